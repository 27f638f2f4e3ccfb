//! What rays meet behind surfaces that are not opaque, front to back: a layer is traced and shaded, then the next, until no
//! ray is left of which something goes on, or there are as many layers as core composites.
//!
//! Buffers are as `layers.wgsl` and `shade_layers.wgsl` have them. Nothing of it is there for a scene that is opaque.

use hdtrapeze_core::render::{LEAST_TRANSMITTANCE, MAX_LAYERS};
use hdtrapeze_core::trace;
use hdtrapeze_shaders::layout::{Hit, Sample, Veil};
use hdtrapeze_shaders::stage::{self, VEILS_AT};
use wgpu::BufferUsages as Usage;

use super::trace::{to_layout, unpacked};
use super::{Device, GpuError};

// Both sides give up at the same transmittance.
const _: () = assert!(LEAST_TRANSMITTANCE == stage::LEAST_TRANSMITTANCE);

/// Layers of rays on a device.
#[derive(Debug)]
pub(crate) struct Layers {
    /// What of each ray is seen first, and after these the hits of two layers.
    pub hits: wgpu::Buffer,
    /// What rays have brought home by now.
    pub samples: wgpu::Buffer,
    /// What is left of them.
    pub veils: wgpu::Buffer,
    len: usize,
}

impl Layers {
    /// Of `len` rays.
    ///
    /// # Errors
    /// They are more than the device takes, or it is lost.
    pub fn new(device: &Device, len: usize) -> Result<Self, GpuError> {
        let buffer = |what: &'static str, bytes: u64| {
            let usage = Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST;
            device.buffer(what, bytes, usage)
        };
        let each = |bytes: usize| (len.max(1) * bytes) as u64;
        Ok(Self {
            hits: buffer("hits of layers", each(3 * size_of::<Hit>()))?,
            samples: buffer("samples", each(size_of::<Sample>()))?,
            veils: buffer("what is left of rays", VEILS_AT + each(size_of::<Veil>()))?,
            len,
        })
    }

    /// Puts there what rays met in a layer.
    pub fn put(&self, device: &Device, layer: usize, hits: &[trace::Hit]) {
        let hits: Vec<Hit> = hits.iter().map(to_layout).collect();
        let first = self.first(layer) * size_of::<Hit>();
        let bytes = bytemuck::cast_slice(&hits);
        device.queue.write_buffer(&self.hits, first as u64, bytes);
    }

    /// Fetches what rays met in a layer, the last one or the one before.
    ///
    /// # Errors
    /// The device failed or is lost.
    pub fn get(&self, device: &Device, layer: usize) -> Result<Vec<trace::Hit>, GpuError> {
        let mut all = vec![Hit::default(); 3 * self.len];
        device.fetch(&self.hits, &mut all)?;
        let own = &all[self.first(layer)..][..self.len];
        Ok(own.iter().map(unpacked).collect())
    }

    /// Place of the first hit of a layer.
    fn first(&self, layer: usize) -> usize {
        (1 + layer % 2) * self.len
    }

    /// Runs one layer after the other by `layer`. How far rays have come is asked after 1, 3, 7... layers: asking waits for the
    /// device, and a layer that no ray comes to costs little.
    ///
    /// # Errors
    /// As `layer`; the device failed or is lost.
    pub fn run(
        &self,
        device: &Device,
        mut layer: impl FnMut(usize) -> Result<(), GpuError>,
    ) -> Result<(), GpuError> {
        let (mut next, mut count) = (0, 1);
        while next < MAX_LAYERS {
            let end = MAX_LAYERS.min(next + count);
            (next..end).try_for_each(&mut layer)?;
            let mut reached = [0u32];
            device.fetch(&self.veils, &mut reached)?;
            if (reached[0] as usize) < end {
                break;
            }
            (next, count) = (end, 2 * count);
        }
        Ok(())
    }
}
