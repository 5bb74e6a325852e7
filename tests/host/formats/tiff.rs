//! TIFF stacks.

use glam::DVec3;
use volraster::io::ReadOptions;
use volraster::scene::{Anatomy, Samples};

use crate::formats::support::{OPTIONS, Sample, assert_refusal, grid, shared_loaded, stored, zlib};

/// A value of a directory.
#[derive(Clone, Debug)]
pub enum Value {
    Short(Vec<u16>),
    Long(Vec<u32>),
    Text(String),
    Fraction(u32, u32),
    Bytes(Vec<u8>),
}

/// A page: tags and strips or tiles.
#[derive(Clone, Debug)]
pub struct Page {
    pub tags: Vec<(u16, Value)>,
    pub chunks: Vec<Vec<u8>>,
}

impl Page {
    /// One strip of grey.
    pub fn grey(width: u32, height: u32, bits: u16, format: u16, data: Vec<u8>) -> Self {
        let tags = vec![
            (256, Value::Long(vec![width])),
            (257, Value::Long(vec![height])),
            (258, Value::Short(vec![bits])),
            (259, Value::Short(vec![1])),
            (262, Value::Short(vec![1])),
            (339, Value::Short(vec![format])),
        ];
        Self { tags, chunks: vec![data] }
    }

    /// With another value of a tag.
    pub fn with(mut self, tag: u16, value: Value) -> Self {
        self.tags.retain(|(other, _)| *other != tag);
        self.tags.push((tag, value));
        self
    }

    pub fn short(self, tag: u16, value: u16) -> Self {
        self.with(tag, Value::Short(vec![value]))
    }

    pub fn text(self, text: &str) -> Self {
        self.with(270, Value::Text(text.to_owned()))
    }

    fn without(mut self, tag: u16) -> Self {
        self.tags.retain(|(other, _)| *other != tag);
        self
    }
}

/// The bytes of a file.
#[derive(Clone, Copy, Debug)]
pub struct Order {
    pub large_first: bool,
    pub big: bool,
}

pub const LITTLE: Order = Order { large_first: false, big: false };

impl Order {
    fn put(self, bytes: &mut Vec<u8>, value: u64, size: usize) {
        if self.large_first {
            bytes.extend_from_slice(&value.to_be_bytes()[8 - size..]);
        } else {
            bytes.extend_from_slice(&value.to_le_bytes()[..size]);
        }
    }

    fn set(self, bytes: &mut [u8], at: usize, value: u64, size: usize) {
        let mut word = Vec::new();
        self.put(&mut word, value, size);
        bytes[at..at + size].copy_from_slice(&word);
    }

    /// Numbers of a page as the file stores them.
    pub fn bytes<const N: usize>(self, numbers: impl IntoIterator<Item = [u8; N]>) -> Vec<u8> {
        let order = |mut number: [u8; N]| {
            if self.large_first {
                number.reverse();
            }
            number
        };
        numbers.into_iter().flat_map(order).collect()
    }

    pub fn file(self, pages: &[Page]) -> Vec<u8> {
        let mut file = if self.large_first { b"MM".to_vec() } else { b"II".to_vec() };
        self.put(&mut file, if self.big { 43 } else { 42 }, 2);
        if self.big {
            self.put(&mut file, 8, 2);
            self.put(&mut file, 0, 2);
        }
        let word = if self.big { 8 } else { 4 };
        let mut next = file.len();
        self.put(&mut file, 0, word);
        for page in pages {
            let offsets: Vec<u32> = page
                .chunks
                .iter()
                .map(|chunk| {
                    let at = file.len() as u32;
                    file.extend_from_slice(chunk);
                    at
                })
                .collect();
            let lengths = page.chunks.iter().map(|chunk| chunk.len() as u32).collect();
            let tiled = page.tags.iter().any(|(tag, _)| *tag == 322);
            let mut tags = page.tags.clone();
            for (tag, value) in
                [(if tiled { 324 } else { 273 }, offsets), (if tiled { 325 } else { 279 }, lengths)]
            {
                if !tags.iter().any(|(other, _)| *other == tag) {
                    tags.push((tag, Value::Long(value)));
                }
            }
            tags.sort_by_key(|(tag, _)| *tag);
            let mut entries = Vec::new();
            for (tag, value) in tags {
                let (kind, count, bytes): (u64, usize, Vec<u8>) = match value {
                    Value::Short(v) => (3, v.len(), self.bytes(v.iter().map(|n| n.to_le_bytes()))),
                    Value::Long(v) => (4, v.len(), self.bytes(v.iter().map(|n| n.to_le_bytes()))),
                    Value::Text(text) => (2, text.len() + 1, [text.as_bytes(), &[0]].concat()),
                    Value::Fraction(a, b) => (5, 1, self.bytes([a.to_le_bytes(), b.to_le_bytes()])),
                    Value::Bytes(bytes) => (7, bytes.len(), bytes),
                };
                self.put(&mut entries, u64::from(tag), 2);
                self.put(&mut entries, kind, 2);
                self.put(&mut entries, count as u64, word);
                if bytes.len() <= word {
                    entries.extend_from_slice(&bytes);
                    entries.resize(entries.len() + word - bytes.len(), 0);
                } else {
                    self.put(&mut entries, file.len() as u64, word);
                    file.extend_from_slice(&bytes);
                }
            }
            let at = file.len() as u64;
            self.set(&mut file, next, at, word);
            let count = entries.len() / if self.big { 20 } else { 12 };
            self.put(&mut file, count as u64, if self.big { 8 } else { 2 });
            file.extend_from_slice(&entries);
            next = file.len();
            self.put(&mut file, 0, word);
        }
        file
    }
}

/// Two pages of 4 x 3 bytes: 0 to 23.
fn ramp() -> Vec<Page> {
    (0..2).map(|z| Page::grey(4, 3, 8, 1, (12 * z..12 * (z + 1)).collect())).collect()
}

fn each(pages: Vec<Page>, change: impl Fn(Page) -> Page) -> Vec<Page> {
    pages.into_iter().map(change).collect()
}

fn first(mut pages: Vec<Page>, change: impl Fn(Page) -> Page) -> Vec<Page> {
    let page = pages.remove(0);
    pages.insert(0, change(page));
    pages
}

fn little(what: &'static str, pages: &[Page]) -> Sample {
    Sample::one(what, "a.tif", LITTLE.file(pages))
}

fn numbers(sample: &Sample) -> Vec<f64> {
    stored(&grid(sample.loaded()))
}

fn upto(count: u32) -> Vec<f64> {
    (0..count).map(f64::from).collect()
}

/// Tiles of 16 x 16 of an image of single bytes.
fn tiles(width: usize, height: usize, value: impl Fn(usize, usize) -> u8) -> Vec<Vec<u8>> {
    let mut tiles = Vec::new();
    for top in (0..height).step_by(16) {
        for left in (0..width).step_by(16) {
            let inside = |x, y| if x < width && y < height { value(x, y) } else { 99 };
            tiles.push((0..256).map(|i| inside(left + i % 16, top + i / 16)).collect());
        }
    }
    tiles
}

/// Differences of neighbours within rows.
fn differences(bytes: &[u8], width: usize) -> Vec<u8> {
    let row = |row: &[u8]| {
        let mut last = 0_u8;
        row.iter().map(|&byte| byte.wrapping_sub(std::mem::replace(&mut last, byte))).collect::<Vec<u8>>()
    };
    bytes.chunks(width).flat_map(row).collect()
}

fn lzw(bytes: &[u8]) -> Vec<u8> {
    // Codes of 9 bits, a clear code before each 200 bytes, so that the width never changes.
    let mut codes = Vec::new();
    for block in bytes.chunks(200) {
        codes.push(256_u16);
        codes.extend(block.iter().map(|&byte| u16::from(byte)));
    }
    codes.push(257);
    let bits: Vec<u8> =
        codes.iter().flat_map(|code| (0..9).rev().map(move |i| ((code >> i) & 1) as u8)).collect();
    bits.chunks(8)
        .map(|bits| bits.iter().enumerate().fold(0, |byte, (i, bit)| byte | bit << (7 - i)))
        .collect()
}

/// Bytes as they are, in PackBits.
fn packbits(bytes: &[u8]) -> Vec<u8> {
    bytes.chunks(128).flat_map(|run| [&[run.len() as u8 - 1], run].concat()).collect()
}

/// 8 x 8 pixels of grey, 20 + 3 i but for rounding, as a baseline JPEG.
#[rustfmt::skip]
pub const JPEG: &[u8] = &[0xff, 0xd8, 0xff, 0xe0, 0x00, 0x10, 0x4a, 0x46, 0x49, 0x46, 0x00, 0x01, 0x01, 0x00, 0x00, 0x01, 0x00, 0x01, 0x00, 0x00, 0xff, 0xdb, 0x00, 0x43, 0x00, 0x03, 0x02, 0x02, 0x03, 0x02, 0x02, 0x03, 0x03, 0x03, 0x03, 0x04, 0x03, 0x03, 0x04, 0x05, 0x08, 0x05, 0x05, 0x04, 0x04, 0x05, 0x0a, 0x07, 0x07, 0x06, 0x08, 0x0c, 0x0a, 0x0c, 0x0c, 0x0b, 0x0a, 0x0b, 0x0b, 0x0d, 0x0e, 0x12, 0x10, 0x0d, 0x0e, 0x11, 0x0e, 0x0b, 0x0b, 0x10, 0x16, 0x10, 0x11, 0x13, 0x14, 0x15, 0x15, 0x15, 0x0c, 0x0f, 0x17, 0x18, 0x16, 0x14, 0x18, 0x12, 0x14, 0x15, 0x14, 0xff, 0xc0, 0x00, 0x0b, 0x08, 0x00, 0x08, 0x00, 0x08, 0x01, 0x01, 0x11, 0x00, 0xff, 0xc4, 0x00, 0x14, 0x00, 0x01, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x06, 0xff, 0xc4, 0x00, 0x19, 0x10, 0x00, 0x01, 0x05, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x05, 0x08, 0x24, 0x32, 0xa2, 0xff, 0xda, 0x00, 0x08, 0x01, 0x01, 0x00, 0x00, 0x3f, 0x00, 0x36, 0x88, 0xc9, 0x2b, 0x03, 0x07, 0xff, 0xd9];

/// Their values, as another decoder has them.
#[rustfmt::skip]
pub const JPEG_VALUES: [u8; 64] = [20, 23, 26, 29, 32, 35, 38, 41, 44, 47, 50, 53, 56, 59, 62, 65, 69, 71, 74, 77, 80, 83, 86, 89, 91, 94, 97, 100, 103, 106, 109, 112, 117, 120, 123, 126, 129, 132, 135, 138, 140, 143, 146, 149, 152, 155, 158, 160, 164, 167, 170, 173, 176, 179, 182, 185, 188, 191, 194, 197, 200, 203, 206, 209];

/// 16 x 12 bits, set where x + y is a multiple of 5, in CCITT Group 4.
#[rustfmt::skip]
const GROUP4: &[u8] = &[0x26,0xa8,0xda,0x36,0x94,0x52,0x49,0x2a,0x49,0x25,0x49,0x24,0xa9,0x24,0x95,0x24,0x92,0x51,0x49,0x24,0xa9,0x24,0x95,0x24,0x92,0xa4,0x92,0x54,0x92,0x49,0x45,0x24,0x92,0x80,0x8,0x0,0x80];

/// Small files that cover the format.
pub fn samples() -> Vec<Sample> {
    let mut samples = vec![little("bytes", &ramp())];
    for large_first in [false, true] {
        for big in [false, true] {
            let order = Order { large_first, big };
            let page =
                |z: u16| Page::grey(2, 2, 16, 1, order.bytes((0..4).map(|i| (1000 * z + i).to_le_bytes())));
            samples.push(Sample::one("orders", "a.tif", order.file(&[page(0), page(1)])));
        }
    }
    let order = Order { large_first: true, big: false };
    let typed = |bits, format, data: &dyn Fn(i32) -> Vec<u8>| {
        order.file(&[Page::grey(2, 2, bits, format, data(0)), Page::grey(2, 2, bits, format, data(4))])
    };
    let of = |z: i32| (0..4).map(move |i| z + i - 2);
    samples.extend([
        Sample::one("i8", "a.tif", typed(8, 2, &|z| order.bytes(of(z).map(|n| (n as i8).to_le_bytes())))),
        Sample::one("i16", "a.tif", typed(16, 2, &|z| order.bytes(of(z).map(|n| (n as i16).to_le_bytes())))),
        Sample::one("i32", "a.tif", typed(32, 2, &|z| order.bytes(of(z).map(|n| n.to_le_bytes())))),
        Sample::one(
            "i64",
            "a.tif",
            typed(64, 2, &|z| order.bytes(of(z).map(|n| i64::from(n).to_le_bytes()))),
        ),
        Sample::one("f32", "a.tif", typed(32, 3, &|z| order.bytes(of(z).map(|n| (n as f32).to_le_bytes())))),
        Sample::one(
            "f64",
            "a.tif",
            typed(64, 3, &|z| order.bytes(of(z).map(|n| f64::from(n).to_le_bytes()))),
        ),
    ]);
    let packed = |code: u16, pack: &dyn Fn(&[u8]) -> Vec<u8>| {
        each(ramp(), |mut page| {
            page.chunks = page.chunks[0].chunks(8).map(pack).collect();
            page.short(259, code).short(278, 2)
        })
    };
    samples.extend([
        little("strips", &packed(1, &<[u8]>::to_vec)),
        little("Deflate", &packed(8, &zlib)),
        little("old Deflate", &packed(32946, &zlib)),
        little("LZW", &packed(5, &lzw)),
        little("PackBits", &packed(32773, &packbits)),
        little(
            "LZW with a predictor",
            &each(packed(5, &|b| lzw(&differences(b, 4))), |page| page.short(317, 2)),
        ),
        little(
            "strips without sizes",
            &each(packed(1, &<[u8]>::to_vec), |page| page.with(279, Value::Long(vec![8, 4])).without(279)),
        ),
    ]);
    let tiled = |code: u16, pack: &dyn Fn(&[u8]) -> Vec<u8>| {
        let page = |z: usize| {
            let chunks =
                tiles(20, 17, |x, y| (x + 3 * y + 100 * z) as u8).iter().map(|tile| pack(tile)).collect();
            Page { chunks, ..Page::grey(20, 17, 8, 1, Vec::new()) }
                .short(259, code)
                .short(322, 16)
                .short(323, 16)
        };
        vec![page(0), page(1)]
    };
    samples.extend([little("tiles", &tiled(1, &<[u8]>::to_vec)), little("packed tiles", &tiled(8, &zlib))]);
    let rgb = |planar: bool, alpha: bool| {
        let n = if alpha { 4 } else { 3 };
        let page = |z: u8| {
            let pixel = |i: u8| [3 * (i + z), 4 * (i + z), 12 * (i + z), 255];
            let chunks: Vec<Vec<u8>> = if planar {
                (0..n).map(|c| (0..4).map(|i| pixel(i)[c]).collect()).collect()
            } else {
                vec![(0..4).flat_map(|i| pixel(i)[..n].to_vec()).collect()]
            };
            let page = Page { chunks, ..Page::grey(2, 2, 8, 1, Vec::new()) };
            let page = page.short(262, 2).short(277, n as u16).short(284, if planar { 2 } else { 1 });
            let page = page.with(258, Value::Short(vec![8; n]));
            if alpha { page.short(338, 2) } else { page }
        };
        vec![page(0), page(4)]
    };
    samples.extend([
        little("RGB", &rgb(false, false)),
        little("RGBA", &rgb(false, true)),
        little("RGB in planes", &rgb(true, false)),
        little("RGBA in planes", &rgb(true, true)),
    ]);
    let bits = |z: u8| Page::grey(9, 2, 1, 1, vec![0b1010_0000 | z, 0x80, 0b0000_0001, 0]);
    samples.push(little("bits", &[bits(0), bits(1)]));
    let nibbles = |z: u8| Page::grey(3, 2, 4, 1, vec![0x12, 0x30, 0x45, 0x60 | z]).short(262, 0);
    samples.push(little("nibbles", &[nibbles(0), nibbles(1)]));
    let jpeg = Page::grey(8, 8, 8, 1, JPEG.to_vec()).short(259, 7);
    samples.push(little("JPEG", &[jpeg.clone(), jpeg]));
    let (tables, rest) = JPEG.split_at(89);
    let tables = [tables, &[0xff, 0xd9]].concat();
    let page =
        Page::grey(8, 8, 8, 1, [&[0xff, 0xd8], rest].concat()).short(259, 7).with(347, Value::Bytes(tables));
    samples.push(little("JPEG with tables of the page", &[page.clone(), page]));
    let group4 = Page::grey(16, 12, 1, 1, GROUP4.to_vec()).short(259, 4);
    samples.push(little("CCITT", &[group4.clone(), group4]));
    let halves = Page::grey(2, 2, 16, 3, LITTLE.bytes([0x3c00_u16, 0xc000, 0, 0x7bff].map(u16::to_le_bytes)));
    samples.push(little("halves", &[halves.clone(), halves]));
    samples.push(little(
        "ImageJ",
        &first(ramp(), |page| {
            page.text("ImageJ=1.53t\nimages=2\nslices=2\nunit=um\nspacing=3\ncf=0\nc0=-8\nc1=0.5\n")
                .with(282, Value::Fraction(2, 1))
                .with(283, Value::Fraction(4, 1))
                .short(296, 1)
        }),
    ));
    samples.push(little("ImageJ behind one page", &[contiguous(24)]));
    samples.push(little("channels", &channels()));
    samples.push(little(
        "OME",
        &first(ramp(), |page| {
            page.text(
                "<OME><Image><Pixels DimensionOrder=\"XYZCT\" SizeZ=\"2\" SizeC=\"1\" SizeT=\"1\" \
                 PhysicalSizeX=\"2\" PhysicalSizeY=\"3\" PhysicalSizeZ=\"4\"/></Image></OME>",
            )
        }),
    ));
    let mut thumbnail = ramp();
    thumbnail.insert(1, Page::grey(2, 1, 8, 1, vec![7, 7]).with(254, Value::Long(vec![1])));
    samples.push(little("a thumbnail", &thumbnail));
    samples
}

/// One page with several images behind it.
fn contiguous(bytes: u8) -> Page {
    let page = Page { chunks: vec![(0..bytes).collect()], ..Page::grey(4, 3, 8, 1, Vec::new()) };
    page.text("ImageJ=1.53t\nimages=2\nslices=2\n").with(279, Value::Long(vec![12]))
}

/// Two channels of two slices.
fn channels() -> Vec<Page> {
    let page = |i: u8| Page::grey(2, 2, 8, 1, vec![i, 10 + i, 20 + i, 30 + i]);
    let pages = (0..4).map(page).collect();
    first(pages, |page| page.text("ImageJ=1.53t\nimages=4\nchannels=2\nslices=2\n"))
}

#[track_caller]
fn named(what: &str) -> Sample {
    samples().into_iter().find(|sample| sample.what == what).unwrap_or_else(|| panic!("{what}"))
}

#[test]
fn types_orders_and_big_files() {
    for sample in samples().iter().filter(|sample| sample.what == "orders") {
        let grid = grid(sample.loaded());
        assert_eq!(*grid.samples(), Samples::U16(vec![0, 1, 2, 3, 1000, 1001, 1002, 1003]));
        assert_eq!((grid.dims(), grid.spacing(), grid.anatomy()), ([2, 2, 2], DVec3::ONE, Anatomy::Unknown));
    }
    let wanted: Vec<f64> = (-2..6).map(f64::from).collect();
    for (what, kind) in
        [("i8", "f32"), ("i16", "i16"), ("i32", "f32"), ("i64", "f32"), ("f32", "f32"), ("f64", "f32")]
    {
        let grid = grid(named(what).loaded());
        assert_eq!(stored(&grid), wanted, "{what}");
        assert_eq!(grid.samples().type_name(), kind, "{what}");
    }
}

#[test]
fn strips_and_compressions() {
    for what in [
        "bytes",
        "strips",
        "strips without sizes",
        "Deflate",
        "old Deflate",
        "LZW",
        "PackBits",
        "LZW with a predictor",
        "a thumbnail",
        "ImageJ behind one page",
    ] {
        assert_eq!(numbers(&named(what)), upto(24), "{what}");
    }
    let report = named("a thumbnail").loaded().report;
    assert!(report.notes.iter().any(|note| note.contains("1 reduced pages")), "{:?}", report.notes);
}

#[test]
fn jpeg_and_fax() {
    for what in ["JPEG", "JPEG with tables of the page"] {
        let values = numbers(&named(what));
        for (i, wanted) in JPEG_VALUES.iter().cycle().take(128).enumerate() {
            // Decoders may round differently.
            assert!((values[i] - f64::from(*wanted)).abs() <= 1.0, "{what}: {i}: {} {wanted}", values[i]);
        }
        assert_eq!(values.len(), 128);
    }
    let image = grid(named("CCITT").loaded());
    for (x, y) in (0..12).flat_map(|y| (0..16).map(move |x| (x, y))) {
        assert_eq!(image.value(x, y, 1), f64::from(u8::from((x + y) % 5 == 0)), "{x} {y}");
    }
}

#[test]
fn tiles_lie_where_they_belong() {
    for what in ["tiles", "packed tiles"] {
        let grid = grid(named(what).loaded());
        assert_eq!(grid.dims(), [20, 17, 2]);
        for (x, y, z) in [(0, 0, 0), (15, 15, 0), (16, 15, 0), (15, 16, 1), (19, 16, 1), (3, 9, 1)] {
            assert_eq!(grid.value(x, y, z), f64::from(x + 3 * y + 100 * z), "{what} {x} {y} {z}");
        }
    }
}

#[test]
fn colours() {
    for what in ["RGB", "RGB in planes", "RGBA", "RGBA in planes"] {
        let loaded = named(what).loaded();
        assert!(loaded.report.shown.as_deref().unwrap().contains("colour"), "{:?}", loaded.report.shown);
        assert_eq!(stored(&grid(loaded)), (0..8).map(|i| 13.0 * f64::from(i)).collect::<Vec<_>>(), "{what}");
        let part = |array: &str| {
            let options = ReadOptions { array: Some(array.into()), ..OPTIONS };
            named(what).read(&options).map(|loaded| grid(loaded).samples().clone())
        };
        assert_eq!(part("colour:g").unwrap(), Samples::U8((0..8).map(|i| 4 * i).collect()), "{what}");
        assert_eq!(part("colour:2").unwrap(), Samples::U8((0..8).map(|i| 12 * i).collect()), "{what}");
        if what.contains('A') {
            assert_eq!(part("opacity").unwrap(), Samples::U8(vec![255; 8]));
        } else {
            assert!(part("opacity").unwrap_err().to_string().contains("there are point:colour (u8 x 3)"));
        }
    }
}

#[test]
fn few_bits_and_halves() {
    assert_eq!(
        numbers(&named("bits")),
        [1., 0., 1., 0., 0., 0., 0., 0., 1., 0., 0., 0., 0., 0., 0., 0., 1., 0.]
            .into_iter()
            .chain([1., 0., 1., 0., 0., 0., 0., 1., 1., 0., 0., 0., 0., 0., 0., 0., 1., 0.])
            .collect::<Vec<_>>()
    );
    assert_eq!(numbers(&named("nibbles")), [1., 2., 3., 4., 5., 6., 1., 2., 3., 4., 5., 6.]);
    let notes = named("nibbles").loaded().report.notes;
    assert!(notes.iter().any(|note| note.contains("white")), "{notes:?}");
    assert!(notes.iter().any(|note| note.contains("4 bits")), "{notes:?}");
    assert_eq!(numbers(&named("halves"))[..4], [1.0, -2.0, 0.0, 65504.0]);
    let palette = each(ramp(), |page| page.short(262, 3));
    let loaded = little("palette", &palette).loaded();
    assert!(loaded.report.notes.iter().any(|note| note.contains("palette")));
    assert_eq!(stored(&grid(loaded)), upto(24));
}

#[test]
fn scales() {
    let loaded = named("ImageJ").loaded();
    assert!(loaded.report.notes.contains(&"voxels of 0.5 x 0.25 x 3 um".to_owned()), "{:?}", loaded.report);
    let image = grid(loaded);
    assert_eq!(image.spacing(), DVec3::new(0.5, 0.25, 3.0));
    assert_eq!(image.range(), [-8.0, 3.5]);
    assert_eq!(grid(named("OME").loaded()).spacing(), DVec3::new(2.0, 3.0, 4.0));
    let turned = first(ramp(), |page| page.short(274, 3));
    assert!(little("turned", &turned).loaded().report.warnings[0].contains("Orientation 3"));
}

#[test]
fn channels_are_arrays() {
    let loaded = named("channels").loaded();
    assert_eq!(loaded.report.arrays.len(), 2);
    assert!(
        loaded.report.warnings[0].contains("2 volumes, point:channel 1 is shown"),
        "{:?}",
        loaded.report.warnings
    );
    assert_eq!(stored(&grid(loaded)), [0., 10., 20., 30., 2., 12., 22., 32.]);
    let options = ReadOptions { array: Some("channel 2".into()), ..OPTIONS };
    let loaded = named("channels").read(&options).unwrap();
    assert!(loaded.report.warnings.is_empty(), "{:?}", loaded.report.warnings);
    assert_eq!(stored(&grid(loaded)), [1., 11., 21., 31., 3., 13., 23., 33.]);
}

#[test]
fn channels_of_one_slice_are_slices() {
    let described = |text: &str| first(ramp(), |page| page.text(text));
    let ome =
        "<OME><Image><Pixels DimensionOrder=\"XYCZT\" SizeC=\"2\" SizeZ=\"1\" SizeT=\"1\"/></Image></OME>";
    for (what, pages) in [
        ("ImageJ", described("ImageJ=1.11a\nimages=2\nchannels=2\nhyperstack=true\nmode=grayscale\n")),
        ("OME", described(ome)),
        ("images", vec![contiguous(24).text("ImageJ=1.11a\nimages=2\nchannels=2\n")]),
    ] {
        let loaded = little(what, &pages).loaded();
        assert_eq!(loaded.report.warnings, ["2 channels of one slice are taken as slices"], "{what}");
        assert_eq!(stored(&grid(loaded)), upto(24), "{what}");
    }
    let one = first(ramp(), |page| page.text("ImageJ=1.11a\nchannels=3\nframes=5\n"));
    little("one page", &one[..1])
        .refused(&["pages: 1 slice", "announces 3 channels x 1 slices x 5 frames, there is 1 page"]);
}

#[test]
fn many_volumes() {
    let data = (0..8800_u32).map(|i| i.to_le_bytes()[0]).collect();
    let page = Page::grey(2, 2, 8, 1, data).with(279, Value::Long(vec![4]));
    let page = page.text("ImageJ=1.53t\nimages=2200\nslices=2\nframes=1100\n");
    let options = ReadOptions { array: Some("frame 1100".into()), ..OPTIONS };
    let loaded = little("1100 frames", &[page]).read(&options).unwrap();
    assert_eq!(loaded.report.arrays.len(), 1100);
    assert_eq!(stored(&grid(loaded)), (88..96).map(f64::from).collect::<Vec<_>>());
}

/// The head of `CZ_LSMINFO`: extents x, y, z, channels, time, and sizes of a voxel in metres.
fn lsm(magic: u32, dims: [i32; 5], voxel: [f64; 3]) -> Value {
    let mut bytes = [magic.to_le_bytes(), 64_u32.to_le_bytes()].concat();
    bytes.extend(dims.iter().flat_map(|extent| extent.to_le_bytes()));
    bytes.resize(40, 0);
    bytes.extend(voxel.iter().flat_map(|size| size.to_le_bytes()));
    Value::Bytes(bytes)
}

#[test]
fn lsm_tells_scale_and_time() {
    let pages = |info: &Value| {
        let pages = (0..4).map(|i: u8| Page::grey(2, 2, 8, 1, vec![i, 10 + i, 20 + i, 30 + i])).collect();
        first(pages, |page| page.with(34412, info.clone()))
    };
    let voxel = [0.5e-6, 0.25e-6, 2e-6];
    let loaded = little("time", &pages(&lsm(0x0040_494c, [2, 2, 2, 1, 2], voxel))).loaded();
    assert_eq!(loaded.report.arrays.len(), 2);
    assert_eq!(loaded.report.warnings, ["2 volumes, point:frame 1 is shown: name another array to see it"]);
    let image = grid(loaded);
    assert!((image.spacing() - DVec3::new(0.5, 0.25, 2.0)).length() < 1e-12, "{}", image.spacing());
    assert_eq!(stored(&image), [0., 10., 20., 30., 1., 11., 21., 31.]);
    let other_size = little("another size", &pages(&lsm(0x0030_494c, [3, 2, 2, 1, 2], voxel))).loaded();
    assert!(other_size.report.warnings[0].contains("CZ_LSMINFO: 3 x 2"), "{:?}", other_size.report.warnings);
    for info in [lsm(0x0050_494c, [2, 2, 2, 1, 2], voxel), Value::Bytes(vec![0; 9])] {
        let loaded = little("no such head", &pages(&info)).loaded();
        let warning = &loaded.report.warnings[0];
        assert!(warning.contains("CZ_LSMINFO") && warning.contains("time steps may be stacked"), "{warning}");
        assert_eq!(grid(loaded).dims(), [2, 2, 4]);
    }
    let unknown =
        little("no size", &pages(&lsm(0x0040_494c, [2, 2, 4, 1, 1], [0.5e-6, 0.0, f64::NAN]))).loaded();
    assert!(unknown.report.warnings[0].contains("voxel"), "{:?}", unknown.report.warnings);
}

#[test]
fn refusals_name_the_page_and_the_rule() {
    let refused = |what, pages: &[Page], parts: &[&str]| little(what, pages).refused(parts);
    let all = |tag, value| each(ramp(), |page| page.short(tag, value));
    refused("one page", &ramp()[..1], &["pages: 1 slice", "name their folder"]);
    refused(
        "sizes differ",
        &[ramp().remove(0), Page::grey(3, 4, 8, 1, vec![0; 12])],
        &["page 2: 3 x 4", "4 x 3"],
    );
    refused(
        "types differ",
        &[ramp().remove(0), Page::grey(4, 3, 8, 2, vec![0; 12])],
        &["page 2", "i8", "u8"],
    );
    let white = first(ramp(), |page| page.short(262, 0));
    refused("greys differ", &white, &["page 2", "PhotometricInterpretation 1 instead of 0"]);
    refused("JPEG 2000", &all(259, 34712), &["page 1: Compression: 34712 (JPEG 2000)"]);
    refused("Zstandard", &all(259, 50000), &["Compression: 50000 (Zstandard)", "LZW"]);
    refused("CMYK", &all(262, 5), &["PhotometricInterpretation: 5 (CMYK)"]);
    refused("12 bits", &all(258, 12), &["BitsPerSample: 12 bits of sample format 1"]);
    refused("complex", &all(339, 6), &["sample format 6"]);
    refused("low bits first", &all(266, 2), &["FillOrder: 2"]);
    refused("a predictor alone", &all(317, 2), &["Predictor: 2: not known with uncompressed"]);
    refused("deep pages", &all(32997, 5), &["page 1: ImageDepth: 5: ", "one page for each slice"]);
    refused("deep tiles", &all(32998, 2), &["page 1: TileDepth: 2: "]);
    refused("no rows", &all(278, 0), &["RowsPerStrip: 0"]);
    refused("too few strips", &all(278, 1), &["StripOffsets: 1: 3 strips or tiles are needed"]);
    refused(
        "short strip",
        &each(ramp(), |mut page| {
            page.chunks[0].pop();
            page
        }),
        &["page 1: strip or tile 0: 11 bytes: 12 are needed"],
    );
    refused("no width", &each(ramp(), |page| page.without(256)), &["page 1: ImageWidth: 0"]);
    refused("beyond the file", &each(ramp(), |page| page.with(273, Value::Long(vec![9999]))), &["byte 9999"]);
    let huge =
        each(ramp(), |page| page.with(256, Value::Long(vec![1 << 20])).with(257, Value::Long(vec![1 << 20])));
    refused("huge", &huge, &["2199023255552 bytes: the limit is"]);
    let large =
        each(ramp(), |page| page.with(256, Value::Long(vec![1 << 12])).with(257, Value::Long(vec![1 << 12])));
    refused("large", &large, &["needs 33554432 bytes for 2 slices", "hold at most"]);
    let bomb = each(large, |page| page.short(259, 8));
    refused("bomb", &bomb, &["needs 33554432 bytes for 2 slices", "hold at most"]);
    refused(
        "images",
        &[contiguous(23).with(273, Value::Long(vec![8])).text("ImageJ=1\nimages=99\nslices=99\n")],
        &["images: 99: there is 1 page", "1188 bytes"],
    );
    // Two pages that share a strip of which each needs a part only.
    let runs = [packbits(&(0..12).collect::<Vec<u8>>()), vec![0; 2000]].concat();
    let mut shared = each(ramp(), |page| {
        page.short(259, 32773).with(273, Value::Long(vec![8])).with(279, Value::Long(vec![2013]))
    });
    shared[0].chunks = vec![runs];
    refused("overlap", &shared, &["page 2: strip or tile 0 at byte 8: strips or tiles overlap"]);
    let jpeg = |width, height| Page::grey(width, height, 8, 1, JPEG.to_vec()).short(259, 7);
    refused(
        "JPEG of another size",
        &[jpeg(8, 9), jpeg(8, 9)],
        &["JPEG of 8 x 8 pixels, 1 x 8 bits: does not fit"],
    );

    let mut ring = LITTLE.file(&ramp());
    let second = ring.len() - 4;
    let begin = ring[4..8].to_vec();
    ring[second..].copy_from_slice(&begin);
    Sample::one("a ring", "a.tif", ring).refused(&["page 2: next directory", "has a loop"]);
    let mut cut = LITTLE.file(&ramp());
    cut.truncate(cut.len() - 6);
    Sample::one("cut", "a.tif", cut).refused(&["page 2: directory", "the file has"]);
    Sample::one("gzip", "a.tif", crate::formats::support::gzip(&LITTLE.file(&ramp()))).refused(&["gzip"]);
    let damaged = each(ramp(), |mut page| {
        page.chunks[0] = vec![0x78, 0x9c, 0xff, 0xff, 0xff];
        page.short(259, 8)
    });
    refused("damaged", &damaged, &["page 1: strip or tile 0 at byte 8: Deflate is damaged"]);
}

/// Pages whose samples lie in the file as they are read stay there, and what is read of them is that of the whole; others are read.
#[test]
fn bare_pages_stay_in_their_file() {
    let on_demand = ReadOptions { on_demand: Some(1), ..OPTIONS };
    let gaps = each(ramp(), |mut page| {
        page.chunks = page.chunks[0].chunks(8).map(|chunk| [chunk, &[99]].concat()).collect();
        page.short(278, 2)
    });
    let bare = [
        "bytes",
        "orders",
        "i8",
        "i16",
        "i32",
        "i64",
        "f32",
        "f64",
        "strips",
        "strips without sizes",
        "RGB",
        "ImageJ",
        "ImageJ behind one page",
        "channels",
        "OME",
        "a thumbnail",
    ];
    for sample in samples().into_iter().chain([little("gaps", &gaps)]) {
        let what = sample.what;
        let [whole, own] = [&OPTIONS, &on_demand].map(|options| grid(sample.read(options).unwrap()));
        assert_eq!(
            (stored(&own), own.spacing(), own.rescale()),
            (stored(&whole), whole.spacing(), whole.rescale()),
            "{what}"
        );
        let Samples::OnDemand(samples) = own.samples() else {
            assert!(!bare.contains(&what), "{what}");
            continue;
        };
        assert!(bare.contains(&what), "{what}");
        let part = samples.read([1, 0, 1], [1, 2, 1]).unwrap();
        let all = stored(&whole);
        let [nx, ny, _] = whole.dims().map(|n| n as usize);
        assert_eq!([part.get(0), part.get(1)], [all[nx * ny + 1], all[nx * ny + nx + 1]], "{what}");
    }
    let page = Page::grey(40, 30, 8, 1, vec![7; 1200])
        .with(273, Value::Long(vec![8]))
        .with(279, Value::Long(vec![1200]));
    let again = Page { chunks: Vec::new(), ..page.clone() };
    let shared = vec![page, again.clone(), again.clone(), again];
    for (pages, parts) in [
        (shared, "strips or tiles overlap"),
        (each(ramp(), |page| page.with(273, Value::Long(vec![9999]))), "12 bytes at byte 9999"),
        (each(ramp(), |page| page.with(257, Value::Long(vec![1 << 20]))), "strip or tile 0: 12 bytes"),
    ] {
        let error = little("refused", &pages).read(&on_demand).unwrap_err();
        assert_refusal(&error, &["a.tif: page ", parts], parts);
    }
}

#[test]
fn memory_stays_within_the_limit() {
    let sample = named("packed tiles");
    assert!(sample.read(&ReadOptions::within(680 + 340)).unwrap_err().to_string().contains("of the limit"));
    sample.read(&ReadOptions::within(680 + 340 + (1 << 18))).unwrap();
    named("bytes").read(&ReadOptions::within(24)).unwrap();
    assert!(named("bytes").read(&ReadOptions::within(23)).is_err());
}

#[test]
fn damage_never_panics() {
    for sample in samples() {
        let (name, bytes) = &sample.files[0];
        for at in 0..bytes.len() {
            for change in [1, 0x80, 0xff] {
                let mut bytes = bytes.clone();
                bytes[at] ^= change;
                let _ = Sample::one(sample.what, name, bytes).read(&ReadOptions::within(1 << 20));
            }
            let _ = Sample::one(sample.what, name, &bytes[..at]).read(&ReadOptions::within(1 << 20));
        }
    }
}

#[test]
fn real_stacks() {
    let cases = [
        ("structured/mri_head_anisotropic.tif", [186, 226, 27], DVec3::new(0.5, 0.5, 7.0)),
        ("structured/spots_16bit.tif", [89, 88, 17], DVec3::new(1e6 / 10_623_103.0, 1e6 / 10_623_103.0, 0.4)),
        ("format_conformance/head_i16_imagej.tif", [64, 64, 40], DVec3::new(3.2, 3.2, 1.5)),
    ];
    for (name, dims, spacing) in cases {
        let Some(loaded) = shared_loaded(name) else { return };
        assert!(loaded.report.warnings.is_empty(), "{name}: {:?}", loaded.report.warnings);
        let grid = grid(loaded);
        assert_eq!(grid.dims(), dims, "{name}");
        assert!((grid.spacing() - spacing).length() < 1e-12, "{name}: {}", grid.spacing());
        if name.contains("spots") {
            assert_eq!(grid.range(), [208.0, 54004.0]);
        }
        if name.contains("head_i16") {
            let npy =
                std::fs::read(crate::formats::support::shared("format_conformance/head_i16.npy").unwrap())
                    .unwrap();
            let data = &npy[npy.len() - 2 * 64 * 64 * 40..];
            let wanted = data.as_chunks::<2>().0.iter().map(|pair| i16::from_le_bytes(*pair)).collect();
            assert_eq!(*grid.samples(), Samples::I16(wanted));
        }
    }
}
