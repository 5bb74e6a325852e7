//! What the integration tests share: a device under validation, standard scenes, comparisons.

#![allow(
    dead_code,
    unused_imports,
    unreachable_pub,
    missing_debug_implementations,
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "test helpers: each test file uses its own part, and a test fails by panicking"
)]

pub mod caller;
pub mod cut;
mod devices;

pub use devices::{TestGpu, emulates, fresh_gpu, gpu, gpu_with, provoked_gpu, undisturbed};
use glam::{DVec2, DVec3};
use volraster::GpuScene;
use volraster::Image;
use volraster::gpu::{Gpu, OptionalFeature};
use volraster::measure::ImageErrors;
use volraster::reference::{self, ReferenceOptions};
use volraster::scene::{Camera, Field, Lighting, Mode, Projection, Scene, SplatRule, TransferFunction, View};
use volraster::technique::{Method, Renderer, Technique};

/// Whether this run takes every case (`make test-all`), and not a selection of each kind (`make test`).
pub fn exhaustive() -> bool {
    std::env::var_os("VOLRASTER_TESTS").is_some_and(|tier| tier == "all")
}

/// The cases of a loop that this run takes: all of them, or every `n`-th. The place of the call decides on the first,
/// so that loops over the same cases take different ones.
#[track_caller]
pub fn taken<T>(n: usize, cases: impl IntoIterator<Item = T>) -> Vec<T> {
    taken_from(std::panic::Location::caller().line() as usize, n, cases)
}

/// The same, where a number decides on the first: that of an outer loop, so that its turns take different cases.
pub fn taken_from<T>(first: usize, n: usize, cases: impl IntoIterator<Item = T>) -> Vec<T> {
    let cases: Vec<T> = cases.into_iter().collect();
    let n = if exhaustive() { 1 } else { n.min(cases.len()).max(1) };
    cases.into_iter().skip(first % n).step_by(n).collect()
}

/// The cases that this run takes: all of them, or the `seed`-th of the first kind, the next of the second, and so on.
pub fn one_of_each<T, K: PartialEq>(seed: usize, cases: Vec<T>, kind: impl Fn(&T) -> K) -> Vec<T> {
    if exhaustive() {
        return cases;
    }
    let mut kinds: Vec<(K, Vec<T>)> = Vec::new();
    for case in cases {
        let of = kind(&case);
        match kinds.iter_mut().find(|(kind, _)| *kind == of) {
            Some((_, alike)) => alike.push(case),
            None => kinds.push((of, vec![case])),
        }
    }
    // Half the seed: of every second kind, which `taken` may leave of them, it would else be always the same route.
    let one = |(i, (_, mut alike)): (usize, (K, Vec<T>))| alike.swap_remove((seed / 2 + i) % alike.len());
    kinds.into_iter().enumerate().map(one).collect()
}

pub const SHELLS: [[f64; 5]; 7] = [
    [0.0, 0.1, 0.2, 0.6, 0.0],
    [0.42, 0.9, 0.4, 0.1, 0.0],
    [0.5, 1.0, 0.8, 0.3, 30.0],
    [0.58, 0.2, 0.6, 0.9, 0.0],
    [0.8, 0.2, 0.6, 0.9, 0.0],
    [0.9, 0.3, 0.4, 1.0, 2.0],
    [1.0, 0.6, 0.2, 0.8, 2.0],
];

pub const FOG: [[f64; 5]; 5] = [
    [0.0, 0.1, 0.2, 0.7, 0.0],
    [0.06, 0.1, 0.2, 0.7, 0.0],
    [0.3, 0.2, 0.6, 0.9, 1.0],
    [0.6, 0.9, 0.85, 0.3, 3.0],
    [1.0, 1.0, 0.25, 0.1, 8.0],
];

pub fn scene(field: Field, n: u32, kind: &str, rows: &[[f64; 5]]) -> Scene {
    Scene::new(field.sample([n, n, n], kind).unwrap(), TransferFunction::from_rows(rows).unwrap())
}

pub fn perspective() -> Projection {
    Projection::Perspective { fov_y_deg: 42.0 }
}

pub fn orthographic() -> Projection {
    Projection::Orthographic { half_height: 1.6 }
}

/// The standard camera at a distance factor: 1 outside, 0.1 inside the cube.
pub fn camera(projection: Projection, distance: f64) -> Camera {
    Camera { eye: DVec3::new(2.0, 1.5, 3.8) * distance, target: DVec3::ZERO, up: DVec3::Y, projection }
}

pub fn view(projection: Projection, distance: f64, width: u32, height: u32) -> View {
    View::new(camera(projection, distance), width, height).unwrap()
}

/// Fails unless two images are the same but for what two pipelines round otherwise: compilers are free to fuse operations.
#[track_caller]
pub fn assert_same_but_for_rounding(image: &Image, other: &Image, what: &str) {
    let apart = ImageErrors::between(image, other).unwrap().all;
    assert!(apart.rmse < 3e-7 && apart.max_abs < 1e-5, "{what}: {apart:?}");
}

/// The routes of a technique that this device offers; the others are named aloud.
pub fn routes_of(gpu: &Gpu, method: Method) -> Vec<&'static str> {
    let offered = |route: &&str| match *route {
        "raster" => gpu.has(OptionalFeature::BlendRgba32f),
        "interlock" => gpu.has(OptionalFeature::FragmentInterlock),
        "implementation-ordered" => gpu.has(OptionalFeature::OrderedStores),
        _ => true,
    };
    for route in method.routes().iter().filter(|route| !offered(route)) {
        println!("skipped: {}/{route}: the device does not offer it", method.name());
    }
    method.routes().iter().copied().filter(offered).collect()
}

/// Every technique that draws a grid's trilinear field by every route that this device offers, with every integrator that it
/// has, of which `make test` takes one for each technique, of both routes some. An option may follow each after a comma.
/// `splat-ewa` is left out: Gaussians are another field.
#[track_caller]
pub fn specs(gpu: &Gpu) -> Vec<String> {
    let seed = std::panic::Location::caller().line() as usize;
    let technique = |spec: &String| spec.split(':').next().map(str::to_string);
    one_of_each(seed, all_specs(gpu), technique)
}

/// The same with every integrator in every run.
pub fn all_specs(gpu: &Gpu) -> Vec<String> {
    let mut specs = Vec::new();
    let grid = scene(Field::Homogeneous(1.0), 2, "f32", &FOG);
    for method in Method::ALL.into_iter().filter(|method| method.fits(&grid)) {
        if method == Method::SplatSheets {
            // One route, which is no option.
            specs.push(format!("{}:sheets=image", method.name()));
            continue;
        }
        for route in routes_of(gpu, method) {
            let integrators = match method {
                // A small 2-D table, because many tests build many.
                Method::Slabs => ["integral", "full,table=128", "exact"].as_slice(),
                Method::Raycast => &["midpoint", "integral", "full,table=128", "exact"],
                _ => &[""],
            };
            for integrator in integrators {
                let option =
                    if integrator.is_empty() { String::new() } else { format!(",integrator={integrator}") };
                // As many lines as the others have.
                let option =
                    if method == Method::ShearWarp { ",intermediate=pixel".to_string() } else { option };
                specs.push(format!("{}:route={route}{option}", method.name()));
            }
        }
    }
    specs
}

/// A small scene of each kind and mode, with every technique that draws it by every route that the device offers; `make test` takes every third.
#[track_caller]
pub fn every_kind(gpu: &Gpu) -> Vec<(std::sync::Arc<GpuScene>, Vec<String>)> {
    let transfer = TransferFunction::from_rows(&FOG).unwrap();
    let shown = |mode| scene(Field::Blobs, 16, "u8", &FOG).with_mode(mode).unwrap();
    let scenes = [
        shown(Mode::Emission),
        Scene::new(Field::Blobs.tets(5).unwrap(), transfer.clone()),
        Scene::new(Field::Blobs.points(300).unwrap().with_estimated_radius(), transfer.clone()),
        shown(Mode::Lit(Lighting::default())),
        shown(Mode::Maximum),
        Scene::new(Field::Blobs.splats(200).unwrap(), transfer).with_rule(SplatRule::Ray),
    ];
    let specs = |scene: &Scene| {
        let methods = Method::ALL.into_iter().filter(|method| method.draws_scene(scene));
        let routes = methods.flat_map(|method| {
            let several = method.routes().len() > 1;
            let spec = move |route: &str| {
                if several { format!("{}:route={route}", method.name()) } else { method.name().to_string() }
            };
            routes_of(gpu, method).into_iter().map(spec)
        });
        routes.collect()
    };
    let first = std::panic::Location::caller().line() as usize;
    let with_specs = |scene: Scene| {
        let specs: Vec<String> = specs(&scene);
        (GpuScene::new(gpu, scene), taken_from(first, 3, specs))
    };
    scenes.map(with_specs).into()
}

/// Whether a pixel is what lies on its own line, and not resampled from lines beside it.
pub fn by_pixel(spec: &str) -> bool {
    technique(spec).method() != Method::ShearWarp
}

/// Whether the technique of a spec has an option.
pub fn has_option(spec: &str, key: &str) -> bool {
    technique(spec).method().options().iter().any(|option| option.key == key)
}

/// A spec with a value for an option that some techniques lack, which are left as they are.
pub fn with_option(spec: &str, key: &str, value: &str) -> String {
    let joint = if spec.contains(':') { ',' } else { ':' };
    if has_option(spec, key) { format!("{spec}{joint}{key}={value}") } else { spec.to_string() }
}

pub fn technique(spec: &str) -> Technique {
    Technique::parse(spec).unwrap()
}

pub fn draw(gpu: &Gpu, scene: &Scene, view: &View, options: &str) -> Image {
    Renderer::new(&GpuScene::new(gpu, scene.clone()), technique(options)).render(view).unwrap()
}

/// The same of a scene that is on the device.
pub fn draw_on(scene: &std::sync::Arc<GpuScene>, view: &View, spec: &str) -> Image {
    Renderer::new(scene, technique(spec)).render(view).unwrap()
}

pub fn truth(scene: &Scene, view: &View) -> reference::ReferenceImage {
    reference::render(scene, view, &ReferenceOptions::default(), None).unwrap()
}

pub fn errors(image: &Image, scene: &Scene, view: &View) -> ImageErrors {
    ImageErrors::between_f64(image, &truth(scene, view)).unwrap()
}

/// Every pixel's centre, row by row.
pub fn pixels(view: &View) -> impl Iterator<Item = (usize, DVec2)> {
    let [width, height] = view.extent();
    let centre = move |i: u32| DVec2::new(f64::from(i % width) + 0.5, f64::from(i / width) + 0.5);
    (0..width * height).map(move |i| (i as usize, centre(i)))
}

/// Length of the part of a ray's range that lies inside the cube [-1, 1]³.
pub fn in_cube(mut range: [f64; 2], origin: DVec3, direction: DVec3) -> f64 {
    for axis in 0..3 {
        let (a, b) = ((-1.0 - origin[axis]) / direction[axis], (1.0 - origin[axis]) / direction[axis]);
        range = [range[0].max(a.min(b)), range[1].min(a.max(b))];
    }
    (range[1] - range[0]).max(0.0)
}

/// Length of the ray inside the cube [-1, 1]³; perspective rays start at the eye.
pub fn chord(view: &View, pixel: DVec2) -> f64 {
    let (origin, direction) = view.ray(pixel);
    let range = [if view.is_perspective() { 0.0 } else { f64::NEG_INFINITY }, f64::INFINITY];
    in_cube(range, origin, direction)
}

/// The error function, by its series.
pub fn erf(x: f64) -> f64 {
    if x.abs() > 5.0 {
        return x.signum();
    }
    let (mut sum, mut term) = (0.0, x);
    for k in 0..120 {
        sum += term / f64::from(2 * k + 1);
        term *= -x * x / f64::from(k + 1);
    }
    sum * 2.0 / std::f64::consts::PI.sqrt()
}

/// Repeatable numbers from -1 to 1.
pub fn random(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from((state >> 33) as u32) / f64::from(1_u32 << 30) - 1.0
    }
}

/// Whether the outline of the cube passes within 1/64 pixel of a pixel's centre.
pub fn on_outline(view: &View, pixel: DVec2) -> bool {
    let hit = chord(view, pixel) > 0.0;
    (0..16).any(|i| {
        let angle = f64::from(i) / 16.0 * std::f64::consts::TAU;
        (chord(view, pixel + DVec2::new(angle.cos(), angle.sin()) / 64.0) > 0.0) != hit
    })
}
