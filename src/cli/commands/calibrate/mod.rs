//! `volraster calibrate`: measures what settings cost on this device, or checks choices on random scenes (`draws`).

mod draws;

use volraster::choice::{Profile, Source};

use self::draws::Check;
use crate::cli::input::{DeviceArgs, Size};
use crate::cli::load::Load;
use crate::cli::outcome::{Failure, Outcome};
use crate::cli::output;
use crate::cli::timing::Times;

/// Arguments of `calibrate`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Check choices instead of measuring: choose for N random scenes, cameras, transfer functions and error goals
    /// with the stored costs of this device, and compare each choice with all settings. The exit code is 1 unless 95
    /// % of the choices meet their goal.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    check: Option<u32>,
    /// Random seed of --check.
    #[arg(long, value_name = "SEED", default_value_t = 1, requires = "check")]
    seed: u32,
    /// Image size of --check.
    #[arg(long, value_name = "WxH", value_parser = Size::parse, default_value = "128x128", requires = "check")]
    size: Size,
    /// Store the costs even if other programs took processors, which makes the times of some settings too long.
    #[arg(long)]
    busy: bool,
    #[command(flatten)]
    device: DeviceArgs,
}

impl Args {
    /// Runs the command. It fails when too few choices meet their goal.
    pub(crate) fn run(&self, quiet: bool) -> Outcome {
        let (gpu, _) = self.device.open(false)?;
        if let Some(count) = self.check {
            let profile = Profile::load(&gpu);
            let bar = output::progress(u64::from(count), "choices");
            let mut progress = |done: u32, line: &str| {
                bar.set_position(done.into());
                if !quiet {
                    bar.suspend(|| output::print(line).unwrap_or(()));
                }
            };
            let found = draws::check(&gpu, &profile, [count, self.seed], self.size, &mut progress)?;
            bar.finish_and_clear();
            return report(found, &profile);
        }
        Profile::check_store(&gpu)?;
        let bar = output::progress(0, "settings");
        let load = Load::watch();
        let profile = Profile::measure(&gpu, &mut |done, all| {
            bar.set_length(u64::try_from(all).unwrap_or(0));
            bar.set_position(u64::try_from(done).unwrap_or(0));
        })?;
        bar.finish_and_clear();
        if let Some(note) = load.as_ref().and_then(Load::note).filter(|_| !self.busy) {
            return Err(Failure::Finding(format!(
                "{note}: nothing is stored, --busy stores what was measured"
            )));
        }
        let path = profile.store(&gpu)?;
        if !quiet {
            let (count, device) = (profile.costs().count(), &gpu.report().name);
            output::print(&format!("{count} settings on {device}: {}", path.display()))?;
        }
        Ok(())
    }
}

/// Percentage of choices that must meet their goal.
const PROMISED: f64 = 95.0;

fn report(found: Check, profile: &Profile) -> Outcome {
    let Check { possible, held, refused, ratios, trials } = found;
    let source = match profile.source() {
        Source::BuiltIn => "built-in costs",
        Source::Measured => "costs measured on this device",
    };
    output::print(&format!(
        "held: {held} of {possible}; no setting meets the goal and none was chosen: {refused}"
    ))?;
    if let (Some(ratios), Some(trials)) = (Times::new(ratios), Times::new(trials)) {
        output::print(&format!(
            "time relative to the fastest setting that meets the goal: median {:.2}, 95 % below {:.2}; trials: median {}, \
             maximum {}; with {source}",
            ratios.median(),
            ratios.quantile(95),
            trials.median(),
            trials.quantile(100)
        ))?;
    }
    if f64::from(held) * 100.0 < PROMISED * f64::from(possible) {
        return Err(Failure::Finding(format!("only {held} of {possible} choices meet their goal")));
    }
    Ok(())
}
