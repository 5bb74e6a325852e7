//! Formats that are recognised but not read: the error names the format and suggests a conversion.

use std::path::Path;

use crate::error::Error;
use crate::io::file::source::Source;

struct Format {
    name: &'static str,
    /// The suggested conversion.
    hint: &'static str,
    /// Whether the content is certainly of this format.
    content: fn(&Source) -> bool,
    /// File name extensions that identify it if the content does not.
    endings: &'static [&'static str],
}

const CELLS: &str = "write it as VTK (.vtu) with a program that reads it, such as ParaView";
const SAMPLES: &str = "write the samples as NRRD, NIfTI or MetaImage with a program that reads it";
const PARTICLES: &str = "write the particles as VTK, PLY or CSV";
const SURFACE: &str = "a surface has no inside to draw; a volume needs samples, solid cells or points";
const PICTURE: &str =
    "a single picture is not a volume; a series of them may come as one TIFF file of several pages";
const PACKED: &str = "unpack it and read its contents";
const PIECES: &str = "give one of the files that it names, or write all as one .vtu or .vti";

/// The formats, special ones before general ones: EXODUS files are NetCDF or HDF5 files.
static FORMATS: &[Format] = &[
    Format {
        name: "EXODUS",
        hint: CELLS,
        content: |s| (netcdf(s) || hdf5(s)) && ends(s, &["exo", "ex2", "exii", "e", "g"]),
        endings: &["exo", "ex2", "exii"],
    },
    Format {
        name: "MINC",
        hint: SAMPLES,
        content: |s| (netcdf(s) || hdf5(s)) && ends(s, &["mnc"]),
        endings: &["mnc"],
    },
    Format { name: "CGNS", hint: CELLS, content: |s| hdf5(s) && ends(s, &["cgns"]), endings: &["cgns"] },
    Format {
        name: "HDF5 (or NetCDF-4)",
        hint: "write the wanted array as NRRD, NPY or VTK",
        content: hdf5,
        endings: &["h5", "hdf5", "he5", "nc4", "vtkhdf", "ims"],
    },
    Format {
        name: "NetCDF",
        hint: "write the wanted variable as NRRD, NPY or VTK",
        content: netcdf,
        endings: &["nc", "cdf"],
    },
    Format {
        name: "Houdini BGEO",
        hint: PARTICLES,
        content: |s| starts(s, &[b"BgeoV", b"\x7fNSJb", b"scf1"]),
        endings: &["bgeo", "bgeo.gz", "bgeo.sc"],
    },
    Format { name: "PLOT3D", hint: CELLS, content: plot3d, endings: &["p3d", "plot3d"] },
    Format {
        name: "PDB",
        hint: "write the atoms as CSV: x, y, z and a radius",
        content: pdb,
        endings: &["pdb", "ent", "cif"],
    },
    Format {
        name: "molecular XYZ",
        hint: "write the atoms as CSV: x, y, z and a radius",
        content: molecule,
        endings: &[],
    },
    Format {
        name: "OpenVDB",
        hint: "write a dense grid as NRRD or NPY",
        content: |s| starts(s, &[b" BDV\0\0\0\0", b"NanoVDB"]),
        endings: &["vdb", "nvdb"],
    },
    Format { name: "XDMF", hint: CELLS, content: |s| element(s, "Xdmf"), endings: &["xdmf", "xmf"] },
    Format {
        name: "parallel or multi-block VTK",
        hint: PIECES,
        content: |_| false, // the reader of VTK's XML names what it does not take
        endings: &["pvtu", "pvti", "pvtp", "pvtr", "pvts", "vtm", "vtmb", "vtpd", "vtpc", "pvd", "pvtk"],
    },
    Format {
        name: "Analyze 7.5",
        hint: "write it as NIfTI-1: Analyze does not say which side is left",
        content: analyze,
        endings: &[],
    },
    Format {
        name: "MRC / CCP4",
        hint: SAMPLES,
        content: |s| at(s, 208, b"MAP "),
        endings: &["mrc", "ccp4", "rec"],
    },
    Format {
        name: "FITS",
        hint: SAMPLES,
        content: |s| starts(s, &[b"SIMPLE  ="]),
        endings: &["fits", "fit", "fts"],
    },
    Format {
        name: "AmiraMesh",
        hint: SAMPLES,
        content: |s| starts(s, &[b"# AmiraMesh", b"# Avizo"]),
        endings: &["am"],
    },
    Format { name: "PVM", hint: SAMPLES, content: |s| starts(s, &[b"PVM", b"DDS v3"]), endings: &["pvm"] },
    Format {
        name: "MATLAB",
        hint: "write the array as NPY or NRRD",
        content: |s| starts(s, &[b"MATLAB 5.0 MAT-file"]),
        endings: &["mat"],
    },
    Format { name: "LAS", hint: PARTICLES, content: |s| starts(s, &[b"LASF"]), endings: &["las", "laz"] },
    Format { name: "PCD", hint: PARTICLES, content: |s| starts(s, &[b"# .PCD"]), endings: &["pcd"] },
    Format { name: "E57", hint: PARTICLES, content: |s| starts(s, &[b"ASTM-E57"]), endings: &["e57"] },
    Format {
        name: "LAMMPS",
        hint: PARTICLES,
        content: |s| starts(s, &[b"ITEM: TIMESTEP"]),
        endings: &["lammpstrj"],
    },
    Format { name: "EnSight", hint: CELLS, content: |_| false, endings: &["case"] },
    Format {
        name: "Tecplot",
        hint: CELLS,
        content: |s| starts(s, &[b"#!TDV", b"#!SZPLT"]),
        endings: &["plt", "szplt"],
    },
    Format { name: "STL", hint: SURFACE, content: stl, endings: &["stl"] },
    Format {
        name: "OBJ",
        hint: SURFACE,
        content: |s| ends(s, &["obj"]) && starts(s, &[b"v ", b"#", b"mtllib ", b"o ", b"g "]),
        endings: &["obj"],
    },
    Format { name: "glTF", hint: SURFACE, content: |s| starts(s, &[b"glTF"]), endings: &["gltf", "glb"] },
    Format {
        name: "OFF",
        hint: SURFACE,
        content: |s| starts(s, &[b"OFF\n", b"OFF\r", b"OFF "]),
        endings: &["off"],
    },
    Format { name: "PNG", hint: PICTURE, content: |s| starts(s, &[b"\x89PNG\r\n\x1a\n"]), endings: &["png"] },
    Format {
        name: "JPEG",
        hint: PICTURE,
        content: |s| starts(s, &[b"\xff\xd8\xff", b"\0\0\0\x0cjP  \r\n\x87\n"]),
        endings: &["jpg", "jpeg", "jp2"],
    },
    Format { name: "GIF", hint: PICTURE, content: |s| starts(s, &[b"GIF87a", b"GIF89a"]), endings: &["gif"] },
    Format { name: "BMP", hint: PICTURE, content: |_| false, endings: &["bmp"] },
    Format {
        name: "OpenEXR",
        hint: PICTURE,
        content: |s| starts(s, &[b"\x76\x2f\x31\x01"]),
        endings: &["exr"],
    },
    Format {
        name: "NPZ",
        hint: "unpack it and give one of its .npy files",
        content: |s| starts(s, ZIP) && ends(s, &["npz"]),
        endings: &["npz"],
    },
    Format {
        name: "ZIP",
        hint: "unpack it and give the file, or for a series the folder",
        content: |s| starts(s, ZIP),
        endings: &["zip"],
    },
    Format {
        name: "tar",
        hint: "unpack it and give the file, or for a series the folder",
        content: |s| at(s, 257, b"ustar"),
        endings: &["tar", "tgz"],
    },
    Format {
        name: "bzip2",
        hint: PACKED,
        content: |s| starts(s, &[b"BZh"]) && at(s, 4, b"1AY&SY"),
        endings: &["bz2"],
    },
    Format { name: "xz", hint: PACKED, content: |s| starts(s, &[b"\xfd7zXZ\0"]), endings: &["xz", "lzma"] },
    Format { name: "zstd", hint: PACKED, content: |s| starts(s, &[b"\x28\xb5\x2f\xfd"]), endings: &["zst"] },
    Format { name: "LZ4", hint: PACKED, content: |s| starts(s, &[b"\x04\x22\x4d\x18"]), endings: &["lz4"] },
    Format { name: "7z", hint: PACKED, content: |s| starts(s, &[b"7z\xbc\xaf\x27\x1c"]), endings: &["7z"] },
    Format { name: "RAR", hint: PACKED, content: |s| starts(s, &[b"Rar!\x1a\x07"]), endings: &["rar"] },
    Format {
        name: "DICOMDIR",
        hint: "a DICOMDIR lists studies and holds no samples: give the folder of one series",
        content: |s| named(s, "dicomdir") && at(s, 128, b"DICM"),
        endings: &[],
    },
    #[cfg(not(feature = "dicom"))]
    Format {
        name: "DICOM",
        hint: "this build is without the feature `dicom`",
        content: |s| at(s, 128, b"DICM"),
        endings: &["dcm"],
    },
    Format {
        name: "Zarr",
        hint: ZARR,
        content: |s| ZARR_FILES.iter().any(|name| named(s, name)),
        endings: &[],
    },
];

const ZIP: &[&[u8]] = &[b"PK\x03\x04", b"PK\x05\x06"];
const ZARR: &str = "write the array as NRRD, NPY or TIFF";
const ZARR_FILES: [&str; 4] = [".zarray", ".zgroup", ".zattrs", "zarr.json"];

/// Returns the error for a file whose content is of an unsupported format.
pub(crate) fn by_content(source: &Source) -> Option<Error> {
    let format = FORMATS.iter().find(|format| (format.content)(source))?;
    Some(source.error("content", format.text()))
}

/// Returns the error for a file whose name is that of an unsupported format.
pub(crate) fn by_name(source: &Source) -> Option<Error> {
    let format = FORMATS.iter().find(|format| ends(source, format.endings))?;
    Some(source.error("file name", format.text()))
}

/// Returns the error for a folder that is a data set of an unsupported format.
pub(crate) fn folder(path: &Path) -> Option<Error> {
    let zarr = path.is_dir() && ZARR_FILES.iter().any(|name| path.join(name).is_file());
    zarr.then(|| Error::file(path, "folder", format!("Zarr is not supported: {ZARR}")))
}

impl Format {
    fn text(&self) -> String {
        format!("{} is not supported: {}", self.name, self.hint)
    }
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
    let size = [head[0], head[1], head[2], head[3]];
    let dims = |rank: i16| (1..=7).contains(&rank);
    let fits = match (i32::from_le_bytes(size), i32::from_be_bytes(size)) {
        (348, _) => dims(i16::from_le_bytes([head[40], head[41]])),
        (_, 348) => dims(i16::from_be_bytes([head[40], head[41]])),
        _ => false,
    };
    fits && head[344..] == [0; 4]
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
    let count = |head: &[u8]| head.get(80..84).and_then(|bytes| bytes.first_chunk().copied());
    !source.is_gzip()
        && count(source.head())
            .map(|bytes| u64::from(u32::from_le_bytes(bytes)))
            .is_some_and(|count| count > 0 && source.len() == 84 + 50 * count)
}

/// Recognises PLOT3D by its sizes alone: the extents of one or several grids, then exactly as many numbers as
/// coordinates or solutions need. Numbers are bare or in Fortran records, in either byte order; some files are padded
/// to blocks of 512 bytes.
fn plot3d(source: &Source) -> bool {
    if source.is_gzip() || !ends(source, &["bin", "xyz", "x", "q", "f", "p3d", "grd", "dat"]) {
        return false;
    }
    let words: Vec<[u8; 4]> = source.head().as_chunks::<4>().0.to_vec();
    [u32::from_le_bytes, u32::from_be_bytes].into_iter().any(|order| {
        let word = |i: usize| words.get(i).map(|&bytes| u64::from(order(bytes)));
        // A Fortran record has its length before and after it.
        [0, 1].into_iter().any(|marker| {
            let one = (marker == 0 || word(0) == Some(12)).then_some((marker, 1));
            let several = (marker == 0 || word(0) == Some(4))
                .then(|| word(marker))
                .flatten()
                .filter(|count| (1..=256).contains(count))
                .map(|count| (1 + 3 * marker, count));
            [one, several].into_iter().flatten().any(|(first, grids)| {
                let extents = usize::try_from(3 * grids).ok().map(|count| first..first + count);
                let extents = extents.and_then(|range| range.map(word).collect::<Option<Vec<u64>>>());
                let Some(extents) = extents else { return false };
                let end = first + extents.len() + marker;
                plot3d_sizes(
                    4 * u64::try_from(end).unwrap_or(0),
                    u64::try_from(marker).unwrap_or(0),
                    &extents,
                )
                .is_some_and(|sizes| {
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
