//! The key `mesh`: a data file, or an analytic field on tetrahedra.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::options::ReadOptions;
use crate::io::scene_file::data::{Given, SceneData, check_memory, read, refuse_arrays};
use crate::io::scene_file::schema::{lacks, needs, one_of, rules, with, words};
use crate::scene::{Data, Field};

/// A mesh: a data file, or an analytic field on tetrahedra.
// One struct has the keys of both, so that every error names its key.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `file` or `field`")]
#[schemars(transform = rules(vec![
    one_of(&["file", "field"]),
    with("file", lacks(&["cubes"])),
    with("field", needs(&["cubes"])),
    with("field", lacks(&["array"])),
]))]
pub(crate) struct MeshSpec {
    /// Names a file that holds a mesh.
    file: Option<String>,
    /// Selects the array of the file that is shown. Left out: that which the file marks as active, else the first
    /// suitable one.
    array: Option<String>,
    /// Selects an analytic field, which fills [-1, 1]³ with values from 0 to 1.
    #[schemars(transform = words(Field::NAMES))]
    field: Option<String>,
    /// Sets the number of cubes along each side for a field: cubes of five tetrahedra, split so that faces match.
    #[schemars(range(min = 1, max = Field::MAX_CUBES))]
    cubes: Option<u32>,
}

impl MeshSpec {
    pub(crate) fn load(&self, scene: &Path, options: &ReadOptions) -> Result<SceneData> {
        options.check_kernels("a mesh").map_err(|error| error.in_file(scene))?;
        match Given::of(scene, "mesh", &self.file, &self.field)? {
            Given::File(_) if self.cubes.is_some() => {
                Err(Error::file(scene, "mesh.cubes", "belongs to a field, not to a file"))
            }
            Given::File(file) => {
                let array = options.array.clone().or_else(|| self.array.clone());
                let loaded = read("mesh", &file, &ReadOptions { array, ..options.clone() })?;
                Ok(SceneData::new(&file, loaded))
            }
            Given::Field(field) => {
                let wanted = [("mesh.array", &self.array), ("array", &options.array)];
                refuse_arrays(scene, "fields", &wanted)?;
                Ok(SceneData::analytic(scene, self.analytic(scene, field, options)?))
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
        check_memory(scene, "mesh.cubes", cubes, 28 * (side + 1).pow(3) + 80 * side.pow(3), options)?;
        field.tets(cubes).map(Data::Mesh).map_err(at("mesh.cubes"))
    }
}
