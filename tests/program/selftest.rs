//! `volraster selftest` from outside: what it prints, what its report says, and that it fails where something is wrong.

#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    reason = "a test fails by panicking"
)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(name)
}

fn run(arguments: &[&str], environment: &[(&str, &str)]) -> (Option<i32>, String, String) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_volraster"));
    command.arg("selftest").args(arguments).env("XDG_CACHE_HOME", path("selftest-cache"));
    let Output { status, stdout, stderr } = command.envs(environment.iter().copied()).output().unwrap();
    (status.code(), String::from_utf8(stdout).unwrap(), String::from_utf8(stderr).unwrap())
}

fn report(name: &str) -> Value {
    serde_json::from_slice(&std::fs::read(path(name)).unwrap()).unwrap()
}

fn status<'a>(report: &'a Value, case: &str) -> &'a str {
    let cases = report["cases"].as_array().unwrap();
    cases.iter().find(|found| found["name"] == case).unwrap()["status"].as_str().unwrap()
}

#[test]
fn a_few_cases_pass_and_are_reported() {
    let file = path("selftest.json");
    let arguments =
        ["--filter", "draw/raycast:step=0.25", "--filter", "upload/slices-3d", "-o", file.to_str().unwrap()];
    let (code, out, err) = run(&arguments, &[]);
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(out.contains("missing: none") && out.contains("ok   draw/raycast:step=0.25 "), "{out}");
    let report = report("selftest.json");
    assert_eq!(report["schema"], "volraster-selftest/1");
    for kind in ["core", "leaks", "synchronization", "gpu-assisted", "best-practices"] {
        assert_eq!(report["validation"][kind], true, "{kind}");
        assert_eq!(status(&report, &format!("validation/{kind}")), "ok");
    }
    assert!(report["device"]["name"].is_string() && report["layer"].is_string());
    assert_eq!(report["failed"], 0);
    assert_eq!(report["whole"], false);
    let cases = report["cases"].as_array().unwrap();
    assert_eq!(report["passed"].as_u64().unwrap() as usize, cases.len());
    // Five controls, three pictures, two routes of an upload, the end.
    let drawn = cases.iter().filter(|case| case["name"].as_str().unwrap().starts_with("draw/")).count();
    assert_eq!([drawn, cases.len()], [3, 11], "{cases:#?}");
    let advice = report["allowed"].as_array().unwrap();
    assert!(advice.iter().any(|entry| entry["matched"].as_u64().unwrap() > 0), "{advice:#?}");
}

#[test]
fn a_fault_in_a_case_fails_it() {
    let file = path("selftest-fault.json");
    let arguments =
        ["--filter", "upload/slabs", "--provoke", "slabs:route=compute", "-o", file.to_str().unwrap()];
    let (code, out, err) = run(&arguments, &[]);
    assert_eq!(code, Some(1), "{out}{err}");
    assert!(err.contains("selftest: 1 of 8 cases failed"), "{err}");
    let report = report("selftest-fault.json");
    assert_eq!(status(&report, "upload/slabs:route=compute"), "fail");
    assert_eq!(status(&report, "upload/slabs:route=raster"), "ok");
    let failed = &report["cases"].as_array().unwrap().iter().find(|case| case["status"] == "fail").unwrap();
    assert!(failed["messages"][0].as_str().unwrap().contains("VUID-VkBufferCreateInfo-size-00912"));
}

/// Without the layer every control fails: nothing is skipped in silence. Unless that is asked for, and then it is told.
#[test]
fn a_missing_layer_fails_unless_it_is_not_wanted() {
    let empty = path("selftest-no-layers");
    std::fs::create_dir_all(&empty).unwrap();
    let empty = empty.to_str().unwrap();
    let without = [("VK_LAYER_PATH", empty), ("VK_ADD_LAYER_PATH", empty)];
    let (code, out, _) = run(&["--filter", "upload/raycast"], &without);
    assert_eq!(code, Some(1), "{out}");
    assert!(out.contains("on: none; missing: core, leaks, synchronization"), "{out}");
    assert!(out.contains("VK_LAYER_KHRONOS_validation is not installed"), "{out}");
    let (code, out, _) = run(&["--filter", "upload/raycast", "--without-validation"], &without);
    assert_eq!(code, Some(0), "{out}");
    assert!(out.contains("skip validation/core") && out.contains("ok   upload/raycast"), "{out}");
    // By googletest's protocol as well, whatever was asked for.
    let (code, out, _) = run(&["--gtest_filter=upload.raycast"], &without);
    assert_eq!(code, Some(1), "{out}");
    assert!(
        out.contains("[  FAILED  ] validation.core") && out.contains("[       OK ] upload.raycast"),
        "{out}"
    );
}

#[test]
fn cases_are_listed_by_name_and_technique() {
    let (code, out, _) = run(&["--list", "--technique", "havs,abuffer"], &[]);
    assert_eq!(code, Some(0));
    assert!(out.lines().count() > 20 && out.lines().all(|line| line.contains('/')), "{out}");
    assert!(out.contains("failures/mesh-lists") && !out.contains("raycast"), "{out}");
    let (code, _, err) = run(&["--filter", "no such case"], &[]);
    assert_eq!(code, Some(2), "{err}");
    let (code, _, err) = run(&["--technique", "none"], &[]);
    assert_eq!(code, Some(2), "{err}");
    // The protocol of googletest has options of its own.
    for (option, of_protocol, environment) in [
        (&["--filter", "slabs"][..], &["--gtest_filter=*"][..], &[][..]),
        (&["--technique", "slabs"], &["--gtest_list_tests"], &[]),
        (&["--output", "x.json"], &[], &[("GTEST_OUTPUT", "xml:x.xml")]),
        (&["--list"], &[], &[("GTEST_FILTER", "*")]),
    ] {
        let (code, _, err) = run(&[option, of_protocol].concat(), environment);
        assert!(code == Some(2) && err.contains(option[0]) && err.lines().count() == 1, "{code:?} {err}");
    }
}

/// Baselines of suites name these tests: a name that disappears is a change that the CHANGELOG tells of.
#[test]
fn the_names_of_googletest_are_those_of_the_list() {
    let (code, out, err) = run(&["--gtest_list_tests"], &[]);
    assert_eq!(code, Some(0), "{err}");
    let list = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program/googletest-names.txt");
    if std::env::var_os("VOLRASTER_WRITE_NAMES").is_some() {
        std::fs::write(&list, &out).unwrap();
    }
    let known = std::fs::read_to_string(list).unwrap();
    assert_eq!(out, known, "VOLRASTER_WRITE_NAMES=1 writes the list anew");
}

/// Returns the results of a run by the protocol, as runners read them: the word in brackets after each `[ RUN      ]`.
fn googletest_results(out: &str) -> Vec<(&str, &str)> {
    let mut results = Vec::new();
    let mut current = None;
    for line in out.lines() {
        if let Some(name) = line.strip_prefix("[ RUN      ] ") {
            assert_eq!(current.replace(name), None, "a test begins inside of another: {line}");
        } else if let (Some(name), Some((word, rest))) =
            (current, line.split_once("] ").filter(|_| line.contains('[')))
        {
            assert!(rest.starts_with(name), "{line}");
            results.push((name, word.trim_start_matches('[').trim()));
            current = None;
        }
    }
    assert_eq!(current, None, "{out}");
    results
}

#[test]
fn runners_of_googletest_get_lines_reports_and_exit_codes() {
    let (json, xml) = (path("selftest-gtest.json"), path("selftest-gtest.xml"));
    let filter = "--gtest_filter=upload.slabs*:validation.core";
    let report = format!("--gtest_output=json:{}", json.display());
    let fault = ["--provoke", "upload/slabs:route=compute", "--without-validation"];
    let (code, out, err) = run(&[filter, &report, "--gtest_color=no", fault[2]], &[]);
    assert_eq!(code, Some(0), "{out}{err}");
    let core = ("validation.core", "SKIPPED");
    let [compute, raster] = ["upload.slabs/route_compute", "upload.slabs/route_raster"];
    assert_eq!(googletest_results(&out), [core, (raster, "OK"), (compute, "OK")], "{out}");
    assert!(
        out.contains("[==========] 3 tests from 2 test suites ran.") && out.contains("[  PASSED  ] 2 tests.")
    );
    let report: Value = serde_json::from_slice(&std::fs::read(&json).unwrap()).unwrap();
    assert_eq!([&report["tests"], &report["failures"]], [3, 0]);
    assert_eq!(report["testsuites"][0]["testsuite"][0]["result"], "SKIPPED");
    assert_eq!(report["testsuites"][1]["testsuite"][1]["name"], "slabs/route_compute");

    let report = format!("--gtest_output=xml:{}", xml.display());
    let (code, out, err) = run(&[filter, &report, fault[0], fault[1]], &[]);
    assert_eq!(code, Some(1), "{out}{err}");
    assert!(err.contains("selftest: 1 of 3 cases failed"), "{err}");
    assert_eq!(
        googletest_results(&out),
        [("validation.core", "OK"), (raster, "OK"), (compute, "FAILED")],
        "{out}"
    );
    assert!(out.contains(&format!("[  FAILED  ] 1 test, listed below:\n[  FAILED  ] {compute}")), "{out}");
    let report = std::fs::read_to_string(&xml).unwrap();
    assert!(report.contains(r#"<testsuites tests="3" failures="1" disabled="0" errors="0""#), "{report}");
    assert!(
        report.contains(r#"<testcase name="slabs/route_compute" status="run" result="completed""#),
        "{report}"
    );
    assert!(report.contains("<failure message=\"1 validation messages, the first VUID-"), "{report}");
}

#[test]
fn shards_of_googletest_take_each_test_once() {
    let status = path("selftest-shard");
    let shard = |index: &str| {
        let environment = [
            ("GTEST_TOTAL_SHARDS", "3"),
            ("GTEST_SHARD_INDEX", index),
            ("GTEST_FILTER", "*raycast*"),
            ("GTEST_SHARD_STATUS_FILE", status.to_str().unwrap()),
        ];
        run(&["--gtest_list_tests"], &environment)
    };
    let whole = run(&["--gtest_list_tests", "--gtest_filter=*raycast*"], &[]).1;
    let tests = |out: &str| out.lines().filter(|line| line.starts_with("  ")).count();
    let parts: Vec<usize> = ["0", "1", "2"].map(|index| tests(&shard(index).1)).into();
    assert_eq!(parts.iter().sum::<usize>(), tests(&whole));
    assert!(parts.iter().all(|part| part.abs_diff(tests(&whole) / 3) <= 1), "{parts:?}");
    assert!(status.exists(), "the file that tells a runner of shards is missing");
    let (code, _, err) = shard("3");
    assert_eq!(code, Some(2), "{err}");
    assert!(err.contains("GTEST_TOTAL_SHARDS") && err.lines().count() == 1, "{err}");
    let (code, out, _) = run(&["--gtest_filter=no.test"], &[]);
    assert_eq!(code, Some(0), "{out}");
    assert!(out.contains("[==========] Running 0 tests from 0 test suites."), "{out}");
}

/// Refusals for an emulated limit are no failures, and the fallbacks of missing features draw.
#[test]
fn emulated_limits_show_fallbacks_and_refusals() {
    let file = path("selftest-emulated.json");
    let cases = ["--filter", "upload/slabs", "--filter", "draw/havs:route", "-o", file.to_str().unwrap()];
    let emulated = ["--emulate", "no-features,loop=2000,subgroup=4,buffer=320KiB"];
    let (code, out, err) = run(&[&emulated[..], &cases[..]].concat(), &[]);
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(out.contains("the device lacks blend-rgba32f: accumulation in registers"), "{out}");
    let drawn = report("selftest-emulated.json");
    assert_eq!(status(&drawn, "upload/slabs:route=raster"), "skip");
    assert_eq!(status(&drawn, "upload/slabs:route=compute"), "ok");
    assert_eq!(status(&drawn, "draw/havs:route=compute"), "ok");
    let (code, out, _) = run(&[&["--emulate", "memory=4KiB"], &cases[..]].concat(), &[]);
    assert_eq!(code, Some(0), "{out}");
    assert_eq!(status(&report("selftest-emulated.json"), "upload/slabs:route=compute"), "skip");
    let (code, _, err) = run(&["--emulate", "loop=none"], &[]);
    assert_eq!(code, Some(2), "{err}");
    assert!(err.contains("\"loop=none\": must be as-hardware, ") && err.lines().count() == 1, "{err}");
}
