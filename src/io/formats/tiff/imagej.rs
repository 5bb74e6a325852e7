//! ImageJ's description: lines of `key=value`.

use glam::DVec3;

use crate::io::file::text;
use crate::io::formats::tiff::calibration::{Calibration, Resolution};
use crate::scene::Rescale;

pub(crate) fn imagej(description: &str, resolution: Resolution, integer: bool) -> Calibration {
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
