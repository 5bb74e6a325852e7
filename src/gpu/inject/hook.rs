//! Hooking a loader: it hands out the functions that stand in for its own.

use std::ffi::{CStr, c_char, c_void};
use std::sync::atomic::Ordering;

use ash::vk;
use ash::vk::Handle as _;

use super::calls::{CALLS, PLACES, TABLE, functions};
use super::injection::Injection;
use crate::error::{Error, Result};

/// The function that stands in for one of a name, which would be `real`; `real` itself where it cannot fail.
fn stand_in<const PLACE: usize>(name: &CStr, real: vk::PFN_vkVoidFunction) -> vk::PFN_vkVoidFunction {
    let function = real?;
    let Some(call) = CALLS.iter().position(|info| name.to_bytes() == info.name.as_bytes()) else {
        return real;
    };
    TABLE[PLACE].real[call].store((function as *const c_void).cast_mut(), Ordering::Release);
    let ours = functions::<PLACE>()[call];
    // SAFETY: a function as any other, which its caller takes for what its name says.
    Some(unsafe { std::mem::transmute::<*const c_void, unsafe extern "system" fn()>(ours) })
}

/// `vkGetInstanceProcAddr` of a place.
unsafe extern "system" fn instance_proc<const PLACE: usize>(
    instance: vk::Instance,
    p_name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    let place = &TABLE[PLACE];
    // SAFETY: the caller gives a zero-terminated name.
    let name = unsafe { CStr::from_ptr(p_name) };
    let real = place.instance_proc.load(Ordering::Acquire);
    // SAFETY: stored by `Hook::new` as the loader's function of this type.
    let real = unsafe { std::mem::transmute::<*mut c_void, vk::PFN_vkGetInstanceProcAddr>(real) };
    // SAFETY: the caller keeps the rules of the call.
    let found = unsafe { real(instance, p_name) };
    let own = match name.to_bytes() {
        b"vkGetInstanceProcAddr" => instance_proc::<PLACE> as *const c_void,
        b"vkGetDeviceProcAddr" => {
            let function = found?;
            place.device_proc.store((function as *const c_void).cast_mut(), Ordering::Release);
            device_proc::<PLACE> as *const c_void
        }
        _ => return stand_in::<PLACE>(name, found),
    };
    // SAFETY: a function as any other, which its caller takes for what its name says.
    Some(unsafe { std::mem::transmute::<*const c_void, unsafe extern "system" fn()>(own) })
}

/// `vkGetDeviceProcAddr` of a place.
unsafe extern "system" fn device_proc<const PLACE: usize>(
    device: vk::Device,
    p_name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    let place = &TABLE[PLACE];
    place.device.store(device.as_raw(), Ordering::Release);
    // SAFETY: the caller gives a zero-terminated name.
    let name = unsafe { CStr::from_ptr(p_name) };
    let real = place.device_proc.load(Ordering::Acquire);
    // SAFETY: stored by `instance_proc` before it handed this function out; of this type by its name.
    let real = unsafe { std::mem::transmute::<*mut c_void, vk::PFN_vkGetDeviceProcAddr>(real) };
    // SAFETY: the caller keeps the rules of the call.
    let found = unsafe { real(device, p_name) };
    stand_in::<PLACE>(name, found)
}

/// `vkGetInstanceProcAddr` of each place.
const INSTANCE_PROCS: [vk::PFN_vkGetInstanceProcAddr; PLACES] = [
    instance_proc::<0>,
    instance_proc::<1>,
    instance_proc::<2>,
    instance_proc::<3>,
    instance_proc::<4>,
    instance_proc::<5>,
    instance_proc::<6>,
    instance_proc::<7>,
];

/// A place that an instance has taken; given back on drop, when the instance is gone.
#[derive(Debug)]
pub(in crate::gpu) struct Hook {
    place: usize,
}

impl Hook {
    /// Hooks a loader. The loader that is returned must not be used after the hook is gone, nor after `entry` is.
    pub(in crate::gpu) fn new(injection: &Injection, entry: &ash::Entry) -> Result<(Self, ash::Entry)> {
        for (i, place) in TABLE.iter().enumerate() {
            let mut taken = place.lock();
            if taken.is_some() {
                continue;
            }
            *taken = Some(injection.clone());
            let real = entry.static_fn().get_instance_proc_addr as *const c_void;
            place.instance_proc.store(real.cast_mut(), Ordering::Release);
            place.device.store(0, Ordering::Release);
            let hooked = ash::StaticFn { get_instance_proc_addr: INSTANCE_PROCS[i] };
            // SAFETY: the function returns what the loader's returns, or what behaves like it.
            let hooked = unsafe { ash::Entry::from_static_fn(hooked) };
            return Ok((Self { place: i }, hooked));
        }
        Err(Error::unsupported(
            "injection",
            format!("{PLACES} devices with one are open, and no more may be"),
        ))
    }
}

impl Drop for Hook {
    fn drop(&mut self) {
        *TABLE[self.place].lock() = None;
    }
}
