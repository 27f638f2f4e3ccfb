//! Trees over meshes of all kinds, sizes and faults.

use glam::{DVec3, Vec3};
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::{InstanceTransform, World};
use hdtrapeze_gpu::{BuildOptions, FirstOnDevice, GpuScene, Tracer};
use libtest_mimic::Failed;

use crate::support::*;
use crate::trace_scenes::*;
use crate::walk::contained;
use crate::{as_with_host_trees, builder, built};

/// A scene is contained, with trees of the device and of the CPU; rays hit what they should.
pub fn sound(tracer: &Tracer, mesh: &DicedMesh, least_hits: usize) -> Result<(), Failed> {
    let world = world_of(mesh.clone());
    let scene = built(tracer, &world, false)?;
    contained(tracer, &scene, &[mesh])?;
    agree(tracer, &world, &scene, least_hits)?;
    for first in [
        FirstOnDevice::Build,
        FirstOnDevice::Instances,
        FirstOnDevice::Generate,
    ] {
        let options = BuildOptions {
            first,
            ..BuildOptions::default()
        };
        let other = GpuScene::build(builder(tracer), &world, &options)?;
        contained(tracer, &other, &[mesh])
            .map_err(|e| format!("from {} on: {e:?}", first.name()))?;
        as_with_host_trees(tracer, &world, &other, RAYS, least_hits)?;
    }
    as_with_host_trees(tracer, &world, &scene, RAYS, least_hits)
}

pub fn single_cells(count: usize, at: impl Fn(usize, f32, f32, f32) -> Vec3) -> DicedMesh {
    mesh(&vec![(1, 1); count], &[0.0], at)
}

/// Very many equal boxes, which no order tells apart. A ray asks each of them; Mesa's software device gives up after some
/// 65,536 turns of loops, so that rays are tried with fewer.
pub fn equal_boxes(tracer: &Tracer) -> Result<(), Failed> {
    for (count, rays) in [(50_000, 0), (1000, 100)] {
        let mesh = single_cells(count, |_, u, v, _| Vec3::new(u, v, 0.3 * u));
        let world = world_of(mesh.clone());
        let scene = built(tracer, &world, false)?;
        let [nodes, _, loose] = contained(tracer, &scene, &[&mesh])?;
        if loose != count || nodes > count * 4 / 7 {
            return Err(format!("{nodes} nodes over {loose} groups").into());
        }
        as_with_host_trees(tracer, &world, &scene, rays, rays / 20)?;
    }
    Ok(())
}

/// Boxes inside boxes, of which no two find each other but the smallest.
pub fn nested_boxes(tracer: &Tracer) -> Result<(), Failed> {
    let mesh = single_cells(3000, |g, u, v, _| {
        let size = 1.002f32.powi(g as i32 - 3000);
        Vec3::new((u - 0.5) * size, (v - 0.5) * size, u * v * size)
    });
    let world = world_of(mesh.clone());
    let scene = built(tracer, &world, false)?;
    if tracer.device().found().timestamps && scene.build_seconds().is_empty() {
        return Err("made by the CPU".into());
    }
    contained(tracer, &scene, &[&mesh])?;
    as_with_host_trees(tracer, &world, &scene, 200, 10)
}

/// What has no thickness, on one axis, on two, or on all.
pub fn flat(tracer: &Tracer) -> Result<(), Failed> {
    for extent in [Vec3::new(1.0, 1.0, 0.0), Vec3::X, Vec3::ZERO] {
        for key_count in [1, 3] {
            let mesh = mesh(&[(9, 9); 30], &keys(key_count), |g, u, v, t| {
                let p = Vec3::new(u + g as f32 * 0.1, v, 1.0) * extent;
                p + Vec3::Y * t * t * extent.y
            });
            let world = world_of(mesh.clone());
            let scene = built(tracer, &world, false)?;
            contained(tracer, &scene, &[&mesh])?;
            as_with_host_trees(tracer, &world, &scene, 300, 0)?;
        }
    }
    Ok(())
}

/// Coordinates as large as can be traced, and as small as floats can be.
pub fn all_sizes(tracer: &Tracer) -> Result<(), Failed> {
    for exponent in [-149, -140, -126, -100, -40, 30, 58] {
        let size = (f64::from(exponent)).exp2() as f32;
        for key_count in [1, 2, 4] {
            for mut mesh in [
                sheet(3, 9, &keys(key_count)),
                patches(20, 7, &keys(key_count), 5),
                fur(40, &keys(key_count), 6),
            ] {
                for p in &mut mesh.positions {
                    *p *= size;
                }
                let world = world_of(mesh.clone());
                let scene = built(tracer, &world, false)?;
                contained(tracer, &scene, &[&mesh])
                    .map_err(|e| format!("2^{exponent}, {key_count} keys: {e:?}"))?;
            }
        }
    }
    Ok(())
}

/// Paths of single points, whose bounds leave nothing to spare: all vertices of a grid are in one place, as
/// far from the origin as they move, or much farther or nearer.
pub fn paths(tracer: &Tracer) -> Result<(), Failed> {
    let mut rng = Rng(77);
    for key_count in [2, 3, 4, 7] {
        let paths: Vec<Vec<Vec3>> = (0..3000)
            .map(|_| {
                let [at, far] = [-140.0, -20.0].map(|low| (low * rng.unit() * rng.unit()).exp2());
                let at = rng.cube() * at;
                let mut step = || at + rng.cube() * rng.unit() * far;
                (0..key_count).map(|_| step()).collect()
            })
            .collect();
        let key_times = keys(key_count);
        let mesh = mesh(&vec![(2, 3); paths.len()], &key_times, |g, _, _, t| {
            let k = key_times.iter().position(|&time| time == t);
            paths[g][k.unwrap_or(0)]
        });
        let scene = built(tracer, &world_of(mesh.clone()), false)?;
        contained(tracer, &scene, &[&mesh])?;
    }
    Ok(())
}

/// Grids that cannot be traced are left out whole, and the others are there.
pub fn bad_grids(tracer: &Tracer) -> Result<(), Failed> {
    for bad in [f32::NAN, f32::NEG_INFINITY, -1.2e18, f32::INFINITY] {
        for key_count in [1, 3] {
            let mut mesh = sheet(4, 13, &keys(key_count));
            let n = mesh.grids[0].vertex_count();
            // A vertex at some key, of every third grid.
            for g in (0..16).step_by(3) {
                let key = g % key_count;
                mesh.positions[(g * key_count + key) * n + 7 * g].y = bad;
            }
            mesh.grids[10].nu = 99;
            let world = world_of(mesh.clone());
            let scene = built(tracer, &world, false)?;
            contained(tracer, &scene, &[&mesh])?;
            as_with_host_trees(tracer, &world, &scene, 500, 50)?;
        }
    }
    Ok(())
}

/// One item, two, none, and no grid that can be traced.
pub fn few_items(tracer: &Tracer) -> Result<(), Failed> {
    let mut lost = sheet(1, 8, &[0.0]);
    lost.positions[3].x = f32::NAN;
    let strip = mesh(&[(1, 3)], &keys(2), |_, u, v, t| Vec3::new(u, v + t, v));
    for mesh in [
        sheet(1, 8, &[0.0]),
        sheet(1, 1, &keys(3)),
        strip,
        DicedMesh {
            key_times: vec![0.0],
            ..DicedMesh::default()
        },
        lost,
    ] {
        let world = world_of(mesh.clone());
        let scene = built(tracer, &world, false)?;
        contained(tracer, &scene, &[&mesh])?;
        as_with_host_trees(tracer, &world, &scene, 300, 0)?;
    }
    Ok(())
}

/// All kinds of grids in one object, beside objects that move and that do not.
fn mixed() -> Vec<DicedMesh> {
    let mut rng = Rng(3);
    let mut meshes = Vec::new();
    for key_count in [1, 2, 1, 5, 1, 2] {
        let rate = |rng: &mut Rng| 1 + rng.below(16) as u16;
        let rates: Vec<_> = (0..60).map(|_| (rate(&mut rng), rate(&mut rng))).collect();
        let who: Vec<_> = (0..60).map(|_| (rng.cube(), rng.direction())).collect();
        meshes.push(mesh(&rates, &keys(key_count), |g, u, v, t| {
            let (at, axis) = who[g];
            let turn = glam::Quat::from_axis_angle(axis, 2.0 * t + g as f32);
            at + turn * Vec3::new(u * 0.4, v * 0.1, 0.1 * u * u)
        }));
    }
    meshes
}

pub fn several_objects(tracer: &Tracer) -> Result<(), Failed> {
    let meshes = mixed();
    let objects: Vec<_> = meshes.iter().cloned().map(object).collect();
    let at = |i: usize| DVec3::splat(0.1) * i as f64;
    let place = |i| InstanceTransform::Translation(at(i));
    let instances = (0..12).map(|i| instance(&objects[i % 6], place(i)));
    let world = World::build(instances.collect(), DVec3::ZERO);
    let scene = built(tracer, &world, false)?;
    let [_, blocks, loose] = contained(tracer, &scene, &meshes.iter().collect::<Vec<_>>())?;
    if blocks == 0 || loose == 0 {
        return Err("not of all kinds".into());
    }
    agree(tracer, &world, &scene, 200)
}

/// Objects of so many items that their keys take more than 32 bits.
pub fn many_items(tracer: &Tracer) -> Result<(), Failed> {
    let mut rng = Rng(91);
    let meshes = [20_000, 30_000, 10].map(|count| {
        let who: Vec<_> = (0..count).map(|_| rng.cube()).collect();
        single_cells(count, |g, u, v, _| who[g] + Vec3::new(u, v, u * v) * 0.01)
    });
    let at = |i| InstanceTransform::Translation(DVec3::splat(i));
    let objects = meshes.iter().cloned().map(object).zip([0.0, 0.3, 0.6]);
    let instances = objects.map(|(object, i)| instance(&object, at(i)));
    let world = World::build(instances.collect(), DVec3::ZERO);
    let scene = built(tracer, &world, false)?;
    contained(tracer, &scene, &meshes.iter().collect::<Vec<_>>())?;
    as_with_host_trees(tracer, &world, &scene, 500, 50)
}
