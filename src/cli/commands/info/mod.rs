//! `volraster info`: describes a file as text or JSON.
//!
//! `facts` collects what is reported; `data` and `scene` add to it, `command` reads the file.

mod command;
mod data;
mod facts;
mod histogram;
mod scene;

pub(crate) use command::Args;
