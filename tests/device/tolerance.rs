//! `tolerance` of `raycast`: each tile of the image takes the step that the error of the image calls for.

use crate::common::*;
use glam::DVec3;
use volraster::GpuScene;
use volraster::gpu::GpuOptions;
use volraster::measure::ImageErrors;
use volraster::scene::{Clip, Field, Lighting, Mode, Scene, Surface, View};
use volraster::technique::{Renderer, Technique};

/// Scenes that are smooth, that have thin shells, light, cuts.
fn scenes() -> Vec<(&'static str, Scene, View)> {
    let outside = view(perspective(), 1.0, 128, 128);
    let blobs = || scene(Field::Blobs, 32, "f32", &FOG);
    let shells = || scene(Field::MarschnerLobb, 64, "f32", &SHELLS);
    let clip = Clip::none().with_plane(DVec3::new(0.1, 0.0, 0.0), DVec3::X).unwrap();
    let ball = Surface::sphere(DVec3::new(0.3, 0.2, 0.2), 0.6, [0.9, 0.4, 0.3, 0.5], 3).unwrap();
    vec![
        ("shells", shells(), outside),
        (
            "u8",
            scene(Field::MarschnerLobb, 48, "u8", &SHELLS.map(|[s, r, g, b, tau]| [255.0 * s, r, g, b, tau])),
            outside,
        ),
        ("inside", shells(), view(perspective(), 0.1, 128, 120)),
        ("parallel", shells(), view(orthographic(), 1.0, 121, 128)),
        ("fog", scene(Field::MarschnerLobb, 64, "f32", &FOG), outside),
        ("clipped", shells(), outside.with_clip(clip)),
        ("lit", blobs().with_mode(Mode::Lit(Lighting::default())).unwrap(), outside),
        ("translucent", shells().with_surfaces(vec![ball]), outside),
    ]
}

/// The RMSE is 0.3 to 1 times the target in most images, and less where the greatest step has less. Steps twice too great would have
/// four times the error, and steps half as great a quarter: 2 and 0.3 are nearer to 1.
#[test]
fn images_have_the_error_that_was_asked_for() {
    let gpu = gpu();
    // Marches that a dispatch cannot end are split; the finest of the steps that are compared are left out.
    let limited = gpu_with(GpuOptions { loop_limit: Some(1500), ..GpuOptions::default() });
    for (name, scene, view) in taken(2, scenes()) {
        let truth = truth(&scene, &view);
        let scenes = [GpuScene::new(&gpu, scene.clone()), GpuScene::new(&limited, scene)];
        let error = |scene, spec: &str| {
            ImageErrors::between_f64(&draw_on(scene, &view, spec), &truth).unwrap().all.rmse
        };
        for target in [1e-2, 3e-3, 1e-3] {
            for (device, scene) in ["whole", "split"].into_iter().zip(&scenes) {
                let found = error(scene, &format!("raycast:tolerance={target}"));
                println!("{name} {device}: {:.2} of {target:e}", found / target);
                assert!(found <= 2.0 * target, "{name} {device}: {found:e} for {target:e}");
                let greatest = error(scene, "raycast:step=8");
                assert!(found >= 0.3 * target.min(greatest), "{name} {device}: {found:e} for {target:e}");
            }
        }
    }
}

/// Each tile of an image is that of the image with its step: a plan that turns keeps nothing of the view before.
#[test]
fn steps_follow_the_view() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::MarschnerLobb, 32, "f32", &SHELLS));
    let renderer = Renderer::new(&scene, technique("raycast:tolerance=3e-3"));
    let first = view(perspective(), 1.0, 83, 70);
    let mut frames = renderer.frames(&first).unwrap();
    for degrees in [0.0, 70.0, 200.0] {
        let turned = View::new(first.camera().orbit(degrees).unwrap(), 83, 70).unwrap();
        frames.draw(&turned).unwrap();
        assert_eq!(
            frames.read_back().unwrap().pixels(),
            renderer.render(&turned).unwrap().pixels(),
            "{degrees}"
        );
    }
}

/// Pixels that are drawn once more take the steps of the whole image.
#[test]
fn redrawn_pixels_are_those_of_the_whole_image() {
    let gpu = gpu();
    let scene = GpuScene::new(&gpu, scene(Field::MarschnerLobb, 32, "f32", &SHELLS));
    let view = view(perspective(), 1.0, 83, 70);
    let whole = draw_on(&scene, &view, "raycast:tolerance=3e-3");
    let redrawn = draw_on(&scene, &view, "raycast:tolerance=3e-3,resolution=half,refine=1e-9");
    let pairs = || whole.pixels().iter().zip(redrawn.pixels());
    let equal = pairs().filter(|(a, b)| a == b).count();
    // What is not redrawn is black.
    let black = |pixel: &[f32; 4]| pixel.iter().all(|value| value.abs() < 1e-6);
    assert!(pairs().all(|(a, b)| a == b || black(a)), "{equal} of {} equal", whole.pixels().len());
}

#[test]
fn what_has_no_steps_is_refused() {
    let gpu = gpu();
    let error = Technique::parse("raycast:tolerance=1e-3,step=2").unwrap_err().to_string();
    assert!(error.contains("tolerance") && error.contains("leave out step"), "{error}");
    let maximum = scene(Field::Blobs, 8, "f32", &FOG).with_mode(Mode::Maximum).unwrap();
    let renderer = Renderer::new(&GpuScene::new(&gpu, maximum), technique("raycast:tolerance=1e-3"));
    let error = renderer.render(&view(perspective(), 1.0, 16, 16)).unwrap_err();
    assert!(error.to_string().contains("tolerance"), "{error}");
    assert_eq!(error.exit_code(), 2);
}
