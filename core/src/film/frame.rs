//! The film of one render: tiles that workers fill and hosts read at any time.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::tile::{Keeps, Tile};
use crate::aov::{Aov, AovData, AovImage};

/// Side of a tile in pixels.
pub const TILE_SIZE: u32 = 16;

/// Largest width and height of a film, pixels.
pub const LARGEST_RESOLUTION: u32 = 65_536;

/// Why a film cannot be made.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum FrameError {
    /// Zero or absurd resolution.
    #[error("resolution {0} x {1} is not between 1 x 1 and 65536 x 65536")]
    Resolution(u32, u32),
    /// The crop leaves no pixel.
    #[error("the crop window holds no pixel of the image")]
    Crop,
    /// No memory for the film.
    #[error("no memory for a film of {0} MiB")]
    OutOfMemory(u64),
}

/// The film. Any thread may read while others render.
#[derive(Debug)]
pub struct Frame {
    resolution: [u32; 2],
    aovs: Vec<Aov>,
    keeps: Keeps,
    tiles: Vec<Mutex<Tile>>,
}

impl Frame {
    /// An empty film of `resolution` that keeps `aovs`; only the pixels inside `crop` (x0, y0, x1, y1,
    /// half open) are ever filled, and take memory.
    ///
    /// # Errors
    /// Resolutions and crops that hold no pixel, or more than memory does.
    pub fn new(
        resolution: [u32; 2],
        crop: Option<[u32; 4]>,
        aovs: &[Aov],
    ) -> Result<Self, FrameError> {
        let [width, height] = resolution;
        let usable = 1..=LARGEST_RESOLUTION;
        if !(usable.contains(&width) && usable.contains(&height)) {
            return Err(FrameError::Resolution(width, height));
        }
        let [x0, y0, x1, y1] = crop.unwrap_or([0, 0, width, height]);
        let (x1, y1) = (x1.min(width), y1.min(height));
        if x0 >= x1 || y0 >= y1 {
            return Err(FrameError::Crop);
        }
        let mut aovs = aovs.to_vec();
        aovs.sort();
        aovs.dedup();
        let keeps = Keeps::of(&aovs);
        let bytes = u64::from(x1 - x0) * u64::from(y1 - y0) * keeps.bytes() as u64;
        // Rust aborts when an allocation fails, so ask for the whole first.
        let mut probe: Vec<u8> = Vec::new();
        let refused = usize::try_from(bytes).map_or(true, |n| probe.try_reserve_exact(n).is_err());
        if refused {
            return Err(FrameError::OutOfMemory(bytes >> 20));
        }
        drop(probe);
        // Tiles lie on a grid of the whole image, so that a crop renders the same samples in the same
        // batches.
        let mut tiles = Vec::new();
        for ty in (y0 / TILE_SIZE)..y1.div_ceil(TILE_SIZE) {
            for tx in (x0 / TILE_SIZE)..x1.div_ceil(TILE_SIZE) {
                let (left, top) = ((tx * TILE_SIZE).max(x0), (ty * TILE_SIZE).max(y0));
                let (right, bottom) = (
                    ((tx + 1) * TILE_SIZE).min(x1),
                    ((ty + 1) * TILE_SIZE).min(y1),
                );
                tiles.push(Mutex::new(Tile::new(
                    left,
                    top,
                    right - left,
                    bottom - top,
                    keeps,
                )));
            }
        }
        Ok(Self {
            resolution,
            aovs,
            keeps,
            tiles,
        })
    }

    /// Width and height in pixels.
    pub fn resolution(&self) -> [u32; 2] {
        self.resolution
    }

    /// AOVs that are kept.
    pub fn aovs(&self) -> &[Aov] {
        &self.aovs
    }

    /// Sums that are kept.
    pub fn keeps(&self) -> Keeps {
        self.keeps
    }

    /// Number of tiles.
    pub fn tile_count(&self) -> usize {
        self.tiles.len()
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let pixels = |t: &Mutex<Tile>| {
            let tile = lock(t);
            u64::from(tile.width) * u64::from(tile.height)
        };
        self.tiles.iter().map(pixels).sum::<u64>() * self.keeps.bytes() as u64
    }

    /// Tile `i`, locked.
    pub fn tile(&self, i: usize) -> MutexGuard<'_, Tile> {
        lock(&self.tiles[i])
    }

    /// Samples that every pixel has.
    pub fn samples_done(&self) -> u32 {
        self.tiles
            .iter()
            .map(|t| lock(t).samples)
            .min()
            .unwrap_or(0)
    }

    /// Pixels of an AOV as they stand; `None` for one that is not kept. Pixels outside the crop are
    /// background.
    pub fn aov(&self, aov: Aov) -> Option<AovImage> {
        if !self.aovs.contains(&aov) {
            return None;
        }
        let [width, height] = self.resolution;
        let components = aov.components();
        let length = width as usize * height as usize * components;
        let pixels = |tile: &Tile| {
            let (x, y, w) = (tile.x as usize, tile.y as usize, tile.width as usize);
            let count = w * tile.height as usize;
            (0..count).map(move |i| (i, (y + i / w) * width as usize + x + i % w))
        };
        let data = if aov.is_integer() {
            let background = if aov == Aov::SampleCount { 0 } else { -1 };
            let mut data = vec![background; length];
            for tile in &self.tiles {
                let tile = lock(tile);
                for (i, at) in pixels(&tile) {
                    data[at] = tile.resolve_i32(aov, i).unwrap_or(background);
                }
            }
            AovData::I32(data)
        } else {
            let background = if aov == Aov::Depth { 1.0 } else { 0.0 };
            let mut data = vec![background; length];
            let mut values = Vec::with_capacity(4);
            for tile in &self.tiles {
                let tile = lock(tile);
                for (i, at) in pixels(&tile) {
                    values.clear();
                    tile.resolve_f32(aov, i, &mut values);
                    data[at * components..][..components].copy_from_slice(&values);
                }
            }
            AovData::F32(data)
        };
        Some(AovImage {
            width,
            height,
            components,
            data,
        })
    }
}

/// A tile whose writer panicked still holds whole samples: each is added at once.
fn lock(tile: &Mutex<Tile>) -> MutexGuard<'_, Tile> {
    tile.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::super::tile::{FirstHit, Sample};
    use super::*;

    #[test]
    fn point_samples_come_from_the_sample_nearest_the_centre() {
        let aovs = [Aov::PrimId, Aov::Depth, Aov::Color, Aov::SampleCount];
        let frame = Frame::new([20, 3], None, &aovs).unwrap();
        assert_eq!(frame.tile_count(), 2);
        let hit = |prim_id| {
            Some(FirstHit {
                prim_id,
                depth: 0.5,
                ..FirstHit::default()
            })
        };
        let mut tile = frame.tile(1);
        let mut add = |distance2, first| {
            let color = [1.0, 0.5, 0.0, 1.0];
            tile.add(
                0,
                &Sample {
                    weight: 1.0,
                    distance2,
                    color,
                    first,
                    cost: [0.0; 2],
                },
            );
            tile.samples += 1;
        };
        add(0.5, hit(7));
        add(0.1, hit(8));
        add(0.3, None);
        drop(tile);
        let Some(AovImage {
            data: AovData::I32(ids),
            ..
        }) = frame.aov(Aov::PrimId)
        else {
            panic!()
        };
        assert_eq!((ids[16], ids[17], ids[0]), (8, -1, -1));
        let Some(AovImage {
            data: AovData::F32(color),
            ..
        }) = frame.aov(Aov::Color)
        else {
            panic!()
        };
        assert_eq!(&color[64..68], &[1.0, 0.5, 0.0, 1.0]);
        assert!(frame.aov(Aov::Normal).is_none());
        assert_eq!(frame.samples_done(), 0, "the other tile has none");
    }

    #[test]
    fn signed_weights_leave_a_constant_as_it_is() {
        let frame = Frame::new([1, 1], None, &[Aov::Color]).unwrap();
        let mut tile = frame.tile(0);
        for weight in [1.2, 1.2, -1.2, 1.2, 1.2, 1.2] {
            let color = [0.25, 0.5, 2.0, 1.0];
            tile.add(
                0,
                &Sample {
                    weight,
                    color,
                    ..Sample::default()
                },
            );
            tile.samples += 1;
        }
        drop(tile);
        let Some(AovImage {
            data: AovData::F32(color),
            ..
        }) = frame.aov(Aov::Color)
        else {
            panic!()
        };
        for (got, want) in color.iter().zip([0.25, 0.5, 2.0, 1.0]) {
            assert!((got - want).abs() < 1e-6);
        }
    }

    #[test]
    fn absurd_films_are_refused() {
        let new = |r, c| Frame::new(r, c, &[Aov::Color]).err();
        assert_eq!(new([0, 5], None), Some(FrameError::Resolution(0, 5)));
        assert_eq!(
            new([70_000, 5], None),
            Some(FrameError::Resolution(70_000, 5))
        );
        assert_eq!(new([8, 8], Some([8, 0, 9, 9])), Some(FrameError::Crop));
        assert!(new([8, 8], Some([2, 2, 100, 100])).is_none());
    }
}
