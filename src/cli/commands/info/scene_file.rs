//! The scene of a data file as a scene file: what is chosen automatically, to be edited.

use std::path::Path;

use serde_json::{Map, Value, json};
use volraster::io::scene_file::SceneFile;
use volraster::scene::{Camera, Lighting, Mode, Projection, Scene, TransferFunction};
use volraster::{Error, Result};

use crate::cli::input::{ArraysArgs, Settings};
use crate::cli::output::{refuse, without_nulls};

/// Returns the scene file that draws what `path`, a data file, draws by itself, with this look.
pub(super) fn scene_file(
    path: &Path,
    arrays: &ArraysArgs,
    scene: &Scene,
    settings: &Settings,
) -> Result<Value> {
    if SceneFile::is_at(path, &arrays.options()) {
        return Err(refuse(path, "--scene", "a scene file is one already"));
    }
    // Formats and parts of a file are found by its own name, so links are not followed.
    let file = std::path::absolute(path);
    let file =
        file.map_err(|source| Error::Io { path: path.to_path_buf(), action: "cannot open", source })?;
    let Some(file) = file.to_str() else {
        return Err(refuse(path, "file name", "must be Unicode, for a scene file to name it"));
    };
    let mut data = Map::from_iter([("file".to_string(), json!(file))]);
    data.extend(arrays.given().map(|(key, name)| (key.to_string(), json!(name))));
    let data_key = match scene.data.kind() {
        "grid" => "volume",
        kind => kind,
    };
    let camera = settings.view.camera();
    let (key, value) = projection(camera);
    let [eye, target, up] = [camera.eye, camera.target, camera.up].map(|v| v.to_array());
    let lighting = if let Mode::Lit(lighting) = scene.mode { lighting_json(lighting) } else { Value::Null };
    let [width, height] = settings.view.extent();
    Ok(without_nulls(json!({
        data_key: data,
        "transfer": rows(&scene.transfer),
        "mode": (scene.mode != Mode::Emission).then(|| scene.mode.name()),
        "lighting": lighting,
        "camera": {"eye": eye, "target": target, "up": up, key: value},
        "image": {"width": width, "height": height},
        "background": settings.background,
    })))
}

/// Returns the knots of a transfer function as rows of scalar, colour and extinction.
pub(super) fn rows(transfer: &TransferFunction) -> Vec<[f64; 5]> {
    let knots = transfer.knots().iter();
    knots.map(|k| [k.s, k.colour.x, k.colour.y, k.colour.z, k.tau]).collect()
}

/// Returns the key of a camera's projection, and its value.
pub(super) fn projection(camera: &Camera) -> (&'static str, f64) {
    match camera.projection {
        Projection::Perspective { fov_y_deg } => ("fov_y_deg", fov_y_deg),
        Projection::Orthographic { half_height } => ("half_height", half_height),
    }
}

/// Returns the keys of a scene's light.
pub(super) fn lighting_json(lighting: Lighting) -> Value {
    let Lighting { ambient, diffuse, specular, shininess, direction, least_gradient } = lighting;
    json!({
        "ambient": ambient, "diffuse": diffuse, "specular": specular, "shininess": shininess,
        "direction": direction.map(|d| d.to_array()), "least_gradient": least_gradient,
    })
}
