//! The documents tell the truth about the tree.

#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails by panicking")]

use std::path::Path;

use volraster::technique::{Method, OptionInfo};

pub fn read(name: &str) -> String {
    std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(name)).unwrap()
}

#[test]
fn every_path_in_the_documents_exists() {
    let text = read("docs/ARCHITECTURE.md");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let named = text.split('`').skip(1).step_by(2).filter(|word| {
        let of_the_tree = ["src/", "glsl/", "tests/", "benches/", "tools/", ".ci/", "build.rs", "docs/"];
        of_the_tree.iter().any(|start| word.starts_with(start))
            && !word.contains('*')
            && !word.contains("/x.")
    });
    let paths: Vec<&str> = named.collect();
    assert!(paths.len() > 30, "only {} paths were found", paths.len());
    for path in paths {
        assert!(root.join(path).exists(), "docs/ARCHITECTURE.md names {path}, which does not exist");
    }
}

/// The text between two marks of a document that a test writes.
pub struct Block {
    pub mark: String,
    pub text: String,
}

/// A document has the blocks, or they are written on request.
pub fn assert_blocks(name: &str, blocks: Vec<Block>) {
    let written = read(name);
    let mut document = written.clone();
    for Block { mark, text } in blocks {
        let (before, rest) = document.split_once(&format!("<!-- {mark} -->\n")).expect(&mark);
        let (_, after) = rest.split_once("<!-- end -->\n").unwrap();
        document = format!("{before}<!-- {mark} -->\n{text}<!-- end -->\n{after}");
    }
    if std::env::var_os("VOLRASTER_WRITE_OPTIONS").is_some() {
        std::fs::write(Path::new(env!("CARGO_MANIFEST_DIR")).join(name), document).unwrap();
        return;
    }
    let remake = "VOLRASTER_WRITE_OPTIONS=1 cargo test --test host the_tables_of writes it";
    assert!(document == written, "{name} has other tables; {remake}");
}

pub fn row(cells: &[&str]) -> String {
    format!("| {} |\n", cells.join(" | "))
}

/// Returns values, default and effect of an option as cells of a table.
fn cells(option: &OptionInfo) -> [String; 3] {
    let words = option.words.iter().map(|word| format!("`{word}`"));
    let numbers = option.numbers.iter().map(ToString::to_string);
    let values = words.chain(numbers).collect::<Vec<_>>().join(", ");
    [values, option.default.clone(), option.effect.to_string()]
}

/// Returns the tables of options: those that only one technique has, for each technique, and those that several share.
fn option_tables() -> Vec<Block> {
    let all: Vec<(Method, &OptionInfo)> = Method::ALL
        .into_iter()
        .flat_map(|method| method.options().iter().map(move |o| (method, o)))
        .collect();
    let same = |a: &OptionInfo, b: &OptionInfo| a.key == b.key && cells(a) == cells(b);
    let sharing = |option: &OptionInfo| {
        let methods = all.iter().filter(|(_, other)| same(option, other)).map(|(method, _)| method.name());
        methods.collect::<Vec<_>>()
    };
    let code = |key: &str| format!("`{key}`");
    let mut blocks = Vec::new();
    for method in Method::ALL {
        let (own, shared): (Vec<_>, Vec<_>) = method.options().iter().partition(|o| sharing(o).len() == 1);
        let mut text = String::new();
        if !own.is_empty() {
            text.push_str("| option | values | default | effect |\n|---|---|---|---|\n");
        }
        for option in own {
            let [values, default, effect] = cells(option);
            text.push_str(&row(&[&code(option.key), &values, &default, &effect]));
        }
        let keys: Vec<String> = shared.iter().map(|option| code(option.key)).collect();
        let more = if text.is_empty() { "Options" } else { "\nFurther options" };
        text.push_str(&format!("{more}, see [shared options](#shared-options): {}.\n", keys.join(", ")));
        blocks.push(Block { mark: format!("options of {}", method.name()), text });
    }
    let mut text = "| option | techniques | values | default | effect |\n|---|---|---|---|---|\n".to_string();
    for (i, (_, option)) in all.iter().enumerate() {
        let names = sharing(option);
        if names.len() > 1 && !all[..i].iter().any(|(_, before)| same(option, before)) {
            let [values, default, effect] = cells(option);
            let names: Vec<String> = names.into_iter().map(code).collect();
            text.push_str(&row(&[&code(option.key), &names.join(", "), &values, &default, &effect]));
        }
    }
    blocks.push(Block { mark: "shared options".to_string(), text });
    blocks
}

#[test]
fn the_tables_of_options_follow_from_the_declarations() {
    assert_blocks("docs/TECHNIQUES.md", option_tables());
}

#[test]
fn every_preset_has_its_row_and_picture() {
    let page = read("docs/PRESETS.md");
    for preset in volraster::io::scene_file::PRESETS {
        let row =
            format!("| `{0}` | {1} | ![{0}, head](images/presets/{0}-head.png)", preset.name, preset.purpose);
        assert!(page.contains(&row), "{row}");
        let picture = format!("docs/images/presets/{}-head.png", preset.name);
        assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(&picture).exists(), "{picture}");
    }
}

#[test]
fn every_technique_has_its_row_and_its_options_are_documented() {
    let readme = read("README.md");
    for method in Method::ALL {
        let row = format!("| `{}` |", method.name());
        assert!(readme.contains(&row), "README.md has no row {row}");
        for option in method.options() {
            assert!(!option.effect.is_empty() && !option.values.is_empty() && !option.default.is_empty());
        }
    }
    // The changelog knows it too.
    let changelog = read("CHANGELOG.md");
    assert!(Method::ALL.iter().all(|method| changelog.contains(method.name())));
}
