//! Signals. Ctrl-C: the first one requests a stop, which long work polls; the second one ends the program at once.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::cli::output;

/// Exit code of an interrupted run, by the convention of shells (128 plus the signal number).
pub(crate) const EXIT_CODE: u8 = 130;

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Installs the handler. If that fails, Ctrl-C ends the program as usual.
pub(crate) fn watch() {
    let _ = ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(EXIT_CODE));
        }
        output::complain("stopping; press Ctrl-C again to stop at once");
    });
}

/// Makes a file that exceeds the limit of file sizes an error of the write, which leaves no part of it, instead of the program's end.
pub(crate) fn outlive_size_limits() {
    #[cfg(unix)]
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default());
}

/// Returns whether the user has requested a stop.
pub(crate) fn requested() -> bool {
    REQUESTED.load(Ordering::SeqCst)
}
