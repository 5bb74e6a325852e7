//! Version and techniques of the library.

use std::ffi::c_char;
use std::sync::OnceLock;

use super::argument::{Caller, Structure, given};
use super::result::{c_text, call, vr_result};
use crate::error::Error;
use crate::num;
use crate::technique::{Method, Technique};

/// Returns the library's version, such as "1.2.3".
///
/// Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn vr_version() -> *const c_char {
    const TEXT: &str = concat!(env!("CARGO_PKG_VERSION"), "\0");
    TEXT.as_ptr().cast()
}

/// An option of a technique.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_option_info {
    /// Key of the option.
    pub key: *const c_char,
    /// Allowed values.
    pub values: *const c_char,
    /// Default value.
    pub default_value: *const c_char,
    /// Effect of the option.
    pub effect: *const c_char,
}

/// A technique. Everything that this points to lives as long as the library.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct vr_technique_info {
    /// sizeof(vr_technique_info).
    pub struct_size: usize,
    /// Name of the technique.
    pub name: *const c_char,
    /// Summary in one line, with authors and year of the paper.
    pub summary: *const c_char,
    /// Options of the technique.
    pub options: *const vr_option_info,
    /// Number of options.
    pub option_count: usize,
}

// SAFETY: repr(C), numbers and pointers, the first its size.
unsafe impl Structure for vr_technique_info {}

/// All techniques. Their texts are never freed.
struct Techniques(Vec<vr_technique_info>);

// SAFETY: the pointers refer to texts that never change.
unsafe impl Send for Techniques {}
// SAFETY: the same.
unsafe impl Sync for Techniques {}

fn told(method: Method) -> vr_technique_info {
    let text = |text: &str| c_text(text).into_raw().cast_const();
    let options = method.options().iter().map(|option| vr_option_info {
        key: text(option.key),
        values: text(&option.values),
        default_value: text(&option.default),
        effect: text(option.effect),
    });
    let options = Vec::leak(options.collect());
    vr_technique_info {
        struct_size: 0,
        name: text(method.name()),
        summary: text(&format!("{} ({})", method.summary(), method.source())),
        options: options.as_ptr(),
        option_count: options.len(),
    }
}

/// Returns the number of techniques.
///
/// Threads: any.
#[unsafe(no_mangle)]
pub extern "C" fn vr_technique_count() -> u32 {
    num::count(Method::ALL.len())
}

/// Describes a technique, from 0 to vr_technique_count() - 1.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// `info` is NULL or valid, with its size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_technique_query(index: u32, info: *mut vr_technique_info) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        static ALL: OnceLock<Techniques> = OnceLock::new();
        let all = &ALL.get_or_init(|| Techniques(Method::ALL.into_iter().map(told).collect())).0;
        let value = all
            .get(num::index(index))
            .ok_or_else(|| Error::invalid("index", format!("{index}: there are {} techniques", all.len())))?;
        caller.fill(info, *value, "vr_technique_info")
    })
}

/// Checks a technique with its options, NAME[:key=value,...].
///
/// Fails with VR_ERROR_INVALID; the message lists the allowed names, keys or values.
///
/// Threads: any.
///
/// # Safety
///
/// `technique` is NULL or ends with NUL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_technique_parse(technique: *const c_char) -> vr_result {
    // SAFETY: the caller's promise.
    call(unsafe { Caller::trusted() }, |caller| {
        let text = caller.text(technique, "technique")?;
        Technique::parse(given(text, "technique")?).map(drop)
    })
}
