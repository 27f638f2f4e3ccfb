//! Build and trace rates of four scenes of about a million micropolygons, static and moving, under
//! rays with lens and time. `cargo bench -p hdtrapeze-core --bench trace [-- SCENE]`; without
//! `--bench` (as under `cargo test`) a small run that only checks.
//!
//! A sample of hits is checked against brute force before anything is printed.

#[path = "../tests/trace_scenes/mod.rs"]
mod trace_scenes;

use std::time::Instant;

use glam::{DVec3, Vec3};
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::{Hit, InstanceTransform, TraceCounts, World, brute};
use rayon::prelude::*;
use trace_scenes::lens::Lens;
use trace_scenes::*;

fn run(name: &str, mesh: DicedMesh, lens: &Lens, size: usize, checks: usize) {
    let cells = mesh.cell_count() as f64;
    let start = Instant::now();
    let object = object(mesh);
    let build = start.elapsed().as_secs_f64();
    let world = World::build(
        vec![instance(
            &object,
            InstanceTransform::Translation(DVec3::ZERO),
        )],
        DVec3::ZERO,
    );
    let rays = lens.rays(size);

    let mut rng = Rng(7);
    for _ in 0..checks {
        let ray = rays[rng.below(rays.len())];
        let hit = world.trace(&ray, &mut TraceCounts::default());
        if let Err(e) = brute::verify(&world, &ray, None, &hit) {
            eprintln!("{name}: {ray:?}: {e}");
            std::process::exit(1);
        }
    }

    let mut best = f64::INFINITY;
    let mut total = TraceCounts::default();
    let mut found = 0;
    for _ in 0..3 {
        let start = Instant::now();
        let parts: Vec<(TraceCounts, usize)> = rays
            .par_chunks(4096)
            .map(|rays| {
                let mut counts = TraceCounts::default();
                let mut hits = vec![Hit::MISS; rays.len()];
                world.trace_many(rays, &mut hits, &mut counts);
                (counts, hits.iter().filter(|h| h.is_hit()).count())
            })
            .collect();
        best = best.min(start.elapsed().as_secs_f64());
        total = TraceCounts::default();
        found = 0;
        for (c, n) in parts {
            total.rays += c.rays;
            total.node_tests += c.node_tests;
            total.cell_tests += c.cell_tests;
            found += n;
        }
    }
    let stats = object.stats();
    let n = total.rays as f64;
    println!(
        "{name:<16} {:8.1} {:8.2} {:8.2} {:8.1} {:8.1} {:6.2} {:9} {:9}",
        cells / build * 1e-6,
        n / best * 1e-6,
        stats.bvh_bytes as f64 / cells,
        total.node_tests as f64 / n,
        total.cell_tests as f64 / n,
        found as f64 / n,
        format!("{}/{}", stats.oriented_nodes, stats.nodes),
        format!("{}/{}", stats.oriented_blocks, stats.blocks),
    );
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let full = args.iter().any(|a| a == "--bench");
    let only = args.iter().find(|a| !a.starts_with('-'));
    let (scale, size, checks) = if full { (1.0, 512, 4) } else { (0.02, 32, 10) };
    println!("{} threads", rayon::current_num_threads());
    println!(
        "scene            Mquads/s  Mrays/s  B/quad  nodes/ray cells/ray  hit  oriented nodes, blocks"
    );
    let n = |full: f64| (full * scale) as usize;
    let sheet_lens = Lens::new(Vec3::new(0.3, -1.6, 1.8), Vec3::ZERO, 0.03, 0.45);
    let patch_lens = Lens::new(Vec3::new(0.4, 0.3, 4.0), Vec3::ZERO, 0.05, 0.35);
    let fur_lens = Lens::new(
        Vec3::new(0.2, -1.5, 1.5),
        Vec3::new(0.0, 0.0, 0.1),
        0.02,
        0.3,
    );
    for (motion, k) in [("static", 1), ("moving", 2)] {
        type Make<'a> = Box<dyn Fn() -> DicedMesh + 'a>;
        let scenes: [(&str, Make<'_>, &Lens); 4] = [
            (
                "sheet",
                Box::new(|| sheet(n(62.0).max(2), 16, &keys(k))),
                &sheet_lens,
            ),
            (
                "patches",
                Box::new(|| patches(n(4000.0), 16, &keys(k), 1)),
                &patch_lens,
            ),
            ("fur", Box::new(|| fur(n(62500.0), &keys(k), 1)), &fur_lens),
            (
                "combed",
                Box::new(|| combed(n(62500.0), 0.0024, &keys(k), 1)),
                &fur_lens,
            ),
        ];
        for (name, make, lens) in scenes {
            if only.is_none_or(|o| o == name) {
                run(&format!("{name} {motion}"), make(), lens, size, checks);
            }
        }
    }
}
