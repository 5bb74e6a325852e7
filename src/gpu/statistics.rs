//! Reports of pipelines: entries, constants and modules, build times, and the driver's statistics of the compiled shaders
//! (`VK_KHR_pipeline_executable_properties`).

use std::collections::BTreeSet;
use std::ffi::CStr;
use std::sync::Arc;

use ash::vk;

use super::device::Gpu;
use super::pipeline::{Pipeline, PipelineKey};
use super::shader::SPEC_NAMES;
use super::specialise::{constants_of, specialised};
use crate::error::{Error, Result};

/// A built pipeline.
#[derive(Clone, Debug)]
pub struct PipelineReport {
    /// Name: the technique and the pass that first used it.
    pub name: String,
    /// The shaders, a file of `glsl` and one of its entries each, such as `SLABS_COMPUTE`.
    pub entries: Vec<&'static str>,
    /// The specialisation constants that its shaders declare, by the names in `glsl`.
    pub constants: Vec<(&'static str, u32)>,
    /// Format of the colour attachment, and how it is blended; empty for compute.
    pub target: String,
    /// Milliseconds that the driver took to build it.
    pub build_ms: f64,
    /// Statistics of each shader by the driver's compiler, on a device opened with
    /// [`GpuOptions::shader_statistics`](super::GpuOptions::shader_statistics).
    pub shaders: Vec<ShaderStatistics>,
    key: PipelineKey,
}

impl PipelineReport {
    /// Returns the SPIR-V of each entry, with the constants applied: the modules have no specialisation constants left.
    #[must_use]
    pub fn modules(&self) -> Vec<Vec<u32>> {
        let key = &self.key;
        key.shaders.iter().map(|shader| specialised(&key.words(shader), &key.constants)).collect()
    }
}

/// The statistics that a driver's compiler gives of one shader of a pipeline.
#[derive(Clone, Debug)]
pub struct ShaderStatistics {
    /// The driver's name of the shader, such as `Compute Shader`.
    pub shader: String,
    /// Invocations of a subgroup; 0 where the driver does not tell.
    pub subgroup_size: u32,
    /// Names and values, as the driver gives them.
    pub values: Vec<(String, f64)>,
}

/// Checks that a device keeps statistics.
///
/// # Errors
///
/// [`Error::Unsupported`] where it does not.
///
/// # Safety
///
/// `physical` belongs to `instance` and supports Vulkan 1.1.
pub(super) unsafe fn check(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Result<()> {
    let mut offered = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut offered);
    // SAFETY: `physical` belongs to `instance`; drivers ignore structures of extensions that they do not know.
    unsafe { instance.get_physical_device_features2(physical, &mut features) };
    if offered.pipeline_executable_info == vk::TRUE {
        return Ok(());
    }
    Err(Error::unsupported("statistics of shaders", "VK_KHR_pipeline_executable_properties"))
}

impl Gpu {
    /// Builds every pipeline that another device has built, with the same constants. The device draws nothing for that.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`] when a call fails.
    pub fn compile_pipelines_of(&self, other: &Self) -> Result<()> {
        let theirs: Vec<_> = other.pipeline_table().values().cloned().collect();
        let own = theirs.iter().map(|made| self.pipeline(&made.name, made.key.clone()));
        self.build(own.collect::<Result<Vec<_>>>()?.iter())
    }

    /// Returns reports of all pipelines built so far, by name and constants.
    ///
    /// # Errors
    ///
    /// [`Error::Vulkan`] when a call fails.
    pub fn pipeline_reports(&self) -> Result<Vec<PipelineReport>> {
        let table = self.pipeline_table();
        let mut pipelines: Vec<_> = table.values().filter(|made| made.is_built()).collect();
        let names = |made: &Pipeline| made.key.shaders.iter().map(|shader| shader.name).collect::<Vec<_>>();
        pipelines.sort_by_key(|made| (made.name.clone(), names(made), made.key.constants.clone()));
        let report = |made: &&Arc<Pipeline>| {
            let words = made.key.shaders.iter().map(|shader| made.key.words(shader));
            let declared: BTreeSet<u32> = words.flat_map(|words| constants_of(&words)).collect();
            let value = |number: u32| {
                let given = made.key.constants.iter().find(|(other, _)| *other == number);
                let name = SPEC_NAMES.iter().find(|(other, _)| *other == number);
                Some((name?.1, given?.1))
            };
            Ok(PipelineReport {
                name: made.name.clone(),
                entries: names(made),
                constants: declared.into_iter().filter_map(value).collect(),
                target: made.key.state.map_or_else(String::new, |state| {
                    state
                        .format
                        .map_or_else(|| "none".to_string(), |format| format!("{format:?} {:?}", state.blend))
                }),
                build_ms: made.build_time.get().map_or(0.0, |time| time.as_secs_f64() * 1e3),
                shaders: self.statistics_of(made)?,
                key: made.key.clone(),
            })
        };
        pipelines.iter().map(report).collect()
    }

    /// Returns the statistics of a pipeline's shaders, if the device keeps them.
    fn statistics_of(&self, pipeline: &Pipeline) -> Result<Vec<ShaderStatistics>> {
        let Some(functions) = &self.inner.statistics else { return Ok(Vec::new()) };
        let info = vk::PipelineInfoKHR::default().pipeline(pipeline.raw());
        // SAFETY: the pipeline is alive and was made with the flag for statistics.
        let executables = unsafe { functions.get_pipeline_executable_properties(&info) }
            .map_err(|result| self.failed("vkGetPipelineExecutablePropertiesKHR", result))?;
        let shader = |(index, executable): (u32, &vk::PipelineExecutablePropertiesKHR<'_>)| {
            let info =
                vk::PipelineExecutableInfoKHR::default().pipeline(pipeline.raw()).executable_index(index);
            // SAFETY: as above; the pipeline has an executable of this index.
            let found = unsafe { functions.get_pipeline_executable_statistics(&info) }
                .map_err(|result| self.failed("vkGetPipelineExecutableStatisticsKHR", result))?;
            Ok(ShaderStatistics {
                shader: text(executable.name_as_c_str()),
                subgroup_size: executable.subgroup_size,
                values: found.iter().map(|one| (text(one.name_as_c_str()), value(one))).collect(),
            })
        };
        (0..).zip(&executables).map(shader).collect()
    }
}

fn text(name: std::result::Result<&CStr, std::ffi::FromBytesUntilNulError>) -> String {
    name.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

/// Returns the number of a statistic, of whichever type it is.
fn value(statistic: &vk::PipelineExecutableStatisticKHR<'_>) -> f64 {
    use vk::PipelineExecutableStatisticFormatKHR as Format;
    let value = &statistic.value;
    match statistic.format {
        // SAFETY: the format tells which field of the union is set.
        Format::BOOL32 => f64::from(unsafe { value.b32 }),
        // SAFETY: as above; no count is negative.
        Format::INT64 | Format::UINT64 => crate::num::f64_of_u64(unsafe { value.u64 }),
        // SAFETY: as above.
        _ => unsafe { value.f64 },
    }
}
