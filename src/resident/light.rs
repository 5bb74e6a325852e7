//! The light of a lit grid on the device (`lighting.glsl`).

use std::sync::Arc;

use glam::DVec3;

use crate::error::Result;
use crate::gpu::{Buffer, Gpu};
use crate::interface::Light;
use crate::num::{f32_of, vec3_of};
use crate::scene::{Grid, Lighting};

/// Uploads the light of a grid.
pub(crate) fn upload(gpu: &Gpu, grid: &Grid, lighting: &Lighting) -> Result<Arc<Buffer>> {
    Buffer::with_data(gpu, "light", bytemuck::bytes_of(&light(grid, lighting)))
}

/// Derives the numbers of the shader in float64.
fn light(grid: &Grid, lighting: &Lighting) -> Light {
    let Lighting { ambient, diffuse, specular, shininess, direction, .. } = *lighting;
    let unit = grid.spacing().min_element();
    let matrix = grid.index_to_world() * (1.0 / unit);
    let inverse = matrix.inverse();
    let metric = inverse * inverse.transpose();
    let to_light = direction.map_or(DVec3::ZERO, DVec3::normalize);
    let pack = |v: DVec3, w: f64| vec3_of(v).extend(f32_of(w)).to_array();
    let squares = DVec3::new(metric.x_axis.x, metric.y_axis.y, metric.z_axis.z);
    let products = DVec3::new(metric.y_axis.z, metric.z_axis.x, metric.x_axis.y);
    Light {
        squares: pack(squares, ambient),
        products: pack(products, diffuse),
        of_gradient: pack(inverse * to_light, specular),
        of_ray: pack(matrix.transpose() * to_light, shininess),
        least: f32_of(lighting.least_gradient_of(grid) * unit),
        from_eye: if direction.is_none() { 1.0 } else { 0.0 },
        pad: [0.0; 2],
    }
}
