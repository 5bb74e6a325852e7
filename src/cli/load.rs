//! Work of other programs on the processors of this machine, which delays what is measured.

use std::time::Instant;

/// Parts of a second in which Linux counts the time of processors.
const TICKS: f64 = 100.0;

/// The part of the processors from which on others' work is mentioned.
const NOTABLE: f64 = 0.1;

/// A watch on the work of other programs.
pub(crate) struct Load {
    ticks: u64,
    begin: Instant,
}

impl Load {
    /// Begins to watch; `None` if the system does not tell.
    pub(crate) fn watch() -> Option<Self> {
        Some(Self { ticks: of_others()?, begin: Instant::now() })
    }

    /// Returns the number of processors that others have taken since, on average.
    pub(crate) fn others(&self) -> Option<f64> {
        Some(taken(of_others()?.saturating_sub(self.ticks), self.begin.elapsed().as_secs_f64()))
    }

    /// Returns a sentence on others' work if it took a notable part of the processors.
    pub(crate) fn note(&self) -> Option<String> {
        let processors = std::thread::available_parallelism().ok()?.get();
        let others = self.others().filter(|others| is_notable(*others, processors))?;
        Some(format!("other programs took {others:.1} of {processors} processors meanwhile"))
    }
}

/// Returns the number of processors that were busy for a number of ticks in a time.
fn taken(ticks: u64, seconds: f64) -> f64 {
    ticks as f64 / TICKS / seconds.max(1.0 / TICKS)
}

/// Returns whether others' work on a number of processors is mentioned.
fn is_notable(others: f64, processors: usize) -> bool {
    others > NOTABLE * processors as f64
}

/// Returns the time that processors have spent for others, also for other guests of a virtual machine's host.
fn of_others() -> Option<u64> {
    difference(
        &std::fs::read_to_string("/proc/stat").ok()?,
        &std::fs::read_to_string("/proc/self/stat").ok()?,
    )
}

/// Returns the time in `/proc/stat` that `/proc/self/stat` does not claim. The two are counted in different ways, so
/// that it may fall by some ticks from one look to the next.
fn difference(all: &str, this: &str) -> Option<u64> {
    Some(busy(all)?.saturating_sub(own(this)?))
}

/// Returns the sum of user, nice, system, irq, softirq and steal in the first line of `/proc/stat`.
fn busy(text: &str) -> Option<u64> {
    let line = text.lines().next()?.strip_prefix("cpu ")?;
    let times: Vec<u64> = line.split_whitespace().map_while(|word| word.parse().ok()).collect();
    [0, 1, 2, 5, 6, 7].into_iter().map(|place| times.get(place).copied()).sum()
}

/// Returns the sum of utime and stime in `/proc/self/stat`, where a name in parentheses may contain blanks.
fn own(text: &str) -> Option<u64> {
    let (_, fields) = text.rsplit_once(')')?;
    let mut times = fields.split_whitespace().skip(11).map(|word| word.parse::<u64>().ok());
    Some(times.next()?? + times.next()??)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_of_linux() {
        assert_eq!(busy("cpu  1 20 300 4000 50000 6 70 800 9 9\ncpu0 5"), Some(1 + 20 + 300 + 6 + 70 + 800));
        assert_eq!(busy("intr 5"), None);
        assert_eq!(own("77 (a ) b) S 1 2 3 4 5 6 7 8 9 10 500 60 7 8"), Some(560));
    }

    /// Of twenty runs beside a busy process each is recognised; a window without one hardly ever is.
    #[test]
    fn a_busy_process_is_recognised() {
        let recorded: serde_json::Value = serde_json::from_str(include_str!("recorded.json")).unwrap();
        let windows = |name: &str| -> Vec<Vec<bool>> {
            let runs: Vec<Vec<(u64, f64)>> = serde_json::from_value(recorded["load"][name].clone()).unwrap();
            let notable = |&(ticks, seconds): &(u64, f64)| is_notable(taken(ticks, seconds), 2);
            runs.iter().map(|run| run.iter().map(notable).collect()).collect()
        };
        let busy = windows("busy");
        assert_eq!((busy.len(), busy.concat().len()), (20, 160));
        assert!(busy.iter().all(|run| run.iter().filter(|&&window| window).count() >= 6), "{busy:?}");
        let quiet = windows("quiet").concat();
        assert!(quiet.iter().filter(|&&window| window).count() <= 1, "{quiet:?}");
    }

    /// Its own work is not that of others, and a count of its own work that runs ahead is no negative time.
    #[test]
    fn own_work_is_left_out() {
        let all = "cpu  500 0 60 4000 0 0 0 7";
        assert_eq!(difference(all, "77 (a) S 1 2 3 4 5 6 7 8 9 10 300 60 7 8"), Some(207));
        assert_eq!(difference(all, "77 (a) S 1 2 3 4 5 6 7 8 9 10 560 60 7 8"), Some(0));
    }
}
