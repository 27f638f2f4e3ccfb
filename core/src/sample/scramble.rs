//! Seeds and nested uniform (Owen) scrambling by hashing.
//!
//! Scrambling flips every bit of a coordinate by a coin that depends on all higher bits, so any two
//! points that share a cell of side 2^-k still share one afterwards, and every point becomes uniform
//! on its own. Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020, after Laine and
//! Karras (2011): on the bit-reversed word, multiplications by even numbers and additions carry only
//! towards higher bits, that is, towards the *lower* bits of the coordinate. The mixing constants are
//! those that N. Vegdahl published in 2021.

/// Mixes 64 bits so that each output bit depends on each input bit (the finalizer of SplitMix64).
#[inline(always)]
pub(super) fn mix64(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Increment of SplitMix64: steps through seeds that are far apart after [`mix64`].
pub(super) const STEP: u64 = 0x9e37_79b9_7f4a_7c15;

/// Scrambles a coordinate given with its bits reversed (bit 0 is the half), and puts the bits in
/// their usual order (bit 31 is the half).
#[inline(always)]
pub(super) fn scramble_reversed(mut x: u32, seed: u32) -> u32 {
    x ^= x.wrapping_mul(0x3d20_adea);
    x = x.wrapping_add(seed);
    x = x.wrapping_mul((seed >> 16) | 1);
    x ^= x.wrapping_mul(0x0552_6c56);
    x ^= x.wrapping_mul(0x53a2_2864);
    x.reverse_bits()
}

/// The upper 24 bits as a number in [0, 1 - 2^-24]: exact, so never rounded up to 1.
#[inline(always)]
pub(super) fn unit(x: u32) -> f32 {
    (x >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Multiplies the sixteen base-4 digits of a word, each by its own non-zero element of GF(4).
///
/// Digits are elements `hi w + lo` with `w^2 = w + 1`. Followed by a binary nested scramble this gives
/// any two points the same joint distribution as Owen's scramble in base 4 (a digit's difference
/// becomes uniform over the three non-zero ones), hence the same variance of every estimate.
/// Of `N` words, side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct DigitFactors<const N: usize> {
    /// Low bit of each digit that `w` or 1 + `w` multiplies (both mix the halves).
    mixes: [u32; N],
    /// Low bit of each digit whose high half keeps the old high half (factors 1 and `w`).
    high_keeps: [u32; N],
    /// Low bit of each digit whose low half keeps the old low half (factors 1 and 1 + `w`).
    low_keeps: [u32; N],
}

/// The low bit of every digit of a bit-reversed word: digit r has its high half in bit 2r and its
/// low half in bit 2r + 1, and the masks sit at bit 2r.
const DIGITS: u32 = 0x5555_5555;

impl<const N: usize> Default for DigitFactors<N> {
    /// Nothing is multiplied.
    #[inline(always)]
    fn default() -> Self {
        Self {
            mixes: [0; N],
            high_keeps: [DIGITS; N],
            low_keeps: [DIGITS; N],
        }
    }
}

impl<const N: usize> DigitFactors<N> {
    /// Draws `digits` factors for each word, uniformly and independently, from 64 random bits each. Nothing branches on them.
    #[inline(always)]
    pub(super) fn draw(mut random: [u64; N], digits: u32) -> Self {
        let mut out = Self::default();
        for r in 0..digits.min(16) {
            for (i, random) in random.iter_mut().enumerate() {
                // Three times the random number: the factor is what is above 64 bits, and the rest is the next number.
                let twice = *random << 1;
                let product = twice.wrapping_add(*random);
                let factor = (*random >> 63) as u32 + u32::from(product < twice);
                *random = product;
                // 1, `w` and 1 + `w`, of which the last keeps the low half.
                let (low, high) = (factor & 1, factor >> 1);
                out.mixes[i] |= (low | high) << (2 * r);
                out.low_keeps[i] &= !(low << (2 * r));
                out.high_keeps[i] &= !(high << (2 * r));
            }
        }
        out
    }

    /// Applies each word's factors to a bit-reversed word.
    #[inline(always)]
    pub(super) fn apply(&self, x: u32) -> [u32; N] {
        let high = x & DIGITS;
        let low = (x >> 1) & DIGITS;
        let mut out = [0; N];
        for (i, out) in out.iter_mut().enumerate() {
            let new_high = (high & self.high_keeps[i]) ^ (low & self.mixes[i]);
            let new_low = (low & self.low_keeps[i]) ^ (high & self.mixes[i]);
            *out = new_high | (new_low << 1);
        }
        out
    }
}
