//! What a device holds of a scene, read back for those that look into it.

use bytemuck::{Pod, Zeroable};
use hdtrapeze_shaders::layout::Object;

use super::{Device, GpuError, GpuScene};

/// The arrays of a page, as `slabs.wgsl` and `layout.wgsl` have them.
#[derive(Clone, Debug)]
pub struct Contents {
    /// Nodes and blocks.
    pub nodes: Vec<[u32; 4]>,
    /// Vertices.
    pub vertices: Vec<f32>,
    /// Grids, key times and frames.
    pub words: Vec<u32>,
    /// Objects.
    pub objects: Vec<Object>,
    /// Entries of a ray's stack.
    pub stack: u32,
    /// The root of the tree over instances.
    pub root: u32,
}

impl Device {
    /// Bytes of all buffers that it has, in use or not given back yet, where it tells.
    pub fn allocated_bytes(&self) -> Option<u64> {
        let report = self.device.generate_allocator_report()?;
        Some(report.total_allocated_bytes)
    }
}

impl GpuScene {
    /// Reads all pages back.
    ///
    /// # Errors
    /// The device failed or is lost.
    pub fn contents(&self, device: &Device) -> Result<Vec<Contents>, GpuError> {
        let page = |page: &super::scene::Page| {
            let [nodes, vertices, words, objects, ..] = &page.group;
            Ok(Contents {
                nodes: whole(device, nodes)?,
                vertices: whole(device, vertices)?,
                words: whole(device, words)?,
                objects: whole(device, objects)?,
                stack: page.permutation.stack,
                root: page.root,
            })
        };
        self.pages.iter().map(page).collect()
    }
}

/// All that fits into a buffer, which may be a little longer than what was put there.
fn whole<T: Pod + Zeroable>(device: &Device, buffer: &wgpu::Buffer) -> Result<Vec<T>, GpuError> {
    let mut all = vec![T::zeroed(); buffer.size() as usize / size_of::<T>()];
    device.fetch(buffer, &mut all)?;
    Ok(all)
}
