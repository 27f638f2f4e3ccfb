//! Trees whose dispatches go to the device in more or fewer submissions.

use std::sync::Arc;
use std::time::Duration;

use glam::Vec3;
use hdtrapeze_gpu::{BuildOptions, GpuScene, Submitted, Tracer, TreeBuilder};
use hdtrapeze_shaders::stage::BuildStage;
use libtest_mimic::Failed;

use crate::shapes::single_cells;
use crate::trace_scenes::*;

/// Builds until sizes of submissions follow the time that they take.
const BUILDS: usize = 6;

/// A device is at one submission for no longer than it should be: where that is no time at all, each has one dispatch of what
/// was found to be long, and where there is no end to it, all of them. Trees have the same bits.
pub fn in_parts(tracer: &Tracer) -> Result<(), Failed> {
    let world = world_of(single_cells(50_000, |g, u, v, _| {
        let (i, j) = (g % 250, g / 250);
        Vec3::new(u + i as f32, v + j as f32, (0.1 * i as f32).sin() + 0.3 * u)
    }));
    let long = [BuildStage::Sort, BuildStage::Cluster];
    let mut trees = Vec::new();
    for (target, alone) in [(Duration::ZERO, true), (Duration::MAX, false)] {
        let builder = TreeBuilder::with_target(Arc::clone(tracer.device()), target);
        let mut told: Vec<[Submitted; 2]> = Vec::new();
        for _ in 0..BUILDS {
            let scene = GpuScene::build(&builder, &world, &BuildOptions::default())?;
            if !scene.has_own_trees() {
                return Err("made by the CPU".into());
            }
            told.push(long.map(|stage| builder.submitted(stage)));
            let pages = scene.contents(tracer.device())?;
            trees.push(
                pages
                    .into_iter()
                    .map(|page| (page.nodes, page.words, page.root)),
            );
        }
        let [.., before, last] = &told[..] else {
            return Err("too few builds".into());
        };
        for (stage, (before, last)) in long.iter().zip(before.iter().zip(last)) {
            let submissions = last.count - before.count;
            let dispatches = last.dispatches - before.dispatches;
            let right = match alone {
                true => submissions == dispatches,
                false => submissions * 20 <= dispatches,
            };
            if !right || dispatches < 20 {
                let what = format!("{submissions} submissions of {dispatches} dispatches");
                return Err(format!("{what}, {stage:?}, {target:?}: {last:?}").into());
            }
        }
    }
    let mut trees = trees.into_iter().map(Iterator::collect::<Vec<_>>);
    let first = trees.next();
    match trees.all(|trees| Some(&trees) == first.as_ref()) {
        true => Ok(()),
        false => Err("trees depend on parts".into()),
    }
}
