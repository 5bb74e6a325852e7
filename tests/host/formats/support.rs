//! What the tests of all formats share.

use std::io::Write as _;

use volraster::io::{Data, Loaded, ReadOptions, read, read_memory};
use volraster::scene::{Gaussians, Grid, Points, Samples, Tets};
use volraster::{Error, Result};

pub use crate::folder::{Folder, OPTIONS, shared};

/// A file with those that it names, in memory: the first is the one to read.
#[derive(Clone, Debug)]
pub struct Sample {
    /// What it shows.
    pub what: &'static str,
    /// Names and contents.
    pub files: Vec<(String, Vec<u8>)>,
}

impl Sample {
    /// A sample of one file.
    pub fn one(what: &'static str, name: &str, bytes: impl Into<Vec<u8>>) -> Self {
        Self { what, files: vec![(name.to_owned(), bytes.into())] }
    }

    /// The same with another file beside it.
    pub fn with(mut self, name: &str, bytes: impl Into<Vec<u8>>) -> Self {
        self.files.push((name.to_owned(), bytes.into()));
        self
    }

    /// Reads it from memory.
    pub fn read(&self, options: &ReadOptions) -> Result<Loaded> {
        let files: Vec<(&str, &[u8])> =
            self.files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
        read_memory(&files, options)
    }

    /// Reads it, and must succeed.
    #[track_caller]
    pub fn loaded(&self) -> Loaded {
        self.read(&OPTIONS).unwrap_or_else(|e| panic!("{}: {e}", self.what))
    }

    /// Reads it, and must be refused in one line that holds all these parts.
    #[track_caller]
    pub fn refused(&self, parts: &[&str]) {
        let error = match self.read(&OPTIONS) {
            Ok(_) => panic!("{}: must be refused", self.what),
            Err(error) => error,
        };
        assert_refusal(&error, parts, self.what);
    }
}

/// A refusal is one line of wrong input that holds all parts.
#[track_caller]
pub fn assert_refusal(error: &Error, parts: &[&str], what: &str) {
    let text = error.to_string();
    assert!(!text.contains('\n'), "{what}: more than one line: {text}");
    assert_eq!(error.exit_code(), 2, "{what}: {text}");
    for part in parts {
        assert!(text.contains(part), "{what}: \"{part}\" is not in: {text}");
    }
}

/// The grid of what was read.
#[track_caller]
pub fn grid(loaded: Loaded) -> Grid {
    match loaded.data {
        Data::Grid(grid) => grid,
        other => panic!("a grid is wanted, not {}", other.kind()),
    }
}

/// The mesh of what was read.
#[track_caller]
pub fn mesh(loaded: Loaded) -> Tets {
    match loaded.data {
        Data::Mesh(mesh) => mesh,
        other => panic!("a mesh is wanted, not {}", other.kind()),
    }
}

/// The points of what was read.
#[track_caller]
pub fn points(loaded: Loaded) -> Points {
    match loaded.data {
        Data::Points(points) => points,
        other => panic!("points are wanted, not {}", other.kind()),
    }
}

/// The Gaussian splats of what was read.
#[track_caller]
pub fn gaussians(loaded: Loaded) -> Gaussians {
    match loaded.data {
        Data::Gaussians(splats) => splats,
        other => panic!("gaussians are wanted, not {}", other.kind()),
    }
}

/// All samples as they are stored.
pub fn stored(grid: &Grid) -> Vec<f64> {
    let samples: &Samples = grid.samples();
    (0..samples.len()).map(|i| samples.get(i)).collect()
}

/// Reads a file of the shared data.
#[track_caller]
pub fn shared_loaded(name: &str) -> Option<Loaded> {
    shared(name).map(|path| read(&path, &OPTIONS).unwrap_or_else(|e| panic!("{e}")))
}

/// A gzip stream.
pub fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

/// A zlib stream.
pub fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}
