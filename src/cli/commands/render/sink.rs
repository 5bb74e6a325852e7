//! Where the frames of a film go: numbered images, or one file that `ffmpeg` encodes.

use std::ffi::OsStr;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::Receiver;
use std::sync::{Mutex, PoisonError};
use std::thread;

use volraster::io::{self, Numbered};
use volraster::{Error, Image, Result};

use crate::cli::output;

/// Endings of films, with `ffmpeg`'s names of their containers and options of their encoders.
const FILMS: [(&str, &str, &[&str]); 6] = [
    ("mp4", "mp4", &[]),
    ("mkv", "matroska", &[]),
    ("webm", "webm", &["-crf", "30", "-b:v", "0"]),
    ("mov", "mov", &[]),
    ("avi", "avi", &[]),
    ("gif", "gif", &[]),
];

/// The limit on threads that encode images.
const MAX_WRITERS: usize = 4;

/// Where the frames of a film go.
pub(super) enum Sink {
    /// Images, numbered from 0.
    Images { folder: PathBuf, names: Numbered },
    /// One file.
    Film { path: PathBuf, muxer: &'static str, options: &'static [&'static str], fps: f64 },
}

/// Frames with their numbers, in order.
pub(super) type Pictures = Mutex<Receiver<(usize, Image)>>;

impl Sink {
    /// Returns where frames go by the name of the output; `None` if it is that of a single image.
    pub(super) fn of(path: &Path, fps: f64) -> Result<Option<Self>> {
        let name = path.file_name().and_then(OsStr::to_str).unwrap_or_default();
        let ending = path.extension().unwrap_or_default();
        if let Some(names) = Numbered::parse(name) {
            let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
            output::check_ending(path)?;
            return Ok(Some(Self::Images { folder, names }));
        }
        let film = FILMS.into_iter().find(|(known, ..)| ending.eq_ignore_ascii_case(known));
        Ok(film.map(|(_, muxer, options)| Self::Film { path: path.to_path_buf(), muxer, options, fps }))
    }

    /// Checks that frames can be written; makes the folder of numbered images.
    pub(super) fn check(&self, background: [f64; 4]) -> Result<()> {
        match self {
            Self::Images { folder, names } => {
                if !folder.as_os_str().is_empty() {
                    output::make_folder(folder)?;
                }
                io::check_writable(folder.join(names.name(0)))
            }
            Self::Film { path, .. } => {
                if path.exists() && !path.is_file() {
                    return Err(output::refuse(path, "file type", "must be a regular file, or none yet"));
                }
                if background[3] < 1.0 {
                    return Err(output::refuse(path, "background", "a film needs one that is opaque"));
                }
                io::check_writable(path)?;
                let mut command = Command::new("ffmpeg");
                let asked =
                    command.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
                match asked.status() {
                    Ok(_) => Ok(()),
                    Err(error) => {
                        let rule = format!(
                            "a film needs the program ffmpeg ({error}); -o {}-%04d.png writes numbered images",
                            path.file_stem().unwrap_or_default().display()
                        );
                        Err(output::refuse(path, "encoder", &rule))
                    }
                }
            }
        }
    }

    /// Returns the names of the first and the last of numbered images.
    pub(super) fn names(&self, count: usize) -> Option<String> {
        let Self::Images { folder, names } = self else { return None };
        let name = |i| folder.join(names.name(i)).display().to_string();
        Some(format!("{} to {}", name(0), name(count.saturating_sub(1))))
    }

    /// Returns the number of threads that write.
    pub(super) fn writers(&self) -> usize {
        match self {
            Self::Images { .. } => thread::available_parallelism().map_or(1, |n| n.get().min(MAX_WRITERS)),
            Self::Film { .. } => 1,
        }
    }

    /// Writes frames as they come; a film only if all `count` do.
    pub(super) fn write(&self, pictures: &Pictures, count: usize, background: [f64; 4]) -> Result<()> {
        // The lock is held while waiting, so that one writer at a time takes the next frame.
        let next = || pictures.lock().unwrap_or_else(PoisonError::into_inner).recv().ok();
        match self {
            Self::Images { folder, names } => {
                while let Some((i, image)) = next() {
                    io::write_image(folder.join(names.name(i)), &image, background)?;
                }
                Ok(())
            }
            Self::Film { path, muxer, options, fps } => {
                let Some((_, first)) = next() else { return Ok(()) };
                let mut encoder =
                    Encoder::start(path, [first.width(), first.height()], muxer, options, *fps)?;
                let mut written = 0;
                for image in std::iter::once(first).chain(std::iter::from_fn(|| Some(next()?.1))) {
                    encoder.put(&io::to_srgb8(&image, background))?;
                    written += 1;
                }
                if written == count { encoder.finish() } else { Ok(()) }
            }
        }
    }
}

/// A running `ffmpeg`, which writes beside a film and is stopped unless it finishes.
struct Encoder {
    child: Child,
    /// The film; of a symbolic link the target.
    path: PathBuf,
    part: PathBuf,
}

impl Encoder {
    fn start(
        path: &Path,
        [width, height]: [u32; 2],
        muxer: &str,
        options: &[&str],
        fps: f64,
    ) -> Result<Self> {
        let path = path.canonicalize().unwrap_or_else(|_| path.to_path_buf());
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let part = path.with_file_name(format!(".{name}.{}.part", std::process::id()));
        // Most players need an even size, and take colours for those of HD television.
        let pixels = if muxer == "gif" {
            vec!["-filter_complex", "split[a][b];[a]palettegen[p];[b][p]paletteuse"]
        } else {
            let filter = "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709,format=yuv420p";
            let tags = ["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"];
            ["-vf", filter].into_iter().chain(tags).collect()
        };
        let child = Command::new("ffmpeg")
            .args(["-hide_banner", "-loglevel", "error", "-y", "-f", "rawvideo", "-pixel_format", "rgb24"])
            .args(["-video_size", &format!("{width}x{height}"), "-framerate", &fps.to_string(), "-i", "-"])
            .args(pixels)
            .args(options)
            .args(["-f", muxer])
            .arg(&part)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn();
        let child =
            child.map_err(|source| Error::Io { path: "ffmpeg".into(), action: "cannot run", source })?;
        Ok(Self { child, path, part })
    }

    /// Passes a frame on: three bytes for each pixel.
    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        let written = self.child.stdin.as_mut().map_or(Ok(()), |stdin| stdin.write_all(bytes));
        // Where ffmpeg has ended, its own words say why.
        if written.is_ok() { Ok(()) } else { Err(self.ended()) }
    }

    /// Waits for the end of encoding, and moves the film into its place.
    fn finish(mut self) -> Result<()> {
        drop(self.child.stdin.take());
        let status = self.child.wait();
        if !status.is_ok_and(|status| status.success()) {
            return Err(self.ended());
        }
        std::fs::rename(&self.part, &self.path).map_err(output::unwritable(&self.path))
    }

    /// Returns the error that ffmpeg reports.
    fn ended(&mut self) -> Error {
        drop(self.child.stdin.take());
        let mut text = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            // What cannot be read is not shown.
            let _ = std::io::Read::read_to_string(&mut stderr, &mut text);
        }
        let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        let said = if lines.is_empty() { "ended without a word".to_string() } else { lines.join("; ") };
        output::refuse(&self.path, "ffmpeg", &output::plain(&said))
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        // After `finish` the process has ended, and the part has its own name.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let _ = std::fs::remove_file(&self.part);
    }
}
