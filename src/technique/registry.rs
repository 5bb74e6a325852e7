//! The techniques by name, with their options.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::frame::prepared::Prepared;
use crate::frame::target::Canvas;
use crate::resident::GpuScene;
use crate::resident::surfaces::SurfaceData;
use crate::scene::{Data, Kernel, Scene, Surface, View};
use crate::technique::grid::frame::GridFrame;
use crate::technique::grid::technique::GridTechnique;
use crate::technique::grid::{raycast, slabs, slices_2d, slices_3d};
use crate::technique::mesh::{abuffer, havs, projected_tets};
use crate::technique::options::OptionInfo;
use crate::technique::shear_warp;
use crate::technique::splat::{ewa as splat_ewa, sheets as splat_sheets};

/// A technique.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Method {
    /// Stacks of 2D-textured slices.
    Slices2d,
    /// View-aligned slices of a 3D texture.
    Slices3d,
    /// Pre-integrated slabs between view-aligned slices.
    Slabs,
    /// Slices composited in a base plane, and warped to the image.
    ShearWarp,
    /// Image-order ray casting.
    Raycast,
    /// Hardware-assisted visibility sorting of a mesh's faces.
    Havs,
    /// Exact lists of a mesh's cells, sorted pixel by pixel.
    Abuffer,
    /// Projected tetrahedra.
    ProjectedTets,
    /// Sheet buffers of splats.
    SplatSheets,
    /// Gaussian splats: elliptical weighted averages, or exact along each line.
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

    /// The technique of a name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] with the names that there are.
    pub fn from_name(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|method| method.name() == name).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|method| method.name()).collect();
            Error::invalid("technique", format!("\"{name}\": must be one of {}", names.join(", ")))
        })
    }

    /// The name in scene files and on the command line.
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

    /// One line on what it does.
    #[must_use]
    pub fn summary(self) -> &'static str {
        match self {
            Self::Slices2d => "stacks of 2D-textured slices parallel to the base plane, post-classified",
            Self::Slices3d => "view-aligned slices of a 3D texture, post-classified (Cabral 1994)",
            Self::Slabs => "view-aligned slabs, the transfer function integrated across each (Engel 2001)",
            Self::ShearWarp => "slices composited in a base plane, and warped to the image (Lacroute 1994)",
            Self::Raycast => "image-order ray casting, what the others are compared with (Levoy 1988)",
            Self::Havs => "faces of a mesh nearly sorted, put in order by a k-buffer a pixel (Callahan 2005)",
            Self::Abuffer => "cells of a mesh in a list a pixel, sorted: exact (Carpenter 1984)",
            Self::ProjectedTets => {
                "cells of a mesh sorted, projected and integrated one by one (Shirley 1990)"
            }
            Self::SplatSheets => {
                "kernels added up in sheets, the sheets composited (Westover 1990, Mueller 1998)"
            }
            Self::SplatEwa => {
                "Gaussian splats, elliptical weighted averages or exact along lines (Zwicker 2001)"
            }
        }
    }

    /// Its options.
    #[must_use]
    pub fn options(self) -> &'static [OptionInfo] {
        match self {
            Self::Slices2d => slices_2d::OPTIONS,
            Self::Slices3d => slices_3d::OPTIONS,
            Self::Slabs => slabs::OPTIONS,
            Self::ShearWarp => shear_warp::OPTIONS,
            Self::Raycast => raycast::OPTIONS,
            Self::Havs => havs::OPTIONS,
            Self::Abuffer => abuffer::OPTIONS,
            Self::ProjectedTets => projected_tets::OPTIONS,
            Self::SplatSheets => splat_sheets::OPTIONS,
            Self::SplatEwa => splat_ewa::OPTIONS,
        }
    }

    /// Whether it draws data of this kind; [`Method::draws_scene`] asks for kernels, too.
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

    /// Whether it draws a scene: data of this kind, kernels where the scene has such, and translucent surfaces. A scene without kernels
    /// is drawn also by what has kernels of its own, blurred by them.
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

    /// Whether the field that it draws of a scene is the one that the reference draws: what has kernels of its own draws
    /// another of a scene without.
    #[must_use]
    pub fn fits(self, scene: &Scene) -> bool {
        let has_kernels = scene.kernels.is_some() || scene.points().is_some();
        self.draws_scene(scene) && (has_kernels || self != Self::SplatEwa)
    }

    /// Whether lines are cut at translucent surfaces: others blend whole splats or cells, or lines that several pixels share.
    #[must_use]
    pub fn draws_translucent_surfaces(self) -> bool {
        match self {
            Self::Slices2d | Self::Slices3d | Self::Slabs | Self::Raycast | Self::Havs | Self::Abuffer => {
                true
            }
            Self::ShearWarp | Self::ProjectedTets | Self::SplatSheets | Self::SplatEwa => false,
        }
    }

    /// Whether it draws a scene with such surfaces.
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

    /// The technique that draws a scene where none is asked for; `None` where none does.
    #[must_use]
    pub fn default_for(scene: &Scene) -> Option<Self> {
        // Before what draws the scene's data without its kernels.
        let first = match (&scene.data, &scene.kernels) {
            (Data::Points(_), _) | (_, Some(_)) => Self::SplatEwa,
            (Data::Mesh(_), None) => Self::Havs,
            (Data::Grid(_), None) => Self::Slices3d,
        };
        std::iter::once(first).chain(Self::ALL).find(|method| method.draws_scene(scene))
    }

    /// The routes that a device may offer, by name.
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
    /// Slices composited in a base plane, and warped to the image.
    ShearWarp(shear_warp::Options),
    /// Image-order ray casting.
    Raycast(raycast::Options),
    /// Hardware-assisted visibility sorting.
    Havs(havs::Options),
    /// Exact lists of cells.
    Abuffer(abuffer::Options),
    /// Projected tetrahedra.
    ProjectedTets(projected_tets::Options),
    /// Sheet buffers of splats.
    SplatSheets(splat_sheets::Options),
    /// Gaussian splats.
    SplatEwa(splat_ewa::Options),
}

impl Technique {
    /// A technique with the given options; the others have their defaults.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming option, value and range.
    pub fn new(method: Method, options: &[(String, String)]) -> Result<Self> {
        Ok(match method {
            Method::Slices2d => Self::Slices2d(slices_2d::Options::parse(options)?),
            Method::Slices3d => Self::Slices3d(slices_3d::Options::parse(options)?),
            Method::Slabs => Self::Slabs(slabs::Options::parse(options)?),
            Method::ShearWarp => Self::ShearWarp(shear_warp::Options::parse(options)?),
            Method::Raycast => Self::Raycast(raycast::Options::parse(options)?),
            Method::Havs => Self::Havs(havs::Options::parse(options)?),
            Method::Abuffer => Self::Abuffer(abuffer::Options::parse(options)?),
            Method::ProjectedTets => Self::ProjectedTets(projected_tets::Options::parse(options)?),
            Method::SplatSheets => Self::SplatSheets(splat_sheets::Options::parse(options)?),
            Method::SplatEwa => Self::SplatEwa(splat_ewa::Options::parse(options)?),
        })
    }

    /// Reads `NAME[:key=value,...]`.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] naming what is wrong.
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

    /// Which technique it is.
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

    /// Every option in force.
    #[must_use]
    pub fn option_pairs(&self) -> Vec<(&'static str, String)> {
        match self {
            Self::Slices2d(options) => options.pairs(),
            Self::Slices3d(options) => options.pairs(),
            Self::Slabs(options) => options.pairs(),
            Self::ShearWarp(options) => options.pairs(),
            Self::Raycast(options) => options.pairs(),
            Self::Havs(options) => options.pairs(),
            Self::Abuffer(options) => options.pairs(),
            Self::ProjectedTets(options) => options.pairs(),
            Self::SplatSheets(options) => options.pairs(),
            Self::SplatEwa(options) => options.pairs(),
        }
    }

    /// Fixes what a frame needs.
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
