//! Frames that use every pipeline: of each kind of data and mode, by each technique and route, with each value of its options, into
//! each kind of target.

use std::sync::Arc;

use ash::vk::Format;
use volraster::glam::DVec3;
use volraster::scene::{
    Camera, Clip, Data, Field, Kernel, Kernels, Lighting, Mode, Model, Projection, Scene, SplatRule, Surface,
    TransferFunction, View,
};
use volraster::technique::{Method, Renderer, Technique};
use volraster::{Error, Gpu, GpuScene, Result, TargetDesc, TargetMode};

use crate::cli::input;

/// Knots beyond those that a uniform block holds.
const MANY_KNOTS: u32 = 2000;

/// Prepares frames whose pipelines the device then has: with `every` variant, or by default options only.
pub(super) fn prepare(gpu: &Gpu, every: bool) -> Result<()> {
    let view = View::new(camera(), 64, 48)?;
    for scene in scenes(every)? {
        let on_gpu = GpuScene::new(gpu, scene);
        for (method, route) in input::all_routes() {
            if !method.draws_scene(on_gpu.scene()) {
                continue;
            }
            let plain = input::by_route(method, route, &[], &[])?;
            try_one(&on_gpu, plain, &view, &TargetDesc::own())?;
            if every {
                for technique in variants(method, route)? {
                    try_one(&on_gpu, technique, &view, &TargetDesc::own())?;
                }
                for (view, target) in targets(&view)? {
                    try_one(&on_gpu, plain, &view, &target)?;
                }
            }
        }
    }
    Ok(())
}

/// Prepares a frame, unless the device or the technique refuses it.
fn try_one(scene: &Arc<GpuScene>, technique: Technique, view: &View, target: &TargetDesc) -> Result<()> {
    match Renderer::new(scene, technique).prepare(view, target) {
        Err(error) if !input::is_refusal(&error) => Err(error),
        _ => Ok(()),
    }
}

fn camera() -> Camera {
    let projection = Projection::Perspective { fov_y_deg: 42.0 };
    Camera { eye: DVec3::new(2.0, 1.5, 3.8), target: DVec3::ZERO, up: DVec3::Y, projection }
}

/// Returns small scenes: one of each kind of data and rule with passes of its own, or with `every` variant one for each property that
/// selects code.
fn scenes(every: bool) -> Result<Vec<Scene>> {
    let transfer = TransferFunction::from_rows(&[[0.0, 0.2, 0.4, 0.9, 0.0], [1.0, 0.9, 0.5, 0.1, 4.0]])?;
    let scene = |data: Data| Scene::new(data, transfer.clone());
    let grid = || Ok::<Data, Error>(Field::Blobs.sample([12, 11, 10], "f32")?.into());
    let mesh = || Ok::<Data, Error>(Field::Blobs.tets(3)?.into());
    let points = || Ok::<Data, Error>(Field::Blobs.points(300)?.with_estimated_radius().into());
    let splats = |rule| Ok::<Scene, Error>(scene(Field::Blobs.splats(8)?.into()).with_rule(rule));
    let mut scenes =
        vec![scene(grid()?), scene(mesh()?), scene(points()?), scene(Field::Blobs.splats(8)?.into())];
    if !every {
        scenes.extend([splats(SplatRule::Ray)?, splats(SplatRule::Overlap)?]);
        return Ok(scenes);
    }
    for (_, rule) in SplatRule::ALL {
        scenes.push(splats(rule)?);
    }
    for kind in ["u8", "u16", "i16"] {
        scenes.push(scene(Field::Blobs.sample([12, 11, 10], kind)?.into()));
    }
    for mode in [Mode::Lit(Lighting::default()), Mode::Maximum] {
        scenes.push(scene(grid()?).with_mode(mode)?);
    }
    for (_, model) in Model::ALL {
        let kernels = |kernel| Kernels { kernel, model, ..Kernels::of_points() };
        for kernel in [Kernel::Gaussian, Kernel::BSpline, Kernel::Tent, Kernel::Sinc] {
            // A kernel with negative lobes has one model only.
            scenes.extend(scene(grid()?).with_kernels(kernels(kernel)).ok());
        }
        scenes.push(scene(mesh()?).with_kernels(kernels(Kernel::Gaussian))?);
        for kernel in [Kernel::Gaussian, Kernel::BSpline] {
            scenes.push(scene(points()?).with_kernels(kernels(kernel))?);
        }
    }
    let rows: Vec<[f64; 5]> =
        (0..MANY_KNOTS).map(|i| [f64::from(i) / f64::from(MANY_KNOTS - 1), 0.9, 0.5, 0.1, 4.0]).collect();
    let many = TransferFunction::from_rows(&rows)?;
    for data in [grid()?, mesh()?, points()?] {
        scenes.push(Scene::new(data, many.clone()));
    }
    let [opaque, translucent] =
        [1.0, 0.5].map(|alpha| Surface::sphere(DVec3::ZERO, 0.5, [0.2, 0.4, 0.6, alpha], 1));
    for surfaces in [vec![opaque?], vec![translucent?]] {
        for data in [grid()?, mesh()?, points()?] {
            scenes.push(scene(data).with_surfaces(surfaces.clone()));
        }
        scenes.push(splats(SplatRule::Khr)?.with_surfaces(surfaces));
    }
    Ok(scenes)
}

/// Returns the settings that differ from the default by one option, for each of its words, and those of the self-test, which combine
/// options and numbers.
fn variants(method: Method, route: &str) -> Result<Vec<Technique>> {
    let mut all = Vec::new();
    for option in method.options().iter().filter(|option| option.key != "route") {
        for word in &option.words {
            // Some words need others beside them.
            if let Ok(technique) = input::by_route(method, route, &[], &[(option.key, word)]) {
                all.push(technique);
            }
        }
    }
    for (_, options, _) in method.samples() {
        let spec = format!("{}:{options}", method.name());
        let technique = Technique::parse(spec.trim_end_matches(':'))?;
        let of_route = |(key, value): &(&str, String)| *key != "route" || value == route;
        if technique.option_pairs().iter().all(of_route) {
            all.push(technique);
        }
    }
    Ok(all)
}

/// Returns views and targets that add passes to a frame.
fn targets(view: &View) -> Result<Vec<(View, TargetDesc)>> {
    let own = TargetDesc::own();
    let clip = Clip::none().with_plane(DVec3::ZERO, DVec3::X)?;
    let mut all = vec![(*view, own.with_depth()), (*view, own.with_counts())];
    all.push((view.with_clip(clip), own));
    let formats = [
        Format::R8G8B8A8_UNORM,
        Format::B8G8R8A8_UNORM,
        Format::B8G8R8A8_SRGB,
        Format::R16G16B16A16_SFLOAT,
        Format::R32G32B32A32_SFLOAT,
    ];
    for format in formats {
        for mode in [TargetMode::Clear, TargetMode::Over] {
            all.push((*view, TargetDesc::caller(format, mode)));
        }
    }
    Ok(all)
}
