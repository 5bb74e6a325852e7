//! Statistics of compiled shaders, such as registers and spills (`VK_KHR_pipeline_executable_properties`).

use std::ffi::CStr;

use ash::vk;

use super::device::Gpu;
use crate::error::{Error, Result};

/// The statistics that a driver's compiler gives of one shader of a pipeline.
#[derive(Clone, Debug)]
pub struct ShaderStatistics {
    /// Name of the pipeline: the technique and the pass that first used it.
    pub pipeline: String,
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

    /// Returns statistics of the shaders of all pipelines so far, by name.
    ///
    /// # Errors
    ///
    /// [`Error::Invalid`] for a device that was opened without [`GpuOptions::shader_statistics`](super::GpuOptions), and
    /// [`Error::Vulkan`] when a call fails.
    pub fn shader_statistics(&self) -> Result<Vec<ShaderStatistics>> {
        let Some(functions) = &self.inner.statistics else {
            return Err(Error::invalid("statistics of shaders", "the device was opened without them"));
        };
        let mut all = Vec::new();
        let table = self.pipeline_table();
        let mut pipelines: Vec<_> = table.values().filter(|made| made.is_built()).collect();
        pipelines.sort_by_key(|made| (made.name.clone(), made.key.constants.clone()));
        for pipeline in pipelines {
            let info = vk::PipelineInfoKHR::default().pipeline(pipeline.raw());
            // SAFETY: the pipeline is alive and was made with the flag for statistics.
            let executables = unsafe { functions.get_pipeline_executable_properties(&info) }
                .map_err(|result| self.failed("vkGetPipelineExecutablePropertiesKHR", result))?;
            for (index, executable) in (0_u32..).zip(&executables) {
                let info =
                    vk::PipelineExecutableInfoKHR::default().pipeline(pipeline.raw()).executable_index(index);
                // SAFETY: as above; the pipeline has an executable of this index.
                let found = unsafe { functions.get_pipeline_executable_statistics(&info) }
                    .map_err(|result| self.failed("vkGetPipelineExecutableStatisticsKHR", result))?;
                all.push(ShaderStatistics {
                    pipeline: pipeline.name.clone(),
                    shader: text(executable.name_as_c_str()),
                    subgroup_size: executable.subgroup_size,
                    values: found.iter().map(|one| (text(one.name_as_c_str()), value(one))).collect(),
                });
            }
        }
        Ok(all)
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
