//! Secondary rays on a device: where they start, where they go, and what they meet, beside the CPU and brute force in f64, on
//! any device there is: software is enough. Where there is none, the tests show as ignored.

mod support;
#[path = "../../tests/trace_scenes/mod.rs"]
mod trace_scenes;

use std::sync::Arc;

use glam::{DVec3, Vec3};
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World, brute};
use hdtrapeze_gpu::occlude::{Before, host};
use hdtrapeze_gpu::{GpuError, GpuScene, Occluder, Occlusion, SecondaryStage, Tracer};
use hdtrapeze_shaders::layout::{Ray as RayThere, Site};
use libtest_mimic::Failed;
use support::*;
use trace_scenes::*;

/// What a direction may be off by: some roundings of its parts.
const DIRECTION: f64 = 16.0 / 16_777_216.0;

/// Whether there is a hit beyond doubt, and whether there may be one.
fn crossed(world: &World, ray: &Ray) -> (bool, bool) {
    let length = f64::from(ray.dir.length());
    let (from, to) = (f64::from(ray.t_min), f64::from(ray.t_max));
    let (mut sure, mut possible) = (false, false);
    for c in brute::crossings(world, ray) {
        let slack = (c.tolerance / c.cosine + c.tolerance) / length;
        sure |= c.inside > c.tolerance && c.t > from + slack && c.t < to - slack;
        possible |= c.t > from - slack && c.t < to + slack;
    }
    (sure, possible)
}

/// The device's answers are the CPU's, but where brute force says that a ray meets something or not within the tolerance.
/// One in `step` answers is checked by brute force alone.
fn same_answers(world: &World, rays: &[Ray], found: &[bool], step: usize) -> Result<(), Failed> {
    let mut here = vec![false; rays.len()];
    world.occluded_many(rays, &mut here, &mut TraceCounts::default());
    let mut in_doubt = 0;
    for (i, (ray, (&here, &found))) in rays.iter().zip(here.iter().zip(found)).enumerate() {
        if here == found && i % step != 0 {
            continue;
        }
        let (sure, possible) = crossed(world, ray);
        let wrong = if found { !possible } else { sure };
        if wrong {
            return Err(format!("{ray:?}: {found}, not {sure}; {here} on the CPU").into());
        }
        in_doubt += usize::from(here != found);
    }
    match in_doubt * 1000 > rays.len() {
        true => Err(format!("{in_doubt} of {} answers in doubt", rays.len()).into()),
        false => Ok(()),
    }
}

/// Random rays that end somewhere: as many meet something as not, about.
fn rays_that_end(
    tracer: &Tracer,
    world: &World,
    most: u64,
    least_pages: usize,
) -> Result<(), Failed> {
    let occluder = Occluder::new(Arc::clone(tracer.device()));
    let scene = GpuScene::with_pages(tracer.device(), world, most)?;
    if scene.page_count() < least_pages {
        return Err(format!("only {} pages", scene.page_count()).into());
    }
    let mut rng = Rng(9);
    let rays: Vec<Ray> = (0..RAYS)
        .map(|_| {
            let mut ray = random_ray(&mut rng);
            let length = ray.dir.length();
            ray.t_max = 3.0 * rng.unit() / length;
            ray
        })
        .collect();
    let mut found = vec![false; rays.len()];
    occluder.occluded(&scene, &rays, false, &mut found)?;
    same_answers(world, &rays, &found, 1)?;
    let mut sorted = vec![true; rays.len()];
    occluder.occluded(&scene, &rays, true, &mut sorted)?;
    if found != sorted {
        return Err("sorted rays meet something else".into());
    }
    let count = found.iter().filter(|&&found| found).count();
    match (30..RAYS - 30).contains(&count) {
        true => Ok(()),
        false => Err(format!("{count} of {RAYS} rays meet something").into()),
    }
}

/// First hits, and all that becomes of them.
struct Made {
    rays: Vec<Ray>,
    rays_there: Vec<RayThere>,
    hits: Vec<Hit>,
    sites: Vec<Site>,
    scattered: Vec<RayThere>,
    order: Vec<u32>,
    shares: Vec<f32>,
}

fn made(
    tracer: &Tracer,
    scene: &GpuScene,
    rays: &[Ray],
    occlusion: &Occlusion,
) -> Result<Made, Failed> {
    let device = tracer.device();
    let occluder = Occluder::new(Arc::clone(device));
    let len = rays.len();
    let there = occluder.upload(rays)?.rays;
    let batch = tracer.batch_of(scene, &there, len, false, false)?;
    tracer.run(&batch)?;
    let mut hits = vec![Hit::MISS; len];
    tracer.read(&batch, &mut hits)?;
    let first = [&there, batch.hits()];
    let (sites, _) = occluder.sites(scene, first, len, false)?;
    let (mut scattered, _) = occluder.scatter(&sites, len, occlusion, false)?;
    if occlusion.sorted {
        occluder.sort(scene, &mut scattered, false)?;
    }
    let mut out = Made {
        rays: rays.to_vec(),
        rays_there: vec![RayThere::default(); len],
        hits,
        sites: vec![Site::default(); len],
        scattered: vec![RayThere::default(); scattered.len],
        order: vec![0; scattered.len],
        shares: vec![0.0; len],
    };
    device.fetch(&there, &mut out.rays_there)?;
    device.fetch(&sites, &mut out.sites)?;
    device.fetch(&scattered.rays, &mut out.scattered)?;
    match &scattered.order {
        Some(order) => device.fetch(order, &mut out.order)?,
        None => out.order.clear(),
    }
    let (shares, _) = occluder.shares(scene, first, len, occlusion, false)?;
    device.fetch(&shares, &mut out.shares)?;
    Ok(out)
}

/// As core has it.
fn to_core(ray: &RayThere) -> Ray {
    Ray {
        origin: Vec3::from_array(ray.origin),
        dir: Vec3::from_array(ray.dir),
        time: ray.time,
        t_min: ray.t_min,
        t_max: ray.t_max,
    }
}

/// Sites are where the CPU sees the hits, and rays those of their samples.
fn sites_and_rays(world: &World, made: &Made, occlusion: &Occlusion) -> Result<(), Failed> {
    let samples = occlusion.samples as usize;
    // Those of the device's sites, and sites of its hits.
    let expected = host::scattered(&made.sites, occlusion);
    let expected_sites = host::sites(world, &made.rays_there, &made.hits);
    for (number, ((ray, hit), (site, expected_site))) in made
        .rays
        .iter()
        .zip(&made.hits)
        .zip(made.sites.iter().zip(&expected_sites))
        .enumerate()
    {
        let scattered = &made.scattered[number * samples..][..samples];
        let normal = world.geometric_normal(hit, ray.time).unwrap_or(Vec3::ZERO);
        if normal == Vec3::ZERO {
            let idle = scattered.iter().all(|ray| ray.t_max < ray.t_min);
            if site.normal != [0.0; 3] || !idle || made.shares[number] != 1.0 {
                return Err(format!("{site:?} for {hit:?}").into());
            }
            continue;
        }
        let facing = if normal.dot(ray.dir) > 0.0 {
            -normal
        } else {
            normal
        };
        let off = (Vec3::from_array(site.normal) - facing).length();
        // A ray along the surface has it on both sides.
        if off > 2.0e-5 && normal.dot(ray.dir.normalize()).abs() > 1.0e-4 {
            return Err(format!("{site:?} for {hit:?}, whose normal is {facing}").into());
        }
        let at = world.position(hit, ray.time).unwrap_or(Vec3::NAN);
        let origin = Vec3::from_array(site.origin);
        let away = (origin - at).dot(Vec3::from_array(site.normal));
        let aside = (origin - at).length() - away.abs();
        let size = at.length() + world.radius();
        // As far as told, and not far.
        if !((away - site.offset).abs() < 0.5 * site.offset && aside < 0.2 * site.offset)
            || site.offset > 2.0e-3 * size
            || site.time != ray.time
        {
            return Err(format!("{site:?} for {hit:?} at {at} {away} {aside}").into());
        }
        if (site.offset - expected_site.offset).abs() > 1.0e-4 * site.offset {
            return Err(format!("{site:?}, not {expected_site:?}").into());
        }
        let all = scattered.iter().zip(&expected[number * samples..]);
        for (i, (ray, expected)) in all.enumerate() {
            let n = Vec3::from_array(site.normal).as_dvec3();
            let [dir, expected] = [ray.dir, expected.dir].map(|d| Vec3::from_array(d).as_dvec3());
            let off = (dir - expected).length();
            // Near the rim the root is steep.
            if off > DIRECTION / expected.dot(n).max(1.0 / 64.0) || dir.dot(n) <= 0.0 {
                return Err(format!("{ray:?} is {off} off {expected}").into());
            }
            let number = (number * samples + i) as u32;
            let reach = occlusion.reach.min(f32::MAX);
            if (ray.number, ray.t_min, ray.t_max) != (number, 0.0, reach)
                || ray.origin != site.origin
                || ray.time != site.time
            {
                return Err(format!("{ray:?} of {site:?}").into());
            }
        }
    }
    Ok(())
}

/// Shares are those that the CPU finds for the same rays, sorted or not.
fn shares_of(tracer: &Tracer, world: &World) -> Result<(), Failed> {
    let scene = GpuScene::new(tracer.device(), world)?;
    let mut rng = Rng(21);
    let rays: Vec<Ray> = (0..400).map(|_| random_ray(&mut rng)).collect();
    for (samples, reach, first) in [(16, f32::INFINITY, 0), (5, 0.7, 1000)] {
        let occlusion = Occlusion {
            samples,
            seed: 3,
            first,
            reach,
            sorted: true,
        };
        let sorted = made(tracer, &scene, &rays, &occlusion)?;
        let found = sorted.hits.iter().filter(|hit| hit.is_hit()).count();
        if found < 40 {
            return Err(format!("{found} hits").into());
        }
        sites_and_rays(world, &sorted, &occlusion)?;
        let unsorted = Occlusion {
            sorted: false,
            ..occlusion
        };
        let plain = made(tracer, &scene, &rays, &unsorted)?;
        let bits = |made: &Made| made.shares.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        if bits(&sorted) != bits(&plain) || !plain.order.is_empty() {
            return Err("shares depend on the order".into());
        }
        each_once_in_order(&sorted)?;
        let secondary: Vec<Ray> = sorted.scattered.iter().map(to_core).collect();
        let occluder = Occluder::new(Arc::clone(tracer.device()));
        let mut there = vec![false; secondary.len()];
        occluder.occluded(&scene, &secondary, false, &mut there)?;
        same_answers(world, &secondary, &there, 7)?;
        for (share, met) in sorted.shares.iter().zip(there.chunks(samples as usize)) {
            let free = met.iter().filter(|met| !**met).count();
            if *share != free as f32 / samples as f32 {
                return Err(format!("{share}, not {free} of {samples}").into());
            }
        }
    }
    Ok(())
}

/// Where a scene is on several pages, the bits of sites and shares are those of one page.
fn shares_on_pages(tracer: &Tracer, world: &World, most: u64) -> Result<(), Failed> {
    let device = tracer.device();
    let (whole, scene) = (
        GpuScene::new(device, world)?,
        GpuScene::with_pages(device, world, most)?,
    );
    if scene.page_count() < 3 {
        return Err(format!("only {} pages", scene.page_count()).into());
    }
    let mut rng = Rng(22);
    let rays: Vec<Ray> = (0..600).map(|_| random_ray(&mut rng)).collect();
    let occlusion = Occlusion::default();
    let (on_one, on_several) = (
        made(tracer, &whole, &rays, &occlusion)?,
        made(tracer, &scene, &rays, &occlusion)?,
    );
    let found = on_one.hits.iter().filter(|hit| hit.is_hit()).count();
    if found < 40 || on_one.hits != on_several.hits {
        return Err(format!("{found} hits").into());
    }
    for (one, other) in on_one.sites.iter().zip(&on_several.sites) {
        if bytemuck::bytes_of(one) != bytemuck::bytes_of(other) {
            return Err(format!("{other:?} on pages, {one:?} on one").into());
        }
    }
    let bits = |made: &Made| made.shares.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    match bits(&on_one) == bits(&on_several) {
        true => Ok(()),
        false => Err("shares depend on pages".into()),
    }
}

/// Whichever stage is the first on the device, shares are those that it finds alone: but for rays of the CPU's sites, which
/// are off by roundings, and for answers in doubt. Orders are nearly the same.
fn from_each_stage(tracer: &Tracer, world: &World, most: u64) -> Result<(), Failed> {
    let device = tracer.device();
    let scene = GpuScene::with_pages(device, world, most)?;
    let occluder = Occluder::new(Arc::clone(device));
    let mut rng = Rng(23);
    let rays: Vec<Ray> = (0..3000).map(|_| random_ray(&mut rng)).collect();
    let occlusion = Occlusion {
        first: 77,
        reach: 1.5,
        ..Occlusion::default()
    };
    let there = occluder.upload(&rays)?.rays;
    let batch = tracer.batch_of(&scene, &there, rays.len(), false, false)?;
    tracer.run(&batch)?;
    let met = [&there, batch.hits()];
    let from = |first| -> Result<Vec<f32>, Failed> {
        let before = Before { first, world };
        let shares = occluder.shares_from(before, &scene, met, rays.len(), &occlusion)?;
        let mut found = vec![0.0; rays.len()];
        device.fetch(&shares, &mut found)?;
        Ok(found)
    };
    let whole = made(tracer, &scene, &rays, &occlusion)?;
    let some = whole.shares.iter().filter(|&&x| x > 0.0 && x < 1.0).count();
    if some < 40 {
        return Err(format!("{some} shares between none and all").into());
    }
    // Rays that answer otherwise.
    let apart = |a: &[f32], b: &[f32]| {
        let off = a.iter().zip(b).map(|(a, b)| (a - b).abs());
        (off.sum::<f32>() * occlusion.samples as f32).round() as usize
    };
    let answers = rays.len() * occlusion.samples as usize;
    let mut before = whole.shares.clone();
    for first in SecondaryStage::ALL {
        let found = from(first)?;
        let most = match first {
            SecondaryStage::Scatter | SecondaryStage::Share => answers / 1000,
            SecondaryStage::Order => answers / 10_000,
            // The whole is on the device; or an order differs, at most.
            _ => 0,
        };
        let apart = apart(&found, &before);
        if apart > most {
            let name = first.name();
            return Err(format!("{apart} of {answers} answers differ from {name} on").into());
        }
        before = found;
    }
    orders(&occluder, world, &scene, &whole)
}

/// Which ray follows which in an order is what the CPU's stages say, but where a direction is between two cells.
fn orders(
    occluder: &Occluder,
    world: &World,
    scene: &GpuScene,
    whole: &Made,
) -> Result<(), Failed> {
    let followers = |order: &[u32]| {
        let mut out = vec![u32::MAX; order.len()];
        for pair in order.windows(2) {
            out[pair[0] as usize] = pair[1];
        }
        out
    };
    let expected = followers(&whole.order);
    for first in [SecondaryStage::Sort, SecondaryStage::Occlude] {
        let mut rays = occluder.upload(&[])?;
        (rays.rays, rays.len) = (
            occluder
                .device()
                .upload("rays", bytemuck::cast_slice(&whole.scattered))?,
            whole.scattered.len(),
        );
        let before = Before { first, world };
        occluder.sort_from(Some(before), scene, &mut rays, false)?;
        let mut order = vec![0; rays.len];
        let there = rays.order.as_ref().ok_or("no order")?;
        occluder.device().fetch(there, &mut order)?;
        let found = followers(&order);
        let apart = found.iter().zip(&expected).filter(|(a, b)| a != b).count();
        if apart * 1000 > order.len() {
            let name = first.name();
            return Err(format!("{apart} of {} follow others from {name} on", order.len()).into());
        }
    }
    Ok(())
}

/// An order has each ray once.
fn each_once_in_order(made: &Made) -> Result<(), Failed> {
    let mut seen = vec![false; made.scattered.len()];
    for &place in &made.order {
        if std::mem::replace(&mut seen[place as usize], true) {
            return Err(format!("ray {place} comes twice").into());
        }
    }
    if seen.iter().any(|seen| !seen) {
        return Err("a ray is left out".into());
    }
    Ok(())
}

/// A flat, tilted sheet.
fn plane(size: f32, at: Vec3) -> DicedMesh {
    mesh(&[(16, 16); 9], &[0.0], |g, u, v, _| {
        let (i, j) = ((g % 3) as f32, (g / 3) as f32);
        let (x, y) = ((i + u) / 1.5 - 1.0, (j + v) / 1.5 - 1.0);
        at + Vec3::new(x, y, 0.37 * x - 0.21 * y) * size
    })
}

/// A cube that shears while the shutter is open: its faces stay flat.
fn block() -> DicedMesh {
    closed(2, 5, &keys(2), |p, t| {
        Vec3::new(p.x + 0.4 * t * p.y, 0.7 * p.y, p.z + t * (0.3 - 0.2 * p.z))
    })
}

/// Above an open plane and outside of a block all is free, and inside of what is closed nothing: at any size and place.
fn known_answers(tracer: &Tracer) -> Result<(), Failed> {
    let turned = |scale: DVec3, at: DVec3| {
        InstanceTransform::Static(affine(DVec3::new(1.0, 2.0, 3.0), 0.7, scale, at))
    };
    let still = |at: DVec3| InstanceTransform::Translation(at);
    let transforms = [
        still(DVec3::ZERO),
        still(DVec3::new(1000.0, -300.0, 20.0)),
        turned(DVec3::new(1.0, 2.0, 0.5), DVec3::new(3.0, 1.0, 0.0)),
        turned(DVec3::new(-3.0, 100.0, 20.0), DVec3::new(90.0, 0.0, -70.0)),
        spinning(3, 0.9, DVec3::new(0.8, 1.5, 1.0), DVec3::Z * 5.0),
    ];
    for transform in &transforms {
        for (name, mesh, inside, expected) in [
            ("plane", plane(1.0, Vec3::ZERO), false, 1.0),
            (
                "far plane",
                plane(0.1, Vec3::new(70.0, 20.0, -3.0)),
                false,
                1.0,
            ),
            ("large plane", plane(1.0e4, Vec3::ZERO), false, 1.0),
            ("outside", block(), false, 1.0),
            ("in a block", block(), true, 0.0),
        ] {
            let (centre, radius) = middle(&mesh);
            let world = World::build(
                vec![instance(&object(mesh), transform.clone())],
                DVec3::ZERO,
            );
            let scene = GpuScene::new(tracer.device(), &world)?;
            let mut rng = Rng(4);
            // In the object's space, and from there to the world.
            let aim = |_| {
                let time = rng.unit();
                let to = rng.direction() * radius;
                let from = match inside {
                    true => rng.cube() * 0.2 * radius,
                    false => rng.direction() * radius * 3.0,
                };
                let m = at_time(transform, time);
                let [from, to] = [from, to].map(|p| m.transform_point3((p + centre).as_dvec3()));
                ray(from.as_vec3(), (to - from).as_vec3(), time)
            };
            let rays: Vec<Ray> = (0..400).map(aim).collect();
            let made = made(tracer, &scene, &rays, &Occlusion::default())?;
            let hits = made.hits.iter().zip(&made.shares);
            let shares: Vec<f32> = hits
                .filter(|(hit, _)| hit.is_hit())
                .map(|(_, share)| *share)
                .collect();
            let wrong = shares.iter().filter(|&&share| share != expected).count();
            if shares.len() < 50 || wrong > 0 {
                let what = format!("{name} {transform:?}: {wrong} of {} shares", shares.len());
                return Err(format!("{what} are not {expected}").into());
            }
        }
    }
    Ok(())
}

/// Its middle, and how far it goes from there.
fn middle(mesh: &DicedMesh) -> (Vec3, f32) {
    let (lo, hi) = mesh
        .positions
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| {
            (lo.min(*p), hi.max(*p))
        });
    (0.5 * (lo + hi), 0.3 * (hi - lo).length())
}

fn at_time(transform: &InstanceTransform, time: f32) -> glam::DAffine3 {
    match transform {
        InstanceTransform::Translation(by) => glam::DAffine3::from_translation(*by),
        InstanceTransform::Static(m) => *m,
        InstanceTransform::Moving { matrices, .. } => {
            let last = matrices.len() - 1;
            let at = f64::from(time) * last as f64;
            let k = (at as usize).min(last - 1);
            let (a, b, f) = (&matrices[k], &matrices[k + 1], at - k as f64);
            glam::DAffine3 {
                matrix3: a.matrix3 + (b.matrix3 - a.matrix3) * f,
                translation: a.translation.lerp(b.translation, f),
            }
        }
    }
}

/// A name, what is traced, and the bytes of a page.
type Paged = (&'static str, fn() -> World, u64);

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
        with(|r| r.t_max = f32::NAN),
        with(|r| r.origin = Vec3::splat(3.0e38)),
        with(|r| r.time = 7.0),
        with(|r| r.t_max = 2.0),
    ];
    let expected = rays.map(|ray| world.occluded(&ray, &mut TraceCounts::default()));
    let occluder = Occluder::new(Arc::clone(tracer.device()));
    let scene = GpuScene::new(tracer.device(), &world)?;
    for sorted in [false, true] {
        let mut found = [true; 10];
        occluder.occluded(&scene, &rays, sorted, &mut found)?;
        if found != expected || !found[0] || found[1] {
            return Err(format!("{found:?}, not {expected:?}").into());
        }
    }
    let nothing = World::build(Vec::new(), DVec3::ZERO);
    let scene = GpuScene::new(tracer.device(), &nothing)?;
    let mut found = [true; 10];
    occluder.occluded(&scene, &rays, true, &mut found)?;
    let none = made(tracer, &scene, &rays, &Occlusion::default())?;
    match found == [false; 10] && none.shares == [1.0; 10] {
        true => Ok(()),
        false => Err(format!("{found:?} {:?} in an empty world", none.shares).into()),
    }
}

/// More rays than can be numbered are refused in words, whoever would make them.
fn too_many_rays(tracer: &Tracer) -> Result<(), Failed> {
    let world = world_of(sheet(2, 8, &keys(2)));
    let scene = GpuScene::new(tracer.device(), &world)?;
    let occluder = Occluder::new(Arc::clone(tracer.device()));
    let rays = [ray(Vec3::Z * 3.0, -Vec3::Z, 0.5); 3];
    let there = occluder.upload(&rays)?.rays;
    let batch = tracer.batch_of(&scene, &there, rays.len(), false, false)?;
    tracer.run(&batch)?;
    let met = [&there, batch.hits()];
    let occlusion = Occlusion {
        samples: u32::MAX,
        ..Occlusion::default()
    };
    for first in [SecondaryStage::Site, SecondaryStage::Share] {
        let before = Before {
            first,
            world: &world,
        };
        match occluder.shares_from(before, &scene, met, rays.len(), &occlusion) {
            Err(error @ GpuError::TooLarge { .. }) if error.to_string().contains("rays need") => {}
            other => return Err(format!("{other:?}").into()),
        }
    }
    Ok(())
}

/// Rays that stand together in an order are of neighbouring hits and go one way, and those that go one way are of nearly
/// one instant.
fn order_follows_direction(tracer: &Tracer) -> Result<(), Failed> {
    let world = world_of(sheet(3, 9, &keys(2)));
    let scene = GpuScene::new(tracer.device(), &world)?;
    let mut rng = Rng(2);
    let rays: Vec<Ray> = (0..4000).map(|_| random_ray(&mut rng)).collect();
    let made = made(tracer, &scene, &rays, &Occlusion::default())?;
    each_once_in_order(&made)?;
    let run = |place: u32| place >> 12;
    if !made.order.is_sorted_by_key(|&place| run(place)) {
        return Err("runs are torn".into());
    }
    // What neighbours in the order differ by: in direction, and in the quarter of their times.
    let differ = |order: &[u32]| {
        let rays: Vec<&RayThere> = order
            .iter()
            .map(|&place| &made.scattered[place as usize])
            .filter(|ray| ray.t_max > 0.0)
            .collect();
        let dir = |ray: &RayThere| Vec3::from_array(ray.dir);
        let quarter = |ray: &RayThere| (ray.time * 4.0) as u32;
        let pairs = rays.windows(2);
        let turned = pairs.clone().map(|p| 1.0 - dir(p[0]).dot(dir(p[1])));
        let later = pairs.clone().filter(|p| quarter(p[0]) != quarter(p[1]));
        let count = pairs.len() as f32;
        (turned.sum::<f32>() / count, later.count() as f32 / count)
    };
    let given: Vec<u32> = (0..made.scattered.len() as u32).collect();
    let (plain, sorted) = (differ(&given), differ(&made.order));
    match sorted.0 < 0.1 && plain.0 > 0.3 && sorted.1 < 0.2 {
        true => Ok(()),
        false => Err(format!("neighbours differ by {sorted:?}, of {plain:?}").into()),
    }
}

fn main() {
    let mut checks = Vec::new();
    let mut add = |name: String, run: Check| checks.push((name, run));
    for (name, make, _) in objects() {
        for key_count in [1, 2, 3] {
            add(
                format!("rays_through_{name}_with_{key_count}_keys"),
                Box::new(move |tracer| rays_that_end(tracer, &make(&keys(key_count)), u64::MAX, 1)),
            );
            // Normals of what is so narrow are rounded farther than they are compared.
            if !["fur", "thin"].contains(&name) {
                add(
                    format!("shares_of_{name}_with_{key_count}_keys"),
                    Box::new(move |tracer| shares_of(tracer, &make(&keys(key_count)))),
                );
            }
        }
    }
    for moving in [0, 3, 40] {
        add(
            format!("rays_through_instances_of_which_{moving}_move"),
            Box::new(move |tracer| rays_that_end(tracer, &crowd(moving), u64::MAX, 1)),
        );
        add(
            format!("shares_of_instances_of_which_{moving}_move"),
            Box::new(move |tracer| shares_of(tracer, &crowd(moving))),
        );
    }
    add(
        "rays_through_surfaces_that_coincide".to_owned(),
        Box::new(|tracer| rays_that_end(tracer, &coincident(5), u64::MAX, 1)),
    );
    add(
        "shares_of_surfaces_that_coincide".to_owned(),
        Box::new(|tracer| shares_of(tracer, &coincident(5))),
    );
    let worlds: [Paged; 3] = [
        ("sheet", || world_of(sheet(8, 9, &keys(2))), 20_000),
        ("crowd", || crowd(12), 8_000),
        ("coincident", || coincident(300), 4_000),
    ];
    for (name, make, most) in worlds {
        add(
            format!("rays_through_pages_of_{name}"),
            Box::new(move |tracer| rays_that_end(tracer, &make(), most, 3)),
        );
        // The last has a page for few instances, and rays enter all of them.
        if name != "coincident" {
            add(
                format!("shares_on_pages_of_{name}"),
                Box::new(move |tracer| shares_on_pages(tracer, &make(), most)),
            );
        }
    }
    let worlds: [Paged; 4] = [
        ("patches", || world_of(patches(40, 7, &[0.0], 3)), u64::MAX),
        ("sheet", || world_of(sheet(8, 9, &keys(2))), 20_000),
        ("crowd", || crowd(12), u64::MAX),
        ("crowd_on_pages", || crowd(12), 8_000),
    ];
    for (name, make, most) in worlds {
        add(
            format!("from_each_stage_on_{name}"),
            Box::new(move |tracer| from_each_stage(tracer, &make(), most)),
        );
    }
    add("known_answers".to_owned(), Box::new(known_answers));
    add("bad_rays".to_owned(), Box::new(bad_rays));
    add("too_many_rays".to_owned(), Box::new(too_many_rays));
    add("order".to_owned(), Box::new(order_follows_direction));
    run(checks);
}
