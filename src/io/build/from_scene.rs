//! From scene data to the contents of a file.

use crate::io::build::arrays::{ArrayInfo, Association};
use crate::io::build::data_file::{Array, DataFile, Lattice, Shape};
use crate::io::build::dataset::Dataset;
use crate::io::file::decode::Tuples;
use crate::io::file::sample_type::SampleType;
use crate::num;
use crate::scene::{Data, Gaussians, KernelSize, Points, Samples, TetScalars, Tets};

impl DataFile {
    /// Makes a file of scene data, whose scalars get a name. The weights and sizes of points become arrays `weight`,
    /// and `radius` or `covariance`. Gaussian splats become points with arrays `opacity`, `scale`, `rotation` (w, x, y, z) and
    /// `harmonics`.
    #[must_use]
    pub fn of(data: &Data, name: &str) -> Self {
        let name = if name.is_empty() { "scalar" } else { name };
        match data {
            Data::Grid(grid) => {
                let array = scalars(name, Association::Point, grid.samples());
                Self { shape: Shape::Even(Lattice::of(grid, grid.dims())), arrays: vec![array] }
            }
            Data::Mesh(mesh) => of_mesh(mesh, name),
            Data::Points(points) => of_points(points, name),
            Data::Gaussians(splats) => of_gaussians(splats),
        }
    }
}

/// Makes an array of numbers.
fn array<const N: usize>(
    name: &str,
    association: Association,
    (kind, components): (SampleType, usize),
    numbers: impl Iterator<Item = [u8; N]>,
) -> Array {
    let info = ArrayInfo { name: name.to_owned(), association, kind, components, active: false };
    let tuples = Tuples { bytes: numbers.flatten().collect(), ..Tuples::none(kind, components) };
    Array { info, tuples }
}

fn floats<'f>(name: &str, association: Association, values: impl IntoIterator<Item = &'f f32>) -> Array {
    array(name, association, (SampleType::F32, 1), values.into_iter().map(|x| x.to_le_bytes()))
}

/// Makes the active array of the scalars of a grid.
fn scalars(name: &str, association: Association, values: &Samples) -> Array {
    let mut made = match values {
        Samples::U8(v) => array(name, association, (SampleType::U8, 1), v.iter().map(|x| x.to_le_bytes())),
        Samples::U16(v) => array(name, association, (SampleType::U16, 1), v.iter().map(|x| x.to_le_bytes())),
        Samples::I16(v) => array(name, association, (SampleType::I16, 1), v.iter().map(|x| x.to_le_bytes())),
        Samples::F32(v) => floats(name, association, v),
        Samples::OnDemand(v) => scalars(name, association, &v.run(0..v.len())),
    };
    made.info.active = true;
    made
}

fn of_mesh(mesh: &Tets, name: &str) -> DataFile {
    let association = match mesh.scalars() {
        TetScalars::Point(_) => Association::Point,
        TetScalars::Cell(_) => Association::Cell,
    };
    let mut array = floats(name, association, mesh.scalars().values());
    array.info.active = true;
    let cells = mesh.cells().len();
    let dataset = Dataset {
        points: mesh.points().to_vec(),
        types: vec![10; cells],
        ends: (1..=num::count(cells)).map(|cell| cell.saturating_mul(4)).collect(),
        nodes: mesh.cells().iter().flatten().copied().collect(),
    };
    DataFile { shape: Shape::Cells(dataset), arrays: vec![array] }
}

fn of_points(points: &Points, name: &str) -> DataFile {
    let count = points.centres().len();
    let mut arrays: Vec<Array> = Vec::new();
    if let Some(values) = points.scalars() {
        let mut array = floats(name, Association::Point, values);
        array.info.active = true;
        arrays.push(array);
    }
    // The scalars may have one of these names.
    let unused = |name: &str| {
        if arrays.iter().any(|array| array.info.name == name) { format!("{name}_") } else { name.to_owned() }
    };
    let weights = points.weights().map(|weights| floats(&unused("weight"), Association::Point, weights));
    let (radius, covariance) = (unused("radius"), unused("covariance"));
    arrays.extend(weights);
    match points.size() {
        KernelSize::Unknown => {}
        KernelSize::Radius(radius_of_all) => {
            let all = std::iter::repeat_n(radius_of_all.to_le_bytes(), count);
            arrays.push(array(&radius, Association::Point, (SampleType::F64, 1), all));
        }
        KernelSize::Radii(radii) => arrays.push(floats(&radius, Association::Point, radii)),
        KernelSize::Covariances(all) => {
            // VTK orders six components differently; nine have the same order everywhere.
            let row = |&[xx, xy, xz, yy, yz, zz]: &[f32; 6]| [xx, xy, xz, xy, yy, yz, xz, yz, zz];
            let rows = all.iter().flat_map(row).map(f32::to_le_bytes);
            arrays.push(array(&covariance, Association::Point, (SampleType::F32, 9), rows));
        }
    }
    DataFile { shape: Shape::Cells(Dataset::of_points(points.centres().to_vec())), arrays }
}

fn of_gaussians(splats: &Gaussians) -> DataFile {
    let many = |name: &str, components: usize, numbers: &mut dyn Iterator<Item = f32>| {
        array(name, Association::Point, (SampleType::F32, components), numbers.map(f32::to_le_bytes))
    };
    let coefficients = splats.harmonics().len() / splats.len();
    let mut opacity = floats("opacity", Association::Point, splats.opacities());
    opacity.info.active = true;
    let arrays = vec![
        opacity,
        many("scale", 3, &mut splats.log_scales().as_flattened().iter().map(|log| log.exp())),
        many("rotation", 4, &mut splats.rotations().as_flattened().iter().copied()),
        many("harmonics", coefficients, &mut splats.harmonics().iter().copied()),
    ];
    let centres = (0..splats.len()).map(|i| splats.centre(i)).collect();
    DataFile { shape: Shape::Cells(Dataset::of_points(centres)), arrays }
}
