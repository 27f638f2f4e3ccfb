//! What several linear segments of motion cost against one: scenes whose points run straight, nearly
//! straight, and along arcs, with 2, 3, 5 and 9 keys. `cargo bench -p hdtrapeze-core --bench segments
//! [-- SCENE [MILLIONS]]`; without `--bench` (as under `cargo test`) a small run that only checks.
//!
//! Ratios are to the same scene with one segment, from first key to last; where that would fold the scene
//! up (half a turn), to one of the segments of nine keys over the whole shutter. What moves eight times as far as
//! that costs more for this alone, since rays of a packet, each at its own time, meet less in common: the scenes
//! named "slow" make an eighth of the turn however many keys they have. The same for rays of 4 and of 16 samples a
//! pixel: what is traced together is nearer in time where there are more; counts are of 16. Times are of one thread and in turns, the
//! best of several, by the clock on the wall. A sample of hits is checked against brute force before anything is printed.

#[path = "../tests/trace_scenes/mod.rs"]
mod trace_scenes;

use std::f32::consts::PI;
use std::time::Instant;

use glam::{DVec3, Vec3};
use hdtrapeze_core::bvh::object::Blas;
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World, brute};
use trace_scenes::curved::*;
use trace_scenes::lens::Lens;
use trace_scenes::*;

/// Samples a pixel.
const SAMPLES: [usize; 2] = [4, 16];

/// A world and what tracing it takes.
struct Case {
    keys: usize,
    world: World,
    kind: &'static str,
    bytes: f64,
    build: f64,
    /// Nanoseconds a ray, for each of [`SAMPLES`].
    times: [f64; 2],
    counts: TraceCounts,
}

impl Case {
    fn new(keys: usize, mesh: DicedMesh) -> Case {
        let cells = mesh.cell_count() as f64;
        let start = Instant::now();
        let object = object(mesh);
        let build = cells / start.elapsed().as_secs_f64() * 1e-6;
        let place = InstanceTransform::Translation(DVec3::ZERO);
        Case {
            keys,
            world: World::build(vec![instance(&object, place)], DVec3::ZERO),
            kind: kind(object.blas()),
            bytes: object.stats().bvh_bytes as f64 / cells,
            build,
            times: [f64::INFINITY; 2],
            counts: TraceCounts::default(),
        }
    }

    fn check(&self, rays: &[Ray], checks: usize) -> Result<(), String> {
        let mut rng = Rng(7);
        for _ in 0..checks {
            let ray = rays[rng.below(rays.len())];
            let hit = self.world.trace(&ray, &mut TraceCounts::default());
            brute::verify(&self.world, &ray, None, &hit)
                .map_err(|e| format!("{} keys: {ray:?}: {e}", self.keys))?;
        }
        Ok(())
    }

    fn run(&mut self, loads: &[Vec<Ray>; 2]) {
        let mut hits = vec![Hit::MISS; 4096];
        for (time, rays) in self.times.iter_mut().zip(loads) {
            self.counts = TraceCounts::default();
            let start = Instant::now();
            for rays in rays.chunks(4096) {
                self.world.trace_many(rays, &mut hits, &mut self.counts);
            }
            *time = time.min(start.elapsed().as_secs_f64() * 1e9 / rays.len() as f64);
        }
    }
}

fn kind(blas: &Blas) -> &'static str {
    use hdtrapeze_core::bvh::relative::Trees;
    match blas {
        Blas::Static(_) => "static",
        Blas::Moving(_) => "plain",
        Blas::Relative(r) => match (&r.trees, &r.carrier, r.middle) {
            (Trees::Still(_), ..) => "rigid",
            (_, Some(_), None) => "carried",
            (_, None, _) => "halves",
            _ => "both",
        },
    }
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let full = args.iter().any(|a| a == "--bench");
    let mut plain = args.iter().filter(|a| !a.starts_with('-'));
    let only = plain.next().filter(|o| *o != "all");
    let millions = plain.next().map_or(Ok(1.0), |size| size.parse::<f32>());
    let millions = match millions {
        Ok(millions) if millions > 0.0 && millions.is_finite() => millions,
        _ => {
            eprintln!("the size is a number of millions, more than 0");
            std::process::exit(2);
        }
    };
    let (scale, size, checks, rounds) = if full {
        (millions, 512, 4, 4)
    } else {
        (0.02, 32, 10, 1)
    };
    let n = |full: f32| (full * scale) as usize;
    let s = |full: f32| ((full * scale.sqrt()) as usize).max(1);
    let sheet_lens = Lens::new(Vec3::new(0.3, -1.6, 1.8), Vec3::ZERO, 0.03, 0.45);
    let patch_lens = Lens::new(Vec3::new(0.4, 0.3, 4.0), Vec3::ZERO, 0.05, 0.35);
    let fan_lens = Lens::new(Vec3::new(0.4, -1.3, 3.0), Vec3::ZERO, 0.05, 0.35);
    let fur_target = Vec3::new(0.0, 0.0, 0.1);
    let fur_lens = Lens::new(Vec3::new(0.2, -1.5, 1.5), fur_target, 0.02, 0.3);
    type Make<'a> = Box<dyn Fn(&[f32]) -> DicedMesh + 'a>;
    let eighth = |keys: &[f32], turn: f32| if keys.len() == 2 { turn / 8.0 } else { turn };
    let scenes: Vec<(&str, Make<'_>, &Lens)> = vec![
        ("sheet", Box::new(|k| sheet(s(62.0), 16, k)), &sheet_lens),
        (
            "patches",
            Box::new(|k| patches(n(4000.0), 16, k, 1)),
            &patch_lens,
        ),
        ("fur", Box::new(|k| fur(n(62500.0), k, 1)), &fur_lens),
        (
            "combed",
            Box::new(|k| combed(n(62500.0), 0.0024, k, 1)),
            &fur_lens,
        ),
        ("whip", Box::new(|k| whip(n(62500.0), k, 1)), &fur_lens),
        (
            "fan",
            Box::new(|k| fan(s(14.0), 16, k, eighth(k, PI))),
            &fan_lens,
        ),
        (
            "fan slow",
            Box::new(|k| fan(s(14.0), 16, k, PI / 8.0)),
            &fan_lens,
        ),
        (
            "debris",
            Box::new(|k| debris(n(4000.0), 16, k, 1)),
            &patch_lens,
        ),
        (
            "falling",
            Box::new(|k| falling(n(4000.0), 16, k, 1)),
            &patch_lens,
        ),
        (
            "orbit",
            Box::new(|k| orbit(n(4000.0), 16, k, eighth(k, PI), 1)),
            &patch_lens,
        ),
        (
            "orbit slow",
            Box::new(|k| orbit(n(4000.0), 16, k, PI / 8.0, 1)),
            &patch_lens,
        ),
    ];
    if let Some(only) = only
        && scenes.iter().all(|(name, ..)| name != only)
    {
        let names: Vec<&str> = scenes.iter().map(|(name, ..)| *name).collect();
        eprintln!("no scene {only:?}; there are all, {}", names.join(", "));
        std::process::exit(2);
    }
    println!(
        "scene      | keys | tree    | ns/ray |  time | of 16 |  time | B/quad | bytes | nodes/ray | cells/ray | build Mquads/s"
    );
    for (name, make, lens) in &scenes {
        if only.is_some_and(|o| o != name) {
            continue;
        }
        let loads = SAMPLES.map(|samples| {
            let mut rays = lens.rays_with(size, samples);
            // As the renderer has it: what is traced together is near in time.
            for rays in rays.chunks_mut(64 * samples) {
                rays.sort_by(|a, b| a.time.total_cmp(&b.time));
            }
            rays
        });
        let mut cases: Vec<Case> = [2, 3, 5, 9].map(|k| Case::new(k, make(&keys(k)))).into();
        for case in &cases {
            for rays in &loads {
                if let Err(e) = case.check(rays, checks) {
                    eprintln!("{name}: {e}");
                    std::process::exit(1);
                }
            }
        }
        for _ in 0..rounds {
            for case in &mut cases {
                case.run(&loads);
            }
        }
        let (times, bytes) = (cases[0].times, cases[0].bytes);
        let n = loads[1].len() as f64;
        for case in &cases {
            println!(
                "{name:<10} | {:4} | {:<7} | {:6.1} | {:5.2} | {:5.1} | {:5.2} | {:6.2} | {:5.2} | {:9.1} | {:9.1} | {:14.1}",
                case.keys,
                case.kind,
                case.times[0],
                case.times[0] / times[0],
                case.times[1],
                case.times[1] / times[1],
                case.bytes,
                case.bytes / bytes,
                case.counts.node_tests as f64 / n,
                case.counts.cell_tests as f64 / n,
                case.build,
            );
        }
    }
}
