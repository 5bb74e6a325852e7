//! Folders of tests, scene files in them, and runs of the program there.

#![allow(
    dead_code,
    unreachable_pub,
    missing_debug_implementations,
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "test helpers: each test file uses its own part, and a test fails by panicking"
)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;
use std::sync::atomic::{AtomicU32, Ordering};

use jsonschema::Validator;
use serde_json::Value;
use volraster::io::scene_file::{LoadedScene, SceneFile};
use volraster::io::{ReadOptions, read_exr};
use volraster::technique::{Method, Technique, scene_schema};

/// Enough for every file of the tests.
pub const OPTIONS: ReadOptions = ReadOptions::within(1 << 30);

/// The schema of scene files.
pub static SCHEMA: LazyLock<Validator> =
    LazyLock::new(|| jsonschema::draft202012::new(&serde_json::from_str(&scene_schema()).unwrap()).unwrap());

/// Returns the path of a file of the shared data, or None where there is none: the test is skipped then, and says so.
pub fn shared(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("VOLRASTER_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let path = root.join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} is missing", path.display());
    None
}

/// Whether the reader accepts a scene file, and its technique has the options that the file names.
pub fn is_accepted(path: &Path, options: &ReadOptions) -> bool {
    SceneFile::load(path, options).is_ok_and(|loaded| {
        loaded.technique.is_none_or(|choice| {
            Method::from_name(&choice.name)
                .is_ok_and(|method| Technique::new(method, &choice.options).is_ok())
        })
    })
}

/// A scene file that the reader accepts is valid by the schema.
#[track_caller]
pub fn assert_valid_if_accepted(path: &Path) {
    if is_accepted(path, &OPTIONS) {
        let text = fs::read_to_string(path).unwrap();
        let errors: Vec<String> = SCHEMA
            .iter_errors(&serde_json::from_str(&text).unwrap())
            .map(|error| format!("{}: {error}", error.instance_path()))
            .collect();
        assert!(errors.is_empty(), "the reader accepts {text}, the schema does not: {errors:?}");
    }
}

/// A folder that is empty at first, and goes when the test ends.
pub struct Folder {
    root: PathBuf,
    /// Where the program keeps pipelines and references. No test reads or writes the user's.
    cache: PathBuf,
}

impl Folder {
    /// One whose runs have a cache of their own, in it.
    pub fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let name = format!("volraster-test-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let root = std::env::temp_dir().join(name);
        let _ = fs::remove_dir_all(&root);
        fs::create_dir_all(&root).unwrap();
        let cache = root.join("cache");
        Self { root, cache }
    }

    /// One whose runs share a cache with others.
    pub fn with_cache(cache: &Path) -> Self {
        let mut folder = Self::new();
        folder.cache = cache.to_path_buf();
        folder
    }

    pub fn root(&self) -> &Path {
        &self.root
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }

    /// Writes a file, and the folders that it lies in.
    pub fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        // Some file systems flush a file that is truncated and written again: tests write thousands.
        let _ = fs::remove_file(&path);
        fs::write(&path, bytes).unwrap();
        path
    }

    pub fn text(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap()
    }

    pub fn json(&self, name: &str) -> Value {
        serde_json::from_str(&self.text(name)).unwrap()
    }

    /// Values of a file with one in each line.
    pub fn json_lines(&self, name: &str) -> Vec<Value> {
        self.text(name).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    pub fn exr(&self, name: &str) -> volraster::Image {
        read_exr(self.path(name), &OPTIONS).unwrap()
    }

    /// Names of what lies in a folder in it, or with "" in itself, sorted.
    pub fn names(&self, folder: &str) -> Vec<String> {
        let Ok(entries) = fs::read_dir(self.path(folder)) else { return Vec::new() };
        let mut names: Vec<String> =
            entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// Writes and loads a scene file.
    #[track_caller]
    pub fn scene(&self, json: &str) -> volraster::Result<LoadedScene> {
        let path = self.write("scene.json", json);
        assert_valid_if_accepted(&path);
        SceneFile::load(path, &OPTIONS)
    }

    /// A scene file is refused in one line, which names a file and has these parts.
    #[track_caller]
    pub fn refused(&self, json: &str, file: &str, parts: &[&str]) {
        let text = self.scene(json).expect_err(json).to_string();
        assert!(!text.contains('\n') && text.contains(&*self.path(file).to_string_lossy()), "{text}");
        for part in parts {
            assert!(text.contains(part), "\"{part}\" is not in: {text}");
        }
    }

    /// The program with these arguments, here.
    pub fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_volraster"));
        command.current_dir(&self.root).args(line.split(' ')).env("XDG_CACHE_HOME", &self.cache);
        command
    }

    pub fn run(&self, line: &str) -> Run {
        self.run_in(line, &[])
    }

    #[track_caller]
    pub fn run_in(&self, line: &str, environment: &[(&str, &str)]) -> Run {
        let scene = |name: &&str| name.ends_with(".json") && self.path(name).is_file();
        line.split(' ').skip(1).filter(scene).for_each(|name| assert_valid_if_accepted(&self.path(name)));
        Run::of(self.command(line).envs(environment.iter().copied()).output().unwrap(), line)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.root);
    }
}

/// What a run of the program left.
pub struct Run {
    line: String,
    pub code: i32,
    pub out: String,
    pub err: String,
}

impl Run {
    pub fn of(output: Output, line: &str) -> Self {
        Self {
            line: line.to_string(),
            code: output.status.code().unwrap(),
            out: String::from_utf8(output.stdout).unwrap(),
            err: String::from_utf8(output.stderr).unwrap(),
        }
    }

    /// Exit code 0, and nothing on stderr: no message, no progress.
    #[track_caller]
    pub fn done(self) -> Self {
        assert_eq!((self.code, self.err.as_str()), (0, ""), "{}: {}", self.line, self.out);
        self
    }

    /// An exit code, and one line on stderr with these parts.
    #[track_caller]
    pub fn complains(self, code: i32, parts: &[&str]) -> Self {
        assert_eq!(self.code, code, "{}: {}{}", self.line, self.out, self.err);
        assert!(self.err.ends_with('\n') && self.err.lines().count() == 1, "{}: {}", self.line, self.err);
        for part in parts {
            assert!(self.err.contains(part), "{}: no {part:?} in {}", self.line, self.err);
        }
        self
    }

    /// The same of the program, and nothing on stdout.
    #[track_caller]
    pub fn fails(self, code: i32, parts: &[&str]) -> Self {
        let run = self.complains(code, parts);
        assert!(run.err.starts_with("volraster: "), "{}: {}", run.line, run.err);
        assert_eq!(run.out, "", "{}", run.line);
        run
    }

    pub fn json(&self) -> Value {
        serde_json::from_str(&self.out).unwrap()
    }
}
