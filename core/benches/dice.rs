//! Dicing throughput: micropolygons a second on all threads, for surfaces in closed form, so that
//! the cost of dicing itself shows.

#[path = "../tests/analytic/mod.rs"]
mod analytic;

use analytic::{Analytic, Bend};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::DVec3;
use hdtrapeze_core::dice::{DiceInput, DiceOutput, RasterMetric, dice};
use hdtrapeze_core::motion::PointPath;
use std::sync::atomic::AtomicBool;

/// Dices at `pixels` a unit, rate 1.
fn run(surface: &Analytic, pixels: f32) -> DiceOutput {
    let path = PointPath::identity(&[0.0], DVec3::ZERO);
    dice(&DiceInput {
        surface,
        path: &path,
        metric: &RasterMetric::uniform(pixels),
        shading_rate: 1.0,
        with_normals: true,
        polygons_coarse: false,
        max_micropolygons: 1 << 30,
        cancel: &AtomicBool::new(false),
    })
    .expect("dicing")
}

fn throughput(c: &mut Criterion) {
    let mut group = c.benchmark_group("dice");
    group.sample_size(10);
    for (name, surface, pixels) in [
        (
            "few large faces",
            Analytic::plane(2, 1.0, Bend::Waves(0.05)),
            500.0,
        ),
        (
            "faces of 16 pixels",
            Analytic::plane(64, 1.0, Bend::Waves(0.05)),
            500.0,
        ),
        (
            "faces of a pixel",
            Analytic::plane(500, 1.0, Bend::Waves(0.05)),
            250.0,
        ),
    ] {
        // About one cell a square pixel, or one a face.
        let output = run(&surface, pixels);
        let cells = output.mesh.cell_count();
        let area = (4.0 * pixels * pixels) as usize;
        assert!(
            (area..area * 2).contains(&cells),
            "{name}: {cells} cells for {area} pixels"
        );
        println!(
            "{name}: {:.2} evaluations a cell",
            output.limit_evaluations as f64 / cells as f64
        );
        group.throughput(Throughput::Elements(cells as u64));
        group.bench_function(name, |b| b.iter(|| run(&surface, pixels)));
    }
    group.finish();
}

criterion_group!(benches, throughput);
criterion_main!(benches);
