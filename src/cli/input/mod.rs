//! Input that several commands share: common arguments, the scene to draw, and techniques as the command line names them.
//!
//! Uses `output` and `timing`. Every command that draws uses it.

mod args;
mod look;
mod scene;
mod scene_file;
mod technique;

pub(crate) use args::{ArraysArgs, AxesArgs, ChoiceArgs, DeviceArgs, Size, finite, positive};
pub(crate) use look::LookArgs;
pub(crate) use scene::{Input, Settings, drawn};
#[cfg(any(test, feature = "window"))]
pub(crate) use scene_file::edited;
pub(crate) use scene_file::{lighting_json, projection, rows, scene_file};
pub(crate) use technique::{
    Request, Wanted, all_routes, by_route, is_refusal, options_json, options_text, too_many_splats,
    with_options,
};
