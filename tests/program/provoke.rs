//! `volraster provoke`: what layers hear, and `docs/FAULTS.md`, whose table is made here: `VOLRASTER_WRITE_FAULTS=1` writes it.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::{Value, json};

const HEAD: &str = "\
# Faults

Each row is a mistake that volume renderers make, committed by `volraster provoke` in a process of its own, and the identifier of the
message that two versions of the Khronos validation layer give. [VALIDATION.md](VALIDATION.md#faults) explains the command.
`VOLRASTER_WRITE_FAULTS=1 tools/test.sh --all -- heard_by_both` writes this table. Without the variable, the test fails if the table differs.

";

/// A new layer lies beside the data that tests share.
fn newer_layer() -> Option<PathBuf> {
    let layer = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/tools/validation-layer-1.4.359");
    layer.exists().then_some(layer)
}

/// Runs the command; returns its exit code, its report and the lines of stderr.
fn provoke(name: &str, arguments: &[&str], layer: Option<&Path>) -> (Option<i32>, Value, String) {
    let report = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let mut command = Command::new(env!("CARGO_BIN_EXE_volraster"));
    command.arg("provoke").args(arguments).arg("-o").arg(&report);
    if let Some(layer) = layer {
        // Debian 12's loader filters the extension by which the layer takes its settings.
        command.env("VK_LAYER_PATH", layer).env("VK_LOADER_DISABLE_INST_EXT_FILTER", "1");
    }
    let output = command.output().unwrap();
    let value = std::fs::read(&report).map_or(Value::Null, |bytes| serde_json::from_slice(&bytes).unwrap());
    (output.status.code(), value, String::from_utf8(output.stderr).unwrap())
}

#[test]
fn faults_are_heard_also_where_the_driver_hangs() {
    let names =
        ["empty-buffer", "upload-then-read", "semaphore-never-signalled", "k-buffer-without-interlock"];
    let (code, report, err) = provoke("faults.json", &[&names[..], &["--timeout", "5"]].concat(), None);
    assert_eq!(code, Some(0), "{err}");
    let faults = report["faults"].as_array().unwrap();
    assert_eq!(faults.iter().map(|fault| fault["name"].as_str().unwrap()).collect::<Vec<_>>(), names);
    for fault in &faults[..3] {
        assert!(
            fault["heard"].as_str().unwrap().starts_with(fault["expected"][0].as_str().unwrap()),
            "{fault}"
        );
    }
    assert_eq!(faults[0]["end"], "ok");
    assert!(faults[3]["heard"].is_null() && faults[3]["rule"].as_str().unwrap().contains("Data Race"));
    assert_eq!(report["schema"], "volraster-provoke/1");
    assert!(report["layer"].is_string() && report["device"]["name"].is_string());
}

#[test]
fn a_fault_that_was_heard_before_is_missed() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let faults = ["empty-buffer", "k-buffer-without-interlock"];
    let before = |file: &str, text: &str| {
        let path = folder.join(file);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_string()
    };
    let heard = |names: [Option<&str>; 2]| {
        let faults = [0, 1].map(|i| json!({ "name": faults[i], "heard": names[i] }));
        json!({ "faults": faults }).to_string()
    };
    let run = |baseline: &str| {
        let (code, _, err) =
            provoke("faults-lost.json", &[&faults[..], &["--baseline", baseline]].concat(), None);
        (code, err)
    };
    let (code, err) = run(&before("faults-same.json", &heard([Some("VUID"), None])));
    assert_eq!(code, Some(0), "{err}");
    let (code, err) = run(&before("faults-more.json", &heard([Some("VUID"), Some("SYNC-HAZARD")])));
    assert!(code == Some(1) && err.contains("missed now: k-buffer-without-interlock"), "{code:?} {err}");
    let (code, err) = run(&before("faults-none.json", "{\n}"));
    assert!(code == Some(2) && err.contains("faults-none.json") && err.contains("line 2"), "{code:?} {err}");
}

#[test]
fn wrong_names_and_missing_layers_are_told() {
    let (code, report, err) = provoke("faults-name.json", &["no-fault"], None);
    assert_eq!((code, report), (Some(2), Value::Null), "{err}");
    assert!(err.contains("\"no-fault\": is no fault") && err.lines().count() == 1, "{err}");
    let empty = Path::new(env!("CARGO_TARGET_TMPDIR")).join("no-layers");
    std::fs::create_dir_all(&empty).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_volraster"));
    let output = command
        .args(["provoke", "empty-buffer"])
        .env("VK_LAYER_PATH", &empty)
        .env("VK_ADD_LAYER_PATH", &empty)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(3));
    assert!(String::from_utf8(output.stderr).unwrap().contains("VK_LAYER_KHRONOS_validation"));
    let output = Command::new(env!("CARGO_BIN_EXE_volraster")).args(["provoke", "--list"]).output().unwrap();
    assert!(String::from_utf8(output.stdout).unwrap().lines().count() > 60);
}

/// The table of the document is what both layers give.
#[test]
#[ignore = "make test-all"]
fn faults_are_heard_by_both_layers_as_the_document_says() {
    let Some(newer) = newer_layer() else {
        eprintln!("skipped: there is no second layer");
        return;
    };
    let reports = [None, Some(newer.as_path())].map(|layer| provoke("faults-all.json", &["all"], layer).1);
    let mut table = String::from(HEAD);
    let layers = reports.each_ref().map(|report| report["layer"].as_str().unwrap());
    table += &format!("| fault | mistake | layer {} | layer {} |\n|---|---|---|---|\n", layers[0], layers[1]);
    let [first, second] = reports.each_ref().map(|report| report["faults"].as_array().unwrap());
    assert!(first.len() >= 30 && first.len() == second.len());
    for (a, b) in first.iter().zip(second) {
        let message =
            |fault: &Value| fault["heard"].as_str().map_or("missed".to_string(), |id| format!("`{id}`"));
        let rule = a["rule"].as_str().unwrap();
        let what = a["what"].as_str().unwrap();
        let rule = if rule.is_empty() { String::new() } else { format!(" (rule: {rule})") };
        table += &format!(
            "| `{}` | {what}{rule} | {} | {} |\n",
            a["name"].as_str().unwrap(),
            message(a),
            message(b)
        );
        assert!(
            a["heard"].is_string() || b["heard"].is_string() || !rule.is_empty(),
            "no layer hears {}, and it cites no rule",
            a["name"]
        );
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/FAULTS.md");
    if std::env::var_os("VOLRASTER_WRITE_FAULTS").is_some() {
        std::fs::write(&path, &table).unwrap();
    }
    assert_eq!(
        std::fs::read_to_string(path).unwrap(),
        table,
        "VOLRASTER_WRITE_FAULTS=1 writes docs/FAULTS.md anew"
    );
}
