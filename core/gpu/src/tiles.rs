//! Tiles as stages that go by pixel see them.

use hdtrapeze_core::film::frame::TILE_SIZE;
use hdtrapeze_core::render::{TileSamples, block_size};
use hdtrapeze_shaders::layout::{self, TilesLaunch};
use hdtrapeze_shaders::stage::TILE_SQUARE;

use super::kernel::rows;
use super::{Device, GpuError};

// A workgroup's squares make up a tile.
const _: () = assert!(TILE_SQUARE[0] * TILE_SQUARE[1] == TILE_SIZE);

/// Samples of tiles on a device.
#[derive(Debug)]
pub struct GpuTiles {
    pub(crate) tiles: wgpu::Buffer,
    pub(crate) launch: wgpu::Buffer,
    pub(crate) workgroups: u32,
    /// The first sample of any, and one past the last.
    pub(crate) samples: [u32; 2],
    /// All rays.
    pub rays: usize,
    /// All pixels.
    pub pixels: usize,
}

impl GpuTiles {
    /// Numbers the rays and pixels of tiles, one tile's after the other's: rays as core's
    /// [`draw_tile`](hdtrapeze_core::render::Generator::draw_tile) does.
    ///
    /// # Errors
    /// They are more than the device takes.
    pub fn new(device: &Device, tiles: &[TileSamples], has_time: bool) -> Result<Self, GpuError> {
        let first_sample = tiles.iter().map(|tile| tile.samples.start).min();
        let end_sample = tiles.iter().map(|tile| tile.samples.end).max();
        let samples = [first_sample.unwrap_or(0), end_sample.unwrap_or(0)];
        let (mut rays, mut pixels) = (0, 0);
        let packed = tiles.iter().map(|tile| {
            let (first_ray, first_pixel) = (rays, pixels);
            rays += tile.len();
            pixels += tile.width as usize * tile.height as usize;
            layout::TileSamples {
                x: tile.x,
                y: tile.y,
                width: tile.width,
                height: tile.height,
                first_sample: tile.samples.start,
                count: tile.samples.len() as u32,
                first_ray: first_ray as u32,
                first_pixel: first_pixel as u32,
                block: block_size(tile.samples.len(), has_time),
            }
        });
        let packed: Vec<layout::TileSamples> = packed.collect();
        let workgroups = tiles.len() as u32 * TILE_SQUARE[1] * TILE_SQUARE[1];
        let launch = TilesLaunch {
            row: rows(device, workgroups)[0],
            tile_count: tiles.len() as u32,
            first_sample: samples[0],
        };
        Ok(Self {
            tiles: device.upload("tiles", bytemuck::cast_slice(&packed))?,
            launch: device.uniform("launch", &launch)?,
            workgroups,
            samples,
            rays,
            pixels,
        })
    }
}
