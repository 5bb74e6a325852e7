//! The steps of a recording as data: named passes with the resources that they use. Barriers, timestamps, the number of passes and
//! the recording itself follow from the list, and it can be printed.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use ash::vk;
use ash::vk::Handle as _;

use super::buffer::Buffer;
use super::descriptors::Descriptors;
use super::external::TargetImage;
use super::image::{Image, format_bytes};
use super::inputs::Resource;
use super::pipeline::Pipeline;
use super::sync::{Key, Use};

/// A resource that a step uses.
#[derive(Clone, Debug)]
pub(crate) enum Used {
    Buffer(Arc<Buffer>),
    Image(Arc<Image>),
    /// The colour image of the caller.
    Target(TargetImage),
}

impl Used {
    /// Returns the name of the resource.
    pub(crate) fn name(&self) -> &str {
        match self {
            Self::Buffer(buffer) => &buffer.name,
            Self::Image(image) => &image.name,
            Self::Target(_) => "target",
        }
    }

    /// Returns the bytes of its contents.
    fn bytes(&self) -> u64 {
        match self {
            Self::Buffer(buffer) => buffer.size(),
            Self::Image(image) => image.desc().texel_bytes(),
            Self::Target(target) => {
                target.extent.map(u64::from).iter().product::<u64>() * format_bytes(target.format)
            }
        }
    }

    pub(crate) fn key(&self) -> Key {
        match self {
            Self::Buffer(buffer) => (false, buffer.raw.as_raw()),
            Self::Image(image) => (true, image.raw.as_raw()),
            Self::Target(target) => (true, target.image.as_raw()),
        }
    }
}

/// The target of a raster pass.
#[derive(Clone, Debug)]
pub(crate) enum Attachment {
    /// An image of this crate.
    Own(Arc<Image>),
    /// An image of the caller.
    Caller(TargetImage),
}

impl Attachment {
    pub(super) fn view(&self) -> vk::ImageView {
        match self {
            Self::Own(image) => image.view,
            Self::Caller(target) => target.view,
        }
    }

    pub(super) fn extent(&self) -> [u32; 2] {
        match self {
            Self::Own(image) => [image.desc().extent[0], image.desc().extent[1]],
            Self::Caller(target) => target.extent,
        }
    }

    /// Returns the first pixel that is drawn.
    pub(super) fn corner(&self) -> [u32; 2] {
        match self {
            Self::Own(_) => [0; 2],
            Self::Caller(target) => target.corner,
        }
    }
}

/// The workgroups of a dispatch.
#[derive(Clone, Debug)]
pub(crate) enum Groups {
    /// As many in each dimension.
    Fixed([u32; 3]),
    /// As many as the first three words of a buffer say, which the device has written.
    Counted(Arc<Buffer>),
}

impl From<[u32; 3]> for Groups {
    fn from(groups: [u32; 3]) -> Self {
        Self::Fixed(groups)
    }
}

/// The work of a step.
#[derive(Clone, Debug)]
pub(crate) enum Work {
    /// One dispatch.
    Dispatch { pipeline: Arc<Pipeline>, descriptors: Arc<Descriptors>, push: Vec<u8>, groups: Groups },
    /// One draw into the whole of an attachment; or draws without an attachment, one for each of `pushes`: shaders write bound
    /// resources, and each draw sees the writes of the one before.
    Draw {
        pipeline: Arc<Pipeline>,
        descriptors: Arc<Descriptors>,
        pushes: Vec<Vec<u8>>,
        /// The colour attachment, and whether it is cleared to transparent black first.
        target: Option<(Attachment, bool)>,
        extent: [u32; 2],
        vertices: u32,
        instances: u32,
    },
    /// Fills the first bytes of a buffer with zeros, or (`WHOLE_SIZE`) all of it.
    ClearBuffer(Arc<Buffer>, u64),
    /// Fills an image with one colour.
    ClearImage(Arc<Image>, [f32; 4]),
    /// Copies parts of a buffer to another: each from an offset to an offset, so many bytes.
    CopyBuffer { from: Arc<Buffer>, to: Arc<Buffer>, parts: Vec<[u64; 3]> },
    /// Copies a whole image to the start of a buffer.
    CopyImageToBuffer { image: Arc<Image>, buffer: Arc<Buffer> },
    /// Copies the start of a buffer to planes or layers `[first, count]` of a mip level of an image.
    CopyBufferToImage { buffer: Arc<Buffer>, image: Arc<Image>, level: u32, planes: [u32; 2] },
    /// Copies parts of a buffer, from these offsets on, to cubes of a volume, or of layers of an array, with a side and these corners.
    CopyBufferToCubes { buffer: Arc<Buffer>, image: Arc<Image>, side: u32, cubes: Vec<(u64, [u32; 3])> },
    /// Only makes the resources ready for their uses, also for later recordings. This is no pass.
    Leave,
    /// Only says how an earlier submission to the same queue has used a resource last. This is no pass.
    Inherit(Used, Use),
}

impl Work {
    /// Returns the number of dispatches and draws.
    pub(crate) fn draws(&self) -> u32 {
        match self {
            Self::Dispatch { .. } => 1,
            Self::Draw { pushes, .. } => crate::num::count(pushes.len()),
            _ => 0,
        }
    }

    /// Returns the pipeline of a dispatch or draw.
    pub(crate) fn pipeline(&self) -> Option<&Arc<Pipeline>> {
        match self {
            Self::Dispatch { pipeline, .. } | Self::Draw { pipeline, .. } => Some(pipeline),
            _ => None,
        }
    }

    /// Returns the resources with their uses, in the order of their barriers.
    fn uses(&self) -> Vec<(Used, Use)> {
        let buffer = |buffer: &Arc<Buffer>, usage| (Used::Buffer(Arc::clone(buffer)), usage);
        let image = |image: &Arc<Image>, usage| (Used::Image(Arc::clone(image)), usage);
        match self {
            Self::Dispatch { descriptors, groups, .. } => {
                let mut uses = bound(descriptors, true);
                if let Groups::Counted(words) = groups {
                    uses.push(buffer(words, Use::Indirect));
                }
                uses
            }
            Self::Draw { descriptors, target, .. } => {
                let mut uses = bound(descriptors, false);
                uses.extend(target.as_ref().map(|(target, _)| match target {
                    Attachment::Own(own) => image(own, Use::ColorAttachment),
                    Attachment::Caller(target) => (Used::Target(*target), Use::ColorAttachment),
                }));
                uses
            }
            Self::ClearBuffer(cleared, _) => vec![buffer(cleared, Use::TransferWrite)],
            Self::ClearImage(cleared, _) => vec![image(cleared, Use::TransferWrite)],
            Self::CopyBuffer { from, to, .. } => {
                vec![buffer(from, Use::TransferRead), buffer(to, Use::TransferWrite)]
            }
            Self::CopyImageToBuffer { image: from, buffer: to } => {
                vec![image(from, Use::TransferRead), buffer(to, Use::TransferWrite)]
            }
            Self::CopyBufferToImage { buffer: from, image: to, .. }
            | Self::CopyBufferToCubes { buffer: from, image: to, .. } => {
                vec![buffer(from, Use::TransferRead), image(to, Use::TransferWrite)]
            }
            Self::Leave | Self::Inherit(..) => Vec::new(),
        }
    }
}

/// A step of a recording.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) name: String,
    pub(crate) work: Work,
    /// Resources with their uses, in the order of their barriers.
    pub(crate) uses: Vec<(Used, Use)>,
}

impl Step {
    /// Name of a buffer that is bound where a variant of a shader leaves it alone; steps do not show it.
    pub(crate) const STAND_IN: &str = "stand-in";

    pub(super) fn new(name: &str, work: Work) -> Self {
        Self { name: name.to_string(), uses: work.uses(), work }
    }

    /// Returns whether the step only makes resources ready for later.
    pub(crate) fn leaves(&self) -> bool {
        matches!(self.work, Work::Leave)
    }

    /// Returns the bytes of the resources that the step reads, and of those that it writes or may write.
    pub(crate) fn bytes(&self) -> [u64; 2] {
        let mut resources = BTreeMap::new();
        for (used, usage) in self.uses.iter().filter(|(used, _)| used.name() != Self::STAND_IN) {
            resources.entry(used.key()).or_insert([used.bytes(), 0])[1] |= u64::from(usage.writes());
        }
        let sum = |writes| resources.values().filter(|of| of[1] == writes).map(|of| of[0]).sum();
        match self.work {
            Work::ClearBuffer(_, bytes) if bytes != vk::WHOLE_SIZE => [0, bytes],
            Work::CopyBuffer { ref parts, .. } => [parts.iter().map(|part| part[2]).sum(); 2],
            _ => [sum(0), sum(1)],
        }
    }

    /// Returns whether the step must not run beside another one: they share a resource, and not both read it in the same way.
    pub(super) fn meets(&self, other: &Self) -> bool {
        let meet = |(used, usage): &(Used, Use), (of_other, other): &(Used, Use)| {
            used.key() == of_other.key() && (usage != other || usage.writes())
        };
        self.uses.iter().any(|own| other.uses.iter().any(|others| meet(own, others)))
    }

    /// Returns whether the step is a pass, which has a timestamp.
    pub(crate) fn is_pass(&self) -> bool {
        !matches!(self.work, Work::Leave | Work::Inherit(..))
    }
}

/// Returns the resources of a descriptor set with their uses by a compute or a graphics pipeline.
fn bound(descriptors: &Descriptors, compute: bool) -> Vec<(Used, Use)> {
    let used = |(_, resource): &(u32, Resource)| {
        let by = |in_compute, in_graphics| if compute { in_compute } else { in_graphics };
        let read_write = by(Use::ComputeReadWrite, Use::FragmentReadWrite);
        Some(match resource {
            Resource::Read(read) => (Used::Buffer(Arc::clone(read)), by(Use::ComputeRead, Use::FragmentRead)),
            Resource::Write(written) => (Used::Buffer(Arc::clone(written)), read_write),
            Resource::Sampled(image, _) => {
                (Used::Image(Arc::clone(image)), by(Use::ComputeSample, Use::FragmentSample))
            }
            Resource::Stored(image) => (Used::Image(Arc::clone(image)), read_write),
            // The caller promises that it is ready.
            Resource::External => return None,
        })
    };
    descriptors.resources.iter().filter_map(used).collect()
}

/// Shows a step in one line: its name, its work, and the resources that it reads and writes.
impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let work = match &self.work {
            Work::Dispatch { .. } => "dispatch",
            Work::Draw { target, .. } => target.as_ref().map_or("draws", |_| "draw"),
            Work::ClearBuffer(..) | Work::ClearImage(..) => "clear",
            Work::CopyBuffer { .. }
            | Work::CopyImageToBuffer { .. }
            | Work::CopyBufferToImage { .. }
            | Work::CopyBufferToCubes { .. } => "copy",
            Work::Leave => "leave",
            Work::Inherit(..) => "from an earlier frame",
        };
        write!(f, "{}: {work}", self.name)?;
        for (what, writes) in [("reads", false), ("writes", true)] {
            let uses = self.uses.iter().filter(|(_, usage)| usage.writes() == writes);
            let mut names: Vec<&str> = uses.map(|(used, _)| used.name()).collect();
            names.retain(|name| *name != Self::STAND_IN);
            names.sort_unstable();
            names.dedup();
            if !names.is_empty() {
                write!(f, "; {what} {}", names.join(", "))?;
            }
        }
        Ok(())
    }
}
