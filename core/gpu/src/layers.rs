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

// Both sides give up at the same transmittance, and after as many layers.
const _: () = assert!(LEAST_TRANSMITTANCE == stage::LEAST_TRANSMITTANCE);
const _: () = assert!(MAX_LAYERS == stage::MAX_LAYERS);

/// A layer that is traced or shaded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layer {
    /// Its number.
    pub number: usize,
    /// All rays.
    pub len: usize,
    /// No more of them go on to it.
    pub most: usize,
}

impl Layer {
    /// The first, which all rays go to.
    pub fn first(len: usize) -> Self {
        Self {
            number: 0,
            len,
            most: len,
        }
    }
}

/// Layers of rays on a device.
#[derive(Debug)]
pub(crate) struct Layers {
    /// What of each ray is seen first, and after these the hits of two layers.
    pub hits: wgpu::Buffer,
    /// What rays have brought home by now.
    pub samples: wgpu::Buffer,
    /// What is left of them, and which go on.
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

    /// Has all rays go on to all layers: none is shaded.
    pub fn all_go_on(&self, device: &Device) {
        let counts = vec![self.len as u32; MAX_LAYERS + 1];
        let veil = |place: u32| Veil {
            going: [place; 2],
            ..Veil::default()
        };
        let veils: Vec<Veil> = (0..self.len as u32).map(veil).collect();
        let queue = &device.queue;
        queue.write_buffer(&self.veils, 0, bytemuck::cast_slice(&counts));
        queue.write_buffer(&self.veils, VEILS_AT, bytemuck::cast_slice(&veils));
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

    /// Runs one layer after the other by `layer`. How many rays go on is asked after 1, 3, 7... layers: asking waits for the
    /// device, and a layer that fewer rays come to than there is room for costs little more.
    ///
    /// # Errors
    /// As `layer`; the device failed or is lost.
    pub fn run(
        &self,
        device: &Device,
        mut layer: impl FnMut(Layer) -> Result<(), GpuError>,
    ) -> Result<(), GpuError> {
        let (mut next, mut count) = (0, 1);
        let (len, mut most) = (self.len, self.len);
        while most > 0 && next < MAX_LAYERS {
            let end = MAX_LAYERS.min(next + count);
            (next..end).try_for_each(|number| layer(Layer { number, len, most }))?;
            let mut counts = [0u32; MAX_LAYERS + 1];
            device.fetch(&self.veils, &mut counts)?;
            (next, count, most) = (end, 2 * count, counts[end] as usize);
        }
        Ok(())
    }
}
