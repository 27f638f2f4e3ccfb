//! The device's hits against brute force in f64 and against the CPU's, on any device there is: software is
//! enough. Where there is none, the tests show as ignored.

mod support;
#[path = "../../tests/trace_scenes/mod.rs"]
mod trace_scenes;

use std::sync::Arc;
use std::time::Duration;

use glam::{DVec3, Vec3};
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World, brute};
use hdtrapeze_gpu::{Device, GpuError, GpuScene, Occluder, Tracer};
use libtest_mimic::Failed;
use support::*;
use trace_scenes::*;

fn traced(tracer: &Tracer, world: &World, rays: &[Ray], any: bool) -> Result<Vec<Hit>, Failed> {
    let scene = GpuScene::new(tracer.device(), world)?;
    let mut hits = vec![Hit::MISS; rays.len()];
    tracer.trace(&scene, rays, any, &mut hits)?;
    Ok(hits)
}

/// Hits with the CPU's trees.
fn agree_on(tracer: &Tracer, world: &World, least_hits: usize) -> Result<(), Failed> {
    let scene = GpuScene::new(tracer.device(), world)?;
    agree(tracer, world, &scene, least_hits)
}

/// So few of many move that they have a tree of their own.
fn a_few_that_move(tracer: &Tracer) -> Result<(), Failed> {
    let sheet = object(sheet(2, 7, &[0.0]));
    let at = |i: i32| {
        let by = DVec3::new(0.0, 0.0, -0.1 * f64::from(i));
        instance(&sheet, InstanceTransform::Translation(by))
    };
    let mover = spinning(2, 0.4, DVec3::splat(0.8), DVec3::Z * 0.7);
    let mut instances: Vec<_> = (0..20).map(at).collect();
    instances.push(instance(&sheet, mover));
    let world = World::build(instances, DVec3::ZERO);
    agree_on(tracer, &world, 300)?;
    let down = |i: u8| ray(Vec3::Z * 4.0, -Vec3::Z, f32::from(i) / 50.0);
    let rays: Vec<Ray> = (0..50).map(down).collect();
    let hits = traced(tracer, &world, &rays, false)?;
    let seen = hits.iter().filter(|hit| hit.instance == 20).count();
    match seen > 25 {
        true => Ok(()),
        false => Err(format!("what moves is seen by {seen} of 50 rays").into()),
    }
}

/// A name, what is traced, the bytes of a page, and how many pages that makes at least.
type Paged = (&'static str, fn() -> World, u64, usize);

/// Rays that no stage may stumble over, and an empty world.
fn bad_rays(tracer: &Tracer) -> Result<(), Failed> {
    let world = world_of(sheet(2, 8, &keys(2)));
    let good = ray(Vec3::Z * 3.0 + Vec3::splat(0.1), -Vec3::Z, 0.5);
    let with = |change: fn(&mut Ray)| {
        let mut bad = good;
        change(&mut bad);
        bad
    };
    let rays = [
        good,
        with(|r| r.origin.x = f32::NAN),
        with(|r| r.dir.y = f32::INFINITY),
        with(|r| r.dir = Vec3::ZERO),
        with(|r| r.time = f32::NAN),
        with(|r| r.t_max = -1.0),
        with(|r| r.origin = Vec3::splat(3.0e38)),
        with(|r| r.dir = Vec3::new(1.0e-42, 0.0, -1.0)),
        with(|r| r.time = 7.0),
        with(|r| r.t_max = f32::INFINITY),
    ];
    let hits = traced(tracer, &world, &rays, false)?;
    let found: Vec<bool> = hits.iter().map(Hit::is_hit).collect();
    let expected: Vec<bool> = rays
        .iter()
        .map(|ray| world.trace(ray, &mut TraceCounts::default()).is_hit())
        .collect();
    if found != expected || !found[0] || found[1] {
        return Err(format!("{found:?}, not {expected:?}").into());
    }
    let nothing = World::build(Vec::new(), DVec3::ZERO);
    let hits = traced(tracer, &nothing, &rays, false)?;
    match hits.iter().any(Hit::is_hit) {
        true => Err("an empty world is hit".into()),
        false => Ok(()),
    }
}

/// Rays through edges and corners of a closed surface never slip out of it.
fn watertight(tracer: &Tracer) -> Result<(), Failed> {
    for key_count in [1, 2, 3] {
        let mesh = sphere(3, 6, &keys(key_count));
        let world = world_of(mesh.clone());
        let mut rays = Vec::new();
        for (g, grid) in mesh.grids.iter().enumerate() {
            for i in 0..grid.vertex_count() {
                // At a key vertices are where they are stored.
                let key = i % key_count;
                let time = mesh.key_times[key];
                let to = mesh.grid_positions(g, key)[i];
                rays.push(ray(Vec3::ZERO, to, time));
                let next = mesh.grid_positions(g, key)[(i + 1) % grid.vertex_count()];
                rays.push(ray(Vec3::ZERO, (to + next) * 0.5, time));
            }
        }
        let hits = traced(tracer, &world, &rays, false)?;
        let lost = hits.iter().filter(|hit| !hit.is_hit()).count();
        if lost > 0 {
            return Err(
                format!("{lost} of {} rays got out at {key_count} keys", rays.len()).into(),
            );
        }
    }
    Ok(())
}

/// What does not fit on one page is traced page by page: the same hits, bit for bit.
fn paged(tracer: &Tracer, world: &World, most: u64, least_pages: usize) -> Result<(), Failed> {
    let mut rng = Rng(5);
    let rays: Vec<Ray> = (0..RAYS).map(|_| random_ray(&mut rng)).collect();
    let whole = traced(tracer, world, &rays, false)?;
    let scene = GpuScene::with_pages(tracer.device(), world, most)?;
    if scene.page_count() < least_pages {
        return Err(format!("only {} pages", scene.page_count()).into());
    }
    let mut hits = vec![Hit::MISS; rays.len()];
    tracer.trace(&scene, &rays, false, &mut hits)?;
    for ((ray, hit), whole) in rays.iter().zip(&hits).zip(&whole) {
        if hit != whole {
            return Err(format!("{ray:?}: {hit:?} on pages, {whole:?} on one").into());
        }
    }
    let mut any = vec![Hit::MISS; rays.len()];
    tracer.trace(&scene, &rays, true, &mut any)?;
    let found = hits.iter().filter(|hit| hit.is_hit()).count();
    if found < 50
        || any
            .iter()
            .zip(&hits)
            .any(|(any, hit)| any.is_hit() != hit.is_hit())
    {
        return Err(format!("{found} hits, but not for any").into());
    }
    Ok(())
}

/// A device is at one submission for no longer than it should be: long work goes there in parts, each of one page, and whatever
/// parts there are, hits have the same bits.
fn in_parts(tracer: &Tracer) -> Result<(), Failed> {
    const MANY: usize = 100_000;
    const FIRST: usize = 1 << 15;
    let device = tracer.device();
    let scene = GpuScene::with_pages(device, &world_of(sheet(8, 9, &keys(2))), 20_000)?;
    let pages = scene.page_count();
    let mut rng = Rng(6);
    let rays: Vec<Ray> = (0..MANY).map(|_| random_ray(&mut rng)).collect();
    let (mut hits, mut found, mut behind) = (Vec::new(), Vec::new(), Vec::new());
    for (target, first_is_largest) in [(Duration::ZERO, true), (Duration::MAX, false)] {
        let tracer = Tracer::with_target(Arc::clone(device), target);
        let mut met = vec![Hit::MISS; MANY];
        tracer.trace(&scene, &rays, false, &mut met)?;
        let occluder = Occluder::with_target(Arc::clone(device), target);
        let mut any = vec![false; MANY];
        occluder.occluded(&scene, &rays, true, &mut any)?;
        hits.push(met);
        found.push(any);
        for told in [tracer.submitted(), occluder.submitted()] {
            let right = match first_is_largest {
                true => {
                    told.largest == FIRST
                        && told.next < FIRST / 16
                        && told.count as usize > 50 * pages
                }
                false => {
                    // All rays of a page, once that is known to be possible.
                    let least = 4 + pages - 2;
                    told.largest == MANY && (least..3 * pages).contains(&(told.count as usize))
                }
            };
            if !right || pages < 5 {
                return Err(
                    format!("{told:?} for {MANY} rays on {pages} pages, {target:?}").into(),
                );
            }
        }
        behind.push(tracer.layers(&scene, &rays, 2)?);
    }
    let met = hits[0].iter().map(Hit::is_hit);
    let same = hits[0] == hits[1] && found[0] == found[1] && behind[0] == behind[1];
    match same && met.eq(found[0].iter().copied()) {
        true => Ok(()),
        false => Err("hits depend on parts".into()),
    }
}

/// One set of very many instances needs several pages of them.
fn many_instances() -> World {
    let one = object(sheet(1, 4, &[0.0]));
    let mut rng = Rng(3);
    let at = |_| instance(&one, InstanceTransform::Translation(rng.cube().as_dvec3()));
    World::build((0..400).map(at).collect(), DVec3::ZERO)
}

/// Rays that go on behind what they meet, page by page where arrays may be no larger than `most`: each hit is checked by brute
/// force, and nearly all rays meet what they meet on the CPU, in that order.
fn layered(tracer: &Tracer, world: &World, most: u64, least_layers: usize) -> Result<(), Failed> {
    const LAYERS: usize = 6;
    let mut rng = Rng(13);
    let rays: Vec<Ray> = (0..RAYS / 10).map(|_| random_ray(&mut rng)).collect();
    let scene = GpuScene::with_pages(tracer.device(), world, most)?;
    if (scene.page_count() > 1) != (most < u64::MAX) {
        return Err(format!("{} pages", scene.page_count()).into());
    }
    let layers = tracer.layers(&scene, &rays, LAYERS)?;
    let id = |hit: &Hit| (hit.instance, hit.grid, hit.cell);
    let (mut same, mut most_met) = (0, 0);
    for (i, ray) in rays.iter().enumerate() {
        let (mut cpu, mut agrees) = (world.trace(ray, &mut TraceCounts::default()), true);
        let mut last: Option<Hit> = None;
        for (layer, hits) in layers.iter().enumerate() {
            let hit = &hits[i];
            match last {
                Some(last) if !last.is_hit() => {
                    if hit.is_hit() {
                        return Err(format!("{ray:?}: {hit:?} behind a miss").into());
                    }
                }
                last => brute::verify(world, ray, last.as_ref(), hit)
                    .map_err(|e| format!("{ray:?}, layer {layer}: {e}"))?,
            }
            agrees &= id(hit) == id(&cpu);
            if hit.is_hit() {
                most_met = most_met.max(layer + 1);
            }
            if cpu.is_hit() {
                cpu = world.trace_after(ray, &cpu, &mut TraceCounts::default());
            }
            last = Some(*hit);
        }
        same += usize::from(agrees);
    }
    if most_met < least_layers {
        return Err(format!("only {most_met} layers").into());
    }
    if same * 1000 < rays.len() * 985 {
        return Err(format!("only {same} of {} rays meet the same", rays.len()).into());
    }
    Ok(())
}

/// A device that does not come to an end is lost, and stays so: nobody waits for it twice.
fn hangs(_: &Tracer) -> Result<(), Failed> {
    let device = Arc::new(Device::open()?);
    let scene = GpuScene::new(&device, &world_of(sheet(8, 9, &keys(2))))?;
    let occluder = Occluder::new(Arc::clone(&device));
    let mut rng = Rng(8);
    let rays: Vec<Ray> = (0..30_000).map(|_| random_ray(&mut rng)).collect();
    let there = occluder.upload(&rays)?;
    device.finish(Duration::from_secs(100))?;
    // It may have been quick.
    let told = (0..50).find_map(|_| {
        let begun = occluder.occlude(&scene, &there, false);
        begun.and_then(|_| device.finish(Duration::ZERO)).err()
    });
    let Some(lost @ GpuError::Lost { .. }) = told else {
        return Err(format!("{told:?}").into());
    };
    if device.check() != Err(lost) {
        return Err(format!("{:?}", device.check()).into());
    }
    match occluder.occlude(&scene, &there, false) {
        Err(GpuError::Lost { .. }) => Ok(()),
        other => Err(format!("{other:?}").into()),
    }
}

/// What no page holds is refused in words, and the device goes on working.
fn too_large(tracer: &Tracer) -> Result<(), Failed> {
    // Less than the vertices of a grid.
    match GpuScene::with_pages(tracer.device(), &world_of(sheet(1, 16, &[0.0])), 2000) {
        Err(error @ GpuError::TooLarge { .. }) if error.to_string().contains("need") => {}
        other => return Err(format!("{other:?}").into()),
    }
    agree_on(tracer, &world_of(sheet(3, 9, &[0.0])), 300)
}

fn main() {
    let mut checks = Vec::new();
    let mut add = |name: String, run: Check| checks.push((name, run));
    for (name, make, least) in objects() {
        for key_count in [1, 2, 3, 5] {
            add(
                format!("{name}_with_{key_count}_keys"),
                Box::new(move |tracer| agree_on(tracer, &make(&keys(key_count)), least)),
            );
        }
    }
    for moving in [0, 3, 40] {
        add(
            format!("instances_of_which_{moving}_move"),
            Box::new(move |tracer| agree_on(tracer, &crowd(moving), 200)),
        );
    }
    add("a_few_that_move".to_owned(), Box::new(a_few_that_move));
    add(
        "curved_motion".to_owned(),
        Box::new(|tracer| {
            let world = world_of(curved::fan(2, 6, &keys(9), 3.0));
            agree_on(tracer, &world, 50)
        }),
    );
    for key_count in [3, 6, 9, 12] {
        add(
            format!("paths_along_arcs_with_{key_count}_keys"),
            Box::new(move |tracer| {
                let world = world_of(curved::flown(24, &keys(key_count), 0.0, 3));
                agree_on(tracer, &world, 50)
            }),
        );
    }
    add(
        "surfaces_that_coincide".to_owned(),
        Box::new(|tracer| agree_on(tracer, &coincident(5), 300)),
    );
    add("scenes_that_are_too_large".to_owned(), Box::new(too_large));
    add("a_device_that_hangs".to_owned(), Box::new(hangs));
    let worlds: [Paged; 5] = [
        ("sheet", || world_of(sheet(8, 9, &keys(2))), 20_000, 5),
        (
            "fan",
            || world_of(curved::fan(2, 6, &keys(9), 3.0)),
            20_000,
            3,
        ),
        ("crowd", || crowd(12), 8_000, 3),
        ("coincident", || coincident(300), 4_000, 5),
        ("many_instances", many_instances, 4_000, 5),
    ];
    for (name, make, most, least) in worlds {
        add(
            format!("pages_of_{name}"),
            Box::new(move |tracer| paged(tracer, &make(), most, least)),
        );
    }
    let worlds: [Paged; 7] = [
        (
            "patches",
            || world_of(patches(40, 7, &keys(3), 3)),
            u64::MAX,
            3,
        ),
        ("sphere", || world_of(sphere(2, 5, &keys(1))), u64::MAX, 2),
        ("crowd", || crowd(12), u64::MAX, 6),
        ("coincident", || coincident(5), u64::MAX, 5),
        (
            "sheet_on_pages",
            || world_of(sheet(8, 9, &keys(2))),
            20_000,
            3,
        ),
        ("crowd_on_pages", || crowd(12), 8_000, 6),
        ("coincident_on_pages", || coincident(100), 4_000, 6),
    ];
    for (name, make, most, least_layers) in worlds {
        add(
            format!("layers_of_{name}"),
            Box::new(move |tracer| layered(tracer, &make(), most, least_layers)),
        );
    }
    add("work_in_parts".to_owned(), Box::new(in_parts));
    add("bad_rays".to_owned(), Box::new(bad_rays));
    add("watertight".to_owned(), Box::new(watertight));
    run(checks);
}
