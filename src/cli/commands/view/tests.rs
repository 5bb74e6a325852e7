//! Sessions on a device, without a window.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use clap::Parser as _;
use volraster::choice::Goal;
use volraster::gpu::{GpuOptions, Validation, ValidationLog};
use volraster::io::ReadOptions;
use volraster::scene::{Mode, Projection};
use volraster::{Gpu, GpuScene, Image, Renderer};

use super::pace::LEVELS;
use super::session::Session;
use crate::cli::input::{ArraysArgs, Input};

/// Serialises the tests: the validation layer keeps its devices in a table without a lock.
static TURN: Mutex<()> = Mutex::new(());

/// A session of a scene file in a folder of its own.
struct Test {
    session: Option<Session>,
    log: Arc<ValidationLog>,
    folder: PathBuf,
    _turn: MutexGuard<'static, ()>,
}

impl Test {
    fn new(name: &str, rest: &str) -> Self {
        let volume = r#""volume": {"field": "blobs", "dims": [24, 24, 24]}"#;
        Self::of(name, &format!("{volume}{rest}"), &[], None)
    }

    /// A scene with a raw file of `samples`, which stay in it where the device keeps pages, in a pool of so many bytes.
    fn of(name: &str, entries: &str, samples: &[u8], page_pool: Option<u64>) -> Self {
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        let folder = std::env::temp_dir().join(format!("volraster-view-{}-{name}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let json = format!(r#"{{"image": {{"width": 90, "height": 70}}, {entries}}}"#);
        std::fs::write(folder.join("scene.json"), json).unwrap();
        std::fs::write(folder.join("samples.raw"), samples).unwrap();
        let read = ReadOptions { on_demand: page_pool.map(|_| 0), ..ReadOptions::default() };
        let Input { scene, settings } = Input::load_within(&folder.join("scene.json"), None, &read).unwrap();
        let options = GpuOptions { validation: Validation::On, page_pool, ..GpuOptions::default() };
        let gpu = Gpu::new(&options).unwrap();
        let log = gpu.validation_log();
        let technique = settings.choose(None, &scene).unwrap();
        Self {
            session: Some(Session::new(GpuScene::new(&gpu, scene), &settings, technique, 100.0)),
            log,
            folder,
            _turn: turn,
        }
    }

    fn session(&mut self) -> &mut Session {
        self.session.as_mut().unwrap()
    }

    /// Steps until the picture is complete; returns the sizes that were drawn. Time passes at once.
    fn settle(&mut self) -> Vec<[u32; 2]> {
        let session = self.session();
        let mut sizes = Vec::new();
        let mut now = Instant::now();
        for _ in 0..LEVELS {
            if session.is_complete() {
                break;
            }
            if session.step(now).unwrap() > 0.0 {
                sizes.push(session.drawn_size());
            }
            now += Duration::from_secs(1);
        }
        session.step(now).unwrap();
        sizes
    }

    /// Waits for the work beside the pictures.
    fn wait(&mut self) {
        while self.session().is_busy() {
            std::thread::sleep(Duration::from_millis(5));
            self.session().step(Instant::now()).unwrap();
        }
    }

    /// What `render` writes as a picture of the present state, and what the session writes.
    fn pictures(&mut self) -> [Vec<u8>; 2] {
        let path = self.folder.join("picture.exr");
        let scene = GpuScene::new(&Gpu::headless().unwrap(), self.session().scene().clone());
        let (technique, view) = (*self.session().technique(), *self.session().view());
        let image = Renderer::new(&scene, technique).render(&view).unwrap();
        assert!(shows(&image));
        volraster::io::write_image(&path, &image, [0.0; 4]).unwrap();
        let rendered = std::fs::read(&path).unwrap();
        self.session().save_picture(&path).unwrap();
        [rendered, std::fs::read(&path).unwrap()]
    }
}

fn shows(image: &Image) -> bool {
    (0..image.height()).any(|y| (0..image.width()).any(|x| image.pixel(x, y)[3] > 0.1))
}

impl Drop for Test {
    fn drop(&mut self) {
        self.session = None;
        let _ = std::fs::remove_dir_all(&self.folder);
        if !std::thread::panicking() {
            assert_eq!(self.log.messages().len(), 0, "{:?}", self.log.messages());
        }
    }
}

#[test]
fn pictures_begin_coarse_and_end_as_those_of_render() {
    let mut test = Test::new("pictures", "");
    assert_eq!(test.settle(), [[23, 18], [45, 35], [90, 70]]);
    let [rendered, saved] = test.pictures();
    assert!(rendered == saved);
    // A picture that moves is not refined, and one that is still is drawn once.
    let session = test.session();
    session.pace.forget();
    session.turn([30.0, 10.0]);
    let now = Instant::now();
    assert!(session.step(now).unwrap() > 0.0);
    assert_eq!(session.drawn_size(), [23, 18]);
    assert_eq!(session.step(now).unwrap(), 0.0);
    assert!(session.due().unwrap() > now);
    session.pan([5.0, -3.0]);
    session.zoom(1.3);
    let transfer = session.scene().transfer.thickened(0.5).unwrap();
    session.set_transfer(transfer);
    test.settle();
    let [moved, saved] = test.pictures();
    assert!(moved == saved && moved != rendered);
    test.wait();
    let session = test.session();
    assert!(session.error.is_some() && session.due().is_none());
    let histogram = session.histogram.as_ref().unwrap();
    assert_eq!(histogram.counts.iter().sum::<u64>(), 24 * 24 * 24);
    // Another size, mode and technique; a picture is complete when it is saved.
    session.resize([0, 50]).unwrap();
    assert_eq!(session.view().extent(), [90, 70]);
    session.resize([64, 50]).unwrap();
    session.set_mode(Mode::from_name("maximum").unwrap()).unwrap();
    let [resized, saved] = test.pictures();
    assert!(resized == saved && test.session().is_complete());
}

/// Of a grid that stays in its file an overview is shown until its pages are drawn, one part a step; another camera begins with it again.
#[test]
fn an_overview_is_shown_until_all_parts_are_drawn() {
    const DIMS: [usize; 3] = [150, 70, 66];
    let wave = |i: usize, of: usize| {
        (9.0 * f64::from(u32::try_from(i).unwrap()) / f64::from(u32::try_from(of).unwrap())).sin()
    };
    let mut samples = Vec::new();
    for i in 0..DIMS.iter().product() {
        let [x, y, z] = [i % DIMS[0], i / DIMS[0] % DIMS[1], i / DIMS[0] / DIMS[1]];
        let value = wave(x, DIMS[0]) + wave(y, DIMS[1]) * wave(z, DIMS[2]);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 7 and 247")]
        samples.push((127.0 + 60.0 * value) as u8);
    }
    let entries = r#""volume": {"file": "samples.raw", "dims": [150, 70, 66], "type": "u8"}, "technique": {"name": "raycast", "filter": "exact"}"#;
    // Two pages of 16-bit samples, of twelve.
    let mut test = Test::of("parts", entries, &samples, Some(2 * (67 * 67 * 67 * 2 + 4)));
    for degrees in [0.0, 40.0] {
        let session = test.session();
        session.turn([degrees, 0.0]);
        let mut now = Instant::now();
        assert!(session.step(now).unwrap() > 0.0 && session.drawn_size()[0] < 90);
        assert!(session.picture().is_some());
        let mut parts = 0;
        while !session.is_complete() {
            now += Duration::from_secs(1);
            assert!(session.step(now).unwrap() > 0.0);
            parts += usize::from(session.drawn_size()[0] < 90);
        }
        assert!(parts > 3, "{parts} pictures before the complete one");
        let [rendered, saved] = test.pictures();
        assert!(rendered == saved);
    }
    test.wait();
    assert!(test.session().error.is_some());
}

#[test]
fn the_camera_follows_the_mouse_and_keeps_upright() {
    for projection in ["\"fov_y_deg\": 42", "\"half_height\": 1.6"] {
        let camera = format!(
            r#", "camera": {{"eye": [2, 1.5, 3.8], "target": [0, 0, 0], "up": [0, 1, 0], {projection}}}"#
        );
        let mut test = Test::new("camera", &camera);
        let session = test.session();
        let start = *session.view();
        session.pan([7.0, -4.0]);
        let (at, _) = session.view().project(start.camera().target).unwrap();
        assert!((at.x - 52.0).abs() < 1e-9 && (at.y - 31.0).abs() < 1e-9, "{at}");
        session.go_home();
        session.turn([40.0, 25.0]);
        let arm = |camera: &volraster::scene::Camera| camera.eye - camera.target;
        let eye = arm(session.view().camera());
        assert!((eye.length() - arm(start.camera()).length()).abs() < 1e-12);
        let height = |v: volraster::glam::DVec3| (v.y / v.length()).asin().to_degrees();
        assert!((height(eye) - height(arm(start.camera())) - 25.0).abs() < 1e-9);
        for (up, most) in [(500.0, 89.0), (-500.0, -89.0)] {
            session.turn([0.0, up]);
            assert!((height(arm(session.view().camera())) - most).abs() < 1e-6);
        }
        session.go_home();
        let size = |session: &Session| {
            let beside = start.camera().target + session.view().right();
            session.view().project(beside).unwrap().0.x - 45.0
        };
        let before = size(session);
        session.zoom(2.0);
        assert!((size(session) / before - 2.0).abs() < 1e-9);
        assert_eq!(
            session.view().is_perspective(),
            matches!(start.camera().projection, Projection::Perspective { .. })
        );
        // As near as numbers get, the camera stays one.
        (0..2000).for_each(|_| session.zoom(2.0));
        assert!(session.view().camera().eye.is_finite());
    }
}

#[test]
fn saved_scenes_draw_the_picture() {
    #[derive(clap::Parser)]
    struct Arrays {
        #[command(flatten)]
        arrays: ArraysArgs,
    }
    let mut test = Test::new(
        "scenes",
        r#", "mode": "lit", "technique": {"name": "slabs", "step": 0.7}, "clip": {"crop": {"high": [null, 0.4, null]}}"#,
    );
    test.session().turn([70.0, -20.0]);
    let transfer = test.session().scene().transfer.thickened(2.0).unwrap();
    test.session().set_transfer(transfer);
    let [rendered, saved] = test.pictures();
    assert!(rendered == saved);
    let (input, output) = (test.folder.join("scene.json"), test.folder.join("saved.json"));
    let arrays = Arrays::parse_from(["test"]).arrays;
    assert!(
        test.session().save_scene(&input, &input, &arrays).unwrap_err().to_string().contains("the input")
    );
    test.session().save_scene(&output, &input, &arrays).unwrap();
    let Input { scene, settings } = Input::load_within(&output, None, &ReadOptions::default()).unwrap();
    let technique = settings.choose(None, &scene).unwrap();
    assert_eq!(technique, *test.session().technique());
    let scene = GpuScene::new(&Gpu::headless().unwrap(), scene);
    let image = Renderer::new(&scene, technique).render(&settings.view).unwrap();
    let path = test.folder.join("again.exr");
    volraster::io::write_image(&path, &image, [0.0; 4]).unwrap();
    assert!(std::fs::read(&path).unwrap() == rendered);
}

#[test]
fn a_technique_is_chosen_beside_the_pictures() {
    let mut test = Test::new("choice", "");
    test.session().search(Goal::MaxError(1e-2));
    test.settle();
    test.wait();
    test.settle();
    test.wait();
    let session = test.session();
    assert!(!session.is_searching);
    let error = session.error.unwrap();
    assert!(error.rmse <= 1e-2, "{error:?}: {:?}", session.technique());
    session.search(Goal::MaxError(-1.0));
    let failed = loop {
        if let Err(error) = session.step(Instant::now()) {
            break error;
        }
    };
    assert!(failed.to_string().contains("largest error") && !session.is_searching, "{failed}");
}
