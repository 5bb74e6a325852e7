//! Calibration from the first page's tags: the descriptions of ImageJ (lines of `key=value`), of OME-XML (the first
//! `Pixels`), or neither; and the tag of Zeiss microscopes.

use glam::DVec3;
use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};
use tiff::tags::Tag;

use crate::error::Result;
use crate::io::file::sample_type::SampleType;
use crate::io::file::text;
use crate::io::formats::tiff::calibration::{Calibration, Resolution, UNKNOWN_VOXEL};
use crate::io::formats::tiff::file::{Directory, Entry, LSM};
use crate::io::formats::tiff::page::Page;
use crate::scene::Rescale;

/// The limit on bytes of the description that are read.
const MAX_DESCRIPTION: u64 = 4 << 20;

impl Directory<'_> {
    /// Reads the calibration from the first page.
    pub(crate) fn calibration(&self, page: &Page) -> Result<Calibration> {
        let description = match self.find(Tag::ImageDescription).filter(|entry| entry.size() == 1) {
            Some(entry) => self.bytes(&entry, entry.count.min(MAX_DESCRIPTION))?,
            None => Vec::new(),
        };
        let end = description.iter().position(|&byte| byte == 0).unwrap_or(description.len());
        let description = String::from_utf8_lossy(&description[..end]);
        let pixels = [self.fraction(Tag::XResolution)?, self.fraction(Tag::YResolution)?];
        let resolution = Resolution { pixels, unit: self.number(Tag::ResolutionUnit, 2)? };
        let integer = page.samples == 1 && matches!(page.kind, SampleType::U8 | SampleType::U16);
        let mut calibration = calibration(&description, resolution, integer);
        if let Some(entry) = self.find(LSM) {
            self.microscope(page, &entry, &mut calibration)?;
        }
        let orientation = self.number(Tag::Orientation, 1)?;
        if orientation != 1 {
            calibration.warnings.push(format!(
                "Orientation {orientation} is not applied: rows and columns lie as they are stored"
            ));
        }
        Ok(calibration)
    }

    /// Applies the tag of Zeiss microscopes: voxel size in metres, and the numbers of slices and points in time.
    /// Channels are samples of a pixel.
    fn microscope(&self, page: &Page, entry: &Entry, calibration: &mut Calibration) -> Result<()> {
        let Calibration { notes, warnings, .. } = calibration;
        /// The number of bytes that are read.
        const LEN: u64 = 64;
        let known = entry.size() == 1 && entry.count >= LEN;
        let bytes = if known { self.bytes(entry, LEN)? } else { vec![0; 64] };
        let whole = |at: usize, len: usize| self.file.endian.whole(&bytes[at..at + len]);
        let [magic, width, height, slices, frames] = [0, 8, 12, 16, 24].map(|at| whole(at, 4));
        // Counts are signed 32-bit numbers.
        let counts = [slices, frames].iter().all(|count| (1..=0x7fff_ffff).contains(count));
        let why = if !matches!(magic, 0x0030_494c | 0x0040_494c) {
            "is none that is known".to_owned()
        } else if !counts {
            format!("{slices} slices, {frames} points in time")
        } else if [width, height] != [page.width, page.height].map(u64::from) {
            format!("{width} x {height} pixels, the page has {} x {}", page.width, page.height)
        } else {
            calibration.axes = [('C', 1), ('Z', slices), ('T', frames)];
            notes.retain(|note| note != UNKNOWN_VOXEL);
            let sizes = [40, 48, 56].map(|at| f64::from_bits(whole(at, 8)) * 1e6);
            let [x, y, z] = sizes.map(|size| Some(size).filter(|size| *size > 0.0 && size.is_finite()));
            if let (Some(x), Some(y)) = (x, y) {
                if z.is_none() {
                    let warning = "CZ_LSMINFO: no distance of slices: 1 \u{b5}m is assumed";
                    warnings.push(warning.to_owned());
                }
                let z = z.unwrap_or(1.0);
                calibration.spacing = DVec3::new(x, y, z);
                notes.push(format!("voxels of {x} x {y} x {z} \u{b5}m"));
            } else {
                warnings.push("CZ_LSMINFO: the size of a voxel is unknown and counts as 1".to_owned());
            }
            return Ok(());
        };
        warnings.push(format!(
            "CZ_LSMINFO: {why}: the size of a voxel was not read, and time steps may be stacked as slices"
        ));
        Ok(())
    }
}

/// Parses a description. `integer` is whether pixels have one sample, unsigned and of at most 16 bits.
fn calibration(description: &str, resolution: Resolution, integer: bool) -> Calibration {
    if description.starts_with("ImageJ=") {
        imagej(description, resolution, integer)
    } else if let Some(calibration) = ome(description) {
        calibration
    } else {
        plain(description, resolution)
    }
}

/// Returns the calibration of a description that gives no voxel size.
fn plain(description: &str, resolution: Resolution) -> Calibration {
    let mut calibration = Calibration::unknown();
    let ratio = resolution.sizes().map(|[x, y]| y / x).filter(|ratio| ratio.is_finite() && *ratio > 0.0);
    if let Some(ratio) = ratio
        && ratio != 1.0
    {
        calibration.spacing.y = ratio;
        calibration.notes.push(format!(
            "pixels are {ratio} times as high as wide; the distance of slices is unknown and counts as one width"
        ));
    } else {
        calibration.notes.push(UNKNOWN_VOXEL.to_owned());
    }
    if let Some(shape) = shape(description)
        && shape.iter().rev().skip(2).filter(|&&extent| extent > 1).count() > 1
    {
        calibration.warnings.push(format!(
            "the description says shape {shape:?}: all pages are taken as slices of one volume"
        ));
    }
    calibration
}

/// Returns the `shape` of a description in JSON.
fn shape(description: &str) -> Option<Vec<u64>> {
    if !description.starts_with('{') {
        return None;
    }
    let json: serde_json::Value = serde_json::from_str(description).ok()?;
    json.get("shape")?.as_array()?.iter().take(16).map(serde_json::Value::as_u64).collect()
}

fn imagej(description: &str, resolution: Resolution, integer: bool) -> Calibration {
    let field = |name: &str| {
        let mut values = description.lines().filter_map(|line| line.split_once('='));
        values.find(|(key, _)| *key == name).map(|(_, value)| text::shown(value.trim()))
    };
    let number = |name: &str| field(name)?.parse::<f64>().ok().filter(|number| number.is_finite());
    let count = |name: &str| field(name)?.parse::<u64>().ok();
    let axes = [("channels", 'C'), ("slices", 'Z'), ("frames", 'T')]
        .map(|(name, axis)| (axis, count(name).unwrap_or(1).max(1)));
    let (mut notes, mut warnings) = (Vec::new(), Vec::new());

    // As in ImageJ, 72 pixels per inch means an unknown scale.
    let screen = resolution.unit == 2 && resolution.pixels[0] == Some(72.0);
    let unit = match field("unit").map(|unit| unit.replace("\\u00B5", "\u{b5}")) {
        Some(unit) if !unit.is_empty() => unit,
        _ if resolution.unit == 2 && !screen => "inch".to_owned(),
        _ if resolution.unit == 3 => "cm".to_owned(),
        _ => "pixel".to_owned(),
    };
    let [x, y] = resolution.sizes().filter(|_| !screen).unwrap_or([1.0; 2]);
    let z = number("spacing").filter(|&spacing| spacing != 0.0);
    match z {
        Some(spacing) if spacing < 0.0 => warnings.push(format!("spacing {spacing}: its magnitude is used")),
        None if [x, y] != [1.0; 2] => warnings.push(format!("no spacing of slices: 1 {unit} is assumed")),
        _ => {}
    }
    let spacing = DVec3::new(x, y, z.map_or(1.0, f64::abs));
    notes.push(format!("voxels of {x} x {y} x {} {unit}", spacing.z));
    for name in ["yunit", "zunit"] {
        if let Some(other) = field(name).filter(|other| !other.is_empty() && *other != unit) {
            warnings.push(format!("{name} {other} is not the unit {unit}: no length is converted"));
        }
    }

    // ImageJ gives the origin in pixels.
    let origin = ["xorigin", "yorigin", "zorigin"].map(|name| number(name).unwrap_or(0.0));
    if origin != [0.0; 3] {
        let [x, y, z] = origin;
        notes.push(format!("the origin lies at voxel {x}, {y}, {z}"));
    }

    // Function 0 is a straight line, for samples of 8 and 16 bits; signed samples are stored with an offset of 32768.
    let mut rescale = None;
    match field("cf").as_deref() {
        Some("0") if integer => match (number("c0"), number("c1")) {
            (Some(intercept), Some(slope)) if slope != 0.0 => {
                rescale = Some(Rescale { slope, intercept });
                let unit = field("vunit").unwrap_or_default();
                notes.push(format!("values are {slope} x stored + {intercept} {unit}").trim().to_owned());
            }
            _ => warnings.push("calibration function without c0 and c1: not applied".to_owned()),
        },
        // Function 20 is ImageJ's code for none.
        None | Some("20") => {}
        Some(function) => {
            warnings.push(format!("calibration function {function} is not applied: values are as stored"));
        }
    }
    let origin = if origin == [0.0; 3] { DVec3::ZERO } else { -DVec3::from_array(origin) * spacing };
    Calibration { spacing, origin, rescale, images: count("images"), axes, notes, warnings }
}

/// Parses the first `Pixels` of OME-XML; None if the description is something else.
fn ome(description: &str) -> Option<Calibration> {
    if !description.trim_start().starts_with('<') {
        return None;
    }
    let mut reader = quick_xml::Reader::from_str(description);
    let (mut images, mut found, mut first) = (0_u32, false, None);
    // An incomplete or damaged description ends the search.
    while let Ok(event) = reader.read_event() {
        match event {
            Event::Eof => break,
            Event::Start(element) | Event::Empty(element) => match element.local_name().as_ref() {
                "OME" => found = true,
                "Image" => images += 1,
                "Pixels" if found && first.is_none() => first = Some(pixels(&element)),
                _ => {}
            },
            _ => {}
        }
    }
    let mut calibration = first?;
    if images > 1 {
        calibration
            .warnings
            .push(format!("OME-XML describes {images} images: the voxel size of the first one is used"));
    }
    Some(calibration)
}

fn pixels(element: &BytesStart) -> Calibration {
    let attribute = |name: &str| {
        let attribute = element.try_get_attribute(name).ok()??;
        Some(text::shown(&attribute.normalized_value(XmlVersion::Implicit1_0).ok()?))
    };
    let mut calibration = Calibration::unknown();
    let order = attribute("DimensionOrder").unwrap_or_default();
    let size = |axis: char| {
        attribute(&format!("Size{axis}")).and_then(|size| size.parse::<u64>().ok()).unwrap_or(1).max(1)
    };
    let mut axes: Vec<(char, u64)> =
        order.chars().filter(|axis| "CZT".contains(*axis)).map(|axis| (axis, size(axis))).collect();
    axes.dedup_by_key(|(axis, _)| *axis);
    if let Ok(axes) = <[(char, u64); 3]>::try_from(axes) {
        calibration.axes = axes;
    }

    let unit =
        |axis: char| attribute(&format!("PhysicalSize{axis}Unit")).unwrap_or_else(|| "\u{b5}m".to_owned());
    let length = |axis: char| {
        let size: f64 = attribute(&format!("PhysicalSize{axis}"))?.trim().parse().ok()?;
        Some(size).filter(|size| *size > 0.0 && size.is_finite())
    };
    let (Some(x), Some(y)) = (length('X'), length('Y')) else {
        calibration.notes.push(UNKNOWN_VOXEL.to_owned());
        return calibration;
    };
    let world = unit('X');
    let mut spacing = [x, y, 1.0];
    for (place, axis, length) in [(1, 'Y', Some(y)), (2, 'Z', length('Z'))] {
        let own = unit(axis);
        match (length, metres(&own), metres(&world)) {
            (None, ..) => calibration.warnings.push(format!("no PhysicalSizeZ: 1 {world} is assumed")),
            (Some(length), ..) if own == world => spacing[place] = length,
            (Some(length), Some(own), Some(world)) => spacing[place] = length * (own / world),
            _ => calibration
                .warnings
                .push(format!("PhysicalSize{axis} is in {own}, PhysicalSizeX in {world}: not converted")),
        }
    }
    calibration.spacing = DVec3::from_array(spacing);
    calibration.notes.push(format!("voxels of {} x {} x {} {world}", spacing[0], spacing[1], spacing[2]));
    calibration
}

/// Returns the length of a unit of OME-XML in metres.
fn metres(unit: &str) -> Option<f64> {
    Some(match unit {
        "pm" => 1e-12,
        "\u{c5}" => 1e-10,
        "nm" => 1e-9,
        "\u{b5}m" | "\u{3bc}m" => 1e-6,
        "mm" => 1e-3,
        "cm" => 1e-2,
        "m" => 1.0,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::formats::tiff::calibration::Volume;

    const UNKNOWN: Resolution = Resolution { pixels: [None; 2], unit: 1 };

    fn names(volumes: &[Volume]) -> Vec<(&str, usize, usize, usize)> {
        volumes.iter().map(|v| (v.name.as_str(), v.first, v.stride, v.slices)).collect()
    }

    #[test]
    fn imagej_lengths_origin_and_values() {
        let text = "ImageJ=1.53t\nimages=27\nslices=27\nunit=\\u00B5m\nspacing=-7.0\nxorigin=2\nzorigin=-1\n\
                    cf=0\nc0=-32768.0\nc1=2.0\nvunit=HU\nzunit=mm\nloop=false\n";
        let resolution = Resolution { pixels: [Some(2.0), Some(4.0)], unit: 1 };
        let mut found = calibration(text, resolution, true);
        assert_eq!(found.spacing, DVec3::new(0.5, 0.25, 7.0));
        assert_eq!(found.origin, DVec3::new(-1.0, 0.0, 7.0));
        assert_eq!(found.rescale, Some(Rescale { slope: 2.0, intercept: -32768.0 }));
        assert_eq!(found.notes[0], "voxels of 0.5 x 0.25 x 7 \u{b5}m");
        assert_eq!(found.notes[2], "values are 2 x stored + -32768 HU");
        assert_eq!(found.warnings.len(), 2, "{:?}", found.warnings);
        assert_eq!(names(&found.volumes(27)), [("", 0, 1, 27)]);
        assert_eq!(calibration(text, resolution, false).rescale, None, "floats have none");
        assert!(calibration(text, resolution, false).warnings[2].contains("function 0 is not applied"));
    }

    #[test]
    fn imagej_without_a_scale() {
        let screen = Resolution { pixels: [Some(72.0); 2], unit: 2 };
        assert_eq!(calibration("ImageJ=1\n", screen, false).spacing, DVec3::ONE);
        assert_eq!(calibration("ImageJ=1\n", screen, false).warnings.len(), 0);
        let cm = Resolution { pixels: [Some(4.0); 2], unit: 3 };
        let found = calibration("ImageJ=1\nspacing=0\n", cm, false);
        assert_eq!(found.spacing, DVec3::new(0.25, 0.25, 1.0));
        assert_eq!(found.warnings, ["no spacing of slices: 1 cm is assumed"]);
    }

    #[test]
    fn channels_and_frames() {
        let of = |text: &str, pages| {
            let mut found = calibration(text, UNKNOWN, false);
            let volumes = found.volumes(pages);
            (volumes, found.warnings)
        };
        let (volumes, _) = of("ImageJ=1\nchannels=2\nslices=3\nframes=2\n", 12);
        assert_eq!(
            names(&volumes),
            [
                ("frame 1 channel 1", 0, 2, 3),
                ("frame 1 channel 2", 1, 2, 3),
                ("frame 2 channel 1", 6, 2, 3),
                ("frame 2 channel 2", 7, 2, 3)
            ]
        );
        let (volumes, warnings) = of("ImageJ=1\nchannels=2\nframes=4\n", 8);
        assert_eq!(names(&volumes), [("channel 1", 0, 2, 4), ("channel 2", 1, 2, 4)]);
        assert_eq!(warnings, ["4 frames of one slice are taken as slices"]);
        let (volumes, warnings) = of("ImageJ=1\nchannels=2\nslices=3\n", 7);
        assert_eq!(names(&volumes), [("", 0, 1, 7)]);
        assert!(warnings[0].contains("2 channels x 3 slices x 1 frames, there are 7 pages"), "{warnings:?}");
        let (volumes, _) = of("ImageJ=1\nchannels=18446744073709551615\nslices=18446744073709551615\n", 7);
        assert_eq!(volumes.len(), 1);
    }

    #[test]
    fn ome_lengths_and_orders() {
        let text = "<?xml version=\"1.0\"?><OME xmlns=\"x\"><Image ID=\"a\"><Pixels DimensionOrder=\"XYZCT\" \
                    SizeX=\"4\" SizeY=\"4\" SizeZ=\"3\" SizeC=\"2\" SizeT=\"1\" PhysicalSizeX=\"0.5\" \
                    PhysicalSizeY=\"500\" PhysicalSizeYUnit=\"nm\" PhysicalSizeZ=\"0.002\" PhysicalSizeZUnit=\"mm\"/>\
                    </Image></OME>";
        let mut found = calibration(text, UNKNOWN, false);
        assert!((found.spacing - DVec3::new(0.5, 0.5, 2.0)).length() < 1e-12, "{}", found.spacing);
        assert_eq!(names(&found.volumes(6)), [("channel 1", 0, 1, 3), ("channel 2", 3, 1, 3)]);
        assert_eq!(found.warnings.len(), 0, "{:?}", found.warnings);

        let two = text.replace("</Image>", "</Image><Image/>").replace("\"mm\"", "\"parsec\"");
        let found = calibration(&two, UNKNOWN, false);
        assert_eq!(found.spacing.z, 1.0);
        assert_eq!(found.warnings.len(), 2, "{:?}", found.warnings);
        let bare = calibration("<OME><Image><Pixels/></Image></OME>", UNKNOWN, false);
        assert_eq!((bare.spacing, bare.warnings.len()), (DVec3::ONE, 0));
        assert_eq!(calibration("<OME><Image", UNKNOWN, false).notes.len(), 1);
    }

    #[test]
    fn other_descriptions() {
        let uneven = Resolution { pixels: [Some(300.0), Some(150.0)], unit: 2 };
        assert_eq!(calibration("a scan", uneven, false).spacing, DVec3::new(1.0, 2.0, 1.0));
        let warned = calibration("{\"shape\": [2, 5, 64, 64]}", UNKNOWN, false);
        assert!(warned.warnings[0].contains("shape [2, 5, 64, 64]"));
        assert_eq!(calibration("{\"shape\": [1, 5, 64, 64]}", UNKNOWN, false).warnings.len(), 0);
    }
}
