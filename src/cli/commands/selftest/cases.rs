//! The list of all cases.

use volraster::technique::Method;
use volraster::{Result, Technique};

use super::case::Case;
use super::limits::{allocation, budget, loops, storage};
use super::pictures::{PICTURES, picture};
use super::resources::{passes, resize, scalars, transfer, upload};
use super::session::{self, Place, Session};
use super::subject::Subject;
use super::targets::{caller, flight};
use super::workbench::{Stop, Verdict, Workbench};
use crate::cli::input::all_routes;

type Check = fn(&Workbench, &str) -> Verdict;

/// Checks of every technique by every route.
const CHECKS: [(&str, Check); 11] = [
    ("resize", resize),
    ("upload", upload),
    ("transfer", transfer),
    ("flight", flight),
    ("passes", passes),
    ("caller", caller),
    ("scalars", scalars),
    ("limits/loop", loops),
    ("limits/storage", storage),
    ("limits/allocation", allocation),
    ("limits/budget", budget),
];

type Sweep = fn(&Place, &Session, usize) -> std::result::Result<session::Swept, String>;

/// Sweeps of failures, with the number of calls of each function that fail.
const SWEEPS: [(&str, Sweep, usize); 4] = [
    ("frames", session::fail_frames, 8),
    ("failures", session::fail_each, 2),
    ("opening", session::fail_opening, 1),
    ("lost", session::lose, 2),
];

/// Returns all cases in the order in which they run. With `every_call`, each Vulkan call of a session fails in turn,
/// instead of a few calls of each function.
pub(super) fn all(every_call: bool) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    let mut add = |name: String, method: Method, run: Box<dyn Fn(&Workbench) -> Verdict>| {
        cases.push(Case { name, method: Some(method), run });
    };
    for &(subject, spec, bounds) in PICTURES {
        let data = match subject {
            Subject::Grid("f32") | Subject::Mesh | Subject::Points => "",
            Subject::Grid(kind) => &format!("@{kind}"),
            Subject::Gaussians => "@gaussians",
        };
        let run = move |workbench: &Workbench| picture(workbench, subject, spec, bounds);
        add(format!("draw/{spec}{data}"), Technique::parse(spec)?.method(), Box::new(run));
    }
    for (kind, check) in CHECKS {
        for (method, route) in all_routes() {
            // Only the scalars of a mesh can be replaced.
            if kind == "scalars" && Subject::of(method) != Subject::Mesh {
                continue;
            }
            let named = method.options().iter().any(|option| option.key == "route");
            let route = if named { format!(":route={route}") } else { String::new() };
            let spec = format!("{}{route}", method.name());
            add(format!("{kind}/{spec}"), method, Box::new(move |workbench| check(workbench, &spec)));
        }
    }
    for (kind, sweep, some) in SWEEPS {
        let most = if every_call { usize::MAX } else { some };
        for session in session::sessions()? {
            // Opening a device does not depend on the session.
            if kind == "opening" && session.name != "grid-raster" {
                continue;
            }
            let (name, method) = (format!("{kind}/{}", session.name), session.technique.method());
            let run = move |workbench: &Workbench| {
                // Best-practice advice and instrumented shaders do not matter here, and cost time.
                let place = Place { device: workbench.device.clone(), validation: workbench.plain() };
                let swept = sweep(&place, &session, most).map_err(Stop::Fail)?;
                let failed: u32 = swept.failed.values().sum();
                Ok(format!("{failed} of {} calls, {} kinds", swept.calls, swept.failed.len()))
            };
            add(name, method, Box::new(run));
        }
    }
    Ok(cases)
}
