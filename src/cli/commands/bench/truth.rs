//! The reference image of a view, drawn on a thread of its own so that Ctrl-C need not wait for it.

use std::sync::{Arc, mpsc};
use std::time::Duration;

use volraster::reference::ReferenceImage;
use volraster::scene::View;
use volraster::{Error, GpuScene, Result};

use crate::cli::cache::Cache;
use crate::cli::interrupt;

/// Returns the reference image of a view; `None` as soon as the user requests a stop.
pub(super) fn truth(scene: &Arc<GpuScene>, view: &View, cache: &Cache) -> Result<Option<ReferenceImage>> {
    let (send, drawn) = mpsc::channel();
    let (scene, view, cache) = (Arc::clone(scene), *view, cache.clone());
    let drawing = std::thread::spawn(move || {
        let image = cache.image(scene.scene(), &view, None).map(|(image, _)| image);
        // The receiver is gone after a stop.
        let _ = send.send(image);
    });
    loop {
        match drawn.recv_timeout(Duration::from_millis(50)) {
            Ok(image) => {
                // Wait for the thread to release its reference to the scene.
                let _ = drawing.join();
                return image.map(Some);
            }
            Err(mpsc::RecvTimeoutError::Timeout) if !interrupt::requested() => {}
            Err(mpsc::RecvTimeoutError::Timeout) => return Ok(None),
            Err(mpsc::RecvTimeoutError::Disconnected) => {
                let why = "its thread ended without an image".to_string();
                return Err(Error::Invalid { what: "reference".to_string(), why });
            }
        }
    }
}
