//! Version and techniques of the library.

use std::ffi::{CString, c_char};
use std::sync::OnceLock;

use super::argument::{self, Structure};
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
unsafe impl Structure for vr_technique_info {
    const FIRST: usize = size_of::<Self>();
}

/// The texts of a technique for C.
struct Texts {
    name: CString,
    summary: CString,
    options: Vec<vr_option_info>,
    /// Owner of the texts of `options`.
    _texts: Vec<CString>,
}

// SAFETY: the pointers refer to texts that never change.
unsafe impl Send for Texts {}
// SAFETY: the same.
unsafe impl Sync for Texts {}

impl Texts {
    fn of(method: Method) -> Self {
        let mut texts = Vec::new();
        // Moving a `CString` does not move its text.
        let mut keep = |text: &str| -> *const c_char {
            let text = c_text(text);
            let pointer = text.as_ptr();
            texts.push(text);
            pointer
        };
        let options = method.options().iter().map(|option| vr_option_info {
            key: keep(option.key),
            values: keep(&option.values),
            default_value: keep(&option.default),
            effect: keep(option.effect),
        });
        let options = options.collect();
        let summary = format!("{} ({})", method.summary(), method.source());
        Self { name: c_text(method.name()), summary: c_text(&summary), options, _texts: texts }
    }
}

fn techniques() -> &'static [Texts] {
    static ALL: OnceLock<Vec<Texts>> = OnceLock::new();
    ALL.get_or_init(|| Method::ALL.into_iter().map(Texts::of).collect())
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
    call(|| {
        let words = techniques().get(num::index(index)).ok_or_else(|| {
            Error::invalid("index", format!("{index}: there are {} techniques", Method::ALL.len()))
        })?;
        let value = vr_technique_info {
            struct_size: 0,
            name: words.name.as_ptr(),
            summary: words.summary.as_ptr(),
            options: words.options.as_ptr(),
            option_count: words.options.len(),
        };
        // SAFETY: the caller's promise.
        unsafe { argument::fill(info, value, "vr_technique_info") }?;
        Ok(vr_result::VR_OK)
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
    call(|| {
        // SAFETY: the caller's promise.
        let text = unsafe { argument::text(technique, "technique") }?;
        Technique::parse(text.ok_or_else(|| Error::invalid("technique", "is NULL"))?)?;
        Ok(vr_result::VR_OK)
    })
}
