//! Formats that are known by name only: each is refused by its name, with what to do instead.

use volraster::io::{known_formats, read, read_memory};

use super::support::{self, OPTIONS, Sample, gzip};

/// Reads a file in memory that must be refused with these parts.
#[track_caller]
fn refused(name: &str, bytes: impl Into<Vec<u8>>, parts: &[&str]) {
    Sample::one("refused", name, bytes).refused(&[&[name, "is not supported: "], parts].concat());
}

/// Bytes with some at a place.
fn at(place: usize, bytes: &[u8], len: usize) -> Vec<u8> {
    let mut all = vec![0; len];
    all[place..place + bytes.len()].copy_from_slice(bytes);
    all
}

#[test]
fn real_files_are_called_by_their_names() {
    for (name, parts) in [
        ("particles/dam_break_24389.bgeo", ["content: Houdini BGEO", "particles as VTK"]),
        ("particles/lysozyme_2LYZ.pdb", ["content: PDB", "atoms as CSV"]),
        ("unstructured/bluntfin_plot3d/bluntfinxyz.bin", ["content: PLOT3D", ".vtu"]),
        ("unstructured/bluntfin_plot3d/bluntfinq.bin", ["content: PLOT3D", ".vtu"]),
        ("structured/c_elegans_em_tiff_series.zip", ["content: ZIP", "unpack it"]),
    ] {
        let Some(path) = support::shared(name) else { continue };
        let error = read(&path, &OPTIONS).unwrap_err();
        support::assert_refusal(&error, &[name, parts[0], parts[1], "is not supported: "], name);
        // Whatever it is called, save where the name is half of the evidence.
        let bytes = std::fs::read(&path).unwrap();
        let error = read_memory(&[("file.any", &bytes)], &OPTIONS).unwrap_err().to_string();
        assert_eq!(error.contains(parts[0]), !parts[0].contains("PLOT3D"), "{error}");
    }
}

#[test]
fn magic_bytes_decide() {
    let hdf5 = b"\x89HDF\r\n\x1a\n and more".as_slice();
    for (name, bytes, what) in [
        ("a.h5", hdf5, "HDF5"),
        ("a.nc", hdf5, "HDF5"),
        ("a.exo", hdf5, "EXODUS"),
        ("a.mnc", hdf5, "MINC"),
        ("a.cgns", hdf5, "CGNS"),
        ("a.nc", b"CDF\x01....", "NetCDF is"),
        ("a", b"CDF\x02....", "NetCDF is"),
        ("a", b"CDF\x05....", "NetCDF is"),
        ("can.e", b"CDF\x01....", "EXODUS"),
        ("a.any", b"BgeoV\0\0\0\x05", "Houdini BGEO"),
        ("a.any", b"\x7fNSJb", "Houdini BGEO"),
        ("a.any", b" BDV\0\0\0\0", "OpenVDB"),
        ("a.any", b"NanoVDB0", "OpenVDB"),
        ("a.any", b"<?xml version=\"1.0\"?>\n<!DOCTYPE Xdmf>\n<Xdmf Version=\"2.0\">", "XDMF"),
        ("a.any", b"SIMPLE  =                    T", "FITS"),
        ("a.any", b"# AmiraMesh BINARY-LITTLE-ENDIAN 2.1", "AmiraMesh"),
        ("a.any", b"PVM3\n256 256 256\n", "PVM"),
        ("a.any", b"MATLAB 5.0 MAT-file, Platform", "MATLAB"),
        ("a.any", b"LASF\0\0", "LAS"),
        ("a.any", b"# .PCD v0.7", "PCD"),
        ("a.any", b"ASTM-E57", "E57"),
        ("a.any", b"ITEM: TIMESTEP\n0\n", "LAMMPS"),
        ("a.any", b"#!TDV112", "Tecplot"),
        ("a.any", b"solid cube\n facet normal 0 0 1\n", "STL"),
        ("a.obj", b"# made by hand\nv 0 0 0\n", "OBJ"),
        ("a.any", b"OFF\n8 6 0\n", "OFF"),
        ("a.any", b"\x89PNG\r\n\x1a\n", "PNG"),
        ("a.any", b"\xff\xd8\xff\xe0", "JPEG"),
        ("a.any", b"GIF89a", "GIF"),
        ("a.any", b"\x76\x2f\x31\x01", "OpenEXR"),
        ("a.any", b"PK\x03\x04", "ZIP"),
        ("a.npz", b"PK\x03\x04", "NPZ"),
        ("a.any", b"BZh91AY&SY", "bzip2"),
        ("a.any", b"\xfd7zXZ\0", "xz"),
        ("a.any", b"\x28\xb5\x2f\xfd", "zstd"),
        ("a.any", b"\x04\x22\x4d\x18", "LZ4"),
        ("a.any", b"7z\xbc\xaf\x27\x1c", "7z"),
        ("a.any", b"Rar!\x1a\x07\0", "RAR"),
    ] {
        // Where there is a reader of VTK's XML it knows more.
        if !(what.ends_with("VTK") && known_formats().contains(".vtu")) {
            refused(name, bytes, &[&format!("content: {what}")]);
        }
    }
    refused("a.any", at(257, b"ustar", 512), &["tar", "folder"]);
    // Through gzip, which the content is looked at through.
    refused("a.tar.gz", gzip(&at(257, b"ustar", 512)), &["content: tar"]);
    refused("a.bgeo", gzip(b"BgeoV\0\0\0\x05"), &["content: Houdini BGEO"]);
    refused("a.mrc", at(208, b"MAP ", 1024), &["content: MRC"]);
    if !known_formats().contains("DICOM") {
        refused("DICOMDIR", at(128, b"DICM", 200), &["DICOMDIR", "folder of one series"]);
    }
}

#[test]
fn names_decide_where_the_content_says_nothing() {
    for (name, what) in [
        ("a.bgeo.sc", "Houdini BGEO"),
        ("A.BGEO.GZ", "Houdini BGEO"),
        ("a.vdb", "OpenVDB"),
        ("a.xmf", "XDMF"),
        ("a.pvtu", "parallel or multi-block VTK"),
        ("a.vtm", "parallel or multi-block VTK"),
        ("a.pvd", "parallel or multi-block VTK"),
        ("a.pdb", "PDB"),
        ("a.cif", "PDB"),
        ("a.hdf5", "HDF5"),
        ("a.exo", "EXODUS"),
        ("a.case", "EnSight"),
        ("a.bmp", "BMP"),
        ("a.stl", "STL"),
        ("a.obj", "OBJ"),
        ("a.zip", "ZIP"),
        ("a.p3d", "PLOT3D"),
    ] {
        let error = read_memory(&[(name, b"nothing of the kind")], &OPTIONS).unwrap_err();
        support::assert_refusal(&error, &[name, &format!("file name: {what}"), "is not supported: "], name);
    }
    // An ending is a whole one.
    for name in ["pdb", "apdb", "a.pdbx", "zip"] {
        Sample::one("no ending", name, "text").refused(&["unknown format"]);
    }
}

/// A file of PLOT3D has nothing but its sizes to tell it.
#[test]
fn plot3d_is_told_by_its_sizes() {
    let words = |numbers: &[u32], big: bool| -> Vec<u8> {
        numbers.iter().flat_map(|n| if big { n.to_be_bytes() } else { n.to_le_bytes() }).collect()
    };
    let file = |header: &[u32], big: bool, body: usize| [words(header, big), vec![0; body]].concat();
    let n = 4 * 3 * 2;
    let both = n + 2 * 2 * 2;
    for big in [false, true] {
        for (what, bytes) in [
            ("coordinates", file(&[4, 3, 2], big, 12 * n)),
            ("with blanking", file(&[4, 3, 2], big, 16 * n)),
            ("in 64 bits", file(&[4, 3, 2], big, 24 * n)),
            ("a solution", file(&[4, 3, 2], big, 16 + 20 * n)),
            ("a solution in 64 bits", file(&[4, 3, 2], big, 32 + 40 * n)),
            ("two grids", file(&[2, 4, 3, 2, 2, 2, 2], big, 12 * both)),
            ("two solutions", file(&[2, 4, 3, 2, 2, 2, 2], big, 32 + 20 * both)),
            ("records", file(&[12, 4, 3, 2, 12], big, 12 * n + 8)),
            ("records of a solution", file(&[12, 4, 3, 2, 12], big, 16 + 20 * n + 16)),
            ("records of two grids", file(&[4, 2, 4, 24, 4, 3, 2, 2, 2, 2, 24], big, 12 * both + 16)),
        ] {
            refused("grid.bin", bytes.clone(), &["content: PLOT3D"]);
            let mut filled = bytes.clone();
            filled.resize(bytes.len().next_multiple_of(512), 0);
            refused("grid.bin", filled, &["content: PLOT3D"]);
            let longer = [bytes.clone(), vec![0; 1]].concat();
            Sample::one(what, "grid.bin", longer).refused(&["unknown format"]);
            Sample::one(what, "grid.raw", bytes).refused(&["grid.raw: name: no size"]);
        }
    }
    // Extents whose product is beyond every number, none at all, a header that ends early.
    let large = 1 << 20;
    for header in
        [&[large, large, large][..], &[u32::MAX; 3], &[0, 0, 0], &[256], &[256, 1, 1], &[1, 1, 1, 1]]
    {
        for length in [0, 12, 16] {
            Sample::one("hostile", "grid.bin", file(header, false, length)).refused(&["unknown format"]);
        }
    }
}

#[test]
fn analyze_is_told_from_nifti() {
    let header = |big: bool| {
        let mut bytes = vec![0; 348];
        let order = |n: u16| if big { n.to_be_bytes() } else { n.to_le_bytes() };
        bytes[if big { 2..4 } else { 0..2 }].copy_from_slice(&order(348));
        bytes[40..42].copy_from_slice(&order(4));
        bytes
    };
    for big in [false, true] {
        refused("a.hdr", header(big), &["content: Analyze 7.5", "NIfTI"]);
        refused("a.hdr", gzip(&header(big)), &["content: Analyze 7.5"]);
    }
    let nifti = |magic: &[u8]| [&header(false)[..344], magic].concat();
    for magic in [b"n+1\0", b"n+2\0", b"abc\0"] {
        let error = read_memory(&[("a.hdr", &nifti(magic))], &OPTIONS).unwrap_err().to_string();
        assert!(!error.contains("content: Analyze"), "{error}");
    }
}

#[test]
fn atoms_are_found_in_their_columns() {
    let atom = "ATOM      1  N   LYS A   1       3.287  10.092  10.329  1.00  5.89           N";
    refused("a.txt", atom, &["content: PDB"]);
    refused("a.txt", atom.replace("ATOM  ", "HETATM"), &["content: PDB"]);
    for text in ["ATOM  x y z", "ATOMS and molecules", "HEADER,x,y"] {
        Sample::one("no atoms", "a.txt", text).refused(&["unknown format"]);
    }
}

#[test]
fn binary_surfaces_are_found_by_their_size() {
    let stl = |count: u32, triangles: usize| {
        let mut bytes = vec![b' '; 80];
        bytes.extend(count.to_le_bytes());
        bytes.resize(84 + 50 * triangles, 0);
        bytes
    };
    refused("a.any", stl(3, 3), &["content: STL", "no inside"]);
    for bytes in [stl(3, 4), stl(u32::MAX, 3), stl(0, 0)] {
        Sample::one("no surface", "a.any", bytes).refused(&["unknown format"]);
    }
}

#[test]
fn no_head_of_any_length_is_a_panic() {
    let magics: [&[u8]; 8] = [
        b"<VTKFile type=",
        b"<Xdmf",
        b"solid facet normal",
        b"ATOM  ",
        b"HETATM",
        b"\x5c\x01",
        b"\x0c\0\0\0",
        b"",
    ];
    for magic in magics {
        for length in 0..400 {
            for name in ["a.any", "a.bin", "a.q", ".", ""] {
                let mut bytes = magic.to_vec();
                bytes.resize(length, 1);
                let _ = read_memory(&[(name, &bytes)], &OPTIONS);
            }
        }
    }
}

/// Opening a pipe would wait for whoever writes into it.
#[cfg(unix)]
#[test]
fn a_pipe_is_refused_and_not_waited_for() {
    let folder = super::support::Folder::new();
    let path = folder.path("a.nrrd");
    let made = std::process::Command::new("mkfifo").arg(&path).status();
    assert!(made.is_ok_and(|status| status.success()), "mkfifo makes a pipe");
    let error = volraster::io::read(&path, &super::support::OPTIONS).unwrap_err();
    super::support::assert_refusal(&error, &["a.nrrd", "must be a regular file"], "pipe");
}

#[test]
fn molecules_are_told_from_tables() {
    let hint = "molecular XYZ is not supported: write the atoms as CSV: x, y, z and a radius";
    for text in [
        "3\nwater\nO 0 0 0\nH 1 0 0\nH 0 1 0\n",
        "  1 \r\n\r\nNa\t0.5 -1 2e0\r\n",
        "2\n1 2 3\n8 0 0 0 1.5\n1 0 0 1 0.5",
    ] {
        for name in ["a.xyz", "a.xyz.gz", "a.txt"] {
            let bytes = if name.ends_with("gz") { gzip(text.as_bytes()) } else { text.into() };
            Sample::one("molecule", name, bytes).refused(&[name, "content: ", hint]);
        }
    }
    for text in ["O 0 0 0\nH 1 0 0\nH 0 1 0\n", "1 2 3\n4 5 6\n7 8 9 \n"] {
        Sample::one("table", "a.xyz", text).loaded();
    }
}
