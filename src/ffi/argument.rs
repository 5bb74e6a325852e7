//! Arguments from C: pointers, strings, arrays, and structures that grow from version to version.
//!
//! A structure begins with its size in the caller's version. Fields that an older caller lacks are zero, which means their
//! default. Bytes that a newer caller has beyond this version must be zero: other values are refused, not ignored.

use std::ffi::{CStr, c_char, c_void};
use std::path::Path;

use ash::vk;

use crate::error::{Error, Result};
use crate::num;

/// A structure of the interface.
///
/// # Safety
///
/// The type is `repr(C)` and valid when all its bytes are zero. Its first field is a `usize`, the size. It does not end in
/// padding, which callers would not set to zero.
pub(super) unsafe trait Structure: Copy {
    /// Its size in the version that introduced it; a structure that has grown states it.
    const FIRST: usize = size_of::<Self>();
}

/// The pointer that a caller gives with a function of its own. It is passed back and never followed.
#[derive(Clone, Copy)]
pub(super) struct User(pub(super) *mut c_void);

// SAFETY: it is never followed; any thread may call the caller's functions, as their documentation says.
unsafe impl Send for User {}
// SAFETY: the same.
unsafe impl Sync for User {}

impl User {
    pub(super) fn pointer(self) -> *mut c_void {
        self.0
    }
}

/// The promise of a caller about the pointers that it passes, as the documentation of each function states it. References
/// end with the call.
pub(super) struct Caller(());

impl Caller {
    /// # Safety
    ///
    /// Each pointer that is given to the methods of the result is null, or valid for what the method does until the call
    /// ends: strings end with NUL, arrays have the given lengths, structures are as large as they say, and what is written
    /// is not used otherwise.
    pub(super) unsafe fn trusted() -> Self {
        Self(())
    }

    /// Converts a pointer that must not be null.
    pub(super) fn reference<T>(&self, pointer: *const T, name: &str) -> Result<&T> {
        check_pointer(pointer, name)?;
        // SAFETY: the promise.
        Ok(unsafe { &*pointer })
    }

    /// Writes to memory, which may be uninitialised, through a pointer that must not be null.
    pub(super) fn write<T>(&self, pointer: *mut T, value: T, name: &str) -> Result<()> {
        check_pointer(pointer, name)?;
        // SAFETY: the promise.
        unsafe { pointer.write(value) };
        Ok(())
    }

    /// Converts an array, which may be null when it has no elements.
    pub(super) fn array<T>(&self, pointer: *const T, count: usize, name: &str) -> Result<&[T]> {
        if count == 0 {
            return Ok(&[]);
        }
        check_pointer(pointer, name)?;
        if count.checked_mul(size_of::<T>()).is_none_or(|bytes| isize::try_from(bytes).is_err()) {
            return Err(Error::invalid(name, format!("{count} elements are more than memory can hold")));
        }
        // SAFETY: the caller promises this many elements, and a slice may be this large.
        Ok(unsafe { std::slice::from_raw_parts(pointer, count) })
    }

    fn c_str(&self, pointer: *const c_char) -> Option<&CStr> {
        // SAFETY: the promise: it ends with NUL.
        (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) })
    }

    /// Converts a string; `None` for null.
    pub(super) fn text(&self, pointer: *const c_char, name: &str) -> Result<Option<&str>> {
        let text = self.c_str(pointer).map(CStr::to_str).transpose();
        text.map_err(|error| Error::invalid(name, format!("is not UTF-8: {error}")))
    }

    /// Converts the name of a file: any bytes on Unix, UTF-8 elsewhere; `None` for null.
    pub(super) fn path(&self, pointer: *const c_char, name: &str) -> Result<Option<&Path>> {
        #[cfg(unix)]
        {
            use std::os::unix::ffi::OsStrExt as _;
            let _ = name;
            let path = self.c_str(pointer).map(|path| std::ffi::OsStr::from_bytes(path.to_bytes()));
            Ok(path.map(Path::new))
        }
        #[cfg(not(unix))]
        Ok(self.text(pointer, name)?.map(Path::new))
    }

    /// Reads a structure, with zeros for fields that the caller's version lacks.
    pub(super) fn structure<T: Structure>(&self, pointer: *const T, name: &str) -> Result<T> {
        let (size, known) = self.sizes(pointer, name)?;
        let beyond = self.array(pointer.cast::<u8>().wrapping_add(known), size - known, name)?;
        if beyond.iter().any(|&byte| byte != 0) {
            let why = format!(
                "what follows its first {known} bytes is of a newer version than this library, {}: leave it 0",
                env!("CARGO_PKG_VERSION")
            );
            return Err(Error::invalid(name, why));
        }
        let mut value = zeros::<T>();
        // SAFETY: both are at least as large, and do not overlap; what the caller filled in is valid.
        unsafe { std::ptr::copy_nonoverlapping(pointer.cast::<u8>(), (&raw mut value).cast(), known) };
        Ok(value)
    }

    /// Reads a structure; null stands for zeros.
    pub(super) fn structure_or_zeros<T: Structure>(&self, pointer: *const T, name: &str) -> Result<T> {
        if pointer.is_null() { Ok(zeros()) } else { self.structure(pointer, name) }
    }

    /// Writes a structure, as far as the caller's version has its fields. The caller has set its size.
    pub(super) fn fill<T: Structure>(&self, pointer: *mut T, value: T, name: &str) -> Result<()> {
        let (size, known) = self.sizes(pointer, name)?;
        // The size is left unchanged; bytes beyond this version are set to zero.
        let head = size_of::<usize>();
        let (from, to) = ((&raw const value).cast::<u8>().wrapping_add(head), pointer.cast::<u8>());
        // SAFETY: both are at least that large and do not overlap.
        unsafe { std::ptr::copy_nonoverlapping(from, to.wrapping_add(head), known - head) };
        // SAFETY: the caller's structure is as large as it says.
        unsafe { std::ptr::write_bytes(to.wrapping_add(known), 0, size - known) };
        Ok(())
    }

    /// Returns the size of a structure, checked to be plausible and not an uninitialised number, and that of its fields in
    /// this version.
    fn sizes<T: Structure>(&self, pointer: *const T, name: &str) -> Result<(usize, usize)> {
        const MOST: usize = 1 << 16;
        let (size, first) = (*self.reference(pointer.cast::<usize>(), name)?, T::FIRST);
        if !(first..=MOST).contains(&size) {
            let why = format!("struct_size {size}: must be its size, at least {first} bytes");
            return Err(Error::invalid(name, why));
        }
        Ok((size, size.min(size_of::<T>())))
    }
}

fn zeros<T: Structure>() -> T {
    // SAFETY: valid when all bytes are zero.
    unsafe { std::mem::zeroed() }
}

/// Checks a pointer that must not be null.
pub(super) fn check_pointer<T>(pointer: *const T, name: &str) -> Result<()> {
    given((!pointer.is_null()).then_some(()), name)?;
    if pointer.is_aligned() { Ok(()) } else { Err(Error::invalid(name, "is not aligned")) }
}

/// Unwraps an argument that must not be null.
pub(super) fn given<T>(argument: Option<T>, name: &str) -> Result<T> {
    argument.ok_or_else(|| Error::invalid(name, "is NULL"))
}

/// Checks a handle of Vulkan's.
pub(super) fn check_handle(handle: impl vk::Handle, name: &str) -> Result<()> {
    if handle.is_null() { Err(Error::invalid(name, "is VK_NULL_HANDLE")) } else { Ok(()) }
}

/// Converts a `VkBool32`.
pub(super) fn flag(value: u32, name: &str) -> Result<bool> {
    choice(value, 0, &[false, true], name)
}

/// Checks a field that stands for padding at the end of a structure, for use by later versions.
pub(super) fn reserved(value: u32) -> Result<()> {
    if value == 0 { Ok(()) } else { Err(Error::invalid("reserved", format!("{value}: must be 0"))) }
}

/// Converts the value of an enumeration; `all` has what its values mean, in their order, and `first` is the least.
pub(super) fn choice<T: Copy>(value: u32, first: u32, all: &[T], name: &str) -> Result<T> {
    let choice = value.checked_sub(first).and_then(|i| all.get(num::index(i)));
    choice.copied().ok_or_else(|| {
        let codes: Vec<String> = (first..).take(all.len()).map(|code| code.to_string()).collect();
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
    unsafe impl Structure for Old {}

    // SAFETY: numbers alone, the first its size.
    unsafe impl Structure for New {
        const FIRST: usize = size_of::<Old>();
    }

    const OLD: usize = size_of::<Old>();
    const NEW: usize = size_of::<New>();

    fn caller() -> Caller {
        // SAFETY: what the tests give is as large as it says, or refused before it is read.
        unsafe { Caller::trusted() }
    }

    #[test]
    fn callers_of_other_versions_are_understood() {
        let (caller, old) = (caller(), Old { struct_size: OLD, a: 1, b: 2 });
        let read = caller.structure((&raw const old).cast::<New>(), "info").unwrap();
        assert_eq!(read, New { struct_size: OLD, a: 1, b: 2, c: 0 });
        let mut new = New { struct_size: NEW, a: 1, b: 2, c: 0 };
        let read = |new: &New| caller.structure((&raw const *new).cast::<Old>(), "info");
        assert_eq!(read(&new).unwrap(), Old { struct_size: NEW, a: 1, b: 2 });
        new.c = 1 << 63;
        let error = read(&new).unwrap_err();
        assert!(matches!(error, Error::Invalid { .. }) && error.to_string().contains("newer"), "{error}");
    }

    #[test]
    fn what_is_told_ends_where_the_caller_s_structure_does() {
        let value = New { struct_size: 0, a: 3, b: 4, c: 5 };
        let mut places = [Old { struct_size: OLD, a: 0, b: 0 }, Old { struct_size: 7, a: 8, b: 9 }];
        caller().fill(places.as_mut_ptr().cast::<New>(), value, "status").unwrap();
        assert_eq!(places, [Old { struct_size: OLD, a: 3, b: 4 }, Old { struct_size: 7, a: 8, b: 9 }]);
        let mut place = New { struct_size: NEW, a: 0, b: 0, c: 77 };
        let value = Old { struct_size: 0, a: 3, b: 4 };
        caller().fill((&raw mut place).cast::<Old>(), value, "status").unwrap();
        assert_eq!(place, New { struct_size: NEW, a: 3, b: 4, c: 0 });
    }

    #[test]
    fn what_cannot_be_a_structure_is_refused() {
        let caller = caller();
        let read = |size| caller.structure(&Old { struct_size: size, a: 0, b: 0 }, "info");
        for size in [0, OLD - 1, 1 << 17, usize::MAX] {
            let error = read(size).unwrap_err().to_string();
            assert!(error.contains("struct_size"), "{error}");
        }
        let error = caller.structure::<Old>(std::ptr::null(), "info").unwrap_err().to_string();
        assert_eq!(error, "invalid info: is NULL");
        let error = caller.reference(std::ptr::dangling::<u8>().cast::<Old>(), "info").unwrap_err();
        assert!(error.to_string().contains("aligned"));
        let error = caller.array(&0_u64, usize::MAX / 4, "list").unwrap_err();
        assert!(error.to_string().contains("more than memory"));
        assert_eq!(caller.array(std::ptr::null::<u64>(), 0, "list").unwrap(), [0; 0]);
        assert!(caller.array(std::ptr::null::<u64>(), 1, "list").is_err());
        let error = caller.text(c"\xff".as_ptr(), "name").unwrap_err().to_string();
        assert!(error.contains("UTF-8"), "{error}");
    }
}
