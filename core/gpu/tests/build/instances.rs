//! The tree over instances.

use std::sync::Arc;

use glam::DVec3;
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::trace::{InstanceTransform, World};
use hdtrapeze_gpu::Tracer;
use libtest_mimic::Failed;

use crate::support::*;
use crate::trace_scenes::*;
use crate::walk::over_instances;
use crate::{as_with_host_trees, built};

/// So many instances, of which some move, one of the others is flattened to nothing, and one is nowhere.
pub fn instances(count: usize, moving: usize) -> World {
    let objects = [
        Arc::new(ObjectGeometry::later(sheet(1, 5, &[0.0]))),
        Arc::new(ObjectGeometry::later(patches(3, 5, &keys(2), 4))),
    ];
    let mut rng = Rng(count as u64);
    let size = 1.5 / (count as f64).cbrt();
    let one = |i: usize| {
        let at = rng.cube().as_dvec3();
        let turn = f64::from(rng.unit()) * 6.0;
        let scale = DVec3::new(size, 1.2 * size, 0.8 * size);
        let transform = match i % 5 {
            _ if i < moving => spinning(2 + i % 3, 1.0, scale, at),
            2 if i == 7 => InstanceTransform::Static(affine(DVec3::X, 1.0, DVec3::ZERO, at)),
            3 if i == 8 => InstanceTransform::Translation(DVec3::NAN),
            _ => InstanceTransform::Static(affine(DVec3::new(1.0, 2.0, 0.3), turn, scale, at)),
        };
        // Few objects move by themselves.
        instance(&objects[usize::from(moving > 0 && i % 16 == 5)], transform)
    };
    World::build_later((0..count).map(one).collect(), DVec3::ZERO)
}

/// The tree over instances is made on the device as well, over none, one, as many as a node has, and more.
pub fn many_instances(tracer: &Tracer) -> Result<(), Failed> {
    for (count, moving) in [
        (0, 0),
        (1, 0),
        (1, 1),
        (2, 1),
        (8, 0),
        (8, 8),
        (9, 0),
        (9, 9),
        (9, 1),
        (20, 2),
        (1000, 0),
        (1000, 3),
        (1000, 1000),
        (20_000, 0),
    ] {
        let fail = |e: Failed| format!("{moving} of {count} move: {e:?}");
        let world = instances(count, moving);
        let scene = built(tracer, &world, false)?;
        let stats = world.stats();
        if (stats.trees, stats.top_nodes) != (0, 0) || !scene.has_own_trees() {
            return Err("the CPU has made trees".into());
        }
        let nodes = over_instances(tracer, &world, &scene).map_err(fail)?;
        if nodes > count * 4 / 7 + 1 {
            return Err(format!("{nodes} nodes over {count} instances").into());
        }
        as_with_host_trees(tracer, &world, &scene, RAYS, 0).map_err(fail)?;
        // Brute force asks each instance.
        if count < 100 {
            agree(tracer, &world, &scene, count / 4).map_err(fail)?;
        }
    }
    Ok(())
}
