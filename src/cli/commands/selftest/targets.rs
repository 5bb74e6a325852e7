//! Images of the caller as targets, in several formats.

use volraster::ash::vk;
use volraster::{GpuScene, Image, Offscreen, Renderer, TargetDesc, TargetMode};

use super::subject::{SIZE, VIEWS, view};
use super::workbench::{Verdict, Workbench, fail, prepared};

pub(super) fn texels_f32(bytes: &[u8]) -> Vec<[f32; 4]> {
    let number = |b: &[u8]| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
    bytes.chunks_exact(16).map(|t| std::array::from_fn(|c| number(&t[4 * c..4 * c + 4]))).collect()
}

/// Returns the largest difference between texels and an image composited over a colour.
pub(super) fn difference(texels: &[[f32; 4]], picture: &Image, behind: [f32; 4]) -> f32 {
    let over = |pixel: &[f32; 4], c: usize| pixel[c] + (1.0 - pixel[3]) * behind[c];
    let of = |(texel, pixel): (&[f32; 4], &[f32; 4])| {
        (0..4)
            .map(|c| (texel[c] - over(pixel, c)).abs())
            .fold(0.0, |a: f32, b| if b > a || b.is_nan() { b } else { a })
    };
    if texels.len() != picture.pixels().len() {
        return f32::INFINITY;
    }
    texels.iter().zip(picture.pixels()).map(of).fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a })
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
    let (gpu, technique, subject) = prepared(workbench, spec)?;
    let scene = GpuScene::new(&gpu, subject.scene()?);
    let renderer = Renderer::new(&scene, technique);
    let view = view(VIEWS[0], SIZE)?;
    let alone = renderer.render(&view)?;
    let behind = [0.0, 0.5, 0.25, 1.0];
    for (format, bounds) in FORMATS {
        for (mode, bound) in [TargetMode::Clear, TargetMode::Over].into_iter().zip(bounds) {
            let mut plan = renderer.prepare(&view, &TargetDesc::caller(format, mode))?;
            let mut image = Offscreen::new(&gpu, format, SIZE)?;
            image.draw(&mut plan, behind)?;
            let (status, bytes) = image.finish()?;
            let code = |byte: u8| f32::from(byte) / 255.0;
            let under = if mode == TargetMode::Over { behind } else { [0.0; 4] };
            let far = match format {
                vk::Format::R32G32B32A32_SFLOAT => difference(&texels_f32(&bytes), &alone, under),
                vk::Format::R8G8B8A8_UNORM => {
                    let texels: Vec<_> =
                        bytes.chunks_exact(4).map(|t| [t[0], t[1], t[2], t[3]].map(code)).collect();
                    difference(&texels, &alone, under)
                }
                _ => {
                    let texels: Vec<_> =
                        bytes.chunks_exact(4).map(|t| [t[2], t[1], t[0], t[3]].map(code)).collect();
                    let laid = |p: &[f32; 4]| {
                        std::array::from_fn(|c| {
                            let linear = p[c] + (1.0 - p[3]) * under[c];
                            if c < 3 { encode(linear) } else { linear }
                        })
                    };
                    let encoded = Image::new(SIZE[0], SIZE[1], alone.pixels().iter().map(laid).collect())?;
                    difference(&texels, &encoded, [0.0; 4])
                }
            };
            if !status.complete || far.is_nan() || far > bound {
                return fail(format!("{format:?} {mode:?}: {far:.1e} from the volume (bound {bound:.1e})"));
            }
        }
    }
    Ok(format!("{} formats, cleared and over", FORMATS.len()))
}
