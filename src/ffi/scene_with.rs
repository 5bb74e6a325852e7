//! Functions that make a scene from another one, with which it shares unchanged data.

use std::ffi::c_void;

use super::argument;
use super::data::{self, vr_knot, vr_surface_info};
use super::result::{call, vr_result};
use super::samples;
use super::scene::{default_technique, give, vr_scene};
use crate::error::{Error, Result};
use crate::scene::Surface;

/// Makes a scene of the same data with another transfer function. The scenes share the data on the device; `source` is
/// unchanged.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, arrays have the given lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_with_transfer(
    source: *const vr_scene,
    knots: *const vr_knot,
    knot_count: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { argument::out(scene, "scene") }?;
        // SAFETY: the caller's promise.
        let source = unsafe { argument::reference(source, "source") }?;
        // SAFETY: the caller's promise.
        let transfer = unsafe { data::transfer(knots, knot_count) }?;
        let transfer = transfer.ok_or_else(|| Error::invalid("knot_count", "0: there must be at least 1"))?;
        Ok(give(source.with(source.scene.with_transfer(transfer)), out))
    })
}

/// Makes a scene of other samples in the same grid, with the same placement, transfer function, surfaces and view. The samples are
/// copied, and may be of another type; see vr_grid_info. `source` is unchanged.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, `samples` has `sample_bytes` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_with_samples(
    source: *const vr_scene,
    sample_type: u32,
    samples: *const c_void,
    sample_bytes: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { argument::out(scene, "scene") }?;
        // SAFETY: the caller's promise.
        let source = unsafe { argument::reference(source, "source") }?;
        let old = source.scene.scene();
        let Some(grid) = old.grid() else {
            return Err(Error::invalid("source", format!("holds a {}, not a grid", old.data.kind())));
        };
        // SAFETY: the caller's promise.
        let samples = unsafe { samples::samples(grid.dims(), sample_type, samples, sample_bytes) }?;
        Ok(give(source.with(source.scene.with_samples(samples)?), out))
    })
}

/// Makes a scene of the same mesh with other scalars, as in vr_mesh_info, and with another transfer function if there are knots. The
/// scenes share points and tetrahedra on the device. Scalars per tetrahedron are given for the tetrahedra that were kept. `source`
/// is unchanged.
///
/// Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, arrays have the given lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_with_scalars(
    source: *const vr_scene,
    scalars_per: u32,
    scalars: *const f32,
    scalar_count: usize,
    knots: *const vr_knot,
    knot_count: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { argument::out(scene, "scene") }?;
        // SAFETY: the caller's promise.
        let source = unsafe { argument::reference(source, "source") }?;
        // SAFETY: the caller's promise.
        let scalars = unsafe { data::scalars(scalars, scalar_count, scalars_per) }?;
        // SAFETY: the caller's promise.
        let transfer = unsafe { data::transfer(knots, knot_count) }?;
        let transfer = transfer.unwrap_or_else(|| source.scene.scene().transfer.clone());
        Ok(give(source.with(source.scene.with_scalars(scalars, transfer)?), out))
    })
}

/// Makes a scene of the same data with other surfaces, or with none. The scenes share the data on the device. Every technique draws
/// opaque surfaces, some draw translucent ones: vr_plan_create() refuses the others.
///
/// `surfaces` are `surface_count` pointers. Everything is copied, and `source` is unchanged. Fails with VR_ERROR_INVALID.
///
/// Threads: any.
///
/// # Safety
///
/// Pointers are NULL or valid, arrays have the given lengths.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vr_scene_with_surfaces(
    source: *const vr_scene,
    surfaces: *const *const vr_surface_info,
    surface_count: usize,
    scene: *mut *mut vr_scene,
) -> vr_result {
    call(|| {
        // SAFETY: the caller's promise.
        let out = unsafe { argument::out(scene, "scene") }?;
        // SAFETY: the caller's promise.
        let source = unsafe { argument::reference(source, "source") }?;
        // SAFETY: the caller's promise.
        let given = unsafe { argument::array(surfaces, surface_count, "surfaces") }?;
        let surface = |(i, info): (usize, &*const vr_surface_info)| -> Result<Surface> {
            // SAFETY: the caller's promise.
            let info = unsafe { argument::structure(*info, &format!("surfaces[{i}]")) }?;
            // SAFETY: the caller's promise.
            unsafe { data::surface(&info) }.map_err(|error| match error {
                Error::Invalid { what, why } => {
                    Error::Invalid { what: format!("surfaces[{i}]: {what}"), why }
                }
                other => other,
            })
        };
        let surfaces = given.iter().enumerate().map(surface).collect::<Result<Vec<_>>>()?;
        let mut made = source.with(source.scene.with_surfaces(surfaces));
        // The default technique depends on the surfaces; the technique of a file is kept.
        if source.technique == default_technique(source.scene.scene()) {
            made.technique = default_technique(made.scene.scene());
        }
        Ok(give(made, out))
    })
}
