//! Techniques chosen for an error or a time: what is promised is held, in truth.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use crate::common::*;
use crate::folder::Folder;
use serde_json::Value;
use volraster::GpuScene;
use volraster::choice::{self, Choice, Goal, Profile, Source, TrialOutcome};
use volraster::scene::{Field, Scene, TransferFunction, View};
use volraster::technique::Renderer;
use volraster::{Error, Gpu};

fn mesh(cubes: u32) -> Scene {
    Scene::new(Field::Blobs.tets(cubes).unwrap(), TransferFunction::from_rows(&FOG).unwrap())
}

fn choose(gpu: &Gpu, scene: &Scene, view: &View, goal: Goal) -> volraster::Result<Choice> {
    choice::choose(&GpuScene::new(gpu, scene.clone()), view, goal, &Profile::built_in())
}

/// Root mean square error of what a technique draws, of every pixel.
fn true_error(gpu: &Gpu, scene: &Scene, view: &View, choice: &Choice) -> f64 {
    let on_gpu = GpuScene::new(gpu, scene.clone());
    let mut frames = Renderer::new(&on_gpu, choice.technique).frames(view).unwrap();
    frames.draw(view).unwrap();
    errors(&frames.read_back().unwrap(), scene, view).all.rmse
}

#[test]
fn the_error_that_is_asked_for_is_held() {
    let gpu = gpu();
    let grid = scene(Field::MarschnerLobb, 24, "f32", &FOG);
    let all = choice::try_all(
        &GpuScene::new(&gpu, grid.clone()),
        &view(perspective(), 1.0, 8, 8),
        Goal::Budget(1e3),
    );
    let table: Vec<String> = all.unwrap().into_iter().map(|(spec, _)| spec).collect();
    let mut refined = Vec::new();
    // Larger than what is compared whole.
    for (scene, view) in [
        (&grid, view(perspective(), 1.0, 40, 30)),
        (&grid, view(perspective(), 1.0, 90, 70)),
        (&mesh(6), view(orthographic(), 1.0, 40, 30)),
    ] {
        let mut errors = Vec::new();
        for max_error in [3e-2, 3e-3, 3e-4] {
            let choice = choose(&gpu, scene, &view, Goal::MaxError(max_error)).unwrap();
            let (estimate, ms) = choice.measured().unwrap();
            assert!(estimate.bound <= max_error && estimate.rmse <= estimate.bound && ms > 0.0);
            let truth = true_error(&gpu, scene, &view, &choice);
            assert!(truth <= max_error, "{}: {truth:e}", choice.trials[choice.chosen].spec);
            // The estimate is one of this image.
            let whole = view.extent()[0] * view.extent()[1] <= 4096;
            assert!(
                (truth - estimate.rmse).abs() <= if whole { 1e-6 } else { 0.2 } * truth + 1e-9,
                "{truth:e}, {estimate:?}"
            );
            assert_eq!(choice.source, Source::BuiltIn);
            assert!(choice.trials.len() <= choice.candidates);
            errors.push(truth);
            // Steps between those of the table aim at the whole error.
            let drawn = choice.trials.iter().filter_map(|trial| match trial.outcome {
                TrialOutcome::Drawn { error, .. } => Some((&trial.spec, error.bound / max_error)),
                TrialOutcome::Refused(_) => None,
            });
            let is_new = |spec: &String| scene.grid().is_some() && !table.contains(spec);
            refined.extend(drawn.filter(|(spec, _)| is_new(spec)).map(|(_, share)| share));
        }
        assert!(errors[0] >= errors[2], "{errors:?}");
    }
    assert!(refined.len() > 1 && refined.iter().any(|share| (0.8..=1.0).contains(share)), "{refined:?}");
}

#[test]
fn the_budget_is_kept() {
    let gpu = gpu();
    let scene = scene(Field::MarschnerLobb, 24, "f32", &FOG);
    let view = view(perspective(), 1.0, 48, 36);
    // What the fastest and what an accurate setting take here, whatever the device.
    let all = choice::try_all(&GpuScene::new(&gpu, scene.clone()), &view, Goal::Budget(1e3)).unwrap();
    let times = all.iter().filter_map(|(_, outcome)| match outcome {
        TrialOutcome::Drawn { ms, .. } => Some(*ms),
        TrialOutcome::Refused(_) => None,
    });
    let (fastest, slowest) = times.fold((f64::MAX, 0.0_f64), |(low, high), ms| (low.min(ms), high.max(ms)));
    let generous = choose(&gpu, &scene, &view, Goal::Budget(slowest * 10.0)).unwrap();
    let (best, _) = generous.measured().unwrap();
    assert!(best.rmse < 1e-4, "{best:?}");
    let tight = choose(&gpu, &scene, &view, Goal::Budget(fastest * 4.0)).unwrap();
    let (found, ms) = tight.measured().unwrap();
    assert!(ms <= fastest * 4.0 && found.rmse >= best.rmse, "{ms} ms, {found:?}");
}

#[test]
fn what_cannot_be_met_is_refused_with_the_nearest() {
    let gpu = gpu();
    let scene = scene(Field::MarschnerLobb, 12, "f32", &FOG);
    let view = view(perspective(), 1.0, 24, 20);
    let why = |goal| choose(&gpu, &scene, &view, goal).unwrap_err();
    for (goal, says) in
        [(Goal::MaxError(1e-12), "an error of at most 1e-12"), (Goal::Budget(1e-6), "a frame in 0.000001 ms")]
    {
        let error = why(goal);
        assert!(matches!(error, Error::Unsupported { .. }), "{error}");
        let text = error.to_string();
        assert!(text.contains(says) && text.contains("the nearest is "), "{text}");
    }
    for goal in [Goal::MaxError(0.0), Goal::MaxError(f64::NAN), Goal::Budget(-1.0)] {
        assert!(matches!(why(goal), Error::Invalid { .. }));
    }
}

const SCENE: &str = r#"{"volume": {"field": "blobs", "dims": [24, 24, 24]}, "transfer": {"preset": "fog"},
    "camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 42}}"#;

#[test]
fn render_chooses_and_says_why() {
    let folder = Folder::new();
    folder.write("scene.json", SCENE);
    let out = folder
        .run("render scene.json -o a.exr --size 50x40 --max-error 1e-3 --stats s.json --validate")
        .done()
        .out;
    assert!(
        out.contains("chosen: ") && out.contains("95 % confidence") && out.contains("at 2000 pixels"),
        "{out}"
    );
    let stats = folder.json("s.json");
    let choice = &stats["choice"];
    assert_eq!((&choice["max_error"], &choice["budget_ms"]), (&Value::from(1e-3), &Value::Null));
    assert_eq!(choice["predictions"], "built in");
    let trials = choice["trials"].as_array().unwrap();
    let chosen = trials.iter().find(|trial| trial["technique"] == choice["chosen"]).unwrap();
    let measured = &chosen["measured"];
    let [rmse, bound] = ["rmse", "rmse_bound"].map(|key| measured[key].as_f64().unwrap());
    assert!(0.0 < rmse && rmse <= bound && bound <= 1e-3, "{measured}");
    assert!(chosen["predicted"]["rmse"].as_f64().unwrap() > 0.0 && measured["ms"].as_f64().unwrap() > 0.0);
    let name = choice["chosen"].as_str().unwrap().split(':').next().unwrap();
    assert_eq!(stats["technique"], name);
    // The picture is as good as was said: all of it was compared.
    let chosen = choice["chosen"].as_str().unwrap();
    let run = folder.run(&format!("compare scene.json -o c --size 50x40 --techniques {chosen}"));
    assert_eq!(run.code, 0, "{}", run.out);

    let run = folder.run("render scene.json -o b.png --size 20x20 --max-error 1e-15");
    run.complains(3, &["the nearest is"]);
    assert!(!folder.path("b.png").exists());
    for line in ["--max-error 0", "--budget x", "--max-error 1 --budget 2", "--budget 2 --technique slabs"] {
        folder.run(&format!("render scene.json -o b.png {line}")).complains(2, &[]);
    }
}

/// What is measured is kept for the device, and for its driver and this version alone.
#[test]
#[ignore = "make test-all: it calibrates a device"]
fn a_profile_is_measured_kept_and_dropped() {
    let folder = Folder::new();
    folder.write("scene.json", SCENE);
    let out = folder.run("calibrate --busy").done().out;
    assert!(out.contains(" settings on "), "{out}");
    let path = std::fs::read_dir(folder.path("cache/volraster")).unwrap().map(|entry| entry.unwrap().path());
    let path = path.into_iter().find(|path| path.to_string_lossy().contains("profile-")).unwrap();
    let used = || {
        let run = folder.run("render scene.json -o a.png --size 16x16 --max-error 0.01 --stats s.json");
        assert_eq!(run.code, 0, "{}{}", run.out, run.err);
        let stats = folder.json("s.json");
        stats["choice"]["predictions"].as_str().unwrap().to_string()
    };
    assert_eq!(used(), "measured on this device");
    let whole = std::fs::read_to_string(&path).unwrap();
    let mut stored: Value = serde_json::from_str(&whole).unwrap();
    let costs = stored["costs"].as_array().unwrap();
    assert!(costs.len() > 30);
    for cost in costs {
        assert!(cost["ms"].as_f64().unwrap() > 0.0 && cost["rmse"].as_f64().unwrap() < 1.0, "{cost}");
    }
    for key in ["driver", "device", "version"] {
        let kept = stored[key].take();
        stored[key] = "another".into();
        std::fs::write(&path, stored.to_string()).unwrap();
        assert_eq!(used(), "built in", "{key}");
        stored[key] = kept;
    }
    std::fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    assert_eq!(used(), "built in");
}

#[test]
#[ignore = "make test-all: it calibrates a device"]
fn choices_hold_on_random_draws() {
    let folder = Folder::new();
    let out = folder.run("calibrate --check 8 --seed 3 --size 32x32").done().out;
    let line = out.lines().find(|line| line.starts_with("held: ")).unwrap();
    let [held, possible] =
        [1, 3].map(|word| line.split(' ').nth(word).unwrap().trim_end_matches(';').parse::<u32>().unwrap());
    assert!(possible >= 4 && held == possible, "{line}");
    assert!(out.contains("median "), "{out}");
}
