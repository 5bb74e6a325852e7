//! A crate outside of this package that depends on the library alone, without the program's dependencies.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// Built from another folder, where this package's `.cargo/config.toml` does not count, against the dependencies that the
/// lock file has; and run.
#[test]
#[ignore = "make test-all: it builds the library once more"]
fn a_dependant_builds_and_draws() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let dependant = root.join("tests/dependant");
    std::fs::copy(root.join("Cargo.lock"), dependant.join("Cargo.lock")).unwrap();
    // target/PROFILE/deps/this
    let target = std::env::current_exe().unwrap().ancestors().nth(3).unwrap().to_path_buf();
    let library = std::env::var_os("SHADERC_LIB_DIR").unwrap_or_else(|| root.join(".deps/shaderc").into());
    let cargo = |command: &str| {
        let mut cargo = Command::new(env!("CARGO"));
        cargo
            .args([command, "--offline", "--manifest-path"])
            .arg(dependant.join("Cargo.toml"))
            .current_dir(std::env::temp_dir())
            .env("CARGO_TARGET_DIR", &target)
            .env("SHADERC_LIB_DIR", &library)
            .env_remove("RUSTC_BOOTSTRAP");
        cargo
    };
    let output = cargo("run").output().unwrap();
    let text = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    assert!(output.status.success(), "{}{}", text[0], text[1]);
    let numbers: Vec<f64> =
        text[0].split(['[', ']', ',', ' ']).filter_map(|word| word.trim().parse().ok()).collect();
    // The name of a device may have numbers, too.
    let pixels = &numbers[numbers.len() - 8..];
    let alpha = 1.0 - (-2.0_f64).exp();
    let want = [alpha, 0.5 * alpha, 0.25 * alpha, alpha, 0.0, 0.0, 0.0, 0.0];
    assert!(pixels.iter().zip(want).all(|(a, b)| (a - b).abs() < 1e-5), "{pixels:?} is not {want:?}");
}

/// The library alone takes few packages, and none that only the program needs.
#[test]
fn the_library_alone_takes_few_packages() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut tree = Command::new(env!("CARGO"));
    tree.args([
        "tree",
        "--offline",
        "--no-default-features",
        "--edges",
        "normal",
        "--prefix",
        "none",
        "--package",
        "volraster",
    ]);
    let output = tree.current_dir(root).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let packages: BTreeSet<&str> = text.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    assert!(packages.iter().any(|package| package.starts_with("volraster v")), "{text}");
    assert!(packages.len() <= 45, "{} packages:\n{text}", packages.len());
    for name in ["clap", "indicatif", "ctrlc", "dicom-object", "exr", "flate2"] {
        assert!(!packages.iter().any(|package| package.starts_with(&format!("{name} "))), "{name}");
    }
}
