//! The registry of techniques: names, capabilities and options.

use std::collections::HashMap;
use std::sync::{Arc, OnceLock};

use crate::error::{Error, Result};
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::resident::GpuScene;
use crate::resident::surfaces::SurfaceData;
use crate::scene::{Data, Kernel, Scene, Surface, View};
use crate::technique::declare::{self, OptionInfo};
use crate::technique::grid::frame::GridFrame;
use crate::technique::grid::technique::GridTechnique;
use crate::technique::grid::{raycast, slabs, slices_2d, slices_3d};
use crate::technique::mesh::{abuffer, havs, projected_tets};

use crate::technique::shear_warp;
use crate::technique::splat::{ewa as splat_ewa, sheets as splat_sheets};

/// The identifier of a technique.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Method {
    /// Stacks of 2D-textured slices.
    Slices2d,
    /// View-aligned slices of a 3D texture.
    Slices3d,
    /// Pre-integrated slabs between view-aligned slices.
    Slabs,
    /// Slices composited in a base plane, which is warped to the image.
    ShearWarp,
    /// Image-order ray casting.
    Raycast,
    /// Hardware-assisted visibility sorting (HAVS) of a mesh's faces.
    Havs,
    /// A-buffer: lists of the cells of each pixel, sorted.
    Abuffer,
    /// Projected tetrahedra.
    ProjectedTets,
    /// Sheet buffers of splats.
    SplatSheets,
    /// Gaussian splats: elliptical weighted averages, or integrals along each ray.
    SplatEwa,
}

impl Method {
    /// Every technique.
    pub const ALL: [Self; 10] = [
        Self::Slices2d,
        Self::Slices3d,
        Self::Slabs,
        Self::ShearWarp,
        Self::Raycast,
        Self::ProjectedTets,
        Self::Havs,
        Self::Abuffer,
        Self::SplatSheets,
        Self::SplatEwa,
    ];

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
        match self {
            Self::Slices2d => "slices-2d",
            Self::Slices3d => "slices-3d",
            Self::Slabs => "slabs",
            Self::ShearWarp => "shear-warp",
            Self::Raycast => "raycast",
            Self::Havs => "havs",
            Self::Abuffer => "abuffer",
            Self::ProjectedTets => "projected-tets",
            Self::SplatSheets => "splat-sheets",
            Self::SplatEwa => "splat-ewa",
        }
    }

    /// A description in one line.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Slices2d => "stacks of 2D-textured slices parallel to the base plane, post-classified",
            Self::Slices3d => "view-aligned slices of a 3D texture, post-classified (Cabral 1994)",
            Self::Slabs => "view-aligned slabs, the transfer function integrated across each (Engel 2001)",
            Self::ShearWarp => {
                "slices composited in a base plane, which is warped to the image (Lacroute 1994)"
            }
            Self::Raycast => "image-order ray casting, the baseline of the comparison (Levoy 1988)",
            Self::Havs => {
                "faces of a mesh sorted approximately, then exactly by a k-buffer per pixel (Callahan 2005)"
            }
            Self::Abuffer => "cells of a mesh in one list per pixel, sorted exactly (Carpenter 1984)",
            Self::ProjectedTets => {
                "cells of a mesh sorted, projected and integrated one by one (Shirley 1990)"
            }
            Self::SplatSheets => {
                "kernels summed in sheet buffers, which are composited (Westover 1990, Mueller 1998)"
            }
            Self::SplatEwa => {
                "Gaussian splats, elliptical weighted averages or integrals along rays (Zwicker 2001)"
            }
        }
    }

    /// Descriptions of its options.
    #[must_use]
    pub fn options(self) -> &'static [OptionInfo] {
        static INFOS: OnceLock<HashMap<Method, Vec<OptionInfo>>> = OnceLock::new();
        INFOS
            .get_or_init(|| {
                let infos = |method| match method {
                    Self::Slices2d => declare::infos::<slices_2d::Options>(),
                    Self::Slices3d => declare::infos::<slices_3d::Options>(),
                    Self::Slabs => declare::infos::<slabs::Options>(),
                    Self::ShearWarp => declare::infos::<shear_warp::Options>(),
                    Self::Raycast => declare::infos::<raycast::Options>(),
                    Self::Havs => declare::infos::<havs::Options>(),
                    Self::Abuffer => declare::infos::<abuffer::Options>(),
                    Self::ProjectedTets => declare::infos::<projected_tets::Options>(),
                    Self::SplatSheets => declare::infos::<splat_sheets::Options>(),
                    Self::SplatEwa => declare::infos::<splat_ewa::Options>(),
                };
                Self::ALL.into_iter().map(|method| (method, infos(method))).collect()
            })
            .get(&self)
            .map_or(&[], Vec::as_slice)
    }

    /// Whether it draws data of this kind; [`Method::draws_scene`] also considers kernels and surfaces.
    #[must_use]
    pub fn draws(self, data: &Data) -> bool {
        match self {
            Self::Slices2d | Self::Slices3d | Self::Slabs | Self::ShearWarp | Self::Raycast => {
                matches!(data, Data::Grid(_))
            }
            Self::ProjectedTets | Self::Havs | Self::Abuffer => matches!(data, Data::Mesh(_)),
            Self::SplatSheets => matches!(data, Data::Grid(_) | Data::Points(_)),
            Self::SplatEwa => true,
        }
    }

    /// Whether it draws a scene: its data, its kernels if it has any, and its translucent surfaces. Techniques with kernels of their own
    /// also draw a scene without kernels, blurred by them.
    #[must_use]
    pub fn draws_scene(self, scene: &Scene) -> bool {
        self.draws(&scene.data)
            && (self.draws_translucent_surfaces() || !scene.surfaces.iter().any(Surface::is_translucent))
            && match (self, &scene.kernels) {
                (_, None) | (Self::SplatSheets, Some(_)) => true,
                (Self::SplatEwa, Some(kernels)) => kernels.kernel == Kernel::Gaussian,
                _ => false,
            }
    }

    /// Whether it draws the same field of a scene as the reference. A technique with kernels of its own draws another field of a scene
    /// without kernels.
    #[must_use]
    pub fn fits(self, scene: &Scene) -> bool {
        let has_kernels = scene.kernels.is_some() || scene.points().is_some();
        self.draws_scene(scene) && (has_kernels || self != Self::SplatEwa)
    }

    /// Whether it splits rays at translucent surfaces. Other techniques blend whole splats or cells, or rays that several pixels share.
    #[must_use]
    pub fn draws_translucent_surfaces(self) -> bool {
        match self {
            Self::Slices2d | Self::Slices3d | Self::Slabs | Self::Raycast | Self::Havs | Self::Abuffer => {
                true
            }
            Self::ShearWarp | Self::ProjectedTets | Self::SplatSheets | Self::SplatEwa => false,
        }
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

    /// The default technique of a scene; `None` where no technique draws it.
    #[must_use]
    pub fn default_for(scene: &Scene) -> Option<Self> {
        // A technique that draws the kernels of the scene comes first.
        let first = match (&scene.data, &scene.kernels) {
            (Data::Points(_), _) | (_, Some(_)) => Self::SplatEwa,
            (Data::Mesh(_), None) => Self::Havs,
            (Data::Grid(_), None) => Self::Slices3d,
        };
        std::iter::once(first).chain(Self::ALL).find(|method| method.draws_scene(scene))
    }

    /// The names of its routes; a device may lack some.
    #[must_use]
    pub fn routes(self) -> &'static [&'static str] {
        match self {
            Self::Slices2d | Self::Slices3d | Self::Slabs | Self::ShearWarp | Self::ProjectedTets => {
                &["raster", "compute"]
            }
            Self::Havs => &["compute", "interlock", "implementation-ordered"],
            Self::Raycast | Self::Abuffer | Self::SplatSheets | Self::SplatEwa => &["compute"],
        }
    }
}

/// A technique with its options.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Technique {
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
    /// Hardware-assisted visibility sorting.
    Havs(havs::Options),
    /// A-buffer of cells.
    Abuffer(abuffer::Options),
    /// Projected tetrahedra.
    ProjectedTets(projected_tets::Options),
    /// Sheet buffers of splats.
    SplatSheets(splat_sheets::Options),
    /// Gaussian splats.
    SplatEwa(splat_ewa::Options),
}

impl Technique {
    /// Makes a technique with the given options; the others have their defaults.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming option, value and range.
    pub fn new(method: Method, options: &[(String, String)]) -> Result<Self> {
        Ok(match method {
            Method::Slices2d => Self::Slices2d(declare::parse(options)?),
            Method::Slices3d => Self::Slices3d(declare::parse(options)?),
            Method::Slabs => Self::Slabs(declare::parse(options)?),
            Method::ShearWarp => Self::ShearWarp(declare::parse(options)?),
            Method::Raycast => Self::Raycast(declare::parse(options)?),
            Method::Havs => Self::Havs(declare::parse(options)?),
            Method::Abuffer => Self::Abuffer(declare::parse(options)?),
            Method::ProjectedTets => Self::ProjectedTets(declare::parse(options)?),
            Method::SplatSheets => Self::SplatSheets(declare::parse(options)?),
            Method::SplatEwa => Self::SplatEwa(declare::parse(options)?),
        })
    }

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

    /// Its identifier.
    #[must_use]
    pub fn method(&self) -> Method {
        match self {
            Self::Slices2d(_) => Method::Slices2d,
            Self::Slices3d(_) => Method::Slices3d,
            Self::Slabs(_) => Method::Slabs,
            Self::ShearWarp(_) => Method::ShearWarp,
            Self::Raycast(_) => Method::Raycast,
            Self::Havs(_) => Method::Havs,
            Self::Abuffer(_) => Method::Abuffer,
            Self::ProjectedTets(_) => Method::ProjectedTets,
            Self::SplatSheets(_) => Method::SplatSheets,
            Self::SplatEwa(_) => Method::SplatEwa,
        }
    }

    /// Every option in force, as text that reads back to it.
    #[must_use]
    pub fn option_pairs(&self) -> Vec<(&'static str, String)> {
        match self {
            Self::Slices2d(options) => declare::pairs(options),
            Self::Slices3d(options) => declare::pairs(options),
            Self::Slabs(options) => declare::pairs(options),
            Self::ShearWarp(options) => declare::pairs(options),
            Self::Raycast(options) => declare::pairs(options),
            Self::Havs(options) => declare::pairs(options),
            Self::Abuffer(options) => declare::pairs(options),
            Self::ProjectedTets(options) => declare::pairs(options),
            Self::SplatSheets(options) => declare::pairs(options),
            Self::SplatEwa(options) => declare::pairs(options),
        }
    }

    /// Builds the frame of a view; refuses scenes that it does not draw.
    pub(crate) fn prepare(
        &self,
        scene: &Arc<GpuScene>,
        view: &View,
        target: &Canvas,
    ) -> Result<Box<dyn Prepared>> {
        let splats = matches!(self, Self::SplatSheets(_) | Self::SplatEwa(_));
        if splats && !self.method().draws(&scene.scene().data) {
            let (name, kind) = (self.method().name(), scene.scene().data.kind());
            let why = format!("{name} draws grids and points: the scene holds a {kind}");
            return Err(Error::invalid("technique", why));
        }
        if scene.scene().kernels.is_some() && !splats {
            let linear = if scene.scene().mesh().is_some() { "linear cells" } else { "trilinear grids" };
            let why = format!("{} draws {linear}: the scene has kernels", self.method().name());
            return Err(Error::invalid("technique", why));
        }
        match self {
            Self::Slices2d(options) => declare::check(options),
            Self::Slices3d(options) => declare::check(options),
            Self::Slabs(options) => declare::check(options),
            Self::ShearWarp(options) => declare::check(options),
            Self::Raycast(options) => declare::check(options),
            Self::Havs(options) => declare::check(options),
            Self::Abuffer(options) => declare::check(options),
            Self::ProjectedTets(options) => declare::check(options),
            Self::SplatSheets(options) => declare::check(options),
            Self::SplatEwa(options) => declare::check(options),
        }?;
        let grid = |technique: Box<dyn GridTechnique>| -> Result<Box<dyn Prepared>> {
            Ok(Box::new(GridFrame::new(scene, view, target, technique)?))
        };
        match *self {
            Self::Slices2d(options) => grid(Box::new(options)),
            Self::Slices3d(options) => grid(Box::new(options)),
            Self::Slabs(options) => grid(Box::new(options)),
            Self::ShearWarp(options) => {
                Ok(Box::new(shear_warp::ShearFrame::new(scene, view, target, options)?))
            }
            Self::Raycast(options) => grid(Box::new(options)),
            Self::Havs(options) => options.prepare(scene, view, target),
            Self::Abuffer(options) => options.prepare(scene, view, target),
            Self::ProjectedTets(options) => options.prepare(scene, view, target),
            Self::SplatSheets(options) => options.prepare(scene, view, target),
            Self::SplatEwa(options) => options.prepare(scene, view, target),
        }
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
}
