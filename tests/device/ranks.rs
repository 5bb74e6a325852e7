//! Several ranks draw the image of one process.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_precision_loss,
    reason = "a test fails by panicking, and counts are small"
)]

use std::sync::Arc;

use crate::common::*;
use glam::DVec3;
use volraster::gpu::GpuOptions;
use volraster::measure::ImageErrors;
use volraster::ranks::{Communicator as _, Counted, KdTree, Shares, Threads, render};
use volraster::scene::{
    Camera, Clip, Data, Field, Grid, KernelSize, Lighting, Mode, Projection, Samples, Scene, Surface, Tets,
    TransferFunction, View,
};
use volraster::technique::Renderer;
use volraster::{GpuScene, Image, Result};

fn fog() -> TransferFunction {
    TransferFunction::from_rows(&[
        [0.0, 0.1, 0.2, 0.9, 0.02],
        [0.3, 0.1, 0.2, 0.9, 0.0],
        [0.6, 0.9, 0.5, 0.1, 3.0],
        [1.0, 1.0, 1.0, 0.3, 40.0],
    ])
    .unwrap()
}

/// From outside, from within, and along an axis, where a column of rays lies in a plane across the middle.
fn views() -> [View; 3] {
    let along = Camera {
        eye: DVec3::new(0.0, 0.0, 4.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Orthographic { half_height: 1.2 },
    };
    [view(perspective(), 1.0, 70, 60), view(perspective(), 0.2, 50, 40), View::new(along, 51, 51).unwrap()]
}

/// Draws with ranks that are threads, and returns what each has.
fn drawn(scene: &Arc<GpuScene>, spec: &str, view: &View, ranks: u32) -> Vec<Result<Option<Image>>> {
    let shares = Shares::new(scene.scene(), view, ranks).unwrap();
    Threads::run(ranks, |end| {
        // Of meshes and points each rank has its own part.
        let part = match scene.scene().grid() {
            None => GpuScene::new(scene.gpu(), shares.part(scene.scene(), view, end.rank())),
            Some(_) => Arc::clone(scene),
        };
        Ok(render(&part, technique(spec), view, &shares, &end)?.image)
    })
}

fn is_same(scene: &Arc<GpuScene>, spec: &str, what: &str) {
    for (i, view) in views().iter().enumerate() {
        let want = draw_on(scene, view, spec);
        for ranks in taken_from(spec.len() + i, 4, [2, 3, 5, 8]) {
            let mut all = drawn(scene, spec, view, ranks).into_iter().map(Result::unwrap);
            let got = all.next().flatten().unwrap();
            assert!(all.all(|image| image.is_none()));
            let errors = ImageErrors::between(&got, &want).unwrap().all;
            println!("{what} {spec}, {ranks} ranks: {:.1e}, at most {:.1e}", errors.rmse, errors.max_abs);
            // The rays of a rectangle of the image are rounded otherwise.
            let bound = if what == "points" { 4e-6 } else { 2e-6 };
            assert!(errors.max_abs <= bound, "{what} {spec}, {ranks} ranks: {errors:?}");
            assert!(want.pixels().iter().any(|pixel| (0.2..0.9999).contains(&pixel[3])));
        }
    }
}

/// Grids are cut into the same pieces, whatever the number of ranks and the technique: whole, or in pages.
#[test]
fn grids_are_those_of_one_process() {
    let specs = [
        "slices-3d:step=0.7",
        "slices-3d:step=2,empty-space=march",
        "slabs",
        "slabs:step=2,integrator=exact",
        "raycast:step=1.3",
        "raycast:step=2,integrator=integral",
        "slices-2d:step=0.5",
        "slices-2d:step=2",
    ];
    let dims = [90, 66, 71];
    let plain = Scene::new(Field::Blobs.sample(dims, "f32").unwrap(), fog());
    let lit = plain.clone().with_mode(Mode::Lit(Lighting::default())).unwrap();
    let whole = gpu();
    let paged =
        gpu_with(GpuOptions { page_pool: Some(3 * (67_u64.pow(3) * 4 + 4)), ..GpuOptions::default() });
    for (name, gpu) in [("whole", &*whole), ("paged", &*paged)] {
        let scene = GpuScene::new(gpu, plain.clone());
        for spec in taken(2, specs) {
            // The coordinates of filters are rounded otherwise where a page lies in another slot.
            let exact = with_option(spec, "filter", "exact");
            is_same(&scene, if name == "paged" { &exact } else { spec }, name);
        }
        is_same(&GpuScene::new(gpu, lit.clone()), "slabs:filter=exact", &format!("{name}, lit"));
    }
}

/// Meshes are clipped to boxes, one that is not convex as well.
#[test]
fn meshes_are_those_of_one_process() {
    let gpu = gpu();
    let whole = Field::Blobs.tets(9).unwrap();
    // With a hole through its middle and a corner cut off, so that rays leave it and enter it again.
    let stays = |cell: &[u32; 4]| {
        let middle = cell.map(|i| whole.points()[i as usize]).into_iter().sum::<DVec3>() / 4.0;
        middle.truncate().length() > 0.4 && middle.element_sum() < 1.5
    };
    let cells: Vec<_> = whole.cells().iter().copied().filter(stays).collect();
    assert!(cells.len() < whole.cells().len());
    let (mesh, _) = Tets::new(whole.points().to_vec(), cells, whole.scalars().clone()).unwrap();
    let scene = GpuScene::new(&gpu, Scene::new(mesh, fog()));
    for spec in [
        "havs:integrator=exact",
        "abuffer:integrator=exact",
        "projected-tets:integrator=exact",
        "projected-tets:route=raster",
    ] {
        is_same(&scene, spec, "mesh");
    }
}

/// Of points each rank draws a rectangle of the image, and has the points alone whose kernels reach it.
#[test]
fn points_are_those_of_one_process() {
    let gpu = gpu();
    let points = Field::Blobs.points(2000).unwrap();
    let alike = Scene::new(points.clone().with_estimated_radius(), fog());
    let radii = (0..2000_u16).map(|i| 0.02 + f32::from(i % 97) * 1e-3).collect();
    let several = Scene::new(points.with_size(KernelSize::Radii(radii)).unwrap(), fog());
    for (scene, specs) in [
        (alike, "splat-ewa splat-ewa:footprint=ewa,order=center splat-sheets"),
        (several, "splat-ewa splat-ewa:footprint=ewa"),
    ] {
        let scene = GpuScene::new(&gpu, scene);
        for spec in specs.split(' ') {
            is_same(&scene, spec, "points");
        }
        let view = &views()[0];
        let shares = Shares::new(scene.scene(), view, 8).unwrap();
        if let Data::Points(all) = &scene.scene().data {
            let count = |rank| match shares.part(scene.scene(), view, rank).data {
                Data::Points(part) => part.centres().len(),
                _ => 0,
            };
            let counts: Vec<usize> = (0..8).map(count).collect();
            assert!(counts.iter().all(|&count| 5 * count < 4 * all.centres().len()), "{counts:?}");
        }
    }
}

/// Of trained splats each rank draws a rectangle of the image by all rules, also those that depend on its edges: but for pixels where rounding
/// decides whether a splat's faint end is drawn.
#[test]
fn trained_splats_are_those_of_one_process() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, Scene::new(Field::Blobs.splats(300).unwrap(), fog()));
    for rule in ["inria", "antialiased", "khr", "ray", "overlap"] {
        for (i, view) in views().iter().enumerate() {
            let spec = format!("gaussians:rule={rule}");
            let want = draw_on(&scene, view, &spec);
            for ranks in taken_from(spec.len() + i, 3, [2, 5, 8]) {
                let got = drawn(&scene, &spec, view, ranks)
                    .into_iter()
                    .map(Result::unwrap)
                    .next()
                    .flatten()
                    .unwrap();
                let errors = ImageErrors::between(&got, &want).unwrap().all;
                let far = |(a, b): &(&[f32; 4], &[f32; 4])| (0..4).any(|c| (a[c] - b[c]).abs() > 4e-6);
                let flips = got.pixels().iter().zip(want.pixels()).filter(far).count();
                let [rmse, most] = [errors.rmse, errors.max_abs];
                println!("{spec}, {ranks} ranks: {rmse:.1e}, at most {most:.1e}, {flips} pixels");
                assert!(flips * 1000 <= want.pixels().len(), "{spec}, {ranks} ranks: {errors:?}, {flips}");
            }
        }
    }
}

/// Where boxes own no pieces of rays each rank draws a rectangle of the image: maximum intensity projection, and scenes with surfaces.
#[test]
fn scenes_without_pieces_are_those_of_one_process() {
    let gpu = gpu();
    let grid = scene(Field::Blobs, 48, "f32", &FOG);
    let maximum = grid.clone().with_mode(Mode::Maximum).unwrap();
    let corners = [[-1.2, -1.0, 0.3], [1.2, -1.0, -0.3], [1.2, 1.0, -0.3], [-1.2, 1.0, 0.3]];
    let pane = Surface::new(
        corners.map(DVec3::from_array).to_vec(),
        vec![[0, 1, 2], [0, 2, 3]],
        [0.2, 0.4, 0.1, 0.5],
    );
    let pane = pane.unwrap();
    let ball = Surface::sphere(DVec3::new(0.3, 0.2, 0.2), 0.4, [0.9, 0.4, 0.3, 1.0], 3).unwrap();
    let with_surfaces = grid.with_surfaces(vec![pane.clone(), ball.clone()]);
    let mesh = Scene::new(Field::Blobs.tets(6).unwrap(), fog()).with_surfaces(vec![pane, ball]);
    for (what, scene, specs) in [
        ("maximum", maximum, "raycast raycast:step=0.4,filter=exact"),
        ("surfaces", with_surfaces, "slabs slices-3d:step=0.5 raycast"),
        ("mesh with surfaces", mesh, "havs"),
    ] {
        let scene = GpuScene::new(&gpu, scene);
        for spec in specs.split(' ') {
            is_same(&scene, spec, what);
        }
    }
}

/// Of rays that lie in the plane between two boxes one box draws all, of a grid and of a mesh.
#[test]
fn rays_in_the_plane_between_boxes_are_drawn_once() {
    let gpu = gpu();
    let grid = Field::Blobs.sample([40; 3], "f32").unwrap();
    let [.., view] = views();
    for (data, spec) in
        [(Data::from(grid), "slabs"), (Field::Blobs.tets(8).unwrap().into(), "havs:integrator=exact")]
    {
        let scene = GpuScene::new(&gpu, Scene::new(data, fog()));
        let half = |low: f64, high: f64| {
            let corner = |x: f64| DVec3::new(x, f64::INFINITY, f64::INFINITY);
            let view = view.with_owned(corner(low) * DVec3::new(1.0, -1.0, -1.0), corner(high)).unwrap();
            draw_on(&scene, &view, spec)
        };
        let (left, right) = (half(f64::NEG_INFINITY, 0.0), half(0.0, f64::INFINITY));
        let want = draw_on(&scene, &view, spec);
        let mut middle = 0;
        for (i, want) in want.pixels().iter().enumerate() {
            let [left, right] = [left.pixels()[i], right.pixels()[i]];
            // The boxes lie beside each other along the rays: one of them draws a pixel.
            assert!(left == [0.0; 4] || right == [0.0; 4], "{spec}: {left:?}, {right:?}");
            let apart = (0..4).map(|c| (left[c] + right[c] - want[c]).abs()).fold(0.0, f32::max);
            assert!(apart <= 2e-6, "{spec}: {apart}");
            middle += usize::from(i % 51 == 25 && want[3] > 0.1);
        }
        assert!(middle > 5, "the middle column shows the data");
    }
}

/// A piece that begins in front of the box that owns it is drawn, also where the box begins in bricks that show nothing.
#[test]
fn long_pieces_begin_in_front_of_their_boxes() {
    let gpu = gpu();
    // Matter at the begin of the way along x, and nothing behind: a long piece begins in it, with its middle far behind.
    let side = 97_usize;
    let samples = (0..side.pow(3)).map(|i| if i % side < 13 { 1.0 } else { -1.0 }).collect();
    let grid = Grid::new([97; 3], Samples::F32(samples)).unwrap();
    let matter =
        TransferFunction::from_rows(&[[0.0, 0.9, 0.4, 0.1, 0.0], [1.0, 1.0, 0.9, 0.2, 0.1]]).unwrap();
    let scene = GpuScene::new(&gpu, Scene::new(grid, matter));
    let camera = Camera {
        eye: DVec3::new(-200.0, 48.0, 48.0),
        target: DVec3::splat(48.0),
        up: DVec3::Y,
        projection: Projection::Orthographic { half_height: 20.0 },
    };
    let view = View::new(camera, 48, 48).unwrap();
    for spec in [
        "slabs:step=40",
        "slabs:step=64",
        "slices-3d:step=20",
        "raycast:step=40,integrator=integral",
        "slices-2d:step=8",
    ] {
        let want = draw_on(&scene, &view, spec);
        assert!(want.pixel(24, 24)[3] > 0.2, "{spec}: {}", want.pixel(24, 24)[3]);
        for plane in 14..96 {
            let half = |low: f64, high: f64| {
                let owned = view.with_owned(DVec3::new(low, -1e3, -1e3), DVec3::new(high, 1e3, 1e3)).unwrap();
                draw_on(&scene, &owned, spec)
            };
            let (front, back) = (half(-1e3, f64::from(plane)), half(f64::from(plane), 1e3));
            for (i, want) in want.pixels().iter().enumerate() {
                let [front, back] = [front.pixels()[i], back.pixels()[i]];
                let apart = (0..4).map(|c| (front[c] + (1.0 - front[3]) * back[c] - want[c]).abs());
                let apart = apart.fold(0.0, f32::max);
                assert!(apart <= 2e-6, "{spec}, cut at {plane}: {apart}");
            }
        }
    }
}

/// The clip planes of a view cut off the boxes, too; a box owns nothing outside of the data.
#[test]
fn clipped_views_are_shared_out() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 40, "f32", &FOG));
    let clip = Clip::none().with_plane(DVec3::new(0.1, 0.2, 0.0), DVec3::new(0.3, -1.0, 0.2)).unwrap();
    let view = views()[0].with_clip(clip);
    for spec in ["slabs:step=2", "slices-3d", "raycast", "slices-2d"] {
        let got = drawn(&scene, spec, &view, 3).swap_remove(0).unwrap().unwrap();
        let errors = ImageErrors::between(&got, &draw_on(&scene, &view, spec)).unwrap().all;
        assert!(errors.max_abs <= 2e-6, "{spec}: {errors:?}");
        let [low, high] = [DVec3::splat(5.0), DVec3::splat(6.0)];
        let empty = draw_on(&scene, &view.with_owned(low, high).unwrap(), spec);
        assert!(empty.pixels().iter().all(|pixel| *pixel == [0.0; 4]), "{spec}");
    }
}

/// A plan turns from view to view and from box to box; without one it is prepared anew.
#[test]
fn boxes_move_with_a_plan() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 40, "f32", &FOG));
    let [first, ..] = views();
    let half = |x: f64| first.with_owned(DVec3::new(x, -9.0, -9.0), DVec3::splat(9.0)).unwrap();
    let mut frames = Renderer::new(&scene, technique("slabs")).frames(&half(0.0)).unwrap();
    for view in [half(0.0), half(0.3), first, half(-0.5)] {
        frames.draw(&view).unwrap();
        assert!(frames.read_back().unwrap() == draw_on(&scene, &view, "slabs"));
    }
}

/// Every rank refuses, in one line, scenes and techniques whose rays no boxes own pieces of.
#[test]
fn what_no_box_owns_is_refused() {
    let gpu = gpu();
    let grid = scene(Field::Blobs, 16, "f32", &FOG);
    let pane =
        Surface::new(vec![DVec3::ZERO, DVec3::X, DVec3::Y], vec![[0, 1, 2]], [0.1, 0.2, 0.3, 0.5]).unwrap();
    let refused = |scene: &Scene, spec: &str| {
        let scene = GpuScene::new(&gpu, scene.clone());
        let all = drawn(&scene, spec, &views()[0], 2);
        all.into_iter().map(|result| result.unwrap_err().to_string()).collect::<Vec<_>>()
    };
    let maximum = grid.clone().with_mode(Mode::Maximum).unwrap();
    let mesh = Scene::new(Field::Blobs.tets(3).unwrap(), fog());
    let with_pane = grid.clone().with_surfaces(vec![pane]);
    for (scene, spec, why) in [
        (&grid, "shear-warp", "slices-2d draws the same"),
        (&grid, "slabs:resolution=half", "resolution=full"),
        (&grid, "raycast:tolerance=0.01", "set step"),
        (&grid, "slabs:route=raster", "set compute"),
        (&mesh, "splat-ewa", "kernels overlap"),
    ] {
        for message in refused(scene, spec) {
            assert!(message.contains(why) && !message.contains('\n'), "{spec}: {message}");
        }
    }
    for (spec, why) in [
        ("raycast:resolution=half", "resolution=full"),
        ("raycast:tolerance=0.01", "set step"),
        ("shear-warp", "slices-2d draws the same"),
    ] {
        let scene = if spec == "shear-warp" { &with_pane } else { &maximum };
        for message in refused(scene, spec) {
            assert!(message.contains(why) && !message.contains('\n'), "{spec}: {message}");
        }
    }
    let owned = views()[0].with_owned(DVec3::ZERO, DVec3::ONE).unwrap();
    for (scene, spec, why) in [(maximum, "raycast", "do not add up"), (with_pane, "slabs", "surfaces")] {
        let scene = GpuScene::new(&gpu, scene);
        let message = Renderer::new(&scene, technique(spec)).render(&owned).unwrap_err().to_string();
        assert!(message.contains(why) && !message.contains('\n'), "{spec}: {message}");
    }
    let points = Scene::new(Field::Blobs.points(50).unwrap().with_estimated_radius(), fog());
    assert!(KdTree::new(&points, &views()[0], 2).unwrap_err().to_string().contains("kernels"));
    for scene in [&grid, &points] {
        assert!(Shares::new(scene, &views()[0], 0).unwrap_err().to_string().contains("at least 1"));
    }
    // Shares for others.
    let scene = GpuScene::new(&gpu, grid);
    let shares = Shares::new(scene.scene(), &views()[0], 3).unwrap();
    let results = Threads::run(2, |end| render(&scene, technique("slabs"), &views()[0], &shares, &end));
    for result in results {
        let why = result.unwrap_err().to_string();
        assert!(why.contains("3 for 2 ranks"), "{why}");
    }
}

/// Samples that boxes ask for are shared out about evenly, for four scenes and several numbers of ranks; and boxes fill space.
#[test]
fn work_is_shared_out_evenly() {
    let gpu = gpu();
    let sharp =
        TransferFunction::from_rows(&[[0.7, 0.9, 0.4, 0.1, 0.0], [0.9, 1.0, 0.9, 0.2, 30.0]]).unwrap();
    let grid = |field: Field, transfer| Scene::new(field.sample([192; 3], "f32").unwrap(), transfer);
    let all = [
        grid(Field::Blobs, fog()),
        grid(Field::Blobs, sharp.clone()),
        grid(Field::MarschnerLobb, sharp.clone()),
        grid(Field::Ramp, sharp),
    ];
    let [view, ..] = views();
    for scene in all {
        let on_device = GpuScene::new(&gpu, scene.clone());
        let renderer = Renderer::new(&on_device, technique("slabs:stop=0"));
        let samples = |view: &View| {
            let counts = renderer.count(view).unwrap();
            counts.iter().find(|(key, _)| *key == "samples").map_or(0, |(_, n)| *n)
        };
        let alone = samples(&view);
        for ranks in taken(1, [2, 4, 7, 8]) {
            let tree = KdTree::new(&scene, &view, ranks).unwrap();
            for i in 0..200_u16 {
                let place = DVec3::new(f64::from(i % 7), f64::from(i % 11), f64::from(i % 13)) * 0.2 - 1.1;
                let owns = |[low, high]: &&[DVec3; 2]| (place.cmpge(*low) & place.cmplt(*high)).all();
                assert_eq!(tree.boxes().iter().filter(owns).count(), 1, "{place}");
            }
            let owned = |[low, high]: &[DVec3; 2]| samples(&view.with_owned(*low, *high).unwrap());
            let work: Vec<u64> = tree.boxes().iter().map(owned).collect();
            let (most, sum) = (*work.iter().max().unwrap(), work.iter().sum::<u64>());
            println!("{ranks} ranks: {work:?}");
            assert!(4 * most * u64::from(ranks) <= 5 * sum, "{ranks} ranks: {work:?}");
            // Pieces are drawn once; only slabs at the sides of boxes are sampled by both, at their fronts.
            assert!(sum >= alone && 2 * sum <= 3 * alone, "{sum} samples, {alone} of one process");
        }
    }
}

/// The bytes that each rank sends, by the model of docs/scale.md: of every piece that it gives away, and of that which it keeps to the end, 16 for
/// each pixel whose ray meets the boxes that were composited, and 8 for each run of them. The order of ranks is that of visibility.
fn bytes_by_model(seen: &[Vec<bool>]) -> Vec<u64> {
    let bytes = |seen: &[bool]| {
        let runs = (0..seen.len()).filter(|&i| seen[i] && (i == 0 || !seen[i - 1])).count();
        (16 * seen.iter().filter(|&&seen| seen).count() + 8 * (runs + 1)) as u64
    };
    let ranks = seen.len();
    let mut held = seen.to_vec();
    let mut sent = vec![0; ranks];
    let (mut stride, mut rest) = (1, ranks);
    while rest > 1 {
        let k = (2..=rest).find(|k| rest % k == 0).unwrap();
        let before = held.clone();
        for place in 0..ranks {
            let digit = place / stride % k;
            let own = &before[place];
            let piece = |i: usize| own.len() * i / k..own.len() * (i + 1) / k;
            sent[place] += (0..k).filter(|&i| i != digit).map(|i| bytes(&own[piece(i)])).sum::<u64>();
            let group: Vec<usize> = (0..k).map(|i| place + i * stride - digit * stride).collect();
            held[place] = piece(digit).map(|i| group.iter().any(|&member| before[member][i])).collect();
        }
        (stride, rest) = (stride * k, rest / k);
    }
    (0..ranks).map(|place| sent[place] + bytes(&held[place])).collect()
}

/// Ranks send what the model says. The first rank sends no piece of its own at the end.
#[test]
fn bytes_are_those_of_the_model() {
    let gpu = gpu();
    let grid = Field::Blobs.sample([80; 3], "f32").unwrap();
    let [domain, .., end] = grid.corners();
    let visible =
        TransferFunction::from_rows(&[[0.0, 0.1, 0.2, 0.9, 0.3], [1.0, 1.0, 1.0, 0.3, 2.0]]).unwrap();
    let scene = GpuScene::new(&gpu, Scene::new(grid, visible));
    let view = view(perspective(), 1.0, 160, 120);
    for count in [2, 3, 4, 8] {
        let shares = Shares::new(scene.scene(), &view, count).unwrap();
        let Shares::Space(tree) = &shares else { panic!("boxes") };
        let order = tree.order(&view);
        let meets = |rank: &u32| -> Vec<bool> {
            let [low, high] = tree.boxes()[*rank as usize];
            let clip = Clip::none().with_crop(low.max(domain), high.min(end)).unwrap();
            let pixel = |i: u32| {
                let at = glam::DVec2::new(f64::from(i % 160) + 0.5, f64::from(i / 160) + 0.5);
                let (origin, direction) = view.ray(at);
                let [from, to] = clip.range(origin, direction, [0.0, f64::INFINITY]);
                from < to
            };
            (0..160 * 120).map(pixel).collect()
        };
        let seen: Vec<Vec<bool>> = order.iter().map(meets).collect();
        let model = bytes_by_model(&seen);
        let sent = Threads::run(count, |end| {
            let end = Counted::new(end);
            render(&scene, technique("slabs"), &view, &shares, &end).unwrap();
            end.sent()
        });
        for (place, &rank) in order.iter().enumerate().filter(|(_, rank)| **rank > 0) {
            let ratio = sent[rank as usize] as f64 / model[place] as f64;
            println!(
                "{count} ranks: rank {rank} sends {} bytes, {ratio:.3} of the model",
                sent[rank as usize]
            );
            assert!((1.0 / 1.2..1.2).contains(&ratio), "{count} ranks: rank {rank}, {ratio}");
        }
    }
}
