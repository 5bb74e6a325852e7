//! Hooks a loader, so that it returns the functions that stand in for its own.

use std::ffi::{CStr, c_char, c_void};
use std::sync::atomic::Ordering;

use ash::vk;
use ash::vk::Handle as _;

use super::calls::{CALLS, SLOTS, TABLE, functions};
use super::injection::Injection;
use crate::error::{Error, Result};

/// Returns the function that stands in for `real`, the entry point of a name; `real` itself where the call cannot fail.
fn stand_in<const SLOT: usize>(name: &CStr, real: vk::PFN_vkVoidFunction) -> vk::PFN_vkVoidFunction {
    let function = real?;
    let Some(call) = CALLS.iter().position(|info| name.to_bytes() == info.name.as_bytes()) else {
        return real;
    };
    TABLE[SLOT].real[call].store((function as *const c_void).cast_mut(), Ordering::Release);
    let ours = functions::<SLOT>()[call];
    // SAFETY: a function pointer; callers cast it to the type of its name.
    Some(unsafe { std::mem::transmute::<*const c_void, unsafe extern "system" fn()>(ours) })
}

/// Stands in for `vkGetInstanceProcAddr`, for one slot.
unsafe extern "system" fn instance_proc<const SLOT: usize>(
    instance: vk::Instance,
    p_name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    let slot = &TABLE[SLOT];
    // SAFETY: the caller passes a name that ends with NUL.
    let name = unsafe { CStr::from_ptr(p_name) };
    let real = slot.instance_proc.load(Ordering::Acquire);
    // SAFETY: stored by `Hook::new` as the loader's function of this type.
    let real = unsafe { std::mem::transmute::<*mut c_void, vk::PFN_vkGetInstanceProcAddr>(real) };
    // SAFETY: the caller meets the contract of the call.
    let found = unsafe { real(instance, p_name) };
    let own = match name.to_bytes() {
        b"vkGetInstanceProcAddr" => instance_proc::<SLOT> as *const c_void,
        b"vkGetDeviceProcAddr" => {
            let function = found?;
            slot.device_proc.store((function as *const c_void).cast_mut(), Ordering::Release);
            device_proc::<SLOT> as *const c_void
        }
        _ => return stand_in::<SLOT>(name, found),
    };
    // SAFETY: a function pointer; callers cast it to the type of its name.
    Some(unsafe { std::mem::transmute::<*const c_void, unsafe extern "system" fn()>(own) })
}

/// Stands in for `vkGetDeviceProcAddr`, for one slot.
unsafe extern "system" fn device_proc<const SLOT: usize>(
    device: vk::Device,
    p_name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    let slot = &TABLE[SLOT];
    slot.device.store(device.as_raw(), Ordering::Release);
    // SAFETY: the caller passes a name that ends with NUL.
    let name = unsafe { CStr::from_ptr(p_name) };
    let real = slot.device_proc.load(Ordering::Acquire);
    // SAFETY: stored by `instance_proc` before it handed this function out; of this type by its name.
    let real = unsafe { std::mem::transmute::<*mut c_void, vk::PFN_vkGetDeviceProcAddr>(real) };
    // SAFETY: the caller meets the contract of the call.
    let found = unsafe { real(device, p_name) };
    stand_in::<SLOT>(name, found)
}

/// `vkGetInstanceProcAddr` of each slot.
const INSTANCE_PROCS: [vk::PFN_vkGetInstanceProcAddr; SLOTS] = [
    instance_proc::<0>,
    instance_proc::<1>,
    instance_proc::<2>,
    instance_proc::<3>,
    instance_proc::<4>,
    instance_proc::<5>,
    instance_proc::<6>,
    instance_proc::<7>,
];

/// The slot of an instance, released on drop, after the instance was destroyed.
#[derive(Debug)]
pub(in crate::gpu) struct Hook {
    slot: usize,
}

impl Hook {
    /// Hooks a loader. The returned loader must not be used after the hook or `entry` is dropped.
    pub(in crate::gpu) fn new(injection: &Injection, entry: &ash::Entry) -> Result<(Self, ash::Entry)> {
        for (i, slot) in TABLE.iter().enumerate() {
            let mut taken = slot.lock();
            if taken.is_some() {
                continue;
            }
            *taken = Some(injection.clone());
            let real = entry.static_fn().get_instance_proc_addr as *const c_void;
            slot.instance_proc.store(real.cast_mut(), Ordering::Release);
            slot.device.store(0, Ordering::Release);
            let hooked = ash::StaticFn { get_instance_proc_addr: INSTANCE_PROCS[i] };
            // SAFETY: the function returns what the loader's returns, or what behaves like it.
            let hooked = unsafe { ash::Entry::from_static_fn(hooked) };
            return Ok((Self { slot: i }, hooked));
        }
        Err(Error::unsupported(
            "injection",
            format!("{SLOTS} devices with injection are open, which is the maximum"),
        ))
    }
}

impl Drop for Hook {
    fn drop(&mut self) {
        *TABLE[self.slot].lock() = None;
    }
}
