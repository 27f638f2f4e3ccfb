//! Worlds that devices are tried with, and what their hits are held to.
#![allow(dead_code)]

use glam::DVec3;
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World, brute};
use hdtrapeze_gpu::{Device, GpuScene, Tracer};
use libtest_mimic::{Arguments, Failed, Trial};
use std::sync::Arc;

use crate::trace_scenes::*;

/// Rays that a world is traced with.
pub const RAYS: usize = 1500;

/// What a test does with a device.
pub type Check = Box<dyn FnOnce(&Tracer) -> Result<(), Failed> + Send>;

pub fn random_ray(rng: &mut Rng) -> Ray {
    let origin = rng.direction() * (0.2 + 3.0 * rng.unit());
    let dir = (rng.cube() - origin) * (0.01 + 5.0 * rng.unit());
    ray(origin, dir, rng.unit())
}

/// Traces random rays; each answer is checked by brute force, and nearly all are the CPU's.
pub fn agree(
    tracer: &Tracer,
    world: &World,
    scene: &GpuScene,
    least_hits: usize,
) -> Result<(), Failed> {
    let mut rng = Rng(7);
    let rays: Vec<Ray> = (0..RAYS).map(|_| random_ray(&mut rng)).collect();
    let (mut hits, mut any) = (vec![Hit::MISS; RAYS], vec![Hit::MISS; RAYS]);
    tracer.trace(scene, &rays, false, &mut hits)?;
    tracer.trace(scene, &rays, true, &mut any)?;
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
pub type Traced = (&'static str, fn(&[f32]) -> World, usize);

/// Worlds of one object.
pub fn objects() -> Vec<Traced> {
    vec![
        ("sheet", |keys| world_of(sheet(3, 9, keys)), 300),
        ("patches", |keys| world_of(patches(40, 7, keys, 3)), 100),
        ("fur", |keys| world_of(fur(200, keys, 4)), 30),
        ("combed", |keys| world_of(combed(200, 0.05, keys, 4)), 100),
        ("thin", |keys| world_of(thin(1000, keys, 4)), 60),
        ("sphere", |keys| world_of(sphere(2, 5, keys)), 200),
    ]
}

pub fn spinning(n: usize, turn: f64, scale: DVec3, at: DVec3) -> InstanceTransform {
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
pub fn crowd(moving: usize) -> World {
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

/// Instances in the same place.
pub fn coincident(count: usize) -> World {
    let one = object(sheet(2, 9, &[0.0]));
    let at = InstanceTransform::Translation(DVec3::ZERO);
    let all = (0..count).map(|_| instance(&one, at.clone())).collect();
    World::build(all, DVec3::ZERO)
}

/// Runs tests on the device there is; they show as ignored where there is none.
pub fn run(checks: Vec<(String, Check)>) {
    let arguments = Arguments::from_args();
    let tracer = Device::open().map(|device| Arc::new(Tracer::new(Arc::new(device))));
    match &tracer {
        Ok(tracer) => println!("on {}", tracer.device().found().name),
        Err(error) => println!("ignored: {error}"),
    }
    let trial = |(name, run): (String, Check)| {
        let tracer = tracer.clone();
        let ignored = tracer.is_err();
        let trial = Trial::test(name, move || run(&*tracer?));
        trial.with_ignored_flag(ignored)
    };
    let trials = checks.into_iter().map(trial).collect();
    libtest_mimic::run(&arguments, trials).exit();
}
