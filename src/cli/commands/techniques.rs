//! `volraster techniques`: lists the techniques with their routes and options.

use std::fmt::Write as _;

use serde_json::{Value, json};
use volraster::technique::Method;

use crate::cli::outcome::Outcome;
use crate::cli::output;

/// Arguments of `techniques`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// Runs the command.
    ///
    /// # Errors
    ///
    /// [`volraster::Error::Io`] when stdout cannot be written.
    pub(crate) fn run(&self) -> Outcome {
        if self.json {
            output::print_json(&Method::ALL.into_iter().map(json_of).collect())?;
        } else {
            output::print(&Method::ALL.map(text_of).join("\n\n"))?;
        }
        Ok(())
    }
}

fn json_of(method: Method) -> Value {
    json!({
        "name": method.name(),
        "summary": method.summary(),
        "source": method.source(),
        "data": method.data(),
        "routes": method.routes(),
        "options": method.options(),
    })
}

fn text_of(method: Method) -> String {
    let [routes, data] = [method.routes(), method.data()].map(|words| words.join(", "));
    let (name, summary, source) = (method.name(), method.summary(), method.source());
    let mut text = format!("{name}: {summary} ({source})\n  data: {data}\n  routes: {routes}");
    for option in method.options() {
        // Writing into a string cannot fail.
        let _ = write!(
            text,
            "\n  {}={} (default {})\n      {}",
            option.key, option.values, option.default, option.effect
        );
    }
    text
}
