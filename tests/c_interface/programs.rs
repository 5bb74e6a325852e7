//! The header and the library, as C compilers and C programs have them.

use std::ffi::OsStr;
use std::mem::offset_of;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use volraster::ffi::*;
use volraster::scene::Field;

use crate::support::*;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// A tool; what a second driver needs of libraries is not the tools'.
fn tool(name: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(name);
    command.current_dir(ROOT).env_remove("LD_LIBRARY_PATH");
    command
}

fn cargo(arguments: &[&str]) -> Output {
    let mut command = tool(std::env::var_os("CARGO").unwrap_or("cargo".into()));
    // The test runner sets it for the tests alone; cargo would build everything anew.
    command.args(arguments).env_remove("RUSTC_BOOTSTRAP");
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

/// Folder of the dynamic library, which is built on first use. With the crate and one of its tests named, too, the library is linked from what
/// was built for the tests, features and all.
fn library() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let mut arguments = vec![
            "build",
            "--lib",
            "--test=c_interface",
            "-p=volraster",
            "-p=volraster-capi",
            "--message-format=json-render-diagnostics",
        ];
        if cfg!(feature = "mpi") {
            arguments.push("--features=volraster/mpi");
        }
        let output = cargo(&arguments);
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

pub fn scratch(name: &str) -> PathBuf {
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

/// The checksum at the header's end is that of the sources, so nobody has forgotten `make header`.
#[test]
fn the_header_was_made_from_these_sources() {
    let mut files: Vec<PathBuf> = std::fs::read_dir(Path::new(ROOT).join("src/ffi"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    files.sort();
    // FNV-1a, as `capi/header` has it.
    let bytes = files.iter().flat_map(|file| std::fs::read(file).unwrap());
    let sum = bytes
        .fold(0xcbf2_9ce4_8422_2325_u64, |sum, byte| (sum ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    let header = std::fs::read_to_string(Path::new(ROOT).join("include/volraster.h")).unwrap();
    assert!(
        header.contains(&format!("sources: {sum:016x}")),
        "include/volraster.h is out of date: run `make header`"
    );
}

#[test]
#[ignore = "make test-all: it builds the program that writes the header"]
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
        vr_gpu_info: struct_size, device, validation, no_pipeline_cache, pipeline_cache_folder, memory_budget;
        vr_device_info: struct_size, get_instance_proc_addr, instance, api_version, instance_extension_count,
            instance_extensions, physical_device, device, device_create_info, queue, queue_family, pipeline_cache,
            pipeline_cache_folder, memory_budget, lock_queue, unlock_queue, released, user;
        vr_gpu_objects: struct_size, instance, physical_device, device, queue, queue_family;
        vr_grid_info: struct_size, dims, sample_type, samples, sample_bytes, spacing, origin, direction, slope, intercept;
        vr_mesh_info: struct_size, points, point_count, cells, cell_count, scalars, scalar_count, scalars_per, reserved;
        vr_points_info: struct_size, centres, point_count, scalars, weights, radii, covariances, radius;
        vr_surface_info: struct_size, points, point_count, triangles, triangle_count, colour, shading, reserved;
        vr_knot: scalar, colour, extinction;
        vr_read_info: struct_size, max_bytes, array, radius, covariance, weight, progress, user;
        vr_scene_info: struct_size, low, high, range, data_kind, dims;
        vr_clip_plane: point, normal;
        vr_view: struct_size, eye, target, up, projection, width, height, clip_plane_count, fov_y_deg, half_height,
            clip_planes, crop_low, crop_high, view_matrix, projection_matrix;
        vr_plan_info: struct_size, technique, format, mode, with_depth, in_part;
        vr_depth_image: struct_size, view, format, layout, extent, kind, at_zero, at_one, matrix, corner;
        vr_record_info: struct_size, commands, image, view, format, extent, depth, corner;
        vr_pass_time: name, ms;
        vr_counter: name, value;
        vr_status: struct_size, complete, pass_count, passes, counters, counter_count, bound_rmse, bound_greatest;
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
