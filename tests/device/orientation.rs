//! Where files say that their samples lie: pictures of oblique and mirrored lattices, against the same field on
//! an upright one.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small numbers of test files")]

use std::fmt::Write as _;

use crate::common::*;
use glam::{DMat3, DQuat, DVec3};
use volraster::GpuScene;
use volraster::io::{Data, ReadOptions, read_memory};
use volraster::measure::ImageErrors;
use volraster::scene::{Camera, Grid, Projection, Samples, Scene, TransferFunction, View};

/// Three unlike Gaussians, none where a mirror or a turn of the others would put it. Below 0.02, where the
/// transfer function begins, further than 0.75 from the origin.
fn field(p: DVec3) -> f64 {
    let blob = |x, y, z, sigma: f64, a: f64| {
        a * (-(p - DVec3::new(x, y, z)).length_squared() / (2.0 * sigma * sigma)).exp()
    };
    blob(0.3, 0.1, -0.05, 0.12, 1.0) + blob(-0.2, 0.25, 0.1, 0.1, 0.7) + blob(-0.05, -0.1, 0.35, 0.09, 0.45)
}

/// Where a lattice lies: samples at `origin + columns * index`.
#[derive(Clone, Copy)]
struct Lattice {
    dims: [u32; 3],
    columns: DMat3,
    origin: DVec3,
}

impl Lattice {
    /// A lattice about the origin that reaches at least 0.75 in every direction: its axes are a turn, a mirror
    /// or a shear of the world's, and its spacings `h` times 1, 1.3 and 0.8.
    fn about_origin(axes: DMat3, h: f64) -> Self {
        let spacing = DVec3::new(1.0, 1.3, 0.8) * h;
        let columns = axes * DMat3::from_diagonal(spacing);
        // A sheared box is thinner than its edges are long.
        let inverse = columns.inverse();
        let half = [0, 1, 2].map(|axis| (0.75 * inverse.row(axis).length()).ceil());
        let origin = -(columns * DVec3::from_array(half));
        Self { dims: half.map(|n| n as u32 * 2 + 1), columns, origin }
    }

    fn values(&self) -> Vec<f32> {
        let [nx, ny, nz] = self.dims;
        let mut values = Vec::new();
        for z in 0..nz {
            for y in 0..ny {
                for x in 0..nx {
                    let index = DVec3::new(f64::from(x), f64::from(y), f64::from(z));
                    values.push(field(self.origin + self.columns * index) as f32);
                }
            }
        }
        values
    }

    fn bytes(&self) -> Vec<u8> {
        self.values().into_iter().flat_map(f32::to_le_bytes).collect()
    }

    fn nrrd(&self) -> Vec<u8> {
        let vector = |v: DVec3| format!("({},{},{})", v.x, v.y, v.z);
        let [x, y, z] = self.dims;
        let mut text = format!("NRRD0005\ntype: float\ndimension: 3\nsizes: {x} {y} {z}\nencoding: raw\n");
        let [a, b, c] = [0, 1, 2].map(|axis| vector(self.columns.col(axis)));
        let _ =
            write!(text, "endian: little\nspace: right-anterior-superior\nspace directions: {a} {b} {c}\n");
        let _ = write!(text, "space origin: {}\n\n", vector(self.origin));
        [text.into_bytes(), self.bytes()].concat()
    }

    /// Spacings, and axes of unit length.
    fn axes(&self) -> ([f64; 3], [DVec3; 3]) {
        let columns = [0, 1, 2].map(|axis| self.columns.col(axis));
        (columns.map(DVec3::length), columns.map(DVec3::normalize))
    }

    /// MetaImage: a row of the matrix is the direction of an axis.
    fn metaimage(&self) -> Vec<u8> {
        let ([x, y, z], ([sx, sy, sz], axes), o) = (self.dims, self.axes(), self.origin);
        let rows = axes.map(|v| format!("{} {} {}", v.x, v.y, v.z)).join(" ");
        let text = format!(
            "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
             TransformMatrix = {rows}\nOffset = {} {} {}\nElementSpacing = {sx} {sy} {sz}\n\
             DimSize = {x} {y} {z}\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n",
            o.x, o.y, o.z
        );
        [text.into_bytes(), self.bytes()].concat()
    }

    /// VTI: the matrix is written by rows, its columns are the axes.
    fn vti(&self) -> Vec<u8> {
        let ([x, y, z], ([sx, sy, sz], [a, b, c]), o) = (self.dims.map(|n| n - 1), self.axes(), self.origin);
        let rows = [0, 1, 2].map(|i| format!("{} {} {}", a[i], b[i], c[i])).join(" ");
        let extent = format!("0 {x} 0 {y} 0 {z}");
        let text = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" \
             header_type=\"UInt64\">\n<ImageData WholeExtent=\"{extent}\" Origin=\"{} {} {}\" \
             Spacing=\"{sx} {sy} {sz}\" Direction=\"{rows}\">\n<Piece Extent=\"{extent}\">\n\
             <PointData Scalars=\"s\"><DataArray type=\"Float32\" Name=\"s\" format=\"appended\" offset=\"0\"/>\
             </PointData>\n</Piece>\n</ImageData>\n<AppendedData encoding=\"raw\">\n_",
            o.x, o.y, o.z
        );
        let data = self.bytes();
        let length = (data.len() as u64).to_le_bytes();
        [text.into_bytes(), length.to_vec(), data, b"\n</AppendedData>\n</VTKFile>\n".to_vec()].concat()
    }

    /// NIfTI-1 with `put` for the fields that place it.
    fn nifti(&self, put: impl Fn(&mut dyn FnMut(usize, &[u8]))) -> Vec<u8> {
        let mut bytes = vec![0; 352];
        let mut set = |at: usize, new: &[u8]| bytes[at..at + new.len()].copy_from_slice(new);
        set(0, &348_i32.to_le_bytes());
        for (i, n) in [3, self.dims[0], self.dims[1], self.dims[2], 1, 1, 1, 1].into_iter().enumerate() {
            set(40 + 2 * i, &(n as u16).to_le_bytes());
        }
        set(70, &16_i16.to_le_bytes());
        set(72, &32_i16.to_le_bytes());
        set(108, &352_f32.to_le_bytes());
        set(344, b"n+1\0");
        put(&mut set);
        [bytes, self.bytes()].concat()
    }

    /// Rows of the affine map.
    fn sform(&self) -> Vec<u8> {
        self.nifti(|set| {
            set(254, &1_i16.to_le_bytes());
            for row in 0..3 {
                for column in 0..4 {
                    let value = if column < 3 { self.columns.col(column)[row] } else { self.origin[row] };
                    set(280 + 16 * row + 4 * column, &(value as f32).to_le_bytes());
                }
            }
        })
    }

    /// A rotation as a quaternion; a mirrored lattice by a negative pixdim[0], which mirrors its z axis.
    fn qform(&self, rotation: DQuat, mirrored: bool) -> Vec<u8> {
        let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
        self.nifti(|set| {
            set(252, &1_i16.to_le_bytes());
            set(76, &if mirrored { -1_f32 } else { 1.0 }.to_le_bytes());
            for axis in 0..3 {
                set(80 + 4 * axis, &(self.columns.col(axis).length() as f32).to_le_bytes());
                set(268 + 4 * axis, &(self.origin[axis] as f32).to_le_bytes());
                let part = [rotation.x, rotation.y, rotation.z][axis];
                set(256 + 4 * axis, &(part as f32).to_le_bytes());
            }
        })
    }
}

fn scene(grid: Grid) -> Scene {
    let rows = [
        [0.02, 0.1, 0.3, 0.9, 0.0],
        [0.3, 0.2, 0.7, 0.5, 4.0],
        [0.6, 0.9, 0.8, 0.2, 8.0],
        [1.0, 1.0, 0.3, 0.1, 12.0],
    ];
    Scene::new(grid, TransferFunction::from_rows(&rows).unwrap())
}

fn read(name: &str, bytes: &[u8]) -> Grid {
    match read_memory(&[(name, bytes)], &ReadOptions::default()).unwrap().data {
        Data::Grid(grid) => grid,
        other => panic!("{}", other.kind()),
    }
}

/// What every format says of a lattice is the same place: the picture comes as near to the upright lattice's as
/// the spacing lets it, to second order, and a mirrored reading would be a hundred times as far off.
#[test]
fn oblique_and_mirrored_files_show_what_an_upright_grid_shows() {
    let gpu = gpu();
    let camera = Camera {
        eye: DVec3::new(1.6, -2.2, 1.1),
        target: DVec3::ZERO,
        up: DVec3::Z,
        projection: Projection::Perspective { fov_y_deg: 34.0 },
    };
    let view = View::new(camera, 64, 64).unwrap();
    let picture =
        |grid: Grid| draw_on(&GpuScene::new(&gpu, scene(grid)), &view, "raycast:step=0.5,filter=exact");
    let turn = DQuat::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), 0.9);
    let turned = DMat3::from_quat(turn);
    let mirror_z = DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0));
    let mirror_x = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    let swapped = DMat3::from_cols(DVec3::Y, DVec3::NEG_Z, DVec3::X);
    let shear = turned * DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(0.3, 0.1, 1.0).normalize());

    let upright = |h: f64| {
        let lattice = Lattice::about_origin(DMat3::IDENTITY, h);
        let grid = Grid::new(lattice.dims, Samples::F32(lattice.values())).unwrap();
        let spacing = DVec3::new(1.0, 1.3, 0.8) * h;
        picture(grid.with_placement(spacing, lattice.origin, DMat3::IDENTITY).unwrap())
    };
    let spacings = [0.04, 0.02];
    let truth = upright(0.01);
    let mirrored = {
        let mut grid = Lattice::about_origin(DMat3::IDENTITY, 0.02);
        grid.columns = mirror_x * grid.columns;
        grid.origin = mirror_x * grid.origin;
        let at = Lattice::about_origin(DMat3::IDENTITY, 0.02);
        let wrong = Grid::new(grid.dims, Samples::F32(grid.values())).unwrap();
        picture(wrong.with_placement(DVec3::new(1.0, 1.3, 0.8) * 0.02, at.origin, DMat3::IDENTITY).unwrap())
    };
    let far = ImageErrors::between(&mirrored, &truth).unwrap().all.rmse;

    type Write = fn(&Lattice, DQuat) -> Vec<u8>;
    let nrrd: Write = |lattice, _| lattice.nrrd();
    let sform: Write = |lattice, _| lattice.sform();
    let metaimage: Write = |lattice, _| lattice.metaimage();
    let vti: Write = |lattice, _| lattice.vti();
    let cases: [(&str, &str, DMat3, Write); 16] = [
        ("MetaImage, oblique", "a.mha", turned, metaimage),
        ("MetaImage, mirrored", "a.mha", mirror_x, metaimage),
        ("MetaImage, axes exchanged", "a.mha", swapped, metaimage),
        ("VTI, oblique", "a.vti", turned, vti),
        ("VTI, mirrored", "a.vti", mirror_x, vti),
        ("VTI, axes exchanged", "a.vti", swapped, vti),
        ("NRRD, oblique", "a.nrrd", turned, nrrd),
        ("NRRD, mirrored", "a.nrrd", mirror_x, nrrd),
        ("NRRD, axes exchanged", "a.nrrd", swapped, nrrd),
        ("NRRD, oblique and sheared", "a.nrrd", shear, nrrd),
        ("NIfTI sform, oblique", "a.nii", turned, sform),
        ("NIfTI sform, mirrored", "a.nii", mirror_x, sform),
        ("NIfTI sform, oblique, mirrored and sheared", "a.nii", shear * mirror_z, sform),
        ("NIfTI qform, oblique", "a.nii", turned, |lattice, turn| lattice.qform(turn, false)),
        ("NIfTI qform, oblique and mirrored", "a.nii", turned * mirror_z, |lattice, turn| {
            lattice.qform(turn, true)
        }),
        ("NIfTI qform, mirrored", "a.nii", mirror_z, |lattice, _| lattice.qform(DQuat::IDENTITY, true)),
    ];
    for (what, name, axes, write) in cases {
        let rmse = spacings.map(|h| {
            let lattice = Lattice::about_origin(axes, h);
            let image = picture(read(name, &write(&lattice, turn)));
            ImageErrors::between(&image, &truth).unwrap().all.rmse
        });
        println!("{what}: {:.1e} {:.1e}, mirrored {far:.1e}", rmse[0], rmse[1]);
        // Trilinear interpolation is second order: a quarter, and a little for what the truth lacks itself.
        assert!(rmse[1] < 0.4 * rmse[0], "{what}: {rmse:?} does not converge");
        assert!(rmse[1] < 0.01 * far, "{what}: {rmse:?} beside {far} of a mirrored reading");
    }
}
