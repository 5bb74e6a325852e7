//! Clip planes, crop boxes and surfaces exactly where something changes, very far away, and next to each other.
//!
//! The affine cube again, of which any piece of a ray has the extinction of its middle.

use glam::{DVec2, DVec3};
use volraster::scene::{Clip, Scene, Surface, View};

use crate::common::pixels;
use crate::extremes::catalogue::{Case, Family, Run};
use crate::extremes::support::*;

pub static FAMILY: Family = Family::new("cuts", CASES);

const OPTIONS: &[(&str, &str)] = &[("step", "0.5"), ("filter", "exact")];

/// Rounding of some 20 pieces, and of where a ray is cut: depths around 5 are sums of three products, which round by some 8
/// units of 2^-24, at both ends of what is left; extinction is at most 2.2.
fn bound() -> f64 {
    t32(20.0) + ENDS[1] * 2.0 * 8.0 * 5.0 * (-24.0_f64).exp2()
}

/// Optical depth between two heights along a pixel's ray of [`through`].
fn depth_between(view: &View, pixel: DVec2, low: f64, high: f64) -> f64 {
    let (low, high) = (low.max(-1.0), high.min(1.0));
    let (origin, _) = view.ray(pixel);
    let mean = affine(DVec3::new(origin.x, origin.y, 0.5 * (low + high)));
    (ENDS[0] + (ENDS[1] - ENDS[0]) * mean) * (high - low).max(0.0)
}

fn cubes() -> Vec<Scene> {
    scenes(4, &ramp(ENDS[0], ENDS[1]), affine)
}

fn plane(clip: Clip, height: f64, normal: DVec3) -> Clip {
    clip.with_plane(DVec3::new(3.0, -2.0, height), normal).unwrap()
}

/// What is left between two heights, seen along z: plans go from one clip to the next.
fn between(run: &mut Run<'_>, clips: &[(Clip, [f64; 2])]) {
    let views: Vec<View> = clips.iter().map(|(clip, _)| through(6, 6).with_clip(*clip)).collect();
    for scene in cubes() {
        run.each_view(&scene, &views, OPTIONS, |_, images| {
            for ((view, image), (_, [low, high])) in views.iter().zip(images).zip(clips) {
                let depth = |pixel| depth_between(view, pixel, *low, *high);
                assert_depths(image, view, |_| bound(), depth)
                    .map_err(|wrong| format!("{low} to {high}: {wrong}"))?;
            }
            Ok(())
        });
    }
}

fn planes_in_faces(run: &mut Run<'_>) {
    let mut clips = Vec::new();
    // The domain's own faces, planes of samples, which are faces of cells, and between them.
    for height in [1.0, 0.5, 0.0, -0.25, -1.0] {
        clips.push((plane(Clip::none(), height, DVec3::Z), [height, 1.0]));
        clips.push((plane(Clip::none(), height, DVec3::NEG_Z), [-1.0, height]));
    }
    between(run, &clips);
}

fn thin_layers(run: &mut Run<'_>) {
    let mut clips = Vec::new();
    for (low, thick) in [(0.0, 1e-2), (0.3, 1e-3), (-1.0, 1e-4)] {
        let both = plane(plane(Clip::none(), low, DVec3::Z), low + thick, DVec3::NEG_Z);
        clips.push((both, [low, low + thick]));
        let all = f64::INFINITY;
        let (from, to) = (DVec3::new(-all, -all, low), DVec3::new(all, all, low + thick));
        clips.push((Clip::none().with_crop(from, to).unwrap(), [low, low + thick]));
    }
    between(run, &clips);
}

/// Planes that keep nothing leave nothing, exactly; planes along the rays keep a pixel's whole ray or nothing of it.
fn all_or_nothing(run: &mut Run<'_>) {
    let apart = plane(plane(Clip::none(), 0.1, DVec3::Z), -0.1, DVec3::NEG_Z);
    let beyond = plane(Clip::none(), 1e9, DVec3::Z);
    let aside = Clip::none().with_crop(DVec3::splat(2.0), DVec3::splat(3.0)).unwrap();
    for scene in cubes() {
        for clip in [apart, beyond, aside] {
            run.each(&scene, &through(6, 6).with_clip(clip), OPTIONS, |_, frame| {
                let all = frame.image.pixels().iter().flatten();
                let seen = all.filter(|value| **value != 0.0).count();
                if seen == 0 { Ok(()) } else { Err(format!("{seen} values are not zero")) }
            });
        }
        // No pixel's centre lies on the plane: see `through`.
        let along = Clip::none().with_plane(DVec3::ZERO, DVec3::X).unwrap();
        let view = through(6, 6).with_clip(along);
        run.each(&scene, &view, OPTIONS, |_, frame| {
            let depth = |pixel| match view.ray(pixel).0.x > 0.0 {
                true => depth_between(&view, pixel, -1.0, 1.0),
                false => 0.0,
            };
            assert_depths(&frame.image, &view, |_| bound(), depth)
        });
    }
}

/// What lies far beyond the data cuts nothing, however far.
fn far_away(run: &mut Run<'_>) {
    let far = |far: f64| {
        let mut clip = Clip::none().with_crop(DVec3::splat(-far), DVec3::splat(far)).unwrap();
        for normal in [DVec3::ONE, DVec3::NEG_ONE, DVec3::new(1.0, -2.0, 0.5)] {
            clip = clip.with_plane(-normal * far, normal).unwrap();
        }
        clip
    };
    let clips = [1e2, 1e6, 1e30].map(|distance| (far(distance), [-1.0, 1.0]));
    between(run, &clips);
}

/// Six planes around the middle, an octahedron without two of its sides, and a box in it: every chord by hand.
fn six_planes_and_a_box(run: &mut Run<'_>) {
    let sides = [[1, 1, 1], [-1, 1, 1], [1, -1, 1], [1, 1, -1], [-1, -1, 1], [1, -1, -1]];
    let normals = sides.map(|side| DVec3::from_array(side.map(f64::from)));
    let mut clip = Clip::none().with_crop(DVec3::splat(-0.9), DVec3::new(0.35, 0.45, 0.3)).unwrap();
    for normal in normals {
        clip = clip.with_plane(normal * -0.3, normal).unwrap();
    }
    let view = through(12, 12).with_clip(clip);
    let ends = |pixel: DVec2| {
        let at = view.ray(pixel).0;
        let (mut low, mut high) = (-0.9_f64, 0.3_f64);
        if at.x > 0.35 || at.y > 0.45 {
            high = low;
        }
        for normal in normals {
            // normal . p + 0.9 >= 0
            let height = -(0.9 + normal.x * at.x + normal.y * at.y) / normal.z;
            if normal.z > 0.0 { low = low.max(height) } else { high = high.min(height) }
        }
        [low, high]
    };
    let shown = pixels(&view).filter(|(_, pixel)| ends(*pixel)[1] > ends(*pixel)[0]).count();
    assert!((40..140).contains(&shown), "{shown}");
    for scene in cubes() {
        run.each(&scene, &view, OPTIONS, |_, frame| {
            let depth = |pixel| depth_between(&view, pixel, ends(pixel)[0], ends(pixel)[1]);
            assert_depths(&frame.image, &view, |_| bound(), depth)
        });
    }
}

const RED: [f64; 4] = [0.9, 0.3, 0.1, 1.0];
const GREEN: [f64; 4] = [0.2, 0.8, 0.4, 0.6];

/// A pane across z, `side` from its middle to its edges.
fn pane(height: f64, side: f64, colour: [f64; 4]) -> Surface {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let points = corners.map(|[x, y]| DVec3::new(x * side, y * side, height)).to_vec();
    Surface::new(points, vec![[0, 1, 2], [0, 2, 3]], colour).unwrap()
}

/// The cube with panes at heights, the highest first, seen along z.
fn panes(run: &mut Run<'_>, panes: &[(f64, [f64; 4])], surfaces: Vec<Surface>) {
    let view = through(6, 6);
    for scene in cubes() {
        let scene = scene.with_surfaces(surfaces.clone());
        run.each(&scene, &view, OPTIONS, |_, frame| {
            for (i, pixel) in pixels(&view) {
                let (mut wanted, mut transmittance, mut above) = ([0.0; 4], 1.0, 9.0);
                for &(height, [r, g, b, a]) in panes.iter().chain([&(-9.0, [0.0; 4])]) {
                    let a_fog = opacity(depth_between(&view, pixel, height, above));
                    let [fr, fg, fb] = COLOUR;
                    for ([r, g, b], a) in [([fr, fg, fb], a_fog), ([r, g, b], a)] {
                        for (sum, value) in wanted.iter_mut().zip([r * a, g * a, b * a, a]) {
                            *sum += transmittance * value;
                        }
                        transmittance *= 1.0 - a;
                    }
                    above = height;
                }
                for (got, wanted) in frame.image.pixels()[i].into_iter().zip(wanted) {
                    near(&format!("panes {panes:?} at {pixel}"), got.into(), wanted, bound())?;
                }
            }
            Ok(())
        });
    }
}

fn one_pane(run: &mut Run<'_>, colour: [f64; 4]) {
    // Before the cube, in its face, in a plane of samples, in a slice, in its other face, behind it.
    for height in [1.5, 1.0, 0.5, 0.125, -1.0, -1.5] {
        panes(run, &[(height, colour)], vec![pane(height, 2.0, colour)]);
    }
}

fn panes_next_to_each_other(run: &mut Run<'_>) {
    let blue = [0.1, 0.2, 0.9, 0.5];
    // The farther one comes first in the scene.
    for apart in [1e-3, 1e-5] {
        let (high, low) = (0.5 + apart, 0.5);
        panes(run, &[(high, GREEN), (low, blue)], vec![pane(low, 2.0, blue), pane(high, 2.0, GREEN)]);
        panes(run, &[(high, GREEN), (low, RED)], vec![pane(low, 2.0, RED), pane(high, 2.0, GREEN)]);
    }
    // In one place: each is passed.
    panes(run, &[(0.3, GREEN), (0.3, GREEN)], vec![pane(0.3, 2.0, GREEN), pane(0.3, 2.5, GREEN)]);
}

fn large_panes(run: &mut Run<'_>) {
    for side in [1e3, 1e6] {
        panes(run, &[(0.3, GREEN), (-0.2, RED)], vec![pane(-0.2, side, RED), pane(0.3, side, GREEN)]);
    }
}

/// Triangles without area, panes that show nothing, and panes that rays run along.
fn nothing_of_surfaces(run: &mut Run<'_>) {
    let line = vec![DVec3::new(-1.0, -1.0, 0.5), DVec3::ZERO, DVec3::new(1.0, 1.0, -0.5), DVec3::ZERO];
    let line = Surface::new(line, vec![[0, 1, 2], [1, 1, 1], [0, 3, 1]], RED).unwrap();
    let along = [DVec3::new(0.0, -9.0, -9.0), DVec3::new(0.0, 9.0, -9.0), DVec3::new(0.0, 0.0, 9.0)];
    let along = Surface::new(along.to_vec(), vec![[0, 1, 2]], RED).unwrap();
    panes(run, &[], vec![line, along]);
    panes(run, &[], vec![pane(0.2, 2.0, [1.0, 1.0, 1.0, 0.0])]);
}

/// An opaque pane just behind the eye, and just before it, inside of the cube.
fn pane_at_the_eye(run: &mut Run<'_>) {
    let (eye, ahead) = (DVec3::new(0.11, 0.23, 0.31), DVec3::new(-0.4, 0.3, -0.8).normalize());
    let view = look(eye, eye + ahead, DVec3::Y, 60.0, 12);
    let (right, up) = ahead.any_orthonormal_pair();
    for aside in [-1e-5, 1e-5] {
        let middle = eye + ahead * aside;
        let corners = [-right - up, right - up, right + up, up - right].map(|d| middle + d * 2.0);
        let pane = Surface::new(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]], RED).unwrap();
        for scene in cubes() {
            let scene = scene.with_surfaces(vec![pane.clone()]);
            run.each(&scene, &view, FINE, |spec, frame| {
                if aside > 0.0 {
                    let all = frame.image.pixels().iter();
                    return all.flat_map(|pixel| pixel.iter().zip(RED)).try_for_each(|(got, wanted)| {
                        // 1e-5 / cos of fog before it.
                        near("the pane", f64::from(*got), wanted, 2e-5 * ENDS[1])
                    });
                }
                let (sheet, warp) = (if spec.sheets() { 1e-3 } else { 0.0 }, |pixel| {
                    if spec.warps() {
                        warped(pixel, 0.5, |pixel| opacity(affine_depth(&view, pixel)))
                    } else {
                        0.0
                    }
                });
                let bound = |pixel| t32(60.0) + 1e-5 + sheet + warp(pixel);
                assert_depths(&frame.image, &view, bound, |pixel| affine_depth(&view, pixel))
            });
        }
    }
}

const CASES: &[Case] = &[
    Case {
        number: "c1",
        name: "clip planes in faces of the domain, planes of samples, faces of cells",
        expect: "closed form of the remaining part",
        tolerance: "t32(20) + 1.1e-5",
        run: planes_in_faces,
    },
    Case {
        number: "c2",
        name: "layers of 1e-2, 1e-3 and 1e-4 between two planes, and cropped",
        expect: "closed form of the remaining part",
        tolerance: "t32(20) + 1.1e-5",
        run: thin_layers,
    },
    Case {
        number: "c3",
        name: "planes that keep nothing, and planes along the rays",
        expect: "nothing; a pixel's whole ray or nothing",
        tolerance: "exact; t32(20) + 1.1e-5",
        run: all_or_nothing,
    },
    Case {
        number: "c4",
        name: "planes and a box 1e2, 1e6 and 1e30 away",
        expect: "closed form of the whole",
        tolerance: "t32(20) + 1.1e-5",
        run: far_away,
    },
    Case {
        number: "c5",
        name: "six planes and a box",
        expect: "closed form of the remaining part",
        tolerance: "t32(20) + 1.1e-5",
        run: six_planes_and_a_box,
    },
    Case {
        number: "s1a",
        name: "an opaque pane before, behind, in faces, in planes of samples",
        expect: "closed form of what is before it, and its colour",
        tolerance: "t32(20) + 1.1e-5",
        run: |run| one_pane(run, RED),
    },
    Case {
        number: "s1b",
        name: "a translucent pane before, behind, in faces, in planes of samples",
        expect: "closed form in its order",
        tolerance: "t32(20) + 1.1e-5",
        run: |run| one_pane(run, GREEN),
    },
    Case {
        number: "s2",
        name: "panes 1e-3 and 1e-5 apart, and in one place",
        expect: "closed form in their order",
        tolerance: "t32(20) + 1.1e-5",
        run: panes_next_to_each_other,
    },
    Case {
        number: "s3",
        name: "panes of 1e3 and 1e6 sizes of the cube",
        expect: "closed form in their order",
        tolerance: "t32(20) + 1.1e-5",
        run: large_panes,
    },
    Case {
        number: "s4",
        name: "triangles without area, along the rays, of no opacity",
        expect: "the cube alone",
        tolerance: "t32(20) + 1.1e-5",
        run: nothing_of_surfaces,
    },
    Case {
        number: "s5",
        name: "an opaque pane 1e-5 behind and before an eye inside",
        expect: "the cube alone; the pane alone",
        tolerance: "t32(60) + 1e-5, sheets 1e-3 more; 4.4e-5",
        run: pane_at_the_eye,
    },
];
