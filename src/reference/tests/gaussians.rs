//! Trained splats against formulas of their own: projections by differences, rays by sampling.

use glam::{DMat2, DVec2, DVec3};

use super::super::{ReferenceOptions, pixels, ray, render};
use crate::num;
use crate::scene::{
    Camera, Clip, GaussianParts, Gaussians, Projection, Scene, SplatRule, Surface, TransferFunction, View,
};

const PERSPECTIVE: Projection = Projection::Perspective { fov_y_deg: 40.0 };
const ORTHOGRAPHIC: Projection = Projection::Orthographic { half_height: 1.5 };

fn view(projection: Projection) -> View {
    let camera =
        Camera { eye: DVec3::new(1.0, -0.7, -4.0), target: DVec3::ZERO, up: DVec3::NEG_Y, projection };
    View::new(camera, 40, 32).unwrap()
}

/// Splats near the origin, of several shapes, with harmonics of degree 1.
fn splats(count: usize) -> GaussianParts {
    let number = |i: usize| num::f32_of(num::f64_of(i * 37 % 101) / 50.0 - 1.0);
    GaussianParts {
        centres: (0..count).map(|i| [number(i), number(3 * i + 5), number(7 * i + 9)]).collect(),
        rotations: (0..count).map(|i| [1.5, number(i + 2), number(i + 3), number(i + 4)]).collect(),
        log_scales: (0..count).map(|i| [-1.0 + number(i), -1.5, -2.0 + number(i + 8)]).collect(),
        opacities: (0..count).map(|i| 0.5 + 0.45 * number(2 * i)).collect(),
        degree: 1,
        harmonics: (0..12 * count).map(|i| 0.4 * number(i + 1)).collect(),
        ..GaussianParts::default()
    }
}

fn scene(parts: GaussianParts, rule: SplatRule) -> Scene {
    let transfer = TransferFunction::from_rows(&[[0.0; 5]]).unwrap();
    Scene::new(Gaussians::new(parts).unwrap().0, transfer).with_rule(rule)
}

fn drawn(scene: &Scene, view: &View) -> Vec<[f64; 4]> {
    render(scene, view, &ReferenceOptions::default(), None).unwrap().pixels().to_vec()
}

/// All pixels' centres.
fn places(view: &View) -> Vec<DVec2> {
    let [width, height] = view.extent();
    (0..width * height).map(|i| DVec2::new(f64::from(i % width), f64::from(i / width)) + 0.5).collect()
}

fn assert_close(got: &[[f64; 4]], want: &[[f64; 4]], bound: f64, what: &str) {
    let mut shown = false;
    for (i, (got, want)) in got.iter().zip(want).enumerate() {
        let error = got.iter().zip(want).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error <= bound, "{what}, pixel {i}: {got:?} is not {want:?}");
        shown |= want[3] > 0.1;
    }
    assert!(shown, "{what}: empty");
}

fn colour(splats: &Gaussians, i: usize, view: &View) -> DVec3 {
    let d = if view.is_perspective() {
        (splats.centre(i) - view.camera().eye).normalize()
    } else {
        view.forward()
    };
    let c1 = (3.0 / (4.0 * std::f64::consts::PI)).sqrt();
    let basis = [0.5 / std::f64::consts::PI.sqrt(), -c1 * d.y, c1 * d.z, -c1 * d.x];
    let k = |n: usize, channel: usize| f64::from(splats.harmonics()[12 * i + 3 * n + channel]);
    let sum = |channel: usize| 0.5 + (0..4).map(|n| basis[n] * k(n, channel)).sum::<f64>();
    DVec3::new(sum(0), sum(1), sum(2)).max(DVec3::ZERO)
}

/// The ellipse of a splat by differences of projected places: where it is, and its covariance.
fn ellipse(splats: &Gaussians, i: usize, view: &View) -> (DVec2, DMat2, f64) {
    let (centre, step) = (splats.centre(i), 1e-5);
    let (place, depth) = view.project(centre).unwrap();
    let along = |axis: DVec3| {
        let at = |sign: f64| view.project(centre + sign * step * axis).unwrap().0;
        (at(1.0) - at(-1.0)) / (2.0 * step)
    };
    let (x, y, z) = (along(DVec3::X), along(DVec3::Y), along(DVec3::Z));
    let rows = [DVec3::new(x.x, y.x, z.x), DVec3::new(x.y, y.y, z.y)];
    let covariance = splats.covariance(i);
    let entry = |a: usize, b: usize| rows[a].dot(covariance * rows[b]);
    (place, DMat2::from_cols_array(&[entry(0, 0), entry(0, 1), entry(0, 1), entry(1, 1)]), depth)
}

/// Blends front to back what `alpha` makes of each splat.
fn blend(sorted: &[(f64, usize)], alpha: impl Fn(usize) -> Option<f64>, colours: &[DVec3]) -> [f64; 4] {
    let (mut sum, mut transmittance) = (DVec3::ZERO, 1.0);
    for &(_, i) in sorted {
        let Some(alpha) = alpha(i) else { continue };
        sum += transmittance * alpha * colours[i];
        transmittance *= 1.0 - alpha;
    }
    [sum.x, sum.y, sum.z, 1.0 - transmittance]
}

#[test]
fn rules_of_the_image_are_those_of_projected_places() {
    for projection in [PERSPECTIVE, ORTHOGRAPHIC] {
        let view = view(projection);
        for rule in [SplatRule::Khr, SplatRule::Inria, SplatRule::Antialiased] {
            let scene = scene(splats(9), rule);
            let splats = scene.gaussians().unwrap();
            let colours: Vec<DVec3> = (0..9).map(|i| colour(splats, i, &view)).collect();
            let ellipses: Vec<_> = (0..9).map(|i| ellipse(splats, i, &view)).collect();
            let khr = rule == SplatRule::Khr;
            let key = |i: usize| {
                let far = splats.centre(i).distance(view.camera().eye);
                if khr && view.is_perspective() { far } else { ellipses[i].2 }
            };
            let mut sorted: Vec<(f64, usize)> = (0..9).map(|i| (key(i), i)).collect();
            sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
            let want: Vec<[f64; 4]> = places(&view)
                .into_iter()
                .map(|place| {
                    let alpha = |i: usize| {
                        let (middle, bare, _) = ellipses[i];
                        let filter = if khr { 0.0 } else { 0.3_f32.into() };
                        let widened = bare + DMat2::from_diagonal(DVec2::splat(filter));
                        let d = place - middle;
                        let square = d.dot(widened.inverse() * d);
                        let mut opacity = f64::from(splats.opacities()[i]);
                        if rule == SplatRule::Antialiased {
                            opacity *= (bare.determinant() / widened.determinant()).sqrt();
                        }
                        let alpha = opacity * (-0.5 * square).exp();
                        let shows = if khr { square <= 9.0 } else { alpha >= f64::from(1.0_f32 / 255.0) };
                        shows.then_some(if khr { alpha } else { alpha.min(0.99_f32.into()) })
                    };
                    blend(&sorted, alpha, &colours)
                })
                .collect();
            assert_close(&drawn(&scene, &view), &want, 1e-8, &format!("{rule:?}, {projection:?}"));
        }
    }
}

/// Samples along a ray, in steps that are short against every splat: the place, and each splat's Gaussian there.
fn sampled(splats: &Gaussians, origin: DVec3, direction: DVec3, from: f64) -> Vec<(f64, Vec<f64>)> {
    const STEP: f64 = 1e-3;
    let inverses: Vec<_> = (0..splats.len()).map(|i| splats.covariance(i).inverse()).collect();
    let at = |t: f64| {
        let gaussian = |i: usize| {
            let d = origin + t * direction - splats.centre(i);
            (-0.5 * d.dot(inverses[i] * d)).exp()
        };
        (t, (0..splats.len()).map(gaussian).collect())
    };
    (0..20_000).map(|k| at(from + (f64::from(k) + 0.5) * STEP)).collect()
}

#[test]
fn rules_of_rays_are_those_of_samples_along_them() {
    for projection in [PERSPECTIVE, ORTHOGRAPHIC] {
        let view = view(projection);
        let count = 6;
        let (width, begin) = (view.extent()[0], if view.is_perspective() { 0.0 } else { -10.0 });
        let some: Vec<[u32; 2]> = (0..24).map(|i| [8 + i, (i * 5) % 24 + 4]).collect();
        assert!(some.iter().all(|[x, _]| *x < width));
        for rule in [SplatRule::Ray, SplatRule::Overlap, SplatRule::Integral] {
            let scene = scene(splats(count), rule);
            let splats = scene.gaussians().unwrap();
            let colours: Vec<DVec3> = (0..count).map(|i| colour(splats, i, &view)).collect();
            let want: Vec<[f64; 4]> = some
                .iter()
                .map(|&[x, y]| {
                    let (origin, direction) = view.ray(DVec2::new(x.into(), y.into()) + 0.5);
                    let samples = sampled(splats, origin, direction, begin);
                    let peaks: Vec<(f64, f64)> = (0..count)
                        .map(|i| {
                            let best = samples.iter().max_by(|a, b| a.1[i].total_cmp(&b.1[i])).unwrap();
                            (best.0, best.1[i])
                        })
                        .collect();
                    let shows = |i: usize| peaks[i].1 >= (-4.5_f64).exp();
                    let opacity = |i: usize| f64::from(splats.opacities()[i]);
                    if rule == SplatRule::Ray {
                        let mut sorted: Vec<(f64, usize)> = (0..count).map(|i| (peaks[i].0, i)).collect();
                        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
                        return blend(&sorted, |i| shows(i).then(|| opacity(i) * peaks[i].1), &colours);
                    }
                    // The optical depth of each splat is spread as its own samples are.
                    let depth = |i: usize| match rule {
                        SplatRule::Overlap => -(1.0 - opacity(i) * peaks[i].1).ln(),
                        _ => -(1.0 - opacity(i)).ln() * peaks[i].1,
                    };
                    let sums: Vec<f64> =
                        (0..count).map(|i| samples.iter().map(|(_, at)| at[i]).sum()).collect();
                    let (mut sum, mut behind) = (DVec3::ZERO, 1.0);
                    for (_, at) in &samples {
                        let parts = (0..count)
                            .filter(|&i| shows(i))
                            .map(|i| (i, depth(i) * at[i] / sums[i]))
                            .filter(|(_, part)| *part > 0.0);
                        let (mut total, mut mean) = (0.0, DVec3::ZERO);
                        for (i, part) in parts {
                            total += part;
                            mean += part * colours[i];
                        }
                        if total > 0.0 {
                            sum += behind * -(-total).exp_m1() * mean / total;
                            behind *= (-total).exp();
                        }
                    }
                    [sum.x, sum.y, sum.z, 1.0 - behind]
                })
                .collect();
            let got = pixels(&scene, &view, &some).unwrap();
            assert_close(&got, &want, 2e-5, &format!("{rule:?}, {projection:?}"));
            let whole = drawn(&scene, &view);
            let begin = if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY };
            let alone = |&[x, y]: &[u32; 2]| {
                let (origin, direction) = view.ray(DVec2::new(x.into(), y.into()) + 0.5);
                ray(&scene, origin, direction, [begin, f64::INFINITY]).unwrap()
            };
            assert_close(&some.iter().map(alone).collect::<Vec<_>>(), &got, 1e-12, "alone");
            for (&[x, y], got) in some.iter().zip(&got) {
                assert_eq!(whole[num::index(y * width + x)], *got);
            }
        }
    }
}

/// One splat alone has the same image by rays and as extinction that overlaps; seen small, also by its ellipse.
#[test]
fn one_splat_has_one_image() {
    let view = view(PERSPECTIVE);
    let mut parts = GaussianParts { opacities: vec![0.8], ..splats(1) };
    parts.centres[0] = [0.1, 0.2, 0.3];
    let of = |rule| drawn(&scene(parts.clone(), rule), &view);
    assert_close(&of(SplatRule::Overlap), &of(SplatRule::Ray), 1e-9, "overlap");
    parts.log_scales[0] = [-3.0, -3.5, -2.8];
    let of = |rule| drawn(&scene(parts.clone(), rule), &view);
    assert_close(&of(SplatRule::Khr), &of(SplatRule::Ray), 6e-3, "khr");
}

#[test]
fn thresholds_are_those_of_the_first_program() {
    let view = view(PERSPECTIVE);
    let towards = |k: f32| {
        let eye = view.camera().eye;
        (eye + view.ray(DVec2::new(20.5, 16.5)).1 * f64::from(k)).to_array().map(num::f32_of)
    };
    // Opaque splats in a row, with the dc of red, green and blue.
    let row = |opacity: f32, count: usize| GaussianParts {
        centres: (0..count).map(|i| towards(3.0 + num::f32_of(num::f64_of(i)))).collect(),
        rotations: vec![[1.0, 0.0, 0.0, 0.0]; count],
        log_scales: vec![[-1.0; 3]; count],
        opacities: vec![opacity; count],
        degree: 0,
        harmonics: (0..3 * count).map(|i| if i % 4 == 0 { 1.0 } else { -1.0 }).collect(),
        ..GaussianParts::default()
    };
    let at = |parts: GaussianParts, rule| pixels(&scene(parts, rule), &view, &[[20, 16]]).unwrap()[0];
    // Capped at 0.99; the second would leave 9.99998e-5 and is not drawn.
    let pixel = at(row(1.0, 3), SplatRule::Inria);
    assert_eq!(pixel[3], f64::from(0.99_f32));
    assert!(at(row(1.0, 1), SplatRule::Khr)[3] > 1.0 - 1e-6);
    // A fourth would leave 0.09^4, less than 1e-4.
    assert!((at(row(0.91, 9), SplatRule::Inria)[3] - (1.0 - 0.09_f64.powi(3))).abs() < 1e-6);
    assert!(at(row(0.9, 9), SplatRule::Khr)[3] > 0.99999);
    // Fainter than 1/255.
    assert_eq!(at(row(0.0038, 1), SplatRule::Inria), [0.0; 4]);
    assert!(at(row(0.0041, 1), SplatRule::Inria)[3] > 0.0039);
    // Nearer than 0.2.
    let mut near = row(0.9, 1);
    near.centres[0] = towards(0.15);
    assert_eq!(at(near.clone(), SplatRule::Khr), [0.0; 4]);
    assert!(at(near, SplatRule::Ray)[3] > 0.5);
}

/// What lies behind an opaque surface or a clip plane is not drawn, where splats have depths.
#[test]
fn surfaces_and_planes_cut_splats_with_depths() {
    let view = view(PERSPECTIVE);
    let wall = |z: f64| {
        let corners = [[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]];
        let corners = corners.map(|[x, y]| DVec3::new(x, y, z)).to_vec();
        Surface::new(corners, vec![[0, 1, 2], [0, 2, 3]], [0.0, 0.0, 0.0, 1.0]).unwrap()
    };
    for rule in [SplatRule::Ray, SplatRule::Overlap, SplatRule::Integral] {
        let open = scene(splats(5), rule);
        let cut = open.clone().with_surfaces(vec![wall(0.0)]);
        let clip = Clip::none().with_plane(DVec3::ZERO, DVec3::NEG_Z).unwrap();
        let clipped = drawn(&open, &view.with_clip(clip));
        let drawn_cut = drawn(&cut, &view);
        let mut differs = false;
        for ((cut, clipped), open) in drawn_cut.iter().zip(&clipped).zip(drawn(&open, &view)) {
            assert!((cut[0] - clipped[0]).abs() < 1e-9 && cut[3] == 1.0, "{rule:?}: {cut:?} {clipped:?}");
            differs |= (clipped[3] - open[3]).abs() > 0.05;
        }
        assert!(differs);
    }
    let khr = scene(splats(2), SplatRule::Khr);
    let why = |scene: &Scene, view: &View| {
        render(scene, view, &ReferenceOptions::default(), None).unwrap_err().to_string()
    };
    assert!(why(&khr.clone().with_surfaces(vec![wall(0.0)]), &view).contains("ray, overlap, integral have"));
    let clip = Clip::none().with_plane(DVec3::ZERO, DVec3::Z).unwrap();
    assert!(why(&khr, &view.with_clip(clip)).contains("clip regions"));
    assert!(ray(&khr, DVec3::ZERO, DVec3::Z, [0.0, 1.0]).is_err());
}

/// Flat splats, splats at and behind the eye, and huge ones give finite images.
#[test]
fn extremes_are_finite() {
    for projection in [PERSPECTIVE, ORTHOGRAPHIC] {
        let view = view(projection);
        let eye = view.camera().eye.to_array().map(num::f32_of);
        for rule in SplatRule::ALL.map(|(_, rule)| rule) {
            let mut parts = splats(8);
            parts.log_scales[0][1] = f32::NEG_INFINITY;
            parts.log_scales[1] = [f32::NEG_INFINITY; 3];
            parts.log_scales[2] = [20.0, 20.0, 20.0];
            parts.log_scales[3] = [-20.0, 3.0, -20.0];
            parts.centres[4] = eye;
            parts.centres[5] = [1.0, -0.7, -9.0];
            parts.opacities[6] = 1.0;
            parts.centres[7] = [1e30, 0.0, 0.0];
            for pixel in drawn(&scene(parts, rule), &view) {
                assert!(pixel.iter().all(|x| x.is_finite()) && pixel[3] <= 1.0, "{rule:?}: {pixel:?}");
            }
        }
    }
}
