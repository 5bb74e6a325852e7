//! Timing cases in turn, and what disturbs their frames.

use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use volraster::scene::View;
use volraster::{Gpu, Result};

use super::case::Case;
use crate::cli::interrupt;
use crate::cli::load::Load;
use crate::cli::sensors::Sensors;

/// How long other work is watched before frames are judged by it: Linux counts it in steps of 10 ms.
const WATCH: Duration = Duration::from_millis(300);

/// Times cases in rounds of one frame each, in alternating directions, until each has enough frames or the user requests a stop.
pub(super) fn time(cases: &mut [Case], view: &View, gpu: &Gpu, bar: &ProgressBar) -> Result<()> {
    let mut watch = Watch::begin(gpu);
    let mut open: Vec<usize> = (0..cases.len()).collect();
    while !open.is_empty() {
        for &place in &open {
            if interrupt::requested() {
                return Ok(());
            }
            if let Some(frame) = cases[place].time(view)? {
                watch.frame(cases, place, frame);
            }
        }
        let before = open.len();
        let wanting =
            |cases: &[Case]| open.iter().copied().filter(|&place| cases[place].wants_more()).collect();
        let mut next: Vec<usize> = wanting(cases);
        if next.is_empty() {
            // The last frames may have to be repeated.
            watch.judge(cases);
            next = wanting(cases);
        }
        open = next;
        open.reverse();
        bar.inc((before - open.len()) as u64);
    }
    Ok(())
}

/// Watches what disturbs frames: other programs' work on the processors of a software device, and a device that holds its clock down.
struct Watch {
    is_software: bool,
    sensors: Option<Sensors>,
    load: Option<Load>,
    since: Instant,
    /// The frames since, each with its case.
    frames: Vec<(usize, usize)>,
}

impl Watch {
    fn begin(gpu: &Gpu) -> Self {
        Self {
            is_software: gpu.is_software(),
            sensors: Sensors::of(gpu.report()),
            load: Load::watch(),
            since: Instant::now(),
            frames: Vec::new(),
        }
    }

    /// Notes a frame that a case has drawn, and judges it with those before once they have taken long enough.
    fn frame(&mut self, cases: &mut [Case], case: usize, frame: usize) {
        self.frames.push((case, frame));
        if self.since.elapsed() >= WATCH {
            self.judge(cases);
        }
    }

    /// Judges the frames since the last judgement.
    fn judge(&mut self, cases: &mut [Case]) {
        let reading = self.sensors.as_ref().map(Sensors::read);
        let throttled = reading.as_ref().and_then(|reading| reading.throttled.as_ref());
        let throttled = throttled.map(|why| format!("the device was throttled: {why}"));
        let loaded = self.load.as_ref().and_then(Load::note).filter(|_| self.is_software);
        let why = throttled.or(loaded);
        for (case, frame) in self.frames.drain(..) {
            if let Some(why) = &why {
                cases[case].disturb(frame, why);
            }
            if let Some(reading) = &reading {
                cases[case].sensed(reading.clone());
            }
        }
        self.load = Load::watch();
        self.since = Instant::now();
    }
}
