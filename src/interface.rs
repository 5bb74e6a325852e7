//! Constants and structures that Rust shares with shaders. `build.rs` generates assertions that both sides agree on every offset
//! and size.
//!
//! Uses no other module. Used by everything that talks to shaders, and by `optics`.

use bytemuck::{Pod, Zeroable};

/// The constants of `glsl/interface.glsl`: numbers of bindings and specialisation constants, sizes, limits.
pub(crate) mod constants {
    include!(concat!(env!("OUT_DIR"), "/constants.rs"));
}

/// A knot of the transfer function (`optics.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct Knot {
    pub(crate) value: [f32; 4],
    pub(crate) rise: [f32; 4],
    pub(crate) s: f32,
    pub(crate) inverse_ds: f32,
    pub(crate) end: f32,
    pub(crate) pad: f32,
}

/// The head of a pre-integration table (`segments.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct TableHead {
    /// First and last scalar; bins or node spacings per unit of scalar; their width.
    pub(crate) range: [f32; 4],
    /// r, g, b, extinction of the constant piece left of the first knot.
    pub(crate) before: [f32; 4],
    /// The same right of the last knot.
    pub(crate) after: [f32; 4],
    /// Number of bins; or numbers of nodes and layers, and the longest segment.
    pub(crate) size: [f32; 4],
}

/// The light of a lit grid (`lighting.glsl`). A is the matrix from index to world, in voxel spacings, and l points to the light.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct Light {
    /// Diagonal of the inverse of the products of A's columns; ambient share.
    pub(crate) squares: [f32; 4],
    /// Its elements yz, zx, xy; diffuse share.
    pub(crate) products: [f32; 4],
    /// Cosine to the light per gradient: inverse of A times l; brightness of the highlight.
    pub(crate) of_gradient: [f32; 4],
    /// Cosine to the light per ray: transposed A times l; shininess.
    pub(crate) of_ray: [f32; 4],
    /// Length of the gradient, in scalars per voxel spacing, up to which nothing is lit.
    pub(crate) least: f32,
    /// 1: l points to the eye, along each ray.
    pub(crate) from_eye: f32,
    pub(crate) pad: [f32; 2],
}

/// A bin of a cumulative table (`segments.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct CumulativeBin {
    pub(crate) high: [f32; 4],
    pub(crate) low: [f32; 4],
    pub(crate) mean: [f32; 4],
    pub(crate) rise: [f32; 4],
}

/// The push constants of every technique for grids (`grid.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct GridPush {
    pub(crate) q0_kq: [f32; 4],
    pub(crate) px_slope: [f32; 4],
    pub(crate) py_z0: [f32; 4],
    pub(crate) d0_h: [f32; 4],
    pub(crate) half_slope: [f32; 4],
    pub(crate) slopes: [f32; 2],
    pub(crate) sides: u32,
    pub(crate) value_scale: f32,
    pub(crate) value_offset: f32,
    pub(crate) knots: u32,
    pub(crate) first: u32,
    pub(crate) count: u32,
    pub(crate) order: u32,
    pub(crate) unit: f32,
    pub(crate) opaque: f32,
    pub(crate) seed: u32,
}

/// The push constants of compositing on a base plane (`base-plane.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct BasePlanePush {
    pub(crate) q0_step: [f32; 4],
    pub(crate) d0_step: [f32; 4],
    pub(crate) half_scale: [f32; 4],
    pub(crate) slope_u: [f32; 4],
    pub(crate) slope_v: [f32; 2],
    pub(crate) z0: f32,
    pub(crate) h: f32,
    pub(crate) value_scale: f32,
    pub(crate) value_offset: f32,
    pub(crate) knots: u32,
    pub(crate) first: u32,
    pub(crate) count: u32,
    pub(crate) order: u32,
    pub(crate) opaque: f32,
    pub(crate) offset: u32,
    pub(crate) size: [u32; 2],
    pub(crate) atlas: [u32; 2],
}

/// The push constants of the warp (`warp.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct WarpPush {
    pub(crate) to_x: [f32; 4],
    pub(crate) to_y: [f32; 4],
    pub(crate) to_w: [f32; 4],
    pub(crate) ahead: [f32; 4],
    pub(crate) aside_u: [f32; 4],
    pub(crate) aside_v: [f32; 4],
    pub(crate) half_extent: [f32; 2],
    pub(crate) size: [u32; 2],
    pub(crate) offset: u32,
    pub(crate) stride: u32,
    pub(crate) levels: u32,
    pub(crate) flags: u32,
}

/// The push constants of `bricks.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct BricksPush {
    pub(crate) across: u32,
    pub(crate) rows: u32,
    pub(crate) planes: u32,
    pub(crate) ranges: u32,
    pub(crate) margin: f32,
}

/// The push constants of every technique for meshes (`mesh.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct MeshPush {
    pub(crate) right: [f32; 4],
    pub(crate) up: [f32; 4],
    pub(crate) forward: [f32; 4],
    pub(crate) half_extent: [f32; 2],
    pub(crate) pixel: f32,
    pub(crate) w0: f32,
    pub(crate) w1: f32,
    pub(crate) slope: f32,
    pub(crate) unit: f32,
    pub(crate) count: u32,
    pub(crate) first: u32,
    pub(crate) number: u32,
    pub(crate) capacity: u32,
    pub(crate) band: u32,
    pub(crate) knots: u32,
    pub(crate) opaque: f32,
    pub(crate) smoke: f32,
    pub(crate) alike: f32,
    pub(crate) last_round: u32,
    pub(crate) aspect: f32,
    pub(crate) skew: [f32; 2],
}

/// The push constants of `bins.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct BinsPush {
    pub(crate) across: u32,
    pub(crate) first: u32,
    pub(crate) tiles: u32,
    pub(crate) count: u32,
    pub(crate) capacity: u32,
}

/// The push constants of the passes that draw splats (`splats.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct SplatPush {
    pub(crate) q0_kq: [f32; 4],
    pub(crate) px_slope: [f32; 4],
    pub(crate) py_slope: [f32; 4],
    pub(crate) d0_slope: [f32; 4],
    pub(crate) forward_reach: [f32; 4],
    pub(crate) slope_y: f32,
    pub(crate) sides: u32,
    pub(crate) unit: f32,
    pub(crate) h: f32,
    pub(crate) cut: f32,
    pub(crate) least: f32,
    pub(crate) amplitude: f32,
    pub(crate) opaque: f32,
    pub(crate) knots: u32,
    pub(crate) band: u32,
    pub(crate) tiles: u32,
    pub(crate) turns: u32,
}

/// The push constants of `splat-project.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct SplatViewPush {
    pub(crate) right: [f32; 4],
    pub(crate) up: [f32; 4],
    pub(crate) forward: [f32; 4],
    pub(crate) half_extent: [f32; 2],
    pub(crate) pixel: f32,
    pub(crate) w0: f32,
    pub(crate) w1: f32,
    pub(crate) unit: f32,
    pub(crate) cut: f32,
    pub(crate) amplitude: f32,
    pub(crate) lowpass: f32,
    pub(crate) thickness: f32,
    pub(crate) eye: f32,
    pub(crate) middle: f32,
    pub(crate) count: u32,
    pub(crate) aspect: f32,
    pub(crate) skew: [f32; 2],
    pub(crate) room: u32,
    pub(crate) pad0: u32,
}

/// The push constants of `gaussians-project.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct TrainedPush {
    pub(crate) right: [f32; 4],
    pub(crate) down: [f32; 4],
    pub(crate) forward: [f32; 4],
    pub(crate) eye: [f32; 4],
    pub(crate) middle: [f32; 4],
    pub(crate) skew: [f32; 2],
    pub(crate) from_whole: [f32; 2],
    pub(crate) sides: u32,
    pub(crate) whole: u32,
    pub(crate) scale_low: f32,
    pub(crate) scale_step: f32,
    pub(crate) reach: f32,
    pub(crate) count: u32,
    pub(crate) degree: u32,
    pub(crate) perspective: u32,
}

/// The thick segment of a cell and the corners around it, drawn as a fan of triangles (`tet-fans.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct Fan {
    pub(crate) weights: [f32; 4],
    pub(crate) thick: [f32; 4],
    pub(crate) corners: u32,
    pub(crate) pad0: u32,
    pub(crate) pad1: u32,
    pub(crate) pad2: u32,
}

/// The push constants of `probe.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct ProbePush {
    pub(crate) count: u32,
}

/// The push constants of the micro-benchmarks (`peak.glsl`).
#[cfg(feature = "cli")]
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct PeakPush {
    pub(crate) count: u32,
}

/// The push constants of `scan.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct ScanPush {
    pub(crate) count: u32,
    pub(crate) chunk: u32,
    pub(crate) chunks: u32,
}

/// The push constants of `radix-sort.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct SortPush {
    pub(crate) capacity: u32,
    pub(crate) runs: u32,
    pub(crate) shift: u32,
    pub(crate) mask: u32,
}

/// The push constants of the pass that bounds rays (`line-bounds.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct BoundsPush {
    pub(crate) planes: [[f32; 4]; 6],
    pub(crate) sides: u32,
    pub(crate) corner: u32,
    pub(crate) inverse: [f32; 2],
    pub(crate) depths: [f32; 2],
    pub(crate) kq: f32,
    pub(crate) count: u32,
}

/// The push constants of `upsampling.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct UpsamplingPush {
    pub(crate) half_extent: [f32; 2],
    pub(crate) half_source: [f32; 2],
    pub(crate) scale: f32,
    pub(crate) inverse: f32,
    pub(crate) refine: f32,
    pub(crate) pad0: u32,
}

/// The changes of the colour of a tile's centre (`pilots.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct Pilot {
    pub(crate) colour: [f32; 4],
    pub(crate) changes: [f32; 8],
    pub(crate) levels: u32,
    pub(crate) pad0: [u32; 3],
}

/// How far the ray of a pixel through pages has come (`paging.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct RayState {
    pub(crate) slab: u32,
    pub(crate) transmittance: f32,
    pub(crate) reached: f32,
    pub(crate) layer: f32,
    pub(crate) front: u32,
    pub(crate) back: u32,
}

/// The push constants of `steps.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct StepsPush {
    pub(crate) tiles: [u32; 2],
    pub(crate) bound: f32,
    pub(crate) pad0: u32,
}

/// The push constants of `shear-bounds.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct ShearBoundsPush {
    pub(crate) q0_step: [f32; 4],
    pub(crate) d0_step: [f32; 4],
    pub(crate) ahead_sign: [f32; 4],
    pub(crate) to_x: [f32; 4],
    pub(crate) to_y: [f32; 4],
    pub(crate) to_w: [f32; 4],
    pub(crate) size: [u32; 2],
    pub(crate) offset: u32,
    pub(crate) stride: u32,
    pub(crate) tolerance: f32,
    pub(crate) spread: f32,
    pub(crate) pad0: f32,
    pub(crate) pad1: f32,
}

/// The push constants of `surfaces.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct SurfacePush {
    pub(crate) q0_kq: [f32; 4],
    pub(crate) right_kd: [f32; 4],
    pub(crate) up_near: [f32; 4],
    pub(crate) forward_ratio: [f32; 4],
    pub(crate) half_extent: [f32; 2],
    pub(crate) offset: f32,
    pub(crate) capacity: u32,
    pub(crate) across: u32,
    pub(crate) tiles: u32,
    pub(crate) slack: f32,
    pub(crate) pad0: u32,
}

/// A triangle of a surface (`surfaces.glsl`).
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct Triangle {
    pub(crate) plane: [f32; 4],
    pub(crate) colour: [f32; 4],
}

/// The push constants of `composite.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct CompositePush {
    pub(crate) corner: [i32; 2],
}

/// The push constants of `hit-depths-image.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct HitDepthsPush {
    pub(crate) corner: [i32; 2],
    pub(crate) numerator: [f32; 2],
    pub(crate) denominator: [f32; 2],
    pub(crate) width: u32,
    pub(crate) far: f32,
}

/// The push constants of `picture.glsl`.
#[cfg(feature = "cli")]
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct PicturePush {
    pub(crate) background: [f32; 4],
    pub(crate) corner: [f32; 2],
    pub(crate) size: [f32; 2],
    pub(crate) displayed: u32,
}

/// The push constants of `panel.glsl`.
#[cfg(feature = "cli")]
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub(crate) struct PanelPush {
    pub(crate) size: [f32; 2],
}

/// A corner of a triangle of a window's panel (`panel.glsl`).
#[cfg(feature = "cli")]
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct PanelCorner {
    /// Position in the window, in pixels from its top left corner.
    pub position: [f32; 2],
    /// Position in the atlas, from 0 to 1.
    pub place: [f32; 2],
    /// The rectangle of the window that the triangle is cut at, in pixels: each word has x in its lower and y in its upper half.
    pub clip: [u32; 2],
    /// Premultiplied sRGB with opacity, a byte each, red in the lowest.
    pub colour: u32,
    /// Not used.
    pub pad: u32,
}
