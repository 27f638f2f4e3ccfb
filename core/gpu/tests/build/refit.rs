//! Trees whose vertices have moved.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::{InstanceTransform, World};
use hdtrapeze_gpu::{BuildOptions, Device, GpuError, GpuScene, Tracer, TreeBuilder};
use libtest_mimic::Failed;
use wgpu::BufferUsages;

use crate::support::*;
use crate::trace_scenes::{self, *};
use crate::walk::{contained, over_instances};
use crate::{as_with_host_trees, builder, built};

/// Trees whose vertices have moved contain them, as trees that are built anew would.
pub fn refitted(tracer: &Tracer) -> Result<(), Failed> {
    let moved = |mesh: &DicedMesh| {
        let mut mesh = mesh.clone();
        for p in &mut mesh.positions {
            *p += Vec3::new(0.3, 0.1 * (3.0 * p.x).sin(), 0.1 * (4.0 * p.y).cos());
        }
        mesh
    };
    for before in [
        patches(40, 7, &[0.0], 3),
        patches(40, 7, &keys(3), 3),
        fur(150, &keys(2), 4),
        sheet(1, 8, &keys(2)),
    ] {
        let after = moved(&before);
        let (world, moved) = (world_of(before), world_of(after.clone()));
        let mut scene = built(tracer, &world, true)?;
        if !scene.refit(builder(tracer), &moved)? {
            return Err("not refitted".into());
        }
        contained(tracer, &scene, &[&after])?;
        agree(tracer, &moved, &scene, 5)?;
        // And back again.
        if !scene.refit(builder(tracer), &world)? {
            return Err("not refitted again".into());
        }
        agree(tracer, &world, &scene, 5)?;
    }
    Ok(())
}

/// So are those of scenes on several pages; where that cannot be, all pages stay as they were.
pub fn refitted_on_pages(tracer: &Tracer) -> Result<(), Failed> {
    let moved = |mesh: &DicedMesh| {
        let mut mesh = mesh.clone();
        for p in &mut mesh.positions {
            *p += Vec3::new(0.3, 0.1 * (3.0 * p.x).sin(), 0.1 * (4.0 * p.y).cos());
        }
        mesh
    };
    for (before, most) in [
        (patches(300, 7, &[0.0], 6), 40_000),
        (sheet(8, 9, &keys(2)), 20_000),
    ] {
        let mut lost = moved(&before);
        let p = lost.grids[farthest(&before)].first_vertex as usize * lost.key_count();
        lost.positions[p].z = f32::NAN;
        let worlds = [before.clone(), moved(&before), before, lost].map(world_of);
        let options = BuildOptions {
            refits: true,
            most,
            ..BuildOptions::default()
        };
        let mut scene = GpuScene::build(builder(tracer), &worlds[0], &options)?;
        if scene.page_count() < 5 {
            return Err(format!("{} pages", scene.page_count()).into());
        }
        for world in &worlds[1..3] {
            if !scene.refit(builder(tracer), world)? {
                return Err("not refitted".into());
            }
            as_with_host_trees(tracer, world, &scene, RAYS, 50)?;
        }
        let one_more = World::build(
            [0.0, 0.1]
                .map(|x| {
                    let at = InstanceTransform::Translation(DVec3::X * x);
                    instance(&object(sheet(8, 9, &keys(2))), at)
                })
                .into(),
            DVec3::ZERO,
        );
        for world in [&worlds[3], &one_more] {
            if scene.refit(builder(tracer), world)? {
                return Err("refitted to another scene".into());
            }
            as_with_host_trees(tracer, &worlds[0], &scene, RAYS, 50)?;
        }
        if !scene.refit(builder(tracer), &worlds[1])? {
            return Err("not refitted after that".into());
        }
        as_with_host_trees(tracer, &worlds[1], &scene, RAYS, 50)?;
    }
    Ok(())
}

/// The grid that is last along the longest side of all: objects are cut across that first, and what is near comes first.
fn farthest(mesh: &DicedMesh) -> usize {
    let object = object(mesh.clone());
    let mesh = object.mesh();
    let centre = |g: usize| {
        let grid = &mesh.grids[g];
        let (across, last) = (usize::from(grid.nu), grid.vertex_count() - 1);
        let corners = [0, across, last - across, last];
        let keys = [0, mesh.key_count() - 1];
        let points = keys.map(|k| corners.map(|i| mesh.position(g, k, i)));
        points.iter().flatten().sum::<Vec3>()
    };
    let centres: Vec<Vec3> = (0..mesh.grids.len()).map(centre).collect();
    let lo = centres.iter().fold(Vec3::INFINITY, |a, &b| a.min(b));
    let hi = centres.iter().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b));
    let axis = (hi - lo).max_position();
    let far = |&a: &usize, &b: &usize| centres[a][axis].total_cmp(&centres[b][axis]);
    (0..centres.len()).max_by(far).unwrap_or(0)
}

/// Instances that move, appear or go are no reason to make objects' trees anew.
pub fn refitted_instances(tracer: &Tracer) -> Result<(), Failed> {
    let meshes = [sheet(2, 7, &[0.0]), patches(12, 5, &keys(3), 9)];
    let objects = meshes.map(object);
    let crowd = |count: usize, seed: u64| {
        let mut rng = Rng(seed);
        let at = |i: usize| {
            let at = rng.cube().as_dvec3();
            instance(
                &objects[i % 2],
                spinning(2 + i % 2, 0.5, DVec3::splat(0.4), at),
            )
        };
        World::build_later((0..count).map(at).collect(), DVec3::ZERO)
    };
    let mut scene = built(tracer, &crowd(12, 1), true)?;
    for (count, seed) in [(12, 2), (20, 3), (2, 4)] {
        let world = crowd(count, seed);
        if !scene.refit(builder(tracer), &world)? {
            return Err(format!("not refitted to {count}").into());
        }
        over_instances(tracer, &world, &scene)?;
        agree(tracer, &world, &scene, 20)?;
    }
    Ok(())
}

/// What no longer fits on its page is refused in words; the scene is as it was, and can be refitted to what fits.
pub fn refused(tracer: &Tracer) -> Result<(), Failed> {
    let sheet = object(sheet(2, 7, &[0.0]));
    let crowd = |count: usize, seed: u64| {
        let mut rng = Rng(seed);
        let mut at = || {
            let at = rng.cube().as_dvec3();
            instance(&sheet, spinning(3, 0.5, DVec3::splat(0.4), at))
        };
        World::build_later((0..count).map(|_| at()).collect(), DVec3::ZERO)
    };
    let few = crowd(12, 1);
    let options = BuildOptions {
        refits: true,
        most: 12_000,
        ..BuildOptions::default()
    };
    let mut scene = GpuScene::build(builder(tracer), &few, &options)?;
    if scene.page_count() != 1 {
        return Err(format!("{} pages", scene.page_count()).into());
    }
    // Matrices are what is uploaded last: trees are refitted by then.
    match scene.refit(builder(tracer), &crowd(150, 2)) {
        Err(error @ GpuError::TooLarge { .. }) if error.to_string().contains("matrices need") => {}
        other => return Err(format!("{other:?}").into()),
    }
    over_instances(tracer, &few, &scene)?;
    agree(tracer, &few, &scene, 20)?;
    let others = crowd(14, 3);
    if !scene.refit(builder(tracer), &others)? {
        return Err("not refitted after that".into());
    }
    over_instances(tracer, &others, &scene)?;
    agree(tracer, &others, &scene, 20)
}

/// A device that has failed says so, whenever it is asked.
pub fn failed(_: &Tracer) -> Result<(), Failed> {
    let device = Arc::new(Device::open()?);
    let builder = TreeBuilder::new(Arc::clone(&device));
    let world = world_of(sheet(3, 9, &keys(2)));
    let options = BuildOptions {
        refits: true,
        ..BuildOptions::default()
    };
    let mut scene = GpuScene::build(&builder, &world, &options)?;
    if !scene.refit(&builder, &world)? {
        return Err("not refitted".into());
    }
    // No device has buffers for both.
    let both = BufferUsages::MAP_READ | BufferUsages::STORAGE;
    let _ = device.buffer("nothing", 64, both);
    for _ in 0..2 {
        match scene.refit(&builder, &world) {
            Err(error @ GpuError::Failed { .. }) => {
                let told = error.to_string();
                let begin = format!("{} failed: ", device.found().name);
                if !told.starts_with(&begin) || told.lines().count() != 1 {
                    return Err(told.into());
                }
            }
            other => return Err(format!("{other:?}").into()),
        }
    }
    match GpuScene::build(&builder, &world, &options) {
        Err(GpuError::Failed { .. }) => Ok(()),
        other => Err(format!("{other:?}").into()),
    }
}

/// Where all go elsewhere, trees over what was near are of no use: scenes are to be built anew.
pub fn too_bad_to_refit(tracer: &Tracer) -> Result<(), Failed> {
    for (before, after) in [
        (patches(80, 7, &[0.0], 3), patches(80, 7, &[0.0], 4)),
        (patches(80, 7, &keys(3), 3), patches(80, 7, &keys(3), 4)),
        (fur(300, &keys(2), 4), fur(300, &keys(2), 5)),
    ] {
        let (world, moved) = (world_of(before.clone()), world_of(after));
        let mut scene = built(tracer, &world, true)?;
        if scene.refit(builder(tracer), &moved)? {
            return Err("refitted".into());
        }
        contained(tracer, &scene, &[&before])?;
        agree(tracer, &world, &scene, 5)?;
    }
    Ok(())
}

/// Where grids differ, or others than before cannot be traced, scenes are to be built anew, and are as they were.
pub fn not_refitted(tracer: &Tracer) -> Result<(), Failed> {
    let mesh = sheet(3, 9, &keys(2));
    let world = world_of(mesh.clone());
    let mut lost = mesh.clone();
    lost.positions[1000].z = f32::NAN;
    let others = [
        sheet(3, 8, &keys(2)),
        sheet(2, 9, &keys(2)),
        sheet(3, 9, &keys(3)),
        sheet(3, 9, &[0.0]),
        lost,
    ];
    let mut scene = built(tracer, &world, true)?;
    for other in others {
        if scene.refit(builder(tracer), &world_of(other))? {
            return Err("refitted to another mesh".into());
        }
        contained(tracer, &scene, &[&mesh])?;
    }
    agree(tracer, &world, &scene, 300)?;
    // One item each, a loose group or a block: those of what moves lie behind it.
    let floor = |rate: (u16, u16)| {
        let floor = trace_scenes::mesh(&[rate], &[0.0], |_, u, v, _| Vec3::new(u, v, 0.0));
        let still = instance(&object(floor), InstanceTransform::Translation(DVec3::ZERO));
        let moving = instance(
            &object(patches(6, 16, &keys(2), 3)),
            InstanceTransform::Translation(DVec3::ONE),
        );
        World::build(vec![still, moving], DVec3::ZERO)
    };
    for (before, after) in [((4, 2), (8, 8)), ((8, 8), (4, 2))] {
        let world = floor(before);
        let mut scene = built(tracer, &world, true)?;
        if scene.refit(builder(tracer), &floor(after))? {
            return Err("refitted to blocks in other places".into());
        }
        agree(tracer, &world, &scene, 100)?;
    }
    let mut scene = built(tracer, &world, false)?;
    match scene.refit(builder(tracer), &world)? {
        true => Err("refitted from nothing".into()),
        false => Ok(()),
    }
}
