//! What `compare` and `bench` leave for reading: report, tables, plots, comparisons of runs, the cache of references.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use std::path::Path;
use std::process::{Command, Stdio};

use crate::folder::{Folder, Run};
use serde_json::Value;

const GRID: &str = r#"{
  "volume": {"field": "marschner-lobb", "dims": [12, 12, 12], "type": "f32"},
  "transfer": {"preset": "shells", "range": [0, 1]},
  "camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 42},
  "image": {"width": 24, "height": 16}
}"#;

const MESH: &str = r#"{
  "mesh": {"field": "blobs", "cubes": 2},
  "transfer": {"preset": "fog", "range": [0, 1]},
  "camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "half_height": 1.6},
  "image": {"width": 24, "height": 16}
}"#;

/// Pictures in a page, decoded.
fn pictures(html: &str) -> Vec<image::RgbImage> {
    use base64::Engine as _;
    let decode = |rest: &str| {
        let bytes =
            base64::engine::general_purpose::STANDARD.decode(rest.split('"').next().unwrap()).unwrap();
        image::load_from_memory(&bytes).unwrap().to_rgb8()
    };
    html.split("data:image/png;base64,").skip(1).map(decode).collect()
}

#[test]
fn a_report_shows_every_technique_and_says_what_it_refused() {
    let folder = Folder::new();
    folder.write("a&b.json", MESH);
    let out = folder.run("compare a&b.json -o out --validate").done().out;
    let html = folder.text("out/report.html");
    let errors = folder.json("out/errors.json");
    let errors = errors.as_array().unwrap();
    for name in ["havs-compute", "abuffer", "projected-tets-compute"] {
        assert!(html.contains(&format!("id=\"{name}\"")), "{name}");
    }
    // The truth; picture and error of each.
    let pictures = pictures(&html);
    assert_eq!(pictures.len(), 1 + 2 * errors.len());
    assert!(pictures.iter().all(|picture| picture.dimensions() == (24, 16)));
    let apart = |a: u8, b: u8| a.abs_diff(b);
    let off = pictures[0].iter().zip(pictures[1].iter()).map(|(&a, &b)| apart(a, b)).max().unwrap();
    assert!(off <= 1 && pictures[0].iter().any(|&code| code > 40), "{off}");
    let refused = out.lines().filter(|line| line.starts_with("skipped: ")).count();
    assert_eq!(html.contains("<h2>Not drawn</h2>"), refused > 0);
    assert!(html.contains("a&amp;b.json") && !html.contains("a&b"), "{html}");
    for entry in errors {
        assert!(entry["device_bytes"].as_u64().unwrap() > 0, "{entry}");
        assert_eq!(
            entry.get("gpu_ms").is_some(),
            !entry["passes_ms"].as_object().unwrap().is_empty(),
            "{entry}"
        );
    }
}

#[test]
fn a_reference_is_drawn_once() {
    let folder = Folder::new();
    folder.write("grid.json", GRID);
    let line = "compare grid.json -o out --techniques raycast:step=0.5";
    let is_cached = || folder.text("out/report.html").contains("reference (cached)");
    let cached = || folder.names("cache/volraster/reference");
    folder.run(&format!("{line} --no-cache")).done();
    assert!(cached().is_empty() && !is_cached());
    folder.run(line).done();
    let first = folder.json("out/errors.json")[0]["errors"].clone();
    let [name] = &cached()[..] else { panic!("{:?}", cached()) };
    assert!(!is_cached());
    folder.run(line).done();
    assert!(is_cached());
    assert_eq!(folder.json("out/errors.json")[0]["errors"], first);
    // Another size is another image, and a file that is damaged is drawn anew.
    folder.run(&format!("{line} --size 8x8")).done();
    assert_eq!((cached().len(), is_cached()), (2, false));
    let path = folder.path("cache/volraster/reference").join(name);
    let whole = std::fs::read(&path).unwrap();
    std::fs::write(&path, &whole[..whole.len() - 1]).unwrap();
    folder.run(line).done();
    assert!(!is_cached());
    assert_eq!(folder.json("out/errors.json")[0]["errors"], first);
    assert_eq!(std::fs::read(&path).unwrap(), whole);
}

#[test]
#[ignore = "make test-all"]
fn a_folder_of_scenes_is_benched_with_tables_and_plots() {
    let folder = Folder::new();
    folder.write("scenes/grid.json", GRID);
    folder.write("scenes/mesh.json", MESH);
    folder.write("scenes/odd.json", "{\"volume\": 7}");
    let Run { code, out, err, .. } = folder.run("bench scenes -o out --frames 2 --csv");
    assert_eq!(code, 0, "{err}");
    assert!(err.lines().count() == 1 && err.contains("skipped: ") && err.contains("odd.json"), "{err}");
    assert!(
        out.contains("fronts of grid.json perspective") && out.contains("fronts of mesh.json orthographic")
    );
    let cases = folder.json_lines("out/bench.jsonl");
    assert_records(&folder, &cases);
    let table = folder.text("out/bench.csv");
    assert_eq!(table.lines().count(), cases.len() + 1);
    assert!(
        table.starts_with("scene,projection,width,height,")
            && table.contains("\ngrid.json,perspective,24,16,grid,1728,")
    );
    for (scene, kind, elements) in [("grid.json", "grid", 1728), ("mesh.json", "mesh", 40)] {
        let own: Vec<&Value> = cases.iter().filter(|case| case["scene"] == scene).collect();
        assert!(own.iter().all(|case| case["data"] == kind && case["elements"] == elements), "{scene}");
        // What a file says of its size holds.
        assert!(own.iter().all(|case| case["size"] == serde_json::json!([24, 16])));
        assert!(own.iter().any(|case| case["device_bytes"].as_u64().is_some_and(|bytes| bytes > 0)));
    }
    for case in cases.iter().filter(|case| case.get("skipped").is_none()) {
        let wall = &case["wall_ms"];
        // Disturbed frames are repeated, up to as many again; all count where fewer than two were not disturbed.
        let disturbed = case["disturbed"].as_str().map_or([0, 2], |text| {
            let words: Vec<&str> = text.split(' ').collect();
            [words[0], words[2]].map(|number| number.parse().unwrap())
        });
        let [disturbed, frames]: [usize; 2] = disturbed;
        let quiet = frames - disturbed;
        assert_eq!(
            wall["times"].as_array().unwrap().len(),
            if quiet >= 2 { quiet } else { frames },
            "{case}"
        );
        assert!(frames <= 4, "{case}");
        let [low, median, high] = ["low", "median", "high"].map(|key| wall[key].as_f64().unwrap());
        assert!(low <= median && median <= high, "{case}");
    }
    let has = |technique: &str, route: &str, options: &[(&str, &str)]| {
        cases.iter().any(|case| {
            case["technique"] == technique
                && case["route"] == route
                && options.iter().all(|(key, value)| case["options"][key] == *value)
        })
    };
    assert!(has("projected-tets", "compute", &[("rank", "centroid")]));
    assert!(has("projected-tets", "compute", &[("rank", "power")]));
    for plane in ["image", "space"] {
        for shade in ["fragment", "vertex"] {
            assert!(
                has("projected-tets", "raster", &[("plane", plane), ("shade", shade)]),
                "{plane} {shade}"
            );
        }
    }
    let table = folder.text("out/table.md");
    for part in [
        "## grid.json, perspective, 24 x 16",
        "## mesh.json, orthographic, 24 x 16",
        "| tets/s | fragments/s |",
        "| empty-space: march → skip | slabs | compute |",
        "| prefilter: none → mip | raycast | compute |",
        "| dither: none → blue | slices-3d | raster |",
        "| filter: hardware → exact | slices-2d | raster |",
        "| stop: 0 → 0.01 | slices-3d | compute |",
        "| repair: none → exact | havs | compute |",
    ] {
        assert!(table.contains(part), "{part}: {table}");
    }
    assert!(!table.contains("was stopped"));
    for scene in ["grid.json-perspective", "mesh.json-orthographic"] {
        let svg = folder.text(&format!("out/fronts-{scene}.svg"));
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{svg}");
        assert!(table.contains(&format!("(fronts-{scene}.svg)")), "{table}");
    }
    // With timestamps, each pass has its time.
    let timed = cases.iter().any(|case| case.get("gpu_ms").is_some());
    assert_eq!(folder.names("out").iter().any(|name| name.starts_with("passes-")), timed);
}

#[test]
#[ignore = "make test-all"]
fn suites_are_chosen_by_name_and_sizes_have_a_plot() {
    let folder = Folder::new();
    folder.run("bench smoke -o out --only blobs-tets,no-such --frames 1 --within 1h").done();
    let cases = folder.json_lines("out/bench.jsonl");
    assert!(cases.iter().all(|case| case["scene"] == "blobs-tets-12" && case["family"] == "blobs-tets"));
    let names = folder.names("out");
    assert!(names.contains(&"size-pixels-blobs-tets-12-perspective.svg".to_string()), "{names:?}");
    assert!(!names.iter().any(|name| name.ends_with(".png")), "{names:?}");
    assert!(names.contains(&"fronts-blobs-tets-12-perspective-96x96.svg".to_string()), "{names:?}");
    folder.run("bench smoke -o out --only no-such").fails(2, &["--only", "no-such"]);
    folder.run("bench").fails(2, &["--output"]);
}

/// Records are as their schema says, in which every field has a description.
fn assert_records(folder: &Folder, records: &[Value]) {
    let schema = folder.run("bench --schema").done().json();
    let parts = schema["$defs"].as_object().unwrap().values().chain([&schema]);
    let properties = parts.flat_map(|part| part["properties"].as_object().unwrap());
    let silent: Vec<&String> = properties
        .filter(|(_, property)| property.get("description").is_none())
        .map(|(name, _)| name)
        .collect();
    assert!(silent.is_empty(), "{silent:?}");
    let schema = jsonschema::draft202012::new(&schema).unwrap();
    for record in records {
        let errors: Vec<String> = schema.iter_errors(record).map(|error| error.to_string()).collect();
        assert!(errors.is_empty(), "{record}: {errors:?}");
        assert_eq!(record["schema"], 1);
        assert_eq!(record["run"]["device_uuid"].as_str().unwrap().len(), 32, "{record}");
        let is_drawn = record.get("skipped").is_none() && record.get("failed").is_none();
        assert_eq!(record["image"].as_str().map(str::len), is_drawn.then_some(16), "{record}");
    }
}

/// A line of bench.jsonl.
fn line(technique: &str, step: f64, times: &[f64]) -> String {
    let spread =
        serde_json::json!({"median": 0.0, "low": 0.0, "high": 0.0, "p10": 0.0, "p90": 0.0, "times": times});
    let line = serde_json::json!({
        "scene": "grid", "projection": "perspective", "size": [8, 8], "technique": technique, "route": "compute",
        "options": {"step": step}, "errors": {"all": {"rmse": 1e-3}}, "wall_ms": spread,
    });
    line.to_string()
}

#[test]
fn runs_are_compared_case_by_case() {
    let folder = Folder::new();
    let steps = [0.5, 1.0, 2.0];
    let run = |times: [f64; 5]| -> Vec<String> {
        let of = |technique| steps.map(|step| line(technique, step, &times.map(|ms| ms * step)));
        [of("slices-3d"), of("raycast")].concat()
    };
    let first = run([10.0, 10.1, 9.9, 10.2, 9.8]);
    // Twice as slow, and one case fewer.
    let second = run([20.0, 20.2, 19.8, 20.4, 19.6])[1..].to_vec();
    folder.write("a.jsonl", first.join("\n"));
    folder.write("b.jsonl", second.join("\n"));
    let text = folder.run("bench --compare a.jsonl b.jsonl -o out").done().out;
    let json = folder.json("out/ratios.json");
    assert_eq!(json["cases"].as_array().unwrap().len(), 5);
    let near = |value: &Value, wanted: f64| (value.as_f64().unwrap() / wanted - 1.0).abs() < 1e-9;
    for case in json["cases"].as_array().unwrap() {
        assert!(near(&case["ratio"], 2.0) && case["outside_noise"] == true, "{case}");
        let [low, high] = ["low", "high"].map(|key| case[key].as_f64().unwrap());
        assert!(low < 2.0 && 2.0 < high && low > 1.9 && high < 2.1, "{case}");
    }
    let means = json["means"].as_array().unwrap();
    let names: Vec<&str> = means.iter().map(|mean| mean["technique"].as_str().unwrap()).collect();
    assert_eq!(names, ["slices-3d", "raycast", "all"]);
    assert!(means.iter().all(|mean| near(&mean["ratio"], 2.0)), "{means:?}");
    assert!(text.contains("geometric mean") && text.contains("Timed in A alone: 1"), "{text}");
    assert!(text.contains("+ slower (5), - faster (0)") && text.contains("of 5 cases"), "{text}");
    // With itself nothing is beyond noise.
    let text = folder.run("bench --compare a.jsonl a.jsonl").done().out;
    assert!(text.contains("+ slower (0), - faster (0)") && text.contains("of 6 cases"), "{text}");

    // Exit codes for programs that watch.
    folder.run("bench --compare a.jsonl b.jsonl --fail-above 150%").done();
    folder.run("bench --compare b.jsonl a.jsonl --fail-above 5%").done();
    folder
        .run("bench --compare a.jsonl b.jsonl --fail-above 5%")
        .complains(4, &["5 cases slower by more than 5 %"]);
    folder.write("c.jsonl", first[1].replace("0.001", "0.002"));
    folder
        .run("bench --compare a.jsonl c.jsonl --fail-above 5")
        .complains(5, &["image of 1 case has changed", "grid"]);
    folder.run("bench --compare a.jsonl b.jsonl --fail-above x").fails(2, &["--fail-above", "percentage"]);

    folder.write("broken.jsonl", format!("{}\nnonsense\n{}\n", first[0], first[1]));
    folder.write("other.jsonl", first[0].replace("grid", "other"));
    folder.run("bench --compare a.jsonl gone.jsonl").fails(2, &["gone.jsonl", "cannot read"]);
    folder.run("bench --compare broken.jsonl b.jsonl").fails(2, &["broken.jsonl", "line 2"]);
    folder.run("bench --compare a.jsonl other.jsonl").fails(2, &["no timed case in common"]);
    folder.run("bench --compare a.jsonl").fails(2, &["--compare"]);
    folder.run("bench smoke --compare a.jsonl b.jsonl").fails(2, &["--compare", "SUITE"]);
}

/// Ctrl-C ends a run soon, with all that it had.
#[cfg(unix)]
#[test]
fn a_run_that_is_stopped_keeps_what_it_has() {
    let folder = Folder::new();
    folder.write("scenes/1.json", GRID);
    // Long enough to be stopped in.
    let long = GRID.replace("12, 12, 12", "96, 96, 96").replace("\"width\": 24", "\"width\": 640");
    folder.write("scenes/2.json", long.replace("\"height\": 16", "\"height\": 480"));
    let mut command = folder.command("bench scenes -o out --frames 3");
    let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let lines = || std::fs::read_to_string(folder.path("out/bench.jsonl")).unwrap_or_default();
    for _ in 0..6000 {
        if lines().ends_with('\n') {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let stopped = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(stopped.success());
    let output = child.wait_with_output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{err}");
    assert!(err.contains("stopped; partial results are in out"), "{err}");
    let cases = folder.json_lines("out/bench.jsonl");
    assert_records(&folder, &cases);
    assert!(cases.iter().any(|case| case["scene"] == "1.json" && case.get("wall_ms").is_some()));
    assert!(folder.text("out/table.md").contains("was stopped"));
    assert!(folder.names("out").contains(&"fronts-1.json-perspective.svg".to_string()));
    // Cases of the scene that was not measured to its end have times, or a reason why not, or are not there.
    for case in cases.iter().filter(|case| case["scene"] == "2.json") {
        assert!(case.get("wall_ms").is_some() || case.get("skipped").is_some(), "{case}");
    }
}

/// The profile of the Phoronix Test Suite: what its launcher prints is what its parsers look for.
#[test]
fn the_phoronix_profile_takes_a_line_per_case() {
    let profile = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/phoronix");
    let xml = std::fs::read_to_string(profile.join("results-definition.xml")).unwrap();
    let all = |tag: &str| {
        let (open, close) = (format!("<{tag}>"), format!("</{tag}>"));
        let texts = xml.split(open.as_str()).skip(1).map(|rest| rest.split(close.as_str()).next().unwrap());
        texts.map(str::to_string).collect::<Vec<String>>()
    };
    let [names, hints, templates] = ["AppendToArgumentsDescription", "LineHint", "OutputTemplate"].map(all);
    assert!(names.len() > 20, "{names:?}");
    for ((name, hint), template) in names.iter().zip(&hints).zip(&templates) {
        assert_eq!((hint, template), (&format!("{name}:"), &format!("{name}: #_RESULT_# ms")));
        assert_eq!(names.iter().filter(|other| *other == name).count(), 1, "{name}");
    }

    let folder = Folder::new();
    let run = |command: &mut Command| {
        let command = command.current_dir(folder.path("")).env_remove("LOG_FILE");
        let output = command.env("VOLRASTER_PROGRAM", env!("CARGO_BIN_EXE_volraster")).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
        text
    };
    run(Command::new("sh").arg(profile.join("install.sh")));
    assert_eq!(folder.text("install-exit-status").trim(), "0");
    let arguments = "smoke --frames 1 --only blobs-tets-12 --size 48x48";
    let text = run(Command::new("./volraster-bench").args(arguments.split(' ')));
    let lines: Vec<&str> = text.lines().collect();
    for line in &lines {
        let (name, rest) = line.split_once(": ").unwrap();
        let (time, of) = rest.split_once(" (blobs-tets-12, 48x48, ").unwrap();
        let ms = time.strip_suffix(" ms").and_then(|ms| ms.parse::<f64>().ok());
        assert!(!name.is_empty() && of.ends_with(')'), "{line}");
        assert!(ms.is_some_and(|ms| ms > 0.0) || time == "-", "{line}");
    }
    let seen = |hint: &&String| lines.iter().any(|line| line.starts_with(hint.as_str()));
    for hint in &hints {
        // The suite searches whole lines, and takes the first.
        assert!(lines.iter().filter(|line| line.contains(hint.as_str())).count() <= 1, "{hint}: {text}");
    }
    let seen: Vec<&String> = hints.iter().filter(seen).collect();
    assert!(seen.len() >= 6, "{seen:?} of {text}");
    assert!(folder.text("pts-footnote").contains(" on "));
}
