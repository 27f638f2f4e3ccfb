//! The stage `film` on a device: what the samples of each pixel add up to, read back once a pass.
//!
//! Sums are f32, of at most as many samples as a pass has; core's film adds them to sums in f64. A pass of n samples is
//! off by no more than n roundings of the sum of its magnitudes.

use std::sync::Arc;

use hdtrapeze_core::film::tile::PixelSums;
use hdtrapeze_shaders::layout::Pixel;
use hdtrapeze_shaders::stage::film_source;
use wgpu::BufferUsages as Usage;

use super::kernel::{Binding, Kernel, Kernels};
use super::tiles::GpuTiles;
use super::trace::unpacked;
use super::{Device, GpuError};

/// Films on a device.
#[derive(Debug)]
pub struct Filmer {
    device: Arc<Device>,
    kernels: Kernels<bool>,
}

impl Filmer {
    /// For this device.
    pub fn new(device: Arc<Device>) -> Self {
        Self {
            device,
            kernels: Kernels::default(),
        }
    }

    /// Sums of the pixels of tiles from their samples and hits, by number: with `seen` hits are what is seen first, else what is
    /// met first. Gives the seconds that the device took where that
    /// is asked for and it can tell.
    ///
    /// # Errors
    /// The device failed or is lost; nothing of `pixels` is then to be used.
    pub fn film(
        &self,
        tiles: &GpuTiles,
        [samples, hits]: [&wgpu::Buffer; 2],
        seen: bool,
        pixels: &mut [PixelSums],
        timed: bool,
    ) -> Result<Option<f64>, GpuError> {
        let device = &*self.device;
        let bytes = (tiles.pixels.max(1) * size_of::<Pixel>()) as u64;
        let sums = device.buffer("pixels", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        let groups: [&[&wgpu::Buffer]; 2] =
            [&[samples, hits, &sums], &[&tiles.tiles, &tiles.launch]];
        let kernel = self.kernel(seen)?;
        let launch = kernel.launch(device, &groups, tiles.workgroups);
        let seconds = launch.run(device, timed)?;
        let mut answers = vec![Pixel::default(); tiles.pixels];
        device.fetch(&sums, &mut answers)?;
        for (to, answer) in pixels.iter_mut().zip(&answers) {
            let &Pixel {
                red,
                green,
                blue,
                alpha,
                weight,
                ..
            } = answer;
            *to = PixelSums {
                color: [red, green, blue, alpha, weight],
                distance2: answer.distance2,
                time: answer.time,
                hit: unpacked(&answer.hit),
            };
        }
        Ok(seconds)
    }

    fn kernel(&self, seen: bool) -> Result<Arc<Kernel>, GpuError> {
        self.kernels.get(seen, || {
            let groups: [&[Binding]; 2] = [
                &[Binding::Read, Binding::Read, Binding::Write],
                &[Binding::Read, Binding::Uniform],
            ];
            Kernel::new(&self.device, "film", &film_source(seen), &groups)
        })
    }
}
