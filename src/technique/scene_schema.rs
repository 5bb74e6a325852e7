//! The JSON Schema of scene files: that of `io::scene_file`, with the techniques and their options.

use serde_json::{Value, json};

use crate::io::scene_file::Document;
use crate::technique::registry::Method;

/// Returns the JSON Schema (draft 2020-12) of scene files as text. It follows from their reader.
///
/// It allows every scene that the reader accepts, except those with a list of all values in place of an object. It does
/// not know rules that depend on the data or on several numbers.
#[must_use]
pub fn scene_schema() -> String {
    let mut schema = Document::schema();
    let rules = json!({
        "properties": {"name": {
            "description": "Selects the technique.",
            "enum": Method::ALL.map(Method::name),
        }},
        "required": ["name"],
        "allOf": Method::ALL.map(of),
    });
    let technique = schema.pointer_mut("/properties/technique").and_then(Value::as_object_mut);
    if let (Some(technique), Value::Object(rules)) = (technique, rules) {
        technique.extend(rules);
    }
    format!("{schema:#}")
}

/// Returns the rule for the options of a technique.
fn of(method: Method) -> Value {
    let mut options = method.option_schemas();
    options.insert("name".to_string(), json!(true));
    json!({
        "if": {"properties": {"name": {"const": method.name()}}, "required": ["name"]},
        "then": {"properties": options, "additionalProperties": false},
    })
}
