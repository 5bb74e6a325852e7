//! Uses of resources, and the barriers between them. Stages and access masks appear only in this file.

use std::collections::HashMap;

use ash::vk;

use vk::{AccessFlags2 as Access, ImageLayout as Layout, PipelineStageFlags2 as Stage};

/// Stage of timestamps: all earlier work has ended.
pub(crate) const END_OF_ALL: Stage = Stage::ALL_COMMANDS;

/// Vertex and fragment shader stages.
const GRAPHICS: Stage = Stage::from_raw(Stage::VERTEX_SHADER.as_raw() | Stage::FRAGMENT_SHADER.as_raw());

/// The use of a resource by a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Use {
    /// It is the source of a copy.
    TransferRead,
    /// It is the destination of a copy or a fill.
    TransferWrite,
    /// The host reads it after the submission has ended.
    HostRead,
    /// A fragment shader samples it.
    FragmentSample,
    /// A vertex or fragment shader reads it as a uniform or storage buffer.
    FragmentRead,
    /// A fragment shader writes, and perhaps reads, it as a storage buffer or image.
    FragmentReadWrite,
    /// A dispatch reads the number of its workgroups from it.
    Indirect,
    /// A compute shader samples it.
    ComputeSample,
    /// A compute shader reads it as a uniform or storage buffer.
    ComputeRead,
    /// A compute shader writes, and perhaps reads, it as a storage buffer or image.
    ComputeReadWrite,
    /// It is the colour attachment, written and blended with.
    ColorAttachment,
    /// Any later shader samples or reads it.
    AnyShaderRead,
    /// The window's system has handed it over; its contents are undefined.
    #[cfg(feature = "cli")]
    Acquired,
    /// The window's system shows it.
    #[cfg(feature = "cli")]
    Presented,
}

impl Use {
    /// Returns the stages, the accesses, and for images the layout.
    fn masks(self) -> (Stage, Access, Layout) {
        use Layout as L;
        let (compute, shader) = (Stage::COMPUTE_SHADER, L::SHADER_READ_ONLY_OPTIMAL);
        let read = Access::UNIFORM_READ | Access::SHADER_STORAGE_READ;
        let read_write = Access::SHADER_STORAGE_READ | Access::SHADER_STORAGE_WRITE;
        let blended = Access::COLOR_ATTACHMENT_READ | Access::COLOR_ATTACHMENT_WRITE;
        match self {
            Self::TransferRead => (Stage::COPY, Access::TRANSFER_READ, L::TRANSFER_SRC_OPTIMAL),
            Self::TransferWrite => (Stage::ALL_TRANSFER, Access::TRANSFER_WRITE, L::TRANSFER_DST_OPTIMAL),
            Self::HostRead => (Stage::HOST, Access::HOST_READ, L::GENERAL),
            Self::FragmentSample => (Stage::FRAGMENT_SHADER, Access::SHADER_SAMPLED_READ, shader),
            Self::FragmentRead => (GRAPHICS, read, L::UNDEFINED),
            Self::FragmentReadWrite => (GRAPHICS, read_write, L::GENERAL),
            Self::Indirect => (Stage::DRAW_INDIRECT, Access::INDIRECT_COMMAND_READ, L::UNDEFINED),
            Self::ComputeSample => (compute, Access::SHADER_SAMPLED_READ, shader),
            Self::ComputeRead => (compute, read, L::UNDEFINED),
            Self::ComputeReadWrite => (compute, read_write, L::GENERAL),
            Self::ColorAttachment => (Stage::COLOR_ATTACHMENT_OUTPUT, blended, L::COLOR_ATTACHMENT_OPTIMAL),
            Self::AnyShaderRead => (Stage::ALL_COMMANDS, Access::SHADER_READ | Access::UNIFORM_READ, shader),
            // The host waits for a fence before it submits, and for the submission before it presents.
            #[cfg(feature = "cli")]
            Self::Acquired => (Stage::COLOR_ATTACHMENT_OUTPUT, Access::NONE, L::UNDEFINED),
            #[cfg(feature = "cli")]
            Self::Presented => (Stage::COLOR_ATTACHMENT_OUTPUT, Access::NONE, L::PRESENT_SRC_KHR),
        }
    }

    /// Returns whether the use samples an image.
    pub(crate) fn samples(self) -> bool {
        matches!(self, Self::FragmentSample | Self::ComputeSample)
    }

    /// Returns whether the use writes.
    pub(crate) fn writes(self) -> bool {
        matches!(
            self,
            Self::TransferWrite | Self::FragmentReadWrite | Self::ComputeReadWrite | Self::ColorAttachment
        )
    }
}

/// A barrier between two uses of one resource. Layouts apply to images only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Barrier {
    pub(crate) src_stage: Stage,
    pub(crate) src_access: Access,
    pub(crate) dst_stage: Stage,
    pub(crate) dst_access: Access,
    pub(crate) old_layout: Layout,
    pub(crate) new_layout: Layout,
}

impl Barrier {
    /// Returns the barriers before and after a clear of an image whose contents this one discards; `None` where it keeps them.
    pub(crate) fn around_clear(&self) -> Option<[Self; 2]> {
        let (stage, access, layout) = Use::TransferWrite.masks();
        let before = Self { dst_stage: stage, dst_access: access, new_layout: layout, ..*self };
        let after = Self { src_stage: stage, src_access: access, old_layout: layout, ..*self };
        (self.old_layout == Layout::UNDEFINED).then_some([before, after])
    }
}

/// A resource: the kind of its handle, image or not, and the handle. Handles of different kinds may be equal.
pub(crate) type Key = (bool, u64);

/// The uses of one resource in one recording so far.
#[derive(Clone, Copy, Debug, Default)]
struct History {
    /// Stage and access of the last write; empty if this recording has not written it.
    write: (Stage, Access),
    /// Stages that have read it since.
    readers: Stage,
    /// Stages and accesses to which the last write is visible.
    visible: (Stage, Access),
    layout: Layout,
}

/// Derives barriers from uses within one recording: a read after a read needs none; a write before or after and a change of
/// layout need one.
#[derive(Debug, Default)]
pub(crate) struct Tracker {
    histories: HashMap<Key, History>,
}

impl Tracker {
    /// Declares the layout of an image when the recording begins, unless it was used or declared before. The contents of an
    /// undeclared image are undefined.
    pub(crate) fn begin(&mut self, image: Key, layout: Layout) {
        self.histories.entry(image).or_insert(History { layout, ..History::default() });
    }

    /// Declares the last use of a resource by an earlier submission to the same queue.
    pub(crate) fn begin_after(&mut self, (is_image, handle): Key, last: Use) {
        let (stage, access, layout) = last.masks();
        let layout = if is_image { layout } else { Layout::UNDEFINED };
        let history = History { write: (stage, access), layout, ..History::default() };
        self.histories.insert((is_image, handle), history);
    }

    /// Returns the barrier that must precede this use, if any.
    pub(crate) fn next(&mut self, (is_image, handle): Key, next: Use) -> Option<Barrier> {
        let (stage, access, layout) = next.masks();
        let layout = if is_image { layout } else { Layout::UNDEFINED };
        // Uniform reads apply to buffers only.
        let access = if is_image { access & !Access::UNIFORM_READ } else { access };
        let history = self.histories.entry((is_image, handle)).or_default();
        let changes_layout = is_image && history.layout != layout;
        let unseen = history.write.0 != Stage::NONE
            && !(history.visible.0.contains(stage) && history.visible.1.contains(access));
        let after_read = next.writes() && history.readers != Stage::NONE;
        let barrier = (changes_layout || unseen || after_read).then_some(Barrier {
            src_stage: history.write.0 | history.readers,
            src_access: history.write.1,
            dst_stage: stage,
            dst_access: access,
            old_layout: history.layout,
            new_layout: layout,
        });
        history.layout = layout;
        if next.writes() || changes_layout {
            // A layout transition is a write, too: later uses in other stages must wait for it.
            history.write = (stage, if next.writes() { access } else { Access::NONE });
            history.readers = if next.writes() { Stage::NONE } else { stage };
            history.visible = if next.writes() { Default::default() } else { (stage, access) };
        } else {
            history.readers |= stage;
            if unseen {
                history.visible.0 |= stage;
                history.visible.1 |= access;
            }
        }
        barrier
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const USES: [Use; 12] = [
        Use::TransferRead,
        Use::TransferWrite,
        Use::HostRead,
        Use::FragmentSample,
        Use::FragmentRead,
        Use::FragmentReadWrite,
        Use::Indirect,
        Use::ComputeSample,
        Use::ComputeRead,
        Use::ComputeReadWrite,
        Use::ColorAttachment,
        Use::AnyShaderRead,
    ];

    #[test]
    fn every_use_has_stage_and_access_and_writes_match_the_masks() {
        let writing = Access::TRANSFER_WRITE | Access::SHADER_STORAGE_WRITE | Access::COLOR_ATTACHMENT_WRITE;
        for each in USES {
            let (stage, access, _) = each.masks();
            assert!(!stage.is_empty() && !access.is_empty(), "{each:?}");
            assert_eq!(access.intersects(writing), each.writes(), "{each:?}");
        }
    }

    #[test]
    fn read_after_read_is_nothing_and_write_after_read_waits() {
        let mut tracker = Tracker::default();
        tracker.begin((true, 1), Layout::SHADER_READ_ONLY_OPTIMAL);
        assert_eq!(tracker.next((true, 1), Use::FragmentSample), None);
        assert_eq!(tracker.next((true, 1), Use::ComputeSample), None);
        let barrier = tracker.next((true, 1), Use::TransferWrite).unwrap();
        assert_eq!(barrier.src_stage, Stage::FRAGMENT_SHADER | Stage::COMPUTE_SHADER);
        assert_eq!(barrier.src_access, Access::NONE);
        assert_eq!(barrier.old_layout, Layout::SHADER_READ_ONLY_OPTIMAL);
        assert_eq!(barrier.new_layout, Layout::TRANSFER_DST_OPTIMAL);
    }

    #[test]
    fn a_write_waits_for_reads_of_what_nobody_wrote() {
        let mut tracker = Tracker::default();
        assert!(tracker.next((false, 4), Use::FragmentRead).is_none());
        let barrier = tracker.next((false, 4), Use::ComputeReadWrite).unwrap();
        assert_eq!((barrier.src_stage, barrier.src_access), (GRAPHICS, Access::NONE));
    }

    #[test]
    fn a_write_is_made_visible_to_each_reader_once() {
        let mut tracker = Tracker::default();
        assert!(tracker.next((false, 7), Use::ComputeReadWrite).is_none());
        let barrier = tracker.next((false, 7), Use::FragmentRead).unwrap();
        assert_eq!(barrier.src_access, Access::SHADER_STORAGE_READ | Access::SHADER_STORAGE_WRITE);
        assert_eq!(tracker.next((false, 7), Use::FragmentRead), None);
        assert!(tracker.next((false, 7), Use::TransferRead).is_some());
        let barrier = tracker.next((false, 7), Use::ComputeReadWrite).unwrap();
        assert!(barrier.src_stage.contains(Stage::FRAGMENT_SHADER | Stage::COPY));
        // Write after write.
        assert!(tracker.next((false, 7), Use::ComputeReadWrite).is_some());
    }

    #[test]
    fn the_first_use_of_an_image_leaves_the_undefined_layout() {
        let mut tracker = Tracker::default();
        let barrier = tracker.next((true, 3), Use::ColorAttachment).unwrap();
        assert_eq!((barrier.old_layout, barrier.src_stage), (Layout::UNDEFINED, Stage::NONE));
        // Blending must wait for the writes of the pass before.
        assert!(tracker.next((true, 3), Use::ColorAttachment).is_some());
    }

    #[test]
    fn what_an_earlier_recording_wrote_is_made_visible() {
        let mut tracker = Tracker::default();
        tracker.begin_after((true, 1), Use::ComputeReadWrite);
        let barrier = tracker.next((true, 1), Use::TransferRead).unwrap();
        assert_eq!((barrier.src_stage, barrier.old_layout), (Stage::COMPUTE_SHADER, Layout::GENERAL));
        assert!(barrier.src_access.contains(Access::SHADER_STORAGE_WRITE));
        // A buffer of the same handle is another resource.
        assert!(tracker.next((false, 1), Use::TransferRead).is_none());
        tracker.begin_after((false, 2), Use::ComputeReadWrite);
        let barrier = tracker.next((false, 2), Use::TransferRead).unwrap();
        assert_eq!((barrier.src_stage, barrier.dst_stage), (Stage::COMPUTE_SHADER, Stage::COPY));
    }

    #[test]
    fn a_reader_after_a_layout_change_waits_for_the_change() {
        let mut tracker = Tracker::default();
        tracker.begin((true, 1), Layout::GENERAL);
        assert!(tracker.next((true, 1), Use::FragmentSample).is_some());
        let barrier = tracker.next((true, 1), Use::ComputeSample).unwrap();
        assert_eq!(barrier.src_stage, Stage::FRAGMENT_SHADER);
    }
}
