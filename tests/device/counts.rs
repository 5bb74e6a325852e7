//! Counts of samples and fetches: `TargetDesc::with_counts`, `Renderer::count`.

use std::sync::Arc;

use crate::common::*;
use ash::vk;
use glam::DVec3;
use volraster::scene::{Camera, Field, Lighting, Mode, Projection, Surface, View};
use volraster::technique::Renderer;
use volraster::{GpuScene, Offscreen, TargetDesc, TargetMode};

/// Every ray passes through the cube [-1, 1]^3 along z.
fn along_z(pixels: u32) -> View {
    let camera = Camera {
        eye: DVec3::new(0.0, 0.0, 4.0),
        target: DVec3::ZERO,
        up: DVec3::Y,
        projection: Projection::Orthographic { half_height: 0.9 },
    };
    View::new(camera, pixels, pixels).unwrap()
}

/// Samples and fetches of a frame.
fn counts(scene: &Arc<GpuScene>, view: &View, spec: &str) -> Option<[u64; 2]> {
    let counters = Renderer::new(scene, technique(spec)).count(view).unwrap();
    let of = |name| counters.iter().find(|(known, _)| *known == name).map(|(_, count)| *count);
    Some([of("samples")?, of("fetches")?])
}

/// Rays along z of a grid of 33 samples: 32 cells, or 33 slices. A march that takes two samples a turn rounds up.
#[test]
fn rays_along_an_axis_have_the_samples_that_one_can_count() {
    let (gpu, view) = (gpu(), along_z(24));
    let rays: u64 = 24 * 24;
    let scene =
        scene(Field::Homogeneous(1.0), 33, "f32", &[[0.0, 0.5, 0.5, 0.5, 0.1], [1.0, 0.5, 0.5, 0.5, 0.1]]);
    let lit = scene.clone().with_mode(Mode::Lit(Lighting::default())).unwrap();
    let maximum = scene.clone().with_mode(Mode::Maximum).unwrap();
    let [plain, lit, maximum] = [scene, lit, maximum].map(|scene| GpuScene::new(&gpu, scene));
    for (scene, spec, samples, fetches_each) in [
        (&plain, "raycast:step=1", 32, 1),
        (&plain, "raycast:step=2", 16, 1),
        (&plain, "raycast:step=1,filter=exact", 32, 8),
        (&plain, "slices-3d:step=1,filter=exact", 32, 8),
        // Its slab before the first and the one after the last have no length.
        (&plain, "slices-2d:step=slices,filter=exact", 33, 4),
        // The colour of each sample takes six more.
        (&lit, "raycast:step=1", 32 * 7, 1),
        (&maximum, "raycast:step=1", 33, 1),
    ] {
        let spec = format!("{spec},empty-space=march");
        let [found, fetches] = counts(scene, &view, &spec).unwrap();
        assert_eq!(fetches, found * fetches_each, "{spec}");
        assert!((samples * rays..=(samples + 2) * rays).contains(&found), "{spec}: {found} of {rays} rays");
    }
    // Its rays are texels of the intermediate image, with a border.
    let [found, fetches] =
        counts(&plain, &view, "shear-warp:intermediate=1,filter=exact,empty-space=march").unwrap();
    assert!(
        fetches == 4 * found && found % 33 == 0 && (rays..=rays * 5 / 4).contains(&(found / 33)),
        "{found}"
    );
}

/// A frame that counts draws the same image, with the counts of all its marches; raster counts none.
#[test]
fn counting_changes_no_pixel() {
    let (gpu, view) = (gpu(), view(perspective(), 1.0, 61, 43));
    let ball = Surface::sphere(DVec3::new(0.3, 0.2, 0.2), 0.6, [0.9, 0.4, 0.3, 0.5], 3).unwrap();
    let shells = scene(Field::MarschnerLobb, 32, "f32", &SHELLS);
    let cut = GpuScene::new(&gpu, shells.clone().with_surfaces(vec![ball]));
    let shells = GpuScene::new(&gpu, shells);
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let mut image = Offscreen::new(&gpu, format, view.extent()).unwrap();
    for (scene, spec) in [
        (&shells, "raycast:step=0.5"),
        (&shells, "raycast:tolerance=1e-2"),
        (&shells, "slabs:resolution=half,refine=0.05"),
        (&shells, "slices-2d"),
        (&cut, "slices-3d"),
        (&shells, "shear-warp"),
    ] {
        let target = TargetDesc::caller(format, TargetMode::Clear);
        let [without, with] = [target, target.with_counts()].map(|target| {
            let mut plan = Renderer::new(scene, technique(spec)).prepare(&view, &target).unwrap();
            image.draw(&mut plan, [0.0; 4]).unwrap();
            image.finish().unwrap()
        });
        assert_eq!(without.1, with.1, "{spec}");
        let counted = with.0.counters.iter().filter(|(name, _)| ["samples", "fetches"].contains(name));
        assert!(
            counted.clone().count() == 2 && counted.clone().all(|(_, count)| *count > 0),
            "{spec}: {:?}",
            with.0
        );
        assert!(without.0.counters.iter().all(|(name, _)| *name != "samples"), "{spec}: {:?}", without.0);
    }
    let [few, all] = ["slabs:resolution=half", "slabs:resolution=half,refine=0.05"];
    assert!(counts(&shells, &view, few).unwrap()[0] < counts(&shells, &view, all).unwrap()[0]);
    if routes_of(&gpu, volraster::technique::Method::Slabs).contains(&"raster") {
        assert_eq!(counts(&shells, &view, "slabs:route=raster"), None);
    }
}
