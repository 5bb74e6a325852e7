//! The key `mesh`: a data file, or an analytic field on tetrahedra.

use std::path::Path;

use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::options::ReadOptions;
use crate::io::read_data;
use crate::io::report::Report;
use crate::io::scene_file::data::{HOLDS_POINTS, SceneData, beside};
use crate::scene::{Data, Field};

/// The keys of both kinds of mesh, in one struct so that every error names its key.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with `file` or `field`")]
pub(crate) struct MeshSpec {
    file: Option<String>,
    array: Option<String>,
    field: Option<String>,
    cubes: Option<u32>,
}

impl MeshSpec {
    pub(crate) fn load(&self, scene: &Path, options: &ReadOptions) -> Result<SceneData> {
        let refuse = |place: &str, rule: String| Err(Error::file(scene, place, rule));
        options.check_kernels("a mesh").map_err(|error| error.in_file(scene))?;
        match (&self.file, &self.field) {
            (Some(_), Some(_)) => refuse("mesh", "must have either `file` or `field`, not both".into()),
            (None, None) => refuse("mesh", "must have `file` or `field`".into()),
            (Some(_), None) if self.cubes.is_some() => {
                refuse("mesh.cubes", "belongs to a field, not to a file".into())
            }
            (Some(file), None) => {
                let file = beside(scene, file);
                let array = options.array.clone().or_else(|| self.array.clone());
                let loaded = read_data::read(&file, &ReadOptions { array, ..options.clone() })?;
                match loaded.data {
                    Data::Mesh(_) => Ok(SceneData::new(&file, loaded)),
                    Data::Grid(_) => {
                        Err(Error::file(&file, "content", "holds a grid: a scene names it in `volume`"))
                    }
                    Data::Points(_) => Err(Error::file(&file, "content", HOLDS_POINTS)),
                }
            }
            (None, Some(field)) => {
                // Arrays may be selected in the scene or in the options.
                let wanted = [("mesh.array", &self.array), ("array", &options.array)];
                if let Some((key, array)) = wanted.into_iter().find_map(|(key, a)| Some((key, a.as_ref()?))) {
                    return refuse(key, format!("\"{array}\": fields have no arrays with names"));
                }
                Ok(SceneData {
                    data: self.analytic(scene, field, options)?,
                    file: scene.to_path_buf(),
                    report: Report { format: "analytic field", ..Report::default() },
                })
            }
        }
    }

    fn analytic(&self, scene: &Path, field: &str, options: &ReadOptions) -> Result<Data> {
        let Some(cubes) = self.cubes else {
            return Err(Error::file(scene, "mesh.cubes", "missing: a field needs cubes"));
        };
        let at = |key: &'static str| move |error: Error| error.at_place(scene, key);
        let field = Field::from_name(field).map_err(at("mesh.field"))?;
        // A corner takes 28 bytes (position and scalar), a cube 80 (five tetrahedra of four indices).
        let side = u64::from(cubes.min(Field::MAX_CUBES));
        let bytes = 28 * (side + 1).pow(3) + 80 * side.pow(3);
        if bytes > options.max_bytes {
            let rule = format!("{cubes}: takes {bytes} bytes, the limit is {} bytes", options.max_bytes);
            return Err(Error::file(scene, "mesh.cubes", rule));
        }
        field.tets(cubes).map(Data::Mesh).map_err(at("mesh.cubes"))
    }
}
