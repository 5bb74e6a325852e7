//! The list of all cases.

use volraster::technique::Method;
use volraster::{Result, Technique};

use super::case::{Case, by_route, label};
use super::limits;
use super::pictures::picture;
use super::resources::{flight, passes, resize, scalars, transfer, upload};
use super::session::{self, Place, Session};
use super::subject::Subject;
use super::targets::caller;
use super::workbench::{Stop, Verdict, Workbench};

/// Returns all cases in the order in which they run. With `every_call`, each Vulkan call of a session fails in turn,
/// instead of a few calls of each function.
///
/// # Errors
///
/// None, unless a constant is wrong.
pub(crate) fn all(every_call: bool) -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    for method in Method::ALL {
        for &(scene, options, bounds) in method.samples() {
            let (subject, spec) = (Subject::of_sample(scene), format!("{}:{options}", method.name()));
            let suffix = if ["u8", "u16", "i16", "gaussians"].contains(&scene) {
                format!("@{scene}")
            } else {
                String::new()
            };
            cases.push(Case::new(
                format!("draw/{}{suffix}", label(&spec)),
                Some(&spec.clone()),
                move |workbench| picture(workbench, subject, &spec, bounds),
            )?);
        }
    }
    type Check = fn(&Workbench, &str) -> Verdict;
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
            cases.push(Case::new(format!("{kind}/{}", label(&spec)), Some(&spec), move |workbench| {
                check(workbench, &of)
            })?);
        }
    }
    for spec in by_route()
        .into_iter()
        .filter(|spec| Technique::parse(spec).is_ok_and(|t| Subject::of(t.method()) == Subject::Mesh))
    {
        let of = spec.clone();
        cases.push(Case::new(format!("scalars/{}", label(&spec)), Some(&spec), move |workbench| {
            scalars(workbench, &of)
        })?);
    }
    cases.extend(limits::cases()?);
    cases.extend(failures(every_call)?);
    Ok(cases)
}

/// Returns the cases of failing calls and lost devices, for sessions of each kind of data and route.
fn failures(every_call: bool) -> Result<Vec<Case>> {
    type Sweep = fn(&Place, &Session, usize) -> std::result::Result<session::Swept, String>;
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
            // Opening a device does not depend on the session.
            if kind == "opening" && session.name != "grid-raster" {
                continue;
            }
            let (name, method) = (format!("{kind}/{}", session.name), Some(session.method()));
            let run = move |workbench: &Workbench| {
                // Best-practice advice and instrumented shaders do not matter here, and cost time.
                let place = Place { device: workbench.device.clone(), validation: workbench.plain() };
                let swept = sweep(&place, &session, most).map_err(Stop::Fail)?;
                let failed: u32 = swept.failed.values().sum();
                Ok(format!("{failed} of {} calls, {} kinds", swept.calls, swept.failed.len()))
            };
            cases.push(Case { name, method, run: Box::new(run) });
        }
    }
    Ok(cases)
}
