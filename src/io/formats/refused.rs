//! Formats that are recognised but not read: the error names the format and suggests a conversion.

#[cfg(not(feature = "zarr"))]
use std::path::Path;

use crate::error::Error;
use crate::io::file::sample_type::Endian;
use crate::io::file::source::Source;
use crate::num;

/// The name of a format, the suggested conversion, whether a content is certainly of the format, and the file name
/// extensions that identify it if the content does not.
struct Format(&'static str, &'static str, fn(&Source) -> bool, &'static [&'static str]);

const CELLS: &str = "write it as VTK (.vtu) with a program that reads it, such as ParaView";
const SAMPLES: &str = "write the samples as NRRD, NIfTI or MetaImage with a program that reads it";
const PARTICLES: &str = "write the particles as VTK, PLY or CSV";
const SURFACE: &str = "a surface has no inside to draw; a volume needs samples, solid cells or points";
const PICTURE: &str =
    "a single picture is not a volume; a series of them may come as one TIFF file of several pages";
const PACKED: &str = "unpack it and read its contents";
const PIECES: &str = "give one of the files that it names, or write all as one .vtu or .vti";
const ATOMS: &str = "write the atoms as CSV: x, y, z and a radius";
const ARRAY: &str = "write the wanted array as NRRD, NPY or VTK";
const GRID: &str = "write a dense grid as NRRD or NPY";
const ARCHIVE: &str = "unpack it and give the file, or for a series the folder";
const STUDIES: &str = "a DICOMDIR lists studies and holds no samples: give the folder of one series";
#[cfg(not(feature = "zarr"))]
const ZARR: &str = "this build is without the feature `zarr`";

/// The formats, special ones before general ones: EXODUS files are NetCDF or HDF5 files.
static FORMATS: &[Format] = &[
    Format("EXODUS", CELLS, |s| scientific(s, &["exo", "ex2", "exii", "e", "g"]), &["exo", "ex2", "exii"]),
    Format("MINC", SAMPLES, |s| scientific(s, &["mnc"]), &["mnc"]),
    Format("CGNS", CELLS, |s| hdf5(s) && ends(s, &["cgns"]), &["cgns"]),
    Format("HDF5 (or NetCDF-4)", ARRAY, hdf5, &["h5", "hdf5", "he5", "nc4", "vtkhdf", "ims"]),
    Format("NetCDF", "write the wanted variable as NRRD, NPY or VTK", netcdf, &["nc", "cdf"]),
    Format("Houdini BGEO", PARTICLES, |s| starts(s, &[b"BgeoV", b"\x7fNSJb", b"scf1"]), &["bgeo", "bgeo.sc"]),
    Format("PLOT3D", CELLS, plot3d, &["p3d", "plot3d"]),
    Format("PDB", ATOMS, pdb, &["pdb", "ent", "cif"]),
    Format("molecular XYZ", ATOMS, molecule, &[]),
    Format("OpenVDB", GRID, |s| starts(s, &[b" BDV\0\0\0\0", b"NanoVDB"]), &["vdb", "nvdb"]),
    Format("XDMF", CELLS, |s| element(s, "Xdmf"), &["xdmf", "xmf"]),
    // The reader of VTK's XML names what it does not take.
    Format(
        "parallel or multi-block VTK",
        PIECES,
        |_| false,
        &["pvtu", "pvti", "pvtp", "pvtr", "pvts", "vtm", "vtmb", "vtpd", "vtpc", "pvd", "pvtk"],
    ),
    Format("Analyze 7.5", "write it as NIfTI-1: Analyze does not say which side is left", analyze, &[]),
    Format("MRC / CCP4", SAMPLES, |s| at(s, 208, b"MAP "), &["mrc", "ccp4", "rec"]),
    Format("FITS", SAMPLES, |s| starts(s, &[b"SIMPLE  ="]), &["fits", "fit", "fts"]),
    Format("AmiraMesh", SAMPLES, |s| starts(s, &[b"# AmiraMesh", b"# Avizo"]), &["am"]),
    Format("PVM", SAMPLES, |s| starts(s, &[b"PVM", b"DDS v3"]), &["pvm"]),
    Format("MATLAB", "write the array as NPY or NRRD", |s| starts(s, &[b"MATLAB 5.0 MAT-file"]), &["mat"]),
    Format("LAS", PARTICLES, |s| starts(s, &[b"LASF"]), &["las", "laz"]),
    Format("PCD", PARTICLES, |s| starts(s, &[b"# .PCD"]), &["pcd"]),
    Format("E57", PARTICLES, |s| starts(s, &[b"ASTM-E57"]), &["e57"]),
    Format("LAMMPS", PARTICLES, |s| starts(s, &[b"ITEM: TIMESTEP"]), &["lammpstrj"]),
    Format("EnSight", CELLS, |_| false, &["case"]),
    Format("Tecplot", CELLS, |s| starts(s, &[b"#!TDV", b"#!SZPLT"]), &["plt", "szplt"]),
    Format("STL", SURFACE, stl, &["stl"]),
    Format(
        "OBJ",
        SURFACE,
        |s| ends(s, &["obj"]) && starts(s, &[b"v ", b"#", b"mtllib ", b"o ", b"g "]),
        &["obj"],
    ),
    Format("OFF", SURFACE, |s| starts(s, &[b"OFF\n", b"OFF\r", b"OFF "]), &["off"]),
    Format("PNG", PICTURE, |s| starts(s, &[b"\x89PNG\r\n\x1a\n"]), &["png"]),
    Format(
        "JPEG",
        PICTURE,
        |s| starts(s, &[b"\xff\xd8\xff", b"\0\0\0\x0cjP  \r\n\x87\n"]),
        &["jpg", "jpeg", "jp2"],
    ),
    Format("GIF", PICTURE, |s| starts(s, &[b"GIF87a", b"GIF89a"]), &["gif"]),
    Format("BMP", PICTURE, |_| false, &["bmp"]),
    Format("OpenEXR", PICTURE, |s| starts(s, &[b"\x76\x2f\x31\x01"]), &["exr"]),
    Format(
        "NPZ",
        "unpack it and give one of its .npy files",
        |s| starts(s, ZIP) && ends(s, &["npz"]),
        &["npz"],
    ),
    Format("ZIP", ARCHIVE, |s| starts(s, ZIP), &["zip"]),
    Format("tar", ARCHIVE, |s| at(s, 257, b"ustar"), &["tar", "tgz"]),
    Format("bzip2", PACKED, |s| starts(s, &[b"BZh"]) && at(s, 4, b"1AY&SY"), &["bz2"]),
    Format("xz", PACKED, |s| starts(s, &[b"\xfd7zXZ\0"]), &["xz", "lzma"]),
    Format("zstd", PACKED, |s| starts(s, &[b"\x28\xb5\x2f\xfd"]), &["zst"]),
    Format("LZ4", PACKED, |s| starts(s, &[b"\x04\x22\x4d\x18"]), &["lz4"]),
    Format("7z", PACKED, |s| starts(s, &[b"7z\xbc\xaf\x27\x1c"]), &["7z"]),
    Format("RAR", PACKED, |s| starts(s, &[b"Rar!\x1a\x07"]), &["rar"]),
    Format("DICOMDIR", STUDIES, |s| named(s, "dicomdir") && at(s, 128, b"DICM"), &[]),
    #[cfg(not(feature = "dicom"))]
    Format("DICOM", "this build is without the feature `dicom`", |s| at(s, 128, b"DICM"), &["dcm"]),
    #[cfg(not(feature = "zarr"))]
    Format("Zarr", ZARR, |s| ZARR_FILES.iter().any(|name| named(s, name)), &[]),
];

const ZIP: &[&[u8]] = &[b"PK\x03\x04", b"PK\x05\x06"];
#[cfg(not(feature = "zarr"))]
const ZARR_FILES: [&str; 4] = [".zarray", ".zgroup", ".zattrs", "zarr.json"];

/// Returns the error for a file whose content is of an unsupported format.
pub(crate) fn by_content(source: &Source) -> Option<Error> {
    let Format(name, hint, ..) = FORMATS.iter().find(|Format(_, _, content, _)| content(source))?;
    Some(source.error("content", format!("{name} is not supported: {hint}")))
}

/// Returns the error for a file whose name is that of an unsupported format.
pub(crate) fn by_name(source: &Source) -> Option<Error> {
    let Format(name, hint, ..) = FORMATS.iter().find(|Format(.., endings)| ends(source, endings))?;
    Some(source.error("file name", format!("{name} is not supported: {hint}")))
}

/// Returns the error for a folder that is a data set of an unsupported format.
#[cfg(not(feature = "zarr"))]
pub(crate) fn folder(path: &Path) -> Option<Error> {
    let zarr = path.is_dir() && ZARR_FILES.iter().any(|name| path.join(name).is_file());
    zarr.then(|| Error::file(path, "folder", format!("Zarr is not supported: {ZARR}")))
}

fn starts(source: &Source, magics: &[&[u8]]) -> bool {
    magics.iter().any(|magic| source.head().starts_with(magic))
}

/// Whether the head has these bytes at an offset.
fn at(source: &Source, place: usize, magic: &[u8]) -> bool {
    source.head().get(place..).is_some_and(|rest| rest.starts_with(magic))
}

fn file_name(source: &Source) -> String {
    source.path().file_name().map(|name| name.to_string_lossy().to_lowercase()).unwrap_or_default()
}

fn named(source: &Source, name: &str) -> bool {
    file_name(source) == name
}

/// Whether the file name has one of these extensions, before an optional `.gz`.
fn ends(source: &Source, endings: &[&str]) -> bool {
    let name = file_name(source);
    let plain = name.strip_suffix(".gz").unwrap_or(&name);
    let has = |name: &str, ending: &str| name.strip_suffix(ending).is_some_and(|stem| stem.ends_with('.'));
    endings.iter().any(|ending| has(&name, ending) || has(plain, ending))
}

/// Whether the first 4096 bytes contain a text.
fn holds(source: &Source, text: &str) -> bool {
    source.head().windows(text.len()).any(|window| window == text.as_bytes())
}

/// Whether the file is XML and its head contains an element of this name.
fn element(source: &Source, name: &str) -> bool {
    let head = source.head();
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    head.trim_ascii_start().starts_with(b"<") && holds(source, &format!("<{name}"))
}

/// Whether the file is NetCDF or HDF5 with one of these extensions.
fn scientific(source: &Source, endings: &[&str]) -> bool {
    (netcdf(source) || hdf5(source)) && ends(source, endings)
}

fn hdf5(source: &Source) -> bool {
    starts(source, &[b"\x89HDF\r\n\x1a\n"])
}

/// Recognises the classic format with 32-bit offsets, 64-bit offsets, or 64-bit sizes.
fn netcdf(source: &Source) -> bool {
    starts(source, &[b"CDF\x01", b"CDF\x02", b"CDF\x05"])
}

/// Recognises a header of 348 bytes without the magic of NIfTI.
fn analyze(source: &Source) -> bool {
    let Some(head) = source.head().first_chunk::<348>() else { return false };
    let fits =
        |order: Endian| order.whole(&head[..4]) == 348 && (1..=7).contains(&order.whole(&head[40..42]));
    [Endian::Little, Endian::Big].into_iter().any(fits) && head[344..] == [0; 4]
}

/// Recognises a first record that only PDB files have, or an atom in the columns of the format.
fn pdb(source: &Source) -> bool {
    let head = source.head();
    let line = head.split(|&byte| byte == b'\n').next().unwrap_or_default();
    if line.starts_with(b"HEADER    ") || line.starts_with(b"CRYST1 ") {
        return true;
    }
    let number = |from: usize, to: usize| {
        let text = line.get(from..to).and_then(|text| std::str::from_utf8(text).ok());
        text.is_some_and(|text| text.trim().parse::<f64>().is_ok())
    };
    (line.starts_with(b"ATOM  ") || line.starts_with(b"HETATM"))
        && number(30, 38)
        && number(38, 46)
        && number(46, 54)
}

/// Recognises a number of atoms, a comment line, and an atom: its element or atomic number, and its position.
fn molecule(source: &Source) -> bool {
    let mut lines = source.head().split(|&byte| byte == b'\n');
    let mut line = || lines.next().and_then(|line| std::str::from_utf8(line).ok());
    let (Some(count), Some(_), Some(atom)) = (line(), line(), line()) else { return false };
    let mut words = atom.split_ascii_whitespace();
    let element = words.next().is_some_and(|word| {
        let letter = |c: char| c.is_ascii_alphabetic();
        word.parse::<u8>().is_ok()
            || word.starts_with(letter) && word.chars().all(|c| c.is_ascii_alphanumeric())
    });
    let mut number = || words.next().is_some_and(|word| word.parse::<f64>().is_ok());
    count.trim().parse::<u32>().is_ok() && element && number() && number() && number()
}

/// Recognises text with facets, or a binary file whose size follows from its number of triangles.
fn stl(source: &Source) -> bool {
    if starts(source, &[b"solid"]) && holds(source, "facet normal") {
        return true;
    }
    let count = source.head().get(80..84).map_or(0, |bytes| Endian::Little.whole(bytes));
    !source.is_gzip() && count > 0 && source.len() == 84 + 50 * count
}

/// Recognises PLOT3D by its sizes alone: the extents of one or several grids, then exactly as many numbers as
/// coordinates or solutions need. Numbers are bare or in Fortran records, in either byte order; some files are padded
/// to blocks of 512 bytes.
fn plot3d(source: &Source) -> bool {
    if source.is_gzip() || !ends(source, &["bin", "xyz", "x", "q", "f", "p3d", "grd", "dat"]) {
        return false;
    }
    [Endian::Little, Endian::Big].into_iter().any(|order| {
        let word = |i: usize| source.head().get(4 * i..4 * i + 4).map(|bytes| order.whole(bytes));
        // A Fortran record has its length before and after it.
        [0, 1].into_iter().any(|marker| {
            let one = (marker == 0 || word(0) == Some(12)).then_some((marker, 1));
            let several = (marker == 0 || word(0) == Some(4))
                .then(|| word(marker))
                .flatten()
                .and_then(|count| usize::try_from(count).ok().filter(|count| (1..=256).contains(count)))
                .map(|count| (1 + 3 * marker, count));
            [one, several].into_iter().flatten().any(|(first, grids)| {
                let Some(extents) = (first..).take(grids * 3).map(word).collect::<Option<Vec<u64>>>() else {
                    return false;
                };
                let end = num::wide(first + extents.len() + marker);
                plot3d_sizes(4 * end, num::wide(marker), &extents).is_some_and(|sizes| {
                    sizes.iter().any(|&size| [size, size.next_multiple_of(512)].contains(&source.len()))
                })
            })
        })
    })
}

/// Returns the possible sizes of files with these extents.
fn plot3d_sizes(header: u64, marker: u64, extents: &[u64]) -> Option<Vec<u64>> {
    let mut nodes = 0_u64;
    for grid in extents.chunks_exact(3) {
        if grid.iter().any(|&extent| !(1..=1 << 20).contains(&extent)) {
            return None;
        }
        nodes = nodes.checked_add(grid.iter().product())?;
    }
    if !(8..=1 << 40).contains(&nodes) {
        return None;
    }
    let grids = u64::try_from(extents.len() / 3).ok()?;
    let both = 8 * marker;
    let sizes = [4, 8].into_iter().flat_map(|real| {
        let coordinates = header + grids * both + 3 * real * nodes;
        let solution = header + grids * (2 * both + 4 * real) + 5 * real * nodes;
        [coordinates, coordinates + 4 * nodes, solution]
    });
    Some(sizes.collect())
}
