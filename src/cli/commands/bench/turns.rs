//! Timing cases in turn, and what disturbs their frames.

use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use volraster::peak::Pulse;
use volraster::scene::View;
use volraster::{Gpu, Result};

use super::case::Case;
use crate::cli::interrupt;
use crate::cli::load::Load;
use crate::cli::sensors::Sensors;
use crate::cli::timing::milliseconds_since;

/// How much longer fixed work takes on a device that counts as slower.
const SLOWER: f64 = 0.1;

/// How long other work is watched before frames are judged by it: Linux counts it in steps of 10 ms.
const WATCH: Duration = Duration::from_millis(300);

/// Times cases in rounds of one frame each, in alternating directions, until each has enough frames or the user requests a stop.
pub(super) fn time(cases: &mut [Case], view: &View, watch: &mut Watch, bar: &ProgressBar) -> Result<()> {
    watch.begin()?;
    let begin = Instant::now();
    let mut open: Vec<usize> = (0..cases.len()).collect();
    while !open.is_empty() {
        for &place in &open {
            if interrupt::requested() {
                return Ok(());
            }
            if let Some(frame) = cases[place].time(view)? {
                watch.frame(cases, place, frame)?;
            }
        }
        let before = open.len();
        let wanting = |cases: &[Case]| {
            let elapsed_ms = milliseconds_since(begin);
            open.iter().copied().filter(|&place| cases[place].wants_more(elapsed_ms)).collect()
        };
        let mut next: Vec<usize> = wanting(cases);
        if next.is_empty() {
            // The last frames may have to be repeated.
            watch.judge(cases)?;
            next = wanting(cases);
        }
        open = next;
        open.reverse();
        bar.inc((before - open.len()) as u64);
    }
    Ok(())
}

/// Watches what disturbs frames: other programs' work on the processors of a software device, a device that holds its clock down, and
/// one that is slower for a while for reasons that it does not tell, by the [`Pulse`] between frames.
pub(super) struct Watch {
    is_software: bool,
    sensors: Option<Sensors>,
    pulse: Pulse,
    /// The fastest pulse of the run.
    best: f64,
    load: Option<Load>,
    since: Instant,
    /// The frames since, each with its case.
    frames: Vec<(usize, usize)>,
    /// The pulse before them.
    before: f64,
    /// The frames of the view that were judged, with the faster of the pulses before and after them: a burst is not a slower device.
    judged: Vec<(Vec<(usize, usize)>, f64)>,
}

impl Watch {
    /// Prepares to watch a device.
    ///
    /// # Errors
    ///
    /// Those of [`Pulse::new`].
    pub(super) fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            is_software: gpu.is_software(),
            sensors: Sensors::of(gpu.report()),
            pulse: Pulse::new(gpu)?,
            best: 0.0,
            load: None,
            since: Instant::now(),
            frames: Vec::new(),
            before: 0.0,
            judged: Vec::new(),
        })
    }

    /// Begins to watch the cases of a view.
    fn begin(&mut self) -> Result<()> {
        self.frames.clear();
        self.judged.clear();
        self.before = self.pulse.per_second()?;
        self.best = self.best.max(self.before);
        self.load = Load::watch();
        self.since = Instant::now();
        Ok(())
    }

    /// Notes a frame that a case has drawn, and judges it with those before once they have taken long enough.
    fn frame(&mut self, cases: &mut [Case], case: usize, frame: usize) -> Result<()> {
        self.frames.push((case, frame));
        if self.since.elapsed() >= WATCH { self.judge(cases) } else { Ok(()) }
    }

    /// Judges the frames since the last judgement, and those before anew by the fastest pulse.
    fn judge(&mut self, cases: &mut [Case]) -> Result<()> {
        let reading = self.sensors.as_ref().map(Sensors::read);
        let throttled = reading.as_ref().and_then(|reading| reading.throttled.as_ref());
        let throttled = throttled.map(|why| format!("the device was throttled: {why}"));
        let loaded = self.load.as_ref().and_then(Load::note).filter(|_| self.is_software);
        let why = throttled.or(loaded);
        for &(case, frame) in &self.frames {
            if let Some(why) = &why {
                cases[case].disturb(frame, why);
            }
            if let Some(reading) = &reading {
                cases[case].sensed(reading.clone());
            }
        }
        let after = self.pulse.per_second()?;
        // Those judged before are slower by a new best.
        let first = if after > self.best { 0 } else { self.judged.len() };
        self.best = self.best.max(after);
        self.judged.push((std::mem::take(&mut self.frames), self.before.max(after)));
        for (frames, pulse) in &self.judged[first..] {
            let slower = self.best / pulse;
            for &(case, frame) in frames.iter().filter(|_| slower > 1.0 + SLOWER) {
                cases[case].disturb(frame, &format!("fixed work beside them took {slower:.2} times as long"));
            }
        }
        self.before = after;
        self.load = Load::watch();
        self.since = Instant::now();
        Ok(())
    }

    /// Returns the fastest pulse while the cases of the view were timed, or just before if none of their frames is judged yet.
    pub(super) fn pulse(&self) -> f64 {
        self.judged.iter().map(|(_, pulse)| *pulse).fold(self.before, f64::max)
    }
}
