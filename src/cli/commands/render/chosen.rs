//! The report of an automatic choice.

use serde_json::{Value, json};
use volraster::choice::{Choice, Estimate, Goal, Source, Trial, TrialOutcome};

use crate::cli::load::Load;
use crate::cli::output;

/// Probability that the bound of an estimated error holds.
const CONFIDENCE: f64 = 0.95;

/// Describes an automatic choice, which took `ms` milliseconds, and its trials.
pub(super) fn json(choice: &Choice, goal: Option<Goal>, ms: f64, load: Option<&Load>) -> Value {
    let trial = |trial: &Trial| {
        let (measured, refused) = match &trial.outcome {
            TrialOutcome::Drawn { error: Estimate { rmse, bound, pixels }, ms } => {
                (json!({"rmse": rmse, "rmse_bound": bound, "pixels": pixels, "ms": ms}), None)
            }
            TrialOutcome::Refused(why) => (Value::Null, Some(why)),
        };
        output::without_nulls(json!({
            "technique": trial.spec,
            "predicted": {"rmse": trial.predicted_error, "ms": trial.predicted_ms},
            "measured": measured,
            "refused": refused,
        }))
    };
    let (max_error, budget) = match goal {
        Some(Goal::MaxError(rmse)) => (Some(rmse), None),
        Some(Goal::Budget(ms)) => (None, Some(ms)),
        None => (None, None),
    };
    output::without_nulls(json!({
        "other_processors": load.and_then(Load::others),
        "max_error": max_error,
        "budget_ms": budget,
        "chosen": choice.trials.get(choice.chosen).map(|trial| &trial.spec),
        "candidates": choice.candidates,
        "confidence": CONFIDENCE,
        "predictions": source(choice.source),
        "search_ms": ms,
        "trials": choice.trials.iter().map(trial).collect::<Value>(),
    }))
}

fn source(source: Source) -> &'static str {
    match source {
        Source::BuiltIn => "built in",
        Source::Measured => "measured on this device",
    }
}

/// Returns the line about an automatic choice.
pub(super) fn line(choice: &Choice, load: Option<&Load>) -> String {
    let Some((Estimate { rmse, bound, pixels }, ms)) = choice.measured() else {
        return String::new();
    };
    let spec = choice.trials.get(choice.chosen).map_or("", |trial| &trial.spec);
    format!(
        "chosen: {spec}, the best of {} settings; error {rmse:.2e}, below {bound:.2e} with 95 % confidence, at {pixels} pixels; \
         {ms:.1} ms; {} tried, predictions {}{}",
        choice.candidates,
        choice.trials.len(),
        source(choice.source),
        load.and_then(Load::note).map_or_else(String::new, |note| format!("; {note}"))
    )
}
