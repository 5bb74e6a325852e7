//! Images of every technique and option, compared with the float64 reference.

use volraster::{GpuScene, Renderer, Technique};

use super::subject::{SIZE, Subject, VIEWS, view};
use super::workbench::{Verdict, Workbench, fail, offered};

/// A subject, a technique, and upper bounds of RMSE and largest error over all views.
pub(super) type Picture = (Subject, &'static str, [f64; 2]);

const F32: Subject = Subject::Grid("f32");

/// Bounds are about twice the errors on lavapipe 22.3.6 and 25.0.7. Bounds below 1e-4 leave only rounding.
#[rustfmt::skip]
pub(super) const PICTURES: &[Picture] = &[
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
    (Subject::Mesh, "abuffer", [1e-6, 4e-6]),
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

/// Compares images from every view, drawn by one plan, with the reference.
pub(super) fn picture(workbench: &Workbench, subject: Subject, spec: &str, bounds: [f64; 2]) -> Verdict {
    // Other cases instrument the shaders of every technique; here only shaders that compile fast are instrumented.
    let gpu = if matches!(subject, Subject::Grid(_)) && !spec.starts_with("splat") {
        workbench.gpu()?
    } else {
        workbench.light()?
    };
    offered(&gpu, spec)?;
    let scene = GpuScene::new(&gpu, subject.scene()?);
    let first = view(VIEWS[0], SIZE)?;
    let mut frames = Renderer::new(&scene, Technique::parse(spec)?).frames(&first)?;
    let mut worst = [0.0_f64; 2];
    for name in VIEWS {
        frames.draw(&view(name, SIZE)?)?;
        let errors = workbench.errors(&frames.read_back()?, (subject, name, SIZE))?;
        worst = std::array::from_fn(|i| worst[i].max(errors[i]));
    }
    let summary = format!(
        "rmse {:.1e} (bound {:.0e}), max {:.1e} (bound {:.0e})",
        worst[0], bounds[0], worst[1], bounds[1]
    );
    if worst[0] <= bounds[0] && worst[1] <= bounds[1] { Ok(summary) } else { fail(summary) }
}
