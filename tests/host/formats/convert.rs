//! Conversion: all arrays are kept, with their types and numbers, and where they lie.

use std::io::Read as _;
use std::path::Path;

use volraster::io::{
    ArrayInfo, Association, Data, DataFile, Loaded, OutputFormat, ReadOptions, SampleType, read, read_arrays,
    read_arrays_memory, write_arrays,
};
use volraster::scene::{Anatomy, Grid, TetScalars};

use super::support::{Folder, OPTIONS, Sample, assert_refusal, grid};
use super::write::Vtu;
use super::{dicom, gmsh, npy, nrrd, tiff};

fn arrays_of(sample: &Sample, options: &ReadOptions, one: bool) -> volraster::Result<Loaded<DataFile>> {
    let files: Vec<(&str, &[u8])> = sample.files.iter().map(|(n, b)| (n.as_str(), b.as_slice())).collect();
    read_arrays_memory(&files, options, one)
}

fn showing(array: Option<&str>) -> ReadOptions {
    ReadOptions { array: array.map(str::to_owned), ..OPTIONS }
}

/// Writes data under the ending that holds it.
fn written(folder: &Folder, data: &DataFile) -> std::path::PathBuf {
    let paths = ["out.vti", "out.vtr", "out.vtu"].map(|name| folder.path(name));
    paths.into_iter().find(|path| write_arrays(path, data.clone()).is_ok()).unwrap()
}

fn same(a: f64, b: f64) -> bool {
    a == b || a.is_nan() && b.is_nan() || (a - b).abs() <= 1e-6 * a.abs()
}

fn assert_grids(a: &Grid, b: &Grid, what: &str) {
    assert_eq!(a.dims(), b.dims(), "{what}");
    let size = a.index_to_world().to_cols_array().into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    assert!(a.index_to_world().abs_diff_eq(b.index_to_world(), 1e-6 * size), "{what}");
    assert!(a.origin().abs_diff_eq(b.origin(), 1e-6 * (size + a.origin().length())), "{what}");
    for i in 0..a.samples().len() {
        let [a, b] = [a, b].map(|g| g.rescale().slope * g.samples().get(i) + g.rescale().intercept);
        assert!(same(a, b), "{what}: sample {i}: {a} became {b}");
    }
}

/// Every sample of every reader: what is rendered before is rendered after.
#[test]
fn what_is_rendered_is_the_same_after_conversion() {
    let folder = Folder::new();
    let mut count = 0;
    for (format, samples) in super::seeds() {
        for sample in samples {
            let what = format!("{format}: {}", sample.what);
            let before = sample.loaded();
            let Loaded { data, report } =
                arrays_of(&sample, &OPTIONS, false).unwrap_or_else(|e| panic!("{what}: {e}"));
            // Types are those of the file.
            for array in data.arrays() {
                let kind = |own: &&ArrayInfo| own.name == array.name && own.association == array.association;
                let own = report.arrays.iter().find(kind);
                assert!(own.is_none_or(|own| own == array), "{what}: {array}");
            }
            let path = written(&folder, &data);
            // A column of a table may be part of an array now.
            let shown = before.report.shown.as_deref();
            let name = before.report.shown_name();
            let is_kept = shown.is_none()
                || data.arrays().any(|own| own.name == name || name.starts_with(&format!("{}:", own.name)));
            let is_part = matches!(before.data, Data::Points(_)) && !is_kept;
            let after = read(&path, &showing(shown.filter(|_| !is_part)));
            let after = after.unwrap_or_else(|e| panic!("{what}: {e}"));
            match (&before.data, &after.data) {
                (Data::Grid(a), Data::Grid(b)) => assert_grids(a, b, &what),
                (Data::Mesh(a), Data::Mesh(b)) => {
                    assert!(a.points() == b.points() && a.cells() == b.cells(), "{what}");
                    let values = |scalars: &TetScalars| {
                        scalars.values().iter().map(|x| x.to_bits()).collect::<Vec<_>>()
                    };
                    assert_eq!(values(a.scalars()), values(b.scalars()), "{what}");
                }
                (Data::Points(a), Data::Points(b)) => {
                    let values = |points: &volraster::scene::Points| {
                        points.scalars().map(|all| all.iter().map(|x| x.to_bits()).collect::<Vec<_>>())
                    };
                    assert_eq!(a.centres(), b.centres(), "{what}");
                    assert!(is_part || values(a) == values(b), "{what}");
                }
                // VTK has no splats: their centres are points.
                (Data::Gaussians(a), Data::Points(b)) => {
                    assert_eq!(a.len(), b.centres().len(), "{what}");
                    assert_eq!(a.centre(0), b.centres()[0], "{what}");
                }
                _ => panic!("{what}: another kind of data"),
            }
            // A second time, nothing changes.
            let bytes = std::fs::read(&path).unwrap();
            write_arrays(&path, read_arrays(&path, &OPTIONS, false).unwrap().data).unwrap();
            assert!(std::fs::read(&path).unwrap() == bytes, "{what}: not the same when converted again");
            count += 1;
        }
    }
    assert!(count > 150, "{count} samples");
}

// ---------------------------------------------------------------------------------------------------
// All types

/// The extremes of each type, as text and as bytes: `count` numbers.
fn extremes(kind: SampleType, count: usize) -> (String, Vec<u8>) {
    macro_rules! of {
        ($type:ty) => {{
            let all = [<$type>::MAX, <$type>::MIN, 1 as $type, (0.1 * 3.0) as $type];
            let numbers = all.into_iter().cycle().take(count);
            let text = numbers.clone().map(|x| format!("{x:?} ")).collect();
            (text, numbers.flat_map(<$type>::to_le_bytes).collect())
        }};
    }
    match kind {
        SampleType::U8 => of!(u8),
        SampleType::I8 => of!(i8),
        SampleType::U16 => of!(u16),
        SampleType::I16 => of!(i16),
        SampleType::U32 => of!(u32),
        SampleType::I32 => of!(i32),
        SampleType::U64 => of!(u64),
        SampleType::I64 => of!(i64),
        SampleType::F32 => of!(f32),
        SampleType::F64 => of!(f64),
    }
}

fn vtk_name(kind: SampleType) -> String {
    let name = kind.name().to_uppercase();
    name.replace('U', "UInt").replace('F', "Float").replacen(
        'I',
        if name.starts_with('I') { "Int" } else { "I" },
        1,
    )
}

/// Arrays of all types with 1 and 3 components, in an element.
fn section(element: &str, tuples: usize) -> String {
    let mut text = format!("<{element}>");
    for kind in SampleType::ALL {
        for components in [1, 3] {
            text += &format!(
                "<DataArray type=\"{}\" Name=\"{element} {} {components}\" NumberOfComponents=\"{components}\" \
                 format=\"ascii\">{}</DataArray>",
                vtk_name(kind),
                kind.name(),
                extremes(kind, tuples * components).0
            );
        }
    }
    text + &format!("</{element}>")
}

/// Checks that a file has all these arrays.
#[track_caller]
fn assert_all(vtu: &Vtu, element: &str, tuples: usize) {
    for kind in SampleType::ALL {
        for components in [1, 3] {
            let name = format!("{element} {} {components}", kind.name());
            assert_eq!(vtu.arrays[&name], extremes(kind, tuples * components).1, "{name}");
            let kind = vtk_name(kind);
            vtu.has(&format!(
                "<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\""
            ));
        }
    }
}

fn image() -> String {
    format!(
        "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\"><ImageData WholeExtent=\"0 3 0 2 0 2\" \
         Origin=\"-1000 0.1 7\" Spacing=\"0.1 0.7 1e-3\" Direction=\"0 -1 0 1 0 0 0 0 1\"><Piece \
         Extent=\"0 3 0 2 0 2\">{}{}</Piece></ImageData></VTKFile>",
        section("PointData", 36),
        section("CellData", 12)
    )
}

#[test]
fn grids_keep_every_array_of_every_type() {
    let folder = Folder::new();
    let loaded = arrays_of(&Sample::one("", "a.vti", image()), &OPTIONS, false).unwrap();
    assert_eq!(loaded.data.arrays().len(), 40);
    assert!(loaded.data.summary().starts_with("a grid of 4 x 3 x 3 points, point:PointData u8 1 (u8), "));
    assert!(loaded.data.summary().ends_with(", and 20 more"));
    let path = folder.path("out.vti");
    assert!(write_arrays(&path, loaded.data).unwrap().is_empty());
    let vti = Vtu::at(&path);
    vti.has("<VTKFile type=\"ImageData\"")
        .has("<ImageData WholeExtent=\"0 3 0 2 0 2\" Origin=\"-1000.0 0.1 7.0\" ");
    vti.has("Spacing=\"0.1 0.7 0.001\" Direction=\"0.0 -1.0 0.0 1.0 0.0 0.0 0.0 0.0 1.0\">");
    vti.has("<Piece Extent=\"0 3 0 2 0 2\">");
    assert_all(&vti, "PointData", 36);
    assert_all(&vti, "CellData", 12);
    assert_eq!(vti.arrays.len(), 40);
}

/// A hexahedron, a triangle and a vertex.
fn mesh() -> String {
    let numbers = |name: &str, kind: &str, text: &str| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">{text}</DataArray>")
    };
    format!(
        "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><UnstructuredGrid><Piece \
         NumberOfPoints=\"9\" NumberOfCells=\"3\">{}{}<Points><DataArray type=\"Float64\" NumberOfComponents=\"3\" \
         format=\"ascii\">0 0 0 0.1 0 0 0.1 1 0 0 1 0 0 0 1 0.1 0 1 0.1 1 1 0 1 1 5 5 1e-300</DataArray></Points>\
         <Cells>{}{}{}</Cells></Piece></UnstructuredGrid></VTKFile>",
        section("PointData", 9),
        section("CellData", 3),
        numbers("connectivity", "Int64", "0 1 2 3 4 5 6 7 0 1 8 8"),
        numbers("offsets", "Int64", "8 11 12"),
        numbers("types", "UInt8", "12 5 1")
    )
}

#[test]
fn meshes_keep_every_cell_and_every_array() {
    let folder = Folder::new();
    let loaded = arrays_of(&Sample::one("", "a.vtu", mesh()), &OPTIONS, false).unwrap();
    assert!(loaded.data.summary().starts_with("a mesh of 9 points and 3 cells, "));
    let path = folder.path("out.vtu");
    assert!(write_arrays(&path, loaded.data).unwrap().is_empty());
    let vtu = Vtu::at(&path);
    assert_all(&vtu, "PointData", 9);
    assert_all(&vtu, "CellData", 3);
    assert_eq!(vtu.arrays.len(), 44);
    let whole = |name: &str| -> Vec<i64> {
        vtu.arrays[name].as_chunks().0.iter().map(|&bytes| i64::from_le_bytes(bytes)).collect()
    };
    assert_eq!(whole("connectivity"), [0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 8, 8]);
    assert_eq!((whole("offsets"), &vtu.arrays["types"]), (vec![8, 11, 12], &vec![12, 5, 1]));
    assert_eq!(vtu.arrays["Points"][200..208], 5_f64.to_le_bytes());
    assert_eq!(vtu.arrays["Points"][208..], 1e-300_f64.to_le_bytes());
}

#[test]
fn uneven_coordinates_are_kept() {
    let lattice = |x: &str| {
        let axis = |text: &str| format!("<DataArray type=\"Float64\" format=\"ascii\">{text}</DataArray>");
        format!(
            "<VTKFile type=\"RectilinearGrid\" version=\"1.0\" byte_order=\"LittleEndian\"><RectilinearGrid \
             WholeExtent=\"0 3 0 2 0 2\"><Piece Extent=\"0 3 0 2 0 2\">{}{}<Coordinates>{}{}{}</Coordinates></Piece>\
             </RectilinearGrid></VTKFile>",
            section("PointData", 36),
            section("CellData", 12),
            axis(x),
            axis("5 4 3"),
            axis("0 0.1 0.2")
        )
    };
    let folder = Folder::new();
    for (x, uneven) in [("0 1 2 3", false), ("0 1 2.5 1e9", true)] {
        let loaded = arrays_of(&Sample::one("", "a.vtr", lattice(x)), &OPTIONS, false).unwrap();
        assert_eq!(loaded.data.is_uneven(), uneven);
        let [vtr, vti] = ["out.vtr", "out.vti"].map(|name| folder.path(name));
        write_arrays(&vtr, loaded.data.clone()).unwrap();
        let file = Vtu::at(&vtr);
        file.has("<RectilinearGrid WholeExtent=\"0 3 0 2 0 2\">");
        assert_all(&file, "PointData", 36);
        assert_all(&file, "CellData", 12);
        let numbers = |text: &str| {
            text.split(' ').flat_map(|word| word.parse::<f64>().unwrap().to_le_bytes()).collect::<Vec<_>>()
        };
        for (axis, text) in [("x", x), ("y", "5 4 3"), ("z", "0 0.1 0.2")] {
            assert_eq!(file.arrays[axis], numbers(text), "{axis}");
        }
        if uneven {
            let says = ["out.vti", "must end in .vtr: the data is a grid of 4 x 3 x 3"];
            assert_refusal(&write_arrays(&vti, loaded.data).unwrap_err(), &says, x);
        } else {
            write_arrays(&vti, loaded.data).unwrap();
            Vtu::at(&vti)
                .has("Origin=\"0.0 5.0 0.0\" Spacing=\"1.0 1.0 0.1\"")
                .has("0.0 -1.0 0.0 0.0 0.0 1.0\"");
        }
    }
}

// ---------------------------------------------------------------------------------------------------
// One array

/// The numbers of an NRRD file, with its header.
fn nrrd_at(path: &Path) -> (String, Vec<u8>) {
    let bytes = std::fs::read(path).unwrap();
    let begin = bytes.windows(2).position(|pair| pair == b"\n\n").unwrap() + 2;
    let mut numbers = Vec::new();
    flate2::read::GzDecoder::new(&bytes[begin..]).read_to_end(&mut numbers).unwrap();
    (String::from_utf8(bytes[..begin].to_vec()).unwrap(), numbers)
}

/// Writes the only array, or the named one, as NRRD.
#[track_caller]
fn only(sample: &Sample, array: Option<&str>) -> (String, Vec<u8>) {
    let folder = Folder::new();
    let path = folder.path("out.nrrd");
    let loaded = arrays_of(sample, &showing(array), true).unwrap_or_else(|e| panic!("{}: {e}", sample.what));
    write_arrays(&path, loaded.data).unwrap();
    nrrd_at(&path)
}

#[test]
fn one_array_keeps_its_type() {
    let sample = Sample::one("", "a.vti", image());
    let folder = Folder::new();
    for (code, kind) in [
        (2_u8, SampleType::U8),
        (0, SampleType::I8),
        (0, SampleType::U16),
        (4, SampleType::I16),
        (0, SampleType::U32),
        (8, SampleType::I32),
        (0, SampleType::U64),
        (0, SampleType::I64),
        (16, SampleType::F32),
        (64, SampleType::F64),
    ] {
        let name = format!("PointData {} 1", kind.name());
        let bytes = extremes(kind, 36).1;
        let (header, numbers) = only(&sample, Some(&name));
        let word = vtk_name(kind).to_lowercase().replace("float32", "float").replace("float64", "double");
        assert!(header.contains(&format!("type: {word}\ndimension: 3\n")), "{header}");
        assert_eq!(numbers, bytes, "{name}");
        // NIfTI: whole, and packed.
        for (ending, packed) in [("out.nii", false), ("out.nii.gz", true)] {
            let path = folder.path(ending);
            write_arrays(&path, arrays_of(&sample, &showing(Some(&name)), true).unwrap().data).unwrap();
            let mut file = std::fs::read(&path).unwrap();
            if packed {
                let stored = std::mem::take(&mut file);
                flate2::read::GzDecoder::new(&*stored).read_to_end(&mut file).unwrap();
            }
            assert_eq!(file[..4], 348_i32.to_le_bytes());
            assert_eq!(file[40..48], [3, 0, 4, 0, 3, 0, 3, 0]);
            assert!(code == 0 || file[70] == code, "{name}: {}", file[70]);
            assert_eq!(u64::from(file[72]), 8 * kind.bytes());
            assert_eq!(
                (&file[344..352], &file[352..]),
                (b"n+1\0\0\0\0\0".as_slice(), bytes.as_slice()),
                "{name}"
            );
            assert_grids(
                &grid(sample.read(&showing(Some(&name))).unwrap()),
                &grid(read(&path, &OPTIONS).unwrap()),
                &name,
            );
        }
    }
    // Cells are samples at their centres, tuples an axis of their own.
    let (header, numbers) = only(&sample, Some("cell:CellData i64 3"));
    assert_eq!(numbers, extremes(SampleType::I64, 36).1);
    for part in [
        "dimension: 4\n",
        "sizes: 3 3 2 2\n",
        "directions: none (0.0,0.1,0.0) (-0.7,",
        "kinds: vector domain",
    ] {
        assert!(header.contains(part), "{part}: {header}");
    }
    assert!(header.contains("space origin: (-1000.35,0.15000000000000002,7.0005)"), "{header}");
    // A part: the second of 3 components, and the length.
    let (_, numbers) = only(&sample, Some("CellData i32 3:y"));
    let all = extremes(SampleType::I32, 36).1;
    assert_eq!(numbers, all.chunks(12).flat_map(|tuple| &tuple[4..8]).copied().collect::<Vec<_>>());
    let (header, numbers) = only(&sample, Some("CellData u8 3:magnitude"));
    assert!(header.contains("type: float\n"));
    assert_eq!(numbers[..4], (255.0_f32 * 255.0 + 1.0).sqrt().to_le_bytes());
    let (header, _) = only(&sample, Some("CellData i64 3:magnitude"));
    assert!(header.contains("type: double\n"));
}

#[test]
fn several_arrays_are_refused_with_their_names() {
    let sample = Sample::one("", "a.vti", image());
    let says = [
        "a.vti: arrays: the output holds one array: choose it by --only NAME",
        "point:PointData u8 1 (u8), point:PointData u8 3 (u8 x 3), point:PointData i8 1 (i8)",
        "and 20 more",
    ];
    assert_refusal(&arrays_of(&sample, &OPTIONS, true).unwrap_err(), &says, "several");
    let none = image().replace("PointData", "FieldData").replace("CellData", "FieldData");
    let none = arrays_of(&Sample::one("", "a.vti", none), &OPTIONS, true).unwrap_err();
    assert_refusal(&none, &["--only NAME; there are none"], "none");
    let vector = arrays_of(&sample, &showing(Some("PointData u8 3")), true).unwrap().data;
    let folder = Folder::new();
    let error = write_arrays(folder.path("out.nii"), vector).unwrap_err();
    assert_refusal(&error, &["out.nii", "a voxel holds one number", "--only PointData u8 3:0"], "vector");
    let all = arrays_of(&sample, &OPTIONS, false).unwrap().data;
    let error = write_arrays(folder.path("out.nrrd"), all.clone()).unwrap_err();
    assert_refusal(&error, &["out.nrrd", "must be one array"], "all");
    for name in ["out.vtu", "out.vtr"] {
        let error = write_arrays(folder.path(name), all.clone()).unwrap_err();
        assert_refusal(&error, &[name, "must end in .vti, .nrrd, .nii or .nii.gz"], "a grid");
    }
    assert_eq!(std::fs::read_dir(folder.path(".")).unwrap().count(), 0, "nothing is left");
}

#[test]
fn other_formats_keep_their_types_too() {
    let (header, numbers) = only(&npy::fortran_i64(), None);
    assert!(
        header.contains("type: int64\ndimension: 4\n") && header.contains("sizes: 2 4 3 2\n"),
        "{header}"
    );
    let expected: Vec<u8> = (0..48_i64).flat_map(|i| (i64::MAX - i).to_le_bytes()).collect();
    assert_eq!(numbers, expected);
    for (what, kind) in [("i32", "int32"), ("i64", "int64"), ("f64", "double")] {
        let sample = tiff::samples().into_iter().find(|sample| sample.what.contains(what)).unwrap();
        let (header, numbers) = only(&sample, None);
        assert!(header.contains(&format!("type: {kind}\n")), "{what}: {header}");
        assert!(!numbers.is_empty());
    }
    // Views of double precision.
    let sample = gmsh::samples().into_iter().next().unwrap();
    let loaded = arrays_of(&sample, &OPTIONS, false).unwrap();
    assert!(loaded.data.arrays().any(|array| array.kind == SampleType::F64), "{}", loaded.data.summary());
    // A table: numbers of one group are one array, and missing numbers are NaN, which whole numbers lack.
    let table = "x,y,z,id,vx,vy,vz,t\n0,0,0,7,1,2,3,\n1,0,0,-8,4,5,6,0.1\n";
    let loaded = arrays_of(&Sample::one("", "a.csv", table), &OPTIONS, false).unwrap();
    assert_eq!(loaded.data.summary(), "2 points, point:id (i64), point:t (f64), point:v (i64 x 3)");
    let folder = Folder::new();
    write_arrays(folder.path("out.vtu"), loaded.data).unwrap();
    let vtu = Vtu::at(&folder.path("out.vtu"));
    assert_eq!(vtu.arrays["id"], [7_i64, -8].map(i64::to_le_bytes).concat());
    assert_eq!(vtu.arrays["v"], [1_i64, 2, 3, 4, 5, 6].map(i64::to_le_bytes).concat());
    assert_eq!(vtu.arrays["t"], [f64::NAN, 0.1].map(f64::to_le_bytes).concat());
    let large = "x,y,z,id\n0,0,0,9007199254740993\n1,1,1,2\n";
    let loaded = arrays_of(&Sample::one("", "a.csv", large), &OPTIONS, false).unwrap();
    assert!(loaded.report.warnings[0].contains("\"id\": whole numbers beyond 2^53 are rounded"));
}

/// NIfTI keeps the rescale, others hold values; the world of NIfTI is RAS.
#[test]
fn rescales_and_anatomies_are_converted() {
    let folder = Folder::new();
    let header = |slope: f64| {
        format!(
            "ObjectType = Image\nNDims = 3\nDimSize = 4 3 2\nElementType = MET_SHORT\nBinaryDataByteOrderMSB = False\n\
             AnatomicalOrientation = RAI\nElementToIntensityFunctionSlope = {slope}\nOffset = 1 2 3\n\
             ElementSpacing = 0.5 1 2\nElementDataFile = LOCAL\n"
        )
    };
    for (slope, keeps) in [(0.25, true), (0.1, false)] {
        let numbers = (0..24_i16).flat_map(|i| (i * 999).to_le_bytes());
        let bytes: Vec<u8> = header(slope).into_bytes().into_iter().chain(numbers).collect();
        let sample = Sample::one("rescaled", "a.mha", bytes);
        let before = grid(sample.loaded());
        assert_eq!(before.anatomy(), Anatomy::Lps);
        let data = arrays_of(&sample, &OPTIONS, true).unwrap().data;
        let path = folder.path("out.nii");
        let notes = write_arrays(&path, data.clone()).unwrap();
        let after = grid(read(&path, &OPTIONS).unwrap());
        assert_eq!(after.samples() == before.samples(), keeps);
        assert_eq!(notes.is_empty(), keeps, "{notes:?}");
        assert_eq!(after.anatomy(), Anatomy::Ras);
        let turned = glam::DVec3::new(-1.0, -1.0, 1.0);
        assert_eq!(after.origin(), before.origin() * turned);
        assert_eq!(after.index_to_world().y_axis, before.index_to_world().y_axis * turned);
        for i in 0..2 {
            assert!(same(before.value(i, 1, 0), after.value(i, 1, 0)));
        }
        let notes = write_arrays(folder.path("out.vti"), data).unwrap().join("; ");
        for part in
            ["values written as f32: ", "* stored (i16) + 0", "do not say that the world axes are LPS"]
        {
            assert!(notes.contains(part), "{notes}");
        }
        let after = grid(read(folder.path("out.vti"), &OPTIONS).unwrap());
        assert_grids(&before, &after, "values");
    }
    let unknown = nrrd::samples().into_iter().next().unwrap();
    let data = arrays_of(&unknown, &OPTIONS, true).unwrap().data;
    let notes = write_arrays(folder.path("out.nii"), data).unwrap();
    assert!(notes[0].contains("the unknown world axes are written as RAS"), "{notes:?}");
}

#[test]
fn series_keep_stored_numbers_unless_they_are_computed() {
    for sample in dicom::samples() {
        let Loaded { data, report } = arrays_of(&sample, &OPTIONS, true).unwrap();
        let computed =
            report.warnings.iter().any(|text| text.contains("values are computed, as for rendering"));
        let expected = ["uneven", "slope", "slab"].iter().any(|word| sample.what.contains(word));
        assert_eq!(computed, expected, "{}: {}, {:?}", sample.what, data.summary(), report.warnings);
    }
}

#[test]
fn units_of_lengths_are_kept() {
    let folder = Folder::new();
    let head = "NRRD0004\ntype: uchar\ndimension: 3\nspace dimension: 3\nsizes: 2 2 2\nencoding: raw\n";
    let axes = "space directions: (1,0,0) (0,1,0) (0,0,1)\n";
    for (symbol, code) in [("mm", 2), ("um", 3), ("m", 1), ("furlong", 0)] {
        let bytes = format!("{head}{axes}space units: \"{symbol}\" \"{symbol}\" \"{symbol}\"\n\n12345678");
        let data = arrays_of(&Sample::one(symbol, "a.nrrd", bytes), &OPTIONS, true).unwrap().data;
        let [nii, nrrd, vti] = ["out.nii", "out.nrrd", "out.vti"].map(|name| folder.path(name));
        write_arrays(&nii, data).unwrap();
        assert_eq!(std::fs::read(&nii).unwrap()[123], code, "{symbol}");
        write_arrays(&nrrd, read_arrays(&nii, &OPTIONS, true).unwrap().data).unwrap();
        let (header, _) = nrrd_at(&nrrd);
        let line = format!("\nspace units: \"{symbol}\" \"{symbol}\" \"{symbol}\"\n");
        assert_eq!(header.contains(&line), code != 0, "{header}");
        let notes = write_arrays(&vti, read_arrays(&nrrd, &OPTIONS, true).unwrap().data).unwrap();
        let unit = if code == 0 { String::new() } else { format!(" in {symbol}") };
        assert_eq!(notes, [format!("VTK's files do not say that the world axes are RAS{unit}")]);
    }
}

#[test]
fn hidden_samples_are_kept_or_reported() {
    let text = "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\"><ImageData \
        WholeExtent=\"0 1 0 1 0 1\"><Piece Extent=\"0 1 0 1 0 1\"><PointData><DataArray type=\"Int32\" Name=\"a\" \
        format=\"ascii\">1 2 3 4 5 6 7 8</DataArray><DataArray type=\"UInt8\" Name=\"vtkGhostType\" \
        format=\"ascii\">0 2 0 0 2 0 0 0</DataArray></PointData></Piece></ImageData></VTKFile>";
    let sample = Sample::one("hidden", "a.vti", text);
    let all = arrays_of(&sample, &OPTIONS, false).unwrap();
    assert_eq!(all.data.summary(), "a grid of 2 x 2 x 2 points, point:a (i32), point:vtkGhostType (u8)");
    // The flags are no array to choose.
    let one = arrays_of(&sample, &OPTIONS, true).unwrap();
    assert_eq!(one.data.summary(), "a grid of 2 x 2 x 2 points, point:a (i32)");
    assert!(one.report.warnings[0].contains("2 hidden points"), "{:?}", one.report.warnings);
    // A name that occurs twice is one array.
    let twice = text.replace("vtkGhostType", "a");
    let loaded = arrays_of(&Sample::one("twice", "a.vti", twice), &OPTIONS, false).unwrap();
    assert_eq!(loaded.data.arrays().map(|array| array.association).collect::<Vec<_>>(), [Association::Point]);
    let notes = loaded.report.notes.join("; ");
    assert!(notes.contains("another array has the same name"), "{notes}");
}

#[test]
fn names_ask_for_formats() {
    let of = |name: &str| OutputFormat::of(name).ok();
    assert_eq!(of("a.b.VTI"), Some(OutputFormat::Vti));
    assert_eq!(of("a.nii.GZ"), Some(OutputFormat::Nifti { packed: true }));
    assert_eq!((of("a.gz"), of("vti"), of("a.vtk"), of("")), (None, None, None, None));
}
