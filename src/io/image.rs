//! Images as OpenEXR (32-bit float, lossless) and as PNG (8-bit sRGB).

use std::fs::File;
use std::io::Write;
use std::path::Path;

use ::image::{ExtendedColorType, ImageEncoder as _, codecs::png::PngEncoder};
use exr::prelude::{
    Encoding, Layer, LayerAttributes, MetaData, ReadChannels as _, ReadLayers as _, SpecificChannels, Vec2,
    WritableImage as _,
};

use crate::error::{Error, Result};
use crate::image::{Colours, Image, srgb};
use crate::io::options::ReadOptions;
use crate::num;
use crate::replace::replace;

/// Writes an image as OpenEXR or PNG, chosen by the file name extension.
///
/// `background` is straight (not premultiplied) linear RGBA; only PNG uses it.
///
/// # Errors
///
/// [`Error::File`] for any other extension, otherwise as [`write_exr`] and [`write_png`].
pub fn write_image(path: impl AsRef<Path>, image: &Image, background: [f64; 4]) -> Result<()> {
    let path = path.as_ref();
    match path.extension().map(|ending| ending.to_string_lossy().to_lowercase()).as_deref() {
        Some("exr") => write_exr(path, image),
        Some("png") => write_png(path, image, background),
        _ => Err(Error::file(path, "file name", "must end in .exr or .png")),
    }
}

/// The comment of OpenEXR files whose colours are not linear.
const DISPLAYED: &str = "colours are codes of sRGB from 0 to 1, premultiplied by alpha";

/// Writes 32-bit float OpenEXR with the channels R, G, B and A: premultiplied, lossless. Its comment says so where colours are not linear.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be written, [`Error::File`] if it must not be replaced; no partial
/// file remains.
pub fn write_exr(path: impl AsRef<Path>, image: &Image) -> Result<()> {
    let pixel = |position: Vec2<usize>| {
        let [r, g, b, a] = image.pixels()[position.y() * num::index(image.width()) + position.x()];
        (r, g, b, a)
    };
    let size = (num::index(image.width()), num::index(image.height()));
    let comments = (image.colours() == Colours::Displayed).then(|| DISPLAYED.into());
    let attributes = LayerAttributes { comments, ..LayerAttributes::default() };
    let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, SpecificChannels::rgba(pixel));
    let file = exr::prelude::Image::from_layer(layer);
    replace(path.as_ref(), |writer| {
        // The encoder patches offsets at the end, which needs a seekable writer.
        let mut bytes = std::io::Cursor::new(Vec::new());
        file.write().to_buffered(&mut bytes).map_err(io_error)?;
        writer.write_all(bytes.get_ref())
    })
}

/// Reads the first layer with R, G and B of an OpenEXR file; a missing alpha is 1.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be opened; [`Error::File`] if it has no such layer or its pixels take more than
/// `options.max_bytes`.
pub fn read_exr(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Image> {
    let path = path.as_ref();
    let broken = |error: exr::error::Error| Error::file(path, "OpenEXR", one_line(&error.to_string()));
    let open =
        || File::open(path).map(std::io::BufReader::new).map_err(|e| Error::io(path, "cannot open", e));

    let meta = MetaData::read_from_buffered(open()?, false).map_err(broken)?;
    for header in &meta.headers {
        let (width, height) = (header.layer_size.width(), header.layer_size.height());
        let bytes = num::wide(width).checked_mul(num::wide(height)).and_then(|n| n.checked_mul(16));
        if bytes.is_none_or(|bytes| bytes > options.max_bytes) {
            let limit = options.max_bytes;
            let rule = format!("{width} x {height} pixels of 16 bytes: the limit is {limit} bytes");
            return Err(Error::file(path, "dataWindow", rule));
        }
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgba_channels(
            |size, _| (size.width(), vec![[0.0; 4]; size.area()]),
            |(width, pixels): &mut (usize, Vec<[f32; 4]>), at, (r, g, b, a): (f32, f32, f32, f32)| {
                pixels[at.y() * *width + at.x()] = [r, g, b, a];
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(open()?)
        .map_err(broken)?;
    let size = image.layer_data.size;
    let comments = image.layer_data.attributes.comments.as_ref().map(exr::prelude::Text::to_string);
    let is_displayed = comments.as_deref() == Some(DISPLAYED);
    let colours = if is_displayed { Colours::Displayed } else { Colours::Linear };
    let (_, pixels) = image.layer_data.channel_data.pixels;
    Image::new(num::count(size.width()), num::count(size.height()), pixels)
        .map(|image| image.with_colours(colours))
}

/// Writes 8-bit PNG: composited over `background` (straight linear RGBA), then sRGB-encoded. Displayed colours are composited over
/// the encoded background instead.
///
/// An opaque background gives RGB, any other one RGBA. NaN becomes 0.
///
/// # Errors
///
/// [`Error::Io`] if the file cannot be written, [`Error::File`] if it must not be replaced; no partial
/// file remains.
pub fn write_png(path: impl AsRef<Path>, image: &Image, background: [f64; 4]) -> Result<()> {
    replace(path.as_ref(), |writer| encode_png(writer, image, background))
}

/// Encodes the PNG that [`write_png`] writes.
///
/// # Errors
///
/// Those of the writer.
pub fn encode_png(writer: impl Write, image: &Image, background: [f64; 4]) -> std::io::Result<()> {
    let bytes = to_srgb8(image, background);
    let colour = if background[3] >= 1.0 { ExtendedColorType::Rgb8 } else { ExtendedColorType::Rgba8 };
    let encoder = PngEncoder::new(writer);
    encoder.write_image(&bytes, image.width(), image.height(), colour).map_err(|e| match e {
        ::image::ImageError::IoError(error) => error,
        other => std::io::Error::other(other.to_string()),
    })
}

/// Returns the bytes of the pixels of [`write_png`], row by row: three for each pixel over an opaque background, else four.
#[must_use]
pub fn to_srgb8(image: &Image, background: [f64; 4]) -> Vec<u8> {
    let channels = if background[3] >= 1.0 { 3 } else { 4 };
    let (background, encoding): (_, fn(f64) -> f64) = match image.colours() {
        Colours::Linear => (background, srgb),
        Colours::Displayed => {
            let [r, g, b, a] = background;
            ([srgb(r), srgb(g), srgb(b), a], |code| code)
        }
    };
    let mut bytes = Vec::with_capacity(image.pixels().len() * channels);
    for &pixel in image.pixels() {
        bytes.extend_from_slice(&encode(pixel.map(f64::from), background, encoding)[..channels]);
    }
    bytes
}

/// Composites a premultiplied pixel over a straight background, and encodes the result as straight colours.
fn encode(pixel: [f64; 4], background: [f64; 4], encoding: fn(f64) -> f64) -> [u8; 4] {
    let through = 1.0 - pixel[3];
    let alpha = pixel[3] + through * background[3];
    let code = |i: usize| {
        let premultiplied = pixel[i] + through * background[3] * background[i];
        let linear = if alpha > 0.0 { premultiplied / alpha } else { 0.0 };
        num::u8_code(encoding(linear) * 255.0)
    };
    [code(0), code(1), code(2), num::u8_code(alpha * 255.0)]
}

fn io_error(error: exr::error::Error) -> std::io::Error {
    match error {
        exr::error::Error::Io(error) => error,
        other => std::io::Error::other(other.to_string()),
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Displayed colours go into PNG as they are, and OpenEXR files say what they hold.
    #[test]
    fn displayed_colours_are_not_encoded_again() {
        let image = Image::new(2, 1, vec![[0.5, 0.25, 0.0, 0.5], [1.0, 0.2, 0.6, 1.0]]).unwrap();
        let image = image.with_colours(Colours::Displayed);
        assert_eq!(to_srgb8(&image, [0.0; 4]), [255, 128, 0, 128, 255, 51, 153, 255]);
        // 0.2140 is the linear value of code 127.
        assert_eq!(to_srgb8(&image, [0.2140, 0.0, 0.2140, 1.0])[..3], [191, 64, 64]);
        let path = std::env::temp_dir().join(format!("volraster-displayed-{}.exr", std::process::id()));
        for image in [image.clone(), image.with_colours(Colours::Linear)] {
            write_exr(&path, &image).unwrap();
            assert_eq!(read_exr(&path, &ReadOptions::default()).unwrap(), image);
        }
        std::fs::remove_file(path).unwrap();
    }

    #[test]
    fn pixels_are_composited_in_linear_light_then_encoded() {
        // Half white over black is linear 0.5, code 188 (0.7354 * 255), not 128.
        assert_eq!(encode([0.5, 0.5, 0.5, 0.5], [0.0, 0.0, 0.0, 1.0], srgb), [188, 188, 188, 255]);
        // Nothing over a background is the background; 0.2140 is the linear value of code 127.
        assert_eq!(encode([0.0; 4], [1.0, 0.0, 0.2140, 1.0], srgb), [255, 0, 127, 255]);
        // No background: straight colour, its alpha kept.
        assert_eq!(encode([0.25, 0.0, 0.0, 0.25], [0.0; 4], srgb), [255, 0, 0, 64]);
        // Too much and no number.
        assert_eq!(encode([7.0, f64::NAN, -1.0, 1.0], [0.0; 4], srgb), [255, 0, 0, 255]);
    }
}
