//! The documents tell the truth about the tree.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::path::Path;

use volraster::technique::Method;

fn read(name: &str) -> String {
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
