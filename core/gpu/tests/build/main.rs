//! Trees that the device makes: what they contain, what they hold, and what is hit through them, on any device there is.

mod costs;
mod instances;
mod pages;
mod parts;
mod refit;
mod shapes;
#[path = "../support/mod.rs"]
mod support;
#[path = "../../../tests/trace_scenes/mod.rs"]
mod trace_scenes;
mod walk;

use std::sync::{Arc, OnceLock};

use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::{Hit, Ray, World};
use hdtrapeze_gpu::{BuildOptions, GpuScene, Tracer, TreeBuilder};
use libtest_mimic::Failed;
use support::*;
use trace_scenes::*;

/// Pipelines are compiled once.
static BUILDER: OnceLock<TreeBuilder> = OnceLock::new();

fn builder(tracer: &Tracer) -> &'static TreeBuilder {
    BUILDER.get_or_init(|| TreeBuilder::new(Arc::clone(tracer.device())))
}

fn built(tracer: &Tracer, world: &World, refits: bool) -> Result<GpuScene, Failed> {
    let options = BuildOptions {
        refits,
        ..BuildOptions::default()
    };
    Ok(GpuScene::build(builder(tracer), world, &options)?)
}

/// Hits have the bits of those through the CPU's trees: they do not depend on the order of the walk.
fn as_with_host_trees(
    tracer: &Tracer,
    world: &World,
    scene: &GpuScene,
    rays: usize,
    least_hits: usize,
) -> Result<(), Failed> {
    let rays = random_rays(rays);
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut expected = hits.clone();
    tracer.trace(scene, &rays, false, &mut hits)?;
    let host = GpuScene::new(tracer.device(), world)?;
    tracer.trace(&host, &rays, false, &mut expected)?;
    let found = hits.iter().filter(|hit| hit.is_hit()).count();
    if hits != expected || found < least_hits {
        let other = hits.iter().zip(&expected).find(|(a, b)| a != b);
        return Err(format!("{found} of {} hit; {other:?}", rays.len()).into());
    }
    Ok(())
}

fn random_rays(count: usize) -> Vec<Ray> {
    let mut rng = Rng(41);
    (0..count).map(|_| random_ray(&mut rng)).collect()
}

fn main() {
    let mut checks: Vec<(String, Check)> = Vec::new();
    let mut add = |name: String, run: Check| checks.push((name, run));
    /// A name, a mesh with these keys, and rays that hit it at least.
    type Meshes = (&'static str, fn(&[f32]) -> DicedMesh, usize);
    let meshes: [Meshes; 6] = [
        ("sheet", |keys| sheet(3, 9, keys), 300),
        ("patches", |keys| patches(40, 7, keys, 3), 100),
        ("large_patches", |keys| patches(20, 16, keys, 3), 100),
        ("fur", |keys| fur(200, keys, 4), 30),
        ("combed", |keys| combed(200, 0.05, keys, 4), 100),
        ("fan", |keys| curved::fan(2, 6, keys, 3.0), 50),
    ];
    for (name, make, least) in meshes {
        for key_count in [1, 2, 3, 5] {
            add(
                format!("{name}_with_{key_count}_keys"),
                Box::new(move |tracer| shapes::sound(tracer, &make(&keys(key_count)), least)),
            );
        }
    }
    for (name, make, least) in objects() {
        add(
            format!("world_of_{name}"),
            Box::new(move |tracer| {
                let world = make(&keys(2));
                agree(tracer, &world, &built(tracer, &world, false)?, least)
            }),
        );
    }
    for moving in [0, 3, 40] {
        add(
            format!("instances_of_which_{moving}_move"),
            Box::new(move |tracer| {
                let world = crowd(moving);
                agree(tracer, &world, &built(tracer, &world, false)?, 200)
            }),
        );
    }
    add(
        "surfaces_that_coincide".to_owned(),
        Box::new(|tracer| {
            let world = coincident(5);
            agree(tracer, &world, &built(tracer, &world, false)?, 300)
        }),
    );
    /// A name and a test.
    type Named = (&'static str, fn(&Tracer) -> Result<(), Failed>);
    let others: [Named; 22] = [
        ("equal_boxes", shapes::equal_boxes),
        ("nested_boxes", shapes::nested_boxes),
        ("flat", shapes::flat),
        ("all_sizes", shapes::all_sizes),
        ("paths", shapes::paths),
        ("bad_grids", shapes::bad_grids),
        ("few_items", shapes::few_items),
        ("several_objects", shapes::several_objects),
        ("many_items", shapes::many_items),
        ("costs", costs::costs),
        ("in_parts", parts::in_parts),
        ("paged", pages::paged),
        ("pages_cost_little", costs::pages_cost_little),
        ("many_instances", instances::many_instances),
        ("tops_cost_as_much", costs::tops_cost_as_much),
        ("refitted", refit::refitted),
        ("refitted_on_pages", refit::refitted_on_pages),
        ("refitted_instances", refit::refitted_instances),
        ("too_bad_to_refit", refit::too_bad_to_refit),
        ("not_refitted", refit::not_refitted),
        ("refit_refused", refit::refused),
        ("refit_failed", refit::failed),
    ];
    for (name, check) in others {
        add(name.to_owned(), Box::new(check));
    }
    run(checks);
}
