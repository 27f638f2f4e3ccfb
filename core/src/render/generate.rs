//! The stage `generate`: samples of a tile to rays, in an order in which rays near each other go together.

use std::ops::Range;

use glam::Vec2;

use super::prepared::Prepared;
use crate::camera::Camera;
use crate::camera::opening::Times;
use crate::film::filter::Filter;
use crate::film::tile::Tile;
use crate::sample::{Coordinates, Patterns, PixelSampler, SIDE_BY_SIDE};
use crate::trace::Ray;

/// Side of the pixel block whose rays are drawn together, and traced together but for [`is_sorted_as_one`], where each instant has few of them.
const BLOCK: u32 = 8;
/// The same where four samples of each pixel fill a packet.
const SMALL_BLOCK: u32 = 4;

/// Draws camera rays: each a function of the pixel and the number of the sample alone.
#[derive(Clone, Debug)]
pub struct Generator<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Joint samples.
    pub sampler: PixelSampler,
    /// Where in the pixel, and how much.
    pub filter: Filter,
    /// When.
    pub times: Times,
    /// The one lens point of all rays, where settings name it.
    pub lens_point: Option<[f32; 2]>,
    /// True where samples draw a lens point.
    pub has_lens: bool,
    /// True where samples draw a time.
    pub has_time: bool,
}

/// The samples `samples` of the pixels of a tile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileSamples {
    /// Left pixel.
    pub x: i32,
    /// Top pixel.
    pub y: i32,
    /// Width.
    pub width: u32,
    /// Height.
    pub height: u32,
    /// Numbers of the samples.
    pub samples: Range<u32>,
}

impl TileSamples {
    /// What brings `tile` to `target` samples.
    pub fn of(tile: &Tile, target: u32) -> Self {
        Self {
            x: tile.x,
            y: tile.y,
            width: tile.width,
            height: tile.height,
            samples: tile.samples..target.max(tile.samples),
        }
    }

    /// Number of rays.
    pub fn len(&self) -> usize {
        self.width as usize * self.height as usize * self.samples.len()
    }

    /// True without a ray.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// One camera sample on its way.
#[derive(Clone, Copy, Debug)]
pub struct Job {
    /// Its ray.
    pub ray: Ray,
    /// Filter weight, mean 1.
    pub weight: f32,
    /// Squared distance from the pixel's centre, pixels.
    pub distance2: f32,
}

/// Side of the blocks of pixels whose rays are drawn together, for so many samples of each.
pub fn block_size(samples: usize, has_time: bool) -> u32 {
    if samples >= 4 && !has_time {
        SMALL_BLOCK
    } else {
        BLOCK
    }
}

/// True where a tile's rays are sorted by time as one, for so many samples of each pixel, and not block by block: one sample of each
/// pixel of a block is one packet, which would have rays of the whole shutter.
pub fn is_sorted_as_one(samples: usize, has_time: bool) -> bool {
    samples == 1 && has_time
}

impl<'a> Generator<'a> {
    /// For what the effect plan calls for.
    pub fn new(prepared: &'a Prepared) -> Self {
        let settings = &prepared.settings;
        let width = if settings.filter_width > 0.0 {
            settings.filter_width
        } else {
            settings.filter.default_width()
        };
        Self {
            camera: &prepared.camera,
            sampler: PixelSampler::new(settings.samples, settings.seed),
            filter: Filter::new(settings.filter, width),
            times: Times::new(prepared.camera.opening(), settings.time_window),
            lens_point: settings.lens_point,
            has_lens: prepared.plan.has_lens(),
            has_time: prepared.plan.has_time(),
        }
    }

    /// All of a tile's samples, by slot of the pixel: block by block, and in each sample by sample.
    pub fn draw_tile(&self, tile: &TileSamples) -> Vec<(usize, Job)> {
        let mut jobs = Vec::with_capacity(tile.len());
        for block in self.blocks(tile) {
            self.draw_block(tile, block, &mut jobs);
        }
        jobs
    }

    /// Blocks of pixels `[x0, y0, x1, y1]` whose rays are drawn together.
    pub(super) fn blocks(&self, tile: &TileSamples) -> impl Iterator<Item = [u32; 4]> + use<> {
        let size = block_size(tile.samples.len(), self.has_time);
        let (width, height) = (tile.width, tile.height);
        let rows = (0..height).step_by(size as usize);
        rows.flat_map(move |y| {
            let columns = (0..width).step_by(size as usize);
            columns.map(move |x| [x, y, (x + size).min(width), (y + size).min(height)])
        })
    }

    /// Draws the samples of a block, for the effects that are called for.
    pub(super) fn draw_block(
        &self,
        tile: &TileSamples,
        block: [u32; 4],
        jobs: &mut Vec<(usize, Job)>,
    ) {
        match (self.has_lens, self.has_time) {
            (false, false) => self.draw::<false, false>(tile, block, jobs),
            (true, false) => self.draw::<true, false>(tile, block, jobs),
            (false, true) => self.draw::<false, true>(tile, block, jobs),
            (true, true) => self.draw::<true, true>(tile, block, jobs),
        }
    }

    /// Draws the samples of the pixels `[x0, y0, x1, y1]` of `tile`, sample by sample: their slots, and
    /// rays. What is not drawn takes no time.
    fn draw<const LENS: bool, const TIME: bool>(
        &self,
        tile: &TileSamples,
        [x0, y0, x1, y1]: [u32; 4],
        jobs: &mut Vec<(usize, Job)>,
    ) {
        let places = (y0..y1).flat_map(|y| (x0..x1).map(move |x| (x, y)));
        let (mut slots, mut pixels, mut numbers) = (Vec::new(), Vec::new(), Vec::new());
        for (x, y) in places {
            let pixel = [tile.x + x as i32, tile.y + y as i32];
            slots.push((y * tile.width + x) as usize);
            pixels.push(pixel);
            // Pixels left of the image and above it have numbers of their own too.
            numbers.push(pixel.map(i32::cast_unsigned));
        }
        debug_assert!(numbers.len() <= SIDE_BY_SIDE);
        let patterns = Patterns::<LENS, TIME>::new(&self.sampler, &numbers);
        let mut drawn: Coordinates = [[0.0; SIDE_BY_SIDE]; 5];
        jobs.reserve(slots.len() * tile.samples.len());
        for index in tile.samples.clone() {
            patterns.sample(index, &mut drawn);
            let pixels = slots.iter().zip(&pixels).enumerate();
            jobs.extend(pixels.map(|(i, (slot, pixel))| {
                let drawn = drawn.each_ref().map(|x| x[i]);
                (*slot, self.generate::<LENS, TIME>(*pixel, drawn))
            }));
        }
    }

    /// The ray of a sample whose pixel, lens and time were drawn jointly.
    #[inline]
    fn generate<const LENS: bool, const TIME: bool>(
        &self,
        pixel: [i32; 2],
        drawn: [f32; 5],
    ) -> Job {
        let [x, y, u, v, time] = drawn;
        let (offset, weight) = self.filter.sample(x, y);
        let centre = Vec2::new(pixel[0] as f32 + 0.5, pixel[1] as f32 + 0.5);
        let time = if TIME { self.times.at(time) } else { 0.0 };
        let ray = if LENS {
            let lens = match self.lens_point {
                Some([u, v]) => Vec2::new(u, v),
                None => self.camera.lens_point(u, v),
            };
            self.camera.ray(centre + offset, lens, time)
        } else {
            self.camera.pinhole_ray(centre + offset, time)
        };
        Job {
            ray,
            weight,
            distance2: offset.length_squared(),
        }
    }
}
