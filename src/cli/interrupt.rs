//! Ctrl-C: the first time is a wish that long work asks about, the second time ends the program.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::cli::output;

/// The exit code of a run that was stopped, as shells have it (128 and the signal's number).
pub(crate) const EXIT_CODE: u8 = 130;

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// From now on Ctrl-C is a wish. Where that cannot be had, it ends the program as before.
pub(crate) fn watch() {
    let _ = ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(EXIT_CODE));
        }
        output::complain("stopping; once more to stop at once");
    });
}

/// Whether to stop.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}
