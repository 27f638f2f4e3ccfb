//! Limit evaluations per second on one core: one position at one key is one evaluation.
//!
//! `cargo bench -p hdtrapeze-osd`. Every face is bound and evaluated on one lattice, as dicing does;
//! binding is part of the time. Each case is first compared with single calls of the library, and
//! nothing is printed where they differ. The last column is the same work by single calls.

#[path = "../tests/shapes/mod.rs"]
mod shapes;

use std::hint::black_box;
use std::time::{Duration, Instant};

use glam::{Vec2, Vec3};
use hdtrapeze_core::surface::{
    LimitEvaluator, LimitSamples, LimitSurface, MeshTopology, PatchDomain, Scheme,
};
use hdtrapeze_osd::{OsdEvaluator, OsdFactory, OsdSurface};
use shapes::{Random, grid, icosahedron, patchwork, thirds};

/// How long each figure is measured.
const WINDOW: Duration = Duration::from_millis(250);

fn lattice(rate: u32) -> Vec<Vec2> {
    (0..=rate)
        .flat_map(|t| (0..=rate).map(move |s| Vec2::new(s as f32, t as f32) / rate as f32))
        .collect()
}

fn each_patch(surface: &OsdSurface, mut visit: impl FnMut(u32, PatchDomain)) {
    for face in 0..surface.face_count() as u32 {
        match surface.face_vertices(face).len() as u32 {
            0 => {}
            4 => visit(face, PatchDomain::Whole),
            n => (0..n).for_each(|i| visit(face, PatchDomain::Corner(i))),
        }
    }
}

/// Evaluations a second.
fn measure(
    surface: &OsdSurface,
    mut evaluator: OsdEvaluator<'_>,
    st: &[Vec2],
    with_normals: bool,
) -> f64 {
    let mut out = LimitSamples::default();
    let mut pass = || {
        let mut count = 0u64;
        each_patch(surface, |face, domain| {
            evaluator.bind(face);
            evaluator.evaluate(domain, st, with_normals, &mut out);
            count += black_box(&out).positions.len() as u64;
        });
        count
    };
    pass();
    let mut best = 0.0f64;
    let start = Instant::now();
    while start.elapsed() < WINDOW {
        let one = Instant::now();
        let count = pass();
        best = best.max(count as f64 / one.elapsed().as_secs_f64());
    }
    best
}

/// The largest distance between our positions and the library's, and the smallest cosine between
/// normals.
fn difference(surface: &OsdSurface, st: &[Vec2]) -> (f32, f32) {
    let (mut ours, mut theirs) = (surface.lattice_evaluator(), surface.library_evaluator());
    let (mut a, mut b) = (LimitSamples::default(), LimitSamples::default());
    let mut worst = (0.0f32, 1.0f32);
    each_patch(surface, |face, domain| {
        ours.bind(face);
        theirs.bind(face);
        ours.evaluate(domain, st, true, &mut a);
        theirs.evaluate(domain, st, true, &mut b);
        for (p, q) in a.positions.iter().zip(&b.positions) {
            worst.0 = worst.0.max((*p - *q).length());
        }
        for (p, q) in a.normals.iter().zip(&b.normals) {
            worst.1 = worst.1.min(p.dot(*q));
        }
    });
    worst
}

fn main() {
    let mut random = Random(1);
    let (mut triangles, triangle_points) = grid(10, 10);
    triangles.face_vertex_indices = triangles
        .face_vertex_indices
        .chunks(4)
        .flat_map(|q| [q[0], q[1], q[2], q[0], q[2], q[3]])
        .collect();
    triangles.face_vertex_counts = vec![3; 200];
    triangles.scheme = Scheme::Loop;
    let meshes: Vec<(&str, (MeshTopology, Vec<Vec3>))> = vec![
        ("regular", grid(12, 12)),
        ("extraordinary", thirds(icosahedron())),
        ("mix", patchwork(&mut random, 10, false)),
        ("Loop, regular", (triangles, triangle_points)),
        ("Loop, extraordinary", {
            let (mut topology, points) = icosahedron();
            topology.scheme = Scheme::Loop;
            (topology, points)
        }),
    ];
    println!(
        "million limit evaluations per second and core (one position at one key), bind included"
    );
    println!(
        "{:<20} lattice keys  positions  with normals  single library calls",
        "mesh"
    );
    for (name, (topology, points)) in &meshes {
        for keys in [1, 2] {
            let points: Vec<Vec<Vec3>> = (0..keys)
                .map(|_| points.iter().map(|&p| p + 0.1 * random.vec3()).collect())
                .collect();
            let surface = OsdFactory::new()
                .create_surface(topology, &points, Vec::new())
                .expect("the bench's meshes are good");
            for rate in [8, 16] {
                let st = lattice(rate);
                let (distance, cosine) = difference(&surface, &st);
                if distance > 5e-5 || cosine < 0.999 {
                    println!("{name}: WRONG, {distance} away, cosine {cosine}");
                    std::process::exit(1);
                }
                let rates = [
                    measure(&surface, surface.lattice_evaluator(), &st, false),
                    measure(&surface, surface.lattice_evaluator(), &st, true),
                    measure(&surface, surface.library_evaluator(), &st, false),
                ]
                .map(|rate| rate / 1e6);
                println!(
                    "{name:<20} {0:>3}x{0:<3} {keys:>4} {1:>10.1} {2:>13.1} {3:>21.1}",
                    rate + 1,
                    rates[0],
                    rates[1],
                    rates[2]
                );
            }
        }
    }
}
