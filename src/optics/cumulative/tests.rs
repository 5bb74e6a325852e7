//! The shader's look-ups against exact means.

use super::*;
use crate::num::{count, usize_of};

type Vec4 = [f32; 4];

fn sum<const N: usize>(terms: [(f32, Vec4); N]) -> Vec4 {
    std::array::from_fn(|c| terms.iter().map(|(weight, value)| weight * value[c]).sum())
}

/// Returns the bin that holds a scalar of the domain, and the position in it from 0 to 1.
fn place(table: &Cumulative, s: f32) -> (usize, f32) {
    let [first, _, per_unit, width] = table.head.range;
    let from_first = s - first;
    let mut i = (from_first * per_unit).floor();
    let mut x = from_first - i * width;
    // The product above may round to the wrong side of an edge; edges are exact.
    let step = f32::from(u8::from(x >= width)) - f32::from(u8::from(x < 0.0));
    i = (i + step).clamp(0.0, f32_of(f64_of(table.bins.len() - 1)));
    x = from_first - i * width;
    // Below 1, so that of two bins' parts of a segment at most one is empty.
    (usize_of(f64::from(i)), (x * per_unit).min(1.0_f32.next_down()))
}

/// Computes the mean density between two scalars as the shader does.
fn lookup(table: &Cumulative, front: f32, back: f32) -> Vec4 {
    let [first, last, ..] = table.head.range;
    let premultiplied = |[r, g, b, tau]: Vec4| [r * tau, g * tau, b * tau, tau];
    let mut a = front.min(back).clamp(-1e37, 1e37);
    let mut b = front.max(back).clamp(-1e37, 1e37);
    // Weights of the parts below, inside and above the domain. The interval extends at least one ulp to the
    // right: equal scalars see the function as continuous from the right.
    let wide = b.max(a + (f32::EPSILON * a.abs()).max(1e-30));
    let within = |s: f32| s.clamp(first, last);
    let weights = [wide.min(first) - a, within(wide) - within(a), wide - a.max(last)].map(|w| w.max(0.0));
    let scale = 1.0 / (weights[0] + weights[1] + weights[2]);
    (a, b) = (within(a), within(b));
    let ((i, xa), (j, xb)) = (place(table, a), place(table, b));
    let line = |i: usize, x: f32| sum([(1.0, table.bins[i].mean), (x - 0.5, table.bins[i].rise)]);
    let inside = if i == j {
        line(i, 0.5 * (xa + xb))
    } else {
        let (next, last) = (table.bins[i + 1], table.bins[j]);
        let middle = std::array::from_fn(|c| (last.high[c] - next.high[c]) + (last.low[c] - next.low[c]));
        let number = f32_of(f64_of(j - i - 1));
        let each = 1.0 / ((1.0 - xa) + xb + number);
        let (tail, head) = (line(i, 0.5 * (1.0 + xa)), line(j, 0.5 * xb));
        sum([((1.0 - xa) * each, tail), (xb * each, head), (each, middle)])
    };
    let [before, after] = [table.head.before, table.head.after].map(premultiplied);
    let all = sum([(weights[0] * scale, before), (weights[1] * scale, inside), (weights[2] * scale, after)]);
    all.map(|v| v.max(0.0))
}

/// Returns the mean density by two-point Gauss quadrature between knots, which is exact for cubics, or the
/// density at equal scalars.
fn exact(transfer: &TransferFunction, front: f32, back: f32) -> [f64; 4] {
    let at = |s: f64| {
        let (colour, tau) = transfer.at(s);
        [colour.x * tau, colour.y * tau, colour.z * tau, tau]
    };
    let (a, b) = (f64::from(front.min(back)), f64::from(front.max(back)));
    if a == b {
        return at(a);
    }
    let mut cuts: Vec<f64> = transfer.knots().iter().map(|k| k.s).filter(|&s| s > a && s < b).collect();
    cuts.insert(0, a);
    cuts.push(b);
    let mut total = [0.0; 4];
    for cut in cuts.windows(2) {
        let (middle, half) = (0.5 * (cut[0] + cut[1]), 0.5 * (cut[1] - cut[0]));
        for s in [middle - half / 3_f64.sqrt(), middle + half / 3_f64.sqrt()] {
            let value = at(s);
            total = std::array::from_fn(|c| total[c] + half * value[c] / (b - a));
        }
    }
    total
}

fn transfer(rows: &[[f64; 5]]) -> TransferFunction {
    let round = |&[s, r, g, b, tau]: &[f64; 5]| [f64::from(f32_of(s)), r, g, b, tau];
    TransferFunction::from_rows(&rows.iter().map(round).collect::<Vec<_>>()).unwrap()
}

/// Returns the largest difference from the exact mean in a channel, relative to the exact mean extinction.
fn error(tf: &TransferFunction, table: &Cumulative, a: f32, b: f32) -> f64 {
    let (is, want) = (lookup(table, a, b), exact(tf, a, b));
    assert!(is.iter().all(|v| v.is_finite()), "{a} {b}: {is:?}");
    assert_eq!(is, lookup(table, b, a));
    (0..4).map(|c| (f64::from(is[c]) - want[c]).abs() / want[3].max(1e-300)).fold(0.0, f64::max)
}

fn close(is: Vec4, want: Vec4) {
    let near = (0..4).all(|c| (is[c] - want[c]).abs() <= 2.0 * f32::EPSILON * want[c]);
    assert!(near, "{is:?} instead of {want:?}");
}

fn up(s: f32, ulps: u32) -> f32 {
    (0..ulps).fold(s, |s, _| s.next_up())
}

const SMOOTH: [[f64; 5]; 4] = [
    [0.0, 0.2, 0.9, 0.1, 3.0],
    [0.31, 0.8, 0.3, 0.1, 1000.0],
    [0.64, 0.1, 0.3, 0.9, 40.0],
    [1.0, 0.5, 0.5, 0.5, 90.0],
];

/// The same colours and extinctions at other scalars.
fn moved(rows: &[[f64; 5]], first: f64, range: f64) -> TransferFunction {
    transfer(&rows.iter().map(|&[s, r, g, b, t]| [first + s * range, r, g, b, t]).collect::<Vec<_>>())
}

#[test]
fn nearly_equal_scalars_lose_nothing() {
    // Catalogue 14 and 15, at three places of the domain on the axis.
    for (first, range) in [(0.0, 1.0), (-1000.0, 4000.0), (30_000.0, 1000.0)] {
        let tf = moved(&SMOOTH, first, range);
        let table = Cumulative::new(&tf, 4096);
        // A bin's linear density cannot follow a kink inside the bin: there, and only there, the error is up
        // to (change of slope) * width / 8.
        let (mut worst, mut at_kinks) = ([0.0_f64; 6], 0.0_f64);
        let kinks: Vec<usize> = tf.knots().iter().map(|k| place(&table, f32_of(k.s)).0).collect();
        for i in 1..4000 {
            let a = f32_of(first + range * f64::from(i) / 4001.3);
            let apart = |fraction: f64| f32_of(f64::from(a) + fraction * range);
            let others = [a, up(a, 1), apart(1e-7), apart(1e-5), apart(1e-3), apart(0.1)];
            for (worst, b) in worst.iter_mut().zip(others) {
                let kink = [a, b].iter().any(|&s| kinks.contains(&place(&table, s).0));
                let worst = if kink { &mut at_kinks } else { worst };
                *worst = worst.max(error(&tf, &table, a, b));
            }
        }
        println!("{first} {range}: {worst:?}, at kinks {at_kinks}");
        assert!(worst.iter().all(|&w| w < 3e-5), "{first}: {worst:?}");
        assert!(at_kinks < 3e-3, "{at_kinks}");
    }
}

#[test]
fn identity_is_exact_to_rounding() {
    let tf = transfer(&[[0.0, 1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 1.0, 1.0]]);
    let table = Cumulative::new(&tf, 4096);
    for i in 0..500 {
        for j in 1..500 {
            let (a, b) = (f32_of(f64::from(i) / 499.0), f32_of(f64::from(j) / 499.0));
            assert!(error(&tf, &table, a, b) < 1e-6, "{a} {b}");
        }
    }
    // The interpolation weight must go to the right neighbour.
    let quarter = lookup(&table, 0.25, 0.25);
    assert!((quarter[3] - 0.25).abs() < 1e-6 && (quarter[0] - quarter[3]).abs() < 1e-7);
}

#[test]
fn whole_spikes_and_jumps_count_exactly() {
    // Catalogue 17: far narrower than a bin, with large contrast.
    let (at, half) = (0.437, 0.5e-4);
    let colour = |s: f64, tau: f64| [s, 0.2, 0.4, 0.8, tau];
    let spike = transfer(&[
        colour(0.0, 0.0),
        colour(at - half, 0.0),
        colour(at, 1e6),
        colour(at + half, 0.0),
        colour(1.0, 0.0),
    ]);
    let table = Cumulative::new(&spike, 4096);
    for i in 0..400 {
        let (a, b) = (f32_of(0.4365 - f64::from(i) * 1e-3), f32_of(0.4375 + f64::from(i) * 1.3e-3));
        assert!(error(&spike, &table, a, b) < 1e-3, "{a} {b}");
        // Beyond the spike's bin the density is zero.
        close(lookup(&table, 0.438, b), [0.0; 4]);
    }
    let jumps = transfer(&[
        [-1.0, 1.0, 0.0, 0.0, 5.0],
        [0.123, 1.0, 0.0, 0.0, 5.0],
        [0.123, 0.0, 1.0, 0.5, 1e5],
        [0.7, 0.0, 1.0, 0.5, 1e5],
        [0.7, 0.5, 0.5, 0.5, 0.25],
        [1.0, 0.5, 0.5, 0.5, 0.25],
    ]);
    let table = Cumulative::new(&jumps, 4096);
    for i in 0..400 {
        for (a, b) in [(0.122, 0.701), (0.11, 0.124), (0.69, 0.71), (0.706, 0.95)] {
            // The distance of `b` from the first scalar rounds by 6e-8, and `b` is 1e-3 from a jump.
            let (a, b) = (f32_of(a - f64::from(i) * 1e-5), f32_of(b + f64::from(i) * 1e-5));
            assert!(error(&jumps, &table, a, b) < 1e-4, "{a} {b}: {}", error(&jumps, &table, a, b));
        }
    }
}

#[test]
fn jumps_on_edges_belong_to_the_right() {
    // Catalogue 18: a step at every scalar value in turn, over the whole range of integer data.
    for (last, bins) in [(255_u32, 4096), (4095, 4096), (65_535, 4096), (1000, 4096), (250, 1000)] {
        let apart = last.div_ceil(4096);
        for step in (apart..last).step_by(index(apart)) {
            let s = f32_of(f64::from(step));
            let [low, high] = [[f64::from(s), 1.0, 1.0, 1.0, 1.0], [f64::from(s), 0.5, 0.5, 0.5, 9.0]];
            let mut rows = [low, low, high, high];
            (rows[0][0], rows[3][0]) = (0.0, f64::from(last));
            let table = Cumulative::new(&transfer(&rows), bins);
            assert_eq!(place(&table, s).1, 0.0, "{last} {step}");
            close(lookup(&table, s, s), [4.5, 4.5, 4.5, 9.0]);
            close(lookup(&table, s - 0.01, s - 0.005), [1.0; 4]);
        }
    }
}

#[test]
fn one_ulp_across_an_edge() {
    let tf = transfer(&[[0.0, 1.0, 1.0, 1.0, 10.0], [0.93, 0.0, 1.0, 1.0, 20.0]]);
    for bins in [1000, 4096, 65_536] {
        let table = Cumulative::new(&tf, bins);
        for i in 1..bins {
            let edge = f32_of(f64::from(i) * f64::from(table.head.range[3]));
            if edge < 0.93 {
                assert_eq!(place(&table, edge), (index(i), 0.0));
                assert_eq!(place(&table, edge.next_down()).0, index(i - 1));
                assert!(error(&tf, &table, edge.next_down(), edge) < 1e-6, "{i}/{bins}");
            }
        }
    }
}

#[test]
fn scalars_outside_see_the_ends() {
    let tf = transfer(&[
        [1.0, 1.0, 0.5, 0.0, 2.0],
        [1.0, 0.0, 0.5, 1.0, 30.0],
        [3.0, 1.0, 0.5, 0.0, 30.0],
        [3.0, 0.25, 0.5, 1.0, 7.0],
    ]);
    let table = Cumulative::new(&tf, 4096);
    assert_eq!(table.head.before, [1.0, 0.5, 0.0, 2.0]);
    assert_eq!(table.head.after, [0.25, 0.5, 1.0, 7.0]);
    let places = [-1e6, -5.0, 0.0, 0.999_999, 1.0, 1.5, 2.9, 3.0, 3.1, 77.0, 1e7];
    for a in places {
        for b in places {
            assert!(
                error(&tf, &table, a, b) < 2e-6,
                "{a} {b} {:?} {:?}",
                lookup(&table, a, b),
                exact(&tf, a, b)
            );
        }
    }
    assert_eq!(lookup(&table, f32::NEG_INFINITY, -3.0)[3], 2.0);
    assert_eq!(lookup(&table, f32::INFINITY, f32::INFINITY)[3], 7.0);
    assert!((lookup(&table, f32::NEG_INFINITY, f32::INFINITY)[3] - 4.5).abs() < 1e-6);
}

#[test]
fn one_knot_and_two_equal_knots() {
    let one = transfer(&[[5.0, 0.5, 0.25, 1.0, 4.0]]);
    let table = Cumulative::new(&one, 16);
    for (a, b) in [(5.0, 5.0), (-1.0, 3.0), (4.0, 9.0), (6.0, 6.0)] {
        close(lookup(&table, a, b), [2.0, 1.0, 4.0, 4.0]);
    }
    let jump = transfer(&[[5.0, 0.5, 0.25, 1.0, 4.0], [5.0, 1.0, 1.0, 1.0, 8.0]]);
    let table = Cumulative::new(&jump, 16);
    assert_eq!(table.head.range, [5.0, 5.0, 0.0, 1.0]);
    close(lookup(&table, 5.0, 5.0), [8.0; 4]);
    close(lookup(&table, 4.0, 5.0), [2.0, 1.0, 4.0, 4.0]);
    close(lookup(&table, 4.0, 6.0), [5.0, 4.5, 6.0, 6.0]);
    // A domain too narrow for float32 to divide counts as a jump.
    let narrow = TransferFunction::from_rows(&[[0.0, 0.0, 0.0, 0.0, 4.0], [1e-40, 0.0, 0.0, 0.0, 8.0]]);
    let table = Cumulative::new(&narrow.unwrap(), 16);
    assert_eq!(table.head.range, [1e-40, 1e-40, 0.0, 1.0]);
    assert_eq!(lookup(&table, 1e-30, 1e-30)[3], 8.0);
    assert!((lookup(&table, -1.0, 1.0)[3] - 6.0).abs() < 1e-5);
}

#[test]
fn many_knots() {
    // Catalogue 19: with 16 knots per bin the bin's linear density is approximate, but its mean is exact.
    let rows: Vec<[f64; 5]> = (0..65_536)
        .map(|i| {
            let s = f64::from(i);
            [s, 0.5, 0.5 + 0.5 * (s * 1e-3).sin(), 0.25, 3.0 + (s * 0.7).sin()]
        })
        .collect();
    let tf = transfer(&rows);
    let table = Cumulative::new(&tf, 4096);
    let mut worst = 0.0_f64;
    for i in 0..200 {
        let a = 300.0 * f32_of(f64::from(i));
        worst = worst.max(error(&tf, &table, a + 3.3, a + 3000.7));
    }
    println!("many knots: {worst}");
    assert!(worst < 2e-3, "{worst}");
}

#[test]
fn nothing_overflows() {
    let finite = |tf: &TransferFunction, bins| {
        let table = Cumulative::new(tf, bins);
        let entries: &[f32] = bytemuck::cast_slice(&table.bins);
        assert!(entries.iter().all(|v| v.is_finite()));
        assert!(
            bytemuck::bytes_of(&table.head)
                .chunks(4)
                .all(|v| f32::from_le_bytes(v.try_into().unwrap()).is_finite())
        );
        let [first, last, ..] = table.head.range;
        for a in [-f32::MAX, first, 0.5 * first + 0.5 * last, last, f32::MAX] {
            for b in [-f32::MAX, first, 0.25 * first + 0.75 * last, last, f32::MAX] {
                assert!(lookup(&table, a, b).iter().all(|v| v.is_finite()), "{a} {b}");
            }
        }
    };
    let rows = [[0.0, 1.0, 1.0, 1.0, 0.0], [0.5, 1.0, 1.0, 1.0, 1e300], [1.0, 1.0, 1.0, 1.0, 0.0]];
    finite(&transfer(&rows), 65_536);
    let rows = [[-1e300, 1e300, 1.0, 1.0, 1e300], [1e300, 1e20, 1.0, 1.0, 1e300]];
    finite(&TransferFunction::from_rows(&rows).unwrap(), 65_536);
    let rows = [[0.0, 1e300, 1.0, 1.0, 1e300], [1e-29, 1e20, 1.0, 1.0, 1e300]];
    finite(&TransferFunction::from_rows(&rows).unwrap(), 4096);
    // Extinction far above the opaque range is opaque, and the rest stays exact.
    let tf = transfer(&[
        [0.0, 1.0, 0.5, 0.0, 2.0],
        [0.5, 1.0, 0.5, 0.0, 2.0],
        [0.5, 0.5, 0.5, 1.0, 1e300],
        [1.0, 0.5, 0.5, 1.0, 1e300],
    ]);
    let table = Cumulative::new(&tf, 4096);
    assert!(error(&tf, &table, 0.0, 0.4999) < 1e-6);
    close(lookup(&table, 0.75, 1.0), [0.5e30, 0.5e30, 1e30, 1e30]);
    close(lookup(&table, 0.25, 0.75), [0.25e30, 0.25e30, 0.5e30, 0.5e30]);
}

#[test]
fn lines_stay_above_zero_and_means_are_exact() {
    let tf = transfer(&[
        [0.0, 1.0, 0.3, 0.0, 0.0],
        [0.5, 1.0, 0.3, 0.0, 0.0],
        [0.5, 0.0, 0.3, 2.0, 50.0],
        [0.61, 1.0, 0.3, 1.0, 0.0],
        [1.0, 1.0, 0.0, 0.0, 8.0],
    ]);
    for bins in [1, 3, 7, 64, 1000] {
        let table = Cumulative::new(&tf, bins);
        assert_eq!(table.bins.len(), index(bins));
        let width = f64::from(table.head.range[3]);
        assert!(width * f64::from(bins) >= 1.0);
        for (i, bin) in table.bins.iter().enumerate() {
            let edge = |i: usize| f32_of(f64_of(i) * width);
            let want = exact(&tf, edge(i), edge(i + 1));
            for (c, want) in want.into_iter().enumerate() {
                assert!((f64::from(bin.mean[c]) - want).abs() < 1e-5 * want.max(1e-6), "{i}/{bins} {c}");
                assert!(bin.mean[c] - 0.5 * bin.rise[c].abs() >= 0.0);
            }
            let sum = exact(&tf, 0.0, edge(i)).map(|v| v * f64_of(i));
            let is = f64::from(bin.high[3]) + f64::from(bin.low[3]);
            assert!((is - sum[3]).abs() <= 1e-6 * sum[3], "{i}: {is} {}", sum[3]);
        }
    }
    // Without a knot inside, the rise is from edge to edge.
    let table = Cumulative::new(&tf, 1000);
    let (i, _) = place(&table, 0.8);
    let width = f64::from(table.head.range[3]);
    let ends = [f64_of(i) * width, f64_of(i + 1) * width].map(|s| tf.at(s).1);
    assert!((f64::from(table.bins[i].rise[3]) - (ends[1] - ends[0])).abs() < 1e-6 * ends[1]);
}

#[test]
fn round_up_rounds_up() {
    assert_eq!(round_up(1.0, 12), 1.0);
    assert_eq!(round_up(1.0 + 1e-15, 12), 1.0 + 2_f64.powi(-11));
    assert_eq!(round_up(1.999_99, 12), 2.0);
    assert_eq!(round_up(0.7, 1), 1.0);
    assert_eq!(round_up(0.7, 53), 0.7);
}

#[test]
#[ignore = "a measurement"]
fn measure_build_time() {
    let rows: Vec<[f64; 5]> = (0..65_536).map(|i| [f64::from(i), 0.5, 0.5, 0.2, 1.0]).collect();
    for (name, tf) in [("4 knots", transfer(&SMOOTH)), ("65536 knots", transfer(&rows))] {
        let mut times: Vec<f64> = (0..50)
            .map(|_| {
                let start = std::time::Instant::now();
                std::hint::black_box(Cumulative::new(&tf, 4096));
                start.elapsed().as_secs_f64()
            })
            .collect();
        times.sort_by(f64::total_cmp);
        println!("{name}: {:.3} ms, {} bytes", times[25] * 1e3, count(4096 * size_of::<CumulativeBin>()));
    }
}
