//! The JSON Schema of options, as scene files hold them.

use serde_json::{Map, Value, json};

use super::draw::TechniqueOptions;
use super::options::{Numbers, OptionInfo, accepted};

/// A number as a scene file may also write it: as text.
const NUMBER: &str = r"^[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?$";

/// Returns the schema of each option that a technique accepts, by key.
pub(crate) fn option_schemas<T: TechniqueOptions>() -> Map<String, Value> {
    let options = accepted::<T>();
    // An option may accept words of another one, which they then set.
    let words = |key: &str| {
        let set = |option: &OptionInfo, word: &str| T::key(key, word) == option.key;
        let all = options.iter().flat_map(|option| option.words.iter().map(move |word| (option, *word)));
        all.filter(|(option, word)| set(option, word)).map(|(_, word)| word).collect::<Vec<_>>()
    };
    options.iter().map(|option| (option.key.to_string(), schema(option, &words(option.key)))).collect()
}

fn schema(option: &OptionInfo, words: &[&str]) -> Value {
    // A scene file may write words such as 0 and true without quotes.
    let bare = words.iter().filter_map(|word| serde_json::from_str::<Value>(word).ok());
    let words: Vec<Value> = words.iter().map(|word| json!(word)).chain(bare).collect();
    let number = option.numbers.map(|numbers| match numbers {
        Numbers::Positive => json!({"type": "number", "exclusiveMinimum": 0}),
        Numbers::BelowOne => json!({"type": "number", "minimum": 0, "exclusiveMaximum": 1}),
        Numbers::Between { least, most } => json!({"type": "number", "minimum": least, "maximum": most}),
        Numbers::Whole { least, most } => json!({"type": "integer", "minimum": least, "maximum": most}),
    });
    let text = number.as_ref().map(|_| json!({"type": "string", "pattern": NUMBER}));
    let words = (!words.is_empty()).then(|| json!({"enum": words}));
    let any: Vec<Value> = words.into_iter().chain(number).chain(text).collect();
    let description = format!("{} Default: {}.", option.effect, option.default);
    json!({"description": description, "anyOf": any})
}
