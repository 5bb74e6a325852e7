//! What lives how long: device, plan, recording and textures end in any order, and notes of a loss keep nothing alive.

use std::any::Any;
use std::sync::Arc;

use volraster::gpu::GpuParts;
use volraster::scene::Field;
use volraster::technique::Renderer;
use volraster::{Error, GpuScene, RecordInfo, Recorded, TargetDesc, TargetMode};

use super::common::caller::{Caller, Signal};
use super::common::*;
use super::engine::{Engine, adopt, turn};
use super::{FORMAT, draw};

/// The caller's image, with a share of the device that it was made on.
struct Textures {
    frame: Caller,
    // Last: the image goes before the device.
    _engine: Arc<Engine>,
}

/// The parts of an engine, which the crate keeps a share of.
fn kept(engine: &Arc<Engine>) -> GpuParts {
    GpuParts { keep: Some(Arc::clone(engine) as _), ..engine.parts() }
}

/// All orders of four things.
fn orders() -> Vec<[usize; 4]> {
    let all = (0..256).map(|code| [code & 3, code >> 2 & 3, code >> 4 & 3, code >> 6]);
    all.filter(|order| (0..4).all(|place| order.contains(&place))).collect()
}

/// Device, plan, recording and textures are dropped in each of their 24 orders, with the recording completed or discarded: the layers
/// see everything destroyed once, before the device, and the device destroyed.
#[test]
fn every_order_of_drops_ends_clean() {
    let _turn = turn();
    let orders = orders();
    assert_eq!(orders.len(), 24);
    for (number, order) in orders.into_iter().enumerate() {
        let engine = Arc::new(Engine::full());
        let (log, alive) = (Arc::clone(&engine.log), Arc::downgrade(&engine));
        let gpu = adopt(kept(&engine)).unwrap();
        let scene = GpuScene::new(&gpu, scene(Field::Blobs, 8, "u8", &FOG));
        let view = view(perspective(), 1.0, 20, 16);
        let target = TargetDesc::caller(FORMAT, TargetMode::Clear);
        let mut plan = Renderer::new(&scene, technique("raycast")).prepare(&view, &target).unwrap();
        let textures = Arc::new(Textures {
            frame: Caller::new(&gpu, FORMAT, [20, 16], 16),
            _engine: Arc::clone(&engine),
        });
        let frame = &textures.frame;
        frame.begin([0.0; 4]);
        let (mut commands, image) = (frame.command_buffer(&gpu), frame.target(&gpu));
        let owner: Option<Arc<dyn Any + Send + Sync>> = Some(Arc::clone(&textures) as _);
        let info = RecordInfo { target: Some(&image), owner, ..RecordInfo::default() };
        let recorded = plan.record_with(&mut commands, info).unwrap();
        // A recording may have been submitted, or never.
        let submitted = number % 2 == 0;
        if submitted {
            frame.submit(&gpu, Signal::Fence);
            frame.wait();
        }
        let end = move |recorded: Recorded| {
            if submitted {
                assert!(recorded.completed().unwrap().complete);
            } else {
                recorded.discarded();
            }
        };
        let mut things: [Option<Box<dyn FnOnce()>>; 4] = [
            Some(Box::new(move || drop((gpu, scene, engine)))),
            Some(Box::new(move || drop(plan))),
            Some(Box::new(move || end(recorded))),
            Some(Box::new(move || drop(textures))),
        ];
        for (place, &thing) in order.iter().enumerate() {
            assert!(alive.upgrade().is_some(), "{order:?}: the device went before {place}");
            things[thing].take().unwrap()();
        }
        assert!(alive.upgrade().is_none(), "{order:?}: the device is left");
        assert_eq!(log.messages(), [""; 0], "{order:?}");
    }
}

/// A recording keeps what it is given until it is completed or discarded, and no longer.
#[test]
fn a_recording_keeps_its_owner_until_it_has_ended() {
    let _turn = turn();
    let engine = Engine::full();
    let gpu = engine.gpu();
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 8, "u8", &FOG));
    let (frame, target) =
        (Caller::new(&gpu, FORMAT, [20, 16], 16), TargetDesc::caller(FORMAT, TargetMode::Clear));
    let renderer = Renderer::new(&scene, technique("raycast"));
    let mut plan = renderer.prepare(&view(perspective(), 1.0, 20, 16), &target).unwrap();
    for complete in [true, false] {
        let owner = Arc::new(());
        frame.begin([0.0; 4]);
        let (mut commands, image) = (frame.command_buffer(&gpu), frame.target(&gpu));
        let info = |owner: &Arc<()>| RecordInfo {
            target: Some(&image),
            owner: Some(Arc::clone(owner) as _),
            ..RecordInfo::default()
        };
        let recorded = plan.record_with(&mut commands, info(&owner)).unwrap();
        // Refused, because the last one has not ended: what it was given is free again.
        let refused = plan.record_with(&mut commands, info(&owner));
        assert!(refused.unwrap_err().to_string().contains("not been completed"));
        assert_eq!(Arc::strong_count(&owner), 2);
        frame.end(&gpu);
        assert_eq!(Arc::strong_count(&owner), 2);
        if complete {
            assert!(recorded.completed().unwrap().complete);
        } else {
            recorded.discarded();
        }
        assert_eq!(Arc::strong_count(&owner), 1);
    }
    drop((plan, renderer, scene, frame, gpu));
    engine.end_silently();
}

/// A note of the loss, as a callback of the engine holds it, tells the crate and keeps neither it nor the device alive.
#[test]
fn a_note_of_the_loss_keeps_nothing_alive() {
    let _turn = turn();
    let engine = Arc::new(Engine::full());
    let (log, alive) = (Arc::clone(&engine.log), Arc::downgrade(&engine));
    let gpu = adopt(kept(&engine)).unwrap();
    drop(engine);
    let scene = GpuScene::new(&gpu, scene(Field::Blobs, 8, "u8", &FOG));
    let view = view(perspective(), 1.0, 20, 16);
    let target = TargetDesc::caller(FORMAT, TargetMode::Clear);
    let renderer = Renderer::new(&scene, technique("raycast"));
    let mut plan = renderer.prepare(&view, &target).unwrap();
    let frame = Caller::new(&gpu, FORMAT, [20, 16], 16);
    draw(&gpu, &mut plan, &frame);
    let note = gpu.loss_note();
    let lost = |gpu: &volraster::Gpu| (gpu.is_lost(), note.clone());
    assert!(!lost(&gpu).0);
    note.note();
    assert!(lost(&gpu).0);
    assert!(matches!(plan.set_view(&view), Err(Error::DeviceLost { .. })));
    assert!(matches!(renderer.prepare(&view, &target), Err(Error::DeviceLost { .. })));
    drop((plan, renderer, scene, frame, gpu));
    assert!(alive.upgrade().is_none(), "the note keeps the device");
    note.note();
    assert_eq!(log.messages(), [""; 0]);
}
