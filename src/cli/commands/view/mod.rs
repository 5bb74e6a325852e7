//! `volraster view`: a window to turn the data in, to edit the transfer function, and to save picture and scene.
//!
//! `session` is everything but the window, and `pace` its choice of a resolution; `app` is the window, `panel` and `editor` what it shows
//! beside the picture.

#[cfg(feature = "window")]
mod app;
#[cfg(feature = "window")]
mod command;
#[cfg(feature = "window")]
mod editor;
mod pace;
#[cfg(feature = "window")]
mod panel;
#[cfg_attr(not(feature = "window"), allow(dead_code, reason = "only its tests use it"))]
mod session;
#[cfg(test)]
mod tests;

#[cfg(feature = "window")]
pub(crate) use command::Args;
