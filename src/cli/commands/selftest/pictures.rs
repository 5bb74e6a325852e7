//! Images of the samples of every technique, compared with the float64 reference.

use volraster::{GpuScene, Renderer, Technique};

use super::subject::{SIZE, Subject, VIEWS, view};
use super::workbench::{Stop, Verdict, Workbench, fail, offered};

/// Compares images from every view, drawn by one plan, with the reference.
pub(super) fn picture(workbench: &Workbench, subject: Subject, spec: &str, bounds: [f64; 2]) -> Verdict {
    let gpu = workbench.gpu()?;
    offered(&gpu, spec)?;
    // The error of fans in space is that of the rasteriser's grid, and their bound that of the usual one.
    if spec.contains("plane=space") && gpu.subpixel_bits() < 8 {
        let why = format!("the rasteriser rounds corners to 1/{} pixel", 1 << gpu.subpixel_bits());
        return Err(Stop::Skip(format!("{why}: the bound is for 1/256")));
    }
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
