//! VTK's XML files: every encoding of one small data set, odd but legal files, hostile ones, and real ones.

use std::fmt::{Display, Write as _};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::{DMat3, DVec3};
use volraster::io::{Data, Endian, Loaded, ReadOptions};
use volraster::scene::{Samples, TetScalars, Tets};

use crate::formats::support::{OPTIONS, Sample, grid, gzip, mesh, points, shared_loaded, stored, zlib};

/// A number of a data array.
trait Number: Copy + Display {
    const NAME: &'static str;
    fn bytes(self, endian: Endian) -> Vec<u8>;
}

macro_rules! numbers {
    ($($type:ty => $name:literal),*) => {
        $(impl Number for $type {
            const NAME: &'static str = $name;
            fn bytes(self, endian: Endian) -> Vec<u8> {
                match endian {
                    Endian::Little => self.to_le_bytes().to_vec(),
                    Endian::Big => self.to_be_bytes().to_vec(),
                }
            }
        })*
    };
}

numbers!(
    i8 => "Int8", u8 => "UInt8", i16 => "Int16", u16 => "UInt16", i32 => "Int32", u32 => "UInt32",
    i64 => "Int64", u64 => "UInt64", f32 => "Float32", f64 => "Float64"
);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Ascii,
    Inline,
    AppendedRaw,
    AppendedBase64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compressor {
    None,
    Zlib,
    Lz4,
    Lzma,
}

/// How a file is written.
#[derive(Clone, Copy, Debug)]
struct Style {
    what: &'static str,
    format: Format,
    compressor: Compressor,
    endian: Endian,
    /// Bytes of a number of a header.
    word: usize,
    /// Bytes of a block.
    block: usize,
}

const fn style(
    what: &'static str,
    format: Format,
    compressor: Compressor,
    endian: Endian,
    word: usize,
    block: usize,
) -> Style {
    Style { what, format, compressor, endian, word, block }
}

/// Blocks of 24 bytes end with most arrays, those of 40 do not.
const STYLES: [Style; 16] = [
    style("ascii", Format::Ascii, Compressor::None, Endian::Little, 4, 24),
    style("inline", Format::Inline, Compressor::None, Endian::Little, 4, 24),
    style("inline big 64", Format::Inline, Compressor::None, Endian::Big, 8, 24),
    style("inline zlib", Format::Inline, Compressor::Zlib, Endian::Little, 4, 24),
    style("inline zlib big 64", Format::Inline, Compressor::Zlib, Endian::Big, 8, 40),
    style("inline lz4", Format::Inline, Compressor::Lz4, Endian::Little, 4, 40),
    style("inline lzma", Format::Inline, Compressor::Lzma, Endian::Little, 8, 72),
    style("raw", Format::AppendedRaw, Compressor::None, Endian::Little, 4, 24),
    style("raw big 64", Format::AppendedRaw, Compressor::None, Endian::Big, 8, 24),
    style("raw zlib", Format::AppendedRaw, Compressor::Zlib, Endian::Little, 8, 40),
    style("raw lz4 big", Format::AppendedRaw, Compressor::Lz4, Endian::Big, 4, 24),
    style("raw lzma", Format::AppendedRaw, Compressor::Lzma, Endian::Little, 4, 4096),
    style("base64", Format::AppendedBase64, Compressor::None, Endian::Little, 4, 24),
    style("base64 64", Format::AppendedBase64, Compressor::None, Endian::Big, 8, 24),
    style("base64 zlib", Format::AppendedBase64, Compressor::Zlib, Endian::Little, 4, 24),
    style("base64 lz4 big 64", Format::AppendedBase64, Compressor::Lz4, Endian::Big, 8, 40),
];

const RAW: Style = STYLES[7];
const ASCII: Style = STYLES[0];

/// An xz stream of stored LZMA2 chunks, whose dictionary has the size of a code.
fn xz(bytes: &[u8], dictionary: u8) -> Vec<u8> {
    let crc = |bytes: &[u8]| {
        let mut crc = flate2::Crc::new();
        crc.update(bytes);
        crc.sum().to_le_bytes()
    };
    let mut out = b"\xfd7zXZ\0\0\0".to_vec();
    out.extend(crc(&[0, 0]));
    let mut block = vec![2, 0, 0x21, 1, dictionary, 0, 0, 0];
    block.extend(crc(&block));
    block.push(1);
    block.extend((u16::try_from(bytes.len()).unwrap() - 1).to_be_bytes());
    block.extend(bytes);
    block.push(0);
    let unpadded = block.len();
    block.resize(unpadded.next_multiple_of(4), 0);
    out.extend(block);
    let number = |mut n: usize| {
        let mut bytes = Vec::new();
        while n >= 128 {
            bytes.push((n % 128) as u8 | 128);
            n /= 128;
        }
        bytes.push(n as u8);
        bytes
    };
    let mut index = vec![0, 1];
    index.extend(number(unpadded));
    index.extend(number(bytes.len()));
    index.resize(index.len().next_multiple_of(4), 0);
    let sum = crc(&index);
    index.extend(sum);
    let mut footer = (u32::try_from(index.len() / 4).unwrap() - 1).to_le_bytes().to_vec();
    footer.extend([0, 0]);
    out.extend(index);
    out.extend(crc(&footer));
    out.extend(footer);
    out.extend(b"YZ");
    out
}

/// Writes the arrays of a file.
struct Writer {
    style: Style,
    appended: Vec<u8>,
}

impl Writer {
    fn new(style: Style) -> Self {
        Self { style, appended: Vec::new() }
    }

    fn header(&self, numbers: &[usize]) -> Vec<u8> {
        let one = |&n: &usize| match self.style.word {
            4 => u32::try_from(n).unwrap().bytes(self.style.endian),
            _ => u64::try_from(n).unwrap().bytes(self.style.endian),
        };
        numbers.iter().flat_map(one).collect()
    }

    /// The stored header and data.
    fn stored(&self, bytes: &[u8]) -> [Vec<u8>; 2] {
        let Style { compressor, block, .. } = self.style;
        if compressor == Compressor::None {
            return [[self.header(&[bytes.len()]), bytes.to_vec()].concat(), Vec::new()];
        }
        let blocks: Vec<Vec<u8>> = bytes
            .chunks(block)
            .map(|block| match compressor {
                Compressor::Zlib => zlib(block),
                Compressor::Lz4 => lz4_flex::block::compress(block),
                _ => xz(block, 0),
            })
            .collect();
        let mut header = vec![blocks.len(), block, bytes.len() % block];
        header.extend(blocks.iter().map(Vec::len));
        [self.header(&header), blocks.concat()]
    }

    fn array<T: Number>(&mut self, attributes: &str, values: &[T]) -> String {
        let begin = format!("<DataArray type=\"{}\" {attributes}", T::NAME);
        let bytes: Vec<u8> = values.iter().flat_map(|n| n.bytes(self.style.endian)).collect();
        let [header, data] = self.stored(&bytes);
        let text = || [STANDARD.encode(&header), STANDARD.encode(&data)].concat();
        let offset = self.appended.len();
        match self.style.format {
            Format::Ascii => {
                let words: Vec<String> = values.iter().map(ToString::to_string).collect();
                return format!("{begin} format=\"ascii\">\n{}\n</DataArray>\n", words.join(" "));
            }
            Format::Inline => return format!("{begin} format=\"binary\">\n  {}\n</DataArray>\n", text()),
            Format::AppendedRaw => self.appended.extend([header, data].concat()),
            Format::AppendedBase64 => self.appended.extend(text().into_bytes()),
        }
        format!("{begin} format=\"appended\" offset=\"{offset}\"/>\n")
    }

    fn finish(self, kind: &str, attributes: &str, content: &str) -> Vec<u8> {
        let Style { format, compressor, endian, word, .. } = self.style;
        let mut text = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"{kind}\" version=\"1.0\" byte_order=\"{endian:?}Endian\" \
             header_type=\"UInt{}\"",
            8 * word
        );
        match compressor {
            Compressor::None => {}
            Compressor::Zlib => text += " compressor=\"vtkZLibDataCompressor\"",
            Compressor::Lz4 => text += " compressor=\"vtkLZ4DataCompressor\"",
            Compressor::Lzma => text += " compressor=\"vtkLZMADataCompressor\"",
        }
        write!(text, ">\n<{kind} {attributes}>\n{content}</{kind}>\n").unwrap();
        let encoding = match format {
            Format::Ascii | Format::Inline => return (text + "</VTKFile>\n").into_bytes(),
            Format::AppendedRaw => "raw",
            Format::AppendedBase64 => "base64",
        };
        write!(text, "<AppendedData encoding=\"{encoding}\">\n   _").unwrap();
        let mut bytes = text.into_bytes();
        bytes.extend(self.appended);
        bytes.extend(b"\n</AppendedData>\n</VTKFile>\n");
        bytes
    }
}

/// Point data of an image of 4 x 3 x 3.
fn density() -> Vec<i16> {
    (0..36).map(|i| i * 731 - 12_000).collect()
}

/// Cell data of the same.
fn heat() -> Vec<f32> {
    (0..12).map(|i: u8| f32::from(i).sin()).collect()
}

fn vti(style: Style) -> Vec<u8> {
    let mut w = Writer::new(style);
    let content = format!(
        "<Piece Extent=\"0 3 0 2 0 2\"><PointData Scalars=\"density\">{}</PointData><CellData>{}</CellData></Piece>",
        w.array("Name=\"density\"", &density()),
        w.array("Name=\"heat\"", &heat())
    );
    w.finish("ImageData", "WholeExtent=\"0 3 0 2 0 2\" Origin=\"1 2 3\" Spacing=\"0.5 1 2\"", &content)
}

/// A hexahedron, a pyramid on it, a wedge and two tetrahedra at its sides.
const PLACES: [f64; 36] = [
    0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 1.0, 1.0, 1.0, 1.0,
    0.0, 1.0, 1.0, 0.5, 0.5, 2.0, 2.0, 0.0, 0.0, 2.0, 1.0, 0.0, 0.5, -1.0, 0.5,
];
const NODES: [i64; 27] = [0, 1, 5, 11, 0, 5, 4, 11, 0, 1, 2, 3, 4, 5, 6, 7, 1, 9, 5, 2, 10, 6, 4, 5, 6, 7, 8];
const ENDS: [i64; 5] = [4, 8, 16, 22, 27];
const TYPES: [u8; 5] = [10, 10, 12, 13, 14];
const STRESS: [f32; 5] = [1.5, 2.5, -3.0, 4.0, 0.25];

/// Three components at each of the 12 points.
fn flow() -> Vec<f64> {
    (0..36).map(|i| f64::from(i % 7) - 2.5).collect()
}

fn pressure() -> Vec<i32> {
    (0..12).map(|i| 100_000 - i * i).collect()
}

fn vtu(style: Style) -> Vec<u8> {
    let mut w = Writer::new(style);
    let piece = piece(&mut w);
    w.finish("UnstructuredGrid", "", &piece)
}

fn piece(w: &mut Writer) -> String {
    format!(
        "<Piece NumberOfPoints=\"12\" NumberOfCells=\"5\">\n<PointData Scalars=\"pressure\">{}{}</PointData>\n\
         <CellData>{}</CellData>\n<Points>{}</Points>\n<Cells>{}{}{}</Cells>\n</Piece>\n",
        w.array("Name=\"flow\" NumberOfComponents=\"3\"", &flow()),
        w.array("Name=\"pressure\"", &pressure()),
        w.array("Name=\"stress\"", &STRESS),
        w.array("Name=\"Points\" NumberOfComponents=\"3\"", &PLACES),
        w.array("Name=\"connectivity\"", &NODES),
        w.array("Name=\"offsets\"", &ENDS),
        w.array("Name=\"types\"", &TYPES)
    )
}

/// A grid of 3 x 3 x 2, whose gaps along x are uneven.
fn vtr(style: Style) -> Vec<u8> {
    let mut w = Writer::new(style);
    let content = format!(
        "<Piece Extent=\"1 3 0 2 5 6\"><PointData>{}</PointData><Coordinates>{}{}{}</Coordinates></Piece>",
        w.array("Name=\"a\"", &(0..18_u8).collect::<Vec<_>>()),
        w.array("Name=\"x\"", &[0.0_f32, 1.0, 3.0]),
        w.array("Name=\"y\"", &[2.0_f64, 1.0, 0.0]),
        w.array("Name=\"z\"", &[-1_i32, 1])
    );
    w.finish("RectilinearGrid", "WholeExtent=\"1 3 0 2 5 6\"", &content)
}

/// An image whose content is given as text.
fn image(whole: &str, content: &str) -> Vec<u8> {
    Writer::new(ASCII).finish("ImageData", &format!("WholeExtent=\"{whole}\""), content)
}

/// A piece of an image with one array of point data, in words.
fn part(extent: [i32; 6], values: &str) -> String {
    let [a, b, c, d, e, f] = extent;
    format!(
        "<Piece Extent=\"{a} {b} {c} {d} {e} {f}\"><PointData><DataArray type=\"UInt8\" Name=\"a\">{values}\
         </DataArray></PointData></Piece>"
    )
}

/// The indices of points as values: x + 10 y + 100 z.
fn indices([a, b, c, d, e, f]: [i32; 6]) -> String {
    let mut words = Vec::new();
    for z in e..=f {
        for y in c..=d {
            words.extend((a..=b).map(|x| (x + 10 * y + 100 * z).to_string()));
        }
    }
    words.join(" ")
}

fn pieces() -> Vec<u8> {
    let own = |extent| part(extent, &indices(extent));
    let empty = "<Piece Extent=\"0 -1 0 -1 0 -1\"/>";
    let content = [own([2, 3, 0, 1, 0, 1]), empty.to_owned(), own([0, 2, 0, 1, 0, 1])].concat();
    image("0 3 0 1 0 1", &content)
}

/// What writers may add, and what must not get in the way.
fn decorated() -> Vec<u8> {
    let values = density();
    let words: Vec<String> = values.iter().map(ToString::to_string).collect();
    let (first, rest) = words.split_at(20);
    let text = format!(
        "\u{feff}<?xml version='1.0' encoding='UTF-8'?>\n<!-- > <VTKFile> & -->\n<?note <x> ?>\n\
         <VTKFile type='ImageData' version='2.2' byte_order='BigEndian'>\n<ImageData WholeExtent='0 3 0 2 0 2'>\n\
         <FieldData><DataArray type='String' Name='TimeValue'><a/><![CDATA[<]]> 1 </DataArray></FieldData>\n\
         <Piece Extent='0 3 0 2 0 2'>\n<PointData Vectors='none' Scalars=''>\n\
         <Array type='String' Name='words' format='ascii'>97 0</Array>\n\
         <DataArray type='Bit' Name='bits' format='ascii'>1 0 1</DataArray>\n\
         <DataArray IdType='1' type='Int16' Name='a &lt;&amp;&#65;' NumberOfComponents='0' RangeMin='' >\n{}\n{}\
         <InformationKey name='L2' location='vtkDataArray' length='1'><Value index='0'> 3 </Value></InformationKey>\n\
         <!-- no numbers -->\n</DataArray >\n</PointData><Other><DataArray/></Other>\n</Piece>\n</ImageData>\n\
         </VTKFile>\n<!-- end -->\n",
        first.join("\t"),
        rest.join("\r\n")
    );
    text.into_bytes()
}

fn cloud(cells: bool) -> Vec<u8> {
    let mut w = Writer::new(RAW);
    let vertices: Vec<i32> = (0..12).collect();
    let ends: Vec<i32> = (1..13).collect();
    let cells = if cells {
        let lists = [w.array("Name=\"connectivity\"", &vertices), w.array("Name=\"offsets\"", &ends)];
        format!("<Cells>{}{}</Cells>", lists.concat(), w.array("Name=\"types\"", &[1_u8; 12]))
    } else {
        String::new()
    };
    let content = format!(
        "<Piece NumberOfPoints=\"12\" NumberOfCells=\"{}\">{cells}<Points>{}</Points><PointData>{}{}</PointData></Piece>",
        if cells.is_empty() { 0 } else { 12 },
        w.array("Name=\"Points\" NumberOfComponents=\"3\"", &PLACES.map(|x| x as f32)),
        w.array("Name=\"id\"", &vertices),
        w.array("Name=\"pressure\"", &pressure())
    );
    w.finish("UnstructuredGrid", "", &content)
}

/// Files of every encoding and branch.
pub fn samples() -> Vec<Sample> {
    let mut all = Vec::new();
    for style in STYLES {
        all.push(Sample::one(style.what, "a.vti", vti(style)));
        all.push(Sample::one(style.what, "a.vtu", vtu(style)));
    }
    all.push(Sample::one("gzip, raw", "a.vtu.gz", gzip(&vtu(RAW))));
    all.push(Sample::one("gzip, words", "a.vti.gz", gzip(&vti(ASCII))));
    all.push(Sample::one("rectilinear", "a.vtr", vtr(RAW)));
    all.push(Sample::one("pieces of an image", "a.vti", pieces()));
    all.push(Sample::one("pieces of cells", "a.vtu", two_pieces(RAW)));
    all.push(Sample::one("decorated", "a.vti", decorated()));
    all.push(Sample::one("vertices", "a.vtu", cloud(true)));
    all.push(Sample::one("points", "a.vtu", cloud(false)));
    all
}

fn two_pieces(style: Style) -> Vec<u8> {
    let mut w = Writer::new(style);
    let first = piece(&mut w);
    let empty = "<Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"/>";
    let shifted: Vec<f64> = PLACES.iter().map(|x| x + 10.0).collect();
    let second = format!(
        "<Piece NumberOfPoints=\"12\" NumberOfCells=\"2\"><CellData>{}</CellData><PointData>{}{}</PointData>\
         <Points>{}</Points><Cells>{}{}{}</Cells></Piece>",
        w.array("Name=\"stress\"", &[7.0_f32, 8.0]),
        w.array("Name=\"pressure\"", &pressure().iter().map(|p| -p).collect::<Vec<_>>()),
        w.array("Name=\"extra\"", &[0_u8; 12]),
        w.array("Name=\"Points\" NumberOfComponents=\"3\"", &shifted),
        w.array("Name=\"types\"", &[10_i32, 10]),
        w.array("Name=\"offsets\"", &[4_u16, 8]),
        w.array("Name=\"connectivity\"", &[0_u8, 1, 5, 11, 0, 5, 4, 11])
    );
    w.finish("UnstructuredGrid", "", &[first, empty.to_owned(), second].concat())
}

fn with(array: &str) -> ReadOptions {
    ReadOptions { array: Some(array.to_owned()), ..OPTIONS }
}

#[track_caller]
fn read(what: &str, name: &str, bytes: Vec<u8>, array: &str) -> Loaded {
    Sample::one("", name, bytes).read(&with(array)).unwrap_or_else(|e| panic!("{what}: {e}"))
}

/// Replaces text that must be there, in bytes.
#[track_caller]
fn replaced(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|window| window == from.as_bytes());
    let at = at.unwrap_or_else(|| panic!("\"{from}\" is not in the file"));
    [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
}

fn volume(mesh: &Tets) -> f64 {
    let place = |i: u32| mesh.points()[i as usize];
    mesh.cells()
        .iter()
        .map(|cell| cell.map(place))
        .map(|[a, b, c, d]| (b - a).cross(c - a).dot(d - a) / 6.0)
        .sum()
}

#[test]
fn all_samples_are_read() {
    for sample in samples() {
        let loaded = sample.loaded();
        assert_eq!(loaded.report.format, "VTK XML", "{}", sample.what);
        assert!(loaded.report.warnings.is_empty(), "{}: {:?}", sample.what, loaded.report.warnings);
    }
}

/// Bare bytes of images stay in their file, and what is read of them is that of the whole; other arrays are read. Both are refused alike.
#[test]
fn bare_images_stay_in_their_file() {
    let on_demand = |array: &str| ReadOptions { on_demand: Some(1), ..with(array) };
    for style in STYLES {
        for (array, dims) in [("density", [4, 3, 3]), ("heat", [3, 2, 2])] {
            let whole = grid(read(style.what, "a.vti", vti(style), array));
            let loaded = Sample::one("", "a.vti", vti(style)).read(&on_demand(array));
            let own = grid(loaded.unwrap_or_else(|error| panic!("{}: {error}", style.what)));
            assert_eq!((own.dims(), own.origin()), (dims, whole.origin()), "{}", style.what);
            let bare = style.format == Format::AppendedRaw && style.compressor == Compressor::None;
            match own.samples() {
                Samples::OnDemand(samples) => {
                    assert!(bare, "{}", style.what);
                    for (first, extent) in [([0; 3], dims), ([1, 1, 0], [2, 1, 2])] {
                        let part = samples.read(first, extent).unwrap();
                        for i in 0..part.len() as u32 {
                            let place = [i % extent[0], i / extent[0] % extent[1], i / extent[0] / extent[1]];
                            let [x, y, z] = [0, 1, 2].map(|axis| first[axis] + place[axis]);
                            assert_eq!(part.get(i as usize), whole.value(x, y, z), "{}", style.what);
                        }
                    }
                }
                samples => assert!(!bare && samples == whole.samples(), "{}", style.what),
            }
        }
    }
    let good = vti(RAW);
    let ghosts = replaced(&good, "Name=\"heat\"", "Name=\"vtkGhostType\"");
    let size = 72_u32.to_le_bytes();
    let at = good.windows(4).position(|word| word == size).unwrap();
    let mut longer = good.clone();
    longer[at] += 1;
    for (what, bytes) in [
        ("another size", longer),
        ("cut off", good[..at + 40].to_vec()),
        ("more after the end", [good.as_slice(), b"<a/>"].concat()),
        ("an offset beyond", replaced(&good, "offset=\"0\"", "offset=\"9999999\"")),
        ("another type", replaced(&good, "\"Int16\"", "\"Int32\"")),
    ] {
        let [error, whole] = [on_demand("density"), with("density")]
            .map(|options| Sample::one("", "a.vti", bytes.clone()).read(&options).unwrap_err().to_string());
        assert_eq!(error, whole, "{what}");
    }
    let hidden = Sample::one("", "a.vti", ghosts).read(&on_demand("density")).unwrap();
    assert!(matches!(grid(hidden).samples(), Samples::OnDemand(_)), "no point is hidden");
}

#[test]
fn every_encoding_of_an_image_gives_the_same_grid() {
    for style in STYLES {
        let loaded = read(style.what, "a.vti", vti(style), "density");
        assert_eq!(loaded.report.arrays.len(), 2);
        assert!(loaded.report.arrays[0].active && !loaded.report.arrays[1].active);
        let own = grid(loaded);
        assert_eq!(own.samples(), &Samples::I16(density()), "{}", style.what);
        assert_eq!((own.dims(), own.origin()), ([4, 3, 3], DVec3::new(1.0, 2.0, 3.0)));
        assert_eq!(own.index_to_world(), DMat3::from_diagonal(DVec3::new(0.5, 1.0, 2.0)));

        let own = grid(read(style.what, "a.vti", vti(style), "heat"));
        assert_eq!(own.samples(), &Samples::F32(heat()), "{}", style.what);
        assert_eq!((own.dims(), own.origin()), ([3, 2, 2], DVec3::new(1.25, 2.5, 4.0)));
    }
}

#[test]
fn every_encoding_of_cells_gives_the_same_mesh() {
    let places: Vec<DVec3> = PLACES.as_chunks::<3>().0.iter().map(|&p| DVec3::from_array(p)).collect();
    let flow = flow();
    for style in STYLES {
        let own = mesh(read(style.what, "a.vtu", vtu(style), "pressure"));
        assert_eq!(own.points()[..12], places[..], "{}", style.what);
        assert!((volume(&own) - 13.0 / 6.0).abs() < 1e-12, "{}: {}", style.what, volume(&own));
        let expected: Vec<f32> = pressure().iter().map(|&p| p as f32).collect();
        assert_eq!(own.scalars().values()[..12], expected[..], "{}", style.what);

        let own = mesh(read(style.what, "a.vtu", vtu(style), "flow:y"));
        let expected: Vec<f32> = flow.iter().skip(1).step_by(3).map(|&x| x as f32).collect();
        assert_eq!(own.scalars().values()[..12], expected[..], "{}", style.what);

        let own = mesh(read(style.what, "a.vtu", vtu(style), "flow"));
        let length = |v: &[f64; 3]| DVec3::from_array(*v).length() as f32;
        let expected: Vec<f32> = flow.as_chunks::<3>().0.iter().map(length).collect();
        assert_eq!(own.scalars().values()[..12], expected[..], "{}", style.what);

        let own = mesh(read(style.what, "a.vtu", vtu(style), "stress"));
        let TetScalars::Cell(values) = own.scalars() else { panic!("{}: cell data", style.what) };
        let mut runs = values.clone();
        runs.dedup();
        assert_eq!(runs, STRESS, "{}", style.what);
        assert_eq!(own.cells()[0], [0, 1, 5, 11], "{}", style.what);
    }
}

#[test]
fn every_type_is_read_in_every_format() {
    fn check<T: Number>(style: Style, values: [T; 8], expected: [f64; 8]) {
        let mut w = Writer::new(style);
        let content = format!(
            "<Piece Extent=\"0 1 0 1 0 1\"><PointData>{}</PointData></Piece>",
            w.array("Name=\"a\"", &values)
        );
        let bytes = w.finish("ImageData", "WholeExtent=\"0 1 0 1 0 1\"", &content);
        let own = grid(read(style.what, "a.vti", bytes, "a"));
        assert_eq!(stored(&own), expected, "{} {}", T::NAME, style.what);
    }
    for style in STYLES {
        check(style, [0_u8, 1, 2, 3, 4, 5, 6, 255], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 255.0]);
        check(style, [0_i8, 1, 2, 3, 4, 5, 127, -128], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 127.0, -128.0]);
        check(style, [0_u16, 1, 2, 3, 4, 5, 6, 65_535], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 65_535.0]);
        check(style, [0_i16, 1, 2, 3, 4, 5, 6, -32_768], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -32_768.0]);
        check(
            style,
            [0_u32, 1, 2, 3, 4, 5, 6, 1 << 31],
            [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 2.0_f64.powi(31)],
        );
        check(style, [0_i32, 1, 2, 3, 4, 5, 6, -70_000], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -70_000.0]);
        check(
            style,
            [0_u64, 1, 2, 3, 4, 5, 6, 1 << 63],
            [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 2.0_f64.powi(63)],
        );
        check(
            style,
            [0_i64, 1, 2, 3, 4, 5, 6, -1 << 40],
            [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -2.0_f64.powi(40)],
        );
        check(
            style,
            [0.0_f32, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -1.5],
            [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, -1.5],
        );
        check(style, [0.0_f64, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1e9], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1e9]);
    }
}

#[test]
fn blocks_that_end_with_the_array() {
    // 72 bytes: three blocks of 24, and no smaller one; or two of 40 and 32.
    for (block, partial) in [(24, 0), (40, 32), (72, 0), (100, 72)] {
        for compressor in [Compressor::Zlib, Compressor::Lz4, Compressor::Lzma] {
            let style = Style { compressor, block, ..RAW };
            let w = Writer::new(style);
            let [header, _] = w.stored(&[7; 72]);
            assert_eq!(header[8..12], u32::try_from(partial).unwrap().to_le_bytes());
            let own = grid(read("blocks", "a.vti", vti(style), "density"));
            assert_eq!(own.samples(), &Samples::I16(density()), "{compressor:?} {block}");
        }
    }
}

#[test]
fn base64_may_hold_blanks_and_padded_headers() {
    let bytes: Vec<u8> = (0..8).collect();
    let file = |text: &str| {
        image(
            "0 1 0 1 0 1",
            &format!(
                "<Piece Extent=\"0 1 0 1 0 1\"><PointData><DataArray type=\"UInt8\" Name=\"a\" format=\"binary\">\
                 {text}</DataArray></PointData></Piece>"
            ),
        )
    };
    let one = STANDARD.encode([&8_u32.to_le_bytes()[..], &bytes].concat());
    let two = STANDARD.encode(8_u32.to_le_bytes()) + &STANDARD.encode(&bytes);
    assert!(two.contains("==") && one != two);
    let spread: String = one.chars().flat_map(|c| [c, '\n', ' ']).collect();
    for text in [&one, &two, &spread] {
        let own = grid(read("base64", "a.vti", file(text), "a"));
        assert_eq!(own.samples(), &Samples::U8(bytes.clone()), "{text}");
    }
    let refused = |text: &str, why: &str| {
        Sample::one("base64", "a.vti", file(text)).refused(&["line 4, DataArray \"a\"", why]);
    };
    refused(&one.replace("AgME", "A-ME"), "no base64");
    refused(&one[..12], "needs 8 bytes: at most 5 are there");
    refused(&one[..13], "needs 8 bytes: at most 5 are there");
    refused(&one[..3], "3 bytes hold at most 0");
    refused(&one.replace("AgME", "Ag=E"), "no base64");
    refused(&(one.clone() + "AAAA"), "more base64 than the 8 numbers need");
    refused("", "8 numbers of type u8: 0 bytes hold at most 0");
    refused(&STANDARD.encode([&9_u32.to_le_bytes()[..], &bytes].concat()), "announces 9 bytes: 8 are needed");
}

#[test]
fn extents_and_placement() {
    let file = |attributes: &str| {
        let content = part([2, 4, -1, 1, 4, 5], &indices([0, 2, 0, 2, 0, 1]));
        Writer::new(ASCII).finish(
            "ImageData",
            &format!("WholeExtent=\"2 4 -1 1 4 5\" {attributes}"),
            &content,
        )
    };
    let loaded = Sample::one("", "a.vti", file("")).loaded();
    assert_eq!(loaded.report.notes, ["indices begin at 2 -1 4: the origin is moved there"]);
    let own = grid(loaded);
    assert_eq!((own.origin(), own.spacing()), (DVec3::new(2.0, -1.0, 4.0), DVec3::ONE));
    assert_eq!(own.value(2, 1, 1), 112.0);

    let turned = "Origin=\"1 2 3\" Spacing=\"0.5 0.25 2\" Direction=\"0 -1 0 1 0 0 0 0 1\"";
    let own = grid(Sample::one("", "a.vti", file(turned)).loaded());
    assert_eq!(own.origin(), DVec3::new(1.25, 3.0, 11.0));
    let axes = DMat3::from_cols(DVec3::Y * 0.5, DVec3::X * -0.25, DVec3::Z * 2.0);
    assert_eq!(own.index_to_world(), axes);

    let loaded = Sample::one("", "a.vti", file("Origin=\"1 2 3\" Spacing=\"1 -2 1\"")).loaded();
    assert!(loaded.report.notes.iter().any(|note| note.contains("reversed")));
    let own = grid(loaded);
    assert_eq!((own.origin(), own.spacing()), (DVec3::new(3.0, 4.0, 7.0), DVec3::new(1.0, 2.0, 1.0)));
    assert_eq!(own.world_of_index(DVec3::new(0.0, 1.0, 0.0)), DVec3::new(3.0, 2.0, 7.0));

    let refused = |attributes: &str, why: &str| Sample::one("", "a.vti", file(attributes)).refused(&[why]);
    refused("Spacing=\"1 0 1\"", "spacing");
    refused("Spacing=\"1 1\"", "ImageData Spacing: \"1 1\": must be 3 finite numbers");
    refused("Origin=\"1 nan 1\"", "Origin: \"1 nan 1\": must be 3 finite");
    refused("Direction=\"1 0 0 1 0 0 0 0 1\"", "direction");
}

#[test]
fn pieces_of_an_image_are_put_together() {
    let loaded = Sample::one("", "a.vti", pieces()).loaded();
    assert_eq!(loaded.report.notes, ["2 pieces were joined"]);
    let own = grid(loaded);
    let expected: Vec<f64> =
        indices([0, 3, 0, 1, 0, 1]).split(' ').map(|word| word.parse().unwrap()).collect();
    assert_eq!((own.dims(), stored(&own)), ([4, 2, 2], expected));

    // Cells do not overlap where points do.
    let cells = |extent: [i32; 6], values: &str| part(extent, values).replace("PointData", "CellData");
    let whole = image(
        "0 2 0 2 0 4",
        &(cells([0, 2, 0, 2, 0, 2], "0 1 2 3 4 5 6 7") + &cells([0, 2, 0, 2, 2, 4], "8 9 10 11 12 13 14 15")),
    );
    let own = grid(Sample::one("", "a.vti", whole).loaded());
    assert_eq!((own.dims(), stored(&own)), ([2, 2, 4], (0..16).map(f64::from).collect()));

    let own = |extent| part(extent, &indices(extent));
    let file = |whole: &str, extents: &[[i32; 6]]| {
        Sample::one("pieces", "a.vti", image(whole, &extents.iter().map(|&e| own(e)).collect::<String>()))
    };
    let loaded = file("0 5 0 1 0 1", &[[1, 2, 0, 1, 0, 1], [2, 4, 0, 1, 0, 1]]).loaded();
    assert_eq!(loaded.report.warnings, ["pieces cover 1 4 0 1 0 1 of the whole extent 0 5 0 1 0 1"]);
    assert_eq!((grid(loaded).origin()), DVec3::X);
    file("0 3 0 1 0 1", &[[0, 1, 0, 1, 0, 1], [3, 3, 0, 1, 0, 1]])
        .refused(&["array point:a", "no piece has the point with index 2 0 0"]);
    file("0 3 0 1 0 1", &[[0, 4, 0, 1, 0, 1]]).refused(&["line 4, Piece Extent", "0 4 0 1 0 1: not within"]);
    file("0 1 0 1 0 1", &[[0, 1, 0, 1, 0, 1]; 9]).refused(&["they overlap: 72 points in all, 8 in"]);
    file("0 1 0 1 0 1", &[[0, -1, 0, 1, 0, 1]]).refused(&["all are empty"]);
    file("0 1 0 1 0 1", &[]).refused(&["pieces: none"]);
    file("0 2 0 2 0 0", &[[0, 2, 0, 2, 0, 0]]).refused(&["3 x 3 x 1 samples: 1 is too few"]);
}

#[test]
fn pieces_of_cells_follow_each_other() {
    for style in STYLES {
        let loaded = read(style.what, "a.vtu", two_pieces(style), "pressure");
        let names: Vec<&str> = loaded.report.arrays.iter().map(|array| array.name.as_str()).collect();
        assert_eq!(names, ["pressure", "stress"]);
        let notes = &loaded.report.notes;
        for name in ["point:flow", "point:extra"] {
            assert!(
                notes.contains(&format!("{name} left out: not all pieces have it, or not of the same type"))
            );
        }
        let own = mesh(loaded);
        assert_eq!(own.points()[23], DVec3::new(10.5, 9.0, 10.5));
        assert_eq!(
            own.scalars().values()[12..24],
            own.scalars().values()[..12].iter().map(|p| -p).collect::<Vec<_>>()
        );
        assert!((volume(&own) - 13.0 / 6.0 - 1.0 / 3.0).abs() < 1e-12);
        assert!(own.cells().contains(&[12, 13, 17, 23]));
        let own = mesh(read(style.what, "a.vtu", two_pieces(style), "stress"));
        let mut runs = own.scalars().values().to_vec();
        runs.dedup();
        assert_eq!(runs[5..], [7.0, 8.0], "{}", style.what);
    }
    // Nodes are those of their own piece.
    let far = replaced(
        &two_pieces(ASCII),
        "0 1 5 11 0 5 4 11\n</DataArray>\n</Cells>",
        "0 1 5 12 0 5 4 11</DataArray></Cells>",
    );
    Sample::one("", "a.vtu", far).refused(&["DataArray \"connectivity\": node 12: the piece has 12 points"]);
}

#[test]
fn what_writers_add_does_not_get_in_the_way() {
    let sample = Sample::one("", "a.vti", decorated());
    let loaded = sample.loaded();
    assert_eq!(loaded.report.shown.as_deref(), Some("point:a <&A"));
    assert_eq!(
        loaded.report.notes,
        ["point:words left out: its type is String", "point:bits left out: its type is Bit"]
    );
    assert_eq!(grid(loaded).samples(), &Samples::I16(density()));
    for (name, why) in [("words", "its type is String"), ("point:bits", "its type is Bit")] {
        let text = sample.read(&with(name)).unwrap_err().to_string();
        assert!(text.contains(&format!("array \"{name}\": cannot be read: {why}")), "{text}");
    }
    assert!(sample.read(&with("cell:bits")).unwrap_err().to_string().contains("no such array"));

    let wide =
        replaced(&decorated(), "type='Bit' Name='bits'", "type='Int8' NumberOfComponents='1025' Name='bits'");
    let text = Sample::one("", "a.vti", wide).read(&with("bits")).unwrap_err().to_string();
    assert!(text.contains("it has 1025 components, more than 1024"), "{text}");
    let twice = replaced(&decorated(), "type='Bit' Name='bits'", "type='Int16' Name='a &lt;&amp;A'");
    let loaded = Sample::one("", "a.vti", twice).read(&OPTIONS);
    let text = loaded.unwrap_err().to_string();
    assert!(text.contains("line 10, DataArray \"a <&A\": needs 36 numbers"), "{text}");
    let second =
        "</PointData><PointData><DataArray type='Int8' Name='a &lt;&amp;A'>1</DataArray></PointData>";
    let loaded = Sample::one("", "a.vti", replaced(&decorated(), "</PointData>", second)).loaded();
    let note = "point:a <&A left out: another array has the same name";
    assert!(loaded.report.notes.iter().any(|own| own == note), "{:?}", loaded.report.notes);
    let ids = replaced(&decorated(), "type='Int16'", "type='vtkIdType'");
    assert_eq!(stored(&grid(Sample::one("", "a.vti", ids).loaded()))[0], -12_000.0);
    let silent = replaced(&decorated(), "byte_order='BigEndian'", "");
    let loaded = Sample::one("", "a.vti", silent).loaded();
    assert_eq!(loaded.report.warnings, ["no byte_order: binary data is taken as little-endian"]);
}

#[test]
fn the_file_says_which_array_is_shown() {
    let array = |name: &str, components: usize, tuples: usize| {
        let numbers = (0..components * tuples).map(|i| i.to_string()).collect::<Vec<_>>().join(" ");
        format!(
            "<DataArray type=\"UInt8\" Name=\"{name}\" NumberOfComponents=\"{components}\">{numbers}</DataArray>"
        )
    };
    let shown = |points: &str, cells: &str| {
        let content = format!(
            "<Piece Extent=\"0 2 0 2 0 2\"><PointData {points}>{}{}</PointData><CellData {cells}>{}{}</CellData></Piece>",
            array("p", 1, 27),
            array("v", 3, 27),
            array("c", 1, 8),
            array("w", 3, 8)
        );
        Sample::one("", "a.vti", image("0 2 0 2 0 2", &content)).loaded().report.shown.unwrap()
    };
    assert_eq!(shown("", ""), "point:p");
    assert_eq!(shown("Scalars=\"v\"", ""), "point:v:magnitude");
    assert_eq!(shown("Vectors=\"v\"", ""), "point:v:magnitude");
    assert_eq!(shown("Vectors=\"v\" Scalars=\"p\"", ""), "point:p");
    assert_eq!(shown("Vectors=\"v\"", "Scalars=\"c\""), "cell:c");
    assert_eq!(shown("Scalars=\"v\"", "Scalars=\"c\""), "point:v:magnitude");
    assert_eq!(shown("", "Vectors=\"w\""), "cell:w:magnitude");
    assert_eq!(shown("Scalars=\"gone\"", ""), "point:p");
}

#[test]
fn points_with_vertices_or_without_cells() {
    for cells in [true, false] {
        let own = Sample::one("", "a.vtu", cloud(cells)).loaded();
        assert_eq!(own.report.shown.as_deref(), Some("point:pressure"));
        let own = points(own);
        assert_eq!(own.centres()[8], DVec3::new(0.5, 0.5, 2.0));
        assert_eq!(own.scalars().unwrap()[11], 99_879.0);
    }
    let none = replaced(&cloud(false), "NumberOfPoints=\"12\"", "NumberOfPoints=\"0\"");
    Sample::one("", "a.vtu", none).refused(&["there must be at least one"]);
}

#[test]
fn rectilinear_grids_become_even() {
    for style in STYLES {
        let loaded = Sample::one(style.what, "a.vtr", vtr(style)).loaded();
        assert!(
            loaded.report.notes[0].contains("x: gaps from 1 to 2, resampled"),
            "{:?}",
            loaded.report.notes
        );
        let own = grid(loaded);
        assert_eq!((own.dims(), own.origin()), ([4, 3, 2], DVec3::new(0.0, 2.0, -1.0)));
        assert_eq!(own.world_of_index(DVec3::ONE), DVec3::new(1.0, 1.0, 1.0));
        assert_eq!(stored(&own)[..8], [0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 4.5, 5.0], "{}", style.what);
    }
    let piece = |extent: [i32; 6], x: &str| {
        let axes = [x, "0 1", "0 1"].map(|c| format!("<DataArray type=\"Float32\">{c}</DataArray>"));
        let coordinates = format!("<Coordinates>{}</Coordinates></Piece>", axes.concat());
        part(extent, &indices(extent)).replace("</Piece>", &coordinates)
    };
    let file = |first: &str, second: &str| {
        let content = piece([0, 1, 0, 1, 0, 1], first) + &piece([1, 2, 0, 1, 0, 1], second);
        Sample::one(
            "",
            "a.vtr",
            Writer::new(ASCII).finish("RectilinearGrid", "WholeExtent=\"0 2 0 1 0 1\"", &content),
        )
    };
    let own = grid(file("5 6", "6 7").loaded());
    assert_eq!((own.dims(), own.origin(), own.value(2, 1, 1)), ([3, 2, 2], DVec3::X * 5.0, 112.0));
    file("5 6", "6.5 7").refused(&["6.5: another piece has 6 along x here"]);
    file("5 6", "6 6").refused(&["coordinates along x", "must rise or fall"]);
    file("5 6", "6").refused(&["2 numbers of type f32"]);
    let bytes = replaced(&file("5 6", "6 7").files[0].1, "<DataArray type=\"Float32\">0 1</DataArray>", "");
    Sample::one("", "a.vtr", bytes).refused(&["line 4, Piece: no coordinates along z"]);
}

#[test]
fn files_of_other_kinds_are_named() {
    for (kind, name, why) in [
        ("PolyData", "a.vtp", "surfaces are no volume"),
        ("StructuredGrid", "a.vts", "curvilinear grids are not read"),
        ("PImageData", "a.pvti", "names other files"),
        ("vtkMultiBlockDataSet", "a.vtm", "names other files"),
        ("Collection", "a.pvd", "names other files"),
        ("Else", "a.xml", "ImageData, RectilinearGrid and UnstructuredGrid are supported"),
    ] {
        let bytes = Writer::new(ASCII).finish(kind, "", "");
        Sample::one(kind, name, bytes).refused(&["line 2, VTKFile type", &format!("\"{kind}\""), why]);
    }
}

#[test]
fn wrong_documents_are_refused() {
    let good = vti(ASCII);
    let change = |from: &str, to: &str, parts: &[&str]| {
        Sample::one("changed", "a.vti", replaced(&good, from, to)).refused(parts);
    };
    change("version=\"1.0\" ", "version=\"3.1\" ", &["line 2, VTKFile version", "\"3.1\": versions 0 to 2"]);
    change("LittleEndian", "MiddleEndian", &["byte_order", "LittleEndian or BigEndian"]);
    change("UInt32\"", "UInt16\"", &["header_type: \"UInt16\": must be UInt32 or UInt64"]);
    change(
        "UInt32\"",
        "UInt32\" compressor=\"vtkZstd\"",
        &["compressor: \"vtkZstd\"", "vtkLZ4DataCompressor"],
    );
    change("type=\"ImageData\"", "", &["line 2, VTKFile type: missing"]);
    change("WholeExtent=\"0 3 0 2 0 2\"", "", &["line 3, ImageData WholeExtent: missing"]);
    change("0 3 0 2 0 2", "0 3 0 2 0", &["must be 6 whole numbers"]);
    change("0 3 0 2 0 2", "0 3 0 2 0 3000000000", &["must be 6 whole numbers"]);
    change("Extent=\"0 3 0 2 0 2\"><P", "Extent=\"0 3 0 2 0 2 0\"><P", &["line 4, Piece Extent", "6 whole"]);
    change("type=\"Int16\"", "", &["line 4, DataArray type: missing"]);
    change("Name=\"density\"", "Name=\"density\" NumberOfComponents=\"-1\"", &["NumberOfComponents: \"-1\""]);
    change("format=\"ascii\"", "format=\"hex\"", &["format: \"hex\": must be ascii, binary or appended"]);
    change("format=\"ascii\"", "format=\"appended\"", &["offset: missing"]);
    change(
        "format=\"ascii\"",
        "format=\"appended\" offset=\"x\"",
        &["offset: \"x\": must be a whole number"],
    );
    change("-12000", "<a/>", &["line 4, DataArray \"density\"", "36 numbers of type i16: ends early"]);
    change("-12000", "-12000 <a/> 5", &["more numbers on line 5: they must be in one place"]);
    change("-12000", "-12000 5", &["line 5: \"13585\": more than the 36 numbers that are needed"]);
    change("-12000", "-12000.5", &["line 5: \"-12000.5\": must be a number of type i16"]);
    change("-12000", "&#48;", &["line 5: \"&#48;\": must be a number"]);
    change("-12000", "<![CDATA[-12000]]>", &["line 5: a CDATA section"]);
    change("</PointData>", "</Points>", &["line 7: no XML", "Points"]);
    change("<?xml version=\"1.0\"?>", "<?xml version=\"1.0\"?>x", &["line 1: text outside of all elements"]);
    change("</VTKFile>", "</VTKFile><VTKFile>", &["<VTKFile>: must be one VTKFile"]);
    change("</VTKFile>", "</VTKFile>x", &["text outside of all elements"]);
    change("</ImageData>\n</VTKFile>\n", "", &["ends within 2 open elements"]);
    change("Name=\"density\"", "Name=\"density\" Name=\"d\"", &["line 4: no XML: attributes"]);
    change("Name=\"density\"", "Name=\"&lol;\"", &["line 4: no XML: attributes", "lol"]);
    change(
        "<?xml version=\"1.0\"?>",
        "<!DOCTYPE VTKFile [<!ENTITY a \"aa\">]>",
        &["line 1: a document type"],
    );
    change("<Piece", "<Thing", &["line 10: no XML", "</Thing>"]);
    // Names come as one line.
    let name = replaced(&good, "Name=\"density\"", "Name=\"den&#10;&#x1b;sity\"");
    let text = Sample::one("", "a.vti", name).read(&with("mass")).unwrap_err().to_string();
    assert!(text.ends_with("no such array: there are point:den  sity (i16), cell:heat (f32)"), "{text:?}");
}

#[test]
fn limits_of_documents() {
    let good = vti(ASCII);
    let put =
        |text: &str| Sample::one("hostile", "a.vti", replaced(&good, "<Piece", &format!("{text}<Piece")));
    put(&"<a>".repeat(70)).refused(&["line 4: more than 64 elements within each other"]);
    let many: String = (0..65).map(|i| format!(" a{i}=\"\"")).collect();
    put(&format!("<Piece{many}/>")).refused(&["line 4: more than 64 attributes"]);
    put(&format!("<!--{}-->", "x".repeat(1 << 20))).refused(&["line 4: markup longer than 1048576 bytes"]);
    put(&format!("<{}", "x".repeat(1 << 21))).refused(&["markup longer than"]);
    let long = "x".repeat(257);
    put(&format!("<{long}>")).refused(&["line 4: an element whose name is longer than 256 bytes"]);
    put(&format!("<Piece Extent='0 -1 0 0 0 0'><Cells><DataArray type='Int8' Name='{long}'/>"))
        .refused(&["line 4, DataArray Name: longer than 256 bytes"]);
    put(&"<Piece Extent='0 -1 0 0 0 0'/>".repeat(65_536)).refused(&["pieces: more than 65536"]);
    let arrays = "<DataArray type='Int8'/>".repeat(65_537);
    put(&format!("<Piece Extent='0 -1 0 0 0 0'><Cells>{arrays}")).refused(&["arrays: more than 65536"]);
    // Structure counts as memory.
    let text = put(&"<Piece Extent='0 -1 0 0 0 0'/>".repeat(1000)).read(&ReadOptions::within(10_000));
    assert!(text.unwrap_err().to_string().contains("left of the limit of 10000"));
}

#[test]
fn wrong_cells_are_refused() {
    let good = vtu(ASCII);
    let change = |from: &str, to: &str, parts: &[&str]| {
        Sample::one("changed", "a.vtu", replaced(&good, from, to)).refused(parts);
    };
    change("NumberOfPoints=\"12\"", "", &["Piece NumberOfPoints: missing"]);
    change("NumberOfCells=\"5\"", "NumberOfCells=\"-5\"", &["NumberOfCells: \"-5\": must be a whole number"]);
    change("NumberOfPoints=\"12\"", "NumberOfPoints=\"13\"", &["39 numbers of type f64: ends early"]);
    change("NumberOfPoints=\"12\"", "NumberOfPoints=\"11\"", &["\"0.5\": more than the 33 numbers"]);
    change("NumberOfPoints=\"12\"", "NumberOfPoints=\"4294967295\"", &["must be below 4294967295"]);
    change("NumberOfPoints=\"12\"", "NumberOfPoints=\"99999999\"", &["limit of 1073741824"]);
    change("NumberOfPoints=\"12\"", "NumberOfPoints=\"9999999\"", &["29999997 numbers", "hold at most"]);
    change("NumberOfCells=\"5\"", "NumberOfCells=\"6\"", &["\"offsets\": needs 6 numbers of type i64"]);
    change("Name=\"types\"", "Name=\"typed\"", &["line 4, Piece: no array of types"]);
    change("Name=\"Points\" NumberOfComponents=\"3\"", "Name=\"Points\"", &["1 components: must be 3"]);
    change("4 8 16 22 27", "4 8 16 27 22", &["\"4\": more than the 22"]);
    change("4 8 16 22 27", "4 16 8 22 27", &["cell 1: 12 nodes"]);
    change("4 8 16 22 27", "4 8 16 22 4294967295", &["\"offsets\": 4294967295: must be from 0"]);
    change("4 8 16 22 27", "4 8 16 22 -1", &["\"offsets\": -1: must be from 0"]);
    change("4 8 16 22 27", "4 8 16 22 4000000000", &["nodes of cells", "limit of"]);
    change(
        "4 8 16 22 27",
        "4 8 16 22 40000000",
        &["\"connectivity\": needs 40000000 numbers", "hold at most"],
    );
    change("10 10 12 13 14", "10 10 12 13 256", &["line 27: \"256\": must be a number of type u8"]);
    let wide = replaced(&replaced(&good, "13 14\n", "13 256"), "type=\"UInt8\"", "type=\"Int16\"");
    Sample::one("", "a.vtu", wide).refused(&["\"types\": 256: not a type of a cell"]);
    change("10 10 12 13 14", "10 10 12 13 42", &["1 of type 42 (polyhedra): "]);
    change("10 10 12 13 14", "10 10 12 14 13", &["cells"]);
    change("0 1 5 11 0", "0 1 5 12 0", &["node 12: the piece has 12 points"]);
    change("type=\"UInt8\"", "type=\"Float32\"", &["\"types\": type f32: indices are whole numbers"]);
    change("type=\"UInt8\"", "type=\"String\"", &["\"types\": cannot be read: its type is String"]);
    for (array, radius) in [(Some("pressure:3"), None), (None, Some("pressure"))] {
        let own = |name: Option<&str>| name.map(str::to_owned);
        let options = ReadOptions { array: own(array), radius: own(radius), ..OPTIONS };
        assert!(Sample::one("", "a.vtu", good.clone()).read(&options).is_err());
    }
}

/// A file of 8 bytes in one appended array.
fn appended(compressor: &str, word: usize, data: &[u8]) -> Sample {
    let content = "<Piece Extent=\"0 1 0 1 0 1\"><PointData><DataArray type=\"UInt8\" Name=\"a\" \
                   format=\"appended\" offset=\"0\"/></PointData></Piece>";
    let mut w = Writer::new(Style { word, ..RAW });
    w.appended = data.to_vec();
    let bytes = w.finish("ImageData", "WholeExtent=\"0 1 0 1 0 1\"", content);
    Sample::one(
        "appended",
        "a.vti",
        replaced(&bytes, " header", &format!(" compressor=\"{compressor}\" header")),
    )
}

fn u32s(numbers: &[u32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

#[test]
fn wrong_blocks_are_refused() {
    const ZLIB: &str = "vtkZLibDataCompressor";
    const LZ4: &str = "vtkLZ4DataCompressor";
    const LZMA: &str = "vtkLZMADataCompressor";
    let bytes: Vec<u8> = (0..8).collect();
    let packed = zlib(&bytes);
    let size = u32::try_from(packed.len()).unwrap();
    let good = |numbers: &[u32]| appended(ZLIB, 4, &[u32s(numbers), packed.clone()].concat());
    assert_eq!(stored(&grid(good(&[1, 8, 0, size]).loaded())), (0..8).map(f64::from).collect::<Vec<_>>());
    assert_eq!(stored(&grid(good(&[1, 9, 8, size]).loaded()))[7], 7.0);
    let place = "line 4, DataArray \"a\"";
    let refused = |numbers: &[u32], parts: &[&str]| {
        let sample = good(numbers);
        sample.refused(parts);
        sample.refused(&[place]);
    };
    refused(&[0, 8, 0, size], &["announces 0 blocks of 8 bytes", "8 bytes are needed"]);
    refused(&[1, 9, 0, size], &["1 blocks of 9 bytes"]);
    refused(&[1, 0, 8, size], &["1 blocks of 0 bytes, the last of 8"]);
    refused(&[1, 4, 8, size], &["1 blocks of 4 bytes, the last of 8"]);
    refused(&[2, 8, 0, size], &["2 blocks of 8"]);
    refused(&[u32::MAX, u32::MAX, u32::MAX], &["8 bytes are needed"]);
    refused(&[8, 1, 0], &["its header announces more compressed bytes"]);
    refused(&[1, 8, 0, u32::MAX], &["more compressed bytes than"]);
    refused(&[1, 8, 0, 0], &["needs 8 bytes: 0 bytes of zlib hold at most 0"]);
    refused(&[1, 8, 0, size - 1], &["block 0: zlib stream ends too early"]);
    refused(&[1, 8, 0, size + 1], &["block 0: 1 bytes are left after its end"]);
    refused(&[2, 4, 0, 5, size - 5], &["block 0: zlib"]);
    // Truncated in its header, or with a damaged check sum.
    appended(ZLIB, 4, &[1, 0]).refused(&["blocks"]);
    let mut damaged = packed.clone();
    *damaged.last_mut().unwrap() ^= 1;
    appended(ZLIB, 4, &[u32s(&[1, 8, 0, size]), damaged].concat())
        .refused(&["block 0: zlib stream is damaged"]);
    for (own, why) in [(&bytes[..7], "ends 1 bytes too early"), (&[1; 9], "holds more bytes")] {
        let packed = zlib(own);
        let header = u32s(&[1, 8, 0, u32::try_from(packed.len()).unwrap()]);
        appended(ZLIB, 4, &[header, packed].concat()).refused(&[place, "block 0", why]);
        let packed = xz(own, 0);
        let header = u32s(&[1, 8, 0, u32::try_from(packed.len()).unwrap()]);
        appended(LZMA, 4, &[header, packed].concat()).refused(&[place, "block 0", why]);
        let packed = lz4_flex::block::compress(own);
        let header = u32s(&[1, 8, 0, u32::try_from(packed.len()).unwrap()]);
        appended(LZ4, 4, &[header, packed].concat()).refused(&[place, "block 0", "LZ4"]);
    }
    appended(LZMA, 4, &[u32s(&[1, 8, 0, 12]), vec![7; 12]].concat())
        .refused(&["block 0: xz stream is damaged"]);
    appended(LZ4, 4, &[u32s(&[1, 8, 0, 3]), vec![0x10, 1, 2]].concat()).refused(&["block 0: LZ4"]);
    // 64-bit headers that overflow.
    let huge = |numbers: [u64; 4]| {
        let header: Vec<u8> = numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
        appended(ZLIB, 8, &[header, packed.clone()].concat())
    };
    huge([u64::MAX, u64::MAX, 8, 1]).refused(&["8 bytes are needed"]);
    huge([1, 8, 0, u64::MAX]).refused(&["more compressed bytes"]);
    huge([1, u64::MAX, 8, u64::from(size)]).loaded();
}

#[test]
fn dictionaries_and_blocks_count_as_memory() {
    // 16 MiB of dictionary for 8 bytes.
    let packed = xz(&[5; 8], 24);
    let header = u32s(&[1, 8, 0, u32::try_from(packed.len()).unwrap()]);
    let sample = appended("vtkLZMADataCompressor", 4, &[header, packed].concat());
    sample.loaded();
    let text = sample.read(&ReadOptions::within(1 << 20)).unwrap_err().to_string();
    assert!(text.contains("DataArray \"a\": 16818176 bytes of memory"), "{text}");
    // 4 GiB, by which nothing is made.
    let packed = xz(&[5; 8], 40);
    let header = u32s(&[1, 8, 0, u32::try_from(packed.len()).unwrap()]);
    appended("vtkLZMADataCompressor", 4, &[header, packed].concat()).refused(&["bytes of memory"]);
    // A block of LZ4 is held twice, packed and not.
    let style = Style { compressor: Compressor::Lz4, block: 72, ..RAW };
    assert!(Sample::one("", "a.vti", vti(style)).read(&ReadOptions::within(2600)).is_ok());
}

#[test]
fn wrong_appended_data_is_refused() {
    let good = vti(RAW);
    let change = |from: &str, to: &str, parts: &[&str]| {
        Sample::one("changed", "a.vti", replaced(&good, from, to)).refused(parts);
    };
    change("   _", "   ", &["AppendedData: must begin with \"_\""]);
    change(
        "encoding=\"raw\"",
        "encoding=\"hex\"",
        &["AppendedData encoding: \"hex\": must be raw or base64"],
    );
    change("encoding=\"raw\"", "", &["AppendedData encoding: missing"]);
    change("offset=\"0\"", "offset=\"76\"", &["its header announces 48 bytes: 72 are needed"]);
    change("offset=\"0\"", "offset=\"18446744073709551615\"", &["offset 18446744073709551615: the file has"]);
    change("offset=\"0\"", "offset=\"130\"", &["DataArray \"density\": needs 36 numbers", "hold at most"]);
    change("<AppendedData", "<AppendedDatum", &["no XML"]);
    change("/>", ">5</DataArray>", &["numbers here: its format is appended"]);
    let none = replaced(&vti(ASCII), "format=\"ascii\"", "format=\"appended\" offset=\"0\"");
    let none = replaced(&none, "-12000", "<!--");
    let none = replaced(&none, "13585", "-->");
    Sample::one("", "a.vti", none).refused(&["its format is appended: there is no AppendedData"]);
    // Cut anywhere, a file is refused, except within the tags that close the appended data.
    for (style, tail) in [(RAW, 29), (STYLES[12], 29), (ASCII, 11), (STYLES[3], 11)] {
        let whole = vtu(style);
        for end in 0..whole.len() - tail {
            let sample = Sample::one("cut", "a.vtu", &whole[..end]);
            assert!(sample.read(&with("stress")).is_err() || end > whole.len() - 60, "{}: {end}", style.what);
        }
    }
}

#[test]
fn text_after_the_document_is_refused() {
    for style in STYLES {
        for (name, file) in [("a.vti", vti(style)), ("a.vtu", vtu(style)), ("a.vtr", vtr(style))] {
            // Whether the array that is read is the last one or not.
            for array in match name {
                "a.vti" => ["density", "heat"],
                "a.vtu" => ["flow:z", "stress"],
                _ => ["a", "point:a"],
            } {
                let after = |text: &str| [file.as_slice(), text.as_bytes()].concat();
                read(style.what, name, after(" \n\t\n"), array);
                let second = String::from_utf8_lossy(&file).into_owned();
                for text in ["x", "\n  junk", "<VTKFile>", second.as_str()] {
                    for (name, bytes) in
                        [(name.to_owned(), after(text)), (format!("{name}.gz"), gzip(&after(text)))]
                    {
                        let error = Sample::one(style.what, &name, bytes).read(&with(array)).unwrap_err();
                        let found = error.to_string();
                        assert!(
                            found.contains("outside of all elements")
                                || found.contains("must be one VTKFile"),
                            "{}, {name}, {array}: {found}",
                            style.what
                        );
                    }
                }
            }
        }
    }
}

/// Coordinates that 64-bit floats hold, but whose squares and cubes they do not.
#[test]
fn places_too_far_to_be_rendered_are_named() {
    let rule = "coordinates that are rendered must be within 1e100 of 0";
    for far in ["1e300", "-2e100"] {
        let mesh = replaced(&vtu(ASCII), "0.5 0.5 2", &format!("0.5 {far} 2"));
        let place = format!("a.vtu: point 8: 5e-1, {far}, 2e0: ");
        Sample::one("mesh", "a.vtu", mesh.clone()).refused(&[&place, rule]);
        let lattice = replaced(&vti(ASCII), "Origin=\"1 2 3\"", &format!("Origin=\"1 2 {far}\""));
        Sample::one("grid", "a.vti", lattice).refused(&[
            "a.vti: placement: a corner at 1e0, 2e0, ",
            far,
            rule,
        ]);
        let table = format!("x,y,z,a\n0,0,0,1\n0,{far},1,2\n");
        Sample::one("points", "a.csv", table).refused(&[&format!("a.csv: point 1: 0e0, {far}, 1e0: "), rule]);
        // Other programs may want them.
        let files: &[(&str, &[u8])] = &[("a.vtu", &mesh)];
        assert!(volraster::io::read_arrays_memory(files, &OPTIONS, false).is_ok());
    }
    let near = replaced(&vtu(ASCII), "0.5 0.5 2", "0.5 1e100 2");
    assert!(Sample::one("near", "a.vtu", near).read(&OPTIONS).is_ok());
}

#[test]
fn arrays_in_one_place_are_no_amplifier() {
    // 300 pieces, all of whose numbers are the same bytes.
    let one = "<Piece NumberOfPoints=\"12\" NumberOfCells=\"0\"><PointData><DataArray type=\"UInt8\" Name=\"a\" \
               NumberOfComponents=\"1000\" format=\"appended\" offset=\"292\"/></PointData><Points>\
               <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"appended\" offset=\"0\"/></Points></Piece>";
    let mut w = Writer::new(RAW);
    w.array("", &PLACES);
    w.array("", &[1_u8; 12_000]);
    let bytes = w.finish("UnstructuredGrid", "", &one.repeat(300));
    let sample = Sample::one("", "a.vtu", bytes);
    sample.refused(&["DataArray \"a\": too many arrays lie in the same place"]);
}

#[test]
fn packed_files_are_gone_through_forwards() {
    for style in STYLES {
        let plain = mesh(read(style.what, "a.vtu", vtu(style), "flow:z"));
        let packed = mesh(read(style.what, "a.vtu.gz", gzip(&vtu(style)), "flow:z"));
        assert_eq!(packed.scalars(), plain.scalars());
        assert_eq!((packed.points(), packed.cells()), (plain.points(), plain.cells()));
    }
    // Pieces in an order that goes back each time.
    let mut w = Writer::new(RAW);
    let arrays: Vec<String> =
        (0..100).map(|_| w.array("Name=\"Points\" NumberOfComponents=\"3\"", &PLACES)).collect();
    let pieces: String = arrays
        .iter()
        .rev()
        .map(|array| {
            format!("<Piece NumberOfPoints=\"12\" NumberOfCells=\"0\"><Points>{array}</Points></Piece>")
        })
        .collect();
    let bytes = w.finish("UnstructuredGrid", "", &pieces);
    assert_eq!(points(Sample::one("", "a.vtu", bytes.clone()).loaded()).centres().len(), 1200);
    Sample::one("", "a.vtu.gz", gzip(&bytes)).refused(&["unpack it first"]);
}

#[test]
fn memory_limits_hold() {
    for style in STYLES {
        for bytes in [vti(style), vtu(style)] {
            let sample = Sample::one(style.what, "a.vtx", bytes);
            let text = sample.read(&ReadOptions::within(400)).unwrap_err().to_string();
            assert!(text.contains("left of the limit of 400"), "{text}");
        }
    }
}

/// Reads a real mesh: points, cells and the report.
fn real_mesh(name: &str) -> Option<(Tets, Vec<String>, Option<String>)> {
    let loaded = shared_loaded(name)?;
    // The can is crushed: some of its cells are bent so far that no cut of theirs is without overlaps.
    let expected: &[&str] = match name {
        "unstructured/can_crush_hex.vtu" => &["39 hexahedra are twisted: their tetrahedra overlap"],
        _ => &[],
    };
    assert_eq!(loaded.report.warnings, expected, "{name}");
    let (notes, shown) = (loaded.report.notes.clone(), loaded.report.shown.clone());
    Some((mesh(loaded), notes, shown))
}

fn close([a, b]: [f64; 2], [c, d]: [f64; 2]) -> bool {
    let tolerance = 1e-5 * (d - c);
    (a - c).abs() < tolerance && (b - d).abs() < tolerance
}

#[test]
fn real_meshes() {
    for (name, points, cells, range) in [
        ("unstructured/bluntfin_tets.vtu", 40_960, 187_395 - 77, [0.1926, 4.9775]),
        ("unstructured/combustor_tets.vtu", 47_025, 215_040, [0.197_813, 0.710_419]),
        ("unstructured/lox_post_tets.vtu", 109_744, 513_375, [0.0, 1.391_444]),
        ("unstructured/aneurysm_flow.vtu", 21_332, 63_008 + 3 * 16_748, [0.0, 0.521_670_7]),
        ("unstructured/bracket_quadratic.vtu", 102_578, 8 * 56_786, [0.014_035, 23.268_999]),
        ("unstructured/can_crush_hex.vtu", 6_724, 6 * 4_800, [0.021_583_130_6, 2.893_941_64]),
        ("unstructured/tiny_quadratic_tets.vtu", 189, 8 * 96, [0.0, 1.732_050_8]),
    ] {
        let Some((own, notes, _)) = real_mesh(name) else { continue };
        assert_eq!((own.points().len(), own.cells().len()), (points, cells), "{name}: {notes:?}");
        assert!(close(own.range(), range), "{name}: {:?}", own.range());
    }
    if let Some((_, notes, shown)) = real_mesh("unstructured/bluntfin_tets.vtu") {
        assert_eq!(notes, ["77 tetrahedra without volume left out"]);
        assert_eq!(shown.as_deref(), Some("point:density"));
    }
    if let Some((_, notes, shown)) = real_mesh("unstructured/aneurysm_flow.vtu") {
        assert!(notes.contains(&"16748 wedges became 50244 tetrahedra".to_owned()), "{notes:?}");
        assert_eq!(shown.as_deref(), Some("point:Umag"));
    }
}

#[test]
fn arrays_of_real_meshes() {
    let range = |name: &str, array: &str, expected: [f64; 2]| {
        let Some(path) = crate::formats::support::shared(name) else { return };
        let loaded = volraster::io::read(path, &with(array)).unwrap();
        let own = match loaded.data {
            Data::Mesh(own) => own.range(),
            Data::Points(own) => own.range(),
            _ => panic!("{name}: neither mesh nor points"),
        };
        assert!(close(own, expected), "{name} {array}: {own:?}");
    };
    range("unstructured/aneurysm_flow.vtu", "p", [-5.378_287, 369.058_609]);
    range("unstructured/aneurysm_flow.vtu", "u", [-0.256_622_33, 0.507_631_36]);
    range("unstructured/bluntfin_tets.vtu", "speed", [0.0, 3.122_931_96]);
    range("unstructured/combustor_tets.vtu", "speed", [0.0, 1_528.935_06]);
    range("particles/fluid_encoded_250.vtu", "velocity", [0.107_393_93, 2.878_242_59]);
    range("particles/fluid_encoded_250.vtu", "density", [520.788_92, 1_021.462_56]);
    range("particles/fluid_encoded_250.vtu", "index", [1.0, 250.0]);
}

#[test]
fn conformance_files_agree() {
    let variants = |stem: &str, ends: &[&str], ending: &str| -> Vec<(String, Loaded)> {
        ends.iter()
            .map(|end| format!("format_conformance/{stem}_{end}.{ending}"))
            .filter_map(|name| shared_loaded(&name).map(|loaded| (name, loaded)))
            .collect()
    };
    let images = [
        "appended_b64_zlib",
        "appended_raw_lz4",
        "appended_raw_none",
        "appended_raw_zlib",
        "inline_b64_zlib",
    ];
    let mut first = None;
    for (name, loaded) in variants("head_i16", &images, "vti") {
        let own = grid(loaded);
        assert_eq!(own.dims(), [64, 64, 40]);
        assert_eq!(
            (own.spacing(), own.origin()),
            (DVec3::new(3.2, 3.2, 1.5), DVec3::new(-100.0, 20.5, 7.25))
        );
        assert_eq!(own.range(), [-1024.0, 2902.0]);
        assert_eq!(first.get_or_insert_with(|| own.samples().clone()), own.samples(), "{name}");
    }
    // The reference: 128 bytes of header, then the samples.
    if let (Some(path), Some(Samples::I16(own))) =
        (crate::formats::support::shared("format_conformance/head_i16.npy"), first)
    {
        let bytes = std::fs::read(path).unwrap();
        let expected: Vec<i16> =
            bytes[128..].as_chunks::<2>().0.iter().map(|&b| i16::from_le_bytes(b)).collect();
        assert_eq!(own, expected);
    }
    let meshes = [
        "appended_b64_zlib",
        "appended_raw_lz4",
        "appended_raw_lzma",
        "appended_raw_none",
        "appended_raw_zlib",
        "ascii_none",
        "inline_b64_none",
        "inline_b64_zlib",
    ];
    let mut first: Option<Tets> = None;
    for (name, loaded) in variants("post_small", &meshes, "vtu") {
        let own = mesh(loaded);
        assert_eq!((own.points().len(), own.cells().len()), (2288, 8750), "{name}");
        assert!(close(own.range(), [0.355_367_69, 1.641_240_48]), "{name}");
        let first = first.get_or_insert_with(|| own.clone());
        assert_eq!(
            (own.points(), own.cells(), own.scalars()),
            (first.points(), first.cells(), first.scalars()),
            "{name}"
        );
    }
}

#[test]
fn real_images_and_particles() {
    for (name, range) in
        [("structured/hydrogen.vti", [0.0, 1.0]), ("structured/viscous_fingers.vti", [0.0, 110.957_572_94])]
    {
        let Some(loaded) = shared_loaded(name) else { continue };
        let own = grid(loaded);
        assert_eq!((own.dims(), own.spacing()), ([64; 3], DVec3::ONE), "{name}");
        assert!(close(own.range(), range), "{name}: {:?}", own.range());
    }
    if let Some(loaded) = shared_loaded("particles/fluid_encoded_250.vtu") {
        assert_eq!(loaded.report.shown.as_deref(), Some("point:pressure"));
        let own = points(loaded);
        assert_eq!(own.centres().len(), 250);
        assert!(close(own.range(), [0.0, 89_839.958_963]));
    }
}
