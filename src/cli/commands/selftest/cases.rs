//! Cases of the self-test, their results, and the list of all cases.

use serde::Serialize;
use volraster::Result;
use volraster::technique::Method;

use super::limits::{allocation, budget, loops, storage};
use super::pictures::picture;
use super::resources::{passes, resize, scalars, transfer, upload};
use super::subject::Subject;
use super::targets::{caller, flight};
use super::workbench::{Verdict, Workbench};
use crate::cli::input::all_routes;
use crate::cli::output;

/// A check with a name.
pub(super) struct Case {
    pub(super) name: String,
    /// The technique under test; `None` for checks of all or none.
    pub(super) method: Option<Method>,
    pub(super) run: Box<dyn Fn(&Workbench) -> Verdict>,
}

/// The result of a case, as an entry of the report.
#[derive(Clone, Serialize)]
pub(super) struct Done {
    pub(super) name: String,
    pub(super) status: Status,
    pub(super) ms: f64,
    pub(super) detail: String,
    /// Messages that are not allowed.
    pub(super) messages: Vec<String>,
    /// Number of messages that are allowed.
    pub(super) allowed_messages: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Status {
    Ok,
    Fail,
    Skip,
}

impl Done {
    /// Returns a result without messages.
    pub(super) fn new(name: String, status: Status, ms: f64, detail: String) -> Self {
        Self { name, status, ms, detail, messages: Vec::new(), allowed_messages: 0 }
    }

    /// Returns the line on stdout.
    pub(super) fn line(&self) -> String {
        let status = match self.status {
            Status::Ok => "ok",
            Status::Fail => "FAIL",
            Status::Skip => "skip",
        };
        let (name, ms, detail) = (&self.name, self.ms, output::plain(&self.detail));
        format!("{status:4} {name:60} {ms:8.1} ms  {detail}")
    }
}

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

/// Returns the cases that run in this process, in their order.
pub(super) fn all() -> Result<Vec<Case>> {
    let mut cases = Vec::new();
    let mut add = |name: String, method: Method, run: Box<dyn Fn(&Workbench) -> Verdict>| {
        cases.push(Case { name, method: Some(method), run });
    };
    for method in Method::ALL {
        for &(scene, options, bounds) in method.samples() {
            let spec = format!("{}:{options}", method.name());
            let spec = spec.trim_end_matches(':').to_string();
            let subject = Subject::of_sample(scene);
            let data = if subject == Subject::of(method) || scene == "f32" {
                String::new()
            } else {
                format!("@{scene}")
            };
            let name = format!("draw/{spec}{data}");
            add(name, method, Box::new(move |workbench| picture(workbench, subject, &spec, bounds)));
        }
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
    Ok(cases)
}
