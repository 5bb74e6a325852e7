//! The density model: extinction and emission are sums of kernels.

use crate::num;

use super::super::decay::{STRONG, WEAK, WEAK_DEPTH};
use super::super::march::March;
use super::super::polynomial::gauss_legendre;
use super::values::{Medium, Sums};

/// Largest length of a panel in units of the scale, and number of points; ascending. The points follow a
/// Gaussian's integral to 1e-9 of its peak at each node, and to rounding over the whole panel.
const PANELS: [(f64, usize); 5] = [(0.028, 4), (0.19, 6), (0.53, 8), (1.5, 12), (2.7, MOST)];

/// Largest number of points.
const MOST: usize = 16;

/// Largest optical depth of a panel.
const DEPTH: f64 = 1.0;

/// A Gauss-Legendre rule on the unit interval that also integrates up to each of its nodes.
#[derive(Debug)]
pub(super) struct Rule {
    /// Largest length of the rule's panels, in units of the scale.
    length: f64,
    nodes: Vec<f64>,
    weights: Vec<f64>,
    /// Weights of the values at each node in the integrals from 0 to all nodes.
    partial: Vec<[f64; MOST]>,
}

impl Rule {
    pub(super) fn all() -> Vec<Self> {
        PANELS.iter().map(|&(length, points)| Self::new(length, points)).collect()
    }

    fn new(length: f64, points: usize) -> Self {
        let rule = gauss_legendre(points);
        let legendre: Vec<Vec<f64>> = rule.iter().map(|node| legendre(node.x, points)).collect();
        // Write the interpolant through the nodes as a Legendre series, whose terms have integrals in closed
        // form.
        let weight = |j: usize, k: usize| {
            let terms = (1..points).map(|m| legendre[k][m] * 0.5 * (legendre[j][m + 1] - legendre[j][m - 1]));
            rule[k].weight * (rule[j].x + terms.sum::<f64>())
        };
        let partial =
            (0..points).map(|k| std::array::from_fn(|j| if j < points { weight(j, k) } else { 0.0 }));
        Self {
            length,
            partial: partial.collect(),
            nodes: rule.iter().map(|node| node.x).collect(),
            weights: rule.iter().map(|node| node.weight).collect(),
        }
    }
}

/// Evaluates the Legendre polynomials of degree 0 to `degree` on the unit interval.
fn legendre(x: f64, degree: usize) -> Vec<f64> {
    let x = 2.0 * x - 1.0;
    let mut all = vec![1.0, x];
    for m in 1..degree {
        let n = num::f64_of(m);
        all.push(((2.0 * n + 1.0) * x * all[m] - n * all[m - 1]) / (n + 1.0));
    }
    all
}

/// The state of a ray, front to back.
pub(super) struct Density<'a> {
    rules: &'a [Rule],
    march: March,
}

impl<'a> Density<'a> {
    /// Begins a ray. `most` bounds the colours of all sums.
    pub(super) fn new(rules: &'a [Rule], most: [f64; 3]) -> Self {
        Self { rules, march: March::new(most) }
    }

    /// Adds a panel that is short compared with the kernels, halved until its optical depth is small too.
    fn panel(&mut self, rule: &Rule, from: f64, to: f64, sums: &impl Fn(f64) -> Sums) {
        if self.is_opaque() {
            return;
        }
        let length = to - from;
        let mut at = [[0.0; 4]; MOST];
        let mut total = [0.0; 4];
        for ((at, x), weight) in at.iter_mut().zip(&rule.nodes).zip(&rule.weights) {
            *at = sums(from + length * x).map(|value| value * length);
            for (total, value) in total.iter_mut().zip(*at) {
                *total += weight * value;
            }
        }
        let depth = total[0];
        if depth <= 0.0 {
            return;
        }
        let transmittance = (-self.march.depth).exp();
        if depth > DEPTH {
            let middle = from + 0.5 * length;
            if middle > from && middle < to {
                self.panel(rule, from, middle, sums);
                self.panel(rule, middle, to, sums);
                return;
            }
            // Opaque within the rounding of the parameter: treat the panel as one place.
            let emitted = transmittance * -(-depth).exp_m1();
            for (sum, total) in self.march.colour.iter_mut().zip(&total[1..]) {
                *sum += emitted * (total / depth);
            }
        } else {
            // The optical depths up to all nodes at once, which the compiler vectorises.
            let mut depths = [0.0; MOST];
            for (partial, at) in rule.partial.iter().zip(&at) {
                for (depth, partial) in depths.iter_mut().zip(partial) {
                    *depth += partial * at[0];
                }
            }
            let depths = &mut depths[..rule.nodes.len()];
            if depth <= WEAK_DEPTH {
                depths.iter_mut().for_each(|depth| *depth = WEAK.at(*depth));
            } else {
                depths.iter_mut().for_each(|depth| *depth = STRONG.at(*depth));
            }
            for ((weight, at), decay) in rule.weights.iter().zip(&at).zip(depths) {
                let seen = transmittance * weight * *decay;
                for (sum, emission) in self.march.colour.iter_mut().zip(&at[1..]) {
                    *sum += seen * emission;
                }
            }
        }
        self.march.depth += depth;
    }
}

impl Medium for Density<'_> {
    fn add(&mut self, from: f64, to: f64, scale: f64, sums: &impl Fn(f64) -> Sums) {
        let Some(longest) = self.rules.last() else { return };
        let panels = ((to - from) / (longest.length * scale)).ceil().max(1.0);
        let length = (to - from) / panels;
        let all = self.rules;
        let rule = all.iter().find(|rule| length <= rule.length * scale).unwrap_or(longest);
        let mut here = from;
        let mut panel = 1.0;
        while panel <= panels {
            let end = if panel < panels { from + length * panel } else { to };
            self.panel(rule, here, end, sums);
            here = end;
            panel += 1.0;
        }
    }

    fn is_vacuum(&self, mut values: impl Iterator<Item = Sums>) -> bool {
        values.all(|value| value[0] == 0.0)
    }

    fn is_opaque(&self) -> bool {
        self.march.is_opaque()
    }

    fn pixel(&self) -> [f64; 4] {
        self.march.pixel()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each rule on its longest panel integrates a Gaussian up to each node, wherever the panel lies.
    #[test]
    fn rules_reach_their_stated_accuracy() {
        let gaussian = |x: f64| (-0.5 * x * x).exp();
        for rule in Rule::all() {
            let mut worst = 0.0_f64;
            for place in -12..=12 {
                let start = 0.5 * f64::from(place);
                for (j, x) in rule.nodes.iter().enumerate() {
                    let parts = rule.partial.iter().zip(&rule.nodes);
                    let got: f64 = parts.map(|(w, x)| w[j] * gaussian(start + x * rule.length)).sum();
                    // Composite Simpson, with an error below 1e-13 here.
                    let n = 2000;
                    let h = x / f64::from(n);
                    let want: f64 = (0..n)
                        .map(|i| {
                            let at = |y: f64| gaussian(start + y * rule.length);
                            let y = h * f64::from(i);
                            (at(y) + 4.0 * at(y + 0.5 * h) + at(y + h)) * h / 6.0
                        })
                        .sum();
                    worst = worst.max((got - want).abs());
                }
            }
            println!("{} points, length {}: {worst:e}", rule.nodes.len(), rule.length);
            assert!(worst < 1e-9, "{} points: {worst:e}", rule.nodes.len());
        }
    }
}
