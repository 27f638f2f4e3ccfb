//! Samples of many pixels side by side: the same bits as those of [`PixelPattern`](super::PixelPattern), in vectors.

use hdtrapeze_simd::{Kernel, Simd};

use super::matrices::DIMS;
use super::scramble::{DigitFactors, STEP, mix64, scramble_reversed, unit};
use super::{PatternKind, PixelSampler, is_drawn};

/// Most pixels whose samples are drawn together.
pub const SIDE_BY_SIDE: usize = 64;

/// Pixels in a vector.
const LANES: usize = 16;
const VECTORS: usize = SIDE_BY_SIDE / LANES;

/// Coordinates of one sample of each pixel, by dimension: `x`, `y`, `u`, `v` and time.
pub type Coordinates = [[f32; SIDE_BY_SIDE]; DIMS];

/// How one dimension of pixels of a vector is scrambled.
#[derive(Clone, Copy, Debug, Default)]
struct Scrambles {
    seeds: [u32; LANES],
    /// Net only.
    factors: DigitFactors<LANES>,
}

/// The patterns of up to [`SIDE_BY_SIDE`] pixels, for a `LENS` or none, and with `TIME` or without.
#[derive(Clone, Debug)]
pub struct Patterns<'a, const LENS: bool, const TIME: bool> {
    sampler: &'a PixelSampler,
    pixels: [[u32; 2]; SIDE_BY_SIDE],
    count: usize,
    /// Of the first point set.
    scrambles: [[Scrambles; DIMS]; VECTORS],
}

impl<'a, const LENS: bool, const TIME: bool> Patterns<'a, LENS, TIME> {
    /// Those of `pixels`; of the first [`SIDE_BY_SIDE`] where there are more.
    pub fn new(sampler: &'a PixelSampler, pixels: &[[u32; 2]]) -> Self {
        let count = pixels.len().min(SIDE_BY_SIDE);
        let mut patterns = Self {
            sampler,
            pixels: [[0; 2]; SIDE_BY_SIDE],
            count,
            scrambles: [[Scrambles::default(); DIMS]; VECTORS],
        };
        patterns.pixels[..count].copy_from_slice(&pixels[..count]);
        sampler.level.run(DrawScrambles(&mut patterns));
        patterns
    }

    /// Sample `index` of each pixel. Coordinates of dimensions that are not drawn, and of lanes without a pixel, are left as they are
    /// or mean nothing.
    pub fn sample(&self, index: u32, out: &mut Coordinates) {
        let (epoch, within) = self.sampler.split(index);
        if epoch == 0 {
            let word = self.sampler.word(within);
            self.sampler.level.run(Finish {
                patterns: self,
                word,
                out,
            });
            return;
        }
        // Past the count of a net.
        for (i, &pixel) in self.pixels[..self.count].iter().enumerate() {
            let pattern = self.sampler.pixel_of::<LENS, TIME>(pixel);
            let drawn = pattern.sample_of::<LENS, TIME>(index);
            for (out, x) in out.iter_mut().zip(drawn) {
                out[i] = x;
            }
        }
    }

    fn vectors(&self) -> usize {
        self.count.div_ceil(LANES)
    }
}

struct DrawScrambles<'p, 'a, const LENS: bool, const TIME: bool>(&'p mut Patterns<'a, LENS, TIME>);

impl<const LENS: bool, const TIME: bool> Kernel for DrawScrambles<'_, '_, LENS, TIME> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let patterns = self.0;
        let sampler = patterns.sampler;
        let pixels = patterns.pixels.as_chunks::<LANES>().0;
        let vectors = patterns.vectors();
        for (pixels, scrambles) in pixels.iter().zip(&mut patterns.scrambles).take(vectors) {
            let mut state = [0; LANES];
            for (state, pixel) in state.iter_mut().zip(pixels) {
                *state = sampler.pixel_seed(*pixel);
            }
            for (d, scrambles) in scrambles.iter_mut().enumerate() {
                let mut random = [0; LANES];
                for (state, random) in state.iter_mut().zip(&mut random) {
                    *state = state.wrapping_add(STEP);
                    *random = mix64(*state);
                }
                if !is_drawn::<LENS, TIME>(d) {
                    continue;
                }
                for (seed, random) in scrambles.seeds.iter_mut().zip(&mut random) {
                    *seed = *random as u32;
                    *random = mix64(*random ^ STEP);
                }
                if sampler.kind == PatternKind::Net {
                    scrambles.factors = DigitFactors::draw(random, sampler.digits());
                }
            }
        }
    }
}

struct Finish<'p, 'a, 'o, const LENS: bool, const TIME: bool> {
    patterns: &'p Patterns<'a, LENS, TIME>,
    word: [u32; DIMS],
    out: &'o mut Coordinates,
}

impl<const LENS: bool, const TIME: bool> Kernel for Finish<'_, '_, '_, LENS, TIME> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        let Self {
            patterns,
            word,
            out,
        } = self;
        let is_net = patterns.sampler.kind == PatternKind::Net;
        for (d, out) in out.iter_mut().enumerate() {
            if !is_drawn::<LENS, TIME>(d) {
                continue;
            }
            let out = out.as_chunks_mut::<LANES>().0;
            let scrambles = patterns.scrambles.iter().take(patterns.vectors());
            for (scrambles, out) in scrambles.zip(out) {
                let Scrambles { seeds, factors } = &scrambles[d];
                let digits = match is_net {
                    true => factors.apply(word[d]),
                    false => [word[d]; LANES],
                };
                for ((out, &digits), &seed) in out.iter_mut().zip(&digits).zip(seeds) {
                    *out = unit(scramble_reversed(digits, seed));
                }
            }
        }
    }
}
