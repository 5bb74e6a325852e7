//! Clipped views and surfaces: closed forms in grids, meshes and kernels, rays through edges and corners, the
//! tree against brute force.

use super::*;
use crate::scene::{Clip, KernelSize, Kernels, Model, Points, Shading, Surface};

const COLOUR: [f64; 3] = [0.8, 0.4, 0.1];
const RED: [f64; 4] = [0.9, 0.2, 0.1, 1.0];
const GLASS: [f64; 4] = [0.1, 0.5, 0.8, 0.25];

const PROJECTIONS: [Projection; 2] =
    [Projection::Perspective { fov_y_deg: 70.0 }, Projection::Orthographic { half_height: 1.6 }];

fn over(front: [f64; 4], back: [f64; 4]) -> [f64; 4] {
    std::array::from_fn(|i| front[i] + (1.0 - front[3]) * back[i])
}

fn premultiplied([r, g, b, a]: [f64; 4]) -> [f64; 4] {
    [r * a, g * a, b * a, a]
}

/// The box [-1, 1]³ with one extinction, as a grid and as tetrahedra.
fn boxes(tau: f64) -> [Scene; 2] {
    let [r, g, b] = COLOUR;
    let transfer = TransferFunction::from_rows(&[[0.0, r, g, b, tau]]).unwrap();
    [
        Scene::new(Field::Homogeneous(1.0).sample([9, 6, 4], "u8").unwrap(), transfer.clone()),
        Scene::new(Field::Homogeneous(1.0).tets(3).unwrap(), transfer),
    ]
}

fn view(eye: DVec3, projection: Projection) -> View {
    let camera = Camera { eye, target: DVec3::new(0.05, 0.02, -0.03), up: DVec3::Y, projection };
    View::new(camera, 23, 17).unwrap()
}

/// Outside, inside, and on the box's face.
const EYES: [DVec3; 3] = [DVec3::new(2.0, 1.5, 3.8), DVec3::new(0.3, -0.2, 0.6), DVec3::new(0.0, 0.0, 1.0)];

/// The part of a ray in [low, high] by the slab method; perspective rays begin at the eye; empty when begin
/// >= end.
fn within(low: DVec3, high: DVec3, o: DVec3, d: DVec3, from: f64) -> [f64; 2] {
    let (a, b) = ((low - o) / d, (high - o) / d);
    [a.min(b).max_element().max(from), a.max(b).min_element()]
}

fn length([begin, end]: [f64; 2]) -> f64 {
    (end - begin).max(0.0)
}

/// Two triangles that fill a square far beyond the image at z.
fn wall(z: f64, colour: [f64; 4]) -> Surface {
    let points = [(-50.0, -40.0), (60.0, -30.0), (40.0, 70.0), (-30.0, 55.0)];
    let points = points.map(|(x, y)| DVec3::new(x, y, z)).to_vec();
    Surface::new(points, vec![[0, 1, 2], [3, 0, 2]], colour).unwrap()
}

/// Calls a test for every pixel with its ray, for perspective and parallel rays from outside and inside.
fn for_pixels(
    scenes: &[Scene],
    clip: Clip,
    mut check: impl FnMut(&Scene, &View, (DVec3, DVec3, f64), [f64; 4]),
) {
    for scene in scenes {
        for projection in PROJECTIONS {
            for eye in EYES {
                let view = view(eye, projection).with_clip(clip);
                let image = render(scene, &view, &ReferenceOptions::default(), None).unwrap();
                for y in 0..17 {
                    for x in 0..23 {
                        let (o, d) = view.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5));
                        check(scene, &view, (o, d, view_range(&view)[0]), image.pixel(x, y));
                    }
                }
            }
        }
    }
}

// ---- clipping ----------------------------------------------------------------------------------------

#[test]
fn a_cut_box_is_the_closed_form_of_what_is_left() {
    let tau = 1.7;
    let (low, high) = (DVec3::new(-0.6, -0.9, f64::NEG_INFINITY), DVec3::new(0.7, f64::INFINITY, 0.4));
    let (point, normal) = (DVec3::new(0.1, 0.2, 0.1), DVec3::new(2.0, -1.0, 0.5));
    let crop = Clip::none().with_crop(low, high).unwrap();
    let both = crop.with_plane(point, normal).unwrap();
    for (clip, plane) in [(crop, false), (both, true)] {
        let mut partly = 0;
        for_pixels(&boxes(tau), clip, |_, _, (o, d, from), got| {
            let [mut t0, mut t1] = within(low.max(DVec3::NEG_ONE), high.min(DVec3::ONE), o, d, from);
            let whole = length(within(DVec3::NEG_ONE, DVec3::ONE, o, d, from));
            if plane {
                let (height, rise) = ((o - point).dot(normal), d.dot(normal));
                if rise > 0.0 {
                    t0 = t0.max(-height / rise);
                } else {
                    t1 = t1.min(-height / rise);
                }
            }
            let left = length([t0, t1]);
            partly += u32::from(left > 0.05 && left < whole - 0.05);
            same(got, uniform(COLOUR, tau * left), 1e-13);
        });
        assert!(partly > 1000, "{partly} rays are cut");
    }
}

#[test]
fn a_plane_through_a_kernel_s_centre_halves_its_depth() {
    let [r, g, b] = COLOUR;
    let transfer = TransferFunction::from_rows(&[[0.0, r, g, b, 1.0]]).unwrap();
    let centre = DVec3::new(0.05, 0.02, -0.03);
    let points = Points::new(vec![centre]).unwrap().with_size(KernelSize::Radius(0.9)).unwrap();
    for model in [Model::Density, Model::Interpolate] {
        let kernels = Kernels { model, ..Kernels::of_points() };
        let scene = Scene::new(points.clone(), transfer.clone()).with_kernels(kernels).unwrap();
        let forward = view(EYES[0], PROJECTIONS[1]).forward();
        for (normal, share) in [(forward, 0.5), (-forward, 0.5), (DVec3::X, 1.0), (DVec3::NEG_X, 0.0)] {
            let at = if share == 0.5 { centre } else { centre - DVec3::X * 3.0 };
            let clip = Clip::none().with_plane(at, normal).unwrap();
            let plain = view(EYES[0], PROJECTIONS[1]);
            let clipped = plain.with_clip(clip);
            let draw = |view| render(&scene, view, &ReferenceOptions::default(), None).unwrap();
            let mut shown = 0;
            for (whole, cut) in draw(&plain).pixels().iter().zip(draw(&clipped).pixels()) {
                let depth = -(-whole[3]).ln_1p();
                shown += u32::from(depth > 0.1);
                same(*cut, uniform(COLOUR, share * depth), 1e-9);
            }
            assert!(shown > 15, "{shown}");
        }
    }
}

#[test]
fn clips_cut_no_surface() {
    let clip = Clip::none().with_plane(DVec3::ZERO, DVec3::Z).unwrap();
    for_pixels(
        &boxes(2.0).map(|s| s.with_surfaces(vec![wall(-3.0, RED)])),
        clip,
        |_, view, (o, d, from), got| {
            let [t0, t1] = within(DVec3::NEG_ONE.with_z(0.0), DVec3::ONE, o, d, from);
            let t = (-3.0 - o.z) / d.z;
            let seen = t > from && view.project(o + d * t).is_some_and(|(_, depth)| depth.is_finite());
            let volume = uniform(COLOUR, 2.0 * length([t0, t1]));
            same(got, if seen { over(volume, RED) } else { volume }, 1e-13);
        },
    );
}

// ---- surfaces in closed form -------------------------------------------------------------------------

#[test]
fn walls_part_the_volume_where_they_stand() {
    let tau = 1.3;
    for (colour, other) in [(RED, GLASS), (GLASS, RED), (GLASS, [0.3, 0.9, 0.2, 0.6])] {
        let (first, second) = (0.35, -0.4);
        let walls = vec![wall(first, colour), wall(second, other)];
        let mut hidden = 0;
        let scenes = boxes(tau).map(|scene| scene.with_surfaces(walls.clone()));
        for_pixels(&scenes, Clip::none(), |_, _, (o, d, from), got| {
            let [t0, t1] = within(DVec3::NEG_ONE, DVec3::ONE, o, d, from);
            let mut hits = [(first, colour), (second, other)].map(|(z, colour)| ((z - o.z) / d.z, colour));
            hits.sort_by(|a, b| a.0.total_cmp(&b.0));
            let part = |a: f64, b: f64| uniform(COLOUR, tau * length([a.max(t0), b.min(t1)]));
            let (mut want, mut here) = ([0.0; 4], from);
            for (t, colour) in hits.into_iter().filter(|(t, _)| *t > from) {
                want = over(over(want, part(here, t)), premultiplied(colour));
                here = t;
            }
            want = over(want, part(here, f64::INFINITY));
            same(got, want, 1e-13);
            hidden += u32::from(got[3] == 1.0);
        });
        let opaque = colour[3] == 1.0 || other[3] == 1.0;
        assert!(if opaque { hidden > 2000 } else { hidden == 0 }, "{hidden} pixels are opaque");
    }
}

/// Surfaces behind the eye are visible along parallel rays only.
#[test]
fn surfaces_begin_at_the_eye_in_perspective_only() {
    let scene = &boxes(0.0)[0].clone().with_surfaces(vec![wall(9.0, RED)]);
    for (projection, want) in PROJECTIONS.into_iter().zip([[0.0; 4], RED]) {
        let view = view(EYES[0], projection);
        let image = render(scene, &view, &ReferenceOptions::default(), None).unwrap();
        assert!(image.pixels().iter().all(|pixel| *pixel == want), "{projection:?}");
    }
    // The range of a ray excludes its beginning and includes its end.
    let at = |range| ray(scene, DVec3::ZERO, DVec3::Z, range).unwrap();
    assert_eq!(at([0.0, 9.0]), RED);
    assert_eq!(at([9.0, 99.0]), [0.0; 4]);
    assert_eq!(at([0.0, 8.999]), [0.0; 4]);
}

#[test]
fn surfaces_at_one_place_are_in_the_scene_s_order() {
    let turned = |surface: &Surface| {
        let triangles = surface.triangles().iter().map(|&[a, b, c]| [c, a, b]).collect();
        Surface::new(surface.points().to_vec(), triangles, [0.0, 1.0, 0.0, 0.5]).unwrap()
    };
    let (first, second) = (wall(0.3, GLASS), turned(&wall(0.3, GLASS)));
    let draw = |surfaces: Vec<Surface>| {
        let scene = boxes(0.0)[0].clone().with_surfaces(surfaces);
        render(&scene, &view(EYES[0], PROJECTIONS[0]), &ReferenceOptions::default(), None).unwrap()
    };
    let (a, b) = (premultiplied(GLASS), premultiplied([0.0, 1.0, 0.0, 0.5]));
    let mut seen = 0;
    for pixel in draw(vec![first.clone(), second.clone()]).pixels() {
        seen += u32::from(pixel[3] > 0.0);
        assert!(*pixel == [0.0; 4] || difference(*pixel, over(a, b)) < 1e-15, "{pixel:?}");
    }
    assert!(seen > 200, "{seen}");
    for pixel in draw(vec![second, first]).pixels() {
        assert!(*pixel == [0.0; 4] || difference(*pixel, over(b, a)) < 1e-15, "{pixel:?}");
    }
    // Of two opaque surfaces the first is visible.
    for pixel in draw(vec![wall(0.3, RED), wall(0.3, [0.0, 1.0, 0.0, 1.0])]).pixels() {
        assert!(*pixel == [0.0; 4] || *pixel == RED, "{pixel:?}");
    }
}

#[test]
fn headlights_shade_by_the_cosine_from_both_sides() {
    for extent in [1e-160, 1e-3, 1.0, 1e150] {
        let corners = [(0.0, 0.0, 0.0), (3.0, 0.0, 0.2), (0.0, 2.0, -0.3)].map(|c| DVec3::from(c) * extent);
        let normal = DVec3::new(-0.2 / 3.0, 0.15, 1.0).normalize();
        let colour = [0.5, 1.0, 2.0, 0.7];
        for triangle in [[0, 1, 2], [0, 2, 1]] {
            let surface = Surface::new(corners.to_vec(), vec![triangle], colour)
                .unwrap()
                .with_shading(Shading::Headlight);
            let scene = boxes(0.0)[0].clone().with_surfaces(vec![surface]);
            let centre = (corners[0] + corners[1] + corners[2]) / 3.0;
            for d in [DVec3::Z, DVec3::NEG_Z, DVec3::new(0.6, -0.3, 0.7), normal] {
                let d = d.normalize();
                let shade = d.dot(normal).abs();
                let want = premultiplied([0.5 * shade, shade, 2.0 * shade, 0.7]);
                same(everywhere(&scene, centre - d * (5.0 * extent), d), want, 1e-14);
            }
        }
    }
}

// ---- edges and corners -------------------------------------------------------------------------------

/// Every hit of a surface of opacity 1/2 halves the transmittance, so its logarithm counts the hits.
fn hits(scene: &Scene, o: DVec3, d: DVec3) -> f64 {
    -(1.0 - everywhere(scene, o, d)[3]).log2()
}

#[test]
fn a_ray_through_an_edge_or_a_corner_meets_one_triangle() {
    let mut random = Random(3);
    // A bumpy, rotated square of 6 x 6 cells with diagonals in both directions; neighbours have coincident
    // corners of their own.
    for turn in [DMat3::IDENTITY, DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -1.1, 2.0))] {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        let mut heights = [[0.0; 7]; 7];
        heights.iter_mut().flatten().for_each(|h| *h = 0.3 * random.next());
        let at = |i: usize, j: usize| turn * DVec3::new(num::f64_of(i), num::f64_of(j), heights[i][j]);
        for i in 0..6 {
            for j in 0..6 {
                let first = num::count(points.len());
                points.extend([at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                let quads = if (i + j) % 2 == 0 { [[0, 1, 2], [0, 2, 3]] } else { [[3, 0, 1], [1, 3, 2]] };
                triangles.extend(quads.map(|triangle| triangle.map(|k| first + k)));
            }
        }
        let surface = Surface::new(points.clone(), triangles, [0.0, 0.0, 0.0, 0.5]).unwrap();
        let scene = boxes(0.0)[0].clone().with_surfaces(vec![surface]);
        for i in 1..6 {
            for j in 1..6 {
                let p = at(i, j);
                let neighbours = [at(i + 1, j), at(i, j + 1), at(i + 1, j + 1), at(i - 1, j + 1)];
                for target in neighbours.map(|q| 0.5 * (p + q)).into_iter().chain([p]) {
                    for d in
                        [DVec3::Z, DVec3::NEG_Z, DVec3::new(0.25, -0.125, 1.0), DVec3::new(0.1, 0.2, -0.9)]
                    {
                        let d = turn * d;
                        let met = hits(&scene, target - d * 8.0, d);
                        assert!((met - 1.0).abs() < 1e-12, "{met} hits at {target} along {d}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_closed_surface_is_entered_as_often_as_it_is_left() {
    let half = [0.0, 0.0, 0.0, 0.5];
    let ball = Surface::sphere(DVec3::new(0.25, 0.0, -0.5), 1.25, half, 2).unwrap();
    let brick = Surface::cuboid(DVec3::new(-1.0, -0.5, -0.25), DVec3::new(1.0, 0.5, 0.75), half).unwrap();
    for surface in [ball, brick] {
        let points = surface.points().to_vec();
        let scene = boxes(0.0)[0].clone().with_surfaces(vec![surface]);
        let mut met = [0; 4];
        for (i, &a) in points.iter().enumerate() {
            for &b in points[..i].iter().step_by(3) {
                // Through corners, along edges, in faces, and past them.
                for d in [b - a, DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 1.0, 0.0)] {
                    let count = hits(&scene, a - d * 4.0, d);
                    let whole = count.round();
                    assert!(
                        (count - whole).abs() < 1e-12 && whole % 2.0 == 0.0,
                        "{count} hits: {a} along {d}"
                    );
                    met[num::usize_of(whole).min(3)] += 1;
                }
            }
        }
        assert!(met[0] > 10 && met[2] > 10, "{met:?}");
    }
}

// ---- the tree ----------------------------------------------------------------------------------------

#[test]
fn the_tree_misses_no_triangle() {
    let mut random = Random(29);
    for scale in [1e-6, 1.0, 1e9] {
        let mut surfaces = Vec::new();
        for (count, size, opacity) in [(400, 0.05, 0.1), (60, 1.0, 0.02), (3, 30.0, 0.3), (40, 0.3, 1.0)] {
            let (mut points, mut triangles) = (Vec::new(), Vec::new());
            for _ in 0..count {
                let centre = random.in_box(DVec3::splat(-2.0), DVec3::splat(2.0)) * scale;
                let first = num::count(points.len());
                let half = DVec3::splat(size * scale);
                points.extend((0..3).map(|_| centre + random.in_box(-half, half)));
                triangles.push([first, first + 1, first + 2]);
            }
            let colour = [random.next(), random.next(), random.next(), opacity];
            surfaces.push(Surface::new(points, triangles, colour).unwrap());
        }
        let tree = SurfaceRays::new(&surfaces, |_| true).unwrap();
        let all = SurfaceRays::with_leaves(&surfaces, |_| true, usize::MAX).unwrap();
        let (mut some, mut opaque) = (0, 0);
        for i in 0..3000 {
            let far = if i % 3 == 0 { 1e5 } else { 4.0 };
            let (o, through) = (
                random.in_box(DVec3::splat(-far), DVec3::splat(far)) * scale,
                random.in_box(DVec3::splat(-2.0), DVec3::splat(2.0)) * scale,
            );
            let d = match i % 4 {
                0 => DVec3::AXES[i % 3],
                _ => (through - o).normalize(),
            };
            let o = if i % 4 == 0 { through - d * far * scale } else { o };
            for range in
                [[f64::NEG_INFINITY, f64::INFINITY], [0.0, f64::INFINITY], [far * scale, 1.2 * far * scale]]
            {
                let flat = |rays: &SurfaceRays| -> Vec<_> {
                    rays.hits(o, d, range).iter().map(|hit| (hit.t, hit.colour, hit.opaque)).collect()
                };
                let (got, want) = (flat(&tree), flat(&all));
                assert_eq!(got, want, "{o} along {d}");
                assert!(want.windows(2).all(|pair| pair[0].0 <= pair[1].0 && !pair[0].2));
                assert!(want.iter().all(|hit| hit.0 >= range[0] && hit.0 <= range[1] * (1.0 + 1e-15)));
                some += usize::from(want.len() > 3);
                opaque += usize::from(want.last().is_some_and(|hit| hit.2));
            }
        }
        assert!(some > 150 && opaque > 200, "{some}, {opaque}");
    }
}

#[test]
fn images_pixels_and_rays_agree_and_what_is_not_met_changes_nothing() {
    let transfer = TransferFunction::from_rows(&SHELLS).unwrap();
    let grid = Scene::new(Field::Blobs.sample([12; 3], "f32").unwrap(), transfer.clone());
    let mesh = Scene::new(Field::Blobs.tets(4).unwrap(), transfer.clone());
    let kernels = grid.clone().with_kernels(Kernels::of_samples()).unwrap();
    let ball =
        Surface::sphere(DVec3::new(0.3, 0.1, 0.2), 0.5, GLASS, 2).unwrap().with_shading(Shading::Headlight);
    let brick = Surface::cuboid(DVec3::splat(-0.7), DVec3::new(-0.2, 0.1, 0.0), RED).unwrap();
    let beside = Surface::cuboid(DVec3::splat(100.0), DVec3::splat(101.0), RED).unwrap();
    let clip = Clip::none().with_plane(DVec3::splat(0.2), DVec3::new(-1.0, 0.3, -0.2)).unwrap();
    for (i, scene) in [grid, mesh, kernels].into_iter().enumerate() {
        let full = scene.clone().with_surfaces(vec![ball.clone(), brick.clone()]);
        let bare = Scene { transfer: TransferFunction::from_rows(&[[0.0; 5]]).unwrap(), ..full.clone() };
        let projections =
            [Projection::Perspective { fov_y_deg: 24.0 }, Projection::Orthographic { half_height: 0.9 }];
        for (j, projection) in projections.into_iter().enumerate() {
            if !crate::exhaustive() && i % 2 != j {
                continue;
            }
            let view = view(EYES[0], projection).with_clip(clip);
            let draw =
                |scene: &Scene, samples| render(scene, &view, &ReferenceOptions { samples }, None).unwrap();
            let image = draw(&full, 1);
            let all: Vec<[u32; 2]> = (0..17).flat_map(|y| (0..23).map(move |x| [x, y])).collect();
            assert_eq!(pixels(&full, &view, &all).unwrap(), image.pixels());
            let mut kinds = [0; 3];
            for (&[x, y], pixel) in all.iter().zip(image.pixels()) {
                let (o, d) = view.ray(DVec2::new(f64::from(x), f64::from(y)) + 0.5);
                let range = view_range(&view);
                let [k0, k1] = clip.range(o, d, range);
                // In front of, inside and behind the clip region; outside it only surfaces are left.
                let part = |scene: &Scene, a: f64, b: f64| {
                    if a < b { ray(scene, o, d, [a, b]).unwrap() } else { [0.0; 4] }
                };
                let want = if k0 < k1 {
                    over(part(&bare, range[0], k0), over(part(&full, k0, k1), part(&bare, k1, range[1])))
                } else {
                    part(&bare, range[0], range[1])
                };
                same(*pixel, want, 1e-9);
                kinds[usize::from(want[3] > 0.0) + usize::from(want[3] == 1.0)] += 1;
            }
            assert!(kinds.iter().all(|&count| count > 5), "{kinds:?}");
            // Bit for bit.
            for samples in [1, 2] {
                assert_eq!(
                    draw(&scene, samples),
                    draw(&scene.clone().with_surfaces(vec![beside.clone()]), samples)
                );
            }
        }
    }
}

// ---- depths ------------------------------------------------------------------------------------------

#[test]
fn depths_are_those_of_the_nearest_opaque_surface() {
    let walls = vec![wall(-2.0, RED), wall(0.5, GLASS), wall(0.2, RED), wall(9.0, RED)];
    let scene = boxes(50.0)[0].clone().with_surfaces(walls);
    for projection in PROJECTIONS {
        for eye in EYES {
            // The clip region does not affect surfaces.
            let clip = Clip::none().with_plane(DVec3::ZERO, DVec3::NEG_Z).unwrap();
            let view = view(eye, projection).with_clip(clip);
            let depths = depth(&scene, &view).unwrap();
            for (i, got) in depths.iter().enumerate() {
                let pixel = DVec2::new(num::f64_of(i % 23), num::f64_of(i / 23)) + 0.5;
                let (o, d) = view.ray(pixel);
                let places = [-2.0, 0.2, 9.0].map(|z| (z - o.z) / d.z).into_iter();
                let t = places.filter(|t| *t > view_range(&view)[0]).fold(f64::INFINITY, f64::min);
                let want = if t < f64::INFINITY {
                    (o + d * t - view.camera().eye).dot(view.forward())
                } else {
                    f64::INFINITY
                };
                // To the side, the walls end.
                if t < 30.0 && t > -30.0 {
                    assert!((got - want).abs() < 1e-12 * (1.0 + want.abs()), "{got} instead of {want}");
                }
            }
            assert_eq!(depths.len(), 23 * 17);
        }
    }
    let none =
        depth(&boxes(1.0)[0].clone().with_surfaces(vec![wall(0.0, GLASS)]), &view(EYES[0], PROJECTIONS[0]));
    assert!(none.unwrap().iter().all(|depth| *depth == f64::INFINITY));
}
