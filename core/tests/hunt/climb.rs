//! The hunter: random starts, and from each a climb to what comes nearest to a violation.

use std::cmp::Ordering;

use crate::trace_scenes::Rng;

/// A candidate: bits that a hunt reads its numbers from.
pub struct Genes<'a> {
    bits: &'a [u64],
    next: usize,
}

impl Genes<'_> {
    /// The next 64 bits; candidates read what they need.
    pub fn bits(&mut self) -> u64 {
        self.next += 1;
        self.bits[(self.next - 1) % self.bits.len()]
    }

    /// Below `n`.
    pub fn below(&mut self, n: u64) -> usize {
        ((self.bits() >> 32) % n) as usize
    }

    /// A whole number in a range, both inclusive.
    pub fn whole(&mut self, from: i32, to: i32) -> i32 {
        from + self.below((to - from + 1) as u64) as i32
    }

    /// In [0, 1], now and then an end or something tiny.
    pub fn unit(&mut self) -> f32 {
        let bits = self.bits();
        let x = (bits & 0xff_ffff) as f32 / (1 << 24) as f32;
        match bits >> 60 {
            0 => 0.0,
            1 => 1.0,
            2 => x * (-((bits >> 32 & 0x7f) as f32)).exp2(),
            3 => 1.0 - x * (-((bits >> 32 & 0xf) as f32)).exp2(),
            _ => x,
        }
    }

    /// Of magnitude `2^from` to `2^(to + 1)`, below f32's normal numbers too; one in 16 is zero, and one in 8 has a
    /// mantissa near a power of two, where rounding is worst.
    pub fn float(&mut self, from: i32, to: i32) -> f32 {
        let bits = self.bits();
        let mantissa = match bits >> 24 & 15 {
            0 => return 0.0,
            1 => bits & 7,
            2 => 0x7f_ffff - (bits & 7),
            _ => bits & 0x7f_ffff,
        };
        let exponent = from + ((bits >> 32 & 0xffff) % (to - from + 1) as u64) as i32;
        let x = 1.0 + mantissa as f64 / f64::from(1 << 23);
        let sign = if bits >> 63 == 0 { 1.0 } else { -1.0 };
        (sign * x * f64::from(exponent).exp2()) as f32
    }
}

fn mutate(genes: &mut [u64], rng: &mut Rng) {
    for _ in 0..1 + rng.below(3) {
        let (at, other) = (rng.below(genes.len()), rng.below(genes.len()));
        match rng.below(6) {
            0 => genes[at] = rng.bits(),
            1 => genes[at] = genes[other],
            // A bit of the mantissa, the mantissa, its neighbours, the exponent.
            2 => genes[at] ^= 1 << rng.below(24),
            3 => genes[at] = genes[at] & !0x7f_ffff | rng.bits() & 0x7f_ffff,
            4 => genes[at] = genes[at].wrapping_add(rng.below(9) as u64).wrapping_sub(4),
            _ => {
                genes[at] = genes[at]
                    .wrapping_add((rng.below(9) as u64) << 32)
                    .wrapping_sub(4 << 32)
            }
        }
    }
}

/// The most that was found.
#[derive(Debug)]
pub struct Found {
    pub score: f64,
    pub genes: Vec<u64>,
    pub tried: usize,
}

/// Climbs: `score` is greater the nearer a candidate comes to a violation, and NEG_INFINITY (or NaN) where
/// a candidate says nothing. `HDTRAPEZE_HUNT=n` tries `n` times as many candidates, from other seeds.
pub fn climb(
    count: usize,
    length: usize,
    seed: u64,
    mut score: impl FnMut(&mut Genes<'_>) -> f64,
) -> Found {
    /// Failures in a row before a new start.
    const PATIENCE: usize = 1000;
    let times: usize = std::env::var("HDTRAPEZE_HUNT")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(1);
    let mut rng = Rng(seed.wrapping_add(times as u64 - 1));
    let mut best = Found {
        score: f64::NEG_INFINITY,
        genes: vec![0; length],
        tried: 0,
    };
    let mut at: (f64, Vec<u64>) = (f64::NEG_INFINITY, Vec::new());
    let mut failures = PATIENCE;
    while best.tried < count * times {
        best.tried += 1;
        let genes: Vec<u64> = if failures >= PATIENCE {
            at.0 = f64::NEG_INFINITY;
            failures = 0;
            (0..length).map(|_| rng.bits()).collect()
        } else {
            let mut genes = at.1.clone();
            mutate(&mut genes, &mut rng);
            genes
        };
        let value = score(&mut Genes {
            bits: &genes,
            next: 0,
        });
        failures += 1;
        if at.0 == f64::NEG_INFINITY && value.partial_cmp(&at.0) != Some(Ordering::Greater) {
            // A start that says nothing leads nowhere.
            failures = PATIENCE;
        }
        if at.1.is_empty() || value >= at.0 {
            if value > at.0 {
                failures = 0;
            }
            at = (value, genes);
            if at.0 > best.score {
                (best.score, best.genes) = (at.0, at.1.clone());
            }
        }
    }
    best
}

impl Found {
    /// Fails unless the worst candidate used between `least` (below, the hunt itself would be blunt) and all of a
    /// pad.
    pub fn check(&self, what: &str, least: f64) {
        println!(
            "{what}: worst {:.3} of the pad, {} tried",
            self.score, self.tried
        );
        assert!(
            self.score <= 1.0,
            "{what}: {:.6} of the pad: {:?}",
            self.score,
            self.genes
        );
        assert!(
            self.score >= least,
            "{what}: the hunt reached only {:.3}",
            self.score
        );
    }
}
