//! Case.

use std::sync::Arc;

use volraster::technique::Method;
use volraster::{GpuScene, Result, Technique};

use super::subject::Subject;
use super::workbench::{Verdict, Workbench};

/// One thing to check.
pub(crate) struct Case {
    pub(crate) name: String,
    /// The technique that it is about; `None` where it is about all or none.
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

/// The scene of a subject on a device.
pub(crate) fn on(gpu: &volraster::Gpu, subject: Subject) -> Result<Arc<GpuScene>> {
    Ok(GpuScene::new(gpu, subject.scene()?))
}
