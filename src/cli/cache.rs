//! A cache of reference images on disk.
//!
//! The name of a file is the SHA-256 of everything that determines its image: data, transfer function, camera, size,
//! and the source code of the reference. The file ends in a SHA-256 of its own content; a damaged file counts as
//! missing. The least recently used files are removed when the total exceeds [`MAX_BYTES`].

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use flate2::Compression;
use flate2::read::ZlibDecoder;
use flate2::write::ZlibEncoder;
use sha2::{Digest, Sha256};
use volraster::gpu::user_cache_folder;
use volraster::reference::{ReferenceImage, ReferenceOptions};
use volraster::scene::{Data, KernelSize, Samples, Scene, TetScalars, View};
use volraster::{Result, reference};

/// Maximum total size of the files, in bytes.
const MAX_BYTES: u64 = 1 << 30;

const MAGIC: &[u8; 8] = b"VOLRREF1";

/// Magic number, width, height.
const HEADER: usize = 8 + 4 + 4;

const HASH: usize = 32;

const ENDING: &str = "reference";

/// Lists files below `src/`, each with its content.
macro_rules! sources {
    ($($folder:literal: $($file:literal),*;)*) => {
        &[$($((concat!($folder, $file), include_bytes!(concat!("../", $folder, $file)))),*),*]
    };
}

/// Source code that determines the image: a changed reference invalidates the cache.
const SOURCES: &[(&str, &[u8])] = sources! {
    "reference/": "cells.rs", "cover.rs", "decay.rs", "draw.rs", "gaussians.rs", "grid.rs", "image.rs", "index_space.rs", "kernels.rs", "march.rs",
        "mod.rs", "polynomial.rs", "surfaces.rs", "tets.rs", "tree.rs", "view_ray.rs", "walk.rs";
    "reference/kernels/": "density.rs", "hits.rs", "interpolate.rs", "lattice.rs", "scattered.rs", "values.rs";
    "scene/": "camera.rs", "clip.rs", "gaussians.rs", "grid.rs", "harmonics.rs", "kernel.rs", "mode.rs", "points.rs", "samples.rs", "tets.rs",
        "transfer.rs";
};

/// A folder of reference images.
#[derive(Clone, Debug)]
pub(crate) struct Cache {
    /// `None`: no cache.
    folder: Option<PathBuf>,
    max_bytes: u64,
}

/// How an image was obtained.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Origin {
    Drawn,
    Cached,
}

impl Cache {
    /// Returns the user's cache, or one that stores nothing.
    pub(crate) fn of_user(is_used: bool) -> Self {
        let folder = user_cache_folder().filter(|_| is_used).map(|cache| cache.join("reference"));
        Self { folder, max_bytes: MAX_BYTES }
    }

    /// Returns the reference image of a view, with one ray per pixel, from the cache or drawn. `progress` is called
    /// as by [`reference::render`]. A cache that cannot be read or written is no error.
    pub(crate) fn image(
        &self,
        scene: &Scene,
        view: &View,
        progress: Option<&(dyn Fn(u32, u32) + Sync)>,
    ) -> Result<(ReferenceImage, Origin)> {
        let path = self.folder.as_ref().and_then(|folder| {
            let key = key(scene, view)?;
            let name: String = key.iter().map(|byte| format!("{byte:02x}")).collect();
            Some(folder.join(format!("{name}.{ENDING}")))
        });
        if let Some(path) = &path
            && let Some(image) = load(path, view.extent())
        {
            // The modification time marks a file as recently used.
            if let Ok(file) = std::fs::OpenOptions::new().append(true).open(path) {
                let _ = file.set_modified(SystemTime::now());
            }
            return Ok((image, Origin::Cached));
        }
        let image = reference::render(scene, view, &ReferenceOptions::default(), progress)?;
        if let (Some(folder), Some(path)) = (&self.folder, &path) {
            let _ = self.store(folder, path, &image);
        }
        Ok((image, Origin::Drawn))
    }

    /// Writes a file, which appears complete or not at all for other processes.
    fn store(&self, folder: &Path, path: &Path, image: &ReferenceImage) -> std::io::Result<()> {
        let bytes = encoded(image)?;
        if bytes.len() as u64 > self.max_bytes {
            return Ok(());
        }
        std::fs::create_dir_all(folder)?;
        self.evict(folder, bytes.len() as u64);
        let part = path.with_extension(format!("{}.part", std::process::id()));
        let written = std::fs::write(&part, bytes).and_then(|()| std::fs::rename(&part, path));
        if written.is_err() {
            let _ = std::fs::remove_file(&part);
        }
        written
    }

    /// Removes the least recently used files until `bytes` more fit, and files that interrupted writers left.
    fn evict(&self, folder: &Path, bytes: u64) {
        let mut files: Vec<(SystemTime, u64, PathBuf)> = Vec::new();
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let (path, Ok(meta)) = (entry.path(), entry.metadata()) else { continue };
            let is_ours = path.extension().is_some_and(|ending| ending == ENDING || ending == "part");
            if let (true, true, Ok(used)) = (is_ours, meta.is_file(), meta.modified()) {
                files.push((used, meta.len(), path));
            }
        }
        files.sort();
        let mut all: u64 = files.iter().map(|(_, size, _)| size).sum();
        for (_, size, path) in files {
            if all + bytes <= self.max_bytes {
                break;
            }
            if std::fs::remove_file(path).is_ok() {
                all -= size;
            }
        }
    }
}

/// Hashes everything that determines an image; `None` for data that the reference does not draw, or that are read on demand.
fn key(scene: &Scene, view: &View) -> Option<[u8; HASH]> {
    let mut hash = Sha256::new();
    // Each part is prefixed with its length, so that different lists of parts never hash the same bytes.
    let mut put = |bytes: &[u8]| {
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    };
    put(env!("CARGO_PKG_VERSION").as_bytes());
    for (name, source) in SOURCES {
        put(name.as_bytes());
        put(source);
    }
    // `{:?}` of a float is exact: it reads back as the same value.
    put(format!("{:?} {:?} {:?}", view.camera(), view.extent(), view.clip()).as_bytes());
    put(format!("{:?}", scene.transfer.knots()).as_bytes());
    put(format!("{:?} {:?}", scene.kernels, scene.mode).as_bytes());
    for surface in &scene.surfaces {
        put(format!("surface {:?} {:?}", surface.colour(), surface.shading()).as_bytes());
        put(bytemuck::cast_slice(surface.points()));
        put(bytemuck::cast_slice(surface.triangles()));
    }
    match &scene.data {
        Data::Grid(grid) => {
            let place = (grid.dims(), grid.index_to_world(), grid.origin(), grid.rescale());
            put(format!("grid {:?} {place:?}", grid.samples().type_name()).as_bytes());
            put(match grid.samples() {
                Samples::U8(samples) => samples,
                Samples::U16(samples) => bytemuck::cast_slice(samples),
                Samples::I16(samples) => bytemuck::cast_slice(samples),
                Samples::F32(samples) => bytemuck::cast_slice(samples),
                Samples::OnDemand(_) => return None,
            });
        }
        Data::Mesh(mesh) => {
            put(match mesh.scalars() {
                TetScalars::Point(_) => b"mesh, scalars of points",
                TetScalars::Cell(_) => b"mesh, scalars of cells",
            });
            put(bytemuck::cast_slice(mesh.points()));
            put(bytemuck::cast_slice(mesh.cells()));
            put(bytemuck::cast_slice(mesh.scalars().values()));
        }
        Data::Points(points) => {
            put(b"points");
            put(bytemuck::cast_slice(points.centres()));
            for list in [points.scalars(), points.weights()] {
                put(&[u8::from(list.is_some())]);
                put(bytemuck::cast_slice(list.unwrap_or_default()));
            }
            let (kind, sizes): (&[u8], &[u8]) = match points.size() {
                KernelSize::Unknown => (b"unknown", &[]),
                KernelSize::Radius(radius) => (b"radius", bytemuck::bytes_of(radius)),
                KernelSize::Radii(radii) => (b"radii", bytemuck::cast_slice(radii)),
                KernelSize::Covariances(all) => (b"covariances", bytemuck::cast_slice(all)),
            };
            put(kind);
            put(sizes);
        }
        Data::Gaussians(splats) => {
            put(format!("gaussians {} {:?}", splats.degree(), scene.splat_rule()).as_bytes());
            put(bytemuck::cast_slice(splats.centres()));
            put(bytemuck::cast_slice(splats.rotations()));
            put(bytemuck::cast_slice(splats.log_scales()));
            put(bytemuck::cast_slice(splats.opacities()));
            put(bytemuck::cast_slice(splats.harmonics()));
        }
        _ => return None,
    }
    Some(hash.finalize().into())
}

fn encoded(image: &ReferenceImage) -> std::io::Result<Vec<u8>> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(image.width().to_le_bytes());
    bytes.extend(image.height().to_le_bytes());
    // Many images are mostly empty and compress well.
    let mut packer = ZlibEncoder::new(bytes, Compression::fast());
    for channel in image.pixels().as_flattened() {
        packer.write_all(&channel.to_le_bytes())?;
    }
    let mut bytes = packer.finish()?;
    let hash = Sha256::digest(&bytes);
    bytes.extend_from_slice(&hash);
    Ok(bytes)
}

/// Reads an image; `None` unless the file is intact and of this size.
fn load(path: &Path, extent: [u32; 2]) -> Option<ReferenceImage> {
    let pixels = u64::from(extent[0]) * u64::from(extent[1]);
    // Deflate expands incompressible data only slightly; larger files cannot be valid.
    if std::fs::metadata(path).ok()?.len() > 33 * pixels + 4096 {
        return None;
    }
    decoded(&std::fs::read(path).ok()?, extent)
}

fn decoded(bytes: &[u8], extent: [u32; 2]) -> Option<ReferenceImage> {
    let (body, hash) = bytes.split_at_checked(bytes.len().checked_sub(HASH)?)?;
    let (header, packed) = body.split_at_checked(HEADER)?;
    let expected = [MAGIC.as_slice(), &extent[0].to_le_bytes(), &extent[1].to_le_bytes()].concat();
    if header != expected || *Sha256::digest(body) != *hash {
        return None;
    }
    let mut unpacked = ZlibDecoder::new(packed);
    let pixels = (0..u64::from(extent[0]) * u64::from(extent[1])).map(|_| {
        let mut bytes = [[0; 8]; 4];
        for channel in &mut bytes {
            unpacked.read_exact(channel).ok()?;
        }
        Some(bytes.map(f64::from_le_bytes))
    });
    ReferenceImage::new(extent[0], extent[1], pixels.collect::<Option<Vec<_>>>()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};
    use volraster::glam::DVec3;
    use volraster::scene::{
        Camera, Clip, Field, Kernel, Kernels, Lighting, Mode, Model, Points, Projection, Shading, Surface,
        TransferFunction,
    };

    fn scene(name: &str, cubes: bool, extinction: f64) -> Scene {
        let field = Field::from_name(name).unwrap();
        let transfer =
            TransferFunction::from_rows(&[[0.0, 0.1, 0.2, 0.3, 0.0], [1.0, 1.0, 1.0, 0.5, extinction]]);
        let data: Data =
            if cubes { field.tets(2).unwrap().into() } else { field.sample([5; 3], "f32").unwrap().into() };
        Scene::new(data, transfer.unwrap())
    }

    fn view(x: f64, width: u32) -> View {
        let projection = Projection::Perspective { fov_y_deg: 42.0 };
        let camera = Camera { eye: DVec3::new(x, 1.5, 3.8), target: DVec3::ZERO, up: DVec3::Y, projection };
        View::new(camera, width, 6).unwrap()
    }

    fn cache(name: &str) -> Cache {
        let folder = std::env::temp_dir().join(format!("volraster-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        Cache { folder: Some(folder), max_bytes: MAX_BYTES }
    }

    fn files(cache: &Cache) -> Vec<PathBuf> {
        let entries = std::fs::read_dir(cache.folder.as_ref().unwrap()).unwrap();
        let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        files.sort();
        files
    }

    #[test]
    fn every_source_of_the_reference_counts() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
        for folder in ["reference", "reference/kernels"] {
            for entry in std::fs::read_dir(root.join(folder)).unwrap() {
                let entry = entry.unwrap();
                let name = entry.file_name().into_string().unwrap();
                let listed = SOURCES.iter().any(|(known, _)| *known == format!("{folder}/{name}"));
                let is_folder =
                    entry.path().is_dir() && root.join(folder).join(format!("{name}.rs")).exists();
                assert!(listed || is_folder || name.starts_with("tests"), "{folder}/{name}");
            }
        }
    }

    #[test]
    fn everything_that_determines_an_image_changes_its_key() {
        let keys = [
            key(&scene("blobs", false, 3.0), &view(2.0, 8)),
            key(&scene("blobs", false, 3.5), &view(2.0, 8)),
            key(&scene("marschner-lobb", false, 3.0), &view(2.0, 8)),
            key(&scene("blobs", true, 3.0), &view(2.0, 8)),
            key(&scene("blobs", false, 3.0), &view(2.0 + 1e-15, 8)),
            key(&scene("blobs", false, 3.0), &view(2.0, 9)),
        ];
        for (i, key) in keys.iter().enumerate() {
            assert!(key.is_some() && !keys[..i].contains(key), "{i}");
        }
        assert_eq!(keys[0], key(&scene("blobs", false, 3.0), &view(2.0, 8)));

        let points = || Field::Blobs.points(2).unwrap();
        let sized = |size: KernelSize| points().with_size(size).unwrap();
        let transfer = || scene("blobs", false, 3.0).transfer;
        let of = |points: Points| key(&Scene::new(points, transfer()), &view(2.0, 8));
        let with = |kernels: Kernels| {
            key(&Scene::new(points(), transfer()).with_kernels(kernels).unwrap(), &view(2.0, 8))
        };
        let kernels = Kernels::of_points();
        let keys = [
            of(points()),
            of(Field::Blobs.points(3).unwrap()),
            of(Points::new(points().centres().to_vec()).unwrap()),
            of(points().with_scalars(vec![1.0, 2.0]).unwrap()),
            of(points().with_weights(vec![1.0, 2.0]).unwrap()),
            of(sized(KernelSize::Radius(1.0))),
            of(sized(KernelSize::Radius(2.0))),
            of(sized(KernelSize::Radii(vec![1.0, 2.0]))),
            of(sized(KernelSize::Radii(vec![2.0, 1.0]))),
            of(sized(KernelSize::Covariances(vec![[1.0; 6]; 2]))),
            of(sized(KernelSize::Covariances(vec![[2.0; 6]; 2]))),
            with(Kernels { kernel: Kernel::BSpline, ..kernels }),
            with(Kernels { cut: 2.0, ..kernels }),
            with(Kernels { least: 0.1, ..kernels }),
            with(Kernels { model: Model::Interpolate, ..kernels }),
        ];
        for (i, key) in keys.iter().enumerate() {
            assert!(key.is_some() && !keys[..i].contains(key), "points {i}");
        }
        let mut grid = scene("blobs", false, 3.0);
        let plain = key(&grid, &view(2.0, 8));
        let clip = |x: f64| view(2.0, 8).with_clip(Clip::none().with_plane(DVec3::X * x, DVec3::X).unwrap());
        let surface = |p: [DVec3; 3], triangle, opacity| {
            Surface::new(p.to_vec(), vec![triangle], [1.0, 1.0, 1.0, opacity]).unwrap()
        };
        let corners = [DVec3::X, DVec3::Y, DVec3::Z];
        let with = |surface: Surface| key(&grid.clone().with_surfaces(vec![surface]), &view(2.0, 8));
        let shown = |mode: Mode| key(&grid.clone().with_mode(mode).unwrap(), &view(2.0, 8));
        let keys = [
            plain,
            key(&grid, &clip(0.1)),
            key(&grid, &clip(0.2)),
            with(surface(corners, [0, 1, 2], 0.5)),
            with(surface(corners, [0, 1, 2], 0.6)),
            with(surface(corners, [0, 2, 1], 0.5)),
            with(surface([DVec3::X, DVec3::Y, -DVec3::Z], [0, 1, 2], 0.5)),
            with(surface(corners, [0, 1, 2], 0.5).with_shading(Shading::Headlight)),
            shown(Mode::Maximum),
            shown(Mode::Lit(Lighting::default())),
            shown(Mode::Lit(Lighting { specular: 0.3, ..Lighting::default() })),
        ];
        for (i, key) in keys.iter().enumerate() {
            assert!(key.is_some() && !keys[..i].contains(key), "clips, surfaces and modes {i}");
        }
        grid = grid.with_kernels(Kernels::of_samples()).unwrap();
        assert_ne!(key(&grid, &view(2.0, 8)), plain);
    }

    #[test]
    fn cached_images_are_exact_and_damaged_files_are_drawn_again() {
        let cache = cache("damaged");
        let (scene, view) = (scene("blobs", false, 3.0), view(2.0, 8));
        let rows = AtomicU32::new(0);
        let progress = |_: u32, _: u32| {
            rows.fetch_add(1, Ordering::Relaxed);
        };
        let (image, origin) = cache.image(&scene, &view, Some(&progress)).unwrap();
        assert_eq!((origin, rows.load(Ordering::Relaxed)), (Origin::Drawn, 6));
        assert!(image.pixels().iter().any(|pixel| pixel[3] > 0.1));
        assert_eq!(cache.image(&scene, &view, Some(&progress)).unwrap(), (image.clone(), Origin::Cached));
        assert_eq!(rows.load(Ordering::Relaxed), 6);
        let [path] = &files(&cache)[..] else { panic!("{:?}", files(&cache)) };
        let whole = std::fs::read(path).unwrap();
        for i in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[i] ^= 4;
            assert_eq!(decoded(&damaged, [8, 6]), None, "byte {i}");
            assert_eq!(decoded(&whole[..i], [8, 6]), None, "length {i}");
        }
        assert_eq!(decoded(&whole, [6, 8]), None);
        std::fs::write(path, &whole[..whole.len() / 2]).unwrap();
        assert_eq!(cache.image(&scene, &view, None).unwrap(), (image.clone(), Origin::Drawn));
        assert_eq!(std::fs::read(path).unwrap(), whole);
        // A disabled cache stores nothing.
        let none = Cache::of_user(false);
        assert_eq!(none.image(&scene, &view, None).unwrap(), (image, Origin::Drawn));
        std::fs::remove_dir_all(cache.folder.unwrap()).unwrap();
    }

    #[test]
    fn the_least_recently_used_images_are_removed() {
        let mut cache = cache("full");
        let scene = scene("blobs", true, 3.0);
        let views = [2.0, 2.1, 2.2].map(|x| view(x, 8));
        for (i, view) in (0_u64..).zip(&views) {
            cache.image(&scene, view, None).unwrap();
            // The files are an hour apart, so that the clock's resolution does not matter.
            for path in files(&cache) {
                let file = std::fs::OpenOptions::new().append(true).open(path).unwrap();
                let age = std::time::Duration::from_secs(3600 * (10 - i));
                if file.metadata().unwrap().modified().unwrap().elapsed().unwrap().as_secs() < 1800 {
                    file.set_modified(SystemTime::now() - age).unwrap();
                }
            }
        }
        let sizes: Vec<u64> = files(&cache).iter().map(|path| path.metadata().unwrap().len()).collect();
        assert_eq!(sizes.len(), 3);
        // Using the oldest image makes it the most recently used.
        assert_eq!(cache.image(&scene, &views[0], None).unwrap().1, Origin::Cached);
        cache.max_bytes = sizes.iter().sum::<u64>() + 10;
        cache.image(&scene, &view(2.3, 8), None).unwrap();
        assert!(files(&cache).len() <= 3);
        assert_eq!(cache.image(&scene, &views[0], None).unwrap().1, Origin::Cached);
        cache.max_bytes = u64::MAX;
        assert_eq!(cache.image(&scene, &views[1], None).unwrap().1, Origin::Drawn);
        // An image larger than the limit is not cached.
        cache.max_bytes = 10;
        cache.image(&scene, &view(2.4, 8), None).unwrap();
        cache.max_bytes = u64::MAX;
        assert_eq!(cache.image(&scene, &view(2.4, 8), None).unwrap().1, Origin::Drawn);
        std::fs::remove_dir_all(cache.folder.unwrap()).unwrap();
    }
}
