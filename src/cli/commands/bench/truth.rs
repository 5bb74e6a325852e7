//! Truth.

use std::sync::{Arc, mpsc};
use std::time::Duration;

use volraster::reference::ReferenceImage;
use volraster::scene::View;
use volraster::{Error, GpuScene, Result};

use crate::cli::cache::Cache;
use crate::cli::interrupt;

/// The reference of a view; `None` when it is to stop, which long drawing is not waited for.
pub(super) fn truth(scene: &Arc<GpuScene>, view: &View, cache: &Cache) -> Result<Option<ReferenceImage>> {
    let (send, drawn) = mpsc::channel();
    let (scene, view, cache) = (Arc::clone(scene), *view, cache.clone());
    let drawing = std::thread::spawn(move || {
        let image = cache.image(scene.scene(), &view, None).map(|(image, _)| image);
        // Whoever does not wait has stopped.
        let _ = send.send(image);
    });
    loop {
        match drawn.recv_timeout(Duration::from_millis(50)) {
            Ok(image) => {
                // It has sent, and ends: the scene is nobody else's again.
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
