//! Plain PLY: float32 in little-endian order.

use std::io::Write as _;
use std::path::Path;

use crate::error::Result;
use crate::io::write::gaussian::codes::{comments, harmonics_of, up_to_third};
use crate::num;
use crate::replace::replace;
use crate::scene::{Axes, Gaussians, harmonics};

pub(super) fn write(path: &Path, splats: &Gaussians, texts: &[String]) -> Result<Vec<String>> {
    let splats = &splats.turned(Axes::Rdf);
    let (degree, note) = up_to_third(splats);
    let rest = harmonics::count(degree) - 1;
    // Splats that are all flat along the same axis of their own need no third length.
    let is_flat = splats.log_scales().iter().all(|scales| scales[2] == f32::NEG_INFINITY);
    let mut names: Vec<String> = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"].map(str::to_owned).to_vec();
    names.extend((0..3 * rest).map(|i| format!("f_rest_{i}")));
    names.extend(["opacity", "scale_0", "scale_1"].map(str::to_owned));
    names.extend((!is_flat).then(|| "scale_2".to_owned()));
    names.extend((0..4).map(|i| format!("rot_{i}")));
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\n{}element vertex {}\n{properties}end_header\n",
        comments(splats, texts),
        splats.len()
    );
    replace(path, |writer| {
        writer.write_all(header.as_bytes())?;
        for i in 0..splats.len() {
            let own = harmonics_of(splats, i);
            let of_channels = (0..3).flat_map(|c| (1..=rest).map(move |k| own[3 * k + c]));
            let scales = &splats.log_scales()[i][..if is_flat { 2 } else { 3 }];
            let numbers = splats.centres()[i]
                .into_iter()
                .chain(own[..3].iter().copied())
                .chain(of_channels)
                .chain([logit(splats.opacities()[i])])
                .chain(scales.iter().copied())
                .chain(splats.rotations()[i]);
            for number in numbers {
                writer.write_all(&number.to_le_bytes())?;
            }
        }
        Ok(())
    })?;
    let infinite = splats.opacities().iter().filter(|opacity| logit(**opacity).is_infinite()).count();
    let infinite = (infinite > 0).then(|| format!("{infinite} opacities of 0 or 1 have infinite logits"));
    Ok(note.into_iter().chain(infinite).collect())
}

/// Returns the logit of an opacity: infinite for 0 and 1.
fn logit(opacity: f32) -> f32 {
    let opacity = f64::from(opacity);
    num::f32_of((opacity / (1.0 - opacity)).ln())
}
