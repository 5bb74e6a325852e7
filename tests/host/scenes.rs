//! The schema of scene files agrees with their reader, and docs/SCENES.md with both.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use volraster::io::{Data, ReadOptions, write_nrrd, write_vtu};
use volraster::scene::Field;
use volraster::technique::{Method, Technique, scene_schema};

use crate::contract::{Block, assert_blocks, read, row};
use crate::folder::{Folder, OPTIONS, SCHEMA, assert_valid_if_accepted, is_accepted};

const PAGE: &str = "docs/SCENES.md";

fn schema() -> Value {
    serde_json::from_str(&scene_schema()).unwrap()
}

/// Objects of a schema with the keys that they allow, each with its place in a scene.
fn objects<'a>(schema: &'a Value, place: &str, found: &mut Vec<(String, &'a Value)>) {
    if schema["additionalProperties"] == false {
        found.push((place.to_string(), schema));
    }
    for (key, value) in schema["properties"].as_object().into_iter().flatten() {
        objects(value, &format!("{place}/{key}"), found);
    }
    if schema["items"].is_object() {
        objects(&schema["items"], &format!("{place}/0"), found);
    }
    schema["anyOf"].as_array().into_iter().flatten().for_each(|any| objects(any, place, found));
}

/// A scene with nothing but a value at a place.
fn at(place: &str, value: Value) -> Value {
    place.rsplit('/').filter(|part| !part.is_empty()).fold(value, |value, part| match part {
        "0" => json!([value]),
        key => json!({key: value}),
    })
}

#[test]
fn the_schema_is_valid() {
    let schema = schema();
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    jsonschema::draft202012::meta::validate(&schema).unwrap();
    // What is wrong is found: the test of the schema works.
    assert!(!jsonschema::draft202012::meta::is_valid(&json!({"required": 1})));
}

/// The reader names the keys that it knows when it refuses another one.
#[test]
fn the_schema_has_the_keys_of_the_reader() {
    let (schema, folder) = (schema(), Folder::new());
    let mut found = Vec::new();
    objects(&schema, "", &mut found);
    for (place, object) in &found {
        let scene = at(place, json!({"?": 0}));
        let error = folder.scene(&scene.to_string()).unwrap_err().to_string();
        let (_, known) = error.split_once("unknown field `?`, expected ").expect(&error);
        let known: BTreeSet<&str> = known.split('`').skip(1).step_by(2).collect();
        let keys: BTreeSet<&str> =
            object["properties"].as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(keys, known, "{place}");
    }
    let places: Vec<&str> = found.iter().map(|(place, _)| place.as_str()).collect();
    assert_eq!(places.len(), 16, "{places:?}");
}

/// Values of an option that its schema allows, and one that it does not.
fn values_of(option: &Value) -> Vec<Value> {
    let mut values = vec![json!("?"), json!(-1), json!([])];
    for any in option["anyOf"].as_array().into_iter().flatten() {
        values.extend(any["enum"].as_array().into_iter().flatten().cloned());
        for bound in ["minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"] {
            if let Some(bound) = any[bound].as_f64() {
                values.extend([-0.5, -1e-9, 0.0, 1e-9, 0.5, 1.0].map(|by| json!(bound + by)));
                values.push(json!(bound.to_string()));
            }
        }
    }
    values
}

#[test]
fn the_schema_has_the_techniques_and_their_options() {
    let schema = schema();
    let technique = &schema["properties"]["technique"];
    let options = |method: Method| {
        let rules = technique["allOf"].as_array().unwrap();
        let rule = rules.iter().find(|rule| rule["if"]["properties"]["name"]["const"] == method.name());
        rule.unwrap()["then"]["properties"].as_object().unwrap()
    };
    let all: BTreeSet<&String> = Method::ALL.into_iter().flat_map(|method| options(method).keys()).collect();
    let technique_of = |method: Method, key: &str, value: &Value| {
        let text = match value {
            Value::String(word) => word.clone(),
            Value::Number(number) if number.is_f64() => number.as_f64().unwrap().to_string(),
            other => other.to_string(),
        };
        Technique::new(method, &[(key.to_string(), text)])
    };
    let (mut accepted, mut refused) = (0, 0);
    for method in Method::ALL {
        assert!(method.options().iter().all(|option| options(method).contains_key(option.key)));
        for key in all.iter().filter(|key| **key != "name") {
            // A technique quotes a key that it does not have.
            let error = technique_of(method, key, &json!("?")).unwrap_err().to_string();
            let is_known = !error.contains(&format!("option \"{key}\""));
            let option = options(method).get(*key);
            assert_eq!(is_known, option.is_some(), "{error}");
            let words = options(method).values().flat_map(values_of).filter(Value::is_string);
            for value in option.map_or(vec![json!(1)], values_of).into_iter().chain(words) {
                let volume = json!({"field": "ramp", "dims": [2, 2, 2]});
                let scene = json!({"volume": volume, "technique": {"name": method.name(), *key: value}});
                let valid = SCHEMA.is_valid(&scene);
                match technique_of(method, key, &value) {
                    Ok(_) => assert!(valid, "{scene}"),
                    // Rules between options are the reader's alone.
                    Err(error) if option.is_none() => assert!(!valid, "{scene}: {error}"),
                    Err(error) => {
                        // The range of a number that is written as text is the reader's alone, too.
                        let own = error.to_string().contains(&format!("option {key}: \""));
                        let is_text = value.as_str().is_some_and(|text| text.parse::<f64>().is_ok());
                        assert!(!valid || !own || is_text, "{scene}: {error}");
                    }
                }
                if valid { accepted += 1 } else { refused += 1 }
            }
        }
    }
    assert!(accepted > 200 && refused > 200, "{accepted} {refused}");
}

/// Scenes in a text: what parses as JSON and has data.
fn scenes_in(text: &str) -> Vec<Value> {
    let starts = text.match_indices('{').map(|(start, _)| &text[start..]);
    let parsed = starts.filter_map(|text| serde_json::Deserializer::from_str(text).into_iter().next()?.ok());
    parsed
        .filter(|value: &Value| {
            ["volume", "mesh", "points", "gaussians"].iter().any(|key| value[key].is_object())
        })
        .collect()
}

/// Texts of the repository under a path.
fn texts(path: &Path, found: &mut Vec<String>) {
    if path.is_dir() {
        fs::read_dir(path).unwrap().for_each(|entry| texts(&entry.unwrap().path(), found));
    } else if ["md", "json", "rs", "sh", "c"].iter().any(|end| path.extension().is_some_and(|e| e == *end)) {
        found.push(fs::read_to_string(path).unwrap());
    }
}

/// Every scene of documents and tools is valid; of those in tests all that the reader accepts.
#[test]
fn the_schema_accepts_the_scenes_of_the_repository() {
    let all = |paths: &[&str]| {
        let mut found = Vec::new();
        paths.iter().for_each(|path| texts(&Path::new(env!("CARGO_MANIFEST_DIR")).join(path), &mut found));
        found.iter().flat_map(|text| scenes_in(text)).collect::<Vec<_>>()
    };
    let examples = all(&["README.md", "assets", "benches", "docs", "examples", "tools"]);
    assert!(examples.len() > 10, "{} examples", examples.len());
    for scene in &examples {
        SCHEMA.validate(scene).unwrap_or_else(|error| panic!("{scene}: {}: {error}", error.instance_path()));
    }
    let folder = Folder::new();
    let literals = all(&["src", "tests"]);
    assert!(literals.len() > 30, "{} literals", literals.len());
    for scene in &literals {
        assert_valid_if_accepted(&folder.write("scene.json", scene.to_string()));
    }
}

/// Scenes that use every object, with data that fits into small memory.
const SEEDS: [&str; 6] = [
    r#"{"$schema": "x", "volume": {"field": "ramp", "dims": [2, 3, 4], "type": "u8"}, "background": [0, 0, 0, 1],
        "transfer": [[0, 0, 0, 0, 0], [1, 1, 1, 1, 1]], "mode": "lit", "lighting": {"shininess": 2, "direction": [1, 0, 0]},
        "camera": {"eye": [3, 2, 4], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 40}, "image": {"width": 8},
        "technique": {"name": "slabs", "step": 2}}"#,
    r#"{"volume": {"file": "a.raw", "dims": [2, 2, 2], "type": "u8", "spacing": [1, 2, 3], "origin": [0, 0, 0],
        "direction": [1, 0, 0, 0, 1, 0, 0, 0, 1], "offset": 1, "endian": "Big"}, "kernels": {"kernel": "tent"},
        "camera": {"eye": [3, 2, 4], "target": [0, 0, 0], "up": [0, 1, 0], "half_height": 2}}"#,
    r#"{"mesh": {"field": "blobs", "cubes": 1}, "transfer": {"preset": "fog", "range": [0, 1], "tau_scale": 2},
        "opaque": [{"box": {"low": [-1, -1, -1], "high": [1, 1, 1]}, "colour": [0, 1, 1], "opacity": 0.5},
                   {"sphere": {"centre": [0, 0, 0], "radius": 1, "subdivisions": 0}, "shade": "flat", "scale": 2}],
        "clip": {"planes": [{"point": [0, 0, 0], "normal": [1, 0, 0]}], "crop": {"low": [null, -1, 0]}}}"#,
    r#"{"points": {"field": "blobs", "count": 9, "radius": 1, "kernel": "gaussian", "cut": 2, "model": "interpolate",
        "least": 0.1}, "transfer": {"file": "knots.json"}}"#,
    r#"{"volume": {"file": "a.raw", "dims": [2, 2, 2], "type": "u8", "offset": 1},
        "transfer": {"isosurface": 3, "colour": [1, 1, 1]}}"#,
    r#"{"gaussians": {"file": "a.splat", "axes": "Rdf", "turn_to": "rub", "rule": "khr"}, "image": {"width": 8}}"#,
];

/// Places of all values in a document.
fn places(value: &Value, place: String, found: &mut Vec<String>) {
    match value {
        Value::Object(map) => {
            map.iter().for_each(|(key, value)| places(value, format!("{place}/{key}"), found))
        }
        Value::Array(all) => {
            all.iter().enumerate().for_each(|(i, value)| places(value, format!("{place}/{i}"), found));
        }
        _ => {}
    }
    found.push(place);
}

/// Whatever one key is replaced by: a scene that the reader accepts is valid by the schema.
#[test]
fn the_schema_accepts_what_the_reader_accepts() {
    let (schema, folder) = (schema(), Folder::new());
    folder.write("a.raw", [0, 1, 2, 3, 4, 5, 6, 7, 8]);
    folder.write("knots.json", "[[0, 0, 0, 0, 0], [1, 1, 1, 1, 1]]");
    folder.write("a.splat", [64; 64]);
    let mut keyed = Vec::new();
    objects(&schema, "", &mut keyed);
    let mut words = BTreeSet::from(["", "?", "a.raw", "BIG", "Uint8", "2"]);
    for text in scene_schema().split('"').map(|word| &*word.to_string().leak()) {
        if text.len() < 16 && !text.contains(['\n', ':', '{', '}']) {
            words.insert(text);
        }
    }
    let mut values: Vec<Value> = words.into_iter().map(Value::from).collect();
    values.extend([json!(null), json!(true), json!([]), json!({}), json!([2, 2, 2]), json!([-1, 0.5, 2])]);
    values.extend([-1.0, -0.5, 0.0, 0.05, 0.5, 1.0, 2.0, 9.5, 180.0, 1e4, 1e300].map(Value::from));
    values.extend([-1, 0, 1, 2, 7, 10, 1024, 1025].map(Value::from));
    let options = ReadOptions::within(1 << 20);
    let (mut accepted, mut refused, mut stricter) = (0, 0, 0);
    let mut try_scene = |scene: &Value| {
        let path = folder.write("scene.json", scene.to_string());
        let valid = SCHEMA.is_valid(scene);
        if is_accepted(&path, &options) {
            assert!(valid, "the reader accepts {scene}: {:?}", SCHEMA.validate(scene));
            accepted += 1;
        } else {
            refused += 1;
            stricter += usize::from(!valid);
        }
    };
    for seed in SEEDS {
        let seed: Value = serde_json::from_str(seed).unwrap();
        assert!(is_accepted(&folder.write("scene.json", seed.to_string()), &options), "{seed}");
        let mut known = Vec::new();
        places(&seed, String::new(), &mut known);
        for place in &known {
            for value in &values {
                let mut scene = seed.clone();
                *scene.pointer_mut(place).unwrap() = value.clone();
                try_scene(&scene);
            }
        }
        for (place, object) in &keyed {
            for key in object["properties"].as_object().unwrap().keys() {
                let mut scene = seed.clone();
                for value in &values {
                    let Some(Value::Object(map)) = scene.pointer_mut(place) else { break };
                    map.insert(key.clone(), value.clone());
                    try_scene(&scene);
                }
            }
        }
    }
    println!("{accepted} accepted, {refused} refused, {stricter} of these by the schema as well");
    assert!(accepted > 1000 && stricter * 10 > refused * 9, "{accepted} {refused} {stricter}");
}

/// Scenes that the reader refuses without looking at data, and the schema too.
#[test]
fn the_schema_refuses_broken_scenes() {
    let volume = r#""volume": {"field": "ramp", "dims": [2, 2, 2]}"#;
    let camera = r#""eye": [3, 2, 4], "target": [0, 0, 0], "up": [0, 1, 0]"#;
    let with = |rest: &str| format!("{{{volume}, {rest}}}");
    let broken = [
        "[]".to_string(),
        "{}".to_string(),
        r#"{"$schema": 1, "volume": {"field": "ramp", "dims": [2, 2, 2]}}"#.to_string(),
        r#"{"volume": {"file": "a.raw", "field": "ramp", "dims": [2, 2, 2]}}"#.to_string(),
        r#"{"volume": {"field": "ramp"}}"#.to_string(),
        r#"{"volume": {"field": "ramp", "dims": [2, 2, 1]}}"#.to_string(),
        r#"{"volume": {"field": "ramp", "dims": [2, 2, 2], "type": "f64"}}"#.to_string(),
        r#"{"volume": {"field": "ramp", "dims": [2, 2, 2], "offset": 1}}"#.to_string(),
        r#"{"volume": {"file": "a.raw", "dims": [2, 2, 2], "type": "int17"}}"#.to_string(),
        r#"{"volume": {"file": "a.raw", "spacing": [1, 1, 1]}}"#.to_string(),
        r#"{"mesh": {"field": "ramp", "cubes": 951}}"#.to_string(),
        r#"{"mesh": {"field": "foam", "cubes": 1}}"#.to_string(),
        r#"{"mesh": {"field": "ramp", "cubes": 1}, "kernels": {"kernel": "tent"}}"#.to_string(),
        r#"{"points": {"field": "ramp", "count": 9, "radius": 0}}"#.to_string(),
        r#"{"points": {"field": "ramp", "count": 9, "cut": 2}, "kernels": {}}"#.to_string(),
        with(r#""mesh": {"field": "ramp", "cubes": 1}"#),
        with(r#""gaussians": {"file": "a.splat"}"#),
        r#"{"gaussians": {"axes": "rdf"}}"#.to_string(),
        r#"{"gaussians": {"file": "a.splat", "axes": "rrr"}}"#.to_string(),
        r#"{"gaussians": {"file": "a.splat", "turn_to": "ruf"}}"#.to_string(),
        r#"{"gaussians": {"file": "a.splat", "rule": "khronos"}}"#.to_string(),
        r#"{"gaussians": {"file": "a.splat"}, "transfer": {"preset": "fog"}}"#.to_string(),
        r#"{"gaussians": {"file": "a.splat"}, "kernels": {}}"#.to_string(),
        with(r#""light": 1"#),
        with(r#""kernels": {"cut": 7}"#),
        with(r#""kernels": {"model": "sum"}"#),
        with(r#""transfer": [[0, 0, 0, 0]]"#),
        with(r#""transfer": []"#),
        with(r#""transfer": [[0, 0, -1, 0, 0]]"#),
        with(r#""transfer": {"preset": "nice"}"#),
        with(r#""transfer": {"preset": "fog", "isosurface": 1}"#),
        with(r#""transfer": {"preset": "fog", "tau_scale": -1}"#),
        with(r#""mode": "mip""#),
        with(r#""mode": "maximum", "lighting": {}"#),
        with(r#""lighting": {"shininess": 0}"#),
        with(&format!(r#""camera": {{{camera}}}"#)),
        with(&format!(r#""camera": {{{camera}, "fov_y_deg": 180}}"#)),
        with(&format!(r#""camera": {{{camera}, "fov_y_deg": 40, "half_height": 1}}"#)),
        with(r#""image": {"width": 0}"#),
        with(r#""image": {"width": 1.5}"#),
        with(r#""background": [0, 0, 0, 2]"#),
        with(r#""opaque": [{}]"#),
        with(r#""opaque": [{"box": {"low": [0, 0, 0]}}]"#),
        with(r#""opaque": [{"sphere": {"centre": [0, 0, 0], "radius": 1, "subdivisions": 10}}]"#),
        with(r#""clip": {"crop": {"low": [0, 0]}}"#),
        with(r#""technique": {"step": 1}"#),
        with(r#""technique": {"name": "slices-4d"}"#),
        with(r#""technique": {"name": "slabs", "step": 0}"#),
        with(r#""technique": {"name": "slabs", "k": 2}"#),
    ];
    let folder = Folder::new();
    for scene in broken {
        let path = folder.write("scene.json", &scene);
        assert!(!is_accepted(&path, &OPTIONS), "the reader accepts {scene}");
        assert!(!SCHEMA.is_valid(&serde_json::from_str(&scene).unwrap()), "the schema accepts {scene}");
    }
    // The scene that they break is fine.
    assert!(is_accepted(&folder.write("scene.json", with(r#""image": {}"#)), &OPTIONS));
    assert!(SCHEMA.is_valid(&serde_json::from_str(&with(r#""image": {}"#)).unwrap()));
}

// ---------------------------------------------------------------------------------------------------
// The page

fn number(value: &Value) -> String {
    value.as_f64().map_or_else(String::new, |number| number.to_string())
}

/// The default of a key as a cell of a table.
fn default_of(value: &Value) -> String {
    match value {
        Value::Null => String::new(),
        Value::Array(all) => format!("[{}]", all.iter().map(number).collect::<Vec<_>>().join(", ")),
        Value::String(word) => format!("`{word}`"),
        other => number(other),
    }
}

/// The values of a key as a cell of a table.
fn values(schema: &Value) -> String {
    let types = schema["type"].as_array().cloned().unwrap_or_else(|| vec![schema["type"].clone()]);
    if let Some(any) = schema["anyOf"].as_array() {
        let any: Vec<String> = any.iter().map(values).filter(|text| !text.is_empty()).collect();
        return any.join(", or ");
    }
    if let Some(words) = schema["enum"].as_array() {
        let words = words.iter().filter_map(Value::as_str).map(|word| format!("`{word}`"));
        return words.collect::<Vec<_>>().join(", ");
    }
    let bound = |words: &str, key: &str| match number(&schema[key]) {
        bound if bound.is_empty() => bound,
        bound => format!("{words} {bound}"),
    };
    let range = || {
        let bounds = [
            bound(" from", "minimum"),
            bound(" above", "exclusiveMinimum"),
            bound(" to", "maximum"),
            bound(", below", "exclusiveMaximum"),
        ];
        bounds.concat()
    };
    let text = match types[0].as_str() {
        Some("string") => "text".to_string(),
        Some("object") => "an object".to_string(),
        Some("number") => format!("number{}", range()),
        Some("integer") => format!("whole number{}", range()),
        Some("array") => {
            let entry = values(schema["prefixItems"].get(0).unwrap_or(&schema["items"]));
            let plural = |one: &str, many: &str| entry.strip_prefix(one).map(|rest| format!("{many}{rest}"));
            let entries = plural("number", "numbers")
                .or_else(|| plural("whole number", "whole numbers"))
                .or_else(|| plural("an object", "objects"))
                .unwrap_or_else(|| format!("lists of {entry}"));
            match (&schema["minItems"], &schema["maxItems"]) {
                (least, most) if least == most && most.is_number() => format!("{most} {entries}"),
                (Value::Null, most) if most.is_number() => format!("up to {most} {entries}"),
                _ => format!("list of {entries}"),
            }
        }
        _ => String::new(),
    };
    if types.contains(&json!("null")) && schema.get("description").is_none() && !text.is_empty() {
        format!("{text}, or null")
    } else {
        text
    }
}

#[test]
fn the_tables_of_keys_follow_from_the_schema() {
    let schema = schema();
    let mut found = Vec::new();
    objects(&schema, "", &mut found);
    let block = |(place, object): (String, &Value)| {
        let name: Vec<&str> = place.split('/').filter(|part| !["", "0"].contains(part)).collect();
        let of = if name.is_empty() { "a scene".to_string() } else { name.join(".") };
        let mut text = "| key | values | default | meaning |\n|---|---|---|---|\n".to_string();
        for (key, value) in object["properties"].as_object().unwrap() {
            let is_needed = object["required"].as_array().is_some_and(|keys| keys.contains(&json!(key)));
            let default = if is_needed { "needed".to_string() } else { default_of(&value["default"]) };
            let meaning = value["description"].as_str().expect(key);
            text.push_str(&row(&[&format!("`{key}`"), &values(value), &default, meaning]));
        }
        Block { mark: format!("keys of {of}"), text }
    };
    assert_blocks(PAGE, found.into_iter().map(block).collect());
}

#[test]
fn the_examples_of_the_page_load() {
    let folder = Folder::new();
    write_nrrd(folder.path("scan.nrrd"), &Field::Blobs.sample([8, 9, 10], "u8").unwrap()).unwrap();
    write_vtu(folder.path("flow.vtu"), &Data::Mesh(Field::Blobs.tets(2).unwrap()), "speed").unwrap();
    folder.write("samples.raw", [7; 64 * 64 * 40 * 2]);
    folder.write("stars.csv", "x,y,z,mass,size\n0,0,0,1,0.5\n1,0,0,2,0.5\n0,1,1,3,0.25\n");
    folder.write("garden.spz", minimal_spz());
    folder.write("skull.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let page = read(PAGE);
    let examples: Vec<&str> =
        page.split("```json\n").skip(1).map(|part| part.split("```").next().unwrap()).collect();
    assert!(examples.len() >= 10, "{} examples", examples.len());
    for example in examples {
        folder.scene(example).unwrap_or_else(|error| panic!("{example}: {error}"));
        assert!(is_accepted(&folder.path("scene.json"), &OPTIONS), "{example}");
    }
}

/// A file of one splat, of version 2.
fn minimal_spz() -> Vec<u8> {
    let mut bytes = b"NGSP\x02\0\0\0\x01\0\0\0\0\x0c\0\0".to_vec();
    bytes.extend([1; 19]);
    crate::formats::support::gzip(&bytes)
}
