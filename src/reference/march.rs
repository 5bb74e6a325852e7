//! Emission and absorption along pieces of a ray on which the transfer function is linear.

use glam::DVec3;

use crate::scene::{Knot, TransferFunction};

use super::decay::{Decay, FAINT, STRONG, WEAK};
use super::polynomial::{self, Cubic, gauss_legendre};

/// Optical depth at which a ray ends: the transmittance is below exp(-60) < 1e-26.
const OPAQUE: f64 = 60.0;

/// Optical depth from which on the opacity is exactly 1.
const SETTLED: f64 = 40.0;

/// Share of a number that changes none of its bits when it is added: 2^-54, and less for the rounding of both.
const UNSEEN: f64 = f64::EPSILON / 64.0;

/// Largest optical depths of panels that are integrated by 8, 10 and 14 points, to 1e-12 of the panel's own
/// emission.
const PANELS: [f64; 3] = [0.002, 0.05, 1.0];

/// Extinctions are clamped to this, so that the polynomials do not overflow; a ray is opaque long before.
const MAX_TAU: f64 = 1e150;

/// Returns a scalar, with infinities replaced by the ends of the transfer function.
pub(super) fn finite(scalar: f64, [low, high]: [f64; 2]) -> f64 {
    match scalar {
        f64::NEG_INFINITY => low,
        f64::INFINITY => high,
        scalar => scalar,
    }
}

/// How the light shows the colour emitted at a place of a segment, from 0 to 1: the factor of the colour, and the white that is
/// added.
pub(super) type Shade<'a> = &'a dyn Fn(f64) -> [f64; 2];

/// A transfer function, prepared for integration along rays.
#[derive(Debug)]
pub(super) struct Classes {
    knots: Vec<Knot>,
    /// The bounds of the intervals: the scalars of the knots between -Inf and +Inf.
    bounds: Vec<f64>,
    /// Entry i counts the knots among the first i whose extinction is positive.
    absorbing: Vec<usize>,
    /// The ranges of scalars without extinction: each from its lower end to below its upper end.
    vacuum: Vec<[f64; 2]>,
    /// The greatest of each channel of the colours.
    pub(super) most: DVec3,
    rules: Rules,
}

/// The quadrature rules of panels, each with a series of the transmittance.
#[derive(Debug)]
struct Rules {
    few: Rule<8, 6>,
    more: Rule<10, 9>,
    most: Rule<14, 16>,
}

impl Rules {
    fn new() -> Self {
        Self { few: Rule::new(FAINT), more: Rule::new(WEAK), most: Rule::new(STRONG) }
    }
}

/// A quadrature rule.
#[derive(Debug)]
struct Rule<const N: usize, const TERMS: usize> {
    places: [f64; N],
    weights: [f64; N],
    decay: Decay<TERMS>,
}

impl<const N: usize, const TERMS: usize> Rule<N, TERMS> {
    fn new(decay: Decay<TERMS>) -> Self {
        let nodes = gauss_legendre(N);
        Self {
            places: std::array::from_fn(|i| nodes[i].x),
            weights: std::array::from_fn(|i| nodes[i].weight),
            decay,
        }
    }

    /// Integrates the emission of a panel, times the distance of its place from 1 and from 0. `extinction` is
    /// optical depth per unit of the parameter.
    fn moments(&self, extinction: &Cubic, place: &Cubic) -> [f64; 2] {
        let decays = self.at_nodes(|x| self.decay.at(polynomial::integral(extinction, x)));
        let extinctions = self.at_nodes(|x| polynomial::value(extinction, x));
        let places = self.at_nodes(|x| polynomial::value(place, x));
        let mut moments = [0.0; 2];
        for i in 0..N {
            let emitted = self.weights[i] * extinctions[i] * decays[i];
            moments[0] += emitted * (1.0 - places[i]);
            moments[1] += emitted * places[i];
        }
        moments
    }

    /// Returns a function's values at the nodes.
    ///
    /// Not inlined: among other code the compiler does not vectorise the loop.
    #[inline(never)]
    fn at_nodes(&self, f: impl Fn(f64) -> f64) -> [f64; N] {
        let mut values = [0.0; N];
        for (value, &x) in values.iter_mut().zip(&self.places) {
            *value = f(x);
        }
        values
    }
}

impl Classes {
    /// Copies the knots and computes the quadrature rules.
    pub(super) fn new(transfer: &TransferFunction) -> Self {
        let knots: Vec<Knot> =
            transfer.knots().iter().map(|k| Knot { tau: k.tau.min(MAX_TAU), ..*k }).collect();
        let mut absorbing = vec![0];
        let mut count = 0;
        for knot in &knots {
            count += usize::from(knot.tau > 0.0);
            absorbing.push(count);
        }
        let scalars = knots.iter().map(|knot| knot.s);
        let bounds = [f64::NEG_INFINITY].into_iter().chain(scalars).chain([f64::INFINITY]).collect();
        let most = knots.iter().fold(DVec3::ZERO, |most, knot| most.max(knot.colour));
        let mut classes = Self { knots, bounds, absorbing, vacuum: Vec::new(), most, rules: Rules::new() };
        let empty = |interval: &usize| classes.are_vacuum(*interval, *interval);
        let mut vacuum: Vec<[f64; 2]> = Vec::new();
        for interval in (0..=classes.knots.len()).filter(empty) {
            let range = [classes.bounds[interval], classes.bounds[interval + 1]];
            match vacuum.last_mut() {
                Some(last) if interval > 0 && empty(&(interval - 1)) => last[1] = range[1],
                _ => vacuum.push(range),
            }
        }
        classes.vacuum = vacuum;
        classes
    }

    /// Returns the interval between knots that holds a scalar: the number of knots at or below it.
    pub(super) fn interval(&self, s: f64) -> usize {
        self.bounds[1..=self.knots.len()].partition_point(|&knot| knot <= s)
    }

    /// Returns the interval that holds a scalar, at once if it is the one given.
    fn interval_near(&self, near: usize, s: f64) -> usize {
        if self.bounds[near] <= s && s < self.bounds[near + 1] { near } else { self.interval(s) }
    }

    /// Returns the knots that bound an interval; beyond the ends, both are the end knot.
    fn ends(&self, interval: usize) -> (&Knot, &Knot) {
        let last = self.knots.len() - 1;
        (&self.knots[interval.saturating_sub(1)], &self.knots[interval.min(last)])
    }

    /// Returns whether extinction is zero for all scalars of a range.
    pub(super) fn is_vacuum(&self, [low, high]: [f64; 2]) -> bool {
        self.vacuum.iter().any(|&[from, to]| from <= low && high < to)
    }

    /// Returns whether extinction is zero in all of these intervals.
    pub(super) fn are_vacuum(&self, first: usize, last: usize) -> bool {
        let from = first.saturating_sub(1);
        let to = (last + 1).min(self.knots.len());
        self.absorbing[to] == self.absorbing[from]
    }
}

/// Optical depth and colour accumulated along a ray, front to back.
#[derive(Clone, Copy, Debug)]
pub(super) struct March {
    pub(super) depth: f64,
    pub(super) colour: [f64; 3],
    /// Bounds of the colours that are emitted.
    most: [f64; 3],
    /// The interval of a scalar that was met last.
    near: usize,
}

impl March {
    /// Begins a ray. `most` bounds the emitted colours; without a bound it is infinite.
    pub(super) fn new(most: [f64; 3]) -> Self {
        Self { depth: 0.0, colour: [0.0; 3], most, near: 0 }
    }

    /// Returns whether the rest of the ray is invisible.
    pub(super) fn is_opaque(&self) -> bool {
        self.depth >= OPAQUE || self.depth >= SETTLED && self.is_settled()
    }

    /// Returns whether no colour behind can change the sums: each is a small part of their last bit.
    fn is_settled(&self) -> bool {
        let rest = (-self.depth).exp();
        self.most.iter().zip(self.colour).all(|(most, sum)| rest * most <= UNSEEN * sum)
    }

    /// Returns premultiplied colour and opacity.
    pub(super) fn pixel(&self) -> [f64; 4] {
        let [r, g, b] = self.colour;
        [r, g, b, -(-self.depth).exp_m1()]
    }

    /// Adds a segment along which the scalar is a cubic on [0, 1].
    ///
    /// It is cut at the knots and integrated piece by piece; `shade` lights its colours.
    pub(super) fn add_cubic(
        &mut self,
        classes: &Classes,
        scalar: &Cubic,
        length: f64,
        shade: Option<Shade<'_>>,
    ) {
        // Between turning points the scalar is monotone and crosses each knot at most once.
        let mut from = 0.0;
        let [first, second] = polynomial::turning_points(scalar);
        for to in [first, second, 1.0] {
            if !to.is_nan() {
                self.add_monotone(classes, scalar, length, [from, to], shade);
                from = to;
            }
        }
    }

    fn add_monotone(
        &mut self,
        classes: &Classes,
        scalar: &Cubic,
        length: f64,
        [from, to]: [f64; 2],
        shade: Option<Shade<'_>>,
    ) {
        let (start, end) = (polynomial::value(scalar, from), polynomial::value(scalar, to));
        let first = classes.interval_near(self.near, start.min(end));
        let last = classes.interval_near(first, start.max(end));
        self.near = last;
        if classes.are_vacuum(first, last) {
            return;
        }
        let rising = end > start;
        let mut here = from;
        let mut crossed = None;
        for step in first..last {
            let knot = if rising { step } else { first + last - 1 - step };
            let s = classes.knots[knot].s;
            // The second knot of a jump is at the same place as the first.
            if crossed == Some(s) {
                continue;
            }
            crossed = Some(s);
            let cut = polynomial::crossing(scalar, s, here, to);
            self.add_piece(classes, scalar, length, [here, cut], shade);
            if self.is_opaque() {
                return;
            }
            here = cut;
        }
        self.add_piece(classes, scalar, length, [here, to], shade);
    }

    /// Adds a piece inside one interval of the transfer function.
    fn add_piece(
        &mut self,
        classes: &Classes,
        scalar: &Cubic,
        length: f64,
        [from, to]: [f64; 2],
        shade: Option<Shade<'_>>,
    ) {
        let width = to - from;
        if width <= 0.0 {
            return;
        }
        let middle = polynomial::value(scalar, from + 0.5 * width);
        self.near = classes.interval_near(self.near, middle);
        let (a, b) = classes.ends(self.near);
        if a.tau == 0.0 && b.tau == 0.0 {
            return;
        }
        // Position between the two knots, 0 to 1, along the piece.
        let range = b.s - a.s;
        let mut place = [0.0; 4];
        if range > 0.0 {
            place = if width < 1.0 { polynomial::part(scalar, from, width) } else { *scalar };
            place[0] -= a.s;
            place = place.map(|c| c / range);
            // A cubic with values in [0, 1] has coefficients of at most 24 (Chebyshev's). Larger ones mean
            // that the knots are closer together than the scalar's rounding.
            if !place.iter().all(|c| c.abs() < 32.0) {
                place = [((middle - a.s) / range).clamp(0.0, 1.0), 0.0, 0.0, 0.0];
            }
        }
        match shade {
            None => self.add_linear(&classes.rules, &place, length * width, a, b),
            Some(shade) => {
                self.add_lit(&classes.rules, &place, length * width, [a, b], &|u| shade(from + u * width));
            }
        }
    }

    /// Adds a piece whose extinction and colour are linear between two knots, at positions given by a cubic.
    ///
    /// The optical depth along the piece is then a quartic in closed form, and so is the emission where the
    /// colour is constant. Otherwise panels of bounded optical depth are integrated by Gauss-Legendre
    /// quadrature.
    fn add_linear(&mut self, rules: &Rules, place: &Cubic, length: f64, a: &Knot, b: &Knot) {
        let mut extinction = place.map(|c| (b.tau - a.tau) * c * length);
        extinction[0] += a.tau * length;
        let total = polynomial::integral(&extinction, 1.0).max(0.0);
        if total == 0.0 {
            return;
        }
        if a.colour == b.colour || place[1..] == [0.0; 3] {
            let colour = a.colour + (b.colour - a.colour) * place[0];
            let emitted = (-self.depth).exp() * -(-total).exp_m1();
            for (sum, c) in self.colour.iter_mut().zip(colour.to_array()) {
                *sum += c * emitted;
            }
            self.depth += total;
            return;
        }
        let [.., limit] = PANELS;
        let (mut extinction, mut place) = (extinction, *place);
        loop {
            let rest = polynomial::integral(&extinction, 1.0).max(0.0);
            if rest <= limit {
                self.add_panel(rules, &extinction, &place, rest, a, b);
                return;
            }
            // The depth grows along the piece: bisect for a panel between half the limit and the limit.
            let (mut low, mut high) = (0.0, 1.0);
            let mut width = 0.5;
            let mut depth = polynomial::integral(&extinction, width);
            // 600 halvings reach below 1 / MAX_TAU.
            for _ in 0..600 {
                if depth > limit {
                    high = width;
                } else if depth < 0.5 * limit {
                    low = width;
                } else {
                    break;
                }
                width = 0.5 * (low + high);
                depth = polynomial::integral(&extinction, width);
            }
            let scaled = polynomial::part(&extinction, 0.0, width).map(|c| c * width);
            self.add_panel(rules, &scaled, &polynomial::part(&place, 0.0, width), depth.max(0.0), a, b);
            if self.is_opaque() {
                return;
            }
            let left = 1.0 - width;
            extinction = polynomial::part(&extinction, width, left).map(|c| c * left);
            place = polynomial::part(&place, width, left);
        }
    }

    /// Adds a piece as [`Self::add_linear`] does, with its colour lit: panels are halved until their emission is exact to
    /// 1e-11, because light has kinks where it grazes a surface.
    fn add_lit(&mut self, rules: &Rules, place: &Cubic, length: f64, [a, b]: [&Knot; 2], shade: Shade<'_>) {
        let [.., limit] = PANELS;
        let mut extinction = place.map(|c| (b.tau - a.tau) * c * length);
        extinction[0] += a.tau * length;
        let colour = |u: f64| {
            let [seen, white] = shade(u);
            let emitted = a.colour + (b.colour - a.colour) * polynomial::value(place, u);
            (emitted * seen + white).to_array()
        };
        let glow = Glow { rule: &rules.most, extinction: &extinction, colour: &colour };
        let mut from = 0.0;
        while from < 1.0 && !self.is_opaque() {
            let mut width = 1.0 - from;
            while glow.depth(from, width) > limit {
                width *= 0.5;
            }
            let emitted = glow.refined(from, width, glow.emission(from, width), 40);
            let transmittance = (-self.depth).exp();
            for (sum, emitted) in self.colour.iter_mut().zip(emitted) {
                *sum += transmittance * emitted;
            }
            self.depth += glow.depth(from, width);
            from += width;
        }
    }

    /// Adds one panel. `extinction` is optical depth per unit of the parameter, `total` its integral.
    fn add_panel(
        &mut self,
        rules: &Rules,
        extinction: &Cubic,
        place: &Cubic,
        total: f64,
        a: &Knot,
        b: &Knot,
    ) {
        // The colour is a.colour (1 - place) + b.colour place, so two moments serve all channels.
        let [near, far] = match PANELS {
            [few, ..] if total <= few => rules.few.moments(extinction, place),
            [_, more, _] if total <= more => rules.more.moments(extinction, place),
            _ => rules.most.moments(extinction, place),
        };
        let transmittance = (-self.depth).exp();
        for ((sum, c), d) in self.colour.iter_mut().zip(a.colour.to_array()).zip(b.colour.to_array()) {
            *sum += transmittance * (c * near + d * far);
        }
        self.depth += total;
    }
}

/// A lit piece: optical depth per unit of its parameter, and its colour.
struct Glow<'a> {
    rule: &'a Rule<14, 16>,
    extinction: &'a Cubic,
    colour: &'a dyn Fn(f64) -> [f64; 3],
}

impl Glow<'_> {
    /// Returns the optical depth of a panel.
    fn depth(&self, from: f64, width: f64) -> f64 {
        (polynomial::integral(&polynomial::part(self.extinction, from, width), 1.0) * width).max(0.0)
    }

    /// Returns the emission of a panel by one quadrature.
    fn emission(&self, from: f64, width: f64) -> [f64; 3] {
        let part = polynomial::part(self.extinction, from, width).map(|c| c * width);
        let mut sum = [0.0; 3];
        for (&x, weight) in self.rule.places.iter().zip(&self.rule.weights) {
            let absorbed = self.rule.decay.at(polynomial::integral(&part, x));
            let emitted = weight * polynomial::value(&part, x) * absorbed;
            for (sum, colour) in sum.iter_mut().zip((self.colour)(from + x * width)) {
                *sum += emitted * colour;
            }
        }
        sum
    }

    /// Returns the emission of a panel from its halves, halved again while that changes it. `whole` is the emission by one
    /// quadrature.
    fn refined(&self, from: f64, width: f64, whole: [f64; 3], levels: u32) -> [f64; 3] {
        let half = 0.5 * width;
        let (near, far) = (self.emission(from, half), self.emission(from + half, half));
        let through = (-self.depth(from, half)).exp();
        let both = |near: [f64; 3], far: [f64; 3]| std::array::from_fn(|i| near[i] + through * far[i]);
        let sum: [f64; 3] = both(near, far);
        let change = sum.iter().zip(whole).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if change <= 1e-11 || levels == 0 {
            return sum;
        }
        both(self.refined(from, half, near, levels - 1), self.refined(from + half, half, far, levels - 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Monotone cubics from 0 to 1 on the unit interval. Their slopes are scaled squares or products of
    /// factors that do not change sign.
    fn monotone_cubics() -> Vec<Cubic> {
        let mut cubics = vec![[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];
        for i in 0..=20 {
            // (x - r)^2 with r inside or outside, and x (1 - x) + e.
            let r = -0.5 + 0.1 * f64::from(i);
            cubics.push([0.0, r * r, -r, 1.0 / 3.0]);
            cubics.push([0.0, 0.05 * f64::from(i), 0.5, -1.0 / 3.0]);
        }
        for c in &mut cubics {
            let end = polynomial::value(c, 1.0);
            *c = c.map(|c| c / end);
        }
        let falling = |c: &Cubic| [1.0 - c[0], -c[1], -c[2], -c[3]];
        let mirrored: Vec<Cubic> = cubics.iter().map(falling).collect();
        cubics.extend(mirrored);
        cubics
    }

    /// The panels have the stated accuracy: each rule at its largest optical depth, against the same segment
    /// in 64 parts.
    #[test]
    fn one_panel_equals_many() {
        let transfer = TransferFunction::from_rows(&[[0.0; 5]]).unwrap();
        let rules = Classes::new(&transfer).rules;
        for limit in PANELS {
            let mut worst = 0.0_f64;
            for place in monotone_cubics() {
                for (near, far) in [(0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (0.2, 1.0)] {
                    let knot = |s: f64, tau: f64| Knot { s, colour: DVec3::new(s, 1.0 - s, 1.0), tau };
                    let (a, b) = (knot(0.0, near), knot(1.0, far));
                    let mut extinction = place.map(|c| (far - near) * c);
                    extinction[0] += near;
                    let scale = limit / polynomial::integral(&extinction, 1.0);
                    let extinction = extinction.map(|c| c * scale);
                    let mut one = March::new([f64::INFINITY; 3]);
                    one.add_panel(&rules, &extinction, &place, limit, &a, &b);
                    let mut many = March::new([f64::INFINITY; 3]);
                    let width = 1.0 / 64.0;
                    for i in 0..64 {
                        let start = f64::from(i) * width;
                        let tau = polynomial::part(&extinction, start, width).map(|c| c * width);
                        let total = polynomial::integral(&tau, 1.0);
                        many.add_panel(&rules, &tau, &polynomial::part(&place, start, width), total, &a, &b);
                    }
                    for (one, many) in one.colour.iter().zip(many.colour) {
                        let error = (one - many).abs() / limit;
                        worst = worst.max(error);
                        assert!(error < 1e-12, "depth {limit}, {place:?}, {near} to {far}: {error:e}");
                    }
                }
            }
            println!("depth {limit}: {worst:e}");
        }
    }

    /// Where the scalar's rounding is coarser than the distance of two knots, a piece between them has one
    /// position, without overflow or extrapolation.
    #[test]
    fn knots_closer_than_rounding_do_not_extrapolate() {
        let rows = [[0.0, 1.0, 0.0, 0.0, 2.0], [5e-324, 0.0, 1.0, 0.0, 1e6], [1.0, 0.0, 1.0, 0.0, 2.0]];
        let classes = Classes::new(&TransferFunction::from_rows(&rows).unwrap());
        let mut march = March::new([f64::INFINITY; 3]);
        march.add_piece(&classes, &[-1e-9, 2e-9, 0.0, 0.0], 1.5, [0.0, 1.0], None);
        let alpha = -(-3.0_f64).exp_m1();
        assert_eq!(march.pixel(), [alpha, 0.0, 0.0, alpha]);
    }

    #[test]
    fn intervals_know_their_vacuum() {
        let row = |s: f64, tau: f64| [s, 0.0, 0.0, 0.0, tau];
        let rows = [row(0.0, 0.0), row(1.0, 0.0), row(2.0, 3.0), row(3.0, 0.0), row(3.0, 1.0)];
        let classes = Classes::new(&TransferFunction::from_rows(&rows).unwrap());
        let vacuum = |a: f64, b: f64| classes.is_vacuum([a, b]);
        assert!(vacuum(-9.0, 0.9) && vacuum(0.5, 0.5) && vacuum(-2.0, -1.0));
        assert!(!vacuum(0.5, 1.0), "1 opens the interval that absorbs");
        assert!(!vacuum(2.5, 2.5) && !vacuum(-1.0, 9.0) && !vacuum(8.0, 9.0));
        // Ranges of vacuum are those of intervals, also at the ends and within.
        let taus = [1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 3.0, 0.0];
        let rows: Vec<_> = taus.iter().zip([0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.5, 4.0, 5.0]).collect();
        let rows: Vec<_> = rows.into_iter().map(|(tau, s)| row(s, *tau)).collect();
        for rows in [&rows[..], &rows[1..], &rows[1..4], &rows[..8], &rows[..1]] {
            let classes = Classes::new(&TransferFunction::from_rows(rows).unwrap());
            let scalars = (-4..24).map(|i| 0.25 * f64::from(i));
            for (a, b) in
                scalars.clone().flat_map(|a| scalars.clone().map(move |b| (a, b))).filter(|(a, b)| a <= b)
            {
                let want = classes.are_vacuum(classes.interval(a), classes.interval(b));
                assert_eq!(classes.is_vacuum([a, b]), want, "{a} to {b} of {} knots", rows.len());
            }
        }
    }

    /// Segments behind the end of a ray change no bit of its pixel: bright behind dark, which shows for long.
    #[test]
    fn rays_end_where_nothing_behind_shows() {
        let rows = [[0.0, 1e-6, 1e-3, 0.0, 0.5], [1.0, 1.0, 1.0, 0.0, 0.7]];
        let classes = Classes::new(&TransferFunction::from_rows(&rows).unwrap());
        let bits = |march: &March| march.pixel().map(f64::to_bits);
        let mut march = March::new(classes.most.to_array());
        while march.depth < SETTLED {
            march.add_cubic(&classes, &[0.0; 4], 0.1, None);
        }
        let dark = bits(&march);
        while !march.is_opaque() {
            march.add_cubic(&classes, &[1.0, -1.0, 0.0, 0.0], 0.1, None);
        }
        assert!(bits(&march) != dark && march.depth < OPAQUE, "{}", march.depth);
        let pixel = bits(&march);
        while march.depth < OPAQUE {
            march.add_cubic(&classes, &[0.0, 1.0, 0.0, 0.0], 0.1, None);
            assert_eq!(bits(&march), pixel, "{}", march.depth);
        }
    }
}
