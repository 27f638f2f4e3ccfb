//! Oracles: elementary boxes counted one by one, closed-form integrals, and bits written down.

use super::*;

fn points(sampler: &PixelSampler, pixel: [u32; 2], count: u32) -> Vec<[f32; DIMS]> {
    let mut out = vec![[0.0; DIMS]; count as usize];
    sampler.pixel(pixel).fill(0, &mut out);
    out
}

/// All ways to write `total` as an ordered sum of five numbers.
fn compositions(total: u32) -> Vec<[u32; DIMS]> {
    let mut all = Vec::new();
    for a in 0..=total {
        for b in 0..=total - a {
            for c in 0..=total - a - b {
                for d in 0..=total - a - b - c {
                    all.push([a, b, c, d, total - a - b - c - d]);
                }
            }
        }
    }
    all
}

/// The fewest and most points in a box of side 2^-bits[d] along each axis.
fn box_counts(points: &[[f32; DIMS]], bits: [u32; DIMS]) -> (u32, u32) {
    let mut counts = vec![0u32; 1 << bits.iter().sum::<u32>()];
    for p in points {
        let mut cell = 0usize;
        for d in 0..DIMS {
            cell = (cell << bits[d]) | (f64::from(p[d]) * f64::from(1u32 << bits[d])) as usize;
        }
        counts[cell] += 1;
    }
    (
        counts.iter().copied().min().unwrap_or(0),
        counts.iter().copied().max().unwrap_or(0),
    )
}

#[test]
fn net_has_one_point_in_every_elementary_box() {
    for m in 1..=5u32 {
        let sampler = PixelSampler::new(1 << (2 * m), 7);
        assert_eq!(sampler.kind(), PatternKind::Net);
        for pixel in [[0, 0], [3, 1], [1919, 1079]] {
            let points = points(&sampler, pixel, 1 << (2 * m));
            for shape in compositions(m) {
                let bits = shape.map(|k| 2 * k);
                assert_eq!(box_counts(&points, bits), (1, 1), "m {m} shape {shape:?}");
            }
        }
    }
}

#[test]
fn large_nets_keep_the_property() {
    for m in 6..=MAX_NET_DIGITS {
        let points = points(&PixelSampler::new(1 << (2 * m), 1), [5, 6], 1 << (2 * m));
        for shape in compositions(m).into_iter().step_by(7) {
            let bits = shape.map(|k| 2 * k);
            assert_eq!(box_counts(&points, bits), (1, 1), "m {m} shape {shape:?}");
        }
    }
}

#[test]
fn sobol_is_a_5_5_sequence_in_base_2() {
    // t is the sum of the degrees less one: 0 (van der Corput), 0, 1, 2, 2. Every block of 2^m points counts.
    let sampler = PixelSampler::with_kind(PatternKind::Sobol, 100, 3).unwrap();
    for m in 5..=10u32 {
        for block in [0u32, 1, 6] {
            let mut points = vec![[0.0; DIMS]; 1 << m];
            sampler.pixel([9, 2]).fill(block << m, &mut points);
            for bits in compositions(m - 5) {
                assert_eq!(box_counts(&points, bits), (32, 32), "m {m} bits {bits:?}");
            }
            for d in 0..DIMS {
                let mut bits = [0; DIMS];
                bits[d] = m;
                assert_eq!(box_counts(&points, bits), (1, 1), "axis {d} of {m}");
            }
        }
    }
}

#[test]
fn prefixes_of_nets_fill_every_axis() {
    // Of the first 4^k points, at most two share an interval of length 4^-k of an axis.
    for m in 2..=MAX_NET_DIGITS {
        let points = points(&PixelSampler::new(1 << (2 * m), 11), [2, 3], 1 << (2 * m));
        for k in 1..m {
            for d in 0..DIMS {
                let mut bits = [0; DIMS];
                bits[d] = 2 * k;
                let (_, most) = box_counts(&points[..1 << (2 * k)], bits);
                assert!(most <= 2, "m {m} k {k} axis {d}: {most}");
            }
        }
    }
}

#[test]
fn never_one_even_where_all_bits_are_set() {
    assert_eq!(unit(u32::MAX), 1.0 - f32::EPSILON / 2.0);
    for count in [1, 5, 64, 1024] {
        let sampler = PixelSampler::new(count, 0);
        for x in 0..64 {
            for p in points(&sampler, [x, 17], count) {
                assert!(p.iter().all(|&c| (0.0..1.0).contains(&c)), "{p:?}");
            }
        }
    }
}

#[test]
fn each_sample_alone_is_uniform() {
    // One index over many pixels: its first six bits and its last six are uniform, dimensions uncorrelated.
    for kind in [PatternKind::Sobol, PatternKind::Net] {
        let sampler = PixelSampler::with_kind(kind, 64, 5).unwrap();
        for index in [0, 1, 37] {
            let n = 64 * 256;
            let mut high = vec![[0u32; 64]; DIMS];
            let mut low = vec![[0u32; 64]; DIMS];
            let mut cross = [[0.0f64; DIMS]; DIMS];
            for i in 0..n {
                let p = sampler.sample([i % 128, i / 128], index);
                for d in 0..DIMS {
                    let bits = (p[d] * 16_777_216.0) as u32;
                    high[d][(bits >> 18) as usize] += 1;
                    low[d][(bits & 63) as usize] += 1;
                    for (e, sum) in cross[d][..d].iter_mut().enumerate() {
                        *sum += (f64::from(p[d]) - 0.5) * (f64::from(p[e]) - 0.5);
                    }
                }
            }
            for d in 0..DIMS {
                for counts in [&high[d], &low[d]] {
                    let expected = f64::from(n) / 64.0;
                    let chi2: f64 = counts
                        .iter()
                        .map(|&c| (f64::from(c) - expected).powi(2) / expected)
                        .sum();
                    // 63 degrees of freedom: mean 63, deviation 11.2; five deviations either side.
                    assert!((10.0..120.0).contains(&chi2), "{kind:?} {index} {d} {chi2}");
                }
                for (e, sum) in cross[d][..d].iter().enumerate() {
                    let correlation = sum * 12.0 / f64::from(n);
                    assert!(
                        correlation.abs() < 5.0 / f64::from(n).sqrt(),
                        "{d} {e} {correlation}"
                    );
                }
            }
        }
    }
}

#[test]
fn neighbouring_pixels_and_seeds_are_independent() {
    // Correlation over pixels between sample i of a pixel and of its neighbour, and of another seed.
    let a = PixelSampler::new(16, 1);
    let b = PixelSampler::new(16, 2);
    let n = 20_000;
    for d in 0..DIMS {
        let mut sums = [0.0f64; 3];
        for i in 0..n {
            let at = [i % 200, i / 200];
            let centred = |s: &PixelSampler, p| f64::from(s.sample(p, 3)[d]) - 0.5;
            let here = centred(&a, at);
            sums[0] += here * centred(&a, [at[0] + 1, at[1]]);
            sums[1] += here * centred(&a, [at[0], at[1] + 1]);
            sums[2] += here * centred(&b, at);
        }
        for sum in sums {
            assert!(
                (sum * 12.0 / f64::from(n)).abs() < 5.0 / f64::from(n).sqrt(),
                "axis {d}: {sum}"
            );
        }
    }
}

/// With each instruction set, for blocks of any size and samples past the count, what is drawn side by side is what is drawn alone.
#[test]
fn samples_side_by_side_are_those_of_pixels_alone() {
    fn check<const LENS: bool, const TIME: bool>(sampler: &PixelSampler) {
        for count in [1, 5, 16, 17, 49, SIDE_BY_SIDE] {
            // On both sides of an image's left edge.
            let pixel = |i: u32| [(i % 8).wrapping_sub(3), 1000 + i / 8];
            let pixels: Vec<[u32; 2]> = (0..count as u32).map(pixel).collect();
            let patterns = Patterns::<LENS, TIME>::new(sampler, &pixels);
            let mut drawn: Coordinates = [[0.0; SIDE_BY_SIDE]; DIMS];
            for index in [0, 1, 2, 7, 63, 64, 130, u32::MAX] {
                patterns.sample(index, &mut drawn);
                for (i, &pixel) in pixels.iter().enumerate() {
                    let alone = sampler.pixel(pixel).sample(index);
                    for d in (0..DIMS).filter(|&d| is_drawn::<LENS, TIME>(d)) {
                        assert_eq!(drawn[d][i], alone[d], "{sampler:?} {pixel:?} {index} {d}");
                    }
                }
            }
        }
    }
    for count in [1, 4, 64, 100, 4096] {
        for level in Level::available() {
            let sampler = PixelSampler::new(count, 9).with_level(level);
            check::<true, true>(&sampler);
            check::<false, true>(&sampler);
            check::<true, false>(&sampler);
            check::<false, false>(&sampler);
        }
    }
}

#[test]
fn bits_do_not_depend_on_order_or_route() {
    for sampler in [PixelSampler::new(64, 9), PixelSampler::new(100, 9)] {
        let pixel = sampler.pixel([12, 34]);
        let mut run = vec![[0.0; DIMS]; 300];
        pixel.fill(0, &mut run);
        for i in (0..300).rev() {
            assert_eq!(run[i as usize], sampler.sample([12, 34], i));
        }
        let mut part = vec![[0.0; DIMS]; 100];
        pixel.fill(57, &mut part);
        assert_eq!(part, run[57..157]);
        // Wraps without a panic.
        pixel.fill(u32::MAX - 1, &mut part[..4]);
        assert_eq!(part[1], pixel.sample(u32::MAX));
        assert_eq!(part[2], pixel.sample(0));
    }
}

#[test]
fn golden_bits() {
    let bits = |count, pixel, index| {
        PixelSampler::new(count, 42)
            .sample(pixel, index)
            .map(|x| (x * 16_777_216.0) as u32)
    };
    assert_eq!(
        bits(1024, [0, 0], 0),
        [8346304, 5415256, 7969325, 1347125, 8127940]
    );
    assert_eq!(
        bits(1024, [1919, 1079], 777),
        [13145454, 598750, 3684731, 5595974, 863484]
    );
    assert_eq!(
        bits(100, [0, 0], 0),
        [8346304, 5415256, 7969325, 1347125, 8127940]
    );
    assert_eq!(
        bits(100, [1919, 1079], 77),
        [5059746, 619700, 1226646, 10934092, 15348245]
    );
}

#[test]
fn kinds_are_chosen_by_count() {
    for count in [4, 16, 64, 256, 1024, 4096, 16384, 65536] {
        assert_eq!(PixelSampler::new(count, 0).kind(), PatternKind::Net);
    }
    for count in [0, 1, 2, 3, 8, 32, 100, 529, 1 << 18, u32::MAX] {
        assert_eq!(PixelSampler::new(count, 0).kind(), PatternKind::Sobol);
    }
    assert_eq!(PixelSampler::new(0, 0).samples_per_pixel(), 1);
    assert_eq!(
        PixelSampler::with_kind(PatternKind::Net, 529, 0).unwrap_err(),
        NoSuchNet {
            samples_per_pixel: 529
        }
    );
}

/// Root mean square error over pixels of the mean of `f` over the first `count` samples.
fn error(
    mut sample: impl FnMut(u32, u32) -> [f32; DIMS],
    count: u32,
    f: &dyn Fn([f64; DIMS]) -> f64,
    truth: f64,
) -> f64 {
    let pixels = 200;
    let mut square = 0.0;
    for pixel in 0..pixels {
        let sum: f64 = (0..count).map(|i| f(sample(pixel, i).map(f64::from))).sum();
        square += (sum / f64::from(count) - truth).powi(2);
    }
    (square / f64::from(pixels)).sqrt()
}

fn independent(pixel: u32, index: u32) -> [f32; DIMS] {
    let mut state = mix64(u64::from(pixel) << 32 | u64::from(index));
    std::array::from_fn(|_| {
        state = state.wrapping_add(STEP);
        unit(mix64(state) as u32)
    })
}

/// Integrands with known integrals: each coordinate alone, a coupled product, and an edge that moves and blurs.
type Integrand = (&'static str, Box<dyn Fn([f64; DIMS]) -> f64>, f64);

fn integrands() -> Vec<Integrand> {
    let mut all: Vec<Integrand> = Vec::new();
    for d in 0..DIMS {
        all.push(("coordinate", Box::new(move |p: [f64; DIMS]| p[d]), 0.5));
    }
    all.push((
        "product",
        Box::new(|p: [f64; DIMS]| p.iter().product::<f64>() * 8.0),
        0.25,
    ));
    all.push((
        "wave",
        // The real part of a product of five complex integrals of exp(i w x) over [0, 1].
        Box::new(|p: [f64; DIMS]| (p[0] + 0.5 * p[1] + p[2] + p[3] - 3.0 * p[4]).cos()),
        {
            let waves = [1.0, 0.5, 1.0, 1.0, -3.0f64];
            let size: f64 = waves.iter().map(|w| (w / 2.0).sin() / (w / 2.0)).product();
            size * (waves.iter().sum::<f64>() / 2.0).cos()
        },
    ));
    // By symmetry about the centre of the cube the half-space takes half of it.
    all.push((
        "edge",
        Box::new(|p: [f64; DIMS]| {
            let s = p[0] + 0.3 * p[1] + 0.8 * p[2] - 0.6 * p[3] + 2.0 * p[4];
            f64::from(u8::from(s > 1.75))
        }),
        0.5,
    ));
    all
}

#[test]
fn converges_faster_than_independent_samples() {
    for (name, f, truth) in integrands() {
        let reference = error(independent, 1024, &*f, truth);
        for kind in [PatternKind::Sobol, PatternKind::Net] {
            let sampler = PixelSampler::with_kind(kind, 1024, 1).unwrap();
            let e = error(|p, i| sampler.sample([p, 0], i), 1024, &*f, truth);
            assert!(
                e < 0.5 * reference,
                "{name} {kind:?}: {e} against {reference}"
            );
        }
    }
}

#[test]
fn prefixes_are_no_worse_than_independent_samples() {
    for count in [16u32, 64, 256, 1024] {
        let sampler = PixelSampler::new(count, 1);
        for prefix in (1..).map(|k| 1 << k).take_while(|&n| n < count) {
            let mut total = (0.0, 0.0);
            for (name, f, truth) in integrands() {
                let reference = error(independent, prefix, &*f, truth);
                let e = error(|p, i| sampler.sample([p, 1], i), prefix, &*f, truth);
                // Two points of the net of 16 always share an interval of one axis, so one integrand may
                // lose at prefixes between powers of 4; the slack covers 200 pixels' uncertainty.
                let slack = if prefix.ilog2() % 2 == 0 { 1.2 } else { 1.7 };
                assert!(
                    e < slack * reference,
                    "{name} {prefix} of {count}: {e} against {reference}"
                );
                total = (total.0 + e * e, total.1 + reference * reference);
            }
            assert!(total.0 < total.1, "{prefix} of {count}: {total:?}");
        }
    }
}
