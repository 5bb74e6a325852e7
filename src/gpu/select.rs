//! Choice of a physical device, with the reason why each device was chosen or rejected.

use ash::vk;
use serde::Serialize;

use super::instance::{Instance, version_text};
use crate::error::{Error, Result};
use crate::num;

/// A device of the system, and whether it was chosen.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceReport {
    /// The device's name.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub kind: &'static str,
    /// Driver name and version.
    pub driver: String,
    /// Vulkan version that the device supports.
    pub api: String,
    /// The driver's identifier of the device, in hexadecimal digits.
    pub uuid: String,
    /// The name of the driver in Vulkan, such as `MESA_LLVMPIPE`.
    pub driver_id: String,
    /// The driver's version, in a form of its own.
    pub driver_version: u32,
    /// The identifiers of vendor and device, as buses have them.
    pub ids: [u32; 2],
    /// Whether this device was chosen.
    pub chosen: bool,
    /// Why it was chosen or rejected.
    pub reason: String,
}

/// An inspected device.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    pub(crate) raw: vk::PhysicalDevice,
    pub(crate) properties: vk::PhysicalDeviceProperties,
    pub(crate) queue_family: u32,
    pub(crate) timestamp_bits: u32,
    pub(crate) orders_stores: bool,
    pub(crate) report: DeviceReport,
    /// The missing requirement; `None` when the device qualifies.
    pub(super) refused: Option<String>,
}

/// The properties that decide the choice, separate from Vulkan so that tests can make them.
#[derive(Clone, Debug)]
struct Offer<'a> {
    name: &'a str,
    kind: &'static str,
    refused: Option<&'a str>,
}

/// Returns the preference of a kind of device; lower is better: a real GPU comes before a software one.
fn rank(kind: &str) -> usize {
    ["discrete", "integrated", "virtual", "other", "cpu"].iter().position(|&k| k == kind).unwrap_or(3)
}

/// Returns the index of the best offer, and the reason for each one.
fn choose(offers: &[Offer<'_>], wanted: Option<&str>, nth: u32) -> (Option<usize>, Vec<String>) {
    let matches = |name: &str| wanted.is_none_or(|w| name.to_lowercase().contains(&w.to_lowercase()));
    let usable = || (0..offers.len()).filter(|&i| offers[i].refused.is_none() && matches(offers[i].name));
    let kind = usable().map(|i| rank(offers[i].kind)).min();
    let of_kind: Vec<usize> = usable().filter(|&i| Some(rank(offers[i].kind)) == kind).collect();
    let best = of_kind.get(num::index(nth) % of_kind.len().max(1)).copied();
    let verdicts = offers.iter().enumerate().map(|(i, offer)| match (best, wanted) {
        (Some(b), Some(w)) if b == i => format!("its name contains \"{w}\""),
        (Some(b), None) if b == i && offer.kind == "cpu" => "no real GPU qualifies".to_string(),
        (Some(b), _) if b == i && of_kind[0] != i => "its number among those of the best kind".to_string(),
        (Some(b), _) if b == i => "first of the best kind".to_string(),
        _ if !matches(offer.name) => format!("its name does not contain \"{}\"", wanted.unwrap_or_default()),
        _ => match (offer.refused, best) {
            (Some(lack), _) => lack.to_string(),
            (None, Some(b)) if rank(offers[b].kind) < rank(offer.kind) => {
                format!("usable, but a {} device is taken before a {} one", offers[b].kind, offer.kind)
            }
            (None, Some(b)) if b > i => "usable, but another number of its kind is asked for".to_string(),
            _ => "usable, but another of its kind comes first".to_string(),
        },
    });
    let verdicts = verdicts.collect();
    (best, verdicts)
}

/// Inspects every device. Returns the index of the one to open, and all.
pub(crate) fn survey(
    instance: &Instance,
    wanted: Option<&str>,
    nth: u32,
) -> Result<(Option<usize>, Vec<Candidate>)> {
    // SAFETY: the instance is alive.
    let devices = unsafe { instance.raw.enumerate_physical_devices() }
        .map_err(|result| Error::vulkan("vkEnumeratePhysicalDevices", result))?;
    let mut candidates: Vec<Candidate> =
        devices.into_iter().map(|raw| inspect(&instance.raw, raw, None)).collect();
    let offers: Vec<Offer<'_>> = candidates
        .iter()
        .map(|c| Offer { name: &c.report.name, kind: c.report.kind, refused: c.refused.as_deref() })
        .collect();
    let (best, verdicts) = choose(&offers, wanted, nth);
    for (i, (candidate, reason)) in candidates.iter_mut().zip(verdicts).enumerate() {
        candidate.report.chosen = best == Some(i);
        candidate.report.reason = reason;
    }
    Ok((best, candidates))
}

/// Returns whether timestamps of a driver are known to be wrong.
///
/// Mesa 22.3's software driver writes the timestamp of a dispatch only when the next draw is rasterised, once anything was
/// drawn: compute passes then seem to take no time. Version 25.0 is correct; versions between are untested and not trusted.
/// The driver reports its version only in its text, such as `Mesa 22.3.6 (LLVM 15.0.6)`.
fn stamps_lie(driver: vk::DriverId, info: &str) -> bool {
    let major = info.strip_prefix("Mesa ").and_then(|rest| rest.split('.').next()?.parse::<u32>().ok());
    driver == vk::DriverId::MESA_LLVMPIPE && major.is_none_or(|major| major < 25)
}

/// Returns whether the driver is known to order the stores of fragments to a pixel by primitive, which Vulkan does not
/// promise. Mesa's llvmpipe bins triangles to tiles of the image, and one thread draws the triangles of a tile in order.
fn orders_stores(driver: vk::DriverId) -> bool {
    driver == vk::DriverId::MESA_LLVMPIPE
}

/// Inspects a device and one of its queue families: `family`, or the first for graphics and compute.
pub(super) fn inspect(instance: &ash::Instance, raw: vk::PhysicalDevice, family: Option<usize>) -> Candidate {
    let mut driver = vk::PhysicalDeviceDriverProperties::default();
    let mut identity = vk::PhysicalDeviceIDProperties::default();
    let mut properties2 = vk::PhysicalDeviceProperties2::default();
    // SAFETY: `raw` was enumerated from this instance.
    let properties = unsafe { instance.get_physical_device_properties(raw) };
    let new_enough = properties.api_version >= vk::API_VERSION_1_3;
    if properties.api_version >= vk::API_VERSION_1_2 {
        properties2 = properties2.push_next(&mut driver).push_next(&mut identity);
        // SAFETY: as above; the chained structures are core since 1.2.
        unsafe { instance.get_physical_device_properties2(raw, &mut properties2) };
    }
    let kind = match properties.device_type {
        vk::PhysicalDeviceType::DISCRETE_GPU => "discrete",
        vk::PhysicalDeviceType::INTEGRATED_GPU => "integrated",
        vk::PhysicalDeviceType::VIRTUAL_GPU => "virtual",
        vk::PhysicalDeviceType::CPU => "cpu",
        _ => "other",
    };
    // SAFETY: `raw` was enumerated from this instance.
    let families = unsafe { instance.get_physical_device_queue_family_properties(raw) };
    let both = vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE;
    let draws = |family: &vk::QueueFamilyProperties| family.queue_flags.contains(both);
    let family = match family {
        None => families.iter().position(draws),
        given => given.filter(|&index| families.get(index).is_some_and(draws)),
    };

    let mut features13 = vk::PhysicalDeviceVulkan13Features::default();
    if new_enough {
        let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut features13);
        // SAFETY: as above; the features structure is core since 1.3, which the device supports.
        unsafe { instance.get_physical_device_features2(raw, &mut features) };
    }
    let refused = if !new_enough {
        Some(format!("Vulkan {} is older than the required 1.3", version_text(properties.api_version)))
    } else if features13.synchronization2 == vk::FALSE {
        Some("lacks the required feature synchronization2".to_string())
    } else if features13.dynamic_rendering == vk::FALSE {
        Some("lacks the required feature dynamicRendering".to_string())
    } else if family.is_none() {
        Some("has no queue for both graphics and compute".to_string())
    } else {
        None
    };
    let text = |s: std::result::Result<&std::ffi::CStr, std::ffi::FromBytesUntilNulError>| {
        s.map_or_else(|_| String::new(), |n| n.to_string_lossy().into_owned())
    };
    let info = text(driver.driver_info_as_c_str());
    let driver_text = format!("{} {info}", text(driver.driver_name_as_c_str()));
    let index = family.unwrap_or(0);
    Candidate {
        raw,
        properties,
        queue_family: crate::num::count(index),
        timestamp_bits: if stamps_lie(driver.driver_id, &info) {
            0
        } else {
            families.get(index).map_or(0, |f| f.timestamp_valid_bits)
        },
        orders_stores: orders_stores(driver.driver_id),
        report: DeviceReport {
            name: text(properties.device_name_as_c_str()),
            kind,
            driver: driver_text.trim().to_string(),
            api: version_text(properties.api_version),
            uuid: identity.device_uuid.iter().map(|byte| format!("{byte:02x}")).collect(),
            driver_id: format!("{:?}", driver.driver_id),
            driver_version: properties.driver_version,
            ids: [properties.vendor_id, properties.device_id],
            chosen: false,
            reason: String::new(),
        },
        refused,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offer(name: &'static str, kind: &'static str) -> Offer<'static> {
        Offer { name, kind, refused: None }
    }

    #[test]
    fn a_real_gpu_comes_before_a_software_one() {
        let (best, why) = choose(&[offer("llvmpipe", "cpu"), offer("GeForce", "discrete")], None, 0);
        assert_eq!(best, Some(1));
        assert_eq!(why[0], "usable, but a discrete device is taken before a cpu one");
        assert_eq!(choose(&[offer("llvmpipe", "cpu")], None, 0).1, ["no real GPU qualifies"]);
    }

    #[test]
    fn devices_of_the_best_kind_are_counted_round() {
        let offers = [offer("GeForce", "discrete"), offer("llvmpipe", "cpu"), offer("GeForce", "discrete")];
        for (nth, wanted) in [(0, 0), (1, 2), (2, 0), (5, 2)] {
            let (best, why) = choose(&offers, None, nth);
            assert_eq!(best, Some(wanted));
            assert!(why[2 - wanted].starts_with("usable, but another"), "{why:?}");
        }
        assert_eq!(choose(&offers, None, 1).1[2], "its number among those of the best kind");
        assert_eq!(choose(&offers, Some("llvm"), 3).0, Some(1));
    }

    #[test]
    fn a_name_wins_over_the_kind_and_case_does_not_count() {
        let offers = [offer("llvmpipe (LLVM)", "cpu"), offer("GeForce", "discrete")];
        let (best, why) = choose(&offers, Some("LLVMpipe"), 0);
        assert_eq!(best, Some(0));
        assert_eq!(why[1], "its name does not contain \"LLVMpipe\"");
        assert_eq!(choose(&offers, Some("radeon"), 0).0, None);
    }

    #[test]
    fn stamps_are_not_trusted_where_they_were_seen_to_lie() {
        assert!(stamps_lie(vk::DriverId::MESA_LLVMPIPE, "Mesa 22.3.6 (LLVM 15.0.6)"));
        assert!(stamps_lie(vk::DriverId::MESA_LLVMPIPE, ""));
        assert!(!stamps_lie(vk::DriverId::MESA_LLVMPIPE, "Mesa 25.0.7-2~bpo12+1 (LLVM 15.0.6)"));
        assert!(!stamps_lie(vk::DriverId::MESA_RADV, "Mesa 22.3.6"));
    }

    #[test]
    fn one_driver_is_known_to_order_stores() {
        assert!(orders_stores(vk::DriverId::MESA_LLVMPIPE));
        for driver in [vk::DriverId::NVIDIA_PROPRIETARY, vk::DriverId::MESA_RADV, vk::DriverId::default()] {
            assert!(!orders_stores(driver), "{driver:?}");
        }
    }

    #[test]
    fn what_a_device_lacks_is_its_reason() {
        let old = Offer {
            refused: Some("Vulkan 1.1.0 is older than the required 1.3"),
            ..offer("Old", "discrete")
        };
        let (best, why) = choose(&[old, offer("llvmpipe", "cpu")], None, 0);
        assert_eq!(best, Some(1));
        assert!(why[0].contains("1.1.0"));
    }
}
