//! ImageJ's description: lines of `key=value`.

use glam::DVec3;

use crate::io::file::text;
use crate::io::formats::tiff::calibration::{Calibration, Resolution};
use crate::scene::Rescale;

pub(crate) fn imagej(description: &str, resolution: Resolution, integer_bits: Option<u16>) -> Calibration {
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

    // As in ImageJ, 72 pixels per inch means an unknown scale.
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

    // ImageJ gives the origin in pixels.
    let origin = DVec3::new(
        number("xorigin").unwrap_or(0.0),
        number("yorigin").unwrap_or(0.0),
        number("zorigin").unwrap_or(0.0),
    );
    if origin != DVec3::ZERO {
        calibration.origin = -origin * calibration.spacing;
        calibration.notes.push(format!("the origin lies at voxel {}, {}, {}", origin.x, origin.y, origin.z));
    }

    // Function 0 is a straight line, for samples of 8 and 16 bits; signed samples are stored with an offset of 32768.
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
        // Function 20 is ImageJ's code for none.
        None | Some("20") => {}
        Some(function) => {
            let warning = format!("calibration function {function} is not applied: values are as stored");
            calibration.warnings.push(warning);
        }
    }
    calibration
}
