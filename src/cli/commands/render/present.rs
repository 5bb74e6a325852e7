//! Frames that are presented, for tools that capture what a program presents.

use volraster::gpu::GpuOptions;
use volraster::scene::View;
use volraster::technique::Frames;
use volraster::window::{Picture, Screen};
use volraster::{Error, Gpu, Result};

/// Where frames are presented.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Target {
    /// A surface that nothing shows. The driver must offer `VK_EXT_headless_surface`.
    Headless,
    /// A window of an X display.
    #[cfg(feature = "window")]
    Window,
}

impl Target {
    /// Asks a device for what presenting needs.
    pub(super) fn ask(self, options: &mut GpuOptions) {
        match self {
            Self::Headless => options.headless_surface = true,
            #[cfg(feature = "window")]
            Self::Window => options.window = true,
        }
    }
}

/// Presents frames where that is asked for.
pub(super) struct Presenter {
    screen: Option<Screen>,
    size: [u32; 2],
    background: [f64; 4],
    /// The connection to the display, while a window is open.
    #[cfg(feature = "window")]
    _events: Option<winit::event_loop::EventLoop<()>>,
}

impl Presenter {
    /// Takes the size and the background of frames; opens the target, if there is one, for a device that was asked for it.
    pub(super) fn new(gpu: &Gpu, target: Option<Target>, view: &View, background: [f64; 4]) -> Result<Self> {
        let size = view.extent();
        #[cfg(feature = "window")]
        if target == Some(Target::Window) {
            let (events, screen) = in_window(gpu, size)?;
            return Ok(Self { screen: Some(screen), size, background, _events: Some(events) });
        }
        let screen = target.map(|_| Screen::headless(gpu)).transpose()?;
        Ok(Self {
            screen,
            size,
            background,
            #[cfg(feature = "window")]
            _events: None,
        })
    }

    /// Presents the last frame over the background.
    pub(super) fn present(&mut self, frames: &Frames) -> Result<()> {
        let Some(screen) = &mut self.screen else { return Ok(()) };
        let picture = Picture { frames, corner: [0, 0], size: self.size, background: self.background };
        if screen.show(self.size, Some(&picture), &[])? {
            return Ok(());
        }
        let (what, missing) =
            ("--present".to_string(), "an image of the surface within a second".to_string());
        Err(Error::Unsupported { what, missing })
    }
}

/// Opens a window of the size of frames.
#[cfg(feature = "window")]
fn in_window(gpu: &Gpu, [width, height]: [u32; 2]) -> Result<(winit::event_loop::EventLoop<()>, Screen)> {
    use winit::dpi::PhysicalSize;
    use winit::event_loop::EventLoop;
    use winit::window::Window;

    let refused = |error: &dyn std::fmt::Display| Error::Unsupported {
        what: "--present window".to_string(),
        missing: format!("a window: {error}"),
    };
    let events = EventLoop::new().map_err(|error| refused(&error))?;
    let attributes = Window::default_attributes()
        .with_title("volraster")
        .with_inner_size(PhysicalSize::new(width, height))
        .with_resizable(false);
    #[expect(
        deprecated,
        reason = "nothing handles events: a window of X shows what is presented without that"
    )]
    let window = events.create_window(attributes).map_err(|error| refused(&error))?;
    let screen = Screen::new(gpu, std::sync::Arc::new(window))?;
    Ok((events, screen))
}
