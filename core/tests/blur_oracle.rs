//! The blur oracle: a render over the shutter against an independent f64 Monte-Carlo integral.
//!
//! The oracle knows nothing of keys, dicing or trees: it evaluates the motion in closed form at each
//! sample's own time, makes its own camera rays, and tests every triangle. The two agree within the
//! statistical bound, and stop agreeing when one key is shifted.

mod support;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DAffine3, DMat4, DVec3, Vec3};
use hdtrapeze_core::aov::{Aov, AovData};
use hdtrapeze_core::render::{Frame, RenderControl, prepare, render};
use hdtrapeze_core::scene::Geometry;
use hdtrapeze_core::scene::{
    CameraDesc, FilterKind, InstanceArrays, InstancerDesc, Interpolation, MeshDesc, PointsSamples,
    PrimCommon, PrimDesc, PrimId, PrimvarDesc, Rates, RenderSettings, Samples, Scene,
    TransformSamples,
};
use hdtrapeze_core::surface::{MeshTopology, Scheme};
use support::NoSubdivision;

const WIDTH: u32 = 24;
const HEIGHT: u32 = 18;
const SAMPLES: u32 = 1024;
const ORACLE_SAMPLES: u32 = 4096;
/// A tenth of a 1/255 step (one sample in 2500); keeps pixels without variance from dividing by zero.
const FLOOR: f64 = 0.1 / 255.0;

/// A triangle mesh whose matrix and points are functions of the time code.
#[derive(Clone)]
struct Actor {
    matrix: fn(f64) -> DAffine3,
    points: fn(f64) -> Vec<DVec3>,
    /// Number of times over the shutter (over all that the blur scale makes of it) at which the
    /// renderer is given samples.
    matrix_keys: usize,
    /// Matrices turn between keys.
    turns: bool,
    point_keys: usize,
    /// In place of samples at keys.
    rates: Option<RatedSample>,
    blur_scale: f64,
    nonlinear_samples: Option<u32>,
    color: [f32; 3],
}

/// One sample of the points and how it moves on: units a time code, and a time code squared.
#[derive(Clone)]
struct RatedSample {
    time: f64,
    velocities: [DVec3; 3],
    accelerations: Option<[DVec3; 3]>,
}

struct Play {
    actors: Vec<Actor>,
    camera: fn(f64) -> DAffine3,
    camera_keys: usize,
    f_stop: f64,
    shutter: [f64; 2],
}

const FOCAL: f64 = 5.0;
const APERTURE: f64 = 4.0;
const FOCUS: f64 = 6.0;

fn still(_: f64) -> DAffine3 {
    DAffine3::IDENTITY
}

fn triangle(_: f64) -> Vec<DVec3> {
    vec![
        DVec3::new(-1.0, -0.8, 0.0),
        DVec3::new(1.1, -0.7, 0.2),
        DVec3::new(0.1, 1.0, -0.3),
    ]
}

fn camera_at_z6(_: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(0.0, 0.0, 6.0))
}

fn key_times(count: usize) -> Vec<f64> {
    if count == 1 {
        return vec![0.0];
    }
    (0..count).map(|i| i as f64 / (count - 1) as f64).collect()
}

fn rated_points(actor: &Actor, rated: &RatedSample, shift: f64) -> PointsSamples {
    const TIME_CODES_PER_SECOND: f64 = 24.0;
    let array = |values: &[DVec3], scale: f64| {
        let values = values.iter().map(|v| (*v * scale).as_vec3());
        Arc::new(values.collect::<Vec<Vec3>>())
    };
    let samples = |values: Option<Arc<Vec<Vec3>>>| Samples {
        times: values.iter().map(|_| rated.time).collect(),
        values: values.into_iter().collect(),
    };
    let velocities = rated.velocities.map(|v| v + DVec3::X * shift);
    let accelerations = rated.accelerations.as_ref();
    PointsSamples {
        times: vec![rated.time],
        points: vec![array(&(actor.points)(rated.time), 1.0)],
        rates: Rates {
            velocities: samples(Some(array(&velocities, TIME_CODES_PER_SECOND))),
            accelerations: samples(accelerations.map(|a| array(a, TIME_CODES_PER_SECOND.powi(2)))),
            time_codes_per_second: TIME_CODES_PER_SECOND,
        },
    }
}

/// The play as a scene. `shift` moves one key of the first actor, or changes its velocities.
fn scene(play: &Play, shift: f64) -> Scene {
    let mut scene = Scene::default();
    for (i, actor) in play.actors.iter().enumerate() {
        let reach = actor.blur_scale.max(1.0);
        let [open, close] = play.shutter.map(|time| time * reach);
        let key_times = |count: usize| {
            let at = |t: &f64| open + (close - open) * t;
            key_times(count).iter().map(at).collect()
        };
        let times: Vec<f64> = key_times(actor.matrix_keys);
        let mut matrices: Vec<DMat4> = times
            .iter()
            .map(|&t| DMat4::from((actor.matrix)(t)))
            .collect();
        let point_times: Vec<f64> = key_times(actor.point_keys);
        let mut points: Vec<Vec<Vec3>> = point_times
            .iter()
            .map(|&t| (actor.points)(t).iter().map(|p| p.as_vec3()).collect())
            .collect();
        if i == 0 && actor.rates.is_none() {
            if matrices.len() > 1 {
                *matrices.last_mut().unwrap() =
                    DMat4::from_translation(DVec3::new(shift, 0.0, 0.0))
                        * matrices[times.len() - 1];
            } else {
                for p in points.last_mut().unwrap() {
                    p.x += shift as f32;
                }
            }
        }
        let count = points[0].len() as u32;
        let topology = MeshTopology {
            scheme: Scheme::None,
            face_vertex_counts: vec![3; count as usize / 3],
            face_vertex_indices: (0..count).collect(),
            ..MeshTopology::default()
        };
        let mut common = PrimCommon::new(format!("/actor{i}"));
        common.transform = vec![TransformSamples {
            times,
            matrices,
            turns: actor.turns,
        }];
        common.primvars.insert(
            "displayColor".to_owned(),
            PrimvarDesc::still(Interpolation::Constant, 3, actor.color.to_vec(), vec![]),
        );
        common.blur_scale = actor.blur_scale;
        common.nonlinear_samples = actor.nonlinear_samples;
        let points = match &actor.rates {
            Some(rated) => rated_points(actor, rated, shift),
            None => PointsSamples {
                times: point_times,
                points: points.into_iter().map(Arc::new).collect(),
                ..PointsSamples::default()
            },
        };
        let geometry = Geometry::Mesh(MeshDesc {
            topology: Arc::new(topology),
            points,
            ..MeshDesc::default()
        });
        scene.prims.insert(
            PrimId(i as u64 + 1),
            Arc::new(PrimDesc { common, geometry }),
        );
    }
    let times = key_times(play.camera_keys);
    let matrices = times
        .iter()
        .map(|&t| DMat4::from((play.camera)(t)))
        .collect();
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        transform: vec![TransformSamples {
            times,
            matrices,
            ..TransformSamples::default()
        }],
        horizontal_aperture: APERTURE,
        vertical_aperture: APERTURE * f64::from(HEIGHT) / f64::from(WIDTH),
        focal_length: FOCAL,
        focus_distance: FOCUS,
        f_stop: play.f_stop,
        clipping: [0.01, 1000.0],
        shutter: play.shutter,
        ..CameraDesc::default()
    };
    scene.cameras.insert(PrimId(100), Arc::new(camera));
    scene.active_camera = Some(PrimId(100));
    scene.settings = Arc::new(RenderSettings {
        resolution: [WIDTH, HEIGHT],
        samples: SAMPLES,
        filter: FilterKind::Box,
        ..RenderSettings::default()
    });
    scene
}

fn rendered(scene: &Scene) -> Vec<f32> {
    let cancel = AtomicBool::new(false);
    let preparation = prepare(scene, &NoSubdivision, None, &cancel).unwrap();
    assert!(
        preparation.warnings.is_empty(),
        "{:?}",
        preparation.warnings
    );
    let prepared = preparation.prepared;
    let frame = Frame::new([WIDTH, HEIGHT], None, prepared.aovs()).unwrap();
    let control = RenderControl {
        cancel: &cancel,
        on_progress: &|_| {},
        on_pass: &|_, _| {},
    };
    let statistics = render(&prepared, &frame, &control);
    assert!(!statistics.cancelled);
    match frame.aov(Aov::Color).unwrap().data {
        AovData::F32(data) => data,
        AovData::I32(_) => unreachable!("color is float"),
    }
}

/// SplitMix64: the oracle's own random numbers.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// Mean and variance of the mean of (red, alpha) in each pixel.
fn oracle(play: &Play) -> Vec<([f64; 2], [f64; 2])> {
    let mut out = Vec::new();
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            let mut random = Random(u64::from(y * WIDTH + x) * 7919 + 13);
            let (mut sum, mut squares) = ([0.0; 2], [0.0; 2]);
            for _ in 0..ORACLE_SAMPLES {
                let value = oracle_sample(play, x, y, &mut random);
                for i in 0..2 {
                    sum[i] += value[i];
                    squares[i] += value[i] * value[i];
                }
            }
            let n = f64::from(ORACLE_SAMPLES);
            let mean = sum.map(|s| s / n);
            let variance = [0, 1].map(|i| (squares[i] / n - mean[i] * mean[i]).max(0.0) / n);
            out.push((mean, variance));
        }
    }
    out
}

fn oracle_sample(play: &Play, x: u32, y: u32, random: &mut Random) -> [f64; 2] {
    let half_width = APERTURE / FOCAL / 2.0;
    let half_height = half_width * f64::from(HEIGHT) / f64::from(WIDTH);
    let sx = (f64::from(x) + random.next()) / f64::from(WIDTH) * 2.0 - 1.0;
    let sy = 1.0 - (f64::from(y) + random.next()) / f64::from(HEIGHT) * 2.0;
    let time = random.next();
    let lens = if play.f_stop > 0.0 {
        let radius = FOCAL / (2.0 * play.f_stop) * random.next().sqrt();
        let angle = random.next() * std::f64::consts::TAU;
        DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.0)
    } else {
        DVec3::ZERO
    };
    let focus = DVec3::new(sx * half_width, sy * half_height, -1.0) * FOCUS;
    let [open, close] = play.shutter;
    let time = open + (close - open) * time;
    let camera = (play.camera)(time);
    let origin = camera.transform_point3(lens);
    let dir = camera.transform_vector3(focus - lens);
    let view = camera.transform_vector3(DVec3::NEG_Z).normalize();
    let mut nearest = f64::INFINITY;
    let mut value = [0.0; 2];
    for actor in &play.actors {
        let time = time * actor.blur_scale;
        let matrix = (actor.matrix)(time);
        let points: Vec<DVec3> = (actor.points)(time)
            .iter()
            .map(|p| matrix.transform_point3(*p))
            .collect();
        for p in points.chunks_exact(3) {
            let (e1, e2) = (p[1] - p[0], p[2] - p[0]);
            let normal = e1.cross(e2);
            let determinant = -dir.dot(normal);
            let to = origin - p[0];
            let t = to.dot(normal) / determinant;
            let moment = to.cross(dir);
            let u = e2.dot(moment) / determinant;
            let v = -e1.dot(moment) / determinant;
            if t > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t < nearest {
                nearest = t;
                let cosine = normal.normalize().dot(view).abs();
                let lit = f64::from(hdtrapeze_core::shade::camera_light_irradiance()) * cosine;
                value = [f64::from(actor.color[0]) * lit / std::f64::consts::PI, 1.0];
            }
        }
    }
    value
}

/// Root mean square of the differences in units of their standard error, and the largest.
///
/// The error of the render itself is bounded by the oracle's (it has a quarter of the samples, but
/// stratified).
fn disagreement(play: &Play, shift: f64) -> (f64, f64) {
    disagreement_of(play, &scene(play, shift))
}

/// The same of another scene than the play's own.
fn disagreement_of(play: &Play, scene: &Scene) -> (f64, f64) {
    let image = rendered(scene);
    let (mut squares, mut largest, mut count) = (0.0, 0.0f64, 0.0);
    for (i, (mean, variance)) in oracle(play).into_iter().enumerate() {
        for (channel, at) in [(0, 0), (1, 3)] {
            let difference = f64::from(image[i * 4 + at]) - mean[channel];
            let ratio = f64::from(ORACLE_SAMPLES) / f64::from(SAMPLES);
            let error = (variance[channel] * (1.0 + ratio)).sqrt() + FLOOR;
            squares += (difference / error).powi(2);
            largest = largest.max((difference / error).abs());
            count += 1.0;
        }
    }
    ((squares / count).sqrt(), largest)
}

fn check(name: &str, play: &Play, shift: f64) {
    let (rms, largest) = disagreement(play, 0.0);
    println!("{name}: rms {rms:.3}, largest {largest:.2} standard errors");
    assert!(
        rms < 0.8 && largest < 5.0,
        "{name}: rms {rms}, largest {largest}"
    );
    let (red, reddest) = disagreement(play, shift);
    println!("{name}, one key shifted: rms {red:.3}, largest {reddest:.2}");
    let shows = red > 2.0 * rms && reddest > 6.0;
    assert!(
        shows,
        "{name}: a shifted key must show: rms {red}, largest {reddest}"
    );
}

fn actor() -> Actor {
    Actor {
        matrix: still,
        points: triangle,
        matrix_keys: 1,
        turns: false,
        point_keys: 1,
        rates: None,
        blur_scale: 1.0,
        nonlinear_samples: None,
        color: [0.9, 0.5, 0.2],
    }
}

fn play(actor: Actor) -> Play {
    let backdrop = Actor {
        points: |_| {
            vec![
                DVec3::new(-3.0, -2.0, -2.0),
                DVec3::new(3.0, -2.5, -2.0),
                DVec3::new(0.0, 2.0, -1.0),
            ]
        },
        color: [0.3, 0.3, 0.3],
        ..self::actor()
    };
    Play {
        actors: vec![actor, backdrop],
        camera: camera_at_z6,
        camera_keys: 1,
        f_stop: 0.0,
        shutter: [0.0, 1.0],
    }
}

#[test]
fn linear_transform() {
    let matrix = |t: f64| DAffine3::from_translation(DVec3::new(2.0 * t - 1.0, 0.5 * t, t));
    check(
        "linear transform",
        &play(Actor {
            matrix,
            matrix_keys: 2,
            ..actor()
        }),
        0.35,
    );
}

#[test]
fn rotating_transform() {
    let matrix = |t: f64| DAffine3::from_rotation_z(2.0 * t) * DAffine3::from_rotation_y(t);
    check(
        "rotating transform",
        &play(Actor {
            matrix,
            matrix_keys: 17,
            ..actor()
        }),
        1.5,
    );
}

/// Nearly half a turn, on a way that is not through the origin.
fn spinning(t: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(t - 0.5, 0.3 * t, 0.0)) * spin(t)
}

fn spin(t: f64) -> DAffine3 {
    DAffine3::from_rotation_z(2.8 * t) * DAffine3::from_scale(DVec3::new(1.0, 0.7, 1.0))
}

#[test]
fn what_spins_goes_along_arcs() {
    let in_place = Actor {
        matrix: spin,
        matrix_keys: 2,
        turns: true,
        ..actor()
    };
    // A key between shows that it moves on as it turns.
    let spinning = Actor {
        matrix: spinning,
        matrix_keys: 3,
        ..in_place.clone()
    };
    check("in place", &play(in_place), 0.5);
    check("spinning", &play(spinning), 0.5);
}

const APART: DVec3 = DVec3::new(1.3, 0.4, 0.0);

/// Two actors of a play as one prim that is placed twice; `parts` are the transform of the prim, that of
/// the instancer, and matrices of the instances, which turn about their own origins.
fn placed_twice(play: &Play, parts: [fn(f64) -> DAffine3; 3]) -> Scene {
    let mut scene = scene(play, 0.0);
    scene.prims.remove(&PrimId(2));
    let prim = scene.prims.get_mut(&PrimId(1)).unwrap();
    let common = &mut Arc::make_mut(prim).common;
    let times = vec![0.0, 1.0];
    let samples = |of: fn(f64) -> DAffine3| TransformSamples {
        matrices: times.iter().map(|&t| DMat4::from(of(t))).collect(),
        times: times.clone(),
        turns: true,
    };
    common.transform = vec![samples(parts[0])];
    common.instancer = Some((PrimId(50), 0));
    let own = samples(parts[2]).matrices;
    let values = own.iter().map(|m| Arc::new(vec![*m; 2]));
    let arrays = InstanceArrays {
        instance_count: 2,
        positions: Samples {
            times: vec![0.0],
            values: vec![Arc::new([APART, -APART].map(|p| p.as_vec3()).to_vec())],
        },
        matrices: Samples {
            times: times.clone(),
            values: values.collect(),
        },
        matrices_turn: true,
        ..InstanceArrays::default()
    };
    let instancer = InstancerDesc {
        transform: vec![samples(parts[1])],
        arrays: Arc::new(arrays),
        ..InstancerDesc::new("/instancer")
    };
    scene.instancers.insert(PrimId(50), Arc::new(instancer));
    scene
}

#[test]
fn instances_that_spin_go_along_arcs() {
    type Matrix = fn(f64) -> DAffine3;
    let inside: [Matrix; 2] = [
        |t| DAffine3::from_translation(APART) * spin(t),
        |t| DAffine3::from_translation(-APART) * spin(t),
    ];
    let outside: [Matrix; 2] = [
        |t| spin(t) * DAffine3::from_translation(APART),
        |t| spin(t) * DAffine3::from_translation(-APART),
    ];
    for (name, matrices, parts) in [
        ("prim", inside, [spin as Matrix, still, still]),
        ("instancer", outside, [still as Matrix, spin, still]),
        ("matrices", inside, [still as Matrix, still, spin]),
    ] {
        let each = matrices.map(|matrix| Actor { matrix, ..actor() });
        let mut play = play(actor());
        play.actors.splice(0..1, each);
        let given = placed_twice(&play, parts);
        let (rms, largest) = disagreement_of(&play, &given);
        println!("{name}: rms {rms:.3}, largest {largest:.2} standard errors");
        assert!(rms < 0.8 && largest < 5.0, "{name}: {rms}, {largest}");
    }
}

#[test]
fn linear_deformation() {
    let points = |t: f64| {
        let mut points = triangle(t);
        points[0] += DVec3::new(0.0, t, 0.3 * t);
        points[2] += DVec3::new(-1.5 * t, 0.2 * t, 0.0);
        points
    };
    check(
        "linear deformation",
        &play(Actor {
            points,
            point_keys: 2,
            ..actor()
        }),
        0.35,
    );
}

#[test]
fn curved_deformation() {
    let points = |t: f64| {
        let mut points = triangle(t);
        points[2] += DVec3::new((4.0 * t).sin(), (4.0 * t).cos() - 1.0, 0.0);
        points
    };
    check(
        "curved deformation",
        &play(Actor {
            points,
            point_keys: 33,
            ..actor()
        }),
        1.5,
    );
}

/// M(t) p(t) with both moving: quadratic, and the origin of the space passes through 1/4 of it.
#[test]
fn transform_times_deformation() {
    let matrix = |t: f64| DAffine3::from_scale(DVec3::splat(0.2 + 1.8 * t));
    let points = |t: f64| {
        triangle(t)
            .into_iter()
            .map(|p| p * (1.7 - 1.5 * t))
            .collect()
    };
    let actor = Actor {
        matrix,
        points,
        matrix_keys: 2,
        point_keys: 2,
        ..actor()
    };
    check("transform times deformation", &play(actor), 0.35);
}

#[test]
fn half_turn_between_two_keys_is_an_entrywise_blend() {
    // Two keys only: the path is the straight blend of the matrices, flat in mid-shutter.
    let matrix = |t: f64| DAffine3::from_scale(DVec3::new(1.0 - 2.0 * t, 1.0 - 2.0 * t, 1.0));
    check(
        "half turn",
        &play(Actor {
            matrix,
            matrix_keys: 2,
            ..actor()
        }),
        0.35,
    );
}

#[test]
fn moving_camera() {
    let camera = |t: f64| DAffine3::from_translation(DVec3::new(1.0 - 2.0 * t, 0.3 * t, 6.0 - t));
    check(
        "moving camera",
        &Play {
            camera,
            camera_keys: 2,
            ..play(actor())
        },
        0.35,
    );
}

#[test]
fn turning_camera() {
    let camera = |t: f64| {
        DAffine3::from_translation(DVec3::new(0.0, 0.0, 6.0)) * DAffine3::from_rotation_y(0.4 * t)
    };
    check(
        "turning camera",
        &Play {
            camera,
            camera_keys: 2,
            ..play(actor())
        },
        1.0,
    );
}

#[test]
fn defocus() {
    let matrix = |_: f64| DAffine3::from_translation(DVec3::new(0.0, 0.0, 2.5));
    let play = play(Actor {
        matrix,
        matrix_keys: 1,
        ..actor()
    });
    check(
        "defocus",
        &Play {
            f_stop: 4.0,
            ..play
        },
        0.35,
    );
}

#[test]
fn defocus_and_motion() {
    let matrix = |t: f64| DAffine3::from_translation(DVec3::new(2.0 * t - 1.0, 0.0, 3.0 * t - 1.0));
    let play = play(Actor {
        matrix,
        matrix_keys: 2,
        ..actor()
    });
    check(
        "defocus and motion",
        &Play {
            f_stop: 4.0,
            ..play
        },
        0.35,
    );
}

const VELOCITIES: [DVec3; 3] = [
    DVec3::new(0.5, 0.0, 0.0),
    DVec3::new(0.0, 1.0, 0.0),
    DVec3::new(-1.0, 0.3, 1.0),
];
const ACCELERATIONS: [DVec3; 3] = [
    DVec3::new(0.0, 3.0, 0.0),
    DVec3::new(-2.0, -2.5, 0.0),
    DVec3::new(3.0, 0.0, 1.0),
];
/// Time of the sample that moves on.
const SAMPLED: f64 = -0.3;

fn flying(t: f64) -> Vec<DVec3> {
    let (start, dt) = (triangle(0.0), t - SAMPLED);
    (0..3).map(|i| start[i] + VELOCITIES[i] * dt).collect()
}

fn falling(t: f64) -> Vec<DVec3> {
    let (flying, dt) = (flying(t), t - SAMPLED);
    (0..3)
        .map(|i| flying[i] + ACCELERATIONS[i] * (0.5 * dt * dt))
        .collect()
}

fn by_velocities() -> Actor {
    Actor {
        points: flying,
        rates: Some(RatedSample {
            time: SAMPLED,
            velocities: VELOCITIES,
            accelerations: None,
        }),
        ..actor()
    }
}

fn by_accelerations() -> Actor {
    Actor {
        points: falling,
        rates: Some(RatedSample {
            time: SAMPLED,
            velocities: VELOCITIES,
            accelerations: Some(ACCELERATIONS),
        }),
        ..actor()
    }
}

fn growing(t: f64) -> DAffine3 {
    DAffine3::from_scale(DVec3::splat(0.8 + 0.6 * t))
}

#[test]
fn velocities() {
    check("velocities", &play(by_velocities()), 0.35);
}

#[test]
fn accelerations() {
    check("accelerations", &play(by_accelerations()), 0.35);
}

#[test]
fn transform_times_velocities() {
    let actor = Actor {
        matrix: growing,
        matrix_keys: 2,
        ..by_accelerations()
    };
    check("transform times velocities", &play(actor), 0.35);
}

/// So many positions, evenly spaced, and straight lines between.
#[test]
fn nonlinear_samples() {
    let two = |t: f64| {
        let (a, b) = (falling(0.0), falling(1.0));
        a.iter().zip(b).map(|(a, b)| a.lerp(b, t)).collect()
    };
    let three = |t: f64| {
        let i = if t < 0.5 { 0.0 } else { 0.5 };
        let (a, b) = (falling(i), falling(i + 0.5));
        a.iter()
            .zip(b)
            .map(|(a, b)| a.lerp(b, 2.0 * (t - i)))
            .collect()
    };
    let with = |count: u32, points: fn(f64) -> Vec<DVec3>| {
        let mut actor = by_accelerations();
        actor.nonlinear_samples = Some(count);
        let mut play = play(actor);
        // What the renderer is given stays the sample; the oracle follows the lines.
        let given = scene(&play, 0.0);
        play.actors[0].points = points;
        (play, given)
    };
    for (count, points) in [(2, two as fn(f64) -> Vec<DVec3>), (3, three), (1, two)] {
        let (play, given) = with(count, points);
        let (rms, largest) = disagreement_of(&play, &given);
        println!("{count} samples: rms {rms:.3}, largest {largest:.2} standard errors");
        assert!(rms < 0.8 && largest < 5.0, "{count}: {rms}, {largest}");
    }
    let (play, given) = with(33, two);
    let (rms, largest) = disagreement_of(&play, &given);
    assert!(
        rms > 1.6 && largest > 6.0,
        "the parabola must not look like its chord"
    );
}

/// The blur of everything that moves a prim is scaled, about the frame, which is inside the shutter.
#[test]
fn blur_scales() {
    for scale in [2.0, 0.5, 0.0] {
        let actor = Actor {
            matrix: growing,
            matrix_keys: 2,
            blur_scale: scale,
            ..by_accelerations()
        };
        let play = Play {
            shutter: [-0.25, 0.5],
            ..play(actor)
        };
        check(&format!("blur scale {scale}"), &play, 0.35);
    }
}

#[test]
fn blur_scale_of_keys() {
    let points = |t: f64| triangle(t).iter().map(|p| *p + DVec3::X * t).collect();
    let actor = Actor {
        points,
        point_keys: 2,
        blur_scale: 2.0,
        ..actor()
    };
    check("blur scale of keys", &play(actor), 0.35);
}
