//! Trees over scenes of several pages.

use std::sync::Arc;

use glam::DVec3;
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::trace::{InstanceTransform, World};
use hdtrapeze_gpu::{BuildOptions, GpuScene, Tracer};
use libtest_mimic::Failed;

use crate::support::*;
use crate::trace_scenes::*;
use crate::{as_with_host_trees, builder};

/// Trees over pages hit what trees on one page hit, and no trees of the CPU are asked for.
pub fn paged(tracer: &Tracer) -> Result<(), Failed> {
    let one = |mesh| {
        let object = Arc::new(ObjectGeometry::later(mesh));
        let at = InstanceTransform::Translation(DVec3::ZERO);
        World::build_later(vec![instance(&object, at)], DVec3::ZERO)
    };
    let mut unsound = patches(300, 7, &keys(2), 6);
    unsound.grids[5].nu = 99;
    unsound.positions[9000].x = f32::NAN;
    for (world, most, pages) in [
        (one(sheet(8, 9, &keys(2))), 20_000, 5..=20),
        (one(patches(300, 7, &[0.0], 6)), 40_000, 5..=30),
        (one(fur(2000, &keys(2), 6)), 100_000, 8..=40),
        (one(unsound), 60_000, 5..=30),
        (crowd(12), 8_000, 3..=40),
    ] {
        let options = BuildOptions {
            most,
            ..BuildOptions::default()
        };
        let scene = GpuScene::build(builder(tracer), &world, &options)?;
        if !pages.contains(&scene.page_count()) || !scene.has_own_trees() {
            return Err(format!("{} pages, not {pages:?}", scene.page_count()).into());
        }
        let later = world.stats();
        if later.top_nodes == 0 && later.trees > 0 {
            return Err("the CPU has made trees".into());
        }
        as_with_host_trees(tracer, &world, &scene, RAYS, 50)?;
    }
    Ok(())
}
