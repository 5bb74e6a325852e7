//! Writers: what is written is what was there, and nothing is left of what failed.

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::Path;

use glam::{DMat3, DVec3};
use volraster::io::{Data, read, write_nrrd, write_vtu};
use volraster::scene::{Anatomy, Grid, KernelSize, Points, Rescale, Samples, TetScalars, Tets};

use super::support::{self, Folder, OPTIONS};

// ---------------------------------------------------------------------------------------------------
// NRRD

const DIMS: [u32; 3] = [4, 3, 2];

fn placed(samples: Samples) -> Grid {
    let axes =
        DMat3::from_cols(DVec3::new(0.0, 1.0, 0.0), DVec3::new(-1.0, 0.0, 0.0), DVec3::new(0.0, 0.6, 0.8));
    Grid::new(DIMS, samples)
        .unwrap()
        .with_placement(DVec3::new(0.1, 2.5, 3.0), DVec3::new(-1.5, 1e-7, 1e9), axes)
        .unwrap()
}

/// Writes and reads again.
#[track_caller]
fn again(grid: &Grid) -> (Grid, Option<String>) {
    let folder = Folder::new();
    let path = folder.path("out.nrrd");
    let note = write_nrrd(&path, grid).unwrap();
    (support::grid(read(&path, &OPTIONS).unwrap()), note)
}

#[test]
fn nrrd_keeps_types_samples_and_place() {
    let codes = || (0..24_u8).map(|i| i.wrapping_mul(77));
    let all = [
        Samples::U8(codes().collect()),
        Samples::U16(codes().map(|i| u16::from(i) * 250).collect()),
        Samples::I16(codes().map(|i| i16::from(i) * 100 - 12_000).collect()),
        Samples::F32(codes().map(|i| f32::from(i) / 7.0 - 3.0).collect()),
    ];
    for samples in all {
        let grid = placed(samples);
        let (read, note) = again(&grid);
        assert_eq!((read.samples(), note), (grid.samples(), None));
        assert_eq!((read.dims(), read.origin()), (DIMS, grid.origin()));
        assert!(read.index_to_world().abs_diff_eq(grid.index_to_world(), 1e-15));
        assert_eq!(read.index_to_world().x_axis, grid.index_to_world().x_axis);
    }
}

#[test]
fn nrrd_keeps_what_is_not_finite() {
    let mut values = vec![0.5_f32; 24];
    values[3] = f32::NAN;
    values[5] = f32::INFINITY;
    values[7] = f32::NEG_INFINITY;
    let grid = placed(Samples::F32(values));
    for grid in [grid.clone(), grid.with_rescale(Rescale { slope: -3.0, intercept: 0.1 }).unwrap()] {
        let (read, _) = again(&grid);
        assert_eq!((read.nan_count(), read.infinite_count()), (1, 2));
        assert!(read.value(3, 0, 0).is_nan());
        assert_eq!(read.value(1, 1, 0), grid.value(1, 1, 0));
        assert_eq!(read.value(3, 1, 0), grid.value(3, 1, 0));
    }
}

#[test]
fn nrrd_says_what_the_axes_mean() {
    for anatomy in [Anatomy::Unknown, Anatomy::Ras, Anatomy::Lps, Anatomy::Las] {
        let (read, _) = again(&placed(Samples::U8((0..24).collect())).with_anatomy(anatomy));
        assert_eq!(read.anatomy(), anatomy);
    }
}

#[test]
fn nrrd_holds_values_where_there_is_a_rescale() {
    let codes = Samples::U16((0..24).map(|i| i * 178).collect());
    let wide = Samples::U16((0..24).map(|i| i * 2849).collect());
    let floats = Samples::F32((0..24_u8).map(f32::from).collect());
    for (samples, slope, intercept, kind, note) in [
        (&codes, 1.0, -1024.0, "i16", "as i16: 1 * stored (u16) + -1024"),
        (&codes, -1.0, 4094.0, "u16", "as u16"),
        (&Samples::U8((0..24).collect()), 2.0, 5.0, "u8", "as u8"),
        (&codes, 0.5, -1024.0, "f32", "as f32: 0.5 * stored (u16) + -1024"),
        // One too many for a signed type, and for an unsigned one.
        (&wide, 1.0, -32_768.0, "i16", "as i16"),
        (&wide, 1.0, -32_769.0, "f32", "as f32"),
        (&wide, 1.0, 8.0, "u16", "as u16"),
        (&wide, 1.0, 9.0, "f32", "as f32"),
        // Neighbours would fall together in 32 bits.
        (&codes, 0.001, 1e6, "f64", "as f64"),
        (&codes, 1e36, 0.0, "f64", "as f64"),
        (&floats, 1.0, 0.5, "f32", "as f32"),
        (&floats, 1.0, 1e8, "f64", "as f64"),
    ] {
        let what = format!("{slope} {intercept}");
        let grid = placed(samples.clone()).with_rescale(Rescale { slope, intercept }).unwrap();
        let folder = Folder::new();
        let said = write_nrrd(folder.path("out.nrrd"), &grid).unwrap().unwrap();
        assert!(said.contains(note), "{what}: {said}");
        let bytes = std::fs::read(folder.path("out.nrrd")).unwrap();
        let type_name = match kind {
            "u8" => "type: uint8\n",
            "u16" => "type: uint16\n",
            "i16" => "type: int16\n",
            "f32" => "type: float\n",
            _ => "type: double\n",
        };
        let begin = bytes.windows(2).position(|pair| pair == b"\n\n").unwrap() + 2;
        assert!(String::from_utf8_lossy(&bytes[..begin]).contains(type_name), "{what}");
        // The numbers themselves: what 64-bit floats keep is not to be lost in reading them.
        let mut numbers = Vec::new();
        flate2::read::GzDecoder::new(&bytes[begin..]).read_to_end(&mut numbers).unwrap();
        let number = |i: usize| match kind {
            "u8" => f64::from(numbers[i]),
            "u16" => f64::from(u16::from_le_bytes(numbers[2 * i..][..2].try_into().unwrap())),
            "i16" => f64::from(i16::from_le_bytes(numbers[2 * i..][..2].try_into().unwrap())),
            "f32" => f64::from(f32::from_le_bytes(numbers[4 * i..][..4].try_into().unwrap())),
            _ => f64::from_le_bytes(numbers[8 * i..][..8].try_into().unwrap()),
        };
        for i in 0..24 {
            let value = slope * samples.get(i) + intercept;
            let error = if kind == "f32" { value.abs() * f64::from(f32::EPSILON) } else { 0.0 };
            assert!((number(i) - value).abs() <= error, "{what}: {} instead of {value}", number(i));
        }
    }
}

/// More than one block of the encoder, and a last one that is not full.
#[test]
fn nrrd_of_many_blocks() {
    let count = 70 * 60 * 50;
    let samples =
        Samples::U16((0..count).map(|i: u32| (i.wrapping_mul(2_654_435_761) >> 16) as u16).collect());
    let grid = Grid::new([70, 60, 50], samples).unwrap();
    let (read, _) = again(&grid);
    assert_eq!(read.samples(), grid.samples());
    let rescaled = grid.with_rescale(Rescale { slope: 0.25, intercept: 0.0 }).unwrap();
    let (read, _) = again(&rescaled);
    assert_eq!(read.value(69, 59, 49), rescaled.value(69, 59, 49));
    assert_eq!(read.range(), rescaled.range());
}

/// What other readers of the format expect of a header, to the letter.
#[test]
fn nrrd_header() {
    let folder = Folder::new();
    let grid = placed(Samples::I16((0..24).collect())).with_anatomy(Anatomy::Lps);
    write_nrrd(folder.path("a.nrrd"), &grid).unwrap();
    let bytes = std::fs::read(folder.path("a.nrrd")).unwrap();
    let expected = "NRRD0005\ntype: int16\ndimension: 3\nspace: left-posterior-superior\nsizes: 4 3 2\n\
        space directions: (0.0,0.1,0.0) (-2.5,0.0,0.0) (0.0,1.7999999999999998,2.4000000000000004)\n\
        kinds: domain domain domain\nendian: little\nencoding: gzip\nspace origin: (-1.5,1e-7,1000000000.0)\n\n";
    assert_eq!(String::from_utf8_lossy(&bytes[..expected.len()]), expected);
    assert_eq!(bytes[expected.len()..][..2], [0x1f, 0x8b]);
}

// ---------------------------------------------------------------------------------------------------
// VTU

/// What one of VTK's XML files holds: its header, and the unpacked bytes of its arrays by name.
pub struct Vtu {
    pub header: String,
    pub arrays: BTreeMap<String, Vec<u8>>,
}

impl Vtu {
    /// Writes data and takes the file apart.
    #[track_caller]
    fn of(data: &Data, name: &str) -> Self {
        let folder = Folder::new();
        let path = folder.path("out.vtu");
        write_vtu(&path, data, name).unwrap();
        assert_eq!(std::fs::read_dir(folder.path(".")).unwrap().count(), 1);
        Self::at(&path)
    }

    /// Takes a file apart by the rules of the format.
    #[track_caller]
    pub fn at(path: &Path) -> Self {
        let file = std::fs::read(path).unwrap();
        let begin = file.windows(4).position(|w| w == b"\n   ").unwrap() + 4;
        let begin = begin + file[begin..].windows(4).position(|w| w == b"   _").unwrap() + 4;
        let header = String::from_utf8(file[..begin].to_vec()).unwrap();
        let end = b"\n  </AppendedData>\n</VTKFile>\n";
        assert!(file.ends_with(end));
        let data = &file[begin..file.len() - end.len()];

        let word =
            |at: usize| usize::try_from(u64::from_le_bytes(data[at..at + 8].try_into().unwrap())).unwrap();
        let mut arrays = BTreeMap::new();
        let mut next = 0;
        for element in header.split("<DataArray ").skip(1) {
            let attribute = |key: &str| {
                let (_, rest) = element.split_once(&format!("{key}=\"")).unwrap();
                rest.split_once('"').unwrap().0
            };
            assert_eq!(attribute("format"), "appended");
            let at: usize = attribute("offset").parse().unwrap();
            assert_eq!(at, next, "arrays follow one another");
            let [blocks, whole, last] = [0, 8, 16].map(|i| word(at + i));
            assert!(whole >= 32_768 && last < whole, "{whole} {last}");
            let mut place = at + 24 + 8 * blocks;
            let mut unpacked = Vec::new();
            for block in 0..blocks {
                let size = word(at + 24 + 8 * block);
                let mut bytes = Vec::new();
                flate2::read::ZlibDecoder::new(&data[place..place + size]).read_to_end(&mut bytes).unwrap();
                let short = block + 1 == blocks && last > 0;
                assert_eq!(bytes.len(), if short { last } else { whole });
                unpacked.extend(bytes);
                place += size;
            }
            next = place;
            assert!(arrays.insert(attribute("Name").to_owned(), unpacked).is_none());
        }
        assert_eq!(next, data.len());
        Self { header, arrays }
    }

    fn f32(&self, name: &str) -> Vec<f32> {
        self.arrays[name].as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect()
    }

    fn f64(&self, name: &str) -> Vec<f64> {
        self.arrays[name].as_chunks().0.iter().map(|&b| f64::from_le_bytes(b)).collect()
    }

    fn i64(&self, name: &str) -> Vec<i64> {
        self.arrays[name].as_chunks().0.iter().map(|&b| i64::from_le_bytes(b)).collect()
    }

    #[track_caller]
    pub fn has(&self, part: &str) -> &Self {
        assert!(self.header.contains(part), "no {part} in {}", self.header);
        self
    }
}

fn corners() -> Vec<DVec3> {
    let third = 1.0 / 3.0;
    vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(third, third, 1e-300), DVec3::splat(-1e300), DVec3::NAN]
}

fn mesh(scalars: TetScalars) -> Data {
    Data::Mesh(Tets::new(corners(), vec![[0, 1, 2, 3], [0, 2, 1, 4]], scalars).unwrap().0)
}

#[test]
fn vtu_of_a_mesh() {
    let vtu = Vtu::of(&mesh(TetScalars::Point(vec![0.0, 7.5, -0.0, 1.5, f32::INFINITY, f32::NAN])), "p");
    vtu.has("<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\"")
        .has("byte_order=\"LittleEndian\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\"")
        .has("<Piece NumberOfPoints=\"6\" NumberOfCells=\"2\">")
        .has("<PointData Scalars=\"p\">")
        .has("<CellData>\n      </CellData>")
        .has("<DataArray type=\"Float64\" Name=\"Points\" NumberOfComponents=\"3\"")
        .has("<AppendedData encoding=\"raw\">");
    let flat: Vec<f64> = corners().iter().flat_map(|p| p.to_array()).collect();
    let coordinates = vtu.f64("Points");
    assert!(coordinates[..15] == flat[..15] && coordinates.len() == 18 && coordinates[17].is_nan());
    let bits = |values: &[f32]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&vtu.f32("p")), bits(&[0.0, 7.5, -0.0, 1.5, f32::INFINITY, f32::NAN]));
    let Data::Mesh(tets) = mesh(TetScalars::Cell(vec![3.0, 4.0])) else { panic!() };
    let nodes: Vec<i64> = tets.cells().iter().flatten().map(|&i| i64::from(i)).collect();
    assert_eq!(vtu.i64("connectivity"), nodes);
    assert_eq!(vtu.i64("offsets"), [4, 8]);
    assert_eq!(vtu.arrays["types"], [10, 10]);

    let vtu = Vtu::of(&mesh(TetScalars::Cell(vec![3.0, 4.0])), "q");
    vtu.has("<PointData>\n      </PointData>\n      <CellData Scalars=\"q\">");
    assert_eq!(vtu.f32("q"), [3.0, 4.0]);
}

#[test]
fn vtu_of_points() {
    let centres = corners()[..5].to_vec();
    let plain = Points::new(centres.clone()).unwrap();
    let vtu = Vtu::of(&Data::Points(plain.clone()), "");
    vtu.has("<PointData>\n      </PointData>").has("<Piece NumberOfPoints=\"5\" NumberOfCells=\"5\">");
    assert_eq!(vtu.i64("connectivity"), [0, 1, 2, 3, 4]);
    assert_eq!(vtu.i64("offsets"), [1, 2, 3, 4, 5]);
    assert_eq!(vtu.arrays["types"], [1; 5]);
    assert_eq!(vtu.arrays.len(), 4);

    let with = |size| {
        let points = plain.clone().with_scalars(vec![1.0, 2.0, 3.0, 4.0, f32::NAN]).unwrap();
        let points = points.with_weights(vec![0.5; 5]).unwrap().with_size(size).unwrap();
        Vtu::of(&Data::Points(points), "")
    };
    let vtu = with(KernelSize::Radii(vec![0.1, 0.2, 0.3, 0.4, 0.5]));
    vtu.has("<PointData Scalars=\"scalar\">");
    assert_eq!(vtu.f32("scalar")[..4], [1.0, 2.0, 3.0, 4.0]);
    assert_eq!(vtu.f32("weight"), [0.5; 5]);
    assert_eq!(vtu.f32("radius"), [0.1, 0.2, 0.3, 0.4, 0.5]);
    assert_eq!(with(KernelSize::Radius(0.1)).f64("radius"), [0.1; 5]);
    let vtu = with(KernelSize::Covariances(vec![[1.0, 0.1, 0.2, 2.0, 0.3, 3.0]; 5]));
    vtu.has("Name=\"covariance\" NumberOfComponents=\"9\"");
    assert_eq!(vtu.f32("covariance")[..9], [1.0, 0.1, 0.2, 0.1, 2.0, 0.3, 0.2, 0.3, 3.0]);
}

#[test]
fn vtu_names_are_kept_and_kept_apart() {
    let points = Points::new(corners()[..5].to_vec()).unwrap().with_scalars(vec![1.0; 5]).unwrap();
    let points = points.with_weights(vec![2.0; 5]).unwrap();
    let vtu = Vtu::of(&Data::Points(points), "weight");
    assert_eq!((vtu.f32("weight"), vtu.f32("weight_")), (vec![1.0; 5], vec![2.0; 5]));
    let vtu = Vtu::of(&mesh(TetScalars::Cell(vec![3.0, 4.0])), "a<b> & \"c\"\n\u{1}é");
    vtu.has("<CellData Scalars=\"a&lt;b&gt; &amp; &quot;c&quot;&#10;_é\">");
}

/// A wall of tetrahedra: several blocks of each array, more than are packed together of the largest, and as
/// many coordinates as fill their blocks exactly.
#[test]
fn vtu_of_many_blocks() {
    let columns = 65_520 / 24 * 2;
    let x = |i: usize| f64::from(u32::try_from(i).unwrap());
    let points: Vec<DVec3> =
        (0..columns).map(|i| [0.0, 1.0].map(|y| DVec3::new(x(i / 4), y, x(i % 4)))[i % 2]).collect();
    let mut cells = Vec::new();
    for round in 0..60 {
        for i in 0..u32::try_from(columns).unwrap() - 8 {
            cells.push([i, i + 1, i + 2 + round % 4, i + 5]);
        }
    }
    let scalars = (0..points.len()).map(|i| (i as f32).sin()).collect();
    let (tets, _) = Tets::new(points, cells, TetScalars::Point(scalars)).unwrap();
    assert!(tets.cells().len() * 32 > 65 * 65_536, "{}", tets.cells().len());
    let vtu = Vtu::of(&Data::Mesh(tets.clone()), "s");
    assert_eq!(vtu.arrays["Points"].len() % 65_520, 0);
    assert_eq!(vtu.f32("s"), tets.scalars().values());
    assert_eq!(vtu.f64("Points"), tets.points().iter().flat_map(|p| p.to_array()).collect::<Vec<_>>());
    let nodes: Vec<i64> = tets.cells().iter().flatten().map(|&i| i64::from(i)).collect();
    assert!(vtu.i64("connectivity") == nodes);
    let last = i64::try_from(tets.cells().len()).unwrap() * 4;
    assert_eq!(vtu.i64("offsets").last(), Some(&last));
}

// ---------------------------------------------------------------------------------------------------
// What cannot be written

#[test]
fn what_cannot_be_written_leaves_nothing() {
    let folder = Folder::new();
    let grid = placed(Samples::U8((0..24).collect()));
    let says = |error: volraster::Error, parts: &[&str]| support::assert_refusal(&error, parts, "write");
    let vtu = folder.path("grid.vtu");
    says(
        write_vtu(&vtu, &Data::Grid(grid.clone()), "a").unwrap_err(),
        &["grid.vtu", "holds a mesh or points"],
    );
    let gone = folder.path("gone/out");
    says(write_nrrd(&gone, &grid).unwrap_err(), &["gone/out", "cannot write"]);
    let data = mesh(TetScalars::Cell(vec![3.0, 4.0]));
    says(write_vtu(&gone, &data, "a").unwrap_err(), &["gone/out", "cannot write"]);
    std::fs::create_dir(folder.path("folder")).unwrap();
    says(write_nrrd(folder.path("folder"), &grid).unwrap_err(), &["folder", "file type", "regular file"]);
    says(write_vtu(folder.path("folder"), &data, "a").unwrap_err(), &["folder", "file type", "regular file"]);
    assert_eq!(std::fs::read_dir(folder.path(".")).unwrap().count(), 1);
}
