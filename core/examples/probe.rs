//! scratch
#[path = "../tests/trace_scenes/mod.rs"]
mod trace_scenes;
use glam::{DVec3, Vec3};
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World};
use trace_scenes::*;
fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    s.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
}
fn rays(
    eye: Vec3,
    target: Vec3,
    radius: f32,
    half: f32,
    w: usize,
    h: usize,
    spp: usize,
) -> Vec<Ray> {
    let fw = (target - eye).normalize();
    let right = fw.cross(Vec3::Y).normalize();
    let up = right.cross(fw);
    let focus = (target - eye).length();
    let mut rng = Rng(42);
    let mut out = vec![];
    let tile: usize = std::env::var("TILE").map_or(4, |x| x.parse().unwrap());
    for ty in 0..h / tile {
        for tx in 0..w / tile {
            for s in 0..spp {
                for p in 0..tile * tile {
                    let x = (tx * tile + p % tile) as f32 + rng.unit();
                    let y = (ty * tile + p / tile) as f32 + rng.unit();
                    let time = (s as f32 + rng.unit()) / spp as f32;
                    let px = (x / w as f32 * 2.0 - 1.0) * half * focus;
                    let py = (y / h as f32 * 2.0 - 1.0) * half * focus * h as f32 / w as f32;
                    let (r, phi) = (
                        rng.unit().sqrt() * radius,
                        rng.unit() * std::f32::consts::TAU,
                    );
                    let lens = right * (r * phi.cos()) + up * (r * phi.sin());
                    let f = right * px + up * py + fw * focus;
                    out.push(ray(eye + lens, (f - lens).normalize(), time));
                }
            }
        }
    }
    out
}
fn main() {
    let only: Vec<String> = std::env::args().skip(1).collect();
    for (motion, k) in [("static", 1), ("moving", 2)] {
        for name in ["sheet", "patches", "fur"] {
            let label = format!("{name}-{motion}");
            if !only.is_empty() && !only.iter().any(|o| label.contains(o.as_str())) {
                continue;
            }
            let (mesh, rays) = match name {
                "sheet" => (
                    sheet(62, 16, &keys(k)),
                    rays(
                        Vec3::new(0.3, -1.6, 1.8),
                        Vec3::ZERO,
                        0.03,
                        0.45,
                        1280,
                        720,
                        std::env::var("SPP").map_or(4, |x| x.parse().unwrap()),
                    ),
                ),
                "patches" => (
                    patches(4000, 16, &keys(k), 1),
                    rays(
                        Vec3::new(0.4, 0.3, 4.0),
                        Vec3::ZERO,
                        0.05,
                        0.35,
                        1280,
                        720,
                        std::env::var("SPP").map_or(4, |x| x.parse().unwrap()),
                    ),
                ),
                _ => (
                    fur(31250, &keys(k), 1),
                    rays(
                        Vec3::new(0.2, -1.5, 1.5),
                        Vec3::new(0.0, 0.0, 0.1),
                        0.02,
                        0.3,
                        640,
                        360,
                        1,
                    ),
                ),
            };
            let rep: usize = std::env::var("REP").map_or(1, |x| x.parse().unwrap());
            let rays: Vec<Ray> = if rep > 1 {
                rays.chunks(16)
                    .flat_map(|c| (0..rep).flat_map(|_| c.to_vec()))
                    .collect()
            } else {
                rays
            };
            let cells = mesh.cell_count() as f64;
            if std::env::var("BUILD").is_ok() {
                let mut best = f64::INFINITY;
                let mut cpu1 = 0.0;
                for _ in 0..12 {
                    let m = mesh.clone();
                    let t = std::time::Instant::now();
                    let c = cpu();
                    let o = hdtrapeze_core::bvh::ObjectGeometry::new(m);
                    best = best.min(t.elapsed().as_secs_f64());
                    cpu1 = cpu() - c;
                    std::hint::black_box(o.stats());
                }
                println!(
                    "{label} build best {:.1} Mq/s wall, {:.1} cpu",
                    cells / best * 1e-6,
                    cells / cpu1 * 1e-6
                );
                continue;
            }
            let t = std::time::Instant::now();
            let object = object(mesh);
            let build = t.elapsed().as_secs_f64();
            let st = *object.stats();
            let world = World::build(
                vec![instance(
                    &object,
                    InstanceTransform::Translation(DVec3::ZERO),
                )],
                DVec3::ZERO,
            );
            for (single, level) in [true, false].into_iter().flat_map(|s| {
                hdtrapeze_simd::Level::available()
                    .into_iter()
                    .rev()
                    .take(if std::env::var("BEST").is_ok() { 1 } else { 2 })
                    .map(move |l| (s, l))
            }) {
                if std::env::var("BEST").is_ok() && single {
                    continue;
                }
                let world = world.clone().with_level(level);
                let mut best = f64::INFINITY;
                let mut hits = vec![Hit::MISS; rays.len()];
                let mut c = TraceCounts::default();
                for _ in 0..3 {
                    c = TraceCounts::default();
                    let t = cpu();
                    for (r, h) in rays.chunks(4096).zip(hits.chunks_mut(4096)) {
                        if single {
                            for (r, h) in r.iter().zip(h) {
                                *h = world.trace(r, &mut c);
                            }
                        } else {
                            world.trace_many(r, h, &mut c);
                        }
                    }
                    best = best.min(cpu() - t);
                }
                let n = rays.len() as f64;
                let sum: f64 = hits
                    .iter()
                    .filter(|h| h.is_hit())
                    .map(|h| f64::from(h.t))
                    .sum();
                println!(
                    "{label:<16} {single:<5} {:<7} build(wall) {:5.1} Mq/s  {:7.3} Mrays/s/core  {:5.2} B/quad nodes {:6.2} cells {:6.2} hit {:.4} sum {:.3} ob {}/{}",
                    level.name(),
                    cells / build * 1e-6,
                    n / best * 1e-6,
                    st.bvh_bytes as f64 / cells,
                    c.node_tests as f64 / n,
                    c.cell_tests as f64 / n,
                    hits.iter().filter(|h| h.is_hit()).count() as f64 / n,
                    sum,
                    st.oriented_blocks,
                    st.blocks
                );
            }
        }
    }
}
