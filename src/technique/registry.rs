//! The registry of techniques: it lists them all, finds them by name and dispatches calls to them.

use std::fmt;
use std::sync::{Arc, OnceLock};

use crate::error::{Error, Result};
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::frame::upsampling::Drawn;
use crate::resident::GpuScene;
use crate::resident::surfaces::SurfaceData;
use crate::scene::{Data, Kernel, Mode, Scene, SplatRule, Surface, View};
use crate::technique::declare::draw::{self, Draw as _, Facts, Family, Sample, TechniqueOptions as _};
use crate::technique::declare::{self, OptionInfo};
use crate::technique::grid::{raycast, slabs, slices_2d, slices_3d};
use crate::technique::mesh::{abuffer, havs, projected_tets};
use crate::technique::shear_warp;
use crate::technique::splat::{ewa, gaussians, sheets};

/// Declares the enums of techniques, and the functions that depend on the type of their options.
macro_rules! techniques {
    ($($(#[$doc:meta])* $technique:ident($options:ty),)*) => {
        /// The identifier of a technique.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        pub enum Method { $($(#[$doc])* $technique,)* }

        /// A technique with its options.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[non_exhaustive]
        pub enum Technique { $($(#[$doc])* $technique($options),)* }

        impl Method {
            /// Every technique.
            pub const ALL: [Self; [$(stringify!($technique)),*].len()] = [$(Self::$technique),*];

            fn facts(self) -> &'static Facts {
                match self { $(Self::$technique => &<$options>::FACTS,)* }
            }

            /// Descriptions of its options.
            #[must_use]
            pub fn options(self) -> &'static [OptionInfo] {
                match self { $(Self::$technique => {
                    static INFOS: OnceLock<Vec<OptionInfo>> = OnceLock::new();
                    INFOS.get_or_init(declare::infos::<$options>)
                })* }
            }
        }

        #[cfg(feature = "io")]
        impl Method {
            /// Returns the JSON Schema of each option, by key.
            pub(crate) fn option_schemas(self) -> serde_json::Map<String, serde_json::Value> {
                match self { $(Self::$technique => declare::option_schemas::<$options>(),)* }
            }
        }

        impl Technique {
            /// Makes a technique with the given options; the others have their defaults.
            ///
            /// # Errors
            ///
            /// [`Error::Invalid`] naming option, value and range.
            pub fn new(method: Method, options: &[(String, String)]) -> Result<Self> {
                Ok(match method { $(Method::$technique => Self::$technique(draw::parse(options)?),)* })
            }

            /// Its identifier.
            #[must_use]
            pub fn method(&self) -> Method {
                match self { $(Self::$technique(_) => Method::$technique,)* }
            }

            /// Its options, as text that reads back to them.
            #[must_use]
            pub fn option_pairs(&self) -> Vec<(&'static str, String)> {
                match self { $(Self::$technique(options) => declare::pairs(options),)* }
            }

            /// Its options that differ from their defaults.
            #[must_use]
            pub fn changed(&self) -> Vec<(&'static str, String)> {
                let infos = self.method().options();
                let is_default =
                    |key: &str, value: &str| infos.iter().any(|info| info.key == key && info.default == value);
                self.option_pairs().into_iter().filter(|(key, value)| !is_default(key, value)).collect()
            }

            /// Returns which pixels are drawn.
            pub(crate) fn drawn(&self) -> Drawn {
                match self { $(Self::$technique(options) => draw::drawn(options),)* }
            }

            /// Checks the options, which a program may have set, and builds the frame of a view.
            fn build(&self, scene: &Arc<GpuScene>, view: &View, target: &Canvas) -> Result<Box<dyn Prepared>> {
                match self { $(Self::$technique(options) => {
                    draw::check(options)?;
                    options.prepare(scene, view, target)
                })* }
            }
        }
    };
}

impl fmt::Display for Technique {
    /// Writes the name, and after a colon the options that differ from their defaults: [`Technique::parse`] reads it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.method().name())?;
        for (i, (key, value)) in self.changed().into_iter().enumerate() {
            write!(f, "{}{key}={value}", if i == 0 { ":" } else { "," })?;
        }
        Ok(())
    }
}

techniques! {
    /// Stacks of 2D-textured slices.
    Slices2d(slices_2d::Options),
    /// View-aligned slices of a 3D texture.
    Slices3d(slices_3d::Options),
    /// Pre-integrated slabs between view-aligned slices.
    Slabs(slabs::Options),
    /// Slices composited in a base plane, which is warped to the image.
    ShearWarp(shear_warp::Options),
    /// Image-order ray casting.
    Raycast(raycast::Options),
    /// Projected tetrahedra.
    ProjectedTets(projected_tets::Options),
    /// Hardware-assisted visibility sorting (HAVS) of a mesh's faces.
    Havs(havs::Options),
    /// A-buffer: lists of the cells of each pixel, sorted.
    Abuffer(abuffer::Options),
    /// Sheet buffers of splats.
    SplatSheets(sheets::Options),
    /// Gaussian splats: elliptical weighted averages, or integrals along each ray.
    SplatEwa(ewa::Options),
    /// Trained Gaussian splats, by the rules that they are trained and shown under.
    Gaussians(gaussians::Options),
}

impl Technique {
    /// Returns the default technique of a scene, with default options.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] if none draws the scene.
    pub fn default_for(scene: &Scene) -> Result<Self> {
        let method = Method::default_for(scene);
        Self::new(method.ok_or_else(|| Error::invalid("scene", "no technique draws it"))?, &[])
    }
}

impl Method {
    /// Finds the technique of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for an unknown name; it lists the known ones.
    pub fn from_name(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|method| method.name()).collect();
            Error::invalid("technique", format!("\"{name}\": must be one of {}", names.join(", ")))
        })
    }

    /// Its name in scene files and on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.facts().name
    }

    /// A description in one line.
    #[must_use]
    pub fn summary(self) -> &'static str {
        self.facts().summary
    }

    /// Authors and year of the paper that describes it.
    #[must_use]
    pub fn source(self) -> &'static str {
        self.facts().source
    }

    /// The kinds of data that it draws, as [`Data::kind`] names them; first the one that it is made for.
    #[must_use]
    pub fn data(self) -> &'static [&'static str] {
        self.facts().data
    }

    /// Whether it draws data of this kind; [`Method::draws_scene`] also considers kernels and surfaces.
    #[must_use]
    pub fn draws(self, data: &Data) -> bool {
        self.data().contains(&data.kind())
    }

    /// Whether it draws a scene: its data, its kernels if it has any, its translucent surfaces and its mode. Techniques with kernels of their own
    /// also draw a scene without kernels, blurred by them.
    #[must_use]
    pub fn draws_scene(self, scene: &Scene) -> bool {
        self.draws(&scene.data)
            && (self.draws_translucent_surfaces() || !scene.surfaces.iter().any(Surface::is_translucent))
            && self.check_mode(scene).is_ok()
            && scene.kernels.is_none_or(|kernels| self.facts().kernels.contains(&kernels.kernel))
    }

    /// Whether it draws the same field of a scene as the reference. A technique with kernels of its own draws another field of a scene
    /// without kernels.
    #[must_use]
    pub fn fits(self, scene: &Scene) -> bool {
        let has_kernels = scene.kernels.is_some() || scene.points().is_some();
        let kernels = self.facts().kernels;
        // A sum of tents is the interpolated field of samples.
        self.draws_scene(scene) && (has_kernels || kernels.is_empty() || kernels.contains(&Kernel::Tent))
    }

    /// Returns whether it draws kernels, which overlap.
    pub(crate) fn overlaps(self) -> bool {
        !self.facts().kernels.is_empty()
    }

    /// Whether it splits rays at translucent surfaces. Other techniques blend whole splats or cells, or rays that several pixels share.
    #[must_use]
    pub fn draws_translucent_surfaces(self) -> bool {
        self.facts().splits_rays
    }

    /// Refuses a scene with translucent surfaces where it cannot draw them.
    pub(crate) fn check_surfaces(self, surfaces: &SurfaceData, data: &Data) -> Result<()> {
        if !surfaces.translucent || self.draws_translucent_surfaces() {
            return Ok(());
        }
        let others =
            Self::ALL.into_iter().filter(|method| method.draws_translucent_surfaces() && method.draws(data));
        let names: Vec<&str> = others.map(Self::name).collect();
        let instead = if names.is_empty() {
            format!("no technique for {} does", data.kind())
        } else {
            format!("{} do", names.join(", "))
        };
        let why = format!("{} draws no translucent surfaces: {instead}", self.name());
        Err(Error::invalid("technique", why))
    }

    /// Refuses a scene of a mode that it does not draw.
    fn check_mode(self, scene: &Scene) -> Result<()> {
        scene.check_mode()?;
        let mode = scene.mode;
        let refuse = |why: String| Err(Error::invalid("technique", why));
        let draws = |method: Self| mode == Mode::Emission || method.facts().modes.contains(&mode.name());
        if !draws(self) {
            let others: Vec<&str> = Self::ALL.into_iter().filter(|&m| draws(m)).map(Self::name).collect();
            return refuse(format!(
                "{} does not draw mode {}: {} do",
                self.name(),
                mode.name(),
                others.join(", ")
            ));
        }
        if mode == Mode::Maximum && scene.surfaces.iter().any(Surface::is_translucent) {
            return refuse("mode maximum has no translucent surfaces; opaque ones are drawn".to_string());
        }
        Ok(())
    }

    /// The default technique of a scene; `None` where no technique draws it.
    #[must_use]
    pub fn default_for(scene: &Scene) -> Option<Self> {
        // A technique that draws the kernels of the scene comes first.
        let first = match (&scene.data, &scene.kernels) {
            (Data::Gaussians(_), _) => Self::Gaussians,
            (Data::Points(_), _) | (_, Some(_)) => Self::SplatEwa,
            (Data::Mesh(_), None) => Self::Havs,
            // A slab knows where in it an isosurface lies.
            (Data::Grid(_), None) if matches!(scene.mode, Mode::Lit(_)) => Self::Slabs,
            (Data::Grid(_), None) => Self::Slices3d,
        };
        std::iter::once(first).chain(Self::ALL).find(|method| method.draws_scene(scene))
    }

    /// The names of its routes; a device may lack some.
    #[must_use]
    pub fn routes(self) -> &'static [&'static str] {
        self.facts().routes
    }

    /// Settings, each with the name of a test scene and upper bounds of RMSE and largest error there.
    #[must_use]
    pub fn samples(self) -> &'static [Sample] {
        self.facts().samples
    }

    /// Settings among which one is chosen for a goal.
    pub(crate) fn families(self) -> &'static [Family] {
        self.facts().families
    }
}

impl Technique {
    /// Reads `NAME[:key=value,...]`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming the unknown technique, or the option, its value and the rule.
    pub fn parse(text: &str) -> Result<Self> {
        let (name, rest) = text.split_once(':').unwrap_or((text, ""));
        let method = Method::from_name(name)?;
        let pair = |pair: &str| {
            let (key, value) = pair.split_once('=').ok_or_else(|| {
                Error::invalid(format!("{name} option"), format!("\"{pair}\": must be key=value"))
            })?;
            Ok((key.trim().to_string(), value.trim().to_string()))
        };
        let pairs: Result<Vec<_>> = rest.split(',').filter(|p| !p.trim().is_empty()).map(pair).collect();
        Self::new(method, &pairs?)
    }

    /// Returns the rule of trained splats that its options set in place of the scene's: the truth of its images is that of
    /// [`Scene::with_rule`].
    #[must_use]
    pub fn splat_rule(&self) -> Option<SplatRule> {
        if let Self::Gaussians(options) = self { options.rule } else { None }
    }

    /// Builds the frame of a view; refuses scenes that it does not draw.
    pub(crate) fn prepare(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
    ) -> Result<Box<dyn Prepared>> {
        self.method().check_mode(scene.scene())?;
        if !self.method().draws(&scene.scene().data) {
            let (name, kinds, kind) = (self.method().name(), self.method().data(), scene.scene().data.kind());
            let why = format!("{name}: draws data of the kind {}, not {kind}", kinds.join(" or "));
            return Err(Error::invalid("technique", why));
        }
        if scene.scene().kernels.is_some() && self.method().facts().kernels.is_empty() {
            let linear = if scene.scene().mesh().is_some() { "linear cells" } else { "trilinear grids" };
            let why = format!("{} draws {linear}: the scene has kernels", self.method().name());
            return Err(Error::invalid("technique", why));
        }
        self.build(scene, view, target)
    }
}

impl Default for Technique {
    fn default() -> Self {
        Self::Slices3d(slices_3d::Options::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn techniques_parse_by_name_and_options() {
        let technique = Technique::parse("slices-3d:step=0.5, filter=exact").unwrap();
        assert_eq!(technique.option_pairs()[0], ("step", "0.5".to_string()));
        assert!(Technique::parse("slices-4d").unwrap_err().to_string().contains("slices-3d"));
        assert!(Technique::parse("slices-3d:step").unwrap_err().to_string().contains("key=value"));
    }

    /// Every word of an option is accepted, unless a rule between options names another option; the text of options reads back.
    #[test]
    fn declared_values_are_read_and_printed() {
        for method in Method::ALL {
            for option in method.options() {
                for word in &option.words {
                    let text = format!("{}:{}={word}", method.name(), option.key);
                    let Ok(technique) = Technique::parse(&text) else {
                        assert!(["dither", "route"].contains(&option.key), "{text}");
                        continue;
                    };
                    let pairs: Vec<(String, String)> = technique
                        .option_pairs()
                        .into_iter()
                        .map(|(key, text)| (key.to_string(), text))
                        .collect();
                    assert_eq!(Technique::new(method, &pairs).unwrap(), technique, "{text}: {pairs:?}");
                    // Defaults are left out, as are those that were given.
                    let again = Technique::parse(&technique.to_string()).unwrap();
                    assert_eq!(again.changed(), technique.changed(), "{technique}");
                }
                let error = Technique::parse(&format!("{}:{}=?", method.name(), option.key)).unwrap_err();
                assert!(
                    error.to_string().contains(&format!("option {}: \"?\": must be", option.key)),
                    "{error}"
                );
            }
        }
    }

    #[test]
    fn values_that_a_program_sets_are_checked() {
        use crate::technique::grid::options::{Accumulation, GridOptions};

        let why =
            |grid| draw::check(&raycast::Options { grid, ..Default::default() }).unwrap_err().to_string();
        let usual = raycast::Options::default().grid;
        let step = why(GridOptions { step: f64::NAN, ..usual });
        assert!(step.contains("raycast option step: NaN: must be a number that is positive"), "{step}");
        let target = why(GridOptions { target: Some(Accumulation::Rgba8), ..usual });
        assert!(target.contains("raycast has no such option"), "{target}");
    }
}
