//! Memory figures: device memory of some work, device memory by object name, peak host memory.

use serde_json::{Map, Value};
use volraster::{GpuScene, Result};

/// Runs some work; returns its result and the growth of the device memory during it, in bytes.
pub(crate) fn device_bytes<T>(scene: &GpuScene, work: impl FnOnce() -> Result<T>) -> Result<(T, u64)> {
    let taken = || scene.gpu().memory_report().iter().map(|(_, bytes)| bytes).sum::<u64>();
    let before = taken();
    let result = work()?;
    Ok((result, taken().saturating_sub(before)))
}

/// Sums bytes by object name, in order of first appearance.
pub(super) fn summed(report: Vec<(String, u64)>) -> Value {
    let mut sums = Map::new();
    for (name, bytes) in report {
        let sum = sums.get(&name).and_then(Value::as_u64).unwrap_or(0) + bytes;
        sums.insert(name, sum.into());
    }
    Value::Object(sums)
}

/// Returns the peak resident memory of the process in bytes, where the system reports it (Linux).
pub(super) fn peak_rss_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn bytes_are_summed_by_name_and_the_peak_is_plausible() {
        let entries = [("a", 1), ("b", 5), ("a", 2)].map(|(name, n)| (name.to_string(), n));
        assert_eq!(summed(entries.to_vec()), json!({"a": 3, "b": 5}));
        if cfg!(target_os = "linux") {
            assert!(peak_rss_bytes().unwrap() > 1 << 20);
        }
    }
}
