//! Cameras very far away and exactly on places where something changes, very narrow and very wide, along axes.
//!
//! The field is affine and extinction linear in it, so a ray's mean extinction is that of its middle: every rule is
//! exact, and what is left is where a ray enters and leaves: see [`slack`].

use glam::{DVec2, DVec3};
use volraster::scene::{Camera, Projection, View};

use crate::common::*;
use crate::extremes::catalogue::{Case, Family, Run};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("cameras", CASES);

/// What a warp may be off by at each pixel of the affine cube, texels so many pixels apart where they are farthest.
fn warps(view: &View, texel: f64) -> Vec<f64> {
    let value = |pixel| opacity(affine_depth(view, pixel));
    let bounds: Vec<f64> = pixels(view).map(|(_, pixel)| warped(pixel, texel, value)).collect();
    // Of some use: no pop above 2e-3 passes where no edge of the domain is near. At 179 degrees edges are near everywhere.
    let sharp = bounds.iter().filter(|bound| **bound < 1e-3).count();
    assert!(
        texel >= 1.0 || 6 * sharp > bounds.len(),
        "{sharp} of {} pixels: {:?}",
        bounds.len(),
        view.camera()
    );
    bounds
}

/// The affine cube from views, each with a bound, and the distance of the warp's texels.
fn affine_cube(run: &mut Run<'_>, views: &[View], bound: f64, texel: f64) {
    for scene in scenes(4, &ramp(ENDS[0], ENDS[1]), affine) {
        let warps: Vec<Vec<f64>> = views
            .iter()
            .map(|view| if scene.grid().is_some() { warps(view, texel) } else { Vec::new() })
            .collect();
        run.each_view(&scene, views, FINE, |spec, images| {
            for ((view, image), warps) in views.iter().zip(images).zip(&warps) {
                let seen = image.pixels().iter().any(|p| p[3] > 1e-3);
                if !seen {
                    return Err(format!("{:?}: nothing to see", view.camera()));
                }
                let rule = |pixel| if spec.sheets() { two_points(view, pixel, 0.25) } else { 0.0 };
                let warp = |pixel: DVec2| if spec.warps() { warps[index(view, pixel)] } else { 0.0 };
                let bound = |pixel| bound + slack(view, pixel) + rule(pixel) + warp(pixel);
                assert_depths(image, view, bound, |pixel| affine_depth(view, pixel))
                    .map_err(|wrong| format!("{:?}: {wrong}", view.camera()))?;
            }
            Ok(())
        });
    }
}

/// Distance of the warp's texels under [`FINE`], in pixels: an eighth in the middle of what is drawn, and along a slanting base
/// plane up to twice as much.
const TEXEL: f64 = 0.25;

/// The place of a pixel in an image.
fn index(view: &View, pixel: DVec2) -> usize {
    let [width, _] = view.extent();
    pixel.y as usize * width as usize + pixel.x as usize
}

/// Up to some 60 pieces.
fn bound() -> f64 {
    t32(60.0)
}

/// What places cost: coordinates of a view are sums of three products and of the eye, which rounds by some 8 units of
/// 2^-24 of the cube's radius, and lines through meshes are moved aside by 4.3e-7 of it, so that all cells at an edge agree
/// (`ASIDE` in `glsl/mesh/mesh.glsl`). So far are the ends of a ray off, measured from the face that it passes, and by more
/// along the ray the flatter it meets the face; extinction is at most 2.2.
fn slack(view: &View, pixel: DVec2) -> f64 {
    let (origin, direction) = view.ray(pixel);
    let mut faces = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let at = origin + direction * ((side - origin[axis]) / direction[axis]);
            if at.is_finite() && at.abs().max_element() < 1.0 + 1e-5 {
                faces.push(1.0 / direction[axis].abs());
            }
        }
    }
    ENDS[1] * (8.0 * (-24.0_f64).exp2() + 4.3e-7) * 3.0_f64.sqrt() * faces.iter().sum::<f64>()
}

/// What two points a slab lose in sheets: a kernel has edges in the planes of voxels, which they do not see, and a slab is as
/// long as it is seen under an angle. Of second order; a slab of many voxels takes any two of them.
fn two_points(view: &View, pixel: DVec2, step: f64) -> f64 {
    let (_, direction) = view.ray(pixel);
    let length = step / direction.dot(view.forward());
    (5e-4 * length * length).min(1e-2)
}

/// So far away that the cube fills the image through a narrow angle, against parallel rays: those converge by 1/distance.
fn far(run: &mut Run<'_>, distance: f64) {
    let direction = DVec3::new(0.31, 0.22, 0.92).normalize();
    let eye = direction * 2.0 * distance;
    let fov = 2.0 * (1.8 / (2.0 * distance)).atan().to_degrees();
    let near_by = Camera {
        eye,
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Perspective { fov_y_deg: fov },
    };
    let perspective = View::new(near_by, 13, 13).unwrap();
    let projection = Projection::Orthographic { half_height: 1.8 };
    let parallel = View::new(Camera { projection, ..near_by }, 13, 13).unwrap();
    affine_cube(run, &[perspective, parallel], bound(), TEXEL);
    for scene in scenes(4, &ramp(ENDS[0], ENDS[1]), affine) {
        run.pairs([&scene; 2], [&perspective, &parallel], [FINE; 2], |_, a, b| {
            for (i, pixel) in pixels(&parallel).filter(|(_, pixel)| !on_outline(&parallel, *pixel)) {
                near(
                    &format!("perspective at {pixel}"),
                    a.pixels()[i][3].into(),
                    b.pixels()[i][3].into(),
                    1e-4,
                )?;
            }
            Ok(())
        });
    }
}

/// From places in and at the cube, in directions along axes and oblique. No pixel's ray lies in an edge or a face: its side of
/// those is rounding, and one in a thousand may miss or meet a cell twice.
fn from(run: &mut Run<'_>, eye: DVec3) {
    let mut views = Vec::new();
    for ahead in [DVec3::NEG_Z, DVec3::new(1.0, -1.0, 0.5), DVec3::new(-1.0, 0.25, -0.125)] {
        // Into the cube, where the eye is on its outside.
        let outside = eye.abs().cmpge(DVec3::ONE);
        let ahead = DVec3::select(outside, -eye.signum() * ahead.abs(), ahead);
        views.push(look(eye, eye + ahead, DVec3::new(0.1, 1.0, 0.2), 70.0, 16));
    }
    // Several base planes, each as fine as in the middle of its own part of the image.
    affine_cube(run, &views, bound(), 2.0 * TEXEL);
}

/// Along an axis or a diagonal, and a little aside: no other slices, no pop.
fn perturbed(run: &mut Run<'_>, direction: DVec3) {
    let up = if direction.x == 0.0 && direction.z == 0.0 { DVec3::Z } else { DVec3::Y };
    for scene in scenes(4, &ramp(ENDS[0], ENDS[1]), affine) {
        for projection in
            [Projection::Orthographic { half_height: 1.7 }, Projection::Perspective { fov_y_deg: 40.0 }]
        {
            let view = |aside: f64| {
                let eye = direction.normalize() * 5.0 + DVec3::new(0.7, -0.4, 0.6) * aside;
                View::new(Camera { eye, target: DVec3::ZERO, up, projection }, 12, 12).unwrap()
            };
            let views = [0.0, -1e-7, 1e-7].map(view);
            let exact = &views[0];
            let inside: Vec<_> = pixels(exact).filter(|(_, pixel)| !on_outline(exact, *pixel)).collect();
            let warps = if scene.grid().is_some() { warps(exact, TEXEL) } else { Vec::new() };
            run.each_view(&scene, &views, FINE, |spec, images| {
                let [a, others @ ..] = images else { return Err("no image".to_string()) };
                let warp = |pixel: DVec2| if spec.warps() { warps[index(exact, pixel)] } else { 0.0 };
                for b in others {
                    for &(i, pixel) in &inside {
                        near(
                            &format!("aside at {pixel}"),
                            b.pixels()[i][3].into(),
                            a.pixels()[i][3].into(),
                            // Another base plane has other texels.
                            1e-5 + 2.0 * warp(pixel),
                        )?;
                    }
                }
                assert_depths(
                    a,
                    exact,
                    |pixel| bound() + slack(exact, pixel) + warp(pixel),
                    |pixel| affine_depth(exact, pixel),
                )
            });
        }
    }
}

/// Slices through corners, edges and in faces of the cube: planes at distances 1/k of its extent along the view.
fn planes_through_corners(run: &mut Run<'_>) {
    for direction in [DVec3::Z, DVec3::new(1.0, 0.0, 1.0), DVec3::ONE] {
        let up = DVec3::new(-0.3, 1.0, 0.2);
        let projection = Projection::Orthographic { half_height: 1.8 };
        let camera = Camera { eye: direction * 4.0, target: DVec3::ZERO, up, projection };
        let view = View::new(camera, 16, 16).unwrap();
        let extent = 2.0 * direction.abs().element_sum() / direction.length();
        let value = |pixel| opacity(0.8 * chord(&view, pixel));
        let warps: Vec<f64> = pixels(&view).map(|(_, pixel)| warped(pixel, TEXEL, value)).collect();
        for scene in scenes(2, &fog(0.8), |_| 0.5) {
            // Voxels are one unit wide.
            for pieces in [1.0, 2.0, 3.0, 4.0, 6.0] {
                let step = format!("{}", extent / pieces);
                let options: &[(&str, &str)] = &[("step", &step), ("intermediate", "8"), ("warp", "bicubic")];
                run.each(&scene, &view, options, |spec, frame| {
                    let warp = |pixel: DVec2| if spec.warps() { warps[index(&view, pixel)] } else { 0.0 };
                    assert_depths(
                        &frame.image,
                        &view,
                        |pixel| t32(20.0) + 1e-6 + warp(pixel),
                        |pixel| 0.8 * chord(&view, pixel),
                    )
                });
            }
        }
    }
}

/// A wide angle, from inside and from outside: everything in sight is in the image.
fn wide(run: &mut Run<'_>) {
    let eye = DVec3::new(0.2, -0.1, 0.35);
    let inside = look(eye, eye + DVec3::new(0.3, 0.1, -1.0), DVec3::Y, 179.0, 17);
    let outside = look(DVec3::new(0.3, 0.2, 1.01), DVec3::new(0.1, 0.0, 0.0), DVec3::Y, 179.0, 17);
    // At 89.5 degrees slabs of equal depth are 115 times as long along the ray, and depths of places on it round as
    // much more: 115 2^-23 of the cube's size.
    let depths = bound() + ENDS[1] * 2.0 * 115.0 * (-23.0_f64).exp2();
    // Texels follow pixels in the middle of the image of each plane: to its corner they grow by as much as pixels shrink.
    affine_cube(run, &[inside, outside], depths, 4.0 * TEXEL);
}

fn narrow(run: &mut Run<'_>) {
    let eye = DVec3::new(2.0, 1.5, 3.8);
    let views = [1e-3, 1e-6].map(|fov| look(eye, DVec3::new(0.1, 0.2, 0.05), DVec3::Y, fov, 9));
    affine_cube(run, &views, bound(), TEXEL);
}

const CASES: &[Case] = &[
    Case {
        number: "35a",
        name: "eye 1e3 sizes away",
        expect: "closed form",
        tolerance: "t32(60), 3.5e-6 / cos at faces",
        run: |run| {
            let eye = DVec3::new(0.31, 0.22, 0.92).normalize() * 2e3;
            let view = look(eye, DVec3::ZERO, DVec3::Y, 2.0 * (1.8_f64 / 2e3).atan().to_degrees(), 13);
            affine_cube(run, &[view], bound(), TEXEL);
        },
    },
    Case {
        number: "35b",
        name: "eye 1e6 sizes away, narrow angle",
        expect: "closed form; equals parallel rays",
        tolerance: "t32(60), 3.5e-6 / cos at faces; 1e-4",
        run: |run| far(run, 1e6),
    },
    Case {
        number: "35c",
        name: "eye 1e9 sizes away, narrow angle",
        expect: "closed form; equals parallel rays",
        tolerance: "t32(60), 3.5e-6 / cos at faces; 1e-4",
        run: |run| far(run, 1e9),
    },
    Case {
        number: "37a",
        name: "angles of view of 1e-3 and 1e-6 degrees",
        expect: "closed form, no hole",
        tolerance: "t32(60), 3.5e-6 / cos at faces",
        run: narrow,
    },
    Case {
        number: "37b",
        name: "angle of view of 179 degrees",
        expect: "closed form, no hole",
        tolerance: "t32(60) + 6e-5, 3.5e-6 / cos at faces; sheets 1e-2 more",
        run: wide,
    },
    Case {
        number: "38",
        name: "eye 1e-6 from the outside and inside of a face",
        expect: "closed form",
        tolerance: "t32(60), 3.5e-6 / cos at faces; sheets 3e-5 / cos² more",
        run: |run| {
            from(run, DVec3::new(0.1, 0.2, 1.0 + 1e-6));
            from(run, DVec3::new(0.1, 0.2, 1.0 - 1e-6));
        },
    },
    Case {
        number: "39a",
        name: "eye exactly on a voxel, a vertex of the mesh",
        expect: "closed form",
        tolerance: "t32(60), 3.5e-6 / cos at faces; sheets 3e-5 / cos² more",
        run: |run| from(run, DVec3::ZERO),
    },
    Case {
        number: "39b",
        name: "eye exactly on an edge of cells",
        expect: "closed form",
        tolerance: "t32(60), 3.5e-6 / cos at faces; sheets 3e-5 / cos² more",
        run: |run| from(run, DVec3::new(0.5, 0.0, 0.25)),
    },
    Case {
        number: "39c",
        name: "eye exactly on a face of cells",
        expect: "closed form",
        tolerance: "t32(60), 3.5e-6 / cos at faces; sheets 3e-5 / cos² more",
        run: |run| from(run, DVec3::new(0.5, 0.125, 0.3125)),
    },
    Case {
        number: "39d",
        name: "eye exactly on the middle of a voxel",
        expect: "closed form",
        tolerance: "t32(60), 3.5e-6 / cos at faces; sheets 3e-5 / cos² more",
        run: |run| from(run, DVec3::splat(0.25)),
    },
    Case {
        number: "39e",
        name: "eye exactly on a face of the domain",
        expect: "closed form",
        tolerance: "t32(60), 3.5e-6 / cos at faces; sheets 3e-5 / cos² more",
        run: |run| from(run, DVec3::new(0.1, 0.2, 1.0)),
    },
    Case {
        number: "39f",
        name: "eye exactly on an edge of the domain",
        expect: "closed form",
        tolerance: "t32(60), 3.5e-6 / cos at faces; sheets 3e-5 / cos² more",
        run: |run| from(run, DVec3::new(1.0, 0.2, 1.0)),
    },
    Case {
        number: "39g",
        name: "eye exactly on a corner of the domain",
        expect: "closed form",
        tolerance: "t32(60), 3.5e-6 / cos at faces; sheets 3e-5 / cos² more",
        run: |run| from(run, DVec3::ONE),
    },
    Case {
        number: "40a",
        name: "exactly along the axes, and 1e-7 aside",
        expect: "closed form; the same",
        tolerance: "t32(60), 3.5e-6 / cos at faces; 1e-5",
        run: |run| {
            for axis in [DVec3::X, DVec3::NEG_Y, DVec3::Z] {
                perturbed(run, axis);
            }
        },
    },
    Case {
        number: "40b",
        name: "exactly at 45 degrees, and 1e-7 aside",
        expect: "closed form; the same",
        tolerance: "t32(60), 3.5e-6 / cos at faces; 1e-5",
        run: |run| {
            perturbed(run, DVec3::new(1.0, 0.0, 1.0));
            perturbed(run, DVec3::new(0.0, -1.0, 1.0));
        },
    },
    Case {
        number: "40c",
        name: "exactly along the cube's diagonal, and 1e-7 aside",
        expect: "closed form; the same",
        tolerance: "t32(60), 3.5e-6 / cos at faces; 1e-5",
        run: |run| perturbed(run, DVec3::ONE),
    },
    Case {
        number: "41",
        name: "slices through corners, edges and in faces",
        expect: "1 - exp(-tau chord)",
        tolerance: "t32(20) + 1e-6",
        run: planes_through_corners,
    },
];
