//! The list of formats, and the choice of a reader by content or file name.

use std::path::Path;

use crate::error::{Error, Result};
use crate::io::build::origin::{is_near, too_far};
use crate::io::file::source::Source;
#[cfg(feature = "zarr")]
use crate::io::formats::zarr;
use crate::io::formats::{
    csv, dicom, gaussian, gmsh, metaimage, nifti, npy, nrrd, ply, raw, refused, tiff, vtk_legacy, vtk_xml,
};
use crate::io::options::{ReadOptions, Request};
use crate::io::reader::Reader;
use crate::io::report::{Content, Found};
use crate::scene::{Data, Rescale};

/// All formats, in the order in which they are tried.
static READERS: &[&dyn Reader] = &[
    // Its preamble may be the header of another format, of TIFF for example.
    &dicom::Dicom,
    &nrrd::Nrrd,
    &nifti::Nifti,
    &metaimage::MetaImage,
    &npy::Npy,
    &vtk_xml::VtkXml,
    &vtk_legacy::VtkLegacy,
    &gmsh::Gmsh,
    &gaussian::spz::Spz,
    &gaussian::gltf::Gltf,
    &gaussian::sog::Sog,
    &ply::Ply,
    &csv::Csv,
    &tiff::Tiff,
    #[cfg(feature = "zarr")]
    &zarr::Zarr,
    &gaussian::ksplat::Ksplat,
    &gaussian::splat::Splat,
    &raw::Raw,
];

/// Lists the formats that [`read`](crate::io::read) knows and their file name extensions, in one line.
#[must_use]
pub fn known_formats() -> String {
    let one = |reader: &&dyn Reader| {
        let endings: Vec<String> = reader.extensions().iter().map(|ending| format!(".{ending}")).collect();
        format!("{} ({})", reader.name(), endings.join(", "))
    };
    READERS.iter().map(one).collect::<Vec<_>>().join(", ")
}

pub(crate) fn read_source(source: &Source, request: &Request) -> Result<Found> {
    let known = by_content(source);
    if known.is_none()
        && let Some(refusal) = refused::by_content(source)
    {
        return Err(refusal);
    }
    let Some(reader) = known.or_else(|| by_name(source)) else {
        return Err(refused::by_name(source).unwrap_or_else(|| {
            let packed = "a gzip stream: only NIfTI-1, raw samples, VTK, Gmsh, PLY and CSV are read packed, unpack it \
                          first";
            let unknown = format!(
                "unknown format: known are {}; raw samples need size and type in their name, as \
                 head_256x256x128_int16.raw, in a JSON file beside them, or in a scene file",
                known_formats()
            );
            source.error("content", if source.is_gzip() { packed.to_owned() } else { unknown })
        }));
    };
    checked(source.path(), reader.read(source, request)?, request)
}

/// Checks a result against the options: no selection may be ignored silently. A grid has no kernels, and a format
/// without array names cannot select one.
pub(crate) fn checked(path: &Path, mut loaded: Found, options: &ReadOptions) -> Result<Found> {
    if let Content::Scene(Data::Grid(grid)) = &loaded.data {
        options.check_kernels("a grid").map_err(|error| error.in_file(path))?;
        let Rescale { slope, intercept } = grid.rescale();
        if !grid.range().iter().all(|value| value.is_finite()) {
            let rule = format!("{slope:e} * stored + {intercept:e}: overflows");
            return Err(Error::file(path, "rescale", rule));
        }
        if let Some(corner) = grid.corners().into_iter().find(|corner| !is_near(*corner)) {
            return Err(Error::file(path, "placement", format!("a corner at {}", too_far(corner))));
        }
        if grid.infinite_count() > 0 {
            loaded.report.warnings.push(format!(
                "{} samples are infinite, or beyond f32: they map to the ends of the transfer function",
                grid.infinite_count()
            ));
        }
    }
    if let Content::Scene(data) = &loaded.data {
        options.check_axes(path, data)?;
    }
    if let (Some(array), Content::Scene(_)) = (&options.array, &loaded.data)
        && loaded.report.arrays.is_empty()
        && loaded.report.shown.is_none()
    {
        let rule = "no such array: there is one without a name";
        return Err(Error::file(path, format!("array \"{array}\""), rule));
    }
    Ok(loaded)
}

/// Returns the reader that recognises the content.
pub(crate) fn by_content(source: &Source) -> Option<&'static dyn Reader> {
    READERS.iter().find(|reader| reader.recognises(source)).copied()
}

/// Returns the reader whose file name extensions fit.
pub(crate) fn by_name(source: &Source) -> Option<&'static dyn Reader> {
    let name = source.path().file_name()?.to_string_lossy().to_lowercase();
    let is = |ending: &&str| name.strip_suffix(ending).is_some_and(|stem| stem.ends_with('.'));
    READERS.iter().find(|reader| reader.extensions().iter().any(is)).copied()
}
