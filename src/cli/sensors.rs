//! Clock, temperature, power and throttling of the device, and the governor of processors, by which times differ from run to run.
//!
//! NVIDIA's library answers for its GPUs (NVML, loaded at run time where it is installed), files of Linux for those of the drivers amdgpu,
//! xe and i915, and for processors.

use std::fs;
use std::path::{Path, PathBuf};

use nvml_wrapper::Nvml;
use nvml_wrapper::bitmasks::device::ThrottleReasons;
use nvml_wrapper::enum_wrappers::device::{Clock, TemperatureSensor};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use volraster::gpu::DeviceReport;

/// A reading of sensors at one time. It leaves out values that they do not tell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(deny_unknown_fields)]
pub(crate) struct Reading {
    /// Clock of the shader cores, or of a software device's fastest processor, in MHz.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) clock_mhz: Option<f64>,
    /// Temperature in degrees Celsius.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) temperature_c: Option<f64>,
    /// Power in watts.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) power_w: Option<f64>,
    /// Why the device holds its clock down, if it does.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) throttled: Option<String>,
    /// How the clock of processors is governed, of software devices.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) governor: Option<String>,
}

/// The sensors of a device.
pub(crate) enum Sensors {
    /// NVML, and the number of the device there.
    Nvidia(Box<Nvml>, u32),
    /// The folder of a card of Linux' graphics drivers.
    Card(PathBuf),
    /// The folder of Linux' processors.
    Processors(PathBuf),
}

impl Sensors {
    /// Finds the sensors of a device; `None` where nothing tells.
    pub(crate) fn of(device: &DeviceReport) -> Option<Self> {
        if device.kind == "cpu" {
            let folder = PathBuf::from("/sys/devices/system/cpu");
            return folder.exists().then_some(Self::Processors(folder));
        }
        nvidia(&device.uuid).or_else(|| card(Path::new("/sys/class/drm"), device.ids).map(Self::Card))
    }

    /// Reads all that is told.
    pub(crate) fn read(&self) -> Reading {
        match self {
            Self::Nvidia(nvml, number) => read_nvidia(nvml, *number),
            Self::Card(folder) => read_card(folder),
            Self::Processors(folder) => read_processors(folder),
        }
    }
}

/// Finds the device of an identifier, which Vulkan and NVML write differently.
fn nvidia(uuid: &str) -> Option<Sensors> {
    let nvml = Nvml::init().ok()?;
    let is_it = |&number: &u32| {
        let name = nvml.device_by_index(number).and_then(|device| device.uuid());
        name.is_ok_and(|name| name.trim_start_matches("GPU-").replace('-', "") == uuid)
    };
    let number = (0..nvml.device_count().ok()?).find(is_it)?;
    Some(Sensors::Nvidia(Box::new(nvml), number))
}

fn read_nvidia(nvml: &Nvml, number: u32) -> Reading {
    let Ok(device) = nvml.device_by_index(number) else { return Reading::default() };
    // That it is idle is no throttling.
    let reasons = device.current_throttle_reasons().unwrap_or(ThrottleReasons::empty());
    let reasons = reasons - ThrottleReasons::GPU_IDLE - ThrottleReasons::NONE;
    let names: Vec<String> =
        reasons.iter_names().map(|(name, _)| name.to_lowercase().replace('_', " ")).collect();
    Reading {
        clock_mhz: device.clock_info(Clock::SM).ok().map(f64::from),
        temperature_c: device.temperature(TemperatureSensor::Gpu).ok().map(f64::from),
        power_w: device.power_usage().ok().map(|milliwatts| f64::from(milliwatts) / 1e3),
        throttled: (!names.is_empty()).then(|| names.join(", ")),
        governor: None,
    }
}

/// Returns the text of a file, without the end of the line.
fn text(path: impl AsRef<Path>) -> Option<String> {
    fs::read_to_string(path).ok().map(|text| text.trim().to_string())
}

fn number(path: impl AsRef<Path>) -> Option<f64> {
    text(path)?.parse().ok()
}

/// Returns the entries of a folder whose names begin so, by name.
fn entries(folder: &Path, begin: &str) -> Vec<PathBuf> {
    let named =
        |path: &PathBuf| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(begin));
    let mut found: Vec<PathBuf> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .filter(named)
        .collect();
    found.sort();
    found
}

/// Finds the folder of the first card with these identifiers of vendor and device.
fn card(folder: &Path, ids: [u32; 2]) -> Option<PathBuf> {
    let hexadecimal = |path: PathBuf| u32::from_str_radix(text(path)?.trim_start_matches("0x"), 16).ok();
    let is_it = |card: &PathBuf| {
        ["vendor", "device"].map(|name| hexadecimal(card.join("device").join(name))) == ids.map(Some)
    };
    entries(folder, "card").into_iter().find(is_it)
}

fn read_card(folder: &Path) -> Reading {
    let device = folder.join("device");
    let sensors = entries(&device.join("hwmon"), "hwmon").into_iter().next().unwrap_or_default();
    // amdgpu: its clock in Hz; xe and i915: in MHz.
    let clocks = [
        (sensors.join("freq1_input"), 1e-6),
        (device.join("tile0/gt0/freq0/act_freq"), 1.0),
        (folder.join("gt_act_freq_mhz"), 1.0),
    ];
    // Each reason is a file that holds 1 while it applies.
    let reasons = entries(&device.join("tile0/gt0/freq0/throttle"), "reason_");
    let name = |path: &PathBuf| {
        let name = path.file_name()?.to_string_lossy().trim_start_matches("reason_").replace('_', " ");
        (number(path) == Some(1.0)).then_some(name)
    };
    let names: Vec<String> = reasons.iter().filter_map(name).collect();
    let micro = |name: &str| number(sensors.join(name)).map(|micro| micro * 1e-6);
    Reading {
        clock_mhz: clocks.iter().find_map(|(path, unit)| number(path).map(|clock| clock * unit)),
        temperature_c: number(sensors.join("temp1_input")).map(|milli| milli * 1e-3),
        power_w: micro("power1_average").or_else(|| micro("power1_input")),
        throttled: (!names.is_empty()).then(|| names.join(", ")),
        governor: None,
    }
}

fn read_processors(folder: &Path) -> Reading {
    let frequencies = entries(folder, "cpu").into_iter().map(|processor| processor.join("cpufreq"));
    let frequencies: Vec<PathBuf> = frequencies.filter(|folder| folder.exists()).collect();
    let clocks = frequencies.iter().filter_map(|folder| number(folder.join("scaling_cur_freq")));
    Reading {
        clock_mhz: clocks.map(|kilohertz| kilohertz * 1e-3).reduce(f64::max),
        governor: frequencies.first().and_then(|folder| text(folder.join("scaling_governor"))),
        ..Reading::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes files below a folder of their own.
    fn files(name: &str, files: &[(&str, &str)]) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("volraster-{name}-{}", std::process::id()));
        for (path, text) in files {
            let path = folder.join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, format!("{text}\n")).unwrap();
        }
        folder
    }

    #[test]
    fn cards_are_found_by_their_identifiers() {
        let folder = files(
            "cards",
            &[
                ("card0/device/vendor", "0x8086"),
                ("card0/device/device", "0x56a0"),
                ("card1/device/vendor", "0x1002"),
                ("card1/device/device", "0x744c"),
                ("card1/device/hwmon/hwmon3/freq1_input", "2304000000"),
                ("card1/device/hwmon/hwmon3/temp1_input", "61000"),
                ("card1/device/hwmon/hwmon3/power1_average", "214000000"),
                ("card0/device/tile0/gt0/freq0/act_freq", "1950"),
                ("card0/device/tile0/gt0/freq0/throttle/reason_thermal", "1"),
                ("card0/device/tile0/gt0/freq0/throttle/reason_pl1", "0"),
                ("card2/device/vendor", "0x8086"),
                ("card2/device/device", "0x9a49"),
                ("card2/gt_act_freq_mhz", "1300"),
                ("version", "drm"),
            ],
        );
        let amd = read_card(&card(&folder, [0x1002, 0x744c]).unwrap());
        let want = Reading {
            clock_mhz: Some(2304.0),
            temperature_c: Some(61.0),
            power_w: Some(214.0),
            throttled: None,
            governor: None,
        };
        assert_eq!(amd, want);
        let intel = read_card(&card(&folder, [0x8086, 0x56a0]).unwrap());
        assert_eq!((intel.clock_mhz, intel.throttled.as_deref()), (Some(1950.0), Some("thermal")));
        let older = read_card(&card(&folder, [0x8086, 0x9a49]).unwrap());
        assert_eq!((older.clock_mhz, older.throttled), (Some(1300.0), None));
        assert_eq!(card(&folder, [0x1002, 0x56a0]), None);
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn processors_tell_their_clock_and_governor() {
        let folder = files(
            "processors",
            &[
                ("cpu0/cpufreq/scaling_cur_freq", "1800000"),
                ("cpu0/cpufreq/scaling_governor", "powersave"),
                ("cpu1/cpufreq/scaling_cur_freq", "3100000"),
                ("cpuidle/current_driver", "none"),
            ],
        );
        let reading = read_processors(&folder);
        assert_eq!((reading.clock_mhz, reading.governor.as_deref()), (Some(3100.0), Some("powersave")));
        assert_eq!(read_processors(&folder.join("cpuidle")), Reading::default());
        fs::remove_dir_all(folder).unwrap();
    }
}
