//! Trained Gaussian splats in every format: what is read, what is refused, real files against each other.

pub mod compressed;
pub mod gltf;
pub mod ksplat;
pub mod ply;
mod real;
mod real_others;
pub mod sog;
pub mod splat;
pub mod spz;
mod write;

use volraster::glam::DVec3;
use volraster::scene::{Gaussians, harmonics};

/// Median and largest difference.
pub type Spread = [f64; 2];

/// Differences of splats: of coordinates, of covariance relative to its norm, of opacity, and of colour before clamping, the worst of
/// 64 directions.
#[derive(Debug)]
pub struct Differences {
    pub place: Spread,
    pub covariance: Spread,
    pub opacity: Spread,
    pub colour: Spread,
}

fn spread(mut values: Vec<f64>) -> Spread {
    values.sort_by(f64::total_cmp);
    [values[values.len() / 2], values[values.len() - 1]]
}

/// 64 directions, evenly spread.
pub fn directions() -> Vec<DVec3> {
    let golden = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    let direction = |i: u32| {
        let z = 1.0 - (2.0 * f64::from(i) + 1.0) / 64.0;
        let (radius, angle) = ((1.0 - z * z).sqrt(), golden * f64::from(i));
        DVec3::new(radius * angle.cos(), radius * angle.sin(), z)
    };
    (0..64).map(direction).collect()
}

/// The colour of a splat before clamping, from where the functions have these values.
pub fn colour(splats: &Gaussians, i: usize, basis: &[f64]) -> DVec3 {
    let width = 3 * harmonics::count(splats.degree());
    let own = &splats.harmonics()[i * width..(i + 1) * width];
    own.chunks_exact(3)
        .zip(basis)
        .map(|(k, y)| DVec3::new(k[0].into(), k[1].into(), k[2].into()) * *y)
        .sum::<DVec3>()
        + 0.5
}

/// Compares splats with those that they were made of, in the same order or matched by place.
pub fn compare(splats: &Gaussians, truth: &Gaussians, by_place: bool) -> Differences {
    assert_eq!(splats.len(), truth.len());
    let pairs: Vec<(usize, usize)> = (0..splats.len())
        .map(|i| {
            let distance = |j: &usize| splats.centre(i).distance_squared(truth.centre(*j));
            let nearest = || (0..truth.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap();
            (i, if by_place { nearest() } else { i })
        })
        .collect();
    let of = |difference: &dyn Fn(usize, usize) -> f64| {
        spread(pairs.iter().map(|&(i, j)| difference(i, j)).collect())
    };
    let bases: Vec<_> = directions().into_iter().map(|d| harmonics::basis(4, d)).collect();
    let norm = |m: volraster::glam::DMat3| m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
    Differences {
        place: of(&|i, j| (splats.centre(i) - truth.centre(j)).abs().max_element()),
        covariance: of(&|i, j| {
            let covariance = truth.covariance(j);
            norm(splats.covariance(i) - covariance) / norm(covariance)
        }),
        opacity: of(&|i, j| f64::from((splats.opacities()[i] - truth.opacities()[j]).abs())),
        colour: of(&|i, j| {
            let worst =
                |basis: &[f64; 25]| (colour(splats, i, basis) - colour(truth, j, basis)).abs().max_element();
            bases.iter().map(worst).fold(0.0, f64::max)
        }),
    }
}
