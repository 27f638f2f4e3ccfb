//! Joint 5D low-discrepancy samples: place in the pixel, point of the lens, instant of the shutter.
//!
//! Where: ray generation asks a [`PixelSampler`] for `(x, y, u, v, time)` of each sample; the film's
//! [filter](crate::film::filter) warps `(x, y)`, the camera warps `(u, v)` to the lens.
//!
//! The five dimensions are one point set, never padded from smaller ones: once motion and defocus
//! couple them, padded sets fall back to the convergence of independent samples. Two point sets:
//!
//! * [`PatternKind::Sobol`]: progressive, any count: the Sobol sequence (Joe and Kuo 2008).
//! * [`PatternKind::Net`]: for exactly 4^m samples, a (0, m, 5)-net in base 4 (Faure 1982, Niederreiter
//!   1987): each of the elementary boxes of volume 4^-m, of every shape, holds exactly one sample.
//!
//! Both are scrambled by Owen's nested uniform scrambling (Owen 1995) with a hash in place of stored
//! coins (Burley, JCGT 2020), from seeds that differ for each pixel and dimension. So each sample alone is
//! uniform on [0,1)^5, averages are unbiased, and pixels are independent of each other.
//!
//! Invariants: a sample is a pure function of (kind, count, seed, pixel, index), the same bits for any
//! order of calls and any thread; all coordinates lie in [0, 1 - 2^-24]. A prefix of the indices is
//! already well spread: the net visits its points in an order whose first 4^k points are close to a
//! net themselves, so passes can be shown as they come.

mod matrices;
mod scramble;
mod side_by_side;
#[cfg(test)]
mod tests;

use hdtrapeze_simd::Level;
use matrices::{Columns, DIMS, MAX_NET_DIGITS};
use scramble::{DigitFactors, STEP, mix64, scramble_reversed, unit};
pub use side_by_side::{Coordinates, Patterns, SIDE_BY_SIDE};

/// A point set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PatternKind {
    /// Owen-scrambled Sobol sequence: any number of samples, best at powers of 2.
    Sobol,
    /// Owen-scrambled (0, m, 5)-net in base 4: exactly 4^m samples, 4 to 65536.
    Net,
}

/// A net was asked for, for a count of samples that has none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a net needs 4, 16, 64, ... or 65536 samples a pixel, not {samples_per_pixel}")]
pub struct NoSuchNet {
    /// The count asked for.
    pub samples_per_pixel: u32,
}

/// The number m for which `count` is 4^m and a net exists.
fn net_digits(count: u32) -> Option<u32> {
    let digits = count.trailing_zeros() / 2;
    ((1..=MAX_NET_DIGITS).contains(&digits) && count == 1 << (2 * digits)).then_some(digits)
}

/// The sample pattern of an image. Cheap to share between threads.
#[derive(Clone, Debug)]
pub struct PixelSampler {
    kind: PatternKind,
    samples_per_pixel: u32,
    /// Bits of an index inside one point set: 2m for a net, 32 for Sobol.
    index_bits: u32,
    seed: u64,
    /// Instructions that draw samples of pixels side by side.
    level: Level,
    /// `nibbles[k][n]` is the XOR of the columns of the set bits of `n << 4k`.
    nibbles: Vec<[[u32; DIMS]; 16]>,
    /// `steps[k]` leads from index i to i + 1 where i ends in exactly k ones: the XOR of columns 0 to k.
    steps: Columns,
}

impl PixelSampler {
    /// A sampler for `samples_per_pixel` samples (0 counts as 1): the net where there is one for that
    /// count, Sobol otherwise. Patterns of different `seed` are independent replicates.
    pub fn new(samples_per_pixel: u32, seed: u32) -> Self {
        let samples_per_pixel = samples_per_pixel.max(1);
        match net_digits(samples_per_pixel) {
            Some(digits) => Self::build(PatternKind::Net, samples_per_pixel, seed, 2 * digits),
            None => Self::build(PatternKind::Sobol, samples_per_pixel, seed, 32),
        }
    }

    /// A sampler of the kind asked for.
    ///
    /// # Errors
    /// [`NoSuchNet`] for [`PatternKind::Net`] with a count that is not 4^m, 1 <= m <= 8.
    pub fn with_kind(
        kind: PatternKind,
        samples_per_pixel: u32,
        seed: u32,
    ) -> Result<Self, NoSuchNet> {
        let samples_per_pixel = samples_per_pixel.max(1);
        let index_bits = match kind {
            PatternKind::Sobol => 32,
            PatternKind::Net => {
                2 * net_digits(samples_per_pixel).ok_or(NoSuchNet { samples_per_pixel })?
            }
        };
        Ok(Self::build(kind, samples_per_pixel, seed, index_bits))
    }

    fn build(kind: PatternKind, samples_per_pixel: u32, seed: u32, index_bits: u32) -> Self {
        let columns = match kind {
            PatternKind::Sobol => matrices::sobol(),
            PatternKind::Net => matrices::net(index_bits / 2),
        };
        let mut nibbles = vec![[[0; DIMS]; 16]; columns.len().div_ceil(4)];
        for (b, column) in columns.iter().enumerate() {
            for (n, word) in nibbles[b / 4].iter_mut().enumerate() {
                if n >> (b % 4) & 1 == 1 {
                    xor(word, column);
                }
            }
        }
        let mut steps = columns;
        for b in 1..steps.len() {
            let before = steps[b - 1];
            xor(&mut steps[b], &before);
        }
        Self {
            kind,
            samples_per_pixel,
            index_bits,
            level: Level::best(),
            seed: mix64(u64::from(seed).wrapping_mul(STEP).wrapping_add(STEP)),
            nibbles,
            steps,
        }
    }

    /// The same samples, drawn with other instructions than the best that there are.
    #[must_use]
    pub fn with_level(self, level: Level) -> Self {
        Self { level, ..self }
    }

    /// The point set in use.
    pub fn kind(&self) -> PatternKind {
        self.kind
    }

    /// The count that the pattern was made for.
    pub fn samples_per_pixel(&self) -> u32 {
        self.samples_per_pixel
    }

    /// What all pixels' seeds are made of.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// Digits in base 4 that are scrambled: those of a net's numbers; 0 for Sobol, whose bits are.
    pub fn digits(&self) -> u32 {
        match self.kind {
            PatternKind::Sobol => 0,
            PatternKind::Net => self.index_bits / 2,
        }
    }

    /// Point `index` of the set before it is scrambled, bits reversed: the same for all pixels. An index past the count of
    /// a net has none.
    #[inline]
    pub fn word(&self, mut index: u32) -> [u32; DIMS] {
        let mut word = [0; DIMS];
        for table in &self.nibbles {
            if index == 0 {
                break;
            }
            xor(&mut word, &table[(index & 15) as usize]);
            index >>= 4;
        }
        word
    }

    /// The pattern of one pixel. Making it costs about as much as a few samples: keep it for all samples of the
    /// pixel.
    pub fn pixel(&self, pixel: [u32; 2]) -> PixelPattern<'_> {
        self.pixel_of::<true, true>(pixel)
    }

    /// [`Self::pixel`], for [`PixelPattern::sample_of`] with the same parameters.
    pub fn pixel_of<const LENS: bool, const TIME: bool>(
        &self,
        pixel: [u32; 2],
    ) -> PixelPattern<'_> {
        let seed = self.pixel_seed(pixel);
        PixelPattern {
            sampler: self,
            seed,
            scrambles: self.scrambles::<LENS, TIME>(seed, 0),
        }
    }

    /// Sample `index` of `pixel`: `[x, y, u, v, time]`, see [`PixelPattern::sample`].
    pub fn sample(&self, pixel: [u32; 2], index: u32) -> [f32; DIMS] {
        self.pixel(pixel).sample(index)
    }

    /// What all scrambles of a pixel are made of; those of its first point set, from the next number on.
    #[inline(always)]
    fn pixel_seed(&self, pixel: [u32; 2]) -> u64 {
        let place = u64::from(pixel[1]) << 32 | u64::from(pixel[0]);
        mix64(self.seed ^ mix64(place.wrapping_add(STEP)))
    }

    /// Number of the point set of a sample, and its index inside it.
    #[inline]
    fn split(&self, index: u32) -> (u32, u32) {
        match self.index_bits {
            32 => (0, index),
            bits => (index >> bits, index & ((1 << bits) - 1)),
        }
    }

    /// Scrambles of the `epoch`th point set of a pixel.
    fn scrambles<const LENS: bool, const TIME: bool>(
        &self,
        pixel_seed: u64,
        epoch: u32,
    ) -> [Scramble; DIMS] {
        let mut state = pixel_seed ^ mix64(u64::from(epoch).wrapping_mul(STEP));
        std::array::from_fn(|d| {
            state = state.wrapping_add(STEP);
            if !is_drawn::<LENS, TIME>(d) {
                return Scramble::default();
            }
            let random = mix64(state);
            let factors = match self.kind {
                PatternKind::Sobol => DigitFactors::default(),
                PatternKind::Net => DigitFactors::draw([mix64(random ^ STEP)], self.digits()),
            };
            Scramble {
                seed: random as u32,
                factors,
            }
        })
    }
}

fn xor(a: &mut [u32; DIMS], b: &[u32; DIMS]) {
    for d in 0..DIMS {
        a[d] ^= b[d];
    }
}

/// True for the dimensions that are drawn: the pixel's always, the lens' and the time's where they are asked for.
#[inline(always)]
const fn is_drawn<const LENS: bool, const TIME: bool>(dimension: usize) -> bool {
    match dimension {
        0 | 1 => true,
        2 | 3 => LENS,
        _ => TIME,
    }
}

/// How one dimension of one pixel is scrambled.
#[derive(Clone, Copy, Debug, Default)]
struct Scramble {
    seed: u32,
    /// Net only.
    factors: DigitFactors<1>,
}

/// The samples of one pixel.
#[derive(Clone, Debug)]
pub struct PixelPattern<'a> {
    sampler: &'a PixelSampler,
    seed: u64,
    /// Of the first point set; later ones (indices past the count of a net) are rare and derived on demand.
    scrambles: [Scramble; DIMS],
}

impl PixelPattern<'_> {
    /// Sample `index`: `[x, y, u, v, time]`, each in [0, 1 - 2^-24]. `(x, y)` is the place in the pixel before the
    /// filter, `(u, v)` the lens before it is warped to a disk, `time` the part of the shutter.
    ///
    /// Every index is valid: past the count of a net, another net with its own scramble begins.
    pub fn sample(&self, index: u32) -> [f32; DIMS] {
        self.sample_of::<true, true>(index)
    }

    /// [`Self::sample`], with `u` and `v` only for a `LENS` and `time` only with `TIME`; 0 in their place. What is
    /// drawn has the same bits.
    #[inline]
    pub fn sample_of<const LENS: bool, const TIME: bool>(&self, index: u32) -> [f32; DIMS] {
        let (epoch, index) = self.sampler.split(index);
        let word = self.sampler.word(index);
        if epoch == 0 {
            self.finish::<LENS, TIME>(&word, &self.scrambles)
        } else {
            let scrambles = self.sampler.scrambles::<LENS, TIME>(self.seed, epoch);
            self.finish::<LENS, TIME>(&word, &scrambles)
        }
    }

    /// Fills `out` with the samples `first`, `first + 1`, ... (indices wrap after `u32::MAX`): the same
    /// bits as [`Self::sample`], faster.
    pub fn fill(&self, first: u32, out: &mut [[f32; DIMS]]) {
        let (mut epoch, mut index) = self.sampler.split(first);
        let mut word = self.sampler.word(index);
        let mut scrambles = if epoch == 0 {
            self.scrambles
        } else {
            self.sampler.scrambles::<true, true>(self.seed, epoch)
        };
        let last_step = self.sampler.steps.len() - 1;
        for sample in out {
            *sample = self.finish::<true, true>(&word, &scrambles);
            let step = (index.trailing_ones() as usize).min(last_step);
            xor(&mut word, &self.sampler.steps[step]);
            index = index.wrapping_add(1);
            if self.sampler.index_bits < 32 && index >> self.sampler.index_bits != 0 {
                index = 0;
                epoch = (epoch + 1) & (u32::MAX >> self.sampler.index_bits);
                scrambles = self.sampler.scrambles::<true, true>(self.seed, epoch);
            }
        }
    }

    #[inline]
    fn finish<const LENS: bool, const TIME: bool>(
        &self,
        word: &[u32; DIMS],
        scrambles: &[Scramble; DIMS],
    ) -> [f32; DIMS] {
        let is_net = self.sampler.kind == PatternKind::Net;
        std::array::from_fn(|d| {
            if !is_drawn::<LENS, TIME>(d) {
                return 0.0;
            }
            let digits = match is_net {
                true => scrambles[d].factors.apply(word[d])[0],
                false => word[d],
            };
            unit(scramble_reversed(digits, scrambles[d].seed))
        })
    }
}
