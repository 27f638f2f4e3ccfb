//! Images of what is not opaque, and of sides that rays pass through, against the CPU's; as `frame.rs` has it for the rest.

#[path = "../../tests/support/mod.rs"]
mod support;

mod device;
mod images;

use std::sync::{Arc, OnceLock};

use device::Check;
use glam::{DMat4, DVec3};
use hdtrapeze_core::aov::{Aov, AovData};
use hdtrapeze_core::scene::{
    Backend, Cull, Interpolation, PrimDesc, PrimId, PrimvarDesc, PrimvarSample, PrimvarValues,
    Scene,
};
use hdtrapeze_gpu::{Device, FirstOnDevice, GpuFrame, Stages};
use images::*;
use libtest_mimic::Failed;

/// Opacities from nothing to all, and beyond.
fn spread(interpolation: Interpolation, count: usize) -> PrimvarDesc {
    let values = (0..count).map(|i| (i * 5 % 13) as f32 / 10.0 - 0.1);
    PrimvarDesc::still(interpolation, 1, values.collect(), vec![])
}

/// An opacity that comes and goes while the shutter is open.
fn fading() -> PrimvarDesc {
    let sample = |(time, value): (f64, f32)| PrimvarSample {
        time,
        values: Arc::new(PrimvarValues::Float(vec![value])),
        indices: Arc::default(),
    };
    let samples = [(0.0, 0.0), (0.3, 0.9), (1.0, 0.2)];
    PrimvarDesc {
        samples: samples.into_iter().map(sample).collect(),
        ..PrimvarDesc::still(Interpolation::Constant, 1, vec![], vec![])
    }
}

fn moved(mut prim: PrimDesc, by: DVec3) -> PrimDesc {
    for samples in &mut prim.common.transform {
        for matrix in &mut samples.matrices {
            *matrix = DMat4::from_translation(by) * *matrix;
        }
    }
    prim
}

/// Sheets one behind the other, and a ball behind them all.
fn stack(count: usize, opacity: f32, apart: f64) -> Scene {
    let mut prims = vec![ball("/back", 2.0, &[DVec3::new(0.5, 0.0, -6.0)])];
    for i in 0..count {
        let color = [Interpolation::Constant, Interpolation::Uniform][i % 2];
        let sheet = sheet(&format!("/sheet{i:03}"), &[0.3 * (i % 3) as f32], color);
        let at = DVec3::new(0.1, 0.2, apart * i as f64);
        prims.push(veiled(moved(sheet, at), flat(opacity)));
    }
    scene(prims)
}

/// The same sheet many times over in one place, in many colours; those in front of others in the order of hits are not
/// opaque.
fn coincident() -> Scene {
    let colors = [
        Interpolation::Constant,
        Interpolation::Uniform,
        Interpolation::Vertex,
        Interpolation::FaceVarying,
    ];
    let sheets = (0..).zip(colors).map(|(i, color)| {
        let sheet = sheet(&format!("/sheet{i}"), &[0.0], color);
        veiled(sheet, flat(0.2 + 0.1 * i as f32))
    });
    scene(sheets.collect())
}

/// Instances with an opacity each, some in one place.
fn instances(moving: bool) -> Scene {
    let mut scene = instanced(moving);
    let count = 12;
    let instancer = scene.instancers.get_mut(&INSTANCER).expect("an instancer");
    let instancer = Arc::make_mut(instancer);
    let opacity = spread(Interpolation::Varying, count);
    instancer
        .primvars
        .insert("displayOpacity".to_owned(), opacity);
    let arrays = Arc::make_mut(&mut instancer.arrays);
    for places in &mut arrays.positions.values {
        let places = Arc::make_mut(places);
        for (i, j) in [(1, 0), (3, 2)] {
            places[i] = places[j];
        }
    }
    for turns in &mut arrays.orientations.values {
        Arc::make_mut(turns).swap(1, 4);
    }
    scene
}

/// Everything moves, out of focus; what is matte is not opaque either.
fn all_at_once() -> Scene {
    let mut scene = everything();
    let opacities = [
        (1, spread(Interpolation::FaceVarying, 120)),
        (2, fading()),
        (3, flat(0.6)),
    ];
    for (number, opacity) in opacities {
        let prim = scene.prims.get_mut(&PrimId(number)).expect("three prims");
        let prim = Arc::make_mut(prim);
        *prim = veiled(prim.clone(), opacity);
    }
    scene
}

/// Surfaces that show their backs and their fronts, mirrored ones among them.
fn sides(cull: Cull) -> Scene {
    let mirrored = |mut prim: PrimDesc| {
        let transform = &mut prim.common.transform[0];
        let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        transform.matrices = transform.matrices.iter().map(|m| mirror * *m).collect();
        prim
    };
    let turned = |mut prim: PrimDesc, by: f64| {
        let transform = &mut prim.common.transform[0];
        let turn = DMat4::from_translation(DVec3::new(0.0, 1.0, 0.6))
            * DMat4::from_rotation_y(by)
            * DMat4::from_scale(DVec3::splat(0.4));
        transform.matrices = transform.matrices.iter().map(|m| turn * *m).collect();
        prim
    };
    let mut double = ball("/double", 0.7, &[DVec3::new(1.5, 0.8, 1.0)]);
    double.common.double_sided = true;
    let mut scene = instanced(true);
    let prims = [
        ball("/ball", 1.0, &[DVec3::new(-1.4, 0.1, 0.4), DVec3::X]),
        mirrored(ball("/mirrored", 0.8, &[DVec3::new(-1.2, -1.0, 1.0)])),
        turned(sheet("/shown", &[0.0], Interpolation::Uniform), 0.4),
        turned(sheet("/turned", &[0.0, 0.4], Interpolation::Vertex), 3.4),
        double,
    ];
    for (i, mut prim) in (30..).zip(prims) {
        prim.common.pick_id = i;
        scene.prims.insert(PrimId(i as u64), Arc::new(prim));
    }
    set(&mut scene, |settings| settings.cull = cull);
    scene
}

/// Some of these are not opaque either.
fn veiled_sides() -> Scene {
    let mut scene = sides(Cull::BackUnlessDoubleSided);
    for number in [30, 32, 33] {
        let prim = scene.prims.get_mut(&PrimId(number)).expect("it is there");
        let prim = Arc::make_mut(prim);
        *prim = veiled(prim.clone(), flat(0.5));
    }
    scene
}

/// No more layers are taken in than on the CPU; they are too faint to end rays.
fn layers_are_limited(stages: &Arc<Stages>) -> Result<(), Failed> {
    let mut scene = stack(70, 0.01, 0.03);
    set(&mut scene, |settings| {
        settings.resolution = [16, 10];
        settings.samples = 4;
    });
    agrees(stages, &scene, FirstOnDevice::Bound)?;
    let prepared = prepared_on(&scene, Backend::Gpu);
    let frame = GpuFrame::new(Arc::clone(stages), &prepared)?;
    let there = rendered(&prepared, Some(&frame))?;
    let Some(AovData::F32(color)) = there.aov(Aov::Color).map(|image| image.data) else {
        return Err("there is no colour".into());
    };
    let alpha = color[4 * (5 * 16 + 8) + 3];
    let expected = 1.0 - 0.99f32.powi(64);
    match (alpha - expected).abs() < 1.0e-4 {
        true => Ok(()),
        false => Err(format!("{alpha}, not {expected}").into()),
    }
}

/// A side that is the one or the other by the time is left to the CPU, and said.
fn what_turns_over_is_not_taken(stages: &Arc<Stages>) -> Result<(), Failed> {
    let mut prim = sheet("/sheet", &[0.0], Interpolation::Uniform);
    let near = DMat4::from_translation(DVec3::NEG_Z);
    prim.common.transform = at(&[near, near * DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0))]);
    let mut scene = scene(vec![prim]);
    set(&mut scene, |settings| settings.cull = Cull::Back);
    let prepared = prepared_on(&scene, Backend::Gpu);
    match GpuFrame::new(Arc::clone(stages), &prepared) {
        Err(error) if error.to_string().contains("turn over") => Ok(()),
        other => Err(format!("{other:?}").into()),
    }
}

/// Where the CPU shades what the device traced, sides are passed through as well.
fn the_cpu_shades(stages: &Arc<Stages>) -> Result<(), Failed> {
    for scene in [sides(Cull::Back), veiled_sides(), coincident()] {
        let scene = with_mixed(scene);
        let prepared = prepared_on(&scene, Backend::Gpu);
        let frame = GpuFrame::new(Arc::clone(stages), &prepared)?;
        if !frame.explain().contains(MIXED) {
            return Err(frame.explain().into());
        }
        let there = rendered(&prepared, Some(&frame))?;
        let here = rendered(&prepared_on(&scene, Backend::Cpu), None)?;
        for aov in [Aov::Color, Aov::PrimId] {
            let bad = different(&there, &here, &aov, CLOSE)?;
            if bad.len() > 12 {
                return Err(format!("{} pixels of {} differ", bad.len(), aov.name()).into());
            }
        }
    }
    Ok(())
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let glass = |opacity: PrimvarDesc| {
        let mut scene = stage();
        let prim = scene.prims.get_mut(&PrimId(2)).expect("a ball");
        let prim = Arc::make_mut(prim);
        *prim = veiled(prim.clone(), opacity);
        scene
    };
    let sheet_of = |growths: &[f32], opacity: PrimvarDesc| {
        let front = sheet("/sheet", growths, Interpolation::Uniform);
        let behind = ball("/ball", 2.0, &[DVec3::new(0.3, 0.2, -5.5)]);
        scene(vec![veiled(front, opacity), behind])
    };
    let mut matte = glass(flat(0.4));
    let prim = matte.prims.get_mut(&PrimId(2)).expect("a ball");
    Arc::make_mut(prim).common.matte = true;
    let mut colorless = stack(4, 0.3, 0.2);
    set(&mut colorless, |s| s.aovs.retain(|aov| aov != "color"));
    vec![
        ("constant", glass(flat(0.4))),
        ("nothing", glass(flat(0.0))),
        ("fading", glass(fading())),
        (
            "vertices",
            sheet_of(&[0.0], spread(Interpolation::Vertex, 42)),
        ),
        (
            "moving_vertices",
            sheet_of(&[0.0, 0.7], spread(Interpolation::Vertex, 42)),
        ),
        (
            "faces",
            sheet_of(&[0.0], spread(Interpolation::Uniform, 30)),
        ),
        (
            "corners",
            sheet_of(&[0.0, 0.5], spread(Interpolation::FaceVarying, 120)),
        ),
        ("matte", matte),
        ("colorless", colorless),
        ("stack", stack(10, 0.2, 0.25)),
        ("dense_stack", stack(12, 0.6, 0.1)),
        ("coincident", coincident()),
        ("instances", instances(false)),
        ("moving_instances", instances(true)),
        ("all_at_once", all_at_once()),
        ("backs", sides(Cull::Back)),
        ("fronts", sides(Cull::Front)),
        ("single_sided_backs", sides(Cull::BackUnlessDoubleSided)),
        ("veiled_sides", veiled_sides()),
    ]
}

fn main() {
    let mut trials: Vec<(String, Check)> = Vec::new();
    // Pipelines are compiled once.
    static STAGES: OnceLock<Arc<Stages>> = OnceLock::new();
    let on =
        |device: &Arc<Device>| Arc::clone(STAGES.get_or_init(|| Arc::new(Stages::new(device))));
    for (name, scene) in scenes() {
        let firsts: &[FirstOnDevice] = match name {
            "instances" => &FirstOnDevice::ALL,
            "corners" | "stack" | "coincident" | "all_at_once" | "veiled_sides" => {
                &[FirstOnDevice::Bound, FirstOnDevice::Generate]
            }
            _ => &[],
        };
        if !firsts.is_empty() {
            let paged = scene.clone();
            let run = move |device: &Arc<Device>| on_pages(&on(device), &paged, firsts);
            trials.push((format!("pages_of_{name}"), Box::new(run)));
        }
        let walk = ["stack", "all_at_once", "veiled_sides"].contains(&name);
        let run = move |device: &Arc<Device>| match walk {
            true => walked(&on(device), &scene),
            false => agrees(&on(device), &scene, FirstOnDevice::Bound),
        };
        trials.push((format!("scene_{name}"), Box::new(run)));
    }
    let limited = move |device: &Arc<Device>| layers_are_limited(&on(device));
    trials.push(("layers_are_limited".to_owned(), Box::new(limited)));
    let turning = move |device: &Arc<Device>| what_turns_over_is_not_taken(&on(device));
    trials.push(("what_turns_over".to_owned(), Box::new(turning)));
    let shaded = move |device: &Arc<Device>| the_cpu_shades(&on(device));
    trials.push(("the_cpu_shades".to_owned(), Box::new(shaded)));
    device::run(trials);
}
