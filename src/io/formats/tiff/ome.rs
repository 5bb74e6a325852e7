//! OME-XML: the first `Pixels` element.

use glam::DVec3;
use quick_xml::XmlVersion;
use quick_xml::events::{BytesStart, Event};

use crate::io::file::text;
use crate::io::formats::tiff::calibration::{Calibration, UNKNOWN_VOXEL};

/// Parses the first `Pixels` of OME-XML; None if the description is something else.
pub(crate) fn ome(description: &str) -> Option<Calibration> {
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
