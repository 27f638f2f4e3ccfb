//! Primvars against the CPU's; as `frame.rs` has it for the rest.

#[path = "../../tests/support/mod.rs"]
mod support;

mod device;
mod images;

use std::sync::Arc;

use glam::DVec3;
use hdtrapeze_core::scene::{
    Interpolation, PrimId, PrimvarDesc, PrimvarSample, PrimvarValues, Scene,
};
use images::*;

/// What is seen first is not opaque, nor is what is behind it; before all is something that is not there at all.
fn veils() -> Scene {
    let mut scene = everything();
    for (number, opacity) in [(1, 0.5), (2, 0.4), (3, 0.6)] {
        let prim = scene.prims.get_mut(&PrimId(number)).expect("three prims");
        let prim = Arc::make_mut(prim);
        *prim = veiled(prim.clone(), flat(opacity));
    }
    let nothing = ball("/nothing", 1.2, &[DVec3::new(0.8, 0.0, 2.0)]);
    let nothing = veiled(nothing, flat(0.0));
    scene.prims.insert(PrimId(4), Arc::new(nothing));
    scene
}

/// Primvars of every kind, as AOVs: those of many widths, that change or stay, that some prims lack, and whole numbers.
fn with_primvars(mut scene: Scene) -> Scene {
    let spread = |interpolation, width: usize, count: usize| {
        let values = (0..width * count).map(|i| (i * 7 % 23) as f32 / 9.0 - 0.7);
        PrimvarDesc::still(interpolation, width, values.collect(), vec![])
    };
    let faded = |interpolation, width: usize, count: usize| {
        let sample = |time: f64| PrimvarSample {
            time,
            values: Arc::new(PrimvarValues::Float(
                (0..width * count)
                    .map(|i| (i as f64 * time * 1.7).sin() as f32)
                    .collect(),
            )),
            indices: Arc::default(),
        };
        PrimvarDesc {
            samples: [0.0, 0.3, 1.0].map(sample).to_vec(),
            ..PrimvarDesc::still(interpolation, width, vec![], vec![])
        }
    };
    let whole = PrimvarDesc {
        samples: vec![PrimvarSample {
            time: 0.0,
            values: Arc::new(PrimvarValues::Int(
                (0..30).map(|i| i * i - 70_000).collect(),
            )),
            indices: Arc::default(),
        }],
        ..PrimvarDesc::still(Interpolation::Uniform, 1, vec![], vec![])
    };
    let of_sheet = [
        ("constant", spread(Interpolation::Constant, 4, 1)),
        ("faces", spread(Interpolation::Uniform, 1, 30)),
        ("vertices", spread(Interpolation::Vertex, 2, 42)),
        ("corners", spread(Interpolation::FaceVarying, 3, 120)),
        ("fading", faded(Interpolation::Constant, 3, 1)),
        ("fading_faces", faded(Interpolation::Uniform, 2, 30)),
        ("fading_vertices", faded(Interpolation::Vertex, 4, 42)),
        ("whole", whole),
    ];
    set(&mut scene, |settings| {
        let names = of_sheet.iter().map(|(name, _)| format!("primvars:{name}"));
        settings.aovs.extend(names);
        settings.aovs.push("primvars:displayColor".to_owned());
    });
    for prim in scene.prims.values_mut() {
        let common = &mut Arc::make_mut(prim).common;
        if common.path.contains("sheet") {
            let own = of_sheet
                .iter()
                .map(|(name, desc)| ((*name).to_owned(), desc.clone()));
            common.primvars.extend(own);
        } else {
            let constant = spread(Interpolation::Constant, 4, 1);
            common.primvars.insert("constant".to_owned(), constant);
        }
    }
    scene
}

fn main() {
    let scenes = vec![
        ("primvars", with_primvars(stage())),
        ("primvars_of_everything", with_primvars(everything())),
        ("primvars_of_instances", with_primvars(instanced(true))),
        ("primvars_of_veils", with_primvars(veils())),
    ];
    // Veils on pages are in `layers.rs`: with primvars they took Mesa's software driver 10 GB and a minute and a half.
    device::run(agreeing(scenes, &["primvars_of_everything"]));
}
