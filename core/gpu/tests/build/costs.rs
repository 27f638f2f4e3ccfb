//! What rays cost through the device's trees, beside the CPU's.

use glam::Vec3;
use hdtrapeze_gpu::{BuildOptions, FirstOnDevice, GpuScene, Tracer};
use libtest_mimic::Failed;

use crate::instances::instances;
use crate::shapes::single_cells;
use crate::trace_scenes::*;
use crate::{builder, built, random_rays};

/// Rays open about as many nodes, and test about as many micropolygons, as through the CPU's trees.
pub fn costs(tracer: &Tracer) -> Result<(), Failed> {
    let meshes = [
        sheet(8, 16, &keys(1)),
        sheet(8, 16, &keys(2)),
        patches(60, 16, &keys(2), 3),
        single_cells(5000, |g, u, v, _| {
            let [x, y] = [g % 71, g / 71].map(|i| i as f32 / 35.0 - 1.0);
            Vec3::new(x + 0.02 * u, y + 0.02 * v, 0.1 * (5.0 * x).sin())
        }),
    ];
    for mesh in meshes {
        let world = world_of(mesh);
        let scenes = [
            built(tracer, &world, false)?,
            GpuScene::new(tracer.device(), &world)?,
        ];
        let rays = random_rays(3000);
        let mut costs = [0.0; 2];
        for (cost, scene) in costs.iter_mut().zip(&scenes) {
            let batch = tracer.batch(scene, &rays, false, true)?;
            tracer.run(&batch)?;
            let counts = tracer.counts(&batch)?.unwrap_or_default();
            *cost = (counts.node_tests + counts.cell_tests) as f64;
        }
        if costs[0] > 1.25 * costs[1] {
            return Err(format!("{costs:?}").into());
        }
    }
    Ok(())
}

/// Pages hold what is near each other: but for the roots of all pages, rays open few more nodes than where all is on one.
pub fn pages_cost_little(tracer: &Tracer) -> Result<(), Failed> {
    for (mesh, most, more) in [
        (patches(600, 7, &[0.0], 6), 80_000, 1.1),
        (fur(3000, &[0.0], 6), 150_000, 1.1),
        (sheet(12, 9, &[0.0]), 30_000, 1.1),
    ] {
        let world = world_of(mesh);
        let rays = random_rays(3000);
        for first in [FirstOnDevice::Bound, FirstOnDevice::Generate] {
            let mut nodes = [0.0; 2];
            let mut pages = 0;
            for (nodes, most) in nodes.iter_mut().zip([u64::MAX, most]) {
                let options = BuildOptions {
                    first,
                    most,
                    ..BuildOptions::default()
                };
                let scene = GpuScene::build(builder(tracer), &world, &options)?;
                pages = scene.page_count();
                let batch = tracer.batch(&scene, &rays, false, true)?;
                tracer.run(&batch)?;
                *nodes = tracer.counts(&batch)?.unwrap_or_default().node_tests as f64;
            }
            let roots = (pages * rays.len()) as f64;
            let times = (nodes[1] - roots) / nodes[0];
            let all = nodes[1] / nodes[0];
            println!("{pages} pages: {all:.2} times the nodes, {times:.2} without roots");
            if pages < 6 || times > more {
                return Err(format!("{pages} pages: {nodes:?}").into());
            }
        }
    }
    Ok(())
}

/// Few that move stand apart: rays open about as many nodes as with the CPU's tree over the same instances.
pub fn tops_cost_as_much(tracer: &Tracer) -> Result<(), Failed> {
    for (count, moving) in [(300, 0), (300, 12), (300, 300), (1000, 0)] {
        let world = instances(count, moving);
        let rays = random_rays(3000);
        let mut nodes = [0.0; 2];
        for (nodes, first) in nodes
            .iter_mut()
            .zip([FirstOnDevice::Bound, FirstOnDevice::Generate])
        {
            let options = BuildOptions {
                first,
                ..BuildOptions::default()
            };
            let scene = GpuScene::build(builder(tracer), &world, &options)?;
            let batch = tracer.batch(&scene, &rays, false, true)?;
            tracer.run(&batch)?;
            *nodes = tracer.counts(&batch)?.unwrap_or_default().node_tests as f64;
        }
        println!("{moving} of {count} move: {:.3}", nodes[0] / nodes[1]);
        if nodes[0] > 1.3 * nodes[1] {
            return Err(format!("{moving} of {count} move: {nodes:?}").into());
        }
    }
    Ok(())
}
