//! Arguments from C: pointers, strings, arrays, and structures that grow from version to version.
//!
//! A structure begins with its size in the caller's version. Fields that an older caller lacks are zero, which means their
//! default. Bytes that a newer caller has beyond this version must be zero: other values are refused, not ignored.

use std::ffi::{CStr, OsStr, c_char};
use std::path::Path;

use crate::error::{Error, Result};

/// A structure of the interface.
///
/// # Safety
///
/// The type is `repr(C)` and valid when all its bytes are zero. Its first field is a `usize`, the size. It does not end in
/// padding, which callers would not set to zero.
pub(super) unsafe trait Structure: Copy {
    /// Its size in the version that introduced it.
    const FIRST: usize;
}

fn null(name: &str) -> Error {
    Error::invalid(name, "is NULL")
}

/// Converts a pointer that must not be null.
///
/// # Safety
///
/// `pointer` is null, or valid for as long as the result is used.
pub(super) unsafe fn reference<'a, T>(pointer: *const T, name: &str) -> Result<&'a T> {
    if !pointer.is_null() && !pointer.is_aligned() {
        return Err(Error::invalid(name, "is not aligned"));
    }
    // SAFETY: the caller's promise.
    unsafe { pointer.as_ref() }.ok_or_else(|| null(name))
}

/// Converts a pointer to write through, which must not be null.
///
/// # Safety
///
/// `pointer` is null, or valid for writes and not used otherwise for as long as the result is used.
pub(super) unsafe fn place<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T> {
    if !pointer.is_null() && !pointer.is_aligned() {
        return Err(Error::invalid(name, "is not aligned"));
    }
    // SAFETY: the caller's promise.
    unsafe { pointer.as_mut() }.ok_or_else(|| null(name))
}

/// Converts a pointer that receives a handle, and sets the handle to null.
///
/// # Safety
///
/// As [`place`], of memory that may be uninitialised.
pub(super) unsafe fn out<'a, T>(pointer: *mut *mut T, name: &str) -> Result<&'a mut *mut T> {
    if !pointer.is_null() && pointer.is_aligned() {
        // SAFETY: valid for writes.
        unsafe { pointer.write(std::ptr::null_mut()) };
    }
    // SAFETY: the caller's promise, and just initialised.
    unsafe { place(pointer, name) }
}

/// Converts an array, which may be null when it has no elements.
///
/// # Safety
///
/// `pointer` is null, or has `count` elements that are valid for as long as the result is used.
pub(super) unsafe fn array<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T]> {
    if count == 0 {
        return Ok(&[]);
    }
    // SAFETY: the caller's promise.
    let first: *const T = unsafe { reference(pointer, name) }?;
    if count.checked_mul(size_of::<T>()).is_none_or(|bytes| isize::try_from(bytes).is_err()) {
        return Err(Error::invalid(name, format!("{count} elements are more than memory can hold")));
    }
    // SAFETY: the caller promises this many elements, and a slice may be this large.
    Ok(unsafe { std::slice::from_raw_parts(first, count) })
}

/// Converts an array of `count` elements of `N` numbers each.
///
/// # Safety
///
/// As [`array()`].
pub(super) unsafe fn tuples<'a, const N: usize, T>(
    pointer: *const T,
    count: usize,
    name: &str,
) -> Result<&'a [[T; N]]> {
    // SAFETY: an array has the alignment of its elements and no gaps.
    unsafe { array(pointer.cast::<[T; N]>(), count, name) }
}

/// Converts a string; `None` for null.
///
/// # Safety
///
/// `pointer` is null, or a string that ends with NUL and is valid for as long as the result is used.
pub(super) unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<Option<&'a str>> {
    if pointer.is_null() {
        return Ok(None);
    }
    // SAFETY: ends with NUL.
    let text = unsafe { CStr::from_ptr(pointer) };
    let text = text.to_str().map_err(|error| Error::invalid(name, format!("is not UTF-8: {error}")))?;
    Ok(Some(text))
}

/// Converts the name of a file: any bytes on Unix, UTF-8 elsewhere; `None` for null.
///
/// # Safety
///
/// As [`text`].
pub(super) unsafe fn path<'a>(pointer: *const c_char, name: &str) -> Result<Option<&'a Path>> {
    #[cfg(unix)]
    {
        use std::os::unix::ffi::OsStrExt as _;
        let _ = name;
        if pointer.is_null() {
            return Ok(None);
        }
        // SAFETY: ends with NUL.
        let bytes = unsafe { CStr::from_ptr(pointer) }.to_bytes();
        Ok(Some(Path::new(OsStr::from_bytes(bytes))))
    }
    #[cfg(not(unix))]
    // SAFETY: the caller's promise.
    Ok(unsafe { text(pointer, name) }?.map(|text| Path::new(OsStr::new(text))))
}

/// Reads a structure, with zeros for fields that the caller's version lacks.
///
/// # Safety
///
/// `pointer` is null, or a structure whose first field is its size.
pub(super) unsafe fn structure<T: Structure>(pointer: *const T, name: &str) -> Result<T> {
    // SAFETY: the caller promises that it begins with its size.
    let size = *unsafe { reference(pointer.cast::<usize>(), name) }?;
    check_size(size, T::FIRST, name)?;
    let known = size.min(size_of::<T>());
    // SAFETY: as large as it says.
    let beyond = unsafe { array(pointer.cast::<u8>().wrapping_add(known), size - known, name) }?;
    if beyond.iter().any(|&byte| byte != 0) {
        let missing = format!("what follows its first {known} bytes is of a newer version");
        return Err(Error::unsupported(name, missing));
    }
    let mut value = std::mem::MaybeUninit::<T>::zeroed();
    // SAFETY: both are at least as large, and do not overlap.
    unsafe { std::ptr::copy_nonoverlapping(pointer.cast::<u8>(), value.as_mut_ptr().cast::<u8>(), known) };
    // SAFETY: zeros are valid, and so is what the caller filled in.
    Ok(unsafe { value.assume_init() })
}

/// Writes a structure, as far as the caller's version has its fields. The caller has set its size.
///
/// # Safety
///
/// As [`structure`], and valid for writes.
pub(super) unsafe fn fill<T: Structure>(pointer: *mut T, value: T, name: &str) -> Result<()> {
    // SAFETY: the caller promises that it begins with its size.
    let size = *unsafe { reference(pointer.cast_const().cast::<usize>(), name) }?;
    check_size(size, T::FIRST, name)?;
    let (head, known) = (size_of::<usize>(), size.min(size_of::<T>()));
    // The size is left unchanged; bytes beyond this version are set to zero.
    let from = (&raw const value).cast::<u8>().wrapping_add(head);
    let to = pointer.cast::<u8>();
    // SAFETY: both are at least that large and do not overlap.
    unsafe { std::ptr::copy_nonoverlapping(from, to.wrapping_add(head), known - head) };
    // SAFETY: the caller's structure is as large as it says.
    unsafe { std::ptr::write_bytes(to.wrapping_add(known), 0, size - known) };
    Ok(())
}

/// Checks that a size is plausible, and not an uninitialised number.
fn check_size(size: usize, first: usize, name: &str) -> Result<()> {
    const MOST: usize = 1 << 16;
    if (first..=MOST).contains(&size) {
        return Ok(());
    }
    Err(Error::invalid(name, format!("struct_size {size}: must be its size, at least {first} bytes")))
}

/// Checks a field that stands for padding at the end of a structure, for use by later versions.
pub(super) fn reserved(value: u32) -> Result<()> {
    if value == 0 { Ok(()) } else { Err(Error::invalid("reserved", format!("{value}: must be 0"))) }
}

/// Converts the value of an enumeration.
pub(super) fn choice<T: Copy>(value: u32, all: &[(T, u32)], name: &str) -> Result<T> {
    all.iter().find(|(_, code)| *code == value).map(|(choice, _)| *choice).ok_or_else(|| {
        let codes: Vec<String> = all.iter().map(|(_, code)| code.to_string()).collect();
        Error::invalid(name, format!("{value}: must be one of {}", codes.join(", ")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In two versions.
    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Old {
        struct_size: usize,
        a: u32,
        b: u32,
    }

    #[repr(C)]
    #[derive(Clone, Copy, Debug, PartialEq)]
    struct New {
        struct_size: usize,
        a: u32,
        b: u32,
        c: u64,
    }

    // SAFETY: numbers alone, the first its size.
    unsafe impl Structure for Old {
        const FIRST: usize = size_of::<Old>();
    }

    // SAFETY: numbers alone, the first its size.
    unsafe impl Structure for New {
        const FIRST: usize = size_of::<Old>();
    }

    const OLD: usize = size_of::<Old>();
    const NEW: usize = size_of::<New>();

    #[test]
    fn callers_of_other_versions_are_understood() {
        let old = Old { struct_size: OLD, a: 1, b: 2 };
        // SAFETY: as large as it says.
        let read = unsafe { structure((&raw const old).cast::<New>(), "info") }.unwrap();
        assert_eq!(read, New { struct_size: OLD, a: 1, b: 2, c: 0 });
        let mut new = New { struct_size: NEW, a: 1, b: 2, c: 0 };
        // SAFETY: as large as it says.
        let read = |new: &New| unsafe { structure((&raw const *new).cast::<Old>(), "info") };
        assert_eq!(read(&new).unwrap(), Old { struct_size: NEW, a: 1, b: 2 });
        new.c = 1 << 63;
        let error = read(&new).unwrap_err();
        assert!(matches!(error, Error::Unsupported { .. }) && error.to_string().contains("newer"), "{error}");
    }

    #[test]
    fn what_is_told_ends_where_the_caller_s_structure_does() {
        let value = New { struct_size: 0, a: 3, b: 4, c: 5 };
        let mut places = [Old { struct_size: OLD, a: 0, b: 0 }, Old { struct_size: 7, a: 8, b: 9 }];
        // SAFETY: as large as it says.
        unsafe { fill(places.as_mut_ptr().cast::<New>(), value, "status") }.unwrap();
        assert_eq!(places, [Old { struct_size: OLD, a: 3, b: 4 }, Old { struct_size: 7, a: 8, b: 9 }]);
        let mut place = New { struct_size: NEW, a: 0, b: 0, c: 77 };
        let value = Old { struct_size: 0, a: 3, b: 4 };
        // SAFETY: as large as it says.
        unsafe { fill((&raw mut place).cast::<Old>(), value, "status") }.unwrap();
        assert_eq!(place, New { struct_size: NEW, a: 3, b: 4, c: 0 });
    }

    #[test]
    fn what_cannot_be_a_structure_is_refused() {
        // SAFETY: its size is looked at first.
        let read = |size| unsafe { structure(&Old { struct_size: size, a: 0, b: 0 }, "info") };
        for size in [0, OLD - 1, 1 << 17, usize::MAX] {
            let error = read(size).unwrap_err().to_string();
            assert!(error.contains("struct_size"), "{error}");
        }
        // SAFETY: null.
        let error = unsafe { structure::<Old>(std::ptr::null(), "info") }.unwrap_err().to_string();
        assert_eq!(error, "invalid info: is NULL");
        // SAFETY: refused before anything is read.
        let error = unsafe { reference(std::ptr::dangling::<u8>().cast::<Old>(), "info") }.unwrap_err();
        assert!(error.to_string().contains("aligned"));
        // SAFETY: refused before anything is read.
        let error = unsafe { array(&0_u64, usize::MAX / 4, "list") }.unwrap_err();
        assert!(error.to_string().contains("more than memory"));
        // SAFETY: there are none.
        assert_eq!(unsafe { array(std::ptr::null::<u64>(), 0, "list") }.unwrap(), [0; 0]);
        // SAFETY: refused before anything is read.
        assert!(unsafe { array(std::ptr::null::<u64>(), 1, "list") }.is_err());
        // SAFETY: ends with NUL.
        let error = unsafe { text(c"\xff".as_ptr(), "name") }.unwrap_err().to_string();
        assert!(error.contains("UTF-8"), "{error}");
    }
}
