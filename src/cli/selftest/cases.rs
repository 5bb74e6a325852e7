//! The cases: pictures against the truth, and each way in which resources come and go.

use std::sync::Arc;

use volraster::Offscreen;
use volraster::ash::vk;
use volraster::gpu::GpuOptions;
use volraster::scene::TetScalars;
use volraster::technique::Method;
use volraster::{GpuScene, Image, Renderer, Result, TargetDesc, TargetMode, Technique};

use super::limits;
use super::session::{self, Place, Session};
use super::stage::{SIZE, Stage, Stop, Subject, VIEWS, Verdict, draw, fail, offered, view};

/// One thing to check.
pub(crate) struct Case {
    pub(crate) name: String,
    /// The technique that it is about; `None` where it is about all or none.
    pub(crate) method: Option<Method>,
    pub(crate) run: Box<dyn Fn(&Stage) -> Verdict>,
}

impl Case {
    pub(crate) fn new(
        name: impl Into<String>,
        spec: Option<&str>,
        run: impl Fn(&Stage) -> Verdict + 'static,
    ) -> Result<Self> {
        let method = spec.map(Technique::parse).transpose()?.map(|technique| technique.method());
        Ok(Self { name: name.into(), method, run: Box::new(run) })
    }
}

/// A technique on a subject, with what its RMSE and its largest error may be over all views.
type Picture = (Subject, &'static str, [f64; 2]);

const F32: Subject = Subject::Grid("f32");

/// Pictures against the float64 reference. Bounds are about twice what lavapipe 22.3.6 and 25.0.7 show; where a bound is below
/// 1e-4, rounding alone is left.
#[rustfmt::skip]
const PICTURES: &[Picture] = &[
    (F32, "slices-2d:route=compute,step=0.25", [1e-3, 2e-2]),
    (F32, "slices-2d:route=raster,step=0.25", [1e-3, 2e-2]),
    (F32, "slices-2d:route=raster,step=0.25,order=front-to-back", [1e-3, 2e-2]),
    (F32, "slices-2d:stacks=all,filter=exact", [3e-2, 0.5]),
    (F32, "slices-3d:route=compute,step=0.25", [3e-4, 4e-3]),
    (F32, "slices-3d:route=compute,step=0.25,empty-space=march,stop=0", [3e-4, 4e-3]),
    (F32, "slices-3d:route=raster,step=0.25", [3e-4, 4e-3]),
    (F32, "slices-3d:route=raster,step=0.5,target=rgba16", [2e-3, 2e-2]),
    (F32, "slices-3d:route=raster,step=0.5,target=rgba16f,order=front-to-back", [4e-3, 2e-2]),
    (F32, "slices-3d:route=raster,target=rgba8,dither=alpha", [7e-3, 8e-2]),
    (F32, "slices-3d:route=raster,target=rgba8,dither=blue,order=front-to-back", [9e-3, 9e-2]),
    (F32, "slices-3d:route=compute,step=0.5,filter=exact", [2e-3, 2e-2]),
    (F32, "slices-3d:route=compute,step=0.5,prefilter=mip", [2e-3, 2e-2]),
    (F32, "slices-3d:route=raster,step=0.5,ends=plane", [3e-3, 5e-2]),
    (F32, "slabs:route=compute,step=0.5", [4e-3, 3e-2]),
    (F32, "slabs:route=raster,step=0.5", [4e-3, 3e-2]),
    (F32, "slabs:route=compute,step=0.5,integrator=full,table=128", [4e-3, 4e-2]),
    (F32, "slabs:route=raster,step=0.5,integrator=exact", [4e-3, 4e-2]),
    (F32, "slabs:route=compute,step=0.25,integrator=exact", [9e-4, 1e-2]),
    (F32, "shear-warp:route=compute,step=0.5,intermediate=pixel", [2e-2, 0.3]),
    (F32, "shear-warp:route=raster,step=0.5,intermediate=pixel", [2e-2, 0.3]),
    (F32, "shear-warp:route=compute,integrator=exact,warp=bicubic,intermediate=2", [2e-2, 0.2]),
    (F32, "shear-warp:route=raster,integrator=integral,warp=mip,intermediate=3,stacks=all", [2e-2, 0.2]),
    (F32, "raycast:step=0.25", [3e-4, 5e-3]),
    (F32, "raycast:step=0.5,integrator=integral", [3e-3, 4e-2]),
    (F32, "raycast:step=0.5,integrator=full,table=128", [4e-3, 4e-2]),
    (F32, "raycast:step=0.25,integrator=exact", [9e-4, 2e-2]),
    (Subject::Grid("u8"), "raycast:step=0.25,integrator=exact", [9e-4, 2e-2]),
    (Subject::Grid("u16"), "slices-3d:route=raster,step=0.25", [3e-4, 4e-3]),
    (Subject::Grid("i16"), "slices-2d:route=compute,step=0.25", [1e-3, 2e-2]),
    (Subject::Mesh, "projected-tets:route=compute", [1e-6, 4e-6]),
    (Subject::Mesh, "projected-tets:route=compute,rank=centroid,integrator=full,table=128", [4e-4, 9e-3]),
    (Subject::Mesh, "projected-tets:route=raster", [1e-6, 4e-6]),
    (Subject::Mesh, "projected-tets:route=raster,plane=space,order=back-to-front", [1e-6, 6e-6]),
    (Subject::Mesh, "projected-tets:route=raster,rank=power,shade=vertex", [0.2, 0.8]),
    (Subject::Mesh, "havs:route=compute", [1e-6, 4e-6]),
    (Subject::Mesh, "havs:route=compute,k=2,chunk=9", [1e-6, 4e-6]),
    (Subject::Mesh, "havs:route=compute,k=3,integrator=integral,order=back-to-front", [2e-2, 0.2]),
    (Subject::Mesh, "havs:route=interlock", [1e-6, 4e-6]),
    (Subject::Mesh, "havs:route=implementation-ordered", [1e-6, 4e-6]),
    (Subject::Mesh, "abuffer:", [1e-6, 4e-6]),
    (Subject::Mesh, "abuffer:integrator=integral,empty-space=march", [2e-2, 0.2]),
    (Subject::Points, "splat-ewa:order=slabs,step=0.25", [4e-5, 4e-4]),
    (Subject::Points, "splat-ewa:order=window", [6e-3, 3e-2]),
    (Subject::Points, "splat-ewa:order=center,pairs=500", [6e-3, 3e-2]),
    (Subject::Gaussians, "splat-ewa:footprint=ewa,filter=none", [0.2, 0.5]),
    (Subject::Points, "splat-sheets:sheets=image,step=0.25", [4e-5, 4e-4]),
    (Subject::Points, "splat-sheets:sheets=image,step=0.5,spread=pixels,pairs=1500", [2e-4, 2e-3]),
    (Subject::Gaussians, "splat-ewa:order=slabs,step=0.25", [2e-4, 7e-4]),
    (Subject::Gaussians, "splat-sheets:sheets=image,step=0.25", [2e-4, 7e-4]),
    (Subject::Gaussians, "splat-sheets:sheets=axis", [4e-2, 0.2]),
    (F32, "splat-sheets:sheets=image,step=0.25,kernel=tent", [4e-4, 5e-3]),
];

/// Every technique by every route; the rest of its options are the defaults.
pub(crate) fn by_route() -> Vec<String> {
    let mut specs = Vec::new();
    for method in Method::ALL {
        let named = method.options().iter().any(|option| option.key == "route");
        for route in method.routes() {
            specs.push(if named {
                format!("{}:route={route}", method.name())
            } else {
                format!("{}:", method.name())
            });
        }
    }
    specs
}

/// A spec as a part of a case's name.
pub(crate) fn label(spec: &str) -> &str {
    spec.trim_end_matches(':')
}

/// All cases, in the order in which they run; with `every_call`, each call of a session fails in turn, and not some of each name.
///
/// # Errors
///
/// None, unless a constant is wrong.
pub(crate) fn all(every_call: bool) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    for &(subject, spec, bounds) in PICTURES {
        let kind = match subject {
            Subject::Grid("f32") => "",
            Subject::Grid(kind) => kind,
            Subject::Gaussians => "gaussians",
            Subject::Mesh | Subject::Points => "",
        };
        let name = if kind.is_empty() {
            format!("draw/{}", label(spec))
        } else {
            format!("draw/{}@{kind}", label(spec))
        };
        cases.push(Case::new(name, Some(spec), move |stage| picture(stage, subject, spec, bounds))?);
    }
    type Check = fn(&Stage, &str) -> Verdict;
    let checks: [(&str, Check); 6] = [
        ("resize", resize),
        ("upload", upload),
        ("transfer", transfer),
        ("flight", flight),
        ("passes", passes),
        ("caller", caller),
    ];
    for (kind, check) in checks {
        for spec in by_route() {
            let of = spec.clone();
            cases.push(Case::new(format!("{kind}/{}", label(&spec)), Some(&spec), move |stage| {
                check(stage, &of)
            })?);
        }
    }
    for spec in by_route()
        .into_iter()
        .filter(|spec| Technique::parse(spec).is_ok_and(|t| Subject::of(t.method()) == Subject::Mesh))
    {
        let of = spec.clone();
        cases.push(Case::new(format!("scalars/{}", label(&spec)), Some(&spec), move |stage| {
            scalars(stage, &of)
        })?);
    }
    cases.extend(limits::cases()?);
    cases.extend(failures(every_call)?);
    Ok(cases)
}

/// A picture against the truth, from every view by one plan.
fn picture(stage: &Stage, subject: Subject, spec: &str, bounds: [f64; 2]) -> Verdict {
    // Every technique's shaders are instrumented in the cases below; here those of small ones.
    let gpu = if matches!(subject, Subject::Grid(_)) && !spec.starts_with("splat") {
        stage.gpu()?
    } else {
        stage.light()?
    };
    offered(&gpu, spec)?;
    let scene = GpuScene::new(&gpu, subject.scene()?);
    let first = view(VIEWS[0], SIZE)?;
    let mut frames = Renderer::new(&scene, Technique::parse(spec)?).frames(&first)?;
    let mut worst = [0.0_f64; 2];
    for name in VIEWS {
        frames.draw(&view(name, SIZE)?)?;
        let errors = stage.errors(&frames.read_back()?, (subject, name, SIZE))?;
        worst = std::array::from_fn(|i| worst[i].max(errors[i]));
    }
    let told = format!(
        "rmse {:.1e} (bound {:.0e}), max {:.1e} (bound {:.0e})",
        worst[0], bounds[0], worst[1], bounds[1]
    );
    if worst[0] <= bounds[0] && worst[1] <= bounds[1] { Ok(told) } else { fail(told) }
}

fn same(what: &str, a: &Image, b: &Image) -> std::result::Result<(), Stop> {
    let bits =
        |image: &Image| -> Vec<[u32; 4]> { image.pixels().iter().map(|p| p.map(f32::to_bits)).collect() };
    if bits(a) == bits(b) { Ok(()) } else { fail(format!("{what}: another picture")) }
}

fn prepared(stage: &Stage, spec: &str) -> std::result::Result<(volraster::Gpu, Technique, Subject), Stop> {
    let gpu = stage.gpu()?;
    offered(&gpu, spec)?;
    let technique = Technique::parse(spec)?;
    Ok((gpu, technique, Subject::of(technique.method())))
}

/// Other image sizes, the least ones too, and back.
fn resize(stage: &Stage, spec: &str) -> Verdict {
    let (gpu, technique, subject) = prepared(stage, spec)?;
    let scene = GpuScene::new(&gpu, subject.scene()?);
    let first = draw(&scene, technique, &view(VIEWS[0], SIZE)?)?;
    for size in [[1, 1], [7, 65], [64, 8]] {
        let image = draw(&scene, technique, &view(VIEWS[0], size)?)?;
        if [image.width(), image.height()] != size || image.pixels().iter().flatten().any(|v| !v.is_finite())
        {
            return fail(format!("{} x {}: not a picture", size[0], size[1]));
        }
    }
    same("the first size again", &first, &draw(&scene, technique, &view(VIEWS[0], SIZE)?)?)?;
    Ok("4 sizes".to_string())
}

/// Another transfer function over the same upload draws what it draws over a new one.
fn transfer(stage: &Stage, spec: &str) -> Verdict {
    let (gpu, technique, subject) = prepared(stage, spec)?;
    let view = view(VIEWS[0], SIZE)?;
    let scene = GpuScene::new(&gpu, subject.scene()?);
    let before = draw(&scene, technique, &view)?;
    let other = scene.with_transfer(subject.other_transfer()?);
    let anew = GpuScene::new(&gpu, other.scene().clone());
    same("over the same samples", &draw(&other, technique, &view)?, &draw(&anew, technique, &view)?)?;
    same("the first transfer function again", &draw(&scene, technique, &view)?, &before)?;
    Ok("as uploaded anew".to_string())
}

/// A scene that goes gives its memory back; uploaded again it is the same.
fn upload(stage: &Stage, spec: &str) -> Verdict {
    let (gpu, technique, subject) = prepared(stage, spec)?;
    let view = view(VIEWS[0], SIZE)?;
    let mut images = Vec::new();
    for _ in 0..3 {
        images.push(draw(&GpuScene::new(&gpu, subject.scene()?), technique, &view)?);
        let held = gpu.memory_report();
        if !held.is_empty() {
            return fail(format!("memory is held by what is gone: {held:?}"));
        }
    }
    same("the second upload", &images[0], &images[1])?;
    same("the third upload", &images[0], &images[2])?;
    Ok("3 times".to_string())
}

/// Other scalars over the same mesh draw what they draw over a new one.
fn scalars(stage: &Stage, spec: &str) -> Verdict {
    let (gpu, technique, subject) = prepared(stage, spec)?;
    let view = view(VIEWS[0], SIZE)?;
    let scene = GpuScene::new(&gpu, subject.scene()?);
    draw(&scene, technique, &view)?;
    let Some(mesh) = scene.scene().mesh() else { return fail("no mesh") };
    let turned = mesh.scalars().values().iter().map(|scalar| 1.0 - scalar).collect();
    let other = scene.with_scalars(TetScalars::Point(turned), subject.other_transfer()?)?;
    let anew = GpuScene::new(&gpu, other.scene().clone());
    same("over the same points", &draw(&other, technique, &view)?, &draw(&anew, technique, &view)?)?;
    Ok("as uploaded anew".to_string())
}

/// A command buffer for each pass draws the same picture.
fn passes(stage: &Stage, spec: &str) -> Verdict {
    let (gpu, technique, subject) = prepared(stage, spec)?;
    let view = view(VIEWS[0], SIZE)?;
    let image = draw(&GpuScene::new(&gpu, subject.scene()?), technique, &view)?;
    let by_pass = stage.open(GpuOptions { command_buffer_by_pass: true, ..GpuOptions::default() })?;
    let parts = draw(&GpuScene::new(&by_pass, subject.scene()?), technique, &view)?;
    same("by pass", &parts, &image)?;
    Ok("as in one command buffer".to_string())
}

/// Three frames in flight, of three views, are the pictures that are drawn one by one.
fn flight(stage: &Stage, spec: &str) -> Verdict {
    let (gpu, technique, subject) = prepared(stage, spec)?;
    let scene = GpuScene::new(&gpu, subject.scene()?);
    let renderer = Renderer::new(&scene, technique);
    let format = vk::Format::R32G32B32A32_SFLOAT;
    let mut flying = Vec::new();
    let mut expected = Vec::new();
    for name in VIEWS {
        let view = view(name, SIZE)?;
        // What a frame needs is known only when one of its view has been drawn.
        expected.push(renderer.render(&view)?);
        let plan = renderer.prepare(&view, &TargetDesc::caller(format, TargetMode::Clear))?;
        flying.push((plan, Offscreen::new(&gpu, format, SIZE)?));
    }
    for _ in 0..2 {
        for (plan, image) in &mut flying {
            image.draw(plan, [0.0; 4])?;
        }
        for ((_, image), expected) in flying.iter_mut().zip(&expected) {
            let (status, bytes) = image.finish()?;
            if !status.complete {
                return fail("a frame is not complete");
            }
            let far = difference(&texels_f32(&bytes), expected, [0.0; 4]);
            if far > 1e-5 {
                return fail(format!("{far:.1e} from the picture that is drawn alone"));
            }
        }
    }
    Ok(format!("{} at a time", VIEWS.len()))
}

fn texels_f32(bytes: &[u8]) -> Vec<[f32; 4]> {
    let number = |b: &[u8]| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
    bytes.chunks_exact(16).map(|t| std::array::from_fn(|c| number(&t[4 * c..4 * c + 4]))).collect()
}

/// The largest difference of texels from a picture that is laid over a colour.
fn difference(texels: &[[f32; 4]], picture: &Image, behind: [f32; 4]) -> f32 {
    let over = |pixel: &[f32; 4], c: usize| pixel[c] + (1.0 - pixel[3]) * behind[c];
    let of = |(texel, pixel): (&[f32; 4], &[f32; 4])| {
        (0..4)
            .map(|c| (texel[c] - over(pixel, c)).abs())
            .fold(0.0, |a: f32, b| if b > a || b.is_nan() { b } else { a })
    };
    if texels.len() != picture.pixels().len() {
        return f32::INFINITY;
    }
    texels.iter().zip(picture.pixels()).map(of).fold(0.0, |a, b| if b > a || b.is_nan() { b } else { a })
}

/// Formats of callers' images, with what rounding to them costs at most: half a code of the result; over something, also of
/// that, of the source and of their product.
const FORMATS: [(vk::Format, [f32; 2]); 3] = [
    (vk::Format::R32G32B32A32_SFLOAT, [1e-5, 1e-5]),
    (vk::Format::R8G8B8A8_UNORM, [0.6 / 255.0, 2.6 / 255.0]),
    (vk::Format::B8G8R8A8_SRGB, [1.1 / 255.0, 3.5 / 255.0]),
];

fn encode(linear: f32) -> f32 {
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}

/// A caller's image of each kind of format, cleared or drawn over.
fn caller(stage: &Stage, spec: &str) -> Verdict {
    let (gpu, technique, subject) = prepared(stage, spec)?;
    let scene = GpuScene::new(&gpu, subject.scene()?);
    let renderer = Renderer::new(&scene, technique);
    let view = view(VIEWS[0], SIZE)?;
    let alone = renderer.render(&view)?;
    let behind = [0.0, 0.5, 0.25, 1.0];
    for (format, bounds) in FORMATS {
        for (mode, bound) in [TargetMode::Clear, TargetMode::Over].into_iter().zip(bounds) {
            let mut plan = renderer.prepare(&view, &TargetDesc::caller(format, mode))?;
            let mut image = Offscreen::new(&gpu, format, SIZE)?;
            image.draw(&mut plan, behind)?;
            let (status, bytes) = image.finish()?;
            let code = |byte: u8| f32::from(byte) / 255.0;
            let under = if mode == TargetMode::Over { behind } else { [0.0; 4] };
            let far = match format {
                vk::Format::R32G32B32A32_SFLOAT => difference(&texels_f32(&bytes), &alone, under),
                vk::Format::R8G8B8A8_UNORM => {
                    let texels: Vec<_> =
                        bytes.chunks_exact(4).map(|t| [t[0], t[1], t[2], t[3]].map(code)).collect();
                    difference(&texels, &alone, under)
                }
                _ => {
                    let texels: Vec<_> =
                        bytes.chunks_exact(4).map(|t| [t[2], t[1], t[0], t[3]].map(code)).collect();
                    let laid = |p: &[f32; 4]| {
                        std::array::from_fn(|c| {
                            let linear = p[c] + (1.0 - p[3]) * under[c];
                            if c < 3 { encode(linear) } else { linear }
                        })
                    };
                    let encoded = Image::new(SIZE[0], SIZE[1], alone.pixels().iter().map(laid).collect())?;
                    difference(&texels, &encoded, [0.0; 4])
                }
            };
            if !status.complete || far.is_nan() || far > bound {
                return fail(format!("{format:?} {mode:?}: {far:.1e} from the volume (bound {bound:.1e})"));
            }
        }
    }
    Ok(format!("{} formats, cleared and over", FORMATS.len()))
}

/// Failures of calls and losses of the device, in sessions of each kind of data and route; some calls of
/// each name, or all.
fn failures(every_call: bool) -> Result<Vec<Case>> {
    type Sweep = fn(&Place, &Session, usize) -> std::result::Result<session::Swept, session::Finding>;
    let sweeps: [(&str, Sweep, usize); 4] = [
        ("frames", session::fail_frames, 8),
        ("failures", session::fail_each, 2),
        ("opening", session::fail_opening, 1),
        ("lost", session::lose, 2),
    ];
    let sweeps = sweeps.map(|(kind, sweep, some)| (kind, sweep, if every_call { usize::MAX } else { some }));
    let mut cases = Vec::new();
    for (kind, sweep, most) in sweeps {
        for session in session::sessions()? {
            // What opens a device is the same for all.
            if kind == "opening" && session.name != "grid-raster" {
                continue;
            }
            let (name, method) = (format!("{kind}/{}", session.name), Some(session.method()));
            let run = move |stage: &Stage| {
                // Advice and instrumented shaders are about other things, and cost time.
                let place = Place { device: stage.device.clone(), validation: stage.plain() };
                let swept = sweep(&place, &session, most).map_err(Stop::Fail)?;
                let failed: u32 = swept.failed.values().sum();
                Ok(format!("{failed} of {} calls, {} kinds", swept.calls, swept.failed.len()))
            };
            cases.push(Case { name, method, run: Box::new(run) });
        }
    }
    Ok(cases)
}

/// The scene of a subject on a device.
pub(crate) fn on(gpu: &volraster::Gpu, subject: Subject) -> Result<Arc<GpuScene>> {
    Ok(GpuScene::new(gpu, subject.scene()?))
}
