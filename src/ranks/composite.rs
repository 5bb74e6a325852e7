//! Sort-last compositing of the ranks' images.

use std::ops::Range;

use crate::error::{Error, Result};
use crate::image::Image;
use crate::num;
use crate::ranks::communicator::{Communicator, alike, gather};
use crate::ranks::tiles::{Rectangle, Tiles};

/// Composites the images of all ranks, front to back in this order of ranks, and returns the whole on rank 0.
///
/// In each round `k` ranks, neighbours in the order or each the result of as many neighbours, split their pixels into `k` pieces, and each takes
/// one of all: the rounds are the prime factors of the number of ranks. Of each piece the runs of pixels that are not zero are sent.
///
/// # Errors
///
/// On all ranks: [`Error::Invalid`] or [`Error::Rank`] unless the order names each rank once, and where sizes of images or orders differ; those
/// of the communicator.
pub fn composite(image: Image, order: &[u32], ranks: &dyn Communicator) -> Result<Option<Image>> {
    let sides = [image.width(), image.height()];
    let same: Vec<u8> = sides.iter().chain(order).flat_map(|word| word.to_le_bytes()).collect();
    alike(ranks, "size or visibility order of images", &same)?;
    let size = ranks.size();
    let mut named = order.to_vec();
    named.sort_unstable();
    let place = order.iter().position(|&rank| rank == ranks.rank());
    let (true, Some(place)) = (named.iter().copied().eq(0..size), place) else {
        let why = format!("{order:?}: must name each of {size} ranks once");
        return Err(Error::invalid("visibility order", why));
    };

    // Exchange and composite pieces, round by round: active pixels alone are blended.
    let colours = image.colours();
    let mut pixels = image.into_pixels();
    let mut own = 0..pixels.len();
    let mut stride = 1;
    for k in factors(order.len()) {
        let digit = place / stride % k;
        let member = |i: usize| order[place + i * stride - digit * stride];
        let others = (0..k).filter(|&i| i != digit);
        let messages: Vec<_> = others.map(|i| (member(i), encoded(&pixels[piece(&own, i, k)]))).collect();
        let received = ranks.exchange(&messages)?;
        own = piece(&own, digit, k);
        let below = &mut pixels[own.clone()];
        // The nearest in front first, then the nearest behind.
        for i in (0..digit).rev().chain(digit..k - 1) {
            let blend = |pixel: &mut _, other| {
                *pixel = if i < digit { over(other, *pixel) } else { over(*pixel, other) }
            };
            let count = put(&received[i], below, blend);
            count.filter(|&count| count == below.len()).ok_or_else(|| differs(messages[i].0))?;
        }
        stride *= k;
    }

    // Gather the pieces.
    let bytes = || [&num::wide(own.start).to_le_bytes()[..], &encoded(&pixels[own.clone()])].concat();
    let Some(others) = gather(ranks, bytes)? else { return Ok(None) };
    pixels[..own.start].fill([0.0; 4]);
    pixels[own.end..].fill([0.0; 4]);
    for (bytes, rank) in others.iter().zip(1..) {
        let piece = bytes.split_first_chunk::<8>().and_then(|(first, bytes)| {
            let first = usize::try_from(u64::from_le_bytes(*first)).ok()?;
            put(bytes, pixels.get_mut(first..)?, replace)
        });
        piece.ok_or_else(|| differs(rank))?;
    }
    let [width, height] = sides;
    Ok(Some(Image::new(width, height, pixels)?.with_colours(colours)))
}

/// Joins the rectangles that ranks have drawn, on rank 0.
pub(super) fn joined(
    image: &Image,
    tiles: &Tiles,
    [width, height]: [u32; 2],
    ranks: &dyn Communicator,
) -> Result<Option<Image>> {
    let Some(others) = gather(ranks, || encoded(image.pixels()))? else { return Ok(None) };
    let mut whole = vec![[0.0; 4]; num::index(width) * num::index(height)];
    for rank in 0..ranks.size() {
        let Rectangle { corner, extent } = tiles.of(rank);
        let [columns, rows] = extent.map(num::index);
        let piece = match num::index(rank).checked_sub(1) {
            None => Some(image.pixels().to_vec()),
            Some(place) => decoded(&others[place], columns * rows),
        };
        let piece = piece.filter(|piece| piece.len() == columns * rows).ok_or_else(|| differs(rank))?;
        for (y, row) in piece.chunks_exact(columns).enumerate() {
            let first = (num::index(corner[1]) + y) * num::index(width) + num::index(corner[0]);
            whole[first..first + columns].copy_from_slice(row);
        }
    }
    Ok(Some(Image::new(width, height, whole)?.with_colours(image.colours())))
}

fn differs(rank: u32) -> Error {
    let why = "its image does not have the size of the others";
    Error::Rank { rank, code: 2, why: why.to_string() }
}

/// Returns the prime factors of a number, ascending.
fn factors(mut number: usize) -> Vec<usize> {
    let mut all = Vec::new();
    let mut factor = 2;
    while number > 1 {
        if number.is_multiple_of(factor) {
            all.push(factor);
            number /= factor;
        } else {
            factor += 1;
        }
    }
    all
}

/// Returns the `i`th of `k` pieces of a range of pixels.
fn piece(of: &Range<usize>, i: usize, k: usize) -> Range<usize> {
    of.start + of.len() * i / k..of.start + of.len() * (i + 1) / k
}

/// Puts a premultiplied pixel in front of another.
fn over(front: [f32; 4], back: [f32; 4]) -> [f32; 4] {
    let transmittance = 1.0 - front[3];
    std::array::from_fn(|c| transmittance.mul_add(back[c], front[c]))
}

fn replace(pixel: &mut [f32; 4], other: [f32; 4]) {
    *pixel = other;
}

/// Codes pixels as runs: the number of zero pixels before each, that of its pixels, and these.
fn encoded(pixels: &[[f32; 4]]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut rest = pixels;
    let is_zero = |pixel: &[f32; 4]| *pixel == [0.0; 4];
    while !rest.is_empty() {
        let skipped = rest.iter().take_while(|pixel| is_zero(pixel)).count();
        let run = rest[skipped..].iter().take_while(|pixel| !is_zero(pixel)).count();
        bytes.extend(num::count(skipped).to_le_bytes());
        bytes.extend(num::count(run).to_le_bytes());
        bytes.extend_from_slice(bytemuck::cast_slice(&rest[skipped..skipped + run]));
        rest = &rest[skipped + run..];
    }
    bytes
}

/// Blends coded pixels with those at the front of a room, and returns the number of pixels that the code stands for; `None` where the room is
/// too small, or the code is not whole.
fn put(mut bytes: &[u8], room: &mut [[f32; 4]], blend: impl Fn(&mut [f32; 4], [f32; 4])) -> Option<usize> {
    let mut place = 0;
    while let Some((head, rest)) = bytes.split_first_chunk::<8>() {
        let [skipped, run] = [0, 4].map(|at| [head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let [skipped, run] = [skipped, run].map(|word| num::index(u32::from_le_bytes(word)));
        place += skipped;
        let (pixels, rest) = rest.split_at_checked(16 * run)?;
        let into = room.get_mut(place..place + run)?;
        for (pixel, bytes) in into.iter_mut().zip(pixels.chunks_exact(16)) {
            blend(pixel, bytemuck::pod_read_unaligned(bytes));
        }
        place += run;
        bytes = rest;
    }
    (bytes.is_empty() && place <= room.len()).then_some(place)
}

/// Returns the pixels of a code of so many.
fn decoded(bytes: &[u8], pixels: usize) -> Option<Vec<[f32; 4]>> {
    let mut all = vec![[0.0; 4]; pixels];
    (put(bytes, &mut all, replace)? == pixels).then_some(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ranks::communicator::Threads;

    /// The image of a rank: translucent, of its own colour, and with pixels that show nothing.
    fn image(rank: u32) -> Image {
        let pixel = |i: u32| {
            let word = (i * 7 + rank * 13).wrapping_mul(0x9E37_79B9) >> 16;
            if word.is_multiple_of(3) {
                [0.0; 4]
            } else {
                [0.0, 0.1 * (rank % 5) as f32, 0.2, 0.3 + 0.05 * (rank % 7) as f32]
            }
        };
        Image::new(13, 11, (0..143).map(pixel).collect()).unwrap()
    }

    /// Composites the images of so many ranks, each a thread.
    fn composited(order: &[u32]) -> Vec<Result<Option<Image>>> {
        composited_by(num::count(order.len()), order)
    }

    fn composited_by(ranks: u32, order: &[u32]) -> Vec<Result<Option<Image>>> {
        Threads::run(ranks, |end| composite(image(end.rank()), order, &end))
    }

    /// Any number of ranks gives the image of blending in their order, which is no order of numbers; the last pixel counts.
    #[test]
    fn any_number_of_ranks_in_any_order() {
        for size in 1..=12_u32 {
            let mut order: Vec<u32> = (0..size).rev().collect();
            order.rotate_left(num::index(size / 2));
            if size > 2 {
                order.swap(0, 2);
            }
            let all = composited(&order).into_iter().map(Result::unwrap).collect::<Vec<_>>();
            assert!(all[1..].iter().all(Option::is_none));
            let blended = |order: &[u32]| {
                let layers = order.iter().map(|&rank| image(rank).pixels().to_vec());
                layers
                    .reduce(|front, back| front.into_iter().zip(back).map(|(a, b)| over(a, b)).collect())
                    .unwrap()
            };
            let want = blended(&order);
            let got = all[0].as_ref().unwrap();
            let apart =
                got.pixels().iter().zip(&want).flat_map(|(a, b)| (0..4).map(move |c| (a[c] - b[c]).abs()));
            let most = apart.fold(0.0, f32::max);
            assert!(most <= 3e-7, "{size}: {most}");
            let backwards: Vec<u32> = order.iter().rev().copied().collect();
            assert!(size == 1 || composited(&backwards)[0].as_ref().unwrap().as_ref().unwrap() != got);
            assert!(size == 1 || blended(&backwards) != want);
        }
    }

    #[test]
    fn orders_and_sizes_are_checked() {
        for order in [&[0, 0][..], &[0, 2], &[1]] {
            for result in composited_by(2, order) {
                let why = result.unwrap_err().to_string();
                assert!(why.contains("each of 2 ranks once"), "{why}");
            }
        }
        let results = Threads::run(2, |end| {
            let rows = 8 + end.rank();
            let image = Image::new(8, rows, vec![[0.5; 4]; num::index(8 * rows)]).unwrap();
            composite(image, &[1, 0], &end)
        });
        for result in results {
            let why = result.unwrap_err().to_string();
            assert!(why.contains("rank 1") && why.contains("size"), "{why}");
        }
    }

    /// Prints what coding and blending cost, for docs/scale.md.
    #[test]
    #[ignore = "a tool: prints figures"]
    fn measure_compositing() {
        let pixels: Vec<[f32; 4]> = (0..1_u16 << 15).map(|i| [f32::from(i % 7 + 1) * 0.1; 4]).collect();
        let pixels = pixels.repeat(128);
        let timed = |what: &str, work: &mut dyn FnMut()| {
            let begin = std::time::Instant::now();
            work();
            let rate = num::f64_of(pixels.len()) / begin.elapsed().as_secs_f64();
            println!("{what}: {:.0} M pixels per second", rate * 1e-6);
        };
        for _ in 0..3 {
            let (mut bytes, mut back, mut below) = (Vec::new(), None, pixels.clone());
            timed("encoding", &mut || bytes = encoded(&pixels));
            timed("decoding", &mut || back = decoded(&bytes, pixels.len()));
            assert!(back.is_some());
            timed("blending", &mut || {
                put(&bytes, &mut below, |pixel, other| *pixel = over(*pixel, other)).unwrap();
            });
            let empty = vec![[0.0; 4]; pixels.len()];
            timed("skipping", &mut || bytes = encoded(&empty));
            assert_eq!(bytes.len(), 8);
        }
    }

    #[test]
    fn codes_are_those_of_active_pixels() {
        let mut pixels = vec![[0.0; 4]; 1000];
        pixels[7] = [0.1, 0.2, 0.3, 0.4];
        pixels[8] = [0.0, 0.0, 0.0, 1.0];
        pixels[999] = [1.0; 4];
        let bytes = encoded(&pixels);
        assert_eq!(bytes.len(), 3 * 16 + 2 * 8);
        assert_eq!(decoded(&bytes, 1000).unwrap(), pixels);
        assert!(decoded(&bytes, 999).is_none() && decoded(&bytes, 1001).is_none());
        assert!((1..bytes.len()).all(|end| decoded(&bytes[..end], 1000).is_none()));
        assert_eq!(encoded(&[[0.0; 4]; 50]).len(), 8);
    }
}
