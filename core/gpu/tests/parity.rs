//! The device's hits against brute force in f64 and against the CPU's, on any device there is: software is
//! enough. Where there is none, the tests show as ignored.

#[path = "../../tests/trace_scenes/mod.rs"]
mod trace_scenes;

use std::sync::Arc;

use glam::{DVec3, Vec3};
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World, brute};
use hdtrapeze_gpu::{Device, GpuError, GpuScene, Tracer};
use libtest_mimic::{Arguments, Failed, Trial};
use trace_scenes::*;

const RAYS: usize = 1500;

type Check = Box<dyn FnOnce(&Tracer) -> Result<(), Failed> + Send>;

fn random_ray(rng: &mut Rng) -> Ray {
    let origin = rng.direction() * (0.2 + 3.0 * rng.unit());
    let dir = (rng.cube() - origin) * (0.01 + 5.0 * rng.unit());
    ray(origin, dir, rng.unit())
}

fn traced(tracer: &Tracer, world: &World, rays: &[Ray], any: bool) -> Result<Vec<Hit>, Failed> {
    let scene = GpuScene::new(tracer.device(), world)?;
    let mut hits = vec![Hit::MISS; rays.len()];
    tracer.trace(&scene, rays, any, &mut hits)?;
    Ok(hits)
}

/// Traces random rays; each answer is checked by brute force, and nearly all are the CPU's.
fn agree(tracer: &Tracer, world: &World, least_hits: usize) -> Result<(), Failed> {
    let mut rng = Rng(7);
    let rays: Vec<Ray> = (0..RAYS).map(|_| random_ray(&mut rng)).collect();
    let hits = traced(tracer, world, &rays, false)?;
    let any = traced(tracer, world, &rays, true)?;
    let (mut same, mut found) = (0, 0);
    for ((ray, hit), any) in rays.iter().zip(&hits).zip(&any) {
        brute::verify(world, ray, None, hit).map_err(|e| format!("{ray:?}: {e}"))?;
        let cpu = world.trace(ray, &mut TraceCounts::default());
        let id = |hit: &Hit| (hit.instance, hit.grid, hit.cell);
        same += usize::from(id(&cpu) == id(hit));
        found += usize::from(hit.is_hit());
        if any.is_hit() != hit.is_hit() {
            return Err(format!("{ray:?}: {hit:?}, but any: {any:?}").into());
        }
    }
    if found < least_hits {
        return Err(format!("only {found} of {RAYS} rays hit").into());
    }
    if same * 1000 < RAYS * 995 {
        return Err(format!("only {same} of {RAYS} answers are the CPU's").into());
    }
    Ok(())
}

/// A name, what is traced, with these keys, and rays that hit it at least.
type Traced = (&'static str, fn(&[f32]) -> World, usize);

/// A name, what is traced, the bytes of a page, and how many pages that makes at least.
type Paged = (&'static str, fn() -> World, u64, usize);

fn objects() -> Vec<Traced> {
    vec![
        ("sheet", |keys| world_of(sheet(3, 9, keys)), 300),
        ("patches", |keys| world_of(patches(40, 7, keys, 3)), 100),
        ("fur", |keys| world_of(fur(200, keys, 4)), 30),
        ("combed", |keys| world_of(combed(200, 0.05, keys, 4)), 100),
        ("sphere", |keys| world_of(sphere(2, 5, keys)), 200),
    ]
}

fn spinning(n: usize, turn: f64, scale: DVec3, at: DVec3) -> InstanceTransform {
    let key_times = keys(n);
    let at_key = |&t: &f32| {
        let by = at + DVec3::X * f64::from(t) * 0.4;
        affine(DVec3::new(1.0, 2.0, 0.5), turn * f64::from(t), scale, by)
    };
    let matrices = key_times.iter().map(at_key).collect();
    InstanceTransform::Moving {
        key_times,
        matrices,
    }
}

/// All kinds of instances, of things that move and that do not.
fn crowd(moving: usize) -> World {
    let still = object(sheet(2, 7, &[0.0]));
    let bent = object(patches(12, 5, &keys(3), 9));
    let mut rng = Rng(11);
    let mut instances = Vec::new();
    for i in 0..40 {
        let at = rng.cube().as_dvec3();
        let of = if i % 3 == 0 { &bent } else { &still };
        let transform = match i % 4 {
            _ if i < moving => spinning(2 + i % 3, 1.0, DVec3::splat(0.3), at),
            0 => InstanceTransform::Translation(at * 0.5),
            _ => InstanceTransform::Static(affine(
                rng.direction().as_dvec3(),
                f64::from(rng.unit()) * 6.0,
                DVec3::new(0.3, 0.5, 0.2),
                at,
            )),
        };
        instances.push(instance(of, transform));
    }
    World::build(instances, DVec3::ZERO)
}

fn coincident(count: usize) -> World {
    let one = object(sheet(2, 9, &[0.0]));
    let at = InstanceTransform::Translation(DVec3::ZERO);
    let all = (0..count).map(|_| instance(&one, at.clone())).collect();
    World::build(all, DVec3::ZERO)
}

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

/// One set of very many instances needs several pages of them.
fn many_instances() -> World {
    let one = object(sheet(1, 4, &[0.0]));
    let mut rng = Rng(3);
    let at = |_| instance(&one, InstanceTransform::Translation(rng.cube().as_dvec3()));
    World::build((0..400).map(at).collect(), DVec3::ZERO)
}

/// What no page holds is refused in words, and the device goes on working.
fn too_large(tracer: &Tracer) -> Result<(), Failed> {
    // Less than the vertices of a grid.
    match GpuScene::with_pages(tracer.device(), &world_of(sheet(1, 16, &[0.0])), 2000) {
        Err(error @ GpuError::TooLarge { .. }) if error.to_string().contains("need") => {}
        other => return Err(format!("{other:?}").into()),
    }
    agree(tracer, &world_of(sheet(3, 9, &[0.0])), 300)
}

fn main() {
    let arguments = Arguments::from_args();
    let tracer = Device::open().map(|device| Arc::new(Tracer::new(Arc::new(device))));
    match &tracer {
        Ok(tracer) => println!("on {}", tracer.device().found().name),
        Err(error) => println!("ignored: {error}"),
    }
    let mut trials = Vec::new();
    let mut add = |name: String, run: Check| {
        let tracer = tracer.clone();
        let ignored = tracer.is_err();
        let trial = Trial::test(name, move || run(&*tracer?));
        trials.push(trial.with_ignored_flag(ignored));
    };
    for (name, make, least) in objects() {
        for key_count in [1, 2, 3, 5] {
            add(
                format!("{name}_with_{key_count}_keys"),
                Box::new(move |tracer| agree(tracer, &make(&keys(key_count)), least)),
            );
        }
    }
    for moving in [0, 3, 40] {
        add(
            format!("instances_of_which_{moving}_move"),
            Box::new(move |tracer| agree(tracer, &crowd(moving), 200)),
        );
    }
    add(
        "curved_motion".to_owned(),
        Box::new(|tracer| {
            let world = world_of(curved::fan(2, 6, &keys(9), 3.0));
            agree(tracer, &world, 50)
        }),
    );
    add(
        "surfaces_that_coincide".to_owned(),
        Box::new(|tracer| agree(tracer, &coincident(5), 300)),
    );
    add("scenes_that_are_too_large".to_owned(), Box::new(too_large));
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
    add("bad_rays".to_owned(), Box::new(bad_rays));
    add("watertight".to_owned(), Box::new(watertight));
    libtest_mimic::run(&arguments, trials).exit();
}
