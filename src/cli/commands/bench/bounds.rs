//! Bounds of cases: the least time that the device's peaks allow for the work of a frame, and its share of the time measured.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use volraster::peak::{self, Peak};
use volraster::{Gpu, Result};

use super::record::{Bound, EVALUATIONS, Record, word};
use crate::cli::numbers::count;

/// The peaks of the device that a run measures on.
#[derive(Debug, Default)]
pub(super) struct Peaks(Vec<Peak>);

impl Peaks {
    /// Measures them.
    ///
    /// # Errors
    ///
    /// Those of [`peak::measure`].
    pub(super) fn measure(gpu: &Gpu) -> Result<Self> {
        Ok(Self(peak::measure(gpu)?))
    }

    /// Returns the number per second of each kind of work.
    pub(super) fn json(&self) -> Value {
        self.0.iter().map(|peak| (peak.name.to_string(), json!(peak.per_second))).collect()
    }

    /// Returns rows of a table, below a heading.
    pub(super) fn rows(&self) -> Vec<Vec<String>> {
        let heading = ["peak", "per second", "of"].map(str::to_string).to_vec();
        let row = |peak: &Peak| vec![peak.name.to_string(), count(peak.per_second), peak.what.to_string()];
        std::iter::once(heading).chain(self.0.iter().map(row)).collect()
    }

    fn per_second(&self, name: &str) -> Option<f64> {
        self.0.iter().find(|peak| peak.name == name).map(|peak| peak.per_second)
    }

    /// Returns what bounds a case with counters and times.
    pub(super) fn bound(&self, case: &Record) -> Option<Bound> {
        let measured = case.ms()?;
        let mut least_ms = BTreeMap::new();
        for (name, number) in work(case) {
            if let Some(per_second) = self.per_second(&name) {
                least_ms.insert(name, 1e3 * number / per_second);
            }
        }
        let (by, least) = least_ms.iter().max_by(|a, b| a.1.total_cmp(b.1))?;
        let (by, share) = (by.clone(), least / measured);
        Some(Bound { by, least_ms, share })
    }
}

/// Returns how much of each kind of work a frame of a case needs.
fn work(case: &Record) -> Vec<(String, f64)> {
    let counter = |name| case.counter(name);
    let option = |key: &str| case.options.get(key).map(word).unwrap_or_default();
    let mut work = Vec::new();
    if let Some([read, written]) = case.bytes {
        work.push(("buffer_bytes".to_string(), (read + written) as f64));
    }
    if let (Some(fetches), Some(bytes)) = (counter("fetches"), counter("voxel_bytes")) {
        let kind = if option("filter") == "exact" { "texels" } else { "filtered" };
        let format = match bytes {
            bytes if bytes < 2.0 => "r8",
            bytes if bytes < 4.0 => "r16",
            _ => "r32f",
        };
        work.push((format!("{kind}.{format}"), fetches));
    }
    if let Some(pairs) = counter("pairs").or_else(|| counter("bin_entries")) {
        work.push(("sorted_pairs".to_string(), pairs));
    }
    // A fragment of a mesh takes one; a splat one for each pixel of a tile, unless rays end before.
    let ends = !["0", "0.0", ""].contains(&option("stop").as_str());
    let evaluations = counter("pairs").filter(|_| !ends).map(|pairs| pairs * EVALUATIONS);
    if let Some(number) = counter("fragments").or(evaluations) {
        work.push(("exponentials".to_string(), number));
    }
    work
}

#[cfg(test)]
mod tests {
    use super::super::record::case;
    use super::*;

    #[test]
    fn the_work_that_takes_longest_bounds_a_case() {
        let peak = |name, per_second| Peak { name, what: "", per_second };
        let peaks = Peaks(vec![
            peak("filtered.r16", 1e6),
            peak("texels.r16", 8e6),
            peak("buffer_bytes", 1e9),
            peak("sorted_pairs", 1e6),
            peak("exponentials", 1e8),
        ]);
        let mut grid = case("slabs", "compute", "", 1e-3, &[10.0]);
        assert!(peaks.bound(&grid).is_none(), "without counters there is no bound");
        grid.bytes = Some([1_000_000, 500_000]);
        for (name, number) in [("fetches", 4000), ("voxel_bytes", 2)] {
            grid.counters.insert(name.to_string(), json!(number));
        }
        let bound = peaks.bound(&grid).unwrap();
        assert_eq!((bound.by.as_str(), bound.ms(), bound.share), ("filtered.r16", 4.0, 0.4));
        assert!((bound.least_ms["buffer_bytes"] - 1.5).abs() < 1e-12, "{bound:?}");
        // Single fetches are faster, so that bytes bound.
        grid.options.insert("filter".to_string(), json!("exact"));
        let bound = peaks.bound(&grid).unwrap();
        assert_eq!((bound.by.as_str(), bound.least_ms["texels.r16"]), ("buffer_bytes", 0.5));
        // The time on the device counts, where it is known.
        grid.gpu_ms = crate::cli::timing::Quantiles::new(vec![3.0]);
        assert!((peaks.bound(&grid).unwrap().share - 0.5).abs() < 1e-12);
        // A device without 8-bit volumes has no peak for them.
        grid.counters.insert("voxel_bytes".to_string(), json!(1));
        assert!(!peaks.bound(&grid).unwrap().least_ms.contains_key("texels.r8"));
        let mut splats = case("splat-ewa", "compute", "stop=0", 1e-3, &[10.0]);
        splats.counters.insert("pairs".to_string(), json!(1000));
        let of = |splats: &Record| peaks.bound(splats).unwrap().least_ms.into_keys().collect::<Vec<_>>();
        assert_eq!(of(&splats), ["exponentials", "sorted_pairs"]);
        splats.options.insert("stop".to_string(), json!(0.01));
        assert_eq!(of(&splats), ["sorted_pairs"]);
    }
}
