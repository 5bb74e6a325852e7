//! Images of the caller as targets: in several formats, and with frames in flight.

use volraster::ash::vk;
use volraster::{Image, Offscreen, Renderer, TargetDesc, TargetMode};

use super::subject::{SIZE, VIEWS, view};
use super::workbench::{Trial, Verdict, Workbench, fail};

fn texels_f32(bytes: &[u8]) -> Vec<[f32; 4]> {
    let number = |b: &[u8]| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
    bytes.chunks_exact(16).map(|t| std::array::from_fn(|c| number(&t[4 * c..4 * c + 4]))).collect()
}

/// Returns the largest difference between texels and an image.
fn difference(texels: &[[f32; 4]], picture: &Image) -> f32 {
    if texels.len() != picture.pixels().len() {
        return f32::INFINITY;
    }
    let values = texels.iter().flatten().zip(picture.pixels().iter().flatten());
    values.map(|(a, b)| (a - b).abs()).fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a })
}

/// Formats of the caller's image, with bounds of the rounding error when cleared and when composited: half a code of
/// the result; over a background, also half a code of the background, of the source and of their product.
const FORMATS: [(vk::Format, [f32; 2]); 3] = [
    (vk::Format::R32G32B32A32_SFLOAT, [1e-5, 1e-5]),
    (vk::Format::R8G8B8A8_UNORM, [0.6 / 255.0, 2.6 / 255.0]),
    (vk::Format::B8G8R8A8_SRGB, [1.1 / 255.0, 3.5 / 255.0]),
];

fn encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// Draws into the caller's image in each kind of format, cleared or over existing contents.
pub(super) fn caller(workbench: &Workbench, spec: &str) -> Verdict {
    let trial = Trial::new(workbench, spec)?;
    let scene = trial.scene()?;
    let renderer = Renderer::new(&scene, trial.technique);
    let alone = renderer.render(&trial.view)?;
    let behind = [0.0, 0.5, 0.25, 1.0];
    for (format, bounds) in FORMATS {
        for (mode, bound) in [TargetMode::Clear, TargetMode::Over].into_iter().zip(bounds) {
            let mut plan = renderer.prepare(&trial.view, &TargetDesc::caller(format, mode))?;
            let mut image = Offscreen::new(&trial.gpu, format, SIZE)?;
            image.draw(&mut plan, behind)?;
            let (status, bytes) = image.finish()?;
            let is_srgb = format == vk::Format::B8G8R8A8_SRGB;
            let texel = |t: &[u8]| {
                let [red, blue] = if is_srgb { [t[2], t[0]] } else { [t[0], t[2]] };
                [red, t[1], blue, t[3]].map(|byte| f32::from(byte) / 255.0)
            };
            let texels = match format {
                vk::Format::R32G32B32A32_SFLOAT => texels_f32(&bytes),
                _ => bytes.chunks_exact(4).map(texel).collect(),
            };
            let under = if mode == TargetMode::Over { behind } else { [0.0; 4] };
            let over = |p: &[f32; 4]| {
                std::array::from_fn(|c| {
                    let linear = p[c] + (1.0 - p[3]) * under[c];
                    if is_srgb && c < 3 { encode(linear) } else { linear }
                })
            };
            let expected = Image::new(SIZE[0], SIZE[1], alone.pixels().iter().map(over).collect())?;
            let far = difference(&texels, &expected);
            if !status.complete || far.is_nan() || far > bound {
                return fail(format!("{format:?} {mode:?}: {far:.1e} from the volume (bound {bound:.1e})"));
            }
        }
    }
    Ok(format!("{} formats, cleared and over", FORMATS.len()))
}

/// Compares three frames in flight, of three views, with images that are drawn one by one.
pub(super) fn flight(workbench: &Workbench, spec: &str) -> Verdict {
    let trial = Trial::new(workbench, spec)?;
    let scene = trial.scene()?;
    let renderer = Renderer::new(&scene, trial.technique);
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let mut flying = Vec::new();
    let mut expected = Vec::new();
    for name in VIEWS {
        let view = view(name, SIZE)?;
        // Capacities are known after a frame of the view has been drawn.
        expected.push(renderer.render(&view)?);
        let plan = renderer.prepare(&view, &TargetDesc::caller(format, TargetMode::Clear))?;
        flying.push((plan, Offscreen::new(&trial.gpu, format, SIZE)?));
    }
    for _ in 0..2 {
        for (plan, image) in &mut flying {
            image.draw(plan, [0.0; 4])?;
        }
        for ((_, image), expected) in flying.iter_mut().zip(&expected) {
            let (status, bytes) = image.finish()?;
            if !status.complete {
                return fail("a frame is not complete");
            }
            let far = difference(&texels_f32(&bytes), expected);
            if far > 1e-5 {
                return fail(format!("{far:.1e} from the image that is drawn alone"));
            }
        }
    }
    Ok(format!("{} at a time", VIEWS.len()))
}
