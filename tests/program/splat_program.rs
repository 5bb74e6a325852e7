//! Scenes of points and of kernels, by the program and by the library: what draws them, what refuses them, what is chosen.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

use crate::common::*;
use crate::folder::{Folder, Run};
use volraster::GpuScene;
use volraster::choice::{self, Goal, Profile};
use volraster::scene::{Field, Kernel, KernelSize, Kernels, Model, Scene, TransferFunction};
use volraster::technique::{Method, Renderer};
use volraster::{Error, Technique};

fn transfer() -> TransferFunction {
    TransferFunction::from_rows(&FOG).unwrap()
}

fn with(scene: &Scene, kernel: Kernel, model: Model) -> Scene {
    scene.clone().with_kernels(Kernels { kernel, model, ..Kernels::of_points() }).unwrap()
}

fn points(count: u32) -> Scene {
    let points = Field::Blobs.points(count).unwrap().with_size(KernelSize::Radius(0.3)).unwrap();
    Scene::new(points, transfer())
}

#[test]
fn what_knows_no_kernels_refuses_them() {
    let gpu = gpu();
    let view = view(perspective(), 1.0, 20, 16);
    let grid = scene(Field::Blobs, 6, "f32", &FOG);
    let mesh = Scene::new(Field::Blobs.tets(2).unwrap(), transfer());
    let mut refused = 0;
    for scene in [
        with(&grid, Kernel::Gaussian, Model::Density),
        with(&grid, Kernel::BSpline, Model::Interpolate),
        with(&mesh, Kernel::Gaussian, Model::Interpolate),
        with(&points(20), Kernel::Gaussian, Model::Density),
        with(&points(20), Kernel::BSpline, Model::Interpolate),
        grid.clone(),
        mesh.clone(),
        points(20),
    ] {
        let on_device = GpuScene::new(&gpu, scene.clone());
        let mut draw = Vec::new();
        for method in Method::ALL {
            let technique = Technique::new(method, &[]).unwrap();
            let what = format!("{} of {} {:?}", method.name(), scene.data.kind(), scene.kernels);
            match Renderer::new(&on_device, technique).render(&view) {
                Ok(_) => {
                    assert!(method.draws_scene(&scene), "{what}: is drawn");
                    draw.push(method);
                }
                Err(error) => {
                    assert!(!method.draws_scene(&scene), "{what}: {error}");
                    assert!(matches!(error, Error::Invalid { .. }), "{what}: {error}");
                    // The kernels are the reason where the data is not.
                    let of_kernels = method.draws(&scene.data);
                    let text = error.to_string();
                    assert!(!of_kernels || text.contains("kernel"), "{what}: {error}");
                    if of_kernels && method != Method::SplatEwa {
                        let linear = if scene.mesh().is_some() { "linear cells" } else { "trilinear grids" };
                        assert!(text.contains(&format!("draws {linear}: the scene has kernels")), "{text}");
                        refused += 1;
                    }
                }
            }
        }
        let default = Method::default_for(&scene).unwrap();
        assert!(draw.contains(&default) && default.fits(&scene), "{default:?}");
        let splats = [Method::SplatSheets, Method::SplatEwa].contains(&default);
        assert_eq!(splats, scene.kernels.is_some() || scene.points().is_some());
    }
    // Five techniques for grids twice, three for meshes.
    assert_eq!(refused, 13);
    // What has kernels of its own draws another field.
    assert!(Method::SplatEwa.draws_scene(&grid) && !Method::SplatEwa.fits(&grid));
    assert!(Method::SplatSheets.fits(&grid) && !Method::SplatSheets.draws_scene(&mesh));
    assert!(Method::default_for(&with(&mesh, Kernel::BSpline, Model::Interpolate)).is_none());
}

/// Trilinear interpolation is a sum of tents: sheets converge to what the others draw.
#[test]
fn tents_are_the_trilinear_field() {
    let gpu = gpu();
    let scene = scene(Field::Blobs, 14, "f32", &FOG);
    for view in [
        view(perspective(), 1.0, 40, 32),
        view(orthographic(), 1.0, 40, 32),
        view(perspective(), 0.2, 40, 32),
    ] {
        let error = |step: &str| {
            let image = draw(&gpu, &scene, &view, &format!("splat-sheets:step={step}"));
            errors(&image, &scene, &view).all.rmse
        };
        let (coarse, fine) = (error("1"), error("0.25"));
        println!("{coarse:.1e} {fine:.1e}");
        assert!(fine < 5e-4 && fine < 0.15 * coarse, "{coarse:e}, {fine:e}");
        // Gaussians are another field, which they are the reference's of.
        let gaussian = with(&scene, Kernel::Gaussian, Model::Interpolate);
        let image = draw(&gpu, &gaussian, &view, "splat-ewa:step=0.25");
        assert_eq!(image, draw(&gpu, &scene, &view, "splat-ewa:step=0.25"));
        let (own, other) = (errors(&image, &gaussian, &view), errors(&image, &scene, &view));
        assert!(own.all.rmse < 1e-3 && other.all.rmse > 3.0 * own.all.rmse, "{own}, {other}");
    }
}

#[test]
fn another_transfer_function_keeps_the_kernels() {
    let gpu = gpu();
    let view = view(perspective(), 1.0, 30, 24);
    let plain = scene(Field::Blobs, 8, "f32", &SHELLS);
    let old = GpuScene::new(&gpu, with(&plain, Kernel::BSpline, Model::Interpolate));
    let spec = "splat-sheets:step=0.5";
    let before = draw_on(&old, &view, spec);
    let new = old.with_transfer(transfer());
    let image = draw_on(&new, &view, spec);
    let fresh = with(&scene(Field::Blobs, 8, "f32", &FOG), Kernel::BSpline, Model::Interpolate);
    assert_eq!(image, draw(&gpu, &fresh, &view, spec));
    assert_ne!(image, before);
    // And other scalars.
    let mesh = Scene::new(Field::Blobs.tets(2).unwrap(), transfer());
    let old = GpuScene::new(&gpu, with(&mesh, Kernel::Gaussian, Model::Density));
    let scalars = mesh.mesh().unwrap().scalars().clone();
    let new = old.with_scalars(scalars, transfer()).unwrap();
    assert_eq!(new.scene().kernels, old.scene().kernels);
    assert_eq!(draw_on(&new, &view, "splat-ewa"), draw_on(&old, &view, "splat-ewa"));
}

#[test]
#[ignore = "make test-all"]
fn the_error_that_is_asked_for_is_held_for_kernels() {
    let gpu = gpu();
    let view = view(perspective(), 1.0, 40, 30);
    let grid = scene(Field::Blobs, 8, "f32", &FOG);
    let mesh = Scene::new(Field::Blobs.tets(3).unwrap(), transfer());
    for scene in [
        points(200),
        with(&points(60), Kernel::Gaussian, Model::Interpolate),
        with(&points(60), Kernel::BSpline, Model::Density),
        with(&grid, Kernel::Gaussian, Model::Density),
        with(&grid, Kernel::Sinc, Model::Interpolate),
        with(&mesh, Kernel::Gaussian, Model::Interpolate),
    ] {
        for max_error in [1e-2, 2e-3] {
            let on_device = GpuScene::new(&gpu, scene.clone());
            let choice =
                choice::choose(&on_device, &view, Goal::MaxError(max_error), &Profile::built_in()).unwrap();
            let truth =
                errors(&Renderer::new(&on_device, choice.technique).render(&view).unwrap(), &scene, &view);
            let spec = &choice.trials[choice.chosen].spec;
            println!("{:?}: {spec} {:.1e}, {} trials", scene.kernels, truth.all.rmse, choice.trials.len());
            assert!(truth.all.rmse <= max_error && spec.starts_with("splat-"), "{spec}: {truth}");
            assert!(choice.technique.method().fits(&scene), "{spec}");
            assert!(choice.trials.len() <= 8, "{:?}", choice.trials);
        }
    }
    let nothing = GpuScene::new(&gpu, with(&mesh, Kernel::BSpline, Model::Interpolate));
    let error = choice::choose(&nothing, &view, Goal::MaxError(0.1), &Profile::built_in()).unwrap_err();
    assert!(error.to_string().contains("no technique draws"), "{error}");
}

/// Points with a scalar in VTK's legacy format.
fn vtk(count: u32) -> String {
    let points = Field::Blobs.points(count).unwrap();
    let mut text =
        format!("# vtk DataFile Version 3.0\npoints\nASCII\nDATASET POLYDATA\nPOINTS {count} double\n");
    for centre in points.centres() {
        text += &format!("{} {} {}\n", centre.x, centre.y, centre.z);
    }
    text += &format!("POINT_DATA {count}\nSCALARS s float 1\nLOOKUP_TABLE default\n");
    for scalar in points.scalars().unwrap() {
        text += &format!("{scalar}\n");
    }
    text
}

const GRID: &str = r#"{"volume": {"field": "blobs", "dims": [8, 8, 8]}, "transfer": {"preset": "fog"}, "kernels": KERNELS,
    "camera": {"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], "fov_y_deg": 42}}"#;

#[test]
fn the_program_draws_points_and_kernels() {
    let folder = Folder::new();
    folder.write("points.vtk", vtk(300));
    let kernels = |name: &str, spec: &str| {
        folder.write(name, GRID.replace("KERNELS", spec));
    };
    kernels("gaussian.json", r#"{"model": "density"}"#);
    kernels("sinc.json", r#"{"kernel": "sinc"}"#);
    for (file, default, methods, most) in [
        ("points.vtk", "splat-ewa", &["splat-sheets", "splat-ewa"][..], 2e-2),
        ("gaussian.json", "splat-ewa", &["splat-sheets", "splat-ewa"], 2e-2),
        ("sinc.json", "splat-sheets", &["splat-sheets"], 2e-2),
    ] {
        let out = folder.run(&format!("render {file} -o a.exr --size 40x30 --validate")).done().out;
        assert!(out.starts_with(&format!("{default} (compute)")), "{out}");
        folder.run(&format!("compare {file} -o c-{default}-{file} --size 40x30 --validate")).done();
        let found = folder.json(&format!("c-{default}-{file}/errors.json"));
        let found = found.as_array().unwrap();
        let names: Vec<&str> = found.iter().map(|entry| entry["technique"].as_str().unwrap()).collect();
        assert_eq!(names, methods, "{file}");
        for entry in found {
            let rmse = entry["errors"]["all"]["rmse"].as_f64().unwrap();
            assert!(rmse < most, "{file} {}: {rmse}", entry["technique"]);
        }
        let line = format!("render {file} -o b.png --size 40x30 --max-error 5e-3 --stats s.json --validate");
        folder.run(&line).done();
        let choice = &folder.json("s.json")["choice"];
        let chosen = choice["chosen"].as_str().unwrap();
        assert!(methods.iter().any(|method| chosen.starts_with(method)), "{chosen}");
        let refused = folder.run(&format!("render {file} -o d.png --technique raycast"));
        refused.complains(2, &["\"raycast\": draws no", default]);
    }
    // Nothing draws B-splines at the vertices of a mesh.
    let mesh = r#"{"mesh": {"field": "ramp", "cubes": 1}, "kernels": {"kernel": "bspline"}}"#;
    folder.write("mesh.json", mesh);
    for command in
        ["render mesh.json -o e.png", "compare mesh.json -o e", "render mesh.json -o e.png --max-error 1"]
    {
        folder.run(command).complains(2, &["mesh of bspline kernels"]);
        assert!(!folder.path("e").exists());
    }
}

/// Splats that are asked for are drawn whatever their number; unasked they are not tried where others are far faster.
#[test]
fn large_grids_are_not_splatted_unasked() {
    let folder = Folder::new();
    let scene = r#"{"volume": {"field": "ramp", "dims": [65, 65, 65]}, "transfer": {"preset": "fog"}}"#;
    folder.write("grid.json", scene);
    let out = folder.run("compare grid.json -o c --size 8x8").done().out;
    assert!(out.contains("skipped: splat-sheets/compute: 274625 samples"), "{out}");
    let names = folder.json("c/errors.json");
    assert!(
        names.as_array().unwrap().iter().all(|entry| !entry["technique"].as_str().unwrap().contains("splat"))
    );
    let report = folder.text("c/report.html");
    assert!(report.contains("274625 samples"));
    let Run { code, out, .. } = folder.run("compare grid.json -o d --size 8x8 --techniques splat-sheets");
    assert!(code == 0 && out.contains("splat-sheets"), "{out}");
}

#[test]
fn bench_measures_points_and_kernels() {
    let folder = Folder::new();
    folder.write("data/cloud.vtk", vtk(100));
    folder.write("gaussian.json", GRID.replace("KERNELS", "{}"));
    // What a folder holds, beside no scene of the suite.
    folder.run("bench smoke --data data --only cloud -o found --size 24x20 --frames 1").done();
    let found = folder.json_lines("found/bench.jsonl");
    let mut names: Vec<&str> = found.iter().map(|record| record["technique"].as_str().unwrap()).collect();
    names.dedup();
    assert_eq!(names, ["splat-sheets", "splat-ewa"]);
    for record in &found {
        assert_eq!((&record["data"], &record["elements"]), (&"points".into(), &100.into()));
        assert!(record["counters"]["pairs"].as_u64().unwrap() > 0, "{record}");
    }
    folder.run("bench gaussian.json -o file --size 24x20 --frames 1").done();
    let found = folder.json_lines("file/bench.jsonl");
    assert!(found.len() > 8);
    for record in &found {
        // Interpolated kernels have no order of their own: nothing is tried that is refused.
        assert!(record["skipped"].is_null() && record["failed"].is_null(), "{record}");
        assert!(record["technique"].as_str().unwrap().starts_with("splat-"), "{record}");
    }
    let table = folder.text("file/table.md");
    assert!(table.contains("| pairs/s | evaluations/s |") && table.contains("512 voxels."), "{table}");
}
