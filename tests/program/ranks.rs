//! Processes of an MPI job draw the image of one.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use volraster::measure::ImageErrors;

use crate::common::taken;
use crate::folder::{Folder, Run};

/// Runs a command of the program with so many processes.
fn mpirun(folder: &Folder, ranks: u32, line: &str) -> Command {
    let program = folder.command(line);
    let mut job = Command::new("mpirun");
    job.args(["--oversubscribe", "-n", &ranks.to_string()])
        .arg(program.get_program())
        .args(program.get_args());
    job.current_dir(program.get_current_dir().unwrap());
    job.envs(program.get_envs().filter_map(|(key, value)| Some((key, value?))));
    // Tests may run as root, in a container.
    job.env("OMPI_ALLOW_RUN_AS_ROOT", "1").env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
    // Nor may processes of a container read each other's memory.
    job.env("OMPI_MCA_btl_vader_single_copy_mechanism", "none");
    job
}

fn run(folder: &Folder, ranks: u32, line: &str) -> Run {
    let output = mpirun(folder, ranks, line).output();
    Run::of(
        output.unwrap_or_else(|error| panic!("mpirun (run `make test`, which installs it): {error}")),
        line,
    )
}

/// A raw file of 8-bit samples, and scenes of it, with a camera, because one is chosen by an overview of what stays in its file, and of a mesh.
fn folder() -> Folder {
    let folder = Folder::new();
    let side = 150_usize;
    let wave = |i: usize| (9.0 * i as f64 / side as f64).sin();
    let samples: Vec<u8> = (0..side.pow(3))
        .map(|i| {
            let [x, y, z] = [i % side, i / side % side, i / side / side].map(wave);
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 7 and 247")]
            let sample = (127.0 + 60.0 * (x + y * z)) as u8;
            sample
        })
        .collect();
    folder.write("waves.raw", samples);
    let rest = r#""transfer": [[0, 0.1, 0.2, 0.9, 0], [90, 0.9, 0.5, 0.1, 0.01], [255, 1, 0.9, 0.6, 0.1]], "image": {"width": 90, "height": 70}"#;
    let camera =
        r#""camera": {"eye": [330, 260, 420], "target": [75, 75, 75], "up": [0, 1, 0], "fov_y_deg": 30}"#;
    folder.write(
        "grid.json",
        format!(r#"{{"volume": {{"file": "waves.raw", "dims": [150, 150, 150], "type": "u8"}}, {camera}, {rest}}}"#),
    );
    let fog = r#""transfer": {"preset": "fog", "range": [0, 1]}, "image": {"width": 90, "height": 70}"#;
    folder.write("mesh.json", format!(r#"{{"mesh": {{"field": "blobs", "cubes": 9}}, {fog}}}"#));
    folder.write("points.json", format!(r#"{{"points": {{"field": "blobs", "count": 500}}, {fog}}}"#));
    folder
}

/// Any number of processes draws the image of one, and each reads its own part.
#[test]
fn processes_draw_the_image_of_one() {
    let folder = folder();
    for (scene, technique) in
        [("grid", "slabs:filter=exact"), ("mesh", "havs:integrator=exact"), ("points", "splat-ewa")]
    {
        folder.run(&format!("render {scene}.json --technique {technique} -o one.exr")).done();
        let want = folder.exr("one.exr");
        for ranks in taken(4, [2, 1, 4, 8]) {
            let line = format!(
                "render {scene}.json --technique {technique} -o all.exr --stats all.json --distributed --validate"
            );
            run(&folder, ranks, &line).done();
            let errors = ImageErrors::between(&folder.exr("all.exr"), &want).unwrap().all;
            println!("{scene}, {ranks} processes: at most {:.1e}", errors.max_abs);
            assert!(errors.max_abs <= 2e-6, "{scene}, {ranks} processes: {errors:?}");
            let stats = folder.json("all.json");
            let all = stats["ranks"].as_array().unwrap();
            let numbers: Vec<u64> = all.iter().map(|rank| rank["rank"].as_u64().unwrap()).collect();
            assert_eq!(numbers, (0..u64::from(ranks)).collect::<Vec<_>>());
            let bytes = |key: &str| all.iter().map(|rank| rank[key].as_u64().unwrap()).collect::<Vec<_>>();
            // Of an image of 16 bytes a pixel each sends no more than what it does not keep, and a piece to the first.
            let sent = bytes("bytes_sent");
            assert!(
                sent.iter().all(|&sent| sent < 2 * 16 * 90 * 70)
                    && (ranks == 1) == (sent.iter().sum::<u64>() == 0),
                "{sent:?}"
            );
            if scene == "grid" {
                let read = bytes("bytes_read");
                // Pages of 64 cells and an apron; those across a side of a box are read by both.
                assert!(read.iter().all(|&read| read > 0), "{read:?}");
                assert!(
                    ranks == 1 || read.iter().all(|&read| 10 * read < 9 * 27 * 67_u64.pow(3) * 2),
                    "{read:?}"
                );
            }
        }
    }
}

/// A failure is said once, by the first process, and nothing is written.
#[test]
fn failures_end_all_processes_with_one_line() {
    let folder = folder();
    for (line, code, why) in [
        ("render nothing.json", 2, "nothing.json"),
        ("render grid.json --technique shear-warp", 2, "slices-2d"),
        ("render grid.json --frames 3", 2, "--frames"),
        ("render grid.json --device none", 3, "none"),
    ] {
        let output = mpirun(&folder, 2, &format!("{line} -o none.exr --distributed")).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let lines: Vec<&str> = said.lines().filter(|line| line.starts_with("volraster: ")).collect();
        assert!(lines.len() == 1 && lines[0].contains(why), "{line}: {said}");
        assert_eq!(output.status.code(), Some(code), "{line}: {said}");
        assert!(!folder.path("none.exr").exists(), "{line}");
    }
}

/// The processes that a process has started.
fn children(parent: u32) -> Vec<u32> {
    let parent_of = |pid: u32| -> Option<u32> {
        let text = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        text.rsplit_once(')')?.1.split_whitespace().nth(1)?.parse().ok()
    };
    let all = std::fs::read_dir("/proc")
        .unwrap()
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.parse().ok());
    all.filter(|&pid| parent_of(pid) == Some(parent)).collect()
}

/// The job ends soon where a process is killed, and nothing is written.
#[test]
fn a_killed_process_ends_the_job() {
    if !Path::new("/proc/self/stat").exists() {
        return;
    }
    let folder = folder();
    // Drawing takes many times as long as the test waits.
    let line = "render grid.json --technique slabs:step=0.01,filter=exact --size 2000x2000 -o none.exr --distributed";
    let mut job = mpirun(&folder, 2, line).stderr(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
    let begin = Instant::now();
    let ranks = loop {
        let ranks = children(job.id());
        if ranks.len() == 2 {
            break ranks;
        }
        assert!(begin.elapsed() < Duration::from_secs(60), "two processes were expected: {ranks:?}");
        std::thread::sleep(Duration::from_millis(50));
    };
    // In the middle of drawing.
    std::thread::sleep(Duration::from_secs(4));
    assert!(job.try_wait().unwrap().is_none(), "the job has ended before anything was killed");
    let killed = Instant::now();
    assert!(Command::new("kill").args(["-9", &ranks[1].to_string()]).status().unwrap().success());
    let status = job.wait().unwrap();
    println!("ended {:.1} s after a process was killed", killed.elapsed().as_secs_f64());
    assert!(!status.success() && killed.elapsed() < Duration::from_secs(10), "{status:?}");
    assert!(!folder.path("none.exr").exists() && children(job.id()).is_empty());
}
