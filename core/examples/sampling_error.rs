//! Prints the error and the cost of the sample patterns.
//!
//! Root mean square error of the mean, over independent replicates, of integrands on the unit 5-cube that
//! mimic a pixel under motion and defocus: edges, discs and textures that move with time and shift with the
//! lens point. Beside the two patterns of `hdtrapeze_core::sample`: the same Sobol dimensions padded from
//! independent (x, y), (u, v) and time; jittered grids padded likewise; independent samples.
//!
//! Run: `cargo run --release -p hdtrapeze-core --example sampling_error [replicates]`

use std::f64::consts::FRAC_PI_4;
use std::hint::black_box;
use std::time::Instant;

use hdtrapeze_core::sample::{PatternKind, PixelSampler};

type Point = [f32; 5];
type Integrand = (&'static str, fn([f64; 5]) -> f64);

/// The unit square to the unit disc (Shirley and Chiu's concentric map).
fn disc(u: f64, v: f64) -> [f64; 2] {
    let (a, b) = (2.0 * u - 1.0, 2.0 * v - 1.0);
    if a == 0.0 && b == 0.0 {
        [0.0, 0.0]
    } else if a.abs() > b.abs() {
        let angle = FRAC_PI_4 * b / a;
        [a * angle.cos(), a * angle.sin()]
    } else {
        let angle = FRAC_PI_4 * a / b;
        [b * angle.sin(), b * angle.cos()]
    }
}

/// Where the sample meets an object that moves by `motion` pixels and is defocused by `blur` pixels.
fn seen(p: [f64; 5], motion: [f64; 2], blur: f64) -> [f64; 2] {
    let lens = disc(p[2], p[3]);
    [
        p[0] - 0.5 + motion[0] * (p[4] - 0.5) + blur * lens[0],
        p[1] - 0.5 + motion[1] * (p[4] - 0.5) + blur * lens[1],
    ]
}

const INTEGRANDS: [Integrand; 6] = [
    ("edge", |p| {
        let [x, y] = seen(p, [3.0, 0.5], 1.5);
        f64::from(u8::from(x + 0.3 * y > 0.2))
    }),
    ("disc", |p| {
        let [x, y] = seen(p, [2.0, 1.0], 0.7);
        f64::from(u8::from(x * x + y * y < 0.64))
    }),
    ("blob", |p| {
        let [x, y] = seen(p, [3.0, 0.0], 1.0);
        (-(x * x + y * y)).exp()
    }),
    ("wave", |p| {
        let [x, y] = seen(p, [1.5, 0.6], 0.5);
        0.5 + 0.5 * (3.0 * (x + 0.7 * y)).sin()
    }),
    ("stripes", |p| {
        let [x, y] = seen(p, [2.0, -1.0], 0.8);
        0.7 * x.rem_euclid(1.0) + 0.3 * (1.7 * y).sin()
    }),
    ("product", |p| 4.0 * p.iter().product::<f64>()),
];

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        x ^ (x >> 31)
    }

    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / 16_777_216.0
    }

    fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, (self.next() % (i as u64 + 1)) as usize);
        }
    }
}

/// Joins two planar sets and one linear set, each in its own random order.
fn pad(
    random: &mut Random,
    mut xy: Vec<[f32; 2]>,
    mut uv: Vec<[f32; 2]>,
    mut t: Vec<f32>,
) -> Vec<Point> {
    random.shuffle(&mut xy);
    random.shuffle(&mut uv);
    random.shuffle(&mut t);
    (0..t.len())
        .map(|i| [xy[i][0], xy[i][1], uv[i][0], uv[i][1], t[i]])
        .collect()
}

fn jitter(random: &mut Random, n: usize) -> Vec<Point> {
    let side = n.isqrt();
    let plane = |random: &mut Random| -> Vec<[f32; 2]> {
        (0..n)
            .map(|i| {
                [
                    ((i % side) as f32 + random.unit()) / side as f32,
                    ((i / side) as f32 + random.unit()) / side as f32,
                ]
            })
            .collect()
    };
    let (xy, uv) = (plane(random), plane(random));
    let t = (0..n)
        .map(|i| (i as f32 + random.unit()) / n as f32)
        .collect();
    pad(random, xy, uv, t)
}

fn padded(random: &mut Random, n: usize) -> Vec<Point> {
    let mut set = || {
        let seed = random.next() as u32;
        pattern(PatternKind::Sobol, n, seed, 0)
    };
    let (a, b, c) = (set(), set(), set());
    let plane = |s: &[Point]| s.iter().map(|p| [p[0], p[1]]).collect();
    pad(
        random,
        plane(&a),
        plane(&b),
        c.iter().map(|p| p[0]).collect(),
    )
}

fn pattern(kind: PatternKind, n: usize, seed: u32, replicate: u32) -> Vec<Point> {
    let mut points = vec![[0.0; 5]; n];
    if let Ok(sampler) = PixelSampler::with_kind(kind, n as u32, seed) {
        sampler.pixel([replicate, 0]).fill(0, &mut points);
    }
    points
}

const PATTERNS: [&str; 5] = [
    "net",
    "joint Sobol",
    "padded Sobol",
    "jitter",
    "independent",
];

fn draw(which: usize, n: usize, replicate: u32) -> Vec<Point> {
    let mut random = Random(u64::from(replicate) << 32 | n as u64);
    match which {
        0 => pattern(PatternKind::Net, n, 1, replicate),
        1 => pattern(PatternKind::Sobol, n, 1, replicate),
        2 => padded(&mut random, n),
        3 => jitter(&mut random, n),
        _ => (0..n)
            .map(|_| std::array::from_fn(|_| random.unit()))
            .collect(),
    }
}

fn mean(points: &[Point], f: fn([f64; 5]) -> f64) -> f64 {
    points.iter().map(|p| f(p.map(f64::from))).sum::<f64>() / points.len() as f64
}

fn main() {
    let replicates = std::env::args()
        .nth(1)
        .and_then(|a| a.parse().ok())
        .unwrap_or(400);
    let truth = INTEGRANDS.map(|(_, f)| {
        (0..4)
            .map(|r| mean(&pattern(PatternKind::Sobol, 1 << 20, 99, r), f))
            .sum::<f64>()
            / 4.0
    });

    println!(
        "RMSE of the mean, {replicates} replicates; the last column is the root of the mean square"
    );
    for n in [16usize, 64, 256, 1024] {
        print!("\n{n:>5} samples  ");
        INTEGRANDS.iter().for_each(|(name, _)| print!("{name:>9}"));
        println!("{:>9}", "all");
        for (which, name) in PATTERNS.iter().enumerate() {
            let mut squares = [0.0; INTEGRANDS.len()];
            for r in 0..replicates {
                let points = draw(which, n, r);
                for (k, (_, f)) in INTEGRANDS.iter().enumerate() {
                    squares[k] += (mean(&points, *f) - truth[k]).powi(2) / f64::from(replicates);
                }
            }
            print!("{name:<15}");
            squares.iter().for_each(|s| print!("{:9.5}", s.sqrt()));
            println!(
                "{:9.5}",
                (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
            );
        }
    }

    println!("\ncost, nanoseconds a sample");
    for n in [64usize, 1024] {
        for kind in [PatternKind::Net, PatternKind::Sobol] {
            let Ok(sampler) = PixelSampler::with_kind(kind, n as u32, 1) else {
                continue;
            };
            let pixels = (1 << 22) / n as u32;
            let mut points = vec![[0.0; 5]; n];
            let start = Instant::now();
            for x in 0..pixels {
                sampler.pixel([x, 0]).fill(0, black_box(&mut points));
            }
            let fill = start.elapsed().as_nanos() as f64 / f64::from(pixels * n as u32);
            let start = Instant::now();
            for x in 0..pixels {
                let pixel = sampler.pixel([x, 0]);
                for (i, p) in points.iter_mut().enumerate() {
                    *p = pixel.sample(i as u32);
                }
                black_box(&mut points);
            }
            let single = start.elapsed().as_nanos() as f64 / f64::from(pixels * n as u32);
            let start = Instant::now();
            for x in 0..pixels {
                black_box(sampler.pixel(black_box([x, 0])));
            }
            let setup = start.elapsed().as_nanos() as f64 / f64::from(pixels);
            println!(
                "{kind:?} of {n}: fill {fill:.1}, sample {single:.1}, setup {setup:.0} a pixel"
            );
        }
    }
}
