//! `volraster calibrate`: measures what settings cost on this device, or checks choices on random scenes (`draws`).

mod command;
mod draws;

pub(crate) use command::Args;
