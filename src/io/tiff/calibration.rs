//! What image descriptions say of a stack: ImageJ's lines, OME-XML.

use glam::DVec3;
use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};

use crate::io::text;
use crate::scene::Rescale;

/// What the pages of a stack are, and how large a voxel is.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Calibration {
    pub(super) spacing: DVec3,
    pub(super) origin: DVec3,
    pub(super) rescale: Option<Rescale>,
    /// Images that the description announces.
    pub(super) images: Option<u64>,
    /// Extents of `C`, `Z` and `T`, the one that changes from page to page first.
    axes: [(char, u64); 3],
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
}

/// Pages that make one volume: `first`, and every `stride`-th after it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Volume {
    /// Channel and frame, where there are several.
    pub(super) name: String,
    pub(super) first: usize,
    pub(super) stride: usize,
    pub(super) slices: usize,
}

/// The tags of a page that tell its scale.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Resolution {
    /// Pixels per unit along x and y.
    pub(super) pixels: [Option<f64>; 2],
    /// The code of the unit: 1 none, 2 inch, 3 centimetre.
    pub(super) unit: u64,
}

impl Resolution {
    /// Sizes of a pixel, where both are known.
    fn sizes(self) -> Option<[f64; 2]> {
        let size = |pixels: Option<f64>| {
            pixels.map(|pixels| 1.0 / pixels).filter(|size| *size > 0.0 && size.is_finite())
        };
        Some([size(self.pixels[0])?, size(self.pixels[1])?])
    }
}

/// What there is to say of a stack of samples of so many bits.
pub(super) fn calibration(
    description: &str,
    resolution: Resolution,
    integer_bits: Option<u16>,
) -> Calibration {
    if description.starts_with("ImageJ=") {
        imagej(description, resolution, integer_bits)
    } else if let Some(calibration) = ome(description) {
        calibration
    } else {
        plain(description, resolution)
    }
}

impl Calibration {
    fn unknown() -> Self {
        Self {
            spacing: DVec3::ONE,
            origin: DVec3::ZERO,
            rescale: None,
            images: None,
            axes: [('C', 1), ('Z', 1), ('T', 1)],
            notes: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// The description's counts, where there are others than of slices.
    pub(super) fn announced(&self) -> Option<String> {
        let [channels, slices, frames] = ['C', 'Z', 'T'].map(|axis| extent(&self.axes, axis));
        (channels > 1 || frames > 1).then(|| {
            format!("the description announces {channels} channels x {slices} slices x {frames} frames")
        })
    }

    /// What a microscope's own tag says, where nothing else says more: voxels in metres, and how many
    /// slices and points in time there are. Channels are samples of a pixel.
    pub(super) fn microscope(&mut self, metres: [f64; 3], slices: u64, frames: u64) {
        self.axes = [('C', 1), ('Z', slices.max(1)), ('T', frames.max(1))];
        self.notes.retain(|note| note != UNKNOWN_VOXEL);
        let length = |metres: f64| Some(metres * 1e6).filter(|length| *length > 0.0 && length.is_finite());
        let [x, y, z] = metres.map(length);
        if let (Some(x), Some(y)) = (x, y) {
            if z.is_none() {
                let warning = "CZ_LSMINFO: no distance of slices: 1 \u{b5}m is assumed";
                self.warnings.push(warning.to_owned());
            }
            let z = z.unwrap_or(1.0);
            self.spacing = DVec3::new(x, y, z);
            self.notes.push(format!("voxels of {x} x {y} x {z} \u{b5}m"));
        } else {
            self.warnings.push("CZ_LSMINFO: the size of a voxel is unknown and counts as 1".to_owned());
        }
    }

    /// The volumes that so many pages make; the first is the one to show.
    pub(super) fn volumes(&mut self, pages: usize) -> Vec<Volume> {
        let all = |pages| vec![Volume { name: String::new(), first: 0, stride: 1, slices: pages }];
        let mut axes = self.axes;
        let product = axes.iter().try_fold(1_u64, |n, (_, extent)| n.checked_mul(*extent));
        if product == Some(1) {
            return all(pages);
        }
        let (channels, slices, frames) = (extent(&axes, 'C'), extent(&axes, 'Z'), extent(&axes, 'T'));
        if product.and_then(|product| usize::try_from(product).ok()) != Some(pages) {
            self.warnings.push(format!(
                "the description announces {channels} channels x {slices} slices x {frames} frames, there are {pages} \
                 pages: all are taken as slices"
            ));
            return all(pages);
        }
        // Programs that know of no slices count them as something else.
        let taken = match (slices, frames, channels) {
            (1, 2.., _) => Some(('T', frames, "frames")),
            (1, _, 2..) => Some(('C', channels, "channels")),
            _ => None,
        };
        if let Some((other, count, what)) = taken {
            self.warnings.push(format!("{count} {what} of one slice are taken as slices"));
            axes = axes.map(|(name, extent)| match name {
                'Z' => (other, extent),
                _ if name == other => ('Z', extent),
                _ => (name, extent),
            });
        }
        // The product is the number of pages: no extent, stride or first page is beyond it.
        let stride = |axis| {
            let before = axes.iter().take_while(|(name, _)| *name != axis);
            before.map(|(_, extent)| usize::try_from(*extent).unwrap_or(usize::MAX)).product::<usize>()
        };
        let count = |axis| usize::try_from(extent(&axes, axis)).unwrap_or(usize::MAX);
        let (channels, slices, frames) = (count('C'), count('Z'), count('T'));
        let mut volumes = Vec::new();
        for frame in 0..frames {
            for channel in 0..channels {
                let mut name = Vec::new();
                if frames > 1 {
                    name.push(format!("frame {}", frame + 1));
                }
                if channels > 1 {
                    name.push(format!("channel {}", channel + 1));
                }
                volumes.push(Volume {
                    name: name.join(" "),
                    first: frame * stride('T') + channel * stride('C'),
                    stride: stride('Z'),
                    slices,
                });
            }
        }
        volumes
    }
}

const UNKNOWN_VOXEL: &str = "the size of a voxel is unknown and counts as 1";

/// How many there are of `C`, `Z` or `T`.
fn extent(axes: &[(char, u64); 3], axis: char) -> u64 {
    axes.iter().find(|(name, _)| *name == axis).map_or(1, |(_, extent)| *extent)
}

/// A description that says nothing of voxels.
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

/// The `shape` of a description in JSON.
fn shape(description: &str) -> Option<Vec<u64>> {
    if !description.starts_with('{') {
        return None;
    }
    let json: serde_json::Value = serde_json::from_str(description).ok()?;
    json.get("shape")?.as_array()?.iter().take(16).map(serde_json::Value::as_u64).collect()
}

fn imagej(description: &str, resolution: Resolution, integer_bits: Option<u16>) -> Calibration {
    let field = |name: &str| {
        let mut values = description.lines().filter_map(|line| line.split_once('='));
        values.find(|(key, _)| *key == name).map(|(_, value)| text::shown(value.trim()))
    };
    let number = |name: &str| field(name)?.parse::<f64>().ok().filter(|number| number.is_finite());
    let count = |name: &str| field(name)?.parse::<u64>().ok();
    let mut calibration = Calibration::unknown();
    calibration.images = count("images");
    calibration.axes = [("channels", 'C'), ("slices", 'Z'), ("frames", 'T')]
        .map(|(name, axis)| (axis, count(name).unwrap_or(1).max(1)));

    // As ImageJ does: 72 per inch is what programs write that know nothing of the scale.
    let screen = resolution.unit == 2 && resolution.pixels[0] == Some(72.0);
    let unit = match field("unit").map(|unit| unit.replace("\\u00B5", "\u{b5}")) {
        Some(unit) if !unit.is_empty() => unit,
        _ if resolution.unit == 2 && !screen => "inch".to_owned(),
        _ if resolution.unit == 3 => "cm".to_owned(),
        _ => "pixel".to_owned(),
    };
    if let Some([x, y]) = resolution.sizes().filter(|_| !screen) {
        calibration.spacing.x = x;
        calibration.spacing.y = y;
    }
    match number("spacing").filter(|&spacing| spacing != 0.0) {
        Some(spacing) => {
            calibration.spacing.z = spacing.abs();
            if spacing < 0.0 {
                calibration.warnings.push(format!("spacing {spacing}: its magnitude is used"));
            }
        }
        None if calibration.spacing != DVec3::ONE => {
            let warning = format!("no spacing of slices: 1 {unit} is assumed");
            calibration.warnings.push(warning);
        }
        None => {}
    }
    let DVec3 { x, y, z } = calibration.spacing;
    calibration.notes.push(format!("voxels of {x} x {y} x {z} {unit}"));
    for name in ["yunit", "zunit"] {
        if let Some(other) = field(name)
            && !other.is_empty()
            && other != unit
        {
            calibration
                .warnings
                .push(format!("{name} {other} is not the unit {unit}: no length is converted"));
        }
    }

    // ImageJ counts the origin in pixels.
    let origin = DVec3::new(
        number("xorigin").unwrap_or(0.0),
        number("yorigin").unwrap_or(0.0),
        number("zorigin").unwrap_or(0.0),
    );
    if origin != DVec3::ZERO {
        calibration.origin = -origin * calibration.spacing;
        calibration.notes.push(format!("the origin lies at voxel {}, {}, {}", origin.x, origin.y, origin.z));
    }

    // A straight line of 8 and 16 bits; signed samples are stored with an offset of 32768 so.
    match field("cf").as_deref() {
        Some("0") if integer_bits.is_some_and(|bits| bits <= 16) => {
            if let (Some(intercept), Some(slope)) = (number("c0"), number("c1"))
                && slope != 0.0
            {
                calibration.rescale = Some(Rescale { slope, intercept });
                let unit = field("vunit").unwrap_or_default();
                calibration
                    .notes
                    .push(format!("values are {slope} x stored + {intercept} {unit}").trim().to_owned());
            } else {
                calibration.warnings.push("calibration function without c0 and c1: not applied".to_owned());
            }
        }
        // 20 is ImageJ's word for none.
        None | Some("20") => {}
        Some(function) => {
            let warning = format!("calibration function {function} is not applied: values are as stored");
            calibration.warnings.push(warning);
        }
    }
    calibration
}

/// The first `Pixels` of OME-XML. None, where it is something else.
fn ome(description: &str) -> Option<Calibration> {
    if !description.trim_start().starts_with('<') {
        return None;
    }
    let mut reader = quick_xml::Reader::from_str(description);
    let (mut images, mut found, mut first) = (0_u32, false, None);
    // A description that is cut short or damaged ends the search.
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
        calibration.warnings.push(format!("OME-XML describes {images} images: the first one's voxels count"));
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
    let (x, y, z) = (length('X'), length('Y'), length('Z'));
    let (Some(x), Some(y)) = (x, y) else {
        calibration.notes.push(UNKNOWN_VOXEL.to_owned());
        return calibration;
    };
    let world = unit('X');
    let mut spacing = [x, y, 1.0];
    let mut convert = |axis: char, place: usize, length: f64| match (metres(&unit(axis)), metres(&world)) {
        _ if unit(axis) == world => spacing[place] = length,
        (Some(own), Some(world)) => spacing[place] = length * (own / world),
        _ => calibration.warnings.push(format!(
            "PhysicalSize{axis} is in {}, PhysicalSizeX in {world}: not converted",
            unit(axis)
        )),
    };
    convert('Y', 1, y);
    match z {
        Some(z) => convert('Z', 2, z),
        None => calibration.warnings.push(format!("no PhysicalSizeZ: 1 {world} is assumed")),
    }
    calibration.spacing = DVec3::from_array(spacing);
    calibration.notes.push(format!("voxels of {} x {} x {} {world}", spacing[0], spacing[1], spacing[2]));
    calibration
}

/// The length of a unit of OME-XML.
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

    const UNKNOWN: Resolution = Resolution { pixels: [None; 2], unit: 1 };

    fn names(volumes: &[Volume]) -> Vec<(&str, usize, usize, usize)> {
        volumes.iter().map(|v| (v.name.as_str(), v.first, v.stride, v.slices)).collect()
    }

    #[test]
    fn imagej_lengths_origin_and_values() {
        let text = "ImageJ=1.53t\nimages=27\nslices=27\nunit=\\u00B5m\nspacing=-7.0\nxorigin=2\nzorigin=-1\n\
                    cf=0\nc0=-32768.0\nc1=2.0\nvunit=HU\nzunit=mm\nloop=false\n";
        let resolution = Resolution { pixels: [Some(2.0), Some(4.0)], unit: 1 };
        let mut found = calibration(text, resolution, Some(16));
        assert_eq!(found.spacing, DVec3::new(0.5, 0.25, 7.0));
        assert_eq!(found.origin, DVec3::new(-1.0, 0.0, 7.0));
        assert_eq!(found.rescale, Some(Rescale { slope: 2.0, intercept: -32768.0 }));
        assert_eq!(found.notes[0], "voxels of 0.5 x 0.25 x 7 \u{b5}m");
        assert_eq!(found.notes[2], "values are 2 x stored + -32768 HU");
        assert_eq!(found.warnings.len(), 2, "{:?}", found.warnings);
        assert_eq!(names(&found.volumes(27)), [("", 0, 1, 27)]);
        assert_eq!(calibration(text, resolution, None).rescale, None, "floats have none");
        assert!(calibration(text, resolution, None).warnings[2].contains("function 0 is not applied"));
    }

    #[test]
    fn imagej_without_a_scale() {
        let screen = Resolution { pixels: [Some(72.0); 2], unit: 2 };
        assert_eq!(calibration("ImageJ=1\n", screen, None).spacing, DVec3::ONE);
        assert_eq!(calibration("ImageJ=1\n", screen, None).warnings.len(), 0);
        let cm = Resolution { pixels: [Some(4.0); 2], unit: 3 };
        let found = calibration("ImageJ=1\nspacing=0\n", cm, None);
        assert_eq!(found.spacing, DVec3::new(0.25, 0.25, 1.0));
        assert_eq!(found.warnings, ["no spacing of slices: 1 cm is assumed"]);
    }

    #[test]
    fn channels_and_frames() {
        let of = |text: &str, pages| {
            let mut found = calibration(text, UNKNOWN, None);
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
        let mut found = calibration(text, UNKNOWN, None);
        assert!((found.spacing - DVec3::new(0.5, 0.5, 2.0)).length() < 1e-12, "{}", found.spacing);
        assert_eq!(names(&found.volumes(6)), [("channel 1", 0, 1, 3), ("channel 2", 3, 1, 3)]);
        assert_eq!(found.warnings.len(), 0, "{:?}", found.warnings);

        let two = text.replace("</Image>", "</Image><Image/>").replace("\"mm\"", "\"parsec\"");
        let found = calibration(&two, UNKNOWN, None);
        assert_eq!(found.spacing.z, 1.0);
        assert_eq!(found.warnings.len(), 2, "{:?}", found.warnings);
        let bare = calibration("<OME><Image><Pixels/></Image></OME>", UNKNOWN, None);
        assert_eq!((bare.spacing, bare.warnings.len()), (DVec3::ONE, 0));
        assert_eq!(calibration("<OME><Image", UNKNOWN, None).notes.len(), 1);
    }

    #[test]
    fn other_descriptions() {
        let uneven = Resolution { pixels: [Some(300.0), Some(150.0)], unit: 2 };
        assert_eq!(calibration("a scan", uneven, None).spacing, DVec3::new(1.0, 2.0, 1.0));
        let warned = calibration("{\"shape\": [2, 5, 64, 64]}", UNKNOWN, None);
        assert!(warned.warnings[0].contains("shape [2, 5, 64, 64]"));
        assert_eq!(calibration("{\"shape\": [1, 5, 64, 64]}", UNKNOWN, None).warnings.len(), 0);
    }
}
