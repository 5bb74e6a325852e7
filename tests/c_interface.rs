//! The C interface: its header, a C program that uses it, and its functions called as C would.

#![allow(missing_debug_implementations, unreachable_pub, reason = "a test of several files")]
#![allow(unsafe_code, reason = "plays a C program")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

mod common;
#[path = "embed/engine.rs"]
mod engine;

use std::cell::Cell;
use std::ffi::{CStr, CString, OsStr, c_char, c_void};
use std::mem::{offset_of, zeroed};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::ptr::{null, null_mut};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use common::caller::{Caller, Depth};
use common::{FOG, SHELLS, draw, perspective, technique, view};
use engine::Engine;
use volraster::ash::vk;
use volraster::ash::vk::Handle as _;
use volraster::ffi::*;
use volraster::gpu::{DepthProjection, Enabled};
use volraster::scene::{Clip, Field, Samples, Scene, TetScalars, TransferFunction, View};
use volraster::technique::{GpuScene, Method, Renderer, TargetDesc, TargetMode};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");
const FORMAT: vk::Format = vk::Format::R32G32B32A32_SFLOAT;

/// The layer keeps its devices in a table without a lock: tests with devices take turns.
fn turn() -> MutexGuard<'static, ()> {
    static TURN: Mutex<()> = Mutex::new(());
    TURN.lock().unwrap_or_else(PoisonError::into_inner)
}

// ------------------------------------------------------------------------------------------------ as programs outside

/// A tool; what a second driver needs of libraries is not the tools'.
fn tool(name: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(name);
    command.current_dir(ROOT).env_remove("LD_LIBRARY_PATH");
    command
}

fn cargo(arguments: &[&str]) -> Output {
    let mut command = tool(std::env::var_os("CARGO").unwrap_or("cargo".into()));
    command.args(arguments);
    if !cfg!(debug_assertions) {
        command.arg("--release");
    }
    succeed(&mut command)
}

/// Runs what must work.
fn succeed(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}: run `make setup`"));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{command:?}\n{}{}", text(&output.stdout), text(&output.stderr));
    output
}

/// Folder of the dynamic library, which is built on first use. With the crate named, too, the library is linked from what was built
/// for the tests, features and all.
fn library() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let output = cargo(&[
            "build",
            "--lib",
            "-p",
            "volraster",
            "-p",
            "volraster-capi",
            "--message-format=json-render-diagnostics",
        ]);
        let messages = String::from_utf8(output.stdout).unwrap();
        let messages = messages.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap());
        let files = messages.flat_map(|message| message["filenames"].as_array().cloned().unwrap_or_default());
        let file = files
            .filter_map(|file| Some(PathBuf::from(file.as_str()?)))
            .find(|file| {
                file.ends_with(format!(
                    "{}volraster{}",
                    std::env::consts::DLL_PREFIX,
                    std::env::consts::DLL_SUFFIX
                ))
            })
            .unwrap();
        file.parent().unwrap().to_path_buf()
    })
}

fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c-interface");
    std::fs::create_dir_all(&folder).unwrap();
    folder.join(name)
}

/// Strict C, with the header's folder.
fn cc() -> Command {
    let mut command = tool("cc");
    command.args([
        "-std=c11",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Wno-sign-conversion",
        "-pedantic",
        "-Werror",
        "-Iinclude",
    ]);
    command
}

#[test]
fn the_header_is_what_the_sources_say() {
    let written = cargo(&["run", "-q", "-p", "volraster-header"]).stdout;
    let kept = std::fs::read(Path::new(ROOT).join("include/volraster.h")).unwrap();
    assert!(written == kept, "include/volraster.h is out of date: run `make header`");
}

#[test]
fn the_header_is_c_and_c_plus_plus() {
    succeed(cc().args(["-x", "c", "-fsyntax-only", "include/volraster.h"]));
    succeed(tool("c++").args([
        "-x",
        "c++",
        "-std=c++17",
        "-Wall",
        "-Wextra",
        "-pedantic",
        "-Werror",
        "-fsyntax-only",
        "include/volraster.h",
    ]));
}

/// Rust and the C compiler agree on where fields lie.
#[test]
fn structures_lie_in_memory_as_c_has_them() {
    let mut text = String::from("#include \"volraster.h\"\n#include <stddef.h>\n");
    macro_rules! check {
        ($($name:ident: $($field:ident),+;)+) => {$(
            text += &format!("_Static_assert(sizeof({0}) == {1}, \"{0}\");\n", stringify!($name), size_of::<$name>());
            $(
                text += &format!(
                    "_Static_assert(offsetof({0}, {1}) == {2}, \"{0}.{1}\");\n",
                    stringify!($name), stringify!($field), offset_of!($name, $field)
                );
            )+
        )+};
    }
    check! {
        vr_gpu_info: struct_size, device, validation, no_pipeline_cache, pipeline_cache, memory_budget;
        vr_device_info: struct_size, get_instance_proc_addr, instance, api_version, instance_extension_count,
            instance_extensions, physical_device, device, device_create_info, queue, queue_family, no_pipeline_cache,
            pipeline_cache, memory_budget, lock_queue, unlock_queue, released, user;
        vr_gpu_objects: struct_size, instance, physical_device, device, queue, queue_family;
        vr_grid_info: struct_size, dims, sample_type, samples, sample_bytes, spacing, origin, direction, slope, intercept;
        vr_mesh_info: struct_size, points, point_count, cells, cell_count, scalars, scalar_count, scalars_per, reserved;
        vr_points_info: struct_size, centres, point_count, scalars, weights, radii, covariances, radius;
        vr_knot: scalar, colour, extinction;
        vr_read_info: struct_size, max_bytes, array, radius, covariance, weight, progress, user;
        vr_scene_info: struct_size, low, high, range, data_kind, dims;
        vr_clip_plane: point, normal;
        vr_view: struct_size, eye, target, up, projection, width, height, clip_plane_count, fov_y_deg, half_height,
            clip_planes, crop_low, crop_high;
        vr_plan_info: struct_size, technique, format, mode, with_depth, reserved;
        vr_depth_image: struct_size, view, format, layout, extent, kind, at_zero, at_one, matrix;
        vr_record_info: struct_size, commands, image, view, format, extent, depth;
        vr_pass_time: name, ms;
        vr_counter: name, value;
        vr_status: struct_size, complete, pass_count, passes, counters, counter_count;
        vr_option_info: key, values, default_value, effect;
        vr_technique_info: struct_size, name, summary, options, option_count;
    }
    for (name, value) in
        [("VR_NO_ROOM", vr_result::VR_NO_ROOM as i32), ("VR_ERROR_PANIC", vr_result::VR_ERROR_PANIC as i32)]
    {
        text += &format!("_Static_assert({name} == {value}, \"{name}\");\n");
    }
    text += "_Static_assert(sizeof(vr_result) == 4, \"vr_result\");\n";
    let file = scratch("layout.c");
    std::fs::write(&file, text).unwrap();
    succeed(cc().arg("-fsyntax-only").arg(&file));
}

/// The library has the functions of the header, and no others that a program could collide with.
#[test]
fn the_library_exports_the_header_s_functions_alone() {
    let file =
        library().join(format!("{}volraster{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX));
    let output = succeed(tool("nm").args(["-D", "--defined-only"]).arg(&file));
    let mut exported: Vec<String> = String::from_utf8(output.stdout)
        .unwrap()
        .lines()
        .filter_map(|line| line.split_whitespace().last().map(str::to_string))
        .collect();
    exported.sort();
    let header = std::fs::read_to_string(Path::new(ROOT).join("include/volraster.h")).unwrap();
    let mut declared: Vec<String> = header
        .lines()
        .filter(|line| !line.starts_with([' ', '#', '/', '}']) && !line.starts_with("typedef"))
        .filter_map(|line| Some(line.split_once('(')?.0.rsplit([' ', '*']).next()?.to_string()))
        .collect();
    declared.sort();
    assert!(declared.len() > 30, "{declared:?}");
    assert_eq!(exported, declared);
}

/// The example, compiled as strictly as C can be, draws its own volume and a file's, and the validation layers are silent.
#[test]
fn the_example_draws_and_is_valid() {
    let _turn = turn();
    let program = scratch("embed");
    let mut rpath = std::ffi::OsString::from("-Wl,-rpath,");
    rpath.push(library());
    succeed(
        cc().arg("examples/c/embed.c")
            .arg("-L")
            .arg(library())
            .arg(rpath)
            .args(["-lvolraster", "-lvulkan", "-lm", "-o"])
            .arg(&program),
    );
    let data = scratch("blobs.nrrd");
    volraster::io::write_nrrd(&data, &Field::Blobs.sample([16; 3], "u8").unwrap()).unwrap();
    let mut pictures = Vec::new();
    for file in [None, Some(&data)] {
        let picture = scratch("embed.ppm");
        let _ = std::fs::remove_file(&picture);
        // As the tests run: with the driver of the environment.
        let mut command = Command::new(&program);
        let output = succeed(command.arg(&picture).args(file));
        let (text, errors) =
            (String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap());
        assert_eq!(errors, "");
        assert!(text.starts_with(&format!("volraster {} on ", env!("CARGO_PKG_VERSION"))), "{text}");
        assert!(text.contains("slices-3d by "), "{text}");
        pictures.push(std::fs::read(&picture).unwrap());
    }
    let head = b"P6\n320 240\n255\n";
    for picture in &pictures {
        assert!(picture.starts_with(head) && picture.len() == head.len() + 3 * 320 * 240);
    }
    assert!(pictures[0] != pictures[1]);
    // The shell is as far to the left of the middle as to the right, and brighter there: no wall cuts it.
    let red = |columns: std::ops::Range<usize>| -> u32 {
        let row = |y: usize| columns.clone().map(move |x| head.len() + 3 * (320 * y + x));
        (0..240).flat_map(row).map(|at| u32::from(pictures[0][at])).sum()
    };
    assert!(red(0..160) * 4 > red(160..320) * 5, "{} {}", red(0..160), red(160..320));
    // What fails ends with its message.
    let output = Command::new(&program).arg(scratch("none.ppm")).arg("no-such-file.nrrd").output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success() && errors.contains("no-such-file.nrrd"), "{errors}");
}

// ------------------------------------------------------------------------------------------------ as a program inside

/// A structure with nothing but its size.
macro_rules! sized {
    ($name:ident { $($field:ident: $value:expr),* $(,)? }) => {{
        // SAFETY: zeros are valid.
        let mut info: $name = unsafe { zeroed() };
        info.struct_size = size_of::<$name>();
        $(info.$field = $value;)*
        info
    }};
}

fn message() -> String {
    // SAFETY: ends with NUL.
    unsafe { CStr::from_ptr(vr_last_error()) }.to_str().unwrap().to_string()
}

#[track_caller]
fn done(result: vr_result) {
    assert_eq!(result, vr_result::VR_OK, "{}", message());
}

#[track_caller]
fn refused(result: vr_result, code: vr_result, words: &str) {
    assert_eq!(result, code, "{}", message());
    assert!(message().contains(words), "{words}: {}", message());
}

fn text(pointer: *const c_char) -> String {
    assert!(!pointer.is_null());
    // SAFETY: the library's text.
    unsafe { CStr::from_ptr(pointer) }.to_str().unwrap().to_string()
}

macro_rules! ends {
    ($($name:ident: $destroy:ident($handle:ty);)*) => {$(
        /// Each handle is destroyed once.
        fn $name(handle: *mut $handle) {
            // SAFETY: the tests do so, too.
            unsafe { $destroy(handle) };
        }
    )*};
}

ends! {
    end_gpu: vr_gpu_destroy(vr_gpu);
    end_scene: vr_scene_destroy(vr_scene);
    end_plan: vr_plan_destroy(vr_plan);
    end_recording: vr_recording_destroy(vr_recording);
}

/// What C programs write into `vr_device_info`.
fn with_device<R>(engine: &Engine, use_it: impl FnOnce(vr_device_info) -> R) -> R {
    let mut features13 = vk::PhysicalDeviceVulkan13Features::default()
        .synchronization2(engine.enabled.synchronization2)
        .dynamic_rendering(engine.enabled.dynamic_rendering);
    let names: Vec<_> = engine.enabled.extensions.iter().map(|name| name.as_ptr()).collect();
    let create = vk::DeviceCreateInfo::default().enabled_extension_names(&names).push_next(&mut features13);
    let instance_names = [c"VK_EXT_debug_utils".as_ptr()];
    use_it(sized!(vr_device_info {
        get_instance_proc_addr: Some(engine.entry.static_fn().get_instance_proc_addr),
        instance: engine.instance.handle(),
        api_version: vk::API_VERSION_1_3,
        instance_extension_count: 1,
        instance_extensions: instance_names.as_ptr(),
        physical_device: engine.physical,
        device: engine.device.handle(),
        device_create_info: (&raw const create).cast(),
        queue: engine.queue,
        queue_family: engine.family,
        no_pipeline_cache: vk::TRUE,
    }))
}

fn adopt(engine: &Engine) -> *mut vr_gpu {
    let mut gpu = null_mut();
    // SAFETY: the objects are the engine's, which outlives the handle.
    with_device(engine, |info| done(unsafe { vr_gpu_adopt(&info, &mut gpu) }));
    gpu
}

fn knots(rows: &[[f64; 5]]) -> Vec<vr_knot> {
    rows.iter().map(|r| vr_knot { scalar: r[0], colour: [r[1], r[2], r[3]], extinction: r[4] }).collect()
}

/// A view for C.
fn c_view(view: &View) -> vr_view {
    let camera = view.camera();
    let volraster::scene::Projection::Perspective { fov_y_deg } = camera.projection else { panic!() };
    let [width, height] = view.extent();
    let mut value = sized!(vr_view {
        eye: camera.eye.into(),
        target: camera.target.into(),
        up: camera.up.into(),
        projection: vr_projection::VR_PROJECTION_PERSPECTIVE as u32,
        fov_y_deg: fov_y_deg,
        width: width,
        height: height,
    });
    for (place, plane) in value.clip_planes.iter_mut().zip(view.clip().planes()) {
        *place = vr_clip_plane { point: plane.point.into(), normal: plane.normal.into() };
        value.clip_plane_count += 1;
    }
    if let Some([low, high]) = view.clip().crop() {
        (value.crop_low, value.crop_high) = (low.into(), high.into());
    }
    value
}

/// A field of the crate's, as a C program would hand it over.
fn c_scene(gpu: *const vr_gpu, grid: &volraster::scene::Grid, rows: &[[f64; 5]]) -> *mut vr_scene {
    let Samples::U8(samples) = grid.samples() else { panic!() };
    let axes = grid.index_to_world();
    let rescale = grid.rescale();
    let info = sized!(vr_grid_info {
        dims: grid.dims(),
        sample_type: vr_sample_type::VR_SAMPLE_U8 as u32,
        samples: samples.as_ptr().cast(),
        sample_bytes: samples.len(),
        origin: grid.origin().into(),
        direction: axes.to_cols_array_2d(),
        slope: rescale.slope,
        intercept: rescale.intercept,
    });
    let (knots, mut scene) = (knots(rows), null_mut());
    // SAFETY: all are valid.
    done(unsafe { vr_scene_create_grid(gpu, &info, knots.as_ptr(), knots.len(), &mut scene) });
    scene
}

fn c_render(scene: *const vr_scene, spec: Option<&CStr>, view: &View) -> Vec<[f32; 4]> {
    let [width, height] = view.extent();
    let mut pixels = vec![[f32::NAN; 4]; (width * height) as usize];
    let (spec, view) = (spec.map_or(null(), CStr::as_ptr), c_view(view));
    // SAFETY: all are valid.
    done(unsafe { vr_render(scene, spec, &view, pixels.as_mut_ptr().cast(), 4 * pixels.len()) });
    pixels
}

fn record_info(frame: &Caller) -> vr_record_info {
    sized!(vr_record_info {
        commands: frame.commands,
        image: frame.image,
        view: frame.view,
        format: frame.format,
        extent: vk::Extent2D { width: frame.extent[0], height: frame.extent[1] },
    })
}

fn silent(engine: Engine) {
    let log = std::sync::Arc::clone(&engine.log);
    drop(engine);
    assert_eq!(log.messages(), [""; 0]);
}

/// Frames that C records are those of Rust to the bit: plain, cut, and with a depth image.
#[test]
fn frames_are_those_of_rust() {
    let _turn = turn();
    let engine = Engine::least();
    let (gpu, own) = (adopt(&engine), engine.gpu());
    let extent = [40, 30];
    let frame = Caller::new(&own, FORMAT, extent, 16);
    let transfer = TransferFunction::from_rows(&FOG).unwrap();
    let grid = Field::Blobs.sample([16; 3], "u8").unwrap();
    let scene = c_scene(gpu, &grid, &FOG);
    let rust = GpuScene::new(&own, Scene::new(grid, transfer));
    let first = view(perspective(), 1.0, 40, 30);
    let clip = Clip::none().with_plane([0.1, 0.0, 0.0].into(), [1.0, 0.3, 0.0].into()).unwrap();
    let clip = clip.with_crop([-0.8; 3].into(), [0.9, f64::INFINITY, 0.7].into()).unwrap();
    let second = view(perspective(), 1.1, 40, 30).with_clip(clip);
    // Half of the image behind a wall, stored in reverse without a far end.
    let wall: Vec<f32> = (0..1200).map(|i| if i % 40 < 20 { 0.0 } else { 0.5 / 4.6 }).collect();
    let depth = Depth::new(&own, vk::Format::D32_SFLOAT, extent, &wall).unwrap();
    let projection = DepthProjection::perspective(f64::INFINITY, 0.5).unwrap();
    let depth_image = depth.image(&own, projection);
    for (spec, with_depth) in [(c"slabs:step=0.5", true), (c"slices-3d:route=raster", false)] {
        let info = sized!(vr_plan_info {
            technique: spec.as_ptr(),
            format: FORMAT,
            mode: vr_target_mode::VR_TARGET_OVER as u32,
            with_depth: u32::from(with_depth),
        });
        let mut plan = null_mut();
        // SAFETY: all are valid, and live.
        done(unsafe { vr_plan_create(scene, &info, &c_view(&second), &mut plan) });
        // SAFETY: a plan.
        let route = text(unsafe { vr_plan_route(plan) });
        assert_eq!(route, if with_depth { "compute" } else { "raster" });
        let target = TargetDesc::caller(FORMAT, TargetMode::Over);
        let target = if with_depth { target.with_depth() } else { target };
        let renderer = Renderer::new(&rust, technique(spec.to_str().unwrap()));
        let mut rust_plan = renderer.prepare(&second, &target).unwrap();
        let mut images = Vec::new();
        for view in [&first, &second] {
            // SAFETY: all are valid.
            done(unsafe { vr_plan_set_view(plan, &c_view(view)) });
            frame.begin([0.1, 0.2, 0.3, 1.0]);
            if with_depth {
                depth.fill(frame.commands);
            }
            let c_depth = sized!(vr_depth_image {
                view: depth.view,
                format: vk::Format::D32_SFLOAT,
                extent: vk::Extent2D { width: 40, height: 30 },
                kind: vr_depth_kind::VR_DEPTH_PERSPECTIVE as u32,
                at_zero: f64::INFINITY,
                at_one: 0.5,
            });
            let mut info = record_info(&frame);
            if with_depth {
                info.depth = &raw const c_depth;
            }
            let mut recording = null_mut();
            // SAFETY: all are valid; the frame is submitted once.
            done(unsafe { vr_plan_record(plan, &info, &mut recording) });
            let bytes = frame.end(&own);
            let mut status = sized!(vr_status {});
            for _ in 0..2 {
                // SAFETY: the submission has ended.
                done(unsafe { vr_recording_completed(recording, &mut status) });
                assert_eq!((status.struct_size, status.complete), (size_of::<vr_status>(), 1));
            }
            assert!(rust_plan.set_view(view).unwrap());
            frame.begin([0.1, 0.2, 0.3, 1.0]);
            if with_depth {
                depth.fill(frame.commands);
            }
            let recorded = rust_plan
                .record(
                    &mut frame.command_buffer(&own),
                    Some(&frame.target(&own)),
                    with_depth.then_some(&depth_image),
                )
                .unwrap();
            let want = frame.end(&own);
            let rust_status = recorded.completed().unwrap();
            assert!(bytes == want, "{spec:?}");
            // Times differ from frame to frame; their names do not.
            // SAFETY: valid until the recording goes; never null.
            let passes = unsafe { std::slice::from_raw_parts(status.passes, status.pass_count as usize) };
            let names: Vec<String> = passes.iter().map(|pass| text(pass.name)).collect();
            let want: Vec<String> = rust_status.passes.iter().map(|pass| pass.name.clone()).collect();
            assert_eq!(names, want);
            assert!(passes.iter().all(|pass| pass.ms >= 0.0));
            end_recording(recording);
            images.push(bytes);
        }
        assert!(images[0] != images[1]);
        end_plan(plan);
    }
    // And without a command buffer.
    for view in [&first, &second] {
        let want = Renderer::new(&rust, technique("slices-3d")).render(view).unwrap();
        assert!(c_render(scene, None, view) == want.pixels());
    }
    end_scene(scene);
    end_gpu(gpu);
    drop((depth, frame, rust, own));
    silent(engine);
}

/// Scenes that are made of others, of a mesh, of points and of files draw what Rust's do.
#[test]
fn scenes_are_those_of_rust() {
    let _turn = turn();
    let engine = Engine::full();
    let (gpu, own) = (adopt(&engine), engine.gpu());
    let view = view(perspective(), 1.0, 24, 18);
    let [fog, shells] = [&FOG[..], &SHELLS].map(|rows| TransferFunction::from_rows(rows).unwrap());
    let c_shells = knots(&SHELLS);
    let same = |scene: *mut vr_scene, want: Scene, spec: &CStr| {
        let want = draw(&own, &want, &view, spec.to_str().unwrap());
        assert!(want.pixel(12, 9)[3] > 0.05, "{spec:?}");
        assert!(c_render(scene, Some(spec), &view) == want.pixels(), "{spec:?}");
    };
    let mut handles = Vec::new();
    let grid = Field::Blobs.sample([12; 3], "u8").unwrap();
    let first = c_scene(gpu, &grid, &FOG);
    let mut made = null_mut();
    // SAFETY: all are valid.
    done(unsafe { vr_scene_with_transfer(first, c_shells.as_ptr(), c_shells.len(), &mut made) });
    same(made, Scene::new(grid.clone(), shells.clone()), c"raycast");
    handles.push(made);
    // Samples of another type.
    let floats: Vec<f32> = (0..12 * 12 * 12).map(|i| (i % 7) as f32 * 30.0).collect();
    let kind = vr_sample_type::VR_SAMPLE_F32 as u32;
    // SAFETY: all are valid.
    done(unsafe { vr_scene_with_samples(first, kind, floats.as_ptr().cast(), 4 * floats.len(), &mut made) });
    let other = volraster::scene::Grid::new([12; 3], Samples::F32(floats)).unwrap();
    let other = other.with_placement(glam::DVec3::ONE, grid.origin(), grid.index_to_world()).unwrap();
    same(made, Scene::new(other.with_rescale(grid.rescale()).unwrap(), fog.clone()), c"slabs");
    handles.push(made);
    same(first, Scene::new(grid, fog.clone()), c"slices-2d");
    handles.push(first);

    let mesh = Field::Blobs.tets(4).unwrap();
    let TetScalars::Point(scalars) = mesh.scalars() else { panic!() };
    let points: Vec<[f64; 3]> = mesh.points().iter().map(|p| p.to_array()).collect();
    let mut info = sized!(vr_mesh_info {
        points: points.as_ptr().cast(),
        point_count: points.len(),
        cells: mesh.cells().as_ptr().cast(),
        cell_count: mesh.cells().len(),
        scalars: scalars.as_ptr(),
        scalar_count: scalars.len(),
        scalars_per: vr_scalars_per::VR_SCALARS_PER_POINT as u32,
    });
    let c_fog = knots(&FOG);
    // SAFETY: all are valid.
    done(unsafe { vr_scene_create_mesh(gpu, &info, c_fog.as_ptr(), c_fog.len(), &mut made) });
    same(made, Scene::new(mesh.clone(), fog.clone()), c"abuffer");
    handles.push(made);
    let cells: Vec<f32> = (0..mesh.cells().len()).map(|i| (i % 5) as f32 * 0.25).collect();
    let per_cell = vr_scalars_per::VR_SCALARS_PER_CELL as u32;
    let source = made;
    // SAFETY: all are valid.
    done(unsafe {
        vr_scene_with_scalars(source, per_cell, cells.as_ptr(), cells.len(), null(), 0, &mut made)
    });
    let by_cell = mesh.clone().with_scalars(TetScalars::Cell(cells.clone())).unwrap();
    same(made, Scene::new(by_cell.clone(), fog.clone()), c"havs");
    handles.push(made);
    (info.scalars, info.scalar_count, info.scalars_per) = (cells.as_ptr(), cells.len(), per_cell);
    // SAFETY: all are valid.
    done(unsafe { vr_scene_create_mesh(gpu, &info, c_shells.as_ptr(), c_shells.len(), &mut made) });
    same(made, Scene::new(by_cell, shells.clone()), c"havs");
    handles.push(made);

    let splats = Field::Blobs.points(200).unwrap();
    let centres: Vec<[f64; 3]> = splats.centres().iter().map(|p| p.to_array()).collect();
    let scalars = splats.scalars().unwrap();
    let radii = vec![0.3_f32; centres.len()];
    let covariances = vec![[0.02_f32, 0.0, 0.0, 0.03, 0.0, 0.01]; centres.len()];
    use volraster::scene::KernelSize;
    for (radius, size) in [
        (0.0, None),
        (0.4, Some(KernelSize::Radius(0.4))),
        (0.0, Some(KernelSize::Radii(radii.clone()))),
        (0.0, Some(KernelSize::Covariances(covariances.clone()))),
    ] {
        let info = sized!(vr_points_info {
            centres: centres.as_ptr().cast(),
            point_count: centres.len(),
            scalars: scalars.as_ptr(),
            weights: radii.as_ptr(),
            radii: if matches!(size, Some(KernelSize::Radii(_))) { radii.as_ptr() } else { null() },
            covariances: if matches!(size, Some(KernelSize::Covariances(_))) {
                covariances.as_ptr().cast()
            } else {
                null()
            },
            radius: radius,
        });
        // SAFETY: all are valid.
        done(unsafe { vr_scene_create_points(gpu, &info, c_fog.as_ptr(), c_fog.len(), &mut made) });
        let want = volraster::scene::Points::new(splats.centres().to_vec()).unwrap();
        let want = want.with_scalars(scalars.to_vec()).unwrap().with_weights(radii.clone()).unwrap();
        let want = match size {
            Some(size) => want.with_size(size).unwrap(),
            None => want.with_estimated_radius(),
        };
        same(made, Scene::new(want, fog.clone()), c"splat-ewa");
        handles.push(made);
    }
    for handle in handles {
        end_scene(handle);
    }
    end_gpu(gpu);
    drop(own);
    silent(engine);
}

/// Files: what they ask for, and how far they were read.
#[test]
fn files_are_read() {
    let _turn = turn();
    let engine = Engine::full();
    let gpu = adopt(&engine);
    let data = scratch("read.nrrd");
    volraster::io::write_nrrd(&data, &Field::Blobs.sample([16; 3], "u16").unwrap()).unwrap();
    let scene_file = scratch("read.json");
    let document = r#"{
        "volume": {"file": "read.nrrd"},
        "transfer": [[0, 1, 1, 1, 0], [1, 1, 1, 1, 4]],
        "camera": {"eye": [3, 2, 1], "target": [0, 0, 0], "up": [0, 0, 1], "half_height": 1.5},
        "image": {"width": 31, "height": 17},
        "clip": {"crop": {"low": [-1, -1, 0], "high": [1, 1, 1]}},
        "technique": {"name": "slabs", "step": 2}
    }"#;
    std::fs::write(&scene_file, document).unwrap();
    extern "C" fn progress(done: u64, all: u64, user: *mut c_void) {
        // SAFETY: the cell of this test, which waits.
        let seen = unsafe { &*user.cast::<Mutex<Vec<(u64, u64)>>>() };
        seen.lock().unwrap().push((done, all));
    }
    let seen: Mutex<Vec<(u64, u64)>> = Mutex::default();
    let info = sized!(vr_read_info { progress: Some(progress), user: (&raw const seen).cast_mut().cast() });
    let path = |path: &Path| CString::new(path.to_str().unwrap()).unwrap();
    let mut scene = null_mut();
    // SAFETY: all are valid.
    done(unsafe { vr_scene_load(gpu, path(&data).as_ptr(), &info, &mut scene) });
    assert!(!seen.lock().unwrap().is_empty());
    let mut told = sized!(vr_scene_info {});
    // SAFETY: all are valid.
    done(unsafe { vr_scene_query(scene, &mut told) });
    assert_eq!((told.data_kind, told.dims), (vr_data_kind::VR_DATA_GRID as u32, [16; 3]));
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    assert!(near(told.low[0], -1.0) && near(told.high[2], 1.0) && told.range[0] < told.range[1], "{told:?}");
    // SAFETY: a scene.
    assert_eq!(text(unsafe { vr_scene_technique(scene) }), "slices-3d");
    let mut view = sized!(vr_view {});
    for (asked, want) in [([0, 0], [512, 512]), ([20, 10], [20, 10])] {
        // SAFETY: all are valid.
        done(unsafe { vr_scene_view(scene, asked[0], asked[1], &mut view) });
        assert_eq!(([view.width, view.height], view.clip_plane_count), (want, 0));
        assert_eq!(view.projection, vr_projection::VR_PROJECTION_PERSPECTIVE as u32);
    }
    let mut pixels = [0_f32; 4 * 200];
    // SAFETY: all are valid.
    done(unsafe { vr_render(scene, null(), &view, pixels.as_mut_ptr(), pixels.len()) });
    assert!(pixels.chunks(4).any(|p| p[3] > 0.1));
    end_scene(scene);

    // SAFETY: all are valid.
    done(unsafe { vr_scene_load(gpu, path(&scene_file).as_ptr(), null(), &mut scene) });
    // SAFETY: a scene.
    assert_eq!(text(unsafe { vr_scene_technique(scene) }), "slabs:step=2");
    // SAFETY: a scene.
    assert_eq!(text(unsafe { vr_scene_warnings(scene) }), "");
    // SAFETY: all are valid.
    done(unsafe { vr_scene_view(scene, 0, 0, &mut view) });
    assert_eq!(([view.width, view.height], view.eye, view.half_height), ([31, 17], [3.0, 2.0, 1.0], 1.5));
    assert_eq!((view.crop_low[2], view.crop_high), (0.0, [1.0; 3]));
    let mut draws = 7;
    for (spec, want) in [(c"raycast", 1), (c"havs:k=4", 0)] {
        // SAFETY: all are valid.
        done(unsafe { vr_scene_draws(scene, spec.as_ptr(), &mut draws) });
        assert_eq!(draws, want);
    }
    end_scene(scene);
    for (name, code, words) in
        [(c"/no/such/file.nrrd", vr_result::VR_ERROR_IO, "cannot"), (c"/", vr_result::VR_ERROR_FILE, "/")]
    {
        scene = std::ptr::dangling_mut();
        // SAFETY: all are valid.
        refused(unsafe { vr_scene_load(gpu, name.as_ptr(), null(), &mut scene) }, code, words);
        assert!(scene.is_null());
    }
    std::fs::write(&scene_file, document.replace("\"step\": 2", "\"stride\": 2")).unwrap();
    // SAFETY: all are valid.
    let result = unsafe { vr_scene_load(gpu, path(&scene_file).as_ptr(), null(), &mut scene) };
    assert!(result == vr_result::VR_ERROR_FILE || result == vr_result::VR_ERROR_INVALID, "{}", message());
    assert!(message().contains("stride"), "{}", message());
    end_gpu(gpu);
    silent(engine);
}

/// Wrong arguments give codes and words, and nothing is handed out.
#[test]
fn wrong_arguments_are_refused() {
    use vr_result::VR_ERROR_INVALID as INVALID;
    let _turn = turn();
    let engine = Engine::full();
    let (gpu, own) = (adopt(&engine), engine.gpu());
    let grid = Field::Blobs.sample([8; 3], "u8").unwrap();
    let scene = c_scene(gpu, &grid, &FOG);
    let c_fog = knots(&FOG);
    let view = c_view(&view(perspective(), 1.0, 40, 30));
    let mut out = std::ptr::dangling_mut::<vr_scene>();
    let info = sized!(vr_grid_info {
        dims: [2; 3],
        sample_type: vr_sample_type::VR_SAMPLE_U8 as u32,
        samples: [0_u8, 1, 2, 3, 4, 5, 6, 7].as_ptr().cast(),
        sample_bytes: 8,
    });
    // SAFETY: what is wrong is refused before it is followed.
    let grid_of = |gpu, info: *const vr_grid_info, knots: &[vr_knot], count, out| unsafe {
        vr_scene_create_grid(gpu, info, knots.as_ptr(), count, out)
    };
    refused(grid_of(gpu, &info, &c_fog, c_fog.len(), null_mut()), INVALID, "scene: is NULL");
    refused(grid_of(null(), &info, &c_fog, c_fog.len(), &mut out), INVALID, "gpu: is NULL");
    assert!(out.is_null());
    refused(grid_of(gpu, null(), &c_fog, c_fog.len(), &mut out), INVALID, "vr_grid_info: is NULL");
    let wrong = |change: &dyn Fn(&mut vr_grid_info), words: &str| {
        let (mut info, mut out) = (info, std::ptr::dangling_mut());
        change(&mut info);
        refused(grid_of(gpu, &info, &c_fog, c_fog.len(), &mut out), INVALID, words);
        assert!(out.is_null());
    };
    wrong(&|info| info.struct_size = 0, "struct_size 0");
    wrong(&|info| info.struct_size -= 8, "struct_size");
    wrong(&|info| info.sample_bytes = 7, "need 8 bytes, 7 are given");
    wrong(&|info| info.dims = [2, 2, 1], "need 4 bytes");
    wrong(&|info| (info.dims, info.sample_bytes) = ([8, 1, 1], 8), "at least 2");
    wrong(&|info| info.samples = null(), "samples: is NULL");
    wrong(&|info| info.sample_type = 77, "sample_type: 77");
    wrong(&|info| info.spacing = [1.0, 0.0, 1.0], "spacing");
    wrong(&|info| info.slope = f64::NAN, "slope");
    // SAFETY: null is refused.
    refused(unsafe { vr_scene_create_grid(gpu, &info, null(), 3, &mut out) }, INVALID, "knots: is NULL");
    refused(grid_of(gpu, &info, &c_fog, usize::MAX, &mut out), INVALID, "knots");
    let falling = knots(&[[1.0, 0.0, 0.0, 0.0, 0.0], [0.5, 0.0, 0.0, 0.0, 1.0]]);
    refused(grid_of(gpu, &info, &falling, 2, &mut out), INVALID, "knot 1");

    // SAFETY: what is wrong is refused before it is followed.
    refused(unsafe { vr_scene_with_transfer(scene, null(), 0, &mut out) }, INVALID, "at least 1");
    // SAFETY: the same.
    refused(
        unsafe { vr_scene_with_samples(scene, 1, [0_u8; 8].as_ptr().cast(), 8, &mut out) },
        INVALID,
        "need 512",
    );
    // SAFETY: the same.
    let scalars = unsafe { vr_scene_with_scalars(scene, 1, [0_f32; 8].as_ptr(), 8, null(), 0, &mut out) };
    refused(scalars, INVALID, "grid");
    // SAFETY: the same.
    refused(unsafe { vr_scene_query(scene, null_mut()) }, INVALID, "is NULL");
    let mesh = sized!(vr_mesh_info {
        points: [0.0; 12].as_ptr(),
        point_count: 4,
        cells: [0, 1, 2, 9].as_ptr(),
        cell_count: 1,
        scalars: [0.0; 4].as_ptr(),
        scalar_count: 4,
        scalars_per: 1
    });
    for (change, words) in [
        ((|_| ()) as fn(&mut vr_mesh_info), "there are 4 points"),
        (|mesh| mesh.scalar_count = 3, "3 are given, 4 are needed"),
        (|mesh| mesh.scalars_per = 3, "scalars_per: 3"),
        (|mesh| mesh.cells = null(), "cells: is NULL"),
        (|mesh| mesh.reserved = 1, "reserved"),
    ] {
        let mut mesh = mesh;
        change(&mut mesh);
        // SAFETY: the same.
        refused(unsafe { vr_scene_create_mesh(gpu, &mesh, c_fog.as_ptr(), 1, &mut out) }, INVALID, words);
    }
    let both = sized!(vr_points_info {
        centres: [0.0; 6].as_ptr(),
        point_count: 2,
        radii: [1.0; 2].as_ptr(),
        covariances: [1.0; 12].as_ptr()
    });
    // SAFETY: the same.
    refused(
        unsafe { vr_scene_create_points(gpu, &both, c_fog.as_ptr(), 1, &mut out) },
        INVALID,
        "one of them must be NULL",
    );

    let mut pixels = [0_f32; 4 * 40 * 30];
    let (floats, full) = (pixels.as_mut_ptr(), pixels.len());
    // SAFETY: the same.
    let render = |scene, spec: &CStr, view: *const vr_view, to, room| unsafe {
        vr_render(scene, spec.as_ptr(), view, to, room)
    };
    refused(render(scene, c"slabs", &view, floats, full - 1), INVALID, "4800");
    refused(render(scene, c"slabs", &view, null_mut(), full), INVALID, "pixels: is NULL");
    refused(render(scene, c"slabz", &view, floats, full), INVALID, "must be one of slices-2d");
    refused(render(scene, c"slabs:step=-1", &view, floats, full), INVALID, "step");
    refused(render(scene, c"slabs:step", &view, floats, full), INVALID, "key=value");
    refused(render(scene, c"\xff", &view, floats, full), INVALID, "UTF-8");
    refused(render(scene, c"havs", &view, floats, full), INVALID, "grid");
    refused(render(null(), c"slabs", &view, floats, full), INVALID, "scene: is NULL");
    refused(render(scene, c"slabs", &vr_view { up: [0.0; 3], ..view }, floats, full), INVALID, "up");
    assert!(pixels.iter().all(|&x| x == 0.0));

    let plan_info = sized!(vr_plan_info { format: FORMAT, mode: vr_target_mode::VR_TARGET_CLEAR as u32 });
    let mut plan = std::ptr::dangling_mut();
    // SAFETY: the same.
    let create =
        |info: vr_plan_info, plan: &mut *mut vr_plan| unsafe { vr_plan_create(scene, &info, &view, plan) };
    refused(create(vr_plan_info { mode: 0, ..plan_info }, &mut plan), INVALID, "mode: 0");
    assert!(plan.is_null());
    refused(create(vr_plan_info { reserved: 9, ..plan_info }, &mut plan), INVALID, "reserved: 9");
    let depth_format = vr_plan_info { format: vk::Format::D16_UNORM, ..plan_info };
    refused(create(depth_format, &mut plan), vr_result::VR_ERROR_UNSUPPORTED, "D16_UNORM");
    done(create(plan_info, &mut plan));
    let larger = vr_view { width: 41, ..view };
    // SAFETY: the same.
    assert_eq!(unsafe { vr_plan_set_view(plan, &larger) }, vr_result::VR_NO_ROOM);
    let frame = Caller::new(&own, FORMAT, [40, 30], 16);
    let target = record_info(&frame);
    let mut recording = std::ptr::dangling_mut();
    frame.begin([0.0; 4]);
    // SAFETY: the same.
    let record = |info: &vr_record_info, recording: &mut *mut vr_recording| unsafe {
        vr_plan_record(plan, info, recording)
    };
    let depth = sized!(vr_depth_image {
        view: frame.view,
        format: vk::Format::D32_SFLOAT,
        extent: target.extent,
        kind: 1,
        at_zero: 1.0,
        at_one: 9.0
    });
    for (info, words) in [
        (vr_record_info { commands: vk::CommandBuffer::null(), ..target }, "commands"),
        (vr_record_info { image: vk::Image::null(), ..target }, "image"),
        (vr_record_info { view: vk::ImageView::null(), ..target }, "view"),
        (vr_record_info { format: vk::Format::R8G8B8A8_UNORM, ..target }, "R8G8B8A8_UNORM"),
        (vr_record_info { extent: vk::Extent2D { width: 40, height: 31 }, ..target }, "[40, 31]"),
        (vr_record_info { depth: &depth, ..target }, "depth"),
        (vr_record_info { depth: &vr_depth_image { at_one: 1.0, ..depth }, ..target }, "different"),
        (vr_record_info { depth: &vr_depth_image { kind: 4, ..depth }, ..target }, "kind: 4"),
        (vr_record_info { depth: &vr_depth_image { kind: 3, ..depth }, ..target }, "centre"),
        (
            vr_record_info { depth: &vr_depth_image { view: vk::ImageView::null(), ..depth }, ..target },
            "NULL_HANDLE",
        ),
    ] {
        refused(record(&info, &mut recording), INVALID, words);
        assert!(recording.is_null());
    }
    done(record(&target, &mut recording));
    let mut second = std::ptr::dangling_mut();
    refused(record(&target, &mut second), INVALID, "has not been completed");
    assert!(second.is_null());
    // SAFETY: the submission has ended.
    let completed = |status: *mut vr_status| unsafe { vr_recording_completed(recording, status) };
    frame.end(&own);
    let mut status = sized!(vr_status {});
    status.struct_size = 3;
    refused(completed(&mut status), INVALID, "struct_size 3");
    done(completed(null_mut()));
    // SAFETY: null is refused.
    refused(unsafe { vr_recording_completed(null_mut(), null_mut()) }, INVALID, "recording: is NULL");
    end_recording(recording);
    // A frame that is dropped.
    frame.begin([0.0; 4]);
    done(record(&target, &mut recording));
    // SAFETY: never submitted: it is begun anew.
    done(unsafe { vr_recording_discard(recording) });
    // SAFETY: discarded already.
    done(unsafe { vr_recording_discard(recording) });
    // SAFETY: nothing is read.
    refused(unsafe { vr_recording_completed(recording, &mut status) }, INVALID, "discarded");
    end_recording(recording);
    // SAFETY: not pending.
    unsafe { engine.device.reset_command_buffer(frame.commands, vk::CommandBufferResetFlags::empty()) }
        .unwrap();
    frame.begin([0.0; 4]);
    done(record(&target, &mut recording));
    frame.end(&own);
    // SAFETY: the submission has ended.
    done(unsafe { vr_recording_completed(recording, null_mut()) });
    end_recording(recording);

    let (mut used, mut budget) = (0, 0);
    // SAFETY: all are valid.
    done(unsafe { vr_gpu_memory(gpu, &mut used, &mut budget) });
    assert!(used > 0 && used < budget);
    // SAFETY: null is refused.
    refused(unsafe { vr_gpu_memory(null(), &mut used, &mut budget) }, INVALID, "gpu");
    // SAFETY: null is nothing.
    assert!(unsafe { vr_gpu_name(null()) }.is_null());
    // SAFETY: null is nothing.
    assert!(unsafe { vr_scene_technique(null()) }.is_null());
    // SAFETY: null is nothing.
    assert!(unsafe { vr_plan_route(null()) }.is_null());
    // Null is nothing.
    for (plan, scene, gpu) in [(plan, scene, gpu), (null_mut(), null_mut(), null_mut())] {
        end_plan(plan);
        end_scene(scene);
        end_gpu(gpu);
    }
    end_recording(null_mut());
    drop((frame, own));
    silent(engine);
}

/// What was made from a handle lives on without it. Locks are held in pairs, and the end is told once, after everything.
#[test]
fn handles_go_in_any_order() {
    #[derive(Default)]
    struct Calls {
        held: Cell<bool>,
        /// Locked when it was, or unlocked when it was not.
        wrong: Cell<bool>,
        locks: Cell<u32>,
        released: Cell<u32>,
    }
    // Calls of this test's thread alone.
    unsafe extern "C" fn lock(user: *mut c_void) {
        // SAFETY: the test's, which waits.
        let calls = unsafe { &*user.cast::<Calls>() };
        calls.locks.set(calls.locks.get() + 1);
        calls.wrong.set(calls.wrong.get() | calls.held.replace(true));
    }
    unsafe extern "C" fn unlock(user: *mut c_void) {
        // SAFETY: the test's, which waits.
        let calls = unsafe { &*user.cast::<Calls>() };
        calls.wrong.set(calls.wrong.get() | !calls.held.replace(false));
    }
    unsafe extern "C" fn released(user: *mut c_void) {
        // SAFETY: the test's, which waits.
        let calls = unsafe { &*user.cast::<Calls>() };
        calls.released.set(calls.released.get() + 1);
    }
    unsafe extern "C" fn with_queue(queue: VkQueue, user: *mut c_void) {
        // SAFETY: the test's, which waits.
        unsafe { *user.cast::<u64>() = queue.as_raw() };
    }
    let _turn = turn();
    let engine = Engine::full();
    let own = engine.gpu();
    let frame = Caller::new(&own, FORMAT, [40, 30], 16);
    let calls = Calls::default();
    let view = c_view(&view(perspective(), 1.0, 40, 30));
    let info = sized!(vr_plan_info { format: FORMAT, mode: vr_target_mode::VR_TARGET_CLEAR as u32 });
    let mut expected = 0;
    for order in 0..3 {
        let (mut gpu, mut plan, mut recording) = (null_mut(), null_mut(), null_mut());
        with_device(&engine, |mut info| {
            info.lock_queue = Some(lock);
            info.unlock_queue = Some(unlock);
            info.released = Some(released);
            info.user = (&raw const calls).cast_mut().cast();
            // SAFETY: the engine's objects.
            done(unsafe { vr_gpu_adopt(&info, &mut gpu) });
            // What fails has released, too.
            info.unlock_queue = None;
            let mut none = null_mut();
            // SAFETY: the engine's objects.
            refused(unsafe { vr_gpu_adopt(&info, &mut none) }, vr_result::VR_ERROR_INVALID, "one of them");
            expected += 1;
            assert_eq!(calls.released.get(), expected);
        });
        let before = calls.locks.get();
        let mut queue = 0_u64;
        // SAFETY: all are valid.
        done(unsafe { vr_gpu_with_queue(gpu, Some(with_queue), (&raw mut queue).cast()) });
        assert_eq!((queue, calls.locks.get()), (engine.queue.as_raw(), before + 1));
        let scene = c_scene(gpu, &Field::Blobs.sample([12; 3], "u8").unwrap(), &FOG);
        // SAFETY: all are valid.
        done(unsafe { vr_plan_create(scene, &info, &view, &mut plan) });
        assert!(calls.locks.get() > before + 1 && !calls.held.get());
        end_gpu(gpu);
        if order > 0 {
            end_scene(scene);
        }
        let at_record = calls.locks.get();
        frame.begin([0.0; 4]);
        // SAFETY: all are valid.
        done(unsafe { vr_plan_record(plan, &record_info(&frame), &mut recording) });
        assert_eq!(calls.locks.get(), at_record);
        if order > 1 {
            end_plan(plan);
        }
        let bytes = frame.end(&own);
        assert!(bytes.iter().any(|&byte| byte != 0));
        let mut status = sized!(vr_status {});
        // SAFETY: the submission has ended.
        done(unsafe { vr_recording_completed(recording, &mut status) });
        assert_eq!((status.complete, calls.released.get()), (1, expected + u32::from(order > 1)));
        end_recording(recording);
        if order < 2 {
            end_plan(plan);
        }
        if order < 1 {
            end_scene(scene);
        }
        expected += 1;
        assert_eq!(calls.released.get(), expected);
    }
    assert!(!calls.wrong.get() && calls.locks.get() > 3);
    drop((frame, own));
    silent(engine);
}

/// A device of the library's own, and what is no device.
#[test]
fn a_device_of_its_own() {
    use vr_result::VR_ERROR_INVALID as INVALID;
    let _turn = turn();
    let mut gpu = null_mut();
    let info = sized!(vr_gpu_info {
        no_pipeline_cache: 1,
        memory_budget: 123 << 20,
        validation: vr_validation::VR_VALIDATION_ON as u32
    });
    // SAFETY: all are valid.
    let create = |info: &vr_gpu_info, gpu: &mut *mut vr_gpu| unsafe { vr_gpu_create(info, gpu) };
    done(create(&info, &mut gpu));
    // SAFETY: a device.
    assert_ne!(text(unsafe { vr_gpu_name(gpu) }), "");
    let (mut budget, mut objects) = (0, sized!(vr_gpu_objects {}));
    // SAFETY: all are valid.
    done(unsafe { vr_gpu_memory(gpu, null_mut(), &mut budget) });
    assert_eq!(budget, 123 << 20);
    // SAFETY: all are valid.
    done(unsafe { vr_gpu_handles(gpu, &mut objects) });
    assert!(
        !objects.instance.is_null()
            && !objects.physical_device.is_null()
            && !objects.device.is_null()
            && !objects.queue.is_null()
    );
    let scene = c_scene(gpu, &Field::Blobs.sample([8; 3], "u8").unwrap(), &FOG);
    let view = view(perspective(), 1.0, 16, 12);
    assert!(c_render(scene, Some(c"slabs"), &view).iter().any(|p| p[3] > 0.1));
    end_gpu(gpu);
    end_scene(scene);
    gpu = std::ptr::dangling_mut();
    let none = vr_gpu_info { device: c"none".as_ptr(), ..info };
    refused(create(&none, &mut gpu), vr_result::VR_ERROR_NO_DEVICE, "none");
    assert!(gpu.is_null());
    refused(create(&vr_gpu_info { validation: 3, ..info }, &mut gpu), INVALID, "validation: 3");
    // SAFETY: null is refused.
    refused(unsafe { vr_gpu_create(&info, null_mut()) }, INVALID, "gpu: is NULL");

    let engine = Engine::new(|_| Enabled { dynamic_rendering: true, ..Enabled::default() });
    with_device(&engine, |info| {
        // SAFETY: what is wrong is refused before it is used.
        let adopt = |info: vr_device_info, gpu: &mut *mut vr_gpu| unsafe { vr_gpu_adopt(&info, gpu) };
        let unsupported = vr_result::VR_ERROR_UNSUPPORTED;
        refused(adopt(info, &mut gpu), unsupported, "synchronization2 is not enabled");
        refused(adopt(vr_device_info { api_version: 0, ..info }, &mut gpu), unsupported, "1.3");
        refused(
            adopt(vr_device_info { instance: vk::Instance::null(), ..info }, &mut gpu),
            INVALID,
            "instance",
        );
        refused(adopt(vr_device_info { device: vk::Device::null(), ..info }, &mut gpu), INVALID, "device");
        refused(adopt(vr_device_info { queue: vk::Queue::null(), ..info }, &mut gpu), INVALID, "queue");
        refused(
            adopt(vr_device_info { physical_device: vk::PhysicalDevice::null(), ..info }, &mut gpu),
            INVALID,
            "physical_device",
        );
        refused(
            adopt(vr_device_info { device_create_info: null(), ..info }, &mut gpu),
            INVALID,
            "device_create_info",
        );
        // Of the system's loader, which the engine has, too.
        refused(
            adopt(vr_device_info { get_instance_proc_addr: None, ..info }, &mut gpu),
            unsupported,
            "synchronization2",
        );
    });
    silent(engine);
}

#[test]
fn techniques_are_described() {
    assert_eq!(text(vr_version()), env!("CARGO_PKG_VERSION"));
    assert_eq!(vr_technique_count() as usize, Method::ALL.len());
    for (i, method) in Method::ALL.into_iter().enumerate() {
        let mut info = sized!(vr_technique_info {});
        // SAFETY: all are valid.
        done(unsafe { vr_technique_query(i as u32, &mut info) });
        assert_eq!((text(info.name), text(info.summary)), (method.name().into(), method.summary().into()));
        // SAFETY: lives for ever.
        let options = unsafe { std::slice::from_raw_parts(info.options, info.option_count) };
        assert_eq!(options.len(), method.options().len());
        for (got, want) in options.iter().zip(method.options()) {
            let got = [got.key, got.values, got.default_value, got.effect].map(text);
            assert_eq!(got, [want.key, want.values, want.default, want.effect]);
        }
        // SAFETY: text.
        done(unsafe { vr_technique_parse(info.name) });
    }
    let mut info = sized!(vr_technique_info {});
    // SAFETY: all are valid.
    refused(unsafe { vr_technique_query(99, &mut info) }, vr_result::VR_ERROR_INVALID, "index: 99");
    // SAFETY: null is refused.
    refused(unsafe { vr_technique_parse(null()) }, vr_result::VR_ERROR_INVALID, "NULL");
}
