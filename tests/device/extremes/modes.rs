//! Lit grids, isosurfaces and maximum intensity projections.

use glam::{DMat3, DVec2, DVec3};
use volraster::scene::{Clip, Field, Grid, Lighting, Mode, Samples, Scene, Surface, TetScalars, View, auto};

use crate::common::*;
use crate::extremes::catalogue::{Case, Family, Run, Spec};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("modes", CASES);

const EXACT: &[(&str, &str)] = &[("step", "0.5"), ("filter", "exact")];

fn with(scene: &Scene, mode: Mode) -> Scene {
    scene.clone().with_mode(mode).unwrap()
}

/// What draws a scene of its mode. A full table does not tell where a segment emits.
fn draws(scene: &Scene) -> impl Fn(&Spec) -> bool + '_ {
    |spec| spec.method.draws_scene(scene) && (spec.integrator != "full" || scene.mode == Mode::Maximum)
}

/// A field without a slope along z, in cells sheared across it. Rays along z stay clear of the faces across x and y, so the gradient is the
/// field's everywhere.
fn sheared(scale: f64, unit: f64) -> Grid {
    let direction = DMat3::from_cols(DVec3::X, DVec3::new(0.6, 0.8, 0.0), DVec3::Z);
    let spacing = DVec3::new(0.25, 0.5, 0.125) * unit;
    let dims = [13, 7, 17];
    let corner = DVec3::new(12.0, 6.0, 16.0) * spacing;
    let low = direction * corner * -0.5;
    let mut values = Vec::new();
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let at = low + direction * (DVec3::new(x.into(), y.into(), z.into()) * spacing);
                values.push((scale * slope().dot(at / unit)) as f32);
            }
        }
    }
    Grid::new(dims, Samples::F32(values)).unwrap().with_placement(spacing, low, direction).unwrap()
}

fn slope() -> DVec3 {
    DVec3::new(0.27, -0.13, 0.0)
}

const LIGHT: Lighting = Lighting {
    ambient: 0.2,
    diffuse: 0.6,
    specular: 0.5,
    shininess: 12.0,
    direction: Some(DVec3::new(1.0, 0.5, 2.0)),
    least_gradient: None,
};

/// Rays along -z, each inside the sheared grid and away from its sides.
fn down(unit: f64) -> View {
    let projection = volraster::scene::Projection::Orthographic { half_height: 0.4 * unit };
    let (eye, target) = (DVec3::new(0.01, 0.02, 5.0) * unit, DVec3::new(0.01, 0.02, 0.0) * unit);
    View::new(volraster::scene::Camera { eye, target, up: DVec3::Y, projection }, 9, 9).unwrap()
}

/// The colour c of every place is c (ka + kd |n.l|) + ks |n.h|^p, the same everywhere: the image is the unlit one, so changed.
///
/// A difference of two samples, of which each rounds to 2^-24 of the largest scalar, is off by 2e-6 of itself where it is 1/13 of that; the
/// highlight by that times p, and pow by 1e-6 p.
fn affine_light(run: &mut Run<'_>, scale: f64, unit: f64) {
    let [red, green, blue] = COLOUR;
    let rows = [[-0.7, 0.2], [0.7, 2.2]].map(|[s, tau]| [s * scale, red, green, blue, tau / unit]);
    let scene = Scene::new(sheared(scale, unit), transfer(&rows));
    for direction in [LIGHT.direction, Some(DVec3::new(-3.0, 1.0, 0.5)), None] {
        let light = Lighting { direction, ..LIGHT };
        let lit = with(&scene, Mode::Lit(light));
        let view = down(unit);
        let (n, v) = (slope().normalize(), DVec3::Z);
        let l = direction.map_or(v, DVec3::normalize);
        let seen = light.ambient + light.diffuse * n.dot(l).abs();
        let white = light.specular * n.dot((l + v).normalize()).abs().powf(light.shininess);
        let truth = truth(&scene, &view);
        let claims = draws(&lit);
        run.only(&claims, &lit, &view, EXACT, |_, frame| {
            let bound = t32(40.0) + 2e-6 + light.shininess * 3e-6;
            for (got, want) in frame.image.pixels().iter().zip(truth.pixels()) {
                near("opacity", got[3].into(), want[3], bound)?;
                for channel in 0..3 {
                    near("colour", got[channel].into(), want[channel] * seen + want[3] * white, bound)?;
                }
            }
            Ok(())
        });
    }
}

/// Drawn by everything that draws it, a lit scene is within `bound` of the reference at every pixel but `odd` of a thousand.
fn near_reference(
    run: &mut Run<'_>,
    scene: &Scene,
    view: &View,
    options: &[(&str, &str)],
    bound: f64,
    odd: usize,
) {
    let truth = truth(scene, view);
    let claims = draws(scene);
    run.only(&claims, scene, view, options, |_, frame| {
        finite(&frame.image)?;
        let off = |(got, want): (&[f32; 4], &[f64; 4])| {
            got.iter().zip(want).map(|(got, want)| (f64::from(*got) - want).abs()).fold(0.0, f64::max)
        };
        let errors: Vec<f64> = frame.image.pixels().iter().zip(truth.pixels()).map(off).collect();
        let wrong = errors.iter().filter(|error| **error > bound).count();
        let worst = errors.iter().copied().fold(0.0, f64::max);
        let most = errors.len() * odd / 1000;
        if wrong <= most {
            Ok(())
        } else {
            Err(format!("{wrong} pixels off by up to {worst:.1e}, not {bound:.1e}"))
        }
    });
}

/// Colour and opacity of the greatest scalar, in one colour of an extinction of [`ENDS`].
fn assert_greatest(
    run: &mut Run<'_>,
    scene: &Scene,
    view: &View,
    options: &[(&str, &str)],
    voxel: f64,
    bound: f64,
    greatest: impl Fn(DVec2) -> Option<f64>,
) {
    let claims = draws(scene);
    run.only(&claims, scene, view, options, |_, frame| {
        for (i, pixel) in pixels(view).filter(|(_, pixel)| !on_outline(view, *pixel)) {
            let tau = greatest(pixel).map_or(0.0, |s| ENDS[0] + (ENDS[1] - ENDS[0]) * s);
            let alpha = opacity(tau * voxel);
            let got = frame.image.pixels()[i].map(f64::from);
            near(&format!("opacity at {pixel}"), got[3], alpha, bound)?;
            for channel in 0..3 {
                near(&format!("colour at {pixel}"), got[channel], COLOUR[channel] * alpha, bound)?;
            }
        }
        Ok(())
    });
}

fn greatest_scene(n: u32, field: impl Fn(DVec3) -> f64) -> Scene {
    let grid = grid([n + 1; 3], DVec3::NEG_ONE, DVec3::ONE, field);
    with(&Scene::new(grid, ramp(ENDS[0], ENDS[1])), Mode::Maximum)
}

/// The greatest scalar of [`affine`] on a ray lies at one end of it.
fn affine_at_ends(view: &View, pixel: DVec2, behind: f64) -> Option<f64> {
    let (origin, direction) = view.ray(pixel);
    let (mut from, mut to) = (if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY }, f64::INFINITY);
    for axis in 0..3 {
        let [a, b] = [-1.0, 1.0].map(|side| (side - origin[axis]) / direction[axis]);
        (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
    }
    to = to.min((behind - origin.z) / direction.z).max(from);
    (to > from).then(|| affine(origin + direction * from).max(affine(origin + direction * to)))
}

const CASES: &[Case] = &[
    Case {
        number: "l1",
        name: "a light on an affine field, in sheared cells of three sizes",
        expect: "the unlit image, its colour changed",
        tolerance: "t32(40) + 2e-6 + 3e-6 shininess",
        run: |run| affine_light(run, 1.0, 1.0),
    },
    Case {
        number: "l2",
        name: "scalars of 1e30 and 1e-30, lit",
        expect: "the same",
        tolerance: "the same",
        run: |run| {
            for scale in [1e30, 1e-30] {
                affine_light(run, scale, 1.0);
            }
        },
    },
    Case {
        number: "l3",
        name: "voxels of 1e-12 and 1e12, lit",
        expect: "the same",
        tolerance: "the same",
        run: |run| {
            for unit in [1e-12, 1e12] {
                affine_light(run, 1.0, unit);
            }
        },
    },
    Case {
        number: "l4",
        name: "a constant field, lit",
        expect: "the unlit image",
        tolerance: "the same bits",
        run: |run| {
            let scene = Scene::new(grid([9; 3], DVec3::NEG_ONE, DVec3::ONE, |_| 0.5), fog(1.0));
            let lit = with(&scene, Mode::Lit(LIGHT));
            let view = view(perspective(), 1.0, 16, 12);
            run.pairs_by(draws(&lit), [&lit, &scene], [&view; 2], [EXACT; 2], |_, a, b| equal("lit", a, b));
        },
    },
    Case {
        number: "l5",
        name: "gradients below the least, lit",
        expect: "the unlit image",
        tolerance: "the same bits",
        run: |run| {
            let scene = Scene::new(sheared(1.0, 1.0), ramp(ENDS[0], ENDS[1]));
            let least_gradient = Some(slope().length() * 1.001);
            let lit = with(&scene, Mode::Lit(Lighting { least_gradient, ..LIGHT }));
            let view = down(1.0);
            run.pairs_by(draws(&lit), [&lit, &scene], [&view; 2], [EXACT; 2], |_, a, b| equal("lit", a, b));
        },
    },
    Case {
        number: "l6",
        name: "NaN beside what is lit",
        expect: "the reference: cells that touch it are vacuum, colours from beside it unlit",
        tolerance: "4e-2: pieces that end in such a cell, of 1/8 of an extinction up to 2.2",
        run: |run| {
            let field = |p: DVec3| if p.length() < 0.1 { f64::NAN } else { affine(p) };
            let scene = Scene::new(grid([9; 3], DVec3::NEG_ONE, DVec3::ONE, field), ramp(ENDS[0], ENDS[1]));
            let lit = with(&scene, Mode::Lit(LIGHT));
            near_reference(run, &lit, &through(9, 9), &[("step", "0.125"), ("filter", "exact")], 4e-2, 0);
        },
    },
    Case {
        number: "l7",
        name: "an eye inside, a light behind it and one ahead",
        expect: "the reference",
        tolerance: "5e-3, of second order in a step of 1/8",
        run: |run| {
            let scene = scene(Field::Blobs, 24, "f32", &FOG);
            for z in [1.0, -1.0] {
                let direction = Some(DVec3::new(0.1, 0.3, z));
                let lit = with(&scene, Mode::Lit(Lighting { direction, ..LIGHT }));
                let options = [("step", "0.125"), ("filter", "exact")];
                near_reference(run, &lit, &view(perspective(), 0.1, 24, 20), &options, 5e-3, 0);
            }
        },
    },
    Case {
        number: "l8",
        name: "an isosurface",
        expect: "the reference",
        tolerance: "1e-2 but for 2 % of the pixels, at outlines and edges; samples in the middle of a step 6e-2",
        run: |run| {
            let plain = scene(Field::Blobs, 24, "f32", &FOG);
            let transfer = auto::isosurface(&plain.data, 0.3, auto::ISOSURFACE_COLOUR).unwrap();
            let lit = with(&Scene { transfer, ..plain }, Mode::Lit(LIGHT));
            let view = view(perspective(), 1.0, 48, 40);
            let options = [("step", "0.25"), ("filter", "exact")];
            let truth = truth(&lit, &view);
            let claims = draws(&lit);
            run.only(&claims, &lit, &view, &options, |spec, frame| {
                let bound = if spec.samples() { 6e-2 } else { 1e-2 };
                let pixels = frame.image.pixels().iter().zip(truth.pixels());
                let off = |(got, want): (&[f32; 4], &[f64; 4])| {
                    got.iter().zip(want).any(|(got, want)| (f64::from(*got) - want).abs() > bound)
                };
                let wrong = pixels.filter(|pair| off(*pair)).count();
                if wrong <= 48 * 40 / 50 {
                    Ok(())
                } else {
                    Err(format!("{wrong} pixels are off by {bound:e}"))
                }
            });
        },
    },
    Case {
        number: "m1",
        name: "the maximum of an affine field, from outside and inside, in steps of 1/5000 to 100 voxels, one or several dispatches",
        expect: "closed form: at the end of each ray",
        tolerance: "t32(20)",
        run: |run| {
            let scene = greatest_scene(8, affine);
            for view in [
                view(perspective(), 1.0, 14, 12),
                view(perspective(), 0.1, 14, 12),
                view(orthographic(), 1.0, 14, 12),
            ] {
                for step in ["0.0002", "0.01", "0.3", "1", "100"] {
                    let options = [("step", step), ("filter", "exact")];
                    assert_greatest(run, &scene, &view, &options, 0.25, t32(20.0), |pixel| {
                        affine_at_ends(&view, pixel, f64::NEG_INFINITY)
                    });
                }
            }
        },
    },
    Case {
        number: "m2",
        name: "the maximum of scalars that fall to -1e30, and of one that is infinite",
        expect: "closed form",
        tolerance: "t32(20)",
        run: |run| {
            for (low, high) in [(-1e30, 1.0), (f64::NEG_INFINITY, f64::INFINITY)] {
                let field = |p: DVec3| if p.z > -0.1 { low } else { high };
                let scene = greatest_scene(8, |p| if p.x < -0.9 { 0.5 } else { field(p) });
                let greatest = |_| Some(1.0);
                assert_greatest(run, &scene, &through(5, 5), EXACT, 0.25, t32(20.0), greatest);
            }
        },
    },
    Case {
        number: "m3",
        name: "the maximum beside NaN, and of nothing else on a ray",
        expect: "closed form of the cells that no NaN touches; vacuum",
        tolerance: "t32(20)",
        run: |run| {
            let view = through(5, 5);
            let beside = greatest_scene(8, |p| if p.z > 0.1 { f64::NAN } else { 0.5 });
            assert_greatest(run, &beside, &view, EXACT, 0.25, t32(20.0), |_| Some(0.5));
            let one = greatest_scene(8, |p| if p == DVec3::NEG_ONE { 0.5 } else { f64::NAN });
            assert_greatest(run, &one, &view, EXACT, 0.25, t32(20.0), |_| None);
        },
    },
    Case {
        number: "m4",
        name: "the maximum in front of an opaque surface and a clip plane",
        expect: "closed form of what is in front",
        tolerance: "t32(60)",
        run: |run| {
            let scene = greatest_scene(8, affine);
            let view = through(9, 9);
            let greatest = |pixel| affine_at_ends(&view, pixel, 0.125);
            let clip = Clip::none().with_plane(DVec3::Z * 0.125, DVec3::Z).unwrap();
            assert_greatest(run, &scene, &view.with_clip(clip), EXACT, 0.25, t32(60.0), greatest);
            let pane = Surface::cuboid(
                DVec3::new(-9.0, -9.0, -3.0),
                DVec3::new(9.0, 9.0, 0.125),
                [0.0, 0.0, 0.0, 1.0],
            );
            let behind = scene.clone().with_surfaces(vec![pane.unwrap()]);
            let claims = draws(&behind);
            run.only(&claims, &behind, &view, EXACT, |_, frame| {
                for (i, pixel) in pixels(&view) {
                    let tau = ENDS[0] + (ENDS[1] - ENDS[0]) * greatest(pixel).unwrap_or(0.0);
                    let [red, _, _, alpha] = frame.image.pixels()[i].map(f64::from);
                    near("opacity", alpha, 1.0, t32(60.0))?;
                    near(&format!("red at {pixel}"), red, COLOUR[0] * opacity(tau * 0.25), t32(60.0))?;
                }
                Ok(())
            });
        },
    },
    Case {
        number: "m5",
        name: "the maximum with and without empty-space skipping",
        expect: "one image",
        tolerance: "the same bits",
        run: |run| {
            let scene = with(&scene(Field::MarschnerLobb, 40, "u8", &FOG), Mode::Maximum);
            let view = view(perspective(), 1.0, 40, 32);
            let options: [&[(&str, &str)]; 2] = [&[], &[("empty-space", "march")]];
            run.pairs_by(draws(&scene), [&scene; 2], [&view; 2], options, |_, a, b| equal("skipped", a, b));
        },
    },
    Case {
        number: "m6",
        name: "modes of meshes, of kernels, and where a technique lacks them; translucent surfaces in a maximum",
        expect: "refused",
        tolerance: "",
        run: |run| {
            let lit = Mode::Lit(Lighting::default());
            let mesh = Field::Ramp.tets(2).unwrap();
            let mesh = mesh.with_scalars(TetScalars::Point(vec![0.0; 27])).unwrap();
            for mode in [lit, Mode::Maximum] {
                let scene = Scene::new(mesh.clone(), fog(1.0));
                run.refuses("mode", scene.with_mode(mode), &["mode", "requires a grid", "mesh"]);
            }
            let bad = Lighting { shininess: 0.0, ..Lighting::default() };
            let grid = Scene::new(grid([3; 3], DVec3::NEG_ONE, DVec3::ONE, affine), fog(1.0));
            run.refuses("mode", grid.clone().with_mode(Mode::Lit(bad)), &["shininess", "1 to 1024"]);
            let surface = Surface::sphere(DVec3::ZERO, 0.5, [1.0, 1.0, 1.0, 0.5], 1).unwrap();
            let glass = with(&grid, Mode::Maximum).with_surfaces(vec![surface]);
            for scene in [with(&grid, lit), with(&grid, Mode::Maximum), glass] {
                let claims = |spec: &Spec| !draws(&scene)(spec);
                run.only(claims, &scene, &through(2, 2), &[], |_, _| Err("drawn".to_string()));
            }
            let outside = auto::isosurface(&grid.data, 7.0, DVec3::ONE);
            run.refuses("isosurface", outside, &["7: the data has scalars from"]);
        },
    },
];
