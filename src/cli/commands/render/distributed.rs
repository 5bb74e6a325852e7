//! `--distributed`: the processes of an MPI job draw one image together (`volraster::ranks`).

use std::os::unix::process::CommandExt as _;
use std::process::Command;
use std::sync::Arc;
use std::thread::available_parallelism;
use std::time::Instant;

use serde_json::{Value, json};
use volraster::gpu::ValidationLog;
use volraster::ranks::{Communicator, Counted, Mpi, Rendered, Shares, agree, gather, render};
use volraster::scene::Scene;
use volraster::{Error, Gpu, GpuScene, Image, Result, Technique};

use super::Args;
use crate::cli::annotate::Annotations;
use crate::cli::input::{Input, Settings};
use crate::cli::memory::peak_rss_bytes;
use crate::cli::nothing::why_nothing;
use crate::cli::outcome::{Outcome, messages_found};
use crate::cli::output;
use crate::cli::timing::{gpu_ms, milliseconds_since};

/// The variable by which Mesa's software driver takes its number of threads.
const THREADS: &str = "LP_NUM_THREADS";

/// The variables by which Open MPI, MPICH and Slurm tell the number of processes on a machine.
const LOCAL_SIZES: [&str; 3] = ["OMPI_COMM_WORLD_LOCAL_SIZE", "MPI_LOCALNRANKS", "SLURM_NTASKS_PER_NODE"];

/// The scene and the device of a rank, and how it draws.
struct Prepared<'a> {
    scene: Scene,
    gpu: Gpu,
    settings: Settings,
    technique: Technique,
    annotations: Option<Annotations<'a>>,
    log: Arc<ValidationLog>,
}

impl Args {
    /// Draws with all processes of the job. The first reports and writes; the others end in silence, whatever happens.
    pub(super) fn distribute(&self, quiet: bool) -> Outcome {
        share_processors()?;
        let mpi = Mpi::join()?;
        let is_first = mpi.rank() == 0;
        let outcome = self.draw_together(mpi, quiet || !is_first);
        if is_first { outcome } else { Ok(()) }
    }

    fn draw_together(&self, mpi: Mpi, quiet: bool) -> Outcome {
        let local = mpi.local_rank();
        let ranks = Counted::new(mpi);
        let start = Instant::now();
        // The first alone looks at the files that it will write.
        let checked = if ranks.rank() == 0 { self.check_distributed() } else { Ok(()) };
        let prepared = agree(&ranks, checked.and_then(|()| self.prepare(local, quiet)))?;
        let Prepared { scene, gpu, settings, technique, annotations, log } = prepared;
        let shares = agree(&ranks, Shares::new(&scene, &settings.view, ranks.size()))?;
        let device = gpu.report().name.clone();
        let part = GpuScene::new(&gpu, shares.part(&scene, &settings.view, ranks.rank()));
        drop(gpu);
        let prepare_ms = milliseconds_since(start);
        let start = Instant::now();
        let rendered = render(&part, technique, &settings.view, &shares, &ranks)?;
        let draw_ms = milliseconds_since(start) - rendered.composite_ms;
        drop(part);
        let mut stats = of_rank(&ranks, &rendered, &device);
        stats["setup_ms"] = json!(prepare_ms);
        stats["draw_ms"] = json!(draw_ms);
        stats["validation_messages"] = json!(log.messages().len());
        let others = gather(&ranks, || stats.to_string().into_bytes())?.unwrap_or_default();
        let others = others.iter().map(|bytes| serde_json::from_slice(bytes).unwrap_or_default());
        let all: Vec<Value> = std::iter::once(stats).chain(others).collect();
        let messages = all.iter().filter_map(|rank| rank["validation_messages"].as_u64()).sum::<u64>();

        let written = match &rendered.image {
            Some(image) => {
                let nothing = why_nothing(image, &scene, &settings.view).filter(|_| !quiet);
                if let Some(why) = nothing {
                    output::complain(&format!("warning: the picture shows nothing: {why}"));
                }
                let notes = annotations.map(|notes| notes.draw(image, &settings.view)).transpose();
                notes.and_then(|own| {
                    let image = own.as_ref().unwrap_or(image);
                    self.write(image, &settings, technique, all, quiet)
                })
            }
            None => Ok(()),
        };
        agree(&ranks, written)?;
        messages_found(usize::try_from(messages).unwrap_or(usize::MAX))
    }

    /// Checks what clap cannot.
    fn check_distributed(&self) -> Result<()> {
        let given = [
            ("--frames", self.frames.is_some()),
            ("--orbit", self.orbit.is_some()),
            ("--in-flight", self.in_flight > 1),
            ("--overflow-map", self.overflow_map.is_some()),
            ("--present", self.present.is_some()),
            ("--max-error and --budget", self.choice.goal().is_some()),
            ("several files", self.scenes.len() > 1),
            ("numbered images and films", super::Sink::of(&self.output, self.fps)?.is_some()),
        ];
        if let Some((what, _)) = given.into_iter().find(|(_, given)| *given) {
            let why = format!("draws one image of one file: {what} are for one process");
            return Err(Error::Invalid { what: "--distributed".to_string(), why });
        }
        self.check(&self.scenes, None)
    }

    /// Opens file and device. The samples of a grid stay in the file, of which a rank then reads its part.
    fn prepare(&self, local: u32, quiet: bool) -> Result<Prepared<'_>> {
        let mut arrays = self.arrays.clone();
        arrays.in_files = true;
        let input = Input::load(&self.scenes[0], self.size, &arrays, quiet)?;
        let Input { scene, settings } = self.look.apply(input)?;
        let technique = settings.choose(self.choice.request()?, &scene)?;
        let array = settings.report.shown_name();
        let annotations = self.annotations.prepare(&scene, array, settings.background)?;
        let (gpu, log) = self.device.open_with(self.validate, |options| {
            arrays.limit(options);
            options.nth = local;
        })?;
        Ok(Prepared { scene, gpu, settings, technique, annotations, log })
    }

    fn write(
        &self,
        image: &Image,
        settings: &Settings,
        technique: Technique,
        ranks: Vec<Value>,
        quiet: bool,
    ) -> Result<()> {
        volraster::io::write_image(&self.output, image, settings.background)?;
        let (name, count) = (technique.method().name(), ranks.len());
        if let Some(path) = &self.stats {
            let stats =
                json!({"schema": 1, "technique": name, "image": settings.view.extent(), "ranks": ranks});
            output::write_json(path, &stats)?;
        }
        if !quiet {
            let [width, height] = settings.view.extent();
            let path = self.output.display();
            output::print(&format!("{name} on {count} ranks: {width} x {height}: {path}"))?;
        }
        Ok(())
    }
}

/// Describes what this rank did.
fn of_rank(ranks: &Counted<Mpi>, rendered: &Rendered, device: &str) -> Value {
    let Rendered { frame, composite_ms, .. } = rendered;
    let mut stats = json!({
        "rank": ranks.rank(),
        "device": device,
        "wall_ms": frame.wall_ms,
        "gpu_ms": gpu_ms(frame),
        "composite_ms": composite_ms,
        "bytes_sent": ranks.sent(),
        "peak_rss_bytes": peak_rss_bytes(),
    });
    for (key, count) in &frame.counters {
        stats[key] = json!(count);
    }
    stats
}

/// Gives a software driver this process's share of the processors, by starting the program anew where the variable is not set: the driver reads it
/// when it is loaded.
fn share_processors() -> Result<()> {
    let local = LOCAL_SIZES.iter().find_map(|name| std::env::var(name).ok()?.parse::<usize>().ok());
    let (Some(local), None) = (local.filter(|&local| local > 1), std::env::var_os(THREADS)) else {
        return Ok(());
    };
    let threads = (available_parallelism().map_or(1, usize::from) / local).max(1);
    let program = std::env::current_exe().map_err(|source| io("this program", source))?;
    let error =
        Command::new(&program).args(std::env::args_os().skip(1)).env(THREADS, threads.to_string()).exec();
    Err(io(&program.display().to_string(), error))
}

fn io(path: &str, source: std::io::Error) -> Error {
    Error::Io { path: path.into(), action: "cannot start", source }
}
