//! The surfaces of a scene on the device: points, triangles and colours.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use glam::DVec3;

use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu};
use crate::interface::Triangle;
use crate::num::{self, f32_of};
use crate::resident::local_space::LocalSpace;
use crate::resident::mesh::{Needs, face_words};
use crate::scene::{Shading, Surface};

const NAME: &str = "surfaces";

/// Most triangles of a scene. Their numbers are kept in the bits of floats from 2 up.
const MOST_TRIANGLES: usize = 1 << 27;

/// The surfaces of a scene, for every view.
#[derive(Debug)]
pub(crate) struct SurfaceData {
    pub(crate) space: LocalSpace,
    pub(crate) points: Arc<Buffer>,
    pub(crate) point_count: u32,
    pub(crate) primitives: Arc<Buffer>,
    pub(crate) numbers: Arc<Buffer>,
    /// A point, the unit normal and the colour of each triangle; shaded ones have minus their opacity.
    pub(crate) triangles: Vec<(DVec3, DVec3, [f64; 4])>,
    /// Whether a surface is translucent.
    pub(crate) translucent: bool,
    pub(crate) needs: Mutex<Needs>,
}

impl SurfaceData {
    /// Uploads surfaces; `None` where no triangle has an area.
    ///
    /// Points are relative to the box of `corners`, those of the volume's data, so that float32 keeps its digits there.
    pub(crate) fn new(gpu: &Gpu, surfaces: &[Surface], corners: &[DVec3]) -> Result<Option<Arc<Self>>> {
        let mut places: HashMap<[u64; 3], u32> = HashMap::new();
        let mut points: Vec<DVec3> = Vec::new();
        let mut primitives: Vec<[u32; 5]> = Vec::new();
        let mut triangles = Vec::new();
        for surface in surfaces {
            let index: Vec<u32> = surface
                .points()
                .iter()
                .map(|&point| {
                    // Adding 0 makes -0 and 0 the same place.
                    let point = point + DVec3::ZERO;
                    *places.entry(point.to_array().map(f64::to_bits)).or_insert_with(|| {
                        points.push(point);
                        num::count(points.len() - 1)
                    })
                })
                .collect();
            let [r, g, b, opacity] = surface.colour();
            let colour = [r, g, b, if surface.shading() == Shading::Headlight { -opacity } else { opacity }];
            for corners in surface.triangles() {
                let mut corners = corners.map(|i| index[num::index(i)]);
                let [a, b, c] = corners.map(|i| points[num::index(i)]);
                let (ab, ac) = (b - a, c - a);
                // Scaled, so that triangles of any size have a normal.
                let unit = |edge: DVec3| edge / edge.abs().max_element();
                let Some(normal) = unit(ab).cross(unit(ac)).try_normalize() else { continue };
                if surface.colour()[3] == 0.0 {
                    continue;
                }
                corners.sort_unstable();
                let number = num::count(triangles.len());
                primitives.push(face_words(corners, [number; 2], [true; 2]));
                triangles.push((a, normal, colour));
            }
        }
        if triangles.is_empty() {
            return Ok(None);
        }
        if triangles.len() > MOST_TRIANGLES {
            let why = format!("{} triangles: at most {MOST_TRIANGLES} are drawn", triangles.len());
            return Err(Error::invalid(NAME, why));
        }
        let low = corners.iter().copied().reduce(DVec3::min).unwrap_or_default();
        let high = corners.iter().copied().reduce(DVec3::max).unwrap_or_default();
        let space = LocalSpace::around([low, high]);
        let places: Vec<[f32; 4]> = points
            .iter()
            .map(|&point| {
                let [x, y, z] = space.place(point);
                [x, y, z, 0.0]
            })
            .collect();
        let numbers: Vec<u32> = (0..num::count(triangles.len())).map(|i| 0x4000_0000 | i << 2).collect();
        Ok(Some(Arc::new(Self {
            space,
            points: Buffer::with_data(gpu, "surfaces.points", bytemuck::cast_slice(&places))?,
            point_count: num::count(points.len()),
            primitives: Buffer::with_data(gpu, "surfaces.faces", bytemuck::cast_slice(&primitives))?,
            numbers: Buffer::with_data(gpu, "surfaces.numbers", bytemuck::cast_slice(&numbers))?,
            translucent: surfaces.iter().any(Surface::is_translucent),
            triangles,
            needs: Mutex::default(),
        })))
    }

    /// Returns the plane and colour of each triangle, relative to `centre` in units of `unit`.
    pub(crate) fn planes(&self, centre: DVec3, unit: f64) -> Vec<Triangle> {
        let plane = |&(point, normal, colour): &(DVec3, DVec3, [f64; 4])| {
            let height = normal.dot(centre - point) / unit;
            Triangle { plane: [normal.x, normal.y, normal.z, height].map(f32_of), colour: colour.map(f32_of) }
        };
        self.triangles.iter().map(plane).collect()
    }
}
