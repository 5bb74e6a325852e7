//! The full pre-integration table: colour with attenuation inside the segment (Engel, Kraus, Ertl 2001),
//! built incrementally (in the spirit of Lum, Wilson, Ma 2004).

use glam::{DVec3, DVec4};

use super::density::Density;
use crate::interface::TableHead;
use crate::num::{f32_of, f64_of, index};
use crate::scene::TransferFunction;

/// Tolerance as a fraction of the nodes' spacing: a knot this little above a node counts as on the node.
/// Rounding of a node's scalar must not put it on the other side of a jump.
const SLACK: f64 = 1e-5;

/// Parts of an interval between two nodes. Within a part, colour is the extinction-weighted mean; where a
/// part is opaque, the error is up to half the colour's change in the part.
const PARTS: usize = 4;

/// A table over front scalar, back scalar and segment length, which halves from layer to layer.
///
/// A texel for length d holds (G, a): mean extinction a, and a colour G such that the segment emits C = G d
/// (1 - exp(-a d)) / (a d). Both tend to the point density (tau c, tau) as the segment shrinks. So, unlike C
/// and opacity, they are smooth in d and interpolate well.
#[derive(Clone, Debug)]
pub(crate) struct Full {
    pub(crate) head: TableHead,
    /// Texels at `(layer * size + back) * size + front`; layer l is for the length `longest` 2^-l.
    pub(crate) texels: Vec<[f32; 4]>,
}

impl Full {
    /// Builds the table in O(size^2) for each layer; `size` is at least 2.
    pub(crate) fn new(transfer: &TransferFunction, size: u32, layers: u32, longest: f64) -> Self {
        let density = Density::new(transfer);
        let [first, last] = density.domain();
        let n = index(size);
        if first == last {
            let texels = vec![density.last().to_array().map(f32_of); index(layers) * n * n];
            return Self { head: density.head(0.0, 1.0), texels };
        }
        let spacing = (last - first) / f64::from(size - 1);
        let node = |i: usize| if i + 1 == n { last } else { first + f64_of(i) * spacing };
        let mut walk = density.walk();
        let parts: Vec<DVec4> = (1..n)
            .flat_map(|i| (1..=PARTS).map(move |part| (i, f64_of(part) / f64_of(PARTS))))
            .map(|(i, w)| walk.to(node(i - 1) * (1.0 - w) + node(i) * w).0)
            .collect();
        let points: Vec<DVec4> = (0..n).map(|i| density.at(node(i), SLACK * spacing)).collect();
        let mut texels = vec![[0.0; 4]; index(layers) * n * n];
        let mut windows = Windows::default();
        let mut length = longest;
        for layer in texels.chunks_exact_mut(n * n) {
            for (i, point) in points.iter().enumerate() {
                layer[i * n + i] = point.to_array().map(f32_of);
            }
            for span in 1..n {
                windows.slide(&parts, span, length);
                for low in 0..n - span {
                    let high = low + span;
                    let [up, down] = windows.at(low);
                    layer[high * n + low] = up;
                    layer[low * n + high] = down;
                }
            }
            length *= 0.5;
        }
        Self { head: density.head(1.0 / spacing, spacing), texels }
    }
}

/// Composites premultiplied colours and opacities; associative.
fn over(front: DVec4, back: DVec4) -> DVec4 {
    front + back * (1.0 - front.w)
}

/// An interval of the scalar axis, composited from either end.
#[derive(Clone, Copy, Debug, Default)]
struct Stretch {
    /// Sum of the parts' densities.
    sum: DVec4,
    /// Premultiplied colour and opacity, seen from low to high scalars.
    up: DVec4,
    /// The same from high to low scalars.
    down: DVec4,
}

impl Stretch {
    /// Appends an interval on the side of higher scalars.
    fn then(&self, next: &Self) -> Self {
        Self { sum: self.sum + next.sum, up: over(self.up, next.up), down: over(next.down, self.down) }
    }
}

/// All windows of one number of intervals, each from two precomputed parts.
///
/// The intervals are divided into blocks as long as a window, so a window is the end of one block and the
/// start of the next. No division or subtraction removes an interval, hence extinctions of any contrast keep
/// their relative precision.
#[derive(Debug, Default)]
struct Windows {
    /// From the start of the interval's block to the end of the interval.
    starts: Vec<Stretch>,
    /// From the start of the interval to the end of its block.
    ends: Vec<Stretch>,
    span: usize,
    length: f64,
}

impl Windows {
    /// Prepares the windows of `span` intervals; each window is `length` long.
    fn slide(&mut self, parts: &[DVec4], span: usize, length: f64) {
        (self.span, self.length) = (span, length);
        let piece = length / f64_of(span * PARTS);
        self.starts.clear();
        self.starts.extend(parts.chunks_exact(PARTS).map(|interval| {
            let parts = interval.iter().map(|&mean| {
                let alpha = -(-mean.w * piece).exp_m1();
                let colour = if mean.w > 0.0 { mean.truncate() / mean.w } else { DVec3::ZERO };
                let seen = (colour * alpha).extend(alpha);
                Stretch { sum: mean, up: seen, down: seen }
            });
            parts.fold(Stretch::default(), |all, part| all.then(&part))
        }));
        self.ends.clone_from(&self.starts);
        for block in self.starts.chunks_mut(span) {
            for i in 1..block.len() {
                block[i] = block[i - 1].then(&block[i]);
            }
        }
        for block in self.ends.chunks_mut(span) {
            for i in (1..block.len()).rev() {
                block[i - 1] = block[i - 1].then(&block[i]);
            }
        }
    }

    /// Returns the texels of the window that begins at an interval, for rising and for falling scalars.
    fn at(&self, low: usize) -> [[f32; 4]; 2] {
        let window = if low.is_multiple_of(self.span) {
            self.ends[low]
        } else {
            self.ends[low].then(&self.starts[low + self.span - 1])
        };
        let mean = window.sum / f64_of(self.span * PARTS);
        [window.up, window.down].map(|seen| {
            // C = G d phi(a d) with phi(a d) = alpha / (a d).
            let effective = if seen.w > 0.0 { seen.truncate() * (mean.w / seen.w) } else { mean.truncate() };
            effective.extend(mean.w).to_array().map(f32_of)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::usize_of;

    fn transfer(rows: &[[f64; 5]]) -> TransferFunction {
        TransferFunction::from_rows(rows).unwrap()
    }

    fn texel(table: &Full, layer: u32, front: usize, back: usize) -> [f64; 4] {
        let [first, last, per_unit, _] = table.head.range.map(f64::from);
        let size = usize_of(((last - first) * per_unit).round()) + 1;
        table.texels[(index(layer) * size + back) * size + front].map(f64::from)
    }

    /// Emitted colour and optical depth of a texel over its length.
    fn segment(texel: [f64; 4], length: f64) -> [f64; 4] {
        let od = texel[3] * length;
        let phi = if od > 0.0 { -(-od).exp_m1() / od } else { 1.0 };
        [texel[0] * length * phi, texel[1] * length * phi, texel[2] * length * phi, od]
    }

    /// The same by steps of constant density, with the end of a step at every knot.
    fn brute(tf: &TransferFunction, front: f64, back: f64, length: f64) -> [f64; 4] {
        let place = |s: f64| (s - front) / (back - front);
        let mut cuts = vec![0.0, 1.0];
        cuts.extend(tf.knots().iter().map(|k| place(k.s)).filter(|&x| x > 0.0 && x < 1.0));
        cuts.sort_by(f64::total_cmp);
        let (mut colour, mut od) = (DVec3::ZERO, 0.0_f64);
        for cut in cuts.windows(2) {
            let steps = 4000;
            let dx = (cut[1] - cut[0]) / f64::from(steps);
            for i in 0..steps {
                let x = cut[0] + (f64::from(i) + 0.5) * dx;
                let (c, tau) = tf.at(front + (back - front) * x);
                let step = tau * dx * length;
                colour += c * (-(-step).exp_m1() * (-od).exp());
                od += step;
            }
        }
        [colour.x, colour.y, colour.z, od]
    }

    const MIXED: [[f64; 5]; 6] = [
        [0.0, 1.0, 0.0, 0.2, 0.0],
        [0.25, 1.0, 0.4, 0.2, 8.0],
        [0.42, 0.0, 0.4, 0.9, 0.5],
        [0.42, 0.3, 1.0, 0.0, 40.0],
        [0.6, 0.3, 0.0, 0.7, 0.0],
        [1.0, 0.0, 0.0, 1.0, 3.0],
    ];

    /// Largest error of a colour channel and largest relative error of the optical depth, over some texels.
    fn worst(rows: &[[f64; 5]], size: u32, layers: u32, longest: f64) -> (f64, f64) {
        let tf = transfer(rows);
        let rounded: Vec<[f64; 5]> =
            rows.iter().map(|&[s, r, g, b, t]| [f64::from(f32_of(s)), r, g, b, t]).collect();
        let rounded = transfer(&rounded);
        let table = Full::new(&tf, size, layers, longest);
        let (n, mut worst) = (index(size), (0.0_f64, 0.0_f64));
        let node = |i: usize| f64_of(i) / f64_of(n - 1);
        for layer in 0..layers {
            let length = longest * 0.5_f64.powi(i32::try_from(layer).unwrap());
            for front in (0..n).step_by(n / 16) {
                for back in (0..n).step_by(n / 21) {
                    if front == back {
                        continue;
                    }
                    let is = segment(texel(&table, layer, front, back), length);
                    let want = brute(&rounded, node(front), node(back), length);
                    let off: [f64; 4] = std::array::from_fn(|c| (is[c] - want[c]).abs());
                    worst.0 = worst.0.max(off[0]).max(off[1]).max(off[2]);
                    worst.1 = worst.1.max(off[3] / want[3].max(1e-9));
                }
            }
        }
        worst
    }

    #[test]
    fn matches_quadrature() {
        let (colour, od) = worst(&MIXED, 65, 6, 3.0);
        println!("size 65: colour {colour}, optical depth {od}");
        assert!(colour < 0.02 && od < 1e-6, "{colour} {od}");
    }

    #[test]
    #[ignore = "a measurement"]
    fn measure_colour_error_of_mean_colours() {
        let ramp = [[0.0, 0.0, 1.0, 0.0, 1e4], [1.0, 1.0, 0.0, 0.0, 1e4]];
        for size in [33, 65, 129, 257] {
            for (name, rows, longest) in
                [("mixed d=3", &MIXED[..], 3.0), ("mixed d=100", &MIXED, 100.0), ("ramp 1e4", &ramp, 1.0)]
            {
                println!("{name} size {size}: {:?}", worst(rows, size, 4, longest));
            }
        }
    }

    #[test]
    fn equal_nodes_hold_the_density_right_of_jumps() {
        // Half of the float32 neighbours of i/255 lie above it, hence above the node.
        for jump in 1..255_usize {
            let s = f64::from(f32_of(f64_of(jump) / 255.0));
            let tf = transfer(&[
                [0.0, 1.0, 0.5, 0.25, 1.0],
                [s, 1.0, 0.5, 0.25, 1.0],
                [s, 0.0, 0.5, 1.0, 4.0],
                [1.0, 0.0, 0.5, 1.0, 4.0],
            ]);
            let table = Full::new(&tf, 256, 2, 1.0);
            assert_eq!(texel(&table, 1, jump, jump), [0.0, 2.0, 4.0, 4.0], "{jump}");
            assert_eq!(texel(&table, 1, jump - 1, jump - 1), [1.0, 0.5, 0.25, 1.0]);
            // The jump lies on a node: a neighbouring interval lies on one side of it.
            assert!((texel(&table, 0, jump - 1, jump)[3] - 1.0).abs() < 1e-4);
        }
        let table = Full::new(&transfer(&MIXED), 65, 1, 1.0);
        for i in 0..65 {
            let (colour, tau) = transfer(&MIXED).at(f64_of(i) / 64.0);
            let is = texel(&table, 0, i, i);
            assert!((is[0] - colour.x * tau).abs() < 1e-5 && (is[3] - tau).abs() < 1e-5);
        }
    }

    #[test]
    fn constant_colour_is_exact_and_depth_symmetric() {
        let rows = MIXED.map(|[s, _, _, _, tau]| [s, 0.5, 0.25, 2.0, tau]);
        let table = Full::new(&transfer(&rows), 48, 5, 4.0);
        for layer in 0..5 {
            let length = 4.0 * 0.5_f64.powi(i32::try_from(layer).unwrap());
            for front in 0..48 {
                for back in 0..48 {
                    let value = texel(&table, layer, front, back);
                    let [r, g, b, od] = segment(value, length);
                    let alpha = -(-od).exp_m1();
                    for (is, c) in [(r, 0.5), (g, 0.25), (b, 2.0)] {
                        assert!((is - c * alpha).abs() <= 3e-7 * c * alpha, "{layer} {front} {back}");
                    }
                    assert_eq!(value, texel(&table, layer, back, front));
                }
            }
        }
    }

    #[test]
    fn short_segments_emit_the_mean_density() {
        let table = Full::new(&transfer(&MIXED), 64, 30, 1.0);
        let density = Density::new(&transfer(&MIXED));
        for (front, back) in [(0, 40), (40, 0), (20, 21), (63, 10)] {
            let value = texel(&table, 29, front, back);
            let (low, high) = (front.min(back), front.max(back));
            let mut at = density.walk();
            at.to(f64_of(low) / 63.0);
            let mean = at.to(f64_of(high) / 63.0).0;
            for c in 0..4 {
                assert!((value[c] - mean[c]).abs() < 1e-5 * mean.w, "{front} {back}: {value:?} {mean}");
            }
        }
    }

    #[test]
    fn direction_matters() {
        // Red on the low side of a jump, blue on the high side; each half of the segment is opaque.
        let tf = transfer(&[
            [0.0, 1.0, 0.0, 0.0, 50.0],
            [0.5, 1.0, 0.0, 0.0, 50.0],
            [0.5, 0.0, 0.0, 1.0, 50.0],
            [1.0, 0.0, 0.0, 1.0, 50.0],
        ]);
        let table = Full::new(&tf, 21, 1, 2.0);
        let (up, down) = (segment(texel(&table, 0, 0, 20), 2.0), segment(texel(&table, 0, 20, 0), 2.0));
        assert!(up[0] > 0.999 && up[2] < 1e-6 && down[2] > 0.999 && down[0] < 1e-6, "{up:?} {down:?}");
        assert_eq!(up[3], down[3]);
        // Exactly, the front half attenuates the other by exp(-25 d).
        let table = Full::new(&tf, 21, 1, 0.1);
        let up = segment(texel(&table, 0, 0, 20), 0.1);
        let half = -(-2.5_f64).exp_m1();
        assert!((up[0] - half).abs() < 1e-6 && (up[2] - half * (-2.5_f64).exp()).abs() < 1e-6, "{up:?}");
        // A jump between nodes, in the interval 7 to 8 of 0 to 20.
        let tf = transfer(&[
            [0.0, 1.0, 1.0, 1.0, 2.0],
            [0.375, 1.0, 1.0, 1.0, 2.0],
            [0.375, 1.0, 1.0, 1.0, 6.0],
            [1.0, 1.0, 1.0, 1.0, 6.0],
        ]);
        let table = Full::new(&tf, 21, 1, 1.0);
        assert!((texel(&table, 0, 7, 8)[3] - 4.0).abs() < 1e-6);
        assert!((texel(&table, 0, 0, 20)[3] - 4.5).abs() < 1e-6);
    }

    #[test]
    fn longer_segments_are_more_opaque_and_emit_less_per_length() {
        let table = Full::new(&transfer(&MIXED), 32, 8, 8.0);
        for front in 0..32 {
            for back in 0..32 {
                for layer in 1..8 {
                    let length = 8.0 * 0.5_f64.powi(i32::try_from(layer).unwrap());
                    let long = segment(texel(&table, layer - 1, front, back), 2.0 * length);
                    let short = segment(texel(&table, layer, front, back), length);
                    assert!(long[3] >= short[3]);
                    for c in 0..4 {
                        assert!(long[c] <= 2.0 * short[c] * (1.0 + 1e-6), "{front} {back} {layer}");
                    }
                }
            }
        }
    }

    #[test]
    fn extremes_stay_finite() {
        let white = |s: f64, tau: f64| [s, 1.0, 1.0, 1.0, tau];
        let spike = [white(0.0, 0.0), white(0.3, 0.0), white(0.5, 1e300), white(0.7, 0.0), white(1.0, 1e-3)];
        let bright = [[-1e300, 1e300, 0.0, 1.0, 1e300], [1e300, 1e9, 0.0, 1.0, 0.0]];
        for rows in [&spike[..], &bright, &[white(3.0, 4.0)], &[white(3.0, 4.0), white(3.0, 1e300)]] {
            for longest in [1e-12, 1.0, 1e12] {
                let table = Full::new(&transfer(rows), 17, 4, longest);
                assert_eq!(table.texels.len(), 17 * 17 * 4);
                assert!(table.texels.iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
            }
        }
        // Beside 1e30 the thin part keeps its precision: 12 and 16 are nodes 0.75 and 1.
        let table = Full::new(&transfer(&spike), 17, 1, 1.0);
        let want = 1e-3 * (0.05 + 0.3) / 0.6;
        assert!((texel(&table, 0, 12, 16)[3] - want).abs() < 1e-6 * want);
        let degenerate = Full::new(&transfer(&[white(3.0, 4.0), white(3.0, 8.0)]), 2, 1, 1.0);
        assert_eq!(degenerate.texels, [[8.0; 4]; 4]);
        assert_eq!(degenerate.head.range, [3.0, 3.0, 0.0, 1.0]);
        assert_eq!(degenerate.head.before, [1.0, 1.0, 1.0, 4.0]);
    }

    #[test]
    #[ignore = "a measurement"]
    fn measure_build_time() {
        let mut times: Vec<f64> = (0..11)
            .map(|_| {
                let start = std::time::Instant::now();
                std::hint::black_box(Full::new(&transfer(&MIXED), 256, 8, 1.0));
                start.elapsed().as_secs_f64()
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!("full 256 x 256 x 8: {:.1} ms", times[5] * 1e3);
    }
}
