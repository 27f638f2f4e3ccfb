//! Scenes in pairs, one with an effect authored where it can change nothing, for counting instructions:
//! `scripts/absent_effects.py` runs each case under callgrind, which counts inside of [`measured`] alone.
//!
//! Run: `cargo run --release -p hdtrapeze-core --example absent_effects CASE [LEVEL]`; it prints hits and tests.

#[path = "../tests/support/mod.rs"]
mod support;
#[path = "../tests/trace_scenes/mod.rs"]
mod trace_scenes;

use std::hint::black_box;
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DMat4, DVec3, Vec3};
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::render::{Frame, RenderControl, prepare, render};
use hdtrapeze_core::scene::{
    CameraDesc, Cull, Geometry, GridsDesc, PrimCommon, PrimDesc, PrimId, RenderSettings, Scene,
    TransformSamples,
};
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World};
use hdtrapeze_simd::Level;
use support::NoSubdivision;
use trace_scenes::{Rng, affine, instance, keys, object, patches, ray, sheet};

/// The part that is counted.
#[inline(never)]
fn measured<R>(f: impl FnOnce() -> R) -> R {
    black_box(f())
}

/// Seven sheets one above the other, and perhaps something beside them that no ray meets.
fn world(beside: Option<(DicedMesh, InstanceTransform)>) -> World {
    let still = object(sheet(3, 16, &keys(1)));
    let at = |i: u32| InstanceTransform::Translation(DVec3::new(0.02, 0.03, -0.4) * f64::from(i));
    let mut list: Vec<_> = (0..7).map(|i| instance(&still, at(i))).collect();
    list.extend(beside.map(|(mesh, place)| instance(&object(mesh), place)));
    World::build(list, DVec3::ZERO)
}

fn beside() -> DVec3 {
    DVec3::new(0.0, 2.4, 0.0)
}

/// A thing beside: `k` keys of vertices, or of its matrix.
fn thing(k: usize, matrix_keys: usize) -> (DicedMesh, InstanceTransform) {
    let mut mesh = patches(1, 16, &keys(k), 5);
    let size = mesh
        .positions
        .iter()
        .fold(0.0f32, |m, p| m.max(p.abs().max_element()));
    mesh.positions.iter_mut().for_each(|p| *p *= 0.3 / size);
    let at = |t: f64| affine(DVec3::Z, 0.2 * t, DVec3::ONE, beside());
    let place = match matrix_keys {
        1 => InstanceTransform::Translation(beside()),
        _ => InstanceTransform::Moving {
            key_times: vec![0.0, 1.0],
            matrices: vec![at(0.0), at(1.0)],
        },
    };
    (mesh, place)
}

/// Rays of 64x64 pixels by packets of neighbours, `timed` or at no time.
fn rays(timed: bool) -> Vec<Ray> {
    let mut rng = Rng(3);
    (0..4096)
        .map(|i| {
            let (block, pixel) = (i / 16, i % 16);
            let x = (block % 16 * 4 + pixel % 4) as f32 / 32.0 - 1.0;
            let y = (block / 16 * 4 + pixel / 4) as f32 / 32.0 - 1.0;
            let target = Vec3::new(x + 0.03 * rng.unit(), y + 0.03 * rng.unit(), 0.0);
            let eye = Vec3::new(0.3, -1.0, 3.0);
            let time = rng.unit();
            ray(eye, target - eye, if timed { time } else { 0.0 })
        })
        .collect()
}

fn trace(world: &World, rays: &[Ray], way: &str) -> (usize, TraceCounts) {
    let mut counts = TraceCounts::default();
    let mut hits = vec![Hit::MISS; rays.len()];
    // What a thread keeps between packets is made once.
    world.trace_many(rays, &mut hits, &mut TraceCounts::default());
    measured(|| match way {
        "packets" => world.trace_many(rays, &mut hits, &mut counts),
        "single" => {
            for (ray, hit) in rays.iter().zip(&mut hits) {
                *hit = world.trace(ray, &mut counts);
            }
        }
        _ => {
            for (ray, hit) in rays.iter().zip(&mut hits) {
                hit.instance = if world.occluded(ray, &mut counts) {
                    0
                } else {
                    Hit::NONE
                };
            }
        }
    });
    (hits.iter().filter(|h| h.is_hit()).count(), counts)
}

/// Grids of a mesh as a prim.
fn prim(mesh: &DicedMesh, path: &str, transforms: &[DMat4]) -> PrimDesc {
    let grids = GridsDesc {
        times: mesh.key_times.iter().map(|&t| f64::from(t)).collect(),
        grids: mesh.grids.iter().map(|g| (g.nu, g.nv, g.element)).collect(),
        positions: Arc::new(mesh.positions.clone()),
    };
    let mut common = PrimCommon::new(path);
    common.transform = vec![samples(transforms)];
    PrimDesc {
        common,
        geometry: Geometry::Grids(grids),
    }
}

fn samples(matrices: &[DMat4]) -> TransformSamples {
    TransformSamples {
        times: (0..matrices.len()).map(|i| i as f64).collect(),
        matrices: matrices.to_vec(),
        ..TransformSamples::default()
    }
}

/// What is authored, and what is switched off again.
#[derive(Clone, Copy, Debug, Default)]
struct Authored {
    motion: bool,
    lens: bool,
    disabled: bool,
    /// Two samples that are equal.
    constant: bool,
    /// Sides may be culled, but none is.
    double_sided: bool,
}

/// A render of 48x48 pixels of 16 samples.
fn image(authored: Authored) -> (usize, TraceCounts) {
    let mesh = sheet(3, 16, &keys(if authored.motion { 2 } else { 1 }));
    let mut scene = Scene::default();
    let still = [DMat4::IDENTITY; 2];
    let given = &still[..if authored.constant { 2 } else { 1 }];
    let mut sheet = prim(&mesh, "/sheet", given);
    sheet.common.double_sided = authored.double_sided;
    scene.prims.insert(PrimId(1), Arc::new(sheet));
    let eye = DMat4::from_translation(DVec3::new(0.0, 0.0, 5.0));
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        transform: vec![samples(&[eye])],
        shutter: [0.0, 1.0],
        focus_distance: 5.0,
        f_stop: if authored.lens { 0.2 } else { 0.0 },
        ..CameraDesc::default()
    };
    scene.cameras.insert(PrimId(2), Arc::new(camera));
    scene.active_camera = Some(PrimId(2));
    scene.settings = RenderSettings {
        resolution: [48, 48],
        samples: 16,
        disable_motion_blur: authored.disabled,
        disable_defocus: authored.disabled,
        cull: if authored.double_sided {
            Cull::BackUnlessDoubleSided
        } else {
            Cull::None
        },
        ..RenderSettings::default()
    }
    .into();
    let never = AtomicBool::new(false);
    let prepared = prepare(&scene, &NoSubdivision, None, &never)
        .expect("a scene")
        .prepared;
    let frame = Frame::new([48, 48], None, prepared.aovs()).expect("a frame");
    let control = RenderControl {
        cancel: &never,
        on_progress: &|_| {},
        on_pass: &|_, _| {},
    };
    let done = measured(|| render(&prepared, &frame, &control));
    (done.counts.rays as usize, done.counts)
}

fn run(case: &str, level: Level) -> Option<(usize, TraceCounts)> {
    let off = Authored::default();
    if let Some(case) = case.strip_prefix("image ") {
        return Some(image(match case {
            "still" => off,
            "still, samples that are equal" => Authored {
                constant: true,
                ..off
            },
            "motion and lens, disabled" => Authored {
                motion: true,
                lens: true,
                disabled: true,
                ..off
            },
            "culled, but all is double-sided" => Authored {
                double_sided: true,
                ..off
            },
            "lens" => Authored { lens: true, ..off },
            "motion" => Authored {
                motion: true,
                ..off
            },
            _ => return None,
        }));
    }
    let (way, case) = case.split_once(' ')?;
    let (world, timed) = match case {
        "static" => (world(None), false),
        "static, rays with times" => (world(None), true),
        "static, a still thing beside" => (world(Some(thing(1, 1))), true),
        "static, a thing of moving points beside" => (world(Some(thing(2, 1))), true),
        "static, a thing with a moving matrix beside" => (world(Some(thing(1, 2))), true),
        _ => return None,
    };
    Some(trace(&world.with_level(level), &rays(timed), way))
}

fn main() -> ExitCode {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let name = args.get(1).map_or("", |a| a);
    let level = Level::available().into_iter().find(|l| l.name() == name);
    let level = level.unwrap_or_else(Level::best);
    // On one thread, which is that of the tasks: counting is by thread.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let found = pool
        .ok()
        .and_then(|pool| pool.install(|| run(args.first()?, level)));
    let Some((hits, counts)) = found else {
        eprintln!("absent_effects: no case {args:?}");
        return ExitCode::FAILURE;
    };
    println!(
        "{} {hits} {} {}",
        level.name(),
        counts.node_tests,
        counts.cell_tests
    );
    ExitCode::SUCCESS
}
