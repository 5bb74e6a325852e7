//! A case of the self-test, and specs of techniques by every route.

use std::sync::Arc;

use volraster::technique::Method;
use volraster::{GpuScene, Result, Technique};

use super::subject::Subject;
use super::workbench::{Verdict, Workbench};

/// A check with a name.
pub(crate) struct Case {
    pub(crate) name: String,
    /// The technique under test; `None` for checks of all or none.
    pub(crate) method: Option<Method>,
    pub(crate) run: Box<dyn Fn(&Workbench) -> Verdict>,
}

impl Case {
    pub(crate) fn new(
        name: impl Into<String>,
        spec: Option<&str>,
        run: impl Fn(&Workbench) -> Verdict + 'static,
    ) -> Result<Self> {
        let method = spec.map(Technique::parse).transpose()?.map(|technique| technique.method());
        Ok(Self { name: name.into(), method, run: Box::new(run) })
    }
}

/// Returns a spec for every technique by every route, other options at their defaults.
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

/// Returns a spec as part of the name of a case.
pub(crate) fn label(spec: &str) -> &str {
    spec.trim_end_matches(':')
}

/// Uploads the scene of a subject.
pub(crate) fn on(gpu: &volraster::Gpu, subject: Subject) -> Result<Arc<GpuScene>> {
    Ok(GpuScene::new(gpu, subject.scene()?))
}
