//! The film of one render: tiles that workers fill and hosts read at any time.

use std::borrow::Borrow;
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::tile::{Keeps, Tile};
use crate::aov::{Aov, AovData, AovImage};
use crate::scene::settings::union;

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
    /// The data window holds no pixel, or reaches too far.
    #[error(
        "the data window from {0}, {1} to {2}, {3} holds no pixel, or reaches farther than 65536 \
         pixels"
    )]
    DataWindow(i32, i32, i32, i32),
    /// No memory for the film.
    #[error("no memory for a film of {0} MiB")]
    OutOfMemory(u64),
}

/// The film. Any thread may read while others render.
#[derive(Debug)]
pub struct Frame {
    /// Pixels that hosts see: the image and the data window.
    window: [i32; 4],
    data_window: [i32; 4],
    aovs: Vec<Aov>,
    keeps: Keeps,
    tiles: Vec<Mutex<Tile>>,
}

impl Frame {
    /// An empty film of `resolution` that keeps `aovs`. Only the pixels of `data_window` (x0, y0, x1,
    /// y1, half open, relative to the image's top left) are ever filled, and take memory; it may
    /// lie inside the image (a crop), beyond it (overscan), or both. Without one it is the image.
    ///
    /// # Errors
    /// Resolutions and windows that hold no pixel, or more than memory does.
    pub fn new(
        resolution: [u32; 2],
        data_window: Option<[i32; 4]>,
        aovs: &[Aov],
    ) -> Result<Self, FrameError> {
        let [width, height] = resolution;
        let usable = 1..=LARGEST_RESOLUTION;
        if !(usable.contains(&width) && usable.contains(&height)) {
            return Err(FrameError::Resolution(width, height));
        }
        let image = [0, 0, width as i32, height as i32];
        let data_window = data_window.unwrap_or(image);
        let [x0, y0, x1, y1] = data_window;
        let window = union(image, data_window);
        let most = LARGEST_RESOLUTION as i32;
        if x0 >= x1
            || y0 >= y1
            || window.iter().any(|x| x.unsigned_abs() > LARGEST_RESOLUTION)
            || window[2] - window[0] > most
            || window[3] - window[1] > most
        {
            return Err(FrameError::DataWindow(x0, y0, x1, y1));
        }
        let mut aovs = aovs.to_vec();
        aovs.sort();
        aovs.dedup();
        let keeps = Keeps::of(&aovs);
        let pixels = u64::from(x0.abs_diff(x1)) * u64::from(y0.abs_diff(y1));
        let bytes = pixels * keeps.bytes() as u64;
        // Rust aborts when an allocation fails, so ask for the whole first.
        let mut probe: Vec<u8> = Vec::new();
        let refused = usize::try_from(bytes).map_or(true, |n| probe.try_reserve_exact(n).is_err());
        if refused {
            return Err(FrameError::OutOfMemory(bytes >> 20));
        }
        drop(probe);
        // Tiles lie on a grid of the whole plane, so that any window renders the same samples in the
        // same batches.
        let side = TILE_SIZE as i32;
        let starts = |from: i32, to: i32| from.div_euclid(side)..=(to - 1).div_euclid(side);
        let span = |at: i32, from: i32, to: i32| {
            let first = (at * side).max(from);
            (first, first.abs_diff(((at + 1) * side).min(to)))
        };
        let mut tiles = Vec::new();
        for ty in starts(y0, y1) {
            for tx in starts(x0, x1) {
                let ((left, width), (top, height)) = (span(tx, x0, x1), span(ty, y0, y1));
                tiles.push(Mutex::new(Tile::new(left, top, width, height, keeps)));
            }
        }
        Ok(Self {
            window,
            data_window,
            aovs,
            keeps,
            tiles,
        })
    }

    /// Pixels that [`Frame::aov`] gives: the smallest rectangle around the image and the data window,
    /// x0, y0, x1, y1, half open, relative to the image's top left.
    pub fn window(&self) -> [i32; 4] {
        self.window
    }

    /// Pixels that are rendered, as [`Frame::window`].
    pub fn data_window(&self) -> [i32; 4] {
        self.data_window
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

    /// The AOV of that name, if it is kept.
    pub fn find(&self, name: &str) -> Option<&Aov> {
        self.aovs.iter().find(|aov| aov.name() == name)
    }

    /// Pixels of an AOV as they stand; `None` for one that is not kept. Pixels outside the data
    /// window are background.
    pub fn aov(&self, aov: impl Borrow<Aov>) -> Option<AovImage> {
        let aov = aov.borrow();
        if !self.aovs.contains(aov) {
            return None;
        }
        let [x0, y0, x1, y1] = self.window;
        let (width, height) = (x0.abs_diff(x1), y0.abs_diff(y1));
        let components = aov.components();
        let length = width as usize * height as usize * components;
        let pixels = |tile: &Tile| {
            let (x, y) = (x0.abs_diff(tile.x) as usize, y0.abs_diff(tile.y) as usize);
            let w = tile.width as usize;
            let count = w * tile.height as usize;
            (0..count).map(move |i| (i, (y + i / w) * width as usize + x + i % w))
        };
        let data = if aov.is_integer() {
            let background = if *aov == Aov::SampleCount { 0 } else { -1 };
            let mut data = vec![background; length];
            let mut values = Vec::with_capacity(4);
            for tile in &self.tiles {
                let tile = lock(tile);
                for (i, at) in pixels(&tile) {
                    values.clear();
                    tile.resolve_i32(aov, i, &mut values);
                    data[at * components..][..components].copy_from_slice(&values);
                }
            }
            AovData::I32(data)
        } else {
            let background = if *aov == Aov::Depth { 1.0 } else { 0.0 };
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
            origin: [x0, y0],
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
        for [x0, y0, x1, y1] in [
            [8, 0, 8, 9],
            [0, 5, 8, 4],
            [-1, 0, 65_536, 8],
            [0, i32::MIN, 8, 8],
            [0, 0, i32::MAX, 8],
        ] {
            let refused = Some(FrameError::DataWindow(x0, y0, x1, y1));
            assert_eq!(new([8, 8], Some([x0, y0, x1, y1])), refused);
        }
        assert!(new([8, 8], Some([2, 2, 100, 100])).is_none());
    }

    #[test]
    fn windows_inside_around_and_beside_the_image() {
        for (data, window) in [
            ([2, 3, 20, 30], [0, 0, 40, 40]),
            ([-17, -1, 41, 57], [-17, -1, 41, 57]),
            ([-40, 50, -20, 60], [-40, 0, 40, 60]),
        ] {
            let frame = Frame::new([40, 40], Some(data), &[Aov::SampleCount]).unwrap();
            assert_eq!((frame.window(), frame.data_window()), (window, data));
            let mut pixels = 0;
            for i in 0..frame.tile_count() {
                let mut tile = frame.tile(i);
                tile.samples = 1;
                pixels += tile.width * tile.height;
                assert!(tile.width <= TILE_SIZE && tile.height <= TILE_SIZE);
                let last = tile.x + tile.width as i32 - 1;
                let side = TILE_SIZE as i32;
                assert_eq!(tile.x.div_euclid(side), last.div_euclid(side));
            }
            let [x0, y0, x1, y1] = data;
            assert_eq!(pixels as i32, (x1 - x0) * (y1 - y0));
            let image = frame.aov(Aov::SampleCount).unwrap();
            assert_eq!(image.origin, [window[0], window[1]]);
            let AovData::I32(counts) = image.data else {
                panic!("counts");
            };
            for (i, count) in counts.iter().enumerate() {
                let x = window[0] + i as i32 % image.width as i32;
                let y = window[1] + i as i32 / image.width as i32;
                let inside = (x0..x1).contains(&x) && (y0..y1).contains(&y);
                assert_eq!(*count, i32::from(inside), "{x} {y}");
            }
        }
    }
}
