//! Scenes as scene files: what is chosen automatically for a data file, to be edited, and what was edited in a window.

use std::path::Path;

use serde_json::{Map, Value, json};
#[cfg(any(test, feature = "window"))]
use volraster::Technique;
use volraster::io::scene_file::SceneFile;
use volraster::scene::{Camera, Lighting, Mode, Projection, Scene, TransferFunction, View};
use volraster::{Error, Result};

use super::args::ArraysArgs;
use super::scene::Settings;
#[cfg(any(test, feature = "window"))]
use super::technique::options_json;
use crate::cli::output::{refuse, without_nulls};

/// Returns the scene file that draws what `path`, a data file, draws by itself, with this look.
pub(crate) fn scene_file(
    path: &Path,
    arrays: &ArraysArgs,
    scene: &Scene,
    settings: &Settings,
) -> Result<Value> {
    if SceneFile::is_at(path, &arrays.options()) {
        return Err(refuse(path, "--scene", "a scene file is one already"));
    }
    let mut document = of_data(path, arrays, scene)?;
    document.extend(look(scene, &settings.view, settings.background));
    Ok(without_nulls(Value::Object(document)))
}

/// Returns the part of a scene file that names a data file.
fn of_data(path: &Path, arrays: &ArraysArgs, scene: &Scene) -> Result<Map<String, Value>> {
    let mut data = Map::from_iter([("file".to_string(), json!(absolute(path)?))]);
    data.extend(arrays.given().map(|(key, name)| (key.to_string(), json!(name))));
    Ok(Map::from_iter([(data_key(scene).to_string(), Value::Object(data))]))
}

/// Returns the key of the data in scene files.
fn data_key(scene: &Scene) -> &'static str {
    match scene.data.kind() {
        "grid" => "volume",
        kind => kind,
    }
}

/// Returns the absolute path of a file as text.
fn absolute(path: &Path) -> Result<String> {
    // Formats and parts of a file are found by its own name, so links are not followed.
    let file = std::path::absolute(path);
    let file =
        file.map_err(|source| Error::Io { path: path.to_path_buf(), action: "cannot open", source })?;
    let file = file.to_str().map(str::to_string);
    file.ok_or_else(|| refuse(path, "file name", "must be Unicode, for a scene file to name it"))
}

/// Returns the part of a scene file that says how to look at the data. Keys of parts that a scene lacks are null.
fn look(scene: &Scene, view: &View, background: [f64; 4]) -> Map<String, Value> {
    let camera = view.camera();
    let (key, value) = projection(camera);
    let [eye, target, up] = [camera.eye, camera.target, camera.up].map(|v| v.to_array());
    let lighting = if let Mode::Lit(lighting) = scene.mode { lighting_json(lighting) } else { Value::Null };
    let [width, height] = view.extent();
    Map::from_iter(
        [
            ("transfer", json!(scene.gaussians().is_none().then(|| rows(&scene.transfer)))),
            ("mode", json!((scene.mode != Mode::Emission).then(|| scene.mode.name()))),
            ("lighting", lighting),
            ("camera", json!({"eye": eye, "target": target, "up": up, key: value})),
            ("image", json!({"width": width, "height": height})),
            ("background", json!(background)),
        ]
        .map(|(key, value)| (key.to_string(), value)),
    )
}

/// Returns the knots of a transfer function as rows of scalar, colour and extinction.
pub(crate) fn rows(transfer: &TransferFunction) -> Vec<[f64; 5]> {
    let knots = transfer.knots().iter();
    knots.map(|k| [k.s, k.colour.x, k.colour.y, k.colour.z, k.tau]).collect()
}

/// Returns the key of a camera's projection, and its value.
pub(crate) fn projection(camera: &Camera) -> (&'static str, f64) {
    match camera.projection {
        Projection::Perspective { fov_y_deg } => ("fov_y_deg", fov_y_deg),
        Projection::Orthographic { half_height } => ("half_height", half_height),
    }
}

/// Returns the keys of a scene's light.
pub(crate) fn lighting_json(lighting: Lighting) -> Value {
    let Lighting { ambient, diffuse, specular, shininess, direction, least_gradient } = lighting;
    json!({
        "ambient": ambient, "diffuse": diffuse, "specular": specular, "shininess": shininess,
        "direction": direction.map(|d| d.to_array()), "least_gradient": least_gradient,
    })
}

/// Returns the scene file that draws a scene of `path`, a data file or a scene file, as it looks after edits.
#[cfg(any(test, feature = "window"))]
pub(crate) fn edited(
    path: &Path,
    arrays: &ArraysArgs,
    scene: &Scene,
    view: &View,
    background: [f64; 4],
    technique: &Technique,
) -> Result<Value> {
    let mut document = if SceneFile::is_at(path, &arrays.options()) {
        let text = std::fs::read_to_string(path).map_err(crate::cli::output::unreadable(path))?;
        let mut document: Map<String, Value> =
            serde_json::from_str(&text).map_err(|error| refuse(path, "JSON", &error.to_string()))?;
        let folder = path.parent().unwrap_or(Path::new("."));
        document.values_mut().try_for_each(|value| place_files(value, folder))?;
        if let Some(Value::Object(data)) = document.get_mut(data_key(scene)) {
            data.extend(arrays.given().map(|(key, name)| (key.to_string(), json!(name))));
        }
        document
    } else {
        of_data(path, arrays, scene)?
    };
    document.extend(look(scene, view, background));
    let method = technique.method();
    let is_default = |key: &str, value: &Value| {
        let text = value.as_str().map_or_else(|| value.to_string(), str::to_string);
        method.options().iter().any(|info| info.key == key && info.default == text)
    };
    let mut options = Map::from_iter([("name".to_string(), json!(method.name()))]);
    if let Value::Object(all) = options_json(technique) {
        options.extend(all.into_iter().filter(|(key, value)| !is_default(key, value)));
    }
    document.insert("technique".to_string(), Value::Object(options));
    Ok(without_nulls(Value::Object(document)))
}

/// Makes the relative paths of files in a part of a scene file absolute.
#[cfg(any(test, feature = "window"))]
fn place_files(value: &mut Value, folder: &Path) -> Result<()> {
    match value {
        Value::Object(members) => members.iter_mut().try_for_each(|(key, value)| match value {
            Value::String(file) if key == "file" => {
                *file = absolute(&folder.join(&*file))?;
                Ok(())
            }
            _ => place_files(value, folder),
        }),
        Value::Array(items) => items.iter_mut().try_for_each(|item| place_files(item, folder)),
        _ => Ok(()),
    }
}
