//! The stage `film` on a device: what the samples of each pixel add up to, read back once a pass.
//!
//! Sums are f32, of at most as many samples as a pass has; core's film adds them to sums in f64. A pass of n samples is
//! off by no more than n roundings of the sum of its magnitudes.

use std::sync::Arc;

use hdtrapeze_core::film::tile::PixelSums;
use hdtrapeze_shaders::layout::Pixel;
use hdtrapeze_shaders::stage::FilmPermutation;
use wgpu::BufferUsages as Usage;

use super::kernel::{Binding, Kernel, Kernels};
use super::tiles::GpuTiles;
use super::trace::unpacked;
use super::{Device, GpuError};

/// Films on a device.
#[derive(Debug)]
pub struct Filmer {
    device: Arc<Device>,
    kernels: Kernels<FilmPermutation>,
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
    /// met first. `means` gets the sums of `values`, where these are kept, and behind those of each pixel how many of its samples
    /// see anything. Gives the seconds that the device took where that is asked for and it can tell.
    ///
    /// # Errors
    /// The device failed or is lost; nothing of `pixels` and `means` is then to be used.
    pub fn film(
        &self,
        tiles: &GpuTiles,
        [samples, hits]: [&wgpu::Buffer; 2],
        values: Option<&wgpu::Buffer>,
        seen: bool,
        (pixels, means): (&mut [PixelSums], &mut [f32]),
        timed: bool,
    ) -> Result<Option<f64>, GpuError> {
        let device = &*self.device;
        let bytes = (tiles.pixels.max(1) * size_of::<Pixel>()) as u64;
        let sums = device.buffer("pixels", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        let groups: [&[&wgpu::Buffer]; 2] =
            [&[samples, hits, &sums], &[&tiles.tiles, &tiles.launch]];
        let mut groups = groups.to_vec();
        let usage = Usage::STORAGE | Usage::COPY_SRC;
        let bytes = size_of_val(means) as u64;
        let value_sums = values.map(|_| device.buffer("sums of values", bytes.max(4), usage));
        let value_sums = value_sums.transpose()?;
        let both = values.zip(value_sums.as_ref()).map(<[_; 2]>::from);
        groups.extend(both.as_ref().map(<[_; 2]>::as_slice));
        let stride = means.len() / tiles.pixels.max(1);
        let kernel = self.kernel(FilmPermutation {
            seen,
            values: values.map_or(0, |_| stride as u32 - 1),
        })?;
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
        if let Some(value_sums) = &value_sums {
            device.fetch(value_sums, means)?;
        }
        Ok(seconds)
    }

    fn kernel(&self, permutation: FilmPermutation) -> Result<Arc<Kernel>, GpuError> {
        self.kernels.get(permutation, || {
            let groups: [&[Binding]; 3] = [
                &[Binding::Read, Binding::Read, Binding::Write],
                &[Binding::Read, Binding::Uniform],
                &[Binding::Read, Binding::Write],
            ];
            let count = if permutation.values > 0 { 3 } else { 2 };
            Kernel::new(
                &self.device,
                "film",
                &permutation.source(),
                &groups[..count],
            )
        })
    }
}
