//! Sessions: what a program does with a device, from data to images.

use std::sync::Arc;

use volraster::ash::vk;
use volraster::glam::DVec3;
use volraster::gpu::Gpu;
use volraster::scene::{
    Camera, Clip, Field, Points, Projection, Scene, Surface, TetScalars, TransferFunction, View,
};
use volraster::{GpuScene, Offscreen, Renderer, Result, TargetDesc, TargetMode, Technique};

/// A technique with a scene that it draws.
#[derive(Clone, Debug)]
pub(crate) struct Session {
    /// The name in messages.
    pub(crate) name: &'static str,
    pub(crate) technique: Technique,
    pub(super) scene: Scene,
}

const ROWS: [[f64; 5]; 4] = [
    [0.0, 0.1, 0.2, 0.7, 0.0],
    [0.3, 0.2, 0.6, 0.9, 1.0],
    [0.6, 0.9, 0.85, 0.3, 3.0],
    [1.0, 1.0, 0.25, 0.1, 8.0],
];

/// Names and specs, by kind of data and route.
const SPECS: [(&str, &str); 9] = [
    ("grid-raster", "slices-3d:route=raster,target=rgba8,dither=blue"),
    ("grid-compute", "raycast:integrator=integral"),
    ("grid-warp", "shear-warp:route=raster"),
    ("mesh-lists", "havs:k=2,chunk=9"),
    ("mesh-raster", "projected-tets:route=raster"),
    ("points-ellipses", "splat-ewa:"),
    ("points-sheets", "splat-sheets:"),
    ("grid-cut", "slabs:"),
    ("mesh-cut", "havs:"),
];

const EYE: DVec3 = DVec3::new(2.0, 1.5, 3.8);

/// Names and bytes of results: images, an overflow map, the image of a caller.
pub(crate) type Pictures = Vec<(&'static str, Vec<u8>)>;

/// Returns the sessions, each with a few samples, cells or points.
pub(crate) fn sessions() -> Result<Vec<Session>> {
    let transfer = TransferFunction::from_rows(&ROWS)?;
    // 8-bit samples make the library probe how the device filters them.
    let bytes = ROWS.map(|[scalar, r, g, b, tau]| [255.0 * scalar, r, g, b, tau]);
    let grid = Scene::new(Field::Blobs.sample([6, 5, 4], "u8")?, TransferFunction::from_rows(&bytes)?);
    let mesh = Field::Blobs.tets(2)?;
    let points = Points::of_vertices(&mesh)?.with_estimated_radius();
    let scenes = [grid, Scene::new(mesh, transfer.clone()), Scene::new(points, transfer)];
    let mut sessions = Vec::new();
    for (name, spec) in SPECS {
        for scene in scenes.iter().filter(|scene| name.starts_with(scene.data.kind())) {
            let surfaces = if name.ends_with("cut") { surfaces()? } else { Vec::new() };
            let (technique, scene) = (Technique::parse(spec)?, scene.clone().with_surfaces(surfaces));
            sessions.push(Session { name, technique, scene });
        }
    }
    Ok(sessions)
}

/// An opaque box inside a translucent sphere.
fn surfaces() -> Result<Vec<Surface>> {
    let low = DVec3::splat(-0.3);
    Ok(vec![
        Surface::cuboid(low, -low, [0.9, 0.4, 0.1, 1.0])?,
        Surface::sphere(DVec3::ZERO, 0.8, [0.2, 0.5, 0.9, 0.4], 1)?,
    ])
}

pub(super) fn bytes(image: &volraster::Image) -> Vec<u8> {
    image.pixels().iter().flatten().flat_map(|value| value.to_bits().to_ne_bytes()).collect()
}

impl Session {
    fn view(&self, eye: DVec3, width: u32, height: u32) -> Result<View> {
        let projection = Projection::Perspective { fov_y_deg: 42.0 };
        let camera = Camera { eye, target: DVec3::ZERO, up: DVec3::Y, projection };
        let view = View::new(camera, width, height)?;
        if self.scene.surfaces.is_empty() {
            return Ok(view);
        }
        Ok(view.with_clip(Clip::none().with_plane(DVec3::new(0.6, 0.0, 0.0), DVec3::new(-1.0, 0.3, 0.0))?))
    }

    /// Returns the first and the second view.
    pub(super) fn views(&self) -> Result<[View; 2]> {
        Ok([self.view(EYE, 20, 14)?, self.view(DVec3::new(-3.0, 1.0, 2.0), 20, 14)?])
    }

    /// Draws the first view of a scene.
    fn draw(&self, scene: &Arc<GpuScene>) -> Result<Vec<u8>> {
        Ok(bytes(&Renderer::new(scene, self.technique).render(&self.views()?[0])?))
    }

    /// Uploads, draws and reads back; then another view, size and transfer function, other scalars and surfaces, and
    /// the caller's images with two frames in flight. Drops everything at the end.
    pub(crate) fn run(&self, gpu: &Gpu) -> Result<Pictures> {
        let mut pictures = Pictures::new();
        let views = self.views()?;
        let scene = GpuScene::new(gpu, self.scene.clone());
        let renderer = Renderer::new(&scene, self.technique);
        let mut frames = renderer.frames(&views[0])?;
        for (name, view) in ["first view", "second view"].into_iter().zip(&views) {
            frames.draw(view)?;
            pictures.push((name, bytes(&frames.read_back()?)));
        }
        if let Some(map) = frames.overflow_map()? {
            pictures.push(("overflow map", map.into_iter().map(u8::from).collect()));
        }
        drop(frames);
        pictures.push(("another size", bytes(&renderer.render(&self.view(EYE, 9, 31)?)?)));
        // From white to black over the same scalars.
        let [low, high] = self.scene.transfer.domain();
        let other = [[low, 1.0, 1.0, 1.0, 0.5], [high, 0.0, 0.0, 0.0, 4.0]];
        let other = TransferFunction::from_rows(&other)?;
        pictures.push(("another transfer function", self.draw(&scene.with_transfer(other.clone()))?));
        if let Some(mesh) = self.scene.mesh() {
            let scalars = mesh.scalars().values().iter().map(|scalar| 1.0 - scalar).collect();
            let turned = scene.with_scalars(TetScalars::Point(scalars), other)?;
            pictures.push(("other scalars", self.draw(&turned)?));
        }
        if !self.scene.surfaces.is_empty() {
            let moved = scene.with_surfaces(self.scene.surfaces[..1].to_vec());
            pictures.push(("other surfaces", self.draw(&moved)?));
        }
        let format = vk::Format::R8G8B8A8_UNORM;
        let mut flying = Vec::new();
        for view in &views {
            let mut plan = renderer.prepare(view, &TargetDesc::caller(format, TargetMode::Over))?;
            let mut image = Offscreen::new(gpu, format, view.extent())?;
            image.draw(&mut plan, [0.0, 0.5, 0.25, 1.0])?;
            flying.push((plan, image));
        }
        for (_, image) in &mut flying {
            pictures.push(("a caller's image", image.finish()?.1));
        }
        Ok(pictures)
    }

    /// Draws one frame of the first view.
    pub(super) fn frame(&self, gpu: &Gpu) -> Result<Pictures> {
        Ok(vec![("first view", self.draw(&GpuScene::new(gpu, self.scene.clone()))?)])
    }
}
