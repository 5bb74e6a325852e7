//! Keywords of JSON Schema that structs derive with `#[schemars(transform = ...)]`.
//!
//! The rules between keys treat `null` as a key that is left out, as the reader does.

use schemars::Schema;
use schemars::transform::Transform;
use serde_json::{Map, Value, json};

/// Allows only these words.
pub(super) fn words<'a>(words: impl IntoIterator<Item = &'a str>) -> impl Transform {
    let mut allowed: Vec<Value> = words.into_iter().map(Value::from).collect();
    move |schema: &mut Schema| {
        if schema.get("type").is_some_and(Value::is_array) {
            allowed.push(Value::Null);
        }
        schema.insert("enum".to_string(), allowed.clone().into());
    }
}

/// Returns the names of a list. Attributes of schemars have no closures: it would need other features of `syn`.
pub(super) fn names<T, const N: usize>(list: [(&'static str, T); N]) -> [&'static str; N] {
    list.map(|(name, _)| name)
}

/// Allows words in any case, of which an editor proposes some.
pub(super) fn any_case<'a>(
    proposed: impl IntoIterator<Item = &'a str>,
    words: impl IntoIterator<Item = impl AsRef<str>>,
) -> impl Transform {
    let either =
        |c: char| if c.is_alphabetic() { format!("[{c}{}]", c.to_ascii_uppercase()) } else { c.into() };
    let words = words.into_iter().map(|word| word.as_ref().chars().map(either).collect::<String>());
    let pattern = format!("^({})$", words.collect::<Vec<_>>().join("|"));
    let proposed: Vec<&str> = proposed.into_iter().collect();
    let any = json!([{"enum": proposed}, {"pattern": pattern}]);
    move |schema: &mut Schema| {
        schema.insert("anyOf".to_string(), any.clone());
    }
}

/// Adds keywords to each entry of an array.
pub(super) fn entries(keywords: Value) -> impl Transform {
    move |schema: &mut Schema| {
        let items = schema.get_mut("items").and_then(Value::as_object_mut);
        if let (Some(items), Some(keywords)) = (items, keywords.as_object()) {
            items.extend(keywords.clone());
        }
    }
}

/// Returns the schema of a number that is not negative.
pub(super) fn positive(description: &str) -> Value {
    json!({"type": "number", "minimum": 0, "description": description})
}

/// Adds rules between keys to an object.
pub(super) fn rules(rules: Vec<Value>) -> impl Transform {
    move |schema: &mut Schema| {
        schema.insert("allOf".to_string(), rules.clone().into());
    }
}

/// Requires exactly one of these keys.
pub(super) fn one_of(keys: &[&str]) -> Value {
    json!({"oneOf": keys.iter().map(|key| needs(&[key])).collect::<Value>()})
}

/// Applies a rule where a key is given.
pub(super) fn with(key: &str, rule: Value) -> Value {
    json!({"if": needs(&[key]), "then": rule})
}

/// Requires keys.
pub(super) fn needs(keys: &[&str]) -> Value {
    json!({"required": keys, "properties": each(keys, &json!({"not": {"type": "null"}}))})
}

/// Refuses keys.
pub(super) fn lacks(keys: &[&str]) -> Value {
    json!({"properties": each(keys, &json!({"type": "null"}))})
}

/// Allows only these words for a key.
pub(super) fn only<'a>(key: &str, words: impl IntoIterator<Item = &'a str>) -> Value {
    let allowed = words.into_iter().map(Value::from).chain([Value::Null]);
    json!({"properties": {key: {"enum": allowed.collect::<Value>()}}})
}

fn each(keys: &[&str], schema: &Value) -> Value {
    keys.iter().map(|key| (key.to_string(), schema.clone())).collect::<Map<_, _>>().into()
}
