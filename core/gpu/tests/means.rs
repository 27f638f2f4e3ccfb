//! Normals, and where things go in the image, against the CPU's; as `frame.rs` has it for the rest.

#[path = "../../tests/support/mod.rs"]
mod support;

mod device;
mod images;

use std::sync::Arc;

use glam::{DMat4, DVec3, Quat, Vec3};
use hdtrapeze_core::aov::Aov;
use hdtrapeze_core::render::{RayTracer, Stage};
use hdtrapeze_core::scene::{Backend, Interpolation, PrimDesc, PrimId, Projection, Samples, Scene};
use hdtrapeze_gpu::{Device, GpuFrame, Stages};
use images::*;
use libtest_mimic::Failed;

/// A prim whose places are carried on.
fn carried(mut prim: PrimDesc, by: DMat4) -> PrimDesc {
    for samples in &mut prim.common.transform {
        for matrix in &mut samples.matrices {
            *matrix = by * *matrix;
        }
    }
    prim
}

/// Sheets that show one side or the other, of one side or of two; some are mirrored, and some turn while the shutter is open.
fn sides() -> Scene {
    let mut prims = Vec::new();
    for i in 0..8 {
        let mut prim = sheet(&format!("/sheet{i}"), &[0.0], Interpolation::Uniform);
        let place = DVec3::new(
            f64::from(i % 4) * 1.7 - 2.2,
            f64::from(i / 4) * 2.2 - 1.0,
            0.0,
        );
        let turn = 0.4 + 2.7 * f64::from(i % 2);
        let mirror = DVec3::new(if i & 2 != 0 { -0.25 } else { 0.25 }, 0.3, 0.25);
        let placed = |turn: f64| {
            DMat4::from_translation(place)
                * DMat4::from_rotation_y(turn)
                * DMat4::from_scale(mirror)
        };
        prim.common.double_sided = i >= 4;
        prim.common.transform = match i % 3 {
            0 => at(&[placed(turn), placed(turn + 0.3)]),
            _ => at(&[placed(turn)]),
        };
        prims.push(prim);
    }
    scene(prims)
}

/// Instances of sheets, which store no normals, half of them mirrored; they move, or stand still; they have one side, or two.
fn mirrored_instances(moving: bool, double_sided: bool) -> Scene {
    let mut scene = instanced(moving);
    let mut prototype = carried(
        sheet("/many/sheet", &[0.0, 0.4], Interpolation::Uniform),
        DMat4::from_scale(DVec3::splat(0.2)) * DMat4::from_translation(DVec3::Z * 3.0),
    );
    prototype.common.instancer = Some((INSTANCER, 0));
    prototype.common.pick_id = 7;
    prototype.common.double_sided = double_sided;
    scene.prims.insert(PrimId(20), Arc::new(prototype));
    let instancer = scene.instancers.get_mut(&INSTANCER).expect("an instancer");
    let arrays = Arc::make_mut(&mut Arc::make_mut(instancer).arrays);
    let size = |i: usize| Vec3::new(if i.is_multiple_of(2) { 1.0 } else { -1.0 }, 0.9, 0.8);
    let sizes = (0..arrays.instance_count).map(size).collect();
    arrays.scales = Samples {
        times: vec![0.0],
        values: vec![Arc::new(sizes)],
    };
    if moving {
        let turns = |by: f32| {
            let turn = |i: usize| Quat::from_rotation_x(i as f32 + by);
            Arc::new((0..arrays.instance_count).map(turn).collect())
        };
        arrays.orientations = Samples {
            times: vec![0.0, 1.0],
            values: vec![turns(0.0), turns(0.4)],
        };
    }
    scene
}

/// The camera goes on and turns.
fn moving_camera(projection: Projection) -> Scene {
    let mut scene = stage();
    shoot(&mut scene, |camera| {
        let to = DMat4::from_translation(DVec3::new(0.9, 0.1, 5.5)) * DMat4::from_rotation_z(0.3);
        camera.transform = at(&[DMat4::from_translation(DVec3::Z * 6.0), to]);
        camera.projection = projection;
        if projection == Projection::Orthographic {
            (camera.horizontal_aperture, camera.vertical_aperture) = (7.0, 4.4);
        }
    });
    scene
}

/// A side that is the front or the back by the time is left to the CPU where normals are asked for, and said.
fn normals_that_turn_over_are_not_taken(stages: &Arc<Stages>) -> Result<(), Failed> {
    let mut prim = sheet("/sheet", &[0.0], Interpolation::Uniform);
    let near = DMat4::from_translation(DVec3::NEG_Z);
    prim.common.transform = at(&[near, near * DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0))]);
    let plain = scene(vec![prim]);
    for (scene, last) in [
        (plain.clone(), Stage::Film),
        (with_means(plain), Stage::Trace),
    ] {
        let frame = GpuFrame::new(Arc::clone(stages), &prepared_on(&scene, Backend::Gpu))?;
        let told = frame.explain();
        if *frame.stages().end() != last || told.contains("turn over") != (last == Stage::Trace) {
            return Err(told.into());
        }
    }
    Ok(())
}

/// Each AOV alone is as it is among the others, bit for bit.
fn one_alone_is_as_among_others(stages: &Arc<Stages>) -> Result<(), Failed> {
    let frame_of = |aovs: &[Aov]| {
        let mut scene = everything();
        set(&mut scene, |settings| {
            settings.aovs = aovs.iter().map(|aov| aov.name().to_owned()).collect();
        });
        let prepared = prepared_on(&scene, Backend::Gpu);
        let frame = GpuFrame::new(Arc::clone(stages), &prepared)?;
        rendered(&prepared, Some(&frame))
    };
    let all = frame_of(&MEANS)?;
    for aov in MEANS {
        let alone = frame_of(std::slice::from_ref(&aov))?;
        if !different(&alone, &all, &aov, 0.0)?.is_empty() {
            return Err(format!("{} differs", aov.name()).into());
        }
    }
    Ok(())
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let moving = sheet("/sheet", &[0.0, 0.8], Interpolation::Vertex);
    let mut leaning = sheet("/sheet", &[0.0, 0.8], Interpolation::Vertex);
    let normals = leaning_normals(42);
    let primvars = &mut leaning.common.primvars;
    primvars.insert("normals".to_owned(), normals);
    let mut colorless = everything();
    set(&mut colorless, |s| s.aovs.retain(|aov| aov != "color"));
    vec![
        ("still", stage()),
        ("colorless", colorless),
        ("moving_mesh", scene(vec![moving])),
        ("moving_normals", scene(vec![leaning])),
        ("instances", instanced(false)),
        ("moving_instances", instanced(true)),
        ("sides", sides()),
        ("mirrored_instances", mirrored_instances(false, false)),
        ("moving_mirrored_instances", mirrored_instances(true, false)),
        ("two_sided_instances", mirrored_instances(true, true)),
        ("moving_camera", moving_camera(Projection::Perspective)),
        ("rays_side_by_side", moving_camera(Projection::Orthographic)),
        ("changing_lens", changing_lens()),
    ]
}

fn main() {
    let mut trials = agreeing(scenes(), &["moving_mirrored_instances"]);
    let alone = |device: &Arc<Device>| one_alone_is_as_among_others(&stages_once(device));
    trials.push(("one_alone".to_owned(), Box::new(alone)));
    let turning = |device: &Arc<Device>| normals_that_turn_over_are_not_taken(&stages_once(device));
    trials.push(("what_turns_over".to_owned(), Box::new(turning)));
    device::run(trials);
}
