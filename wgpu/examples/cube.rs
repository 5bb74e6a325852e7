//! A cube that wgpu draws inside a volume that volraster draws, in textures of wgpu, two frames in flight.
//!
//!     cargo run -p volraster-wgpu --example cube -- [--frames N] [--resizes N] [PICTURE.ppm]
//!
//! For each of the formats Bgra8UnormSrgb and Rgba16Float it draws frames, compares the last one with the float64 reference, cut by the
//! depths that wgpu has drawn, and prints errors and resident memory. The exit code is 1 for an error above the bound or a message of the
//! validation layer, which is on where it is installed.

#![allow(clippy::cast_possible_truncation, reason = "sides and depths of images")]
#![allow(clippy::cast_precision_loss, reason = "small numbers")]
#![allow(clippy::print_stdout, reason = "an example")]

use std::error::Error;
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, channel};

use volraster::glam::dcamera::rh;
use volraster::glam::{DMat4, DVec2, DVec3};
use volraster::gpu::DepthProjection;
use volraster::reference;
use volraster::scene::{ClipY, Field, Scene, TransferFunction, View};
use volraster::{GpuScene, Plan, Renderer, Status, Technique};
use volraster_wgpu::Context;
use wgpu::util::DeviceExt as _;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
const NEAR: f64 = 0.1;
const IN_FLIGHT: usize = 2;
const BACKGROUND: [f64; 4] = [0.05, 0.06, 0.1, 1.0];

const SHADER: &str = "
struct Out { @builtin(position) position: vec4f, @location(0) @interpolate(flat) colour: vec3f }
@group(0) @binding(0) var<uniform> to_clip: mat4x4f;
@vertex fn vertex(@builtin(vertex_index) index: u32) -> Out {
    let face = index / 6u;
    let corner = (3492u >> (2u * (index % 6u))) & 3u; // 0 1 2, 2 1 3
    let side = select(1.0, -1.0, face % 2u == 0u);
    let u = select(1.0, -1.0, (corner & 1u) == 0u);
    let v = select(1.0, -1.0, (corner & 2u) == 0u);
    var at = vec3f(side, u, v);
    if face / 2u == 1u { at = vec3f(v, side, u); }
    if face / 2u == 2u { at = vec3f(u, v, side); }
    let light = 0.4 + 0.3 * f32(face / 2u);
    return Out(to_clip * vec4f(at * 0.35, 1.0), vec3f(0.9, 0.5, 0.2) * light);
}
@fragment fn fragment(in: Out) -> @location(0) vec4f { return vec4f(in.colour, 1.0); }
";

/// Counts what the validation layer says, which wgpu logs.
struct Messages;
static MESSAGES: AtomicUsize = AtomicUsize::new(0);

impl log::Log for Messages {
    fn enabled(&self, metadata: &log::Metadata<'_>) -> bool {
        metadata.level() <= log::Level::Warn
    }

    fn log(&self, record: &log::Record<'_>) {
        let text = record.args().to_string();
        // wgpu's modules say that they were WGSL, which layers of 2023 do not know; the objects of a message are a message of their own.
        let known =
            text.contains("Invalid source language operand: 10") || text.trim_start().starts_with("objects:");
        if self.enabled(record.metadata()) && !known {
            eprintln!("{}: {text}", record.target());
            MESSAGES.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn flush(&self) {}
}

/// The size of what the process has in memory, in KiB; `None` where the system does not tell.
fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

struct Arguments {
    frames: usize,
    resizes: usize,
    picture: Option<String>,
}

fn arguments() -> Result<Arguments> {
    let mut arguments = Arguments { frames: 200, resizes: 20, picture: None };
    let mut given = std::env::args().skip(1);
    while let Some(argument) = given.next() {
        let mut number =
            || given.next().ok_or("a number is missing")?.parse().map_err(Box::<dyn Error>::from);
        match argument.as_str() {
            "--frames" => arguments.frames = number()?,
            "--resizes" => arguments.resizes = number()?,
            _ => arguments.picture = Some(argument),
        }
    }
    Ok(arguments)
}

/// The camera of a frame, and its projection: off the centre, with reversed depth and no far plane.
fn matrices(frame: usize, [width, height]: [u32; 2]) -> [DMat4; 2] {
    let angle = frame as f64 * 0.01;
    let eye = DVec3::new(3.6 * angle.sin() + 1.0, 1.6, 3.6 * angle.cos());
    let aspect = f64::from(width) / f64::from(height);
    let mut projection = rh::proj::directx::perspective_infinite_reverse(0.7, aspect, NEAR);
    projection.z_axis.x = 0.1;
    [rh::view::look_at_mat4(eye, DVec3::ZERO, DVec3::Y), projection]
}

/// A frame in flight: textures and the plan that draws into them.
struct Slot {
    size: [u32; 2],
    colour: wgpu::Texture,
    depth: wgpu::Texture,
    plan: Plan,
    pending: Option<Receiver<volraster::Result<Status>>>,
}

struct Engine<'a> {
    context: &'a Context,
    renderer: &'a Renderer,
    format: wgpu::TextureFormat,
    pipeline: wgpu::RenderPipeline,
    uniforms: wgpu::Buffer,
    bindings: wgpu::BindGroup,
}

impl<'a> Engine<'a> {
    fn new(context: &'a Context, renderer: &'a Renderer, format: wgpu::TextureFormat) -> Self {
        let device = context.device();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: None,
            source: wgpu::ShaderSource::Wgsl(SHADER.into()),
        });
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: None,
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: None,
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: Default::default(),
                bias: Default::default(),
            }),
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: None,
                compilation_options: Default::default(),
                targets: &[Some(format.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let uniforms = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: None,
            contents: &[0; 64],
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        });
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: uniforms.as_entire_binding() }],
        });
        Self { context, renderer, format, pipeline, uniforms, bindings }
    }

    fn view(frame: usize, size: [u32; 2]) -> Result<View> {
        let [world, projection] = matrices(frame, size);
        Ok(View::from_matrices(world, projection, ClipY::Up, size[0], size[1])?)
    }

    fn slot(&self, size: [u32; 2]) -> Result<Slot> {
        let texture = |format, usage| {
            self.context.device().create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: usage | wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let target = self.context.target(self.format)?.with_depth();
        Ok(Slot {
            size,
            colour: texture(self.format, wgpu::TextureUsages::empty()),
            depth: texture(DEPTH, wgpu::TextureUsages::TEXTURE_BINDING),
            plan: self.renderer.prepare(&Self::view(0, size)?, &target)?,
            pending: None,
        })
    }

    /// Waits for the frame that a slot has in flight.
    fn finish(&self, slot: &mut Slot) -> Result<()> {
        let Some(pending) = slot.pending.take() else { return Ok(()) };
        self.context.device().poll(wgpu::PollType::wait_indefinitely())?;
        let status = pending.recv()??;
        if status.complete { Ok(()) } else { Err("a frame lacked room".into()) }
    }

    /// Draws the cube, the volume around it, and submits.
    fn draw(&self, slot: &mut Slot, frame: usize) -> Result<()> {
        self.finish(slot)?;
        let [world, projection] = matrices(frame, slot.size);
        if !slot.plan.set_view(&Self::view(frame, slot.size)?)? {
            *slot = self.slot(slot.size)?;
        }
        let matrix = (projection * world).as_mat4().to_cols_array();
        let bytes: Vec<u8> = matrix.into_iter().flat_map(f32::to_ne_bytes).collect();
        self.context.queue().write_buffer(&self.uniforms, 0, &bytes);
        let mut encoder = self.context.device().create_command_encoder(&Default::default());
        let [r, g, b, a] = BACKGROUND;
        let views = [&slot.colour, &slot.depth].map(|texture| texture.create_view(&Default::default()));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &views[0],
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color { r, g, b, a }),
                    store: wgpu::StoreOp::Store,
                },
            })],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &views[1],
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.draw(0..36, 0..1);
        drop(pass);
        let depth = (&slot.depth, DepthProjection::from_matrix(&projection)?);
        let frame = self.context.composite(&mut slot.plan, &slot.colour, Some(depth))?;
        let (tell, told) = channel();
        self.context.submit([encoder.finish()], frame, [], move |status| drop(tell.send(status)));
        slot.pending = Some(told);
        Ok(())
    }

    /// Reads a texture back, as bytes row by row.
    fn read(&self, texture: &wgpu::Texture) -> Result<Vec<u8>> {
        let device = self.context.device();
        let texel = texture
            .format()
            .block_copy_size(Some(wgpu::TextureAspect::DepthOnly))
            .or(texture.format().block_copy_size(None));
        let row = texture.width() * texel.ok_or("a texture without texels")?;
        let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(padded) * u64::from(texture.height()),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = device.create_command_encoder(&Default::default());
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(padded), rows_per_image: None };
        let target = wgpu::TexelCopyBufferInfo { buffer: &buffer, layout };
        encoder.copy_texture_to_buffer(texture.as_image_copy(), target, texture.size());
        self.context.queue().submit([encoder.finish()]);
        buffer.map_async(wgpu::MapMode::Read, .., |_| ());
        device.poll(wgpu::PollType::wait_indefinitely())?;
        let mapped = buffer.get_mapped_range(..)?;
        let rows = mapped.chunks_exact(padded as usize).flat_map(|line| &line[..row as usize]);
        Ok(rows.copied().collect())
    }
}

fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let size = if exponent == 0 {
        fraction * 2f64.powi(-24)
    } else {
        (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15)
    };
    if bits >> 15 == 1 { -size } else { size }
}

/// The linear colour of a texel, and half the distance of its codes.
fn linear(format: wgpu::TextureFormat, texel: &[u8]) -> ([f64; 4], f64) {
    if format == wgpu::TextureFormat::Rgba16Float {
        let part = |i: usize| half(u16::from_le_bytes([texel[2 * i], texel[2 * i + 1]]));
        return ([part(0), part(1), part(2), part(3)], 2f64.powi(-11));
    }
    let decode = |code: u8| {
        let coded = f64::from(code) / 255.0;
        if coded <= 0.04045 { coded / 12.92 } else { ((coded + 0.055) / 1.055).powf(2.4) }
    };
    ([decode(texel[2]), decode(texel[1]), decode(texel[0]), f64::from(texel[3]) / 255.0], 1.0 / 255.0)
}

/// Compares a finished frame with the reference over what wgpu has drawn; returns the greatest difference, the root of the mean square, and the bound of that.
fn compare(
    engine: &Engine<'_>,
    scene: &Scene,
    slot: &Slot,
    frame: usize,
    picture: Option<&str>,
) -> Result<[f64; 3]> {
    let [colours, depths] = [engine.read(&slot.colour)?, engine.read(&slot.depth)?];
    let [width, height] = slot.size;
    let view = Engine::view(frame, slot.size)?;
    let texel = colours.len() / (width * height) as usize;
    let (mut worst, mut sum, mut bound, mut seen) = (0.0_f64, 0.0, 0.0_f64, 0);
    let mut ppm = format!("P6\n{width} {height}\n255\n").into_bytes();
    for (i, (colour, depth)) in colours.chunks_exact(texel).zip(depths.chunks_exact(4)).enumerate() {
        let stored = f64::from(f32::from_le_bytes([depth[0], depth[1], depth[2], depth[3]]));
        let pixel = DVec2::new((i % width as usize) as f64 + 0.5, (i / width as usize) as f64 + 0.5);
        let (origin, direction) = view.ray(pixel);
        // The depth along the view that wgpu has stored, as a distance along the ray.
        let end = if stored > 0.0 { NEAR / stored / direction.dot(view.forward()) } else { f64::INFINITY };
        let volume = reference::ray(scene, origin, direction, [0.0, end])?;
        let behind = if stored > 0.0 { cube(origin + direction * end) } else { BACKGROUND };
        let (got, step) = linear(engine.format, colour);
        bound = bound.max(step);
        for c in 0..4 {
            let want = volume[c] + (1.0 - volume[3]) * behind[c];
            let far = (got[c] - want).abs();
            (worst, sum) = (worst.max(far), sum + far * far);
        }
        seen += 4;
        let coded = |linear: f64| (255.0 * linear.clamp(0.0, 1.0).powf(1.0 / 2.2)).round() as u8;
        ppm.extend(got[..3].iter().map(|&part| coded(part)));
    }
    if let Some(path) = picture {
        std::fs::write(path, ppm)?;
    }
    Ok([worst, (sum / f64::from(seen)).sqrt(), bound])
}

/// The colour of the cube at a point of its surface.
fn cube(point: DVec3) -> [f64; 4] {
    let size = point.abs();
    let axis = if size.x > size.y.max(size.z) {
        0
    } else if size.y > size.z {
        1
    } else {
        2
    };
    let light = [0.4, 0.7, 1.0][axis];
    [0.9 * light, 0.5 * light, 0.2 * light, 1.0]
}

fn run() -> Result<bool> {
    let arguments = arguments()?;
    log::set_logger(&Messages).map_err(|error| error.to_string())?;
    log::set_max_level(log::LevelFilter::Warn);
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends: wgpu::Backends::VULKAN,
        // Without DEBUG the layer would write to stdout, and nobody would count.
        flags: wgpu::InstanceFlags::VALIDATION | wgpu::InstanceFlags::DEBUG,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))?;
    println!("adapter: {}", adapter.get_info().name);
    let context = Context::open(&adapter, &wgpu::DeviceDescriptor::default())?;
    let fog = [
        [0.0, 0.2, 0.5, 0.9, 0.0],
        [0.35, 0.2, 0.5, 0.9, 0.0],
        [0.6, 0.3, 0.7, 0.9, 0.7],
        [1.0, 0.9, 0.9, 0.5, 1.2],
    ];
    let scene = Scene::new(Field::Blobs.sample([48, 48, 48], "u8")?, TransferFunction::from_rows(&fog)?);
    let on_device = GpuScene::new(context.gpu(), scene.clone());
    let renderer = Renderer::new(&on_device, Technique::parse("raycast:step=0.5")?);
    let mut good = true;
    for format in [wgpu::TextureFormat::Bgra8UnormSrgb, wgpu::TextureFormat::Rgba16Float] {
        let engine = Engine::new(&context, &renderer, format);
        let mut slots = Vec::new();
        for _ in 0..IN_FLIGHT {
            slots.push(engine.slot([160, 120])?);
        }
        let mut memory = Vec::new();
        for frame in 0..arguments.frames {
            engine.draw(&mut slots[frame % IN_FLIGHT], frame)?;
            if frame % 50 == 49 {
                memory.extend(resident());
            }
        }
        // Textures of another size need plans of that size.
        for resize in 0..arguments.resizes {
            let slot = &mut slots[resize % IN_FLIGHT];
            engine.finish(slot)?;
            *slot = engine.slot([160 + 2 * (resize as u32 % 7), 120 + resize as u32 % 5])?;
            engine.draw(slot, resize)?;
        }
        memory.extend(resident());
        let last = &mut slots[0];
        engine.draw(last, 7)?;
        engine.finish(last)?;
        let name = arguments.picture.as_deref().filter(|_| format == wgpu::TextureFormat::Rgba16Float);
        let [worst, rmse, bound] = compare(&engine, &scene, last, 7, name)?;
        println!(
            "{format:?}: {} frames, {} resizes, rmse {rmse:.1e} of {bound:.1e}, worst {worst:.1e}; resident KiB {memory:?}",
            arguments.frames, arguments.resizes
        );
        good &= rmse < bound;
        for slot in &mut slots {
            engine.finish(slot)?;
        }
    }
    drop((renderer, on_device, context));
    let messages = MESSAGES.load(Ordering::Relaxed);
    println!("messages of wgpu and the validation layer: {messages}");
    Ok(good && messages == 0)
}

fn main() -> ExitCode {
    match run() {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}
