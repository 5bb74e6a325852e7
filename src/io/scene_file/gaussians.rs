//! The key `gaussians`: a file of trained Gaussian splats.

use std::path::Path;

use schemars::JsonSchema;
use serde::Deserialize;

use crate::error::{Error, Result};
use crate::io::options::ReadOptions;
use crate::io::scene_file::data::{SceneData, beside, read};
use crate::io::scene_file::schema::{any_case, names, needs, rules, words};
use crate::scene::{Axes, SplatRule, StoredAxes};

/// Trained Gaussian splats in a file.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, expecting = "an object with `file`, `axes`, `turn_to` and `rule`")]
#[schemars(transform = rules(vec![needs(&["file"])]))]
pub(crate) struct GaussiansSpec {
    /// Names a file that holds Gaussian splats.
    file: Option<String>,
    /// Sets the directions that x, y and z of the file point to, whatever it says: `r` right or `l` left, `u` up or `d`
    /// down, `f` front or `b` back. Left out: those that the file tells, else those of its format.
    #[schemars(transform = any_case(PROPOSED, StoredAxes::names()))]
    axes: Option<String>,
    /// Sets right-handed axes that the splats are turned to, with their colours. Left out: they are not turned.
    #[schemars(transform = any_case(PROPOSED, Axes::ALL.map(Axes::name)))]
    turn_to: Option<String>,
    /// Selects the rule of drawing. Left out: the one that the splats were trained under, as far as the file tells, else `inria`.
    #[schemars(transform = words(names(SplatRule::ALL)))]
    rule: Option<String>,
}

/// Axes that an editor proposes: of PLY files, of SPZ, of glTF, and with z up.
const PROPOSED: [&str; 4] = ["rdf", "rub", "luf", "rfu"];

impl GaussiansSpec {
    /// Reads the file. Options override keys.
    pub(crate) fn load(&self, scene: &Path, options: &ReadOptions) -> Result<SceneData> {
        let Some(file) = &self.file else {
            return Err(Error::file(scene, "gaussians.file", "missing: splats come from a file"));
        };
        let at = |key: &'static str| move |error: Error| error.at_place(scene, key);
        let named = |name: &Option<String>| name.as_deref().map(Axes::named).transpose();
        let axes = named(&self.axes).map_err(at("gaussians.axes"))?;
        let turn_to = named(&self.turn_to).and_then(|axes| axes.map(StoredAxes::right_handed).transpose());
        let turn_to = turn_to.map_err(at("gaussians.turn_to"))?;
        let options = ReadOptions {
            axes: options.axes.or(axes),
            turn_to: options.turn_to.or(turn_to),
            ..options.clone()
        };
        let file = beside(scene, file);
        let loaded = read("gaussians", &file, &options)?;
        let rule = self.rule.as_deref().map(SplatRule::named).transpose().map_err(at("gaussians.rule"))?;
        Ok(SceneData { rule, ..SceneData::new(&file, loaded) })
    }
}
