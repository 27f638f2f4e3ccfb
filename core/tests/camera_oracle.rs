//! The camera's oracle: renders through lenses that change, blades, shutter curves and clipping planes
//! against an f64 Monte-Carlo integral that draws by rejection and tests every triangle.
//!
//! It knows nothing of maps from the square, inverse integrals or keys. The two agree within the
//! statistical bound, and stop agreeing when the renderer is given something slightly else.

mod support;

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DMat4, DVec2, DVec3, Vec3};
use hdtrapeze_core::aov::{Aov, AovData};
use hdtrapeze_core::render::{Frame, RenderControl, prepare, render};
use hdtrapeze_core::scene::{
    ApertureDesc, CameraDesc, FilterKind, Geometry, LensSample, MeshDesc, PointsSamples,
    PrimCommon, PrimDesc, PrimId, Projection, RenderSettings, Scene, TransformSamples,
};
use hdtrapeze_core::surface::{MeshTopology, Scheme};
use support::NoSubdivision;

const SIZE: [u32; 2] = [20, 15];
const SAMPLES: u32 = 1024;
const ORACLE_SAMPLES: u32 = 4096;
/// A tenth of a 1/255 step; keeps pixels without variance from dividing by zero.
const FLOOR: f64 = 0.1 / 255.0;

/// A camera at the origin before three triangles, of which the nearest moves by `MOVE`.
const TRIANGLES: [[DVec3; 3]; 3] = [
    [
        DVec3::new(-1.2, -0.9, -4.0),
        DVec3::new(0.6, -0.7, -4.0),
        DVec3::new(-0.5, 1.0, -3.6),
    ],
    [
        DVec3::new(0.2, -1.5, -7.0),
        DVec3::new(3.0, -0.5, -6.0),
        DVec3::new(1.0, 2.0, -7.5),
    ],
    [
        DVec3::new(-6.0, -5.0, -12.0),
        DVec3::new(6.0, -5.0, -13.0),
        DVec3::new(0.0, 5.0, -11.0),
    ],
];
const MOVE: DVec3 = DVec3::new(0.9, 0.3, 0.0);

fn camera() -> CameraDesc {
    CameraDesc {
        path: "/camera".to_owned(),
        horizontal_aperture: 4.0,
        vertical_aperture: 3.0,
        focal_length: 5.0,
        focus_distance: 7.0,
        clipping: [0.01, 1000.0],
        shutter: [0.0, 1.0],
        ..CameraDesc::default()
    }
}

fn scene(camera: &CameraDesc, moves: bool) -> Scene {
    let mut scene = Scene::default();
    for (i, triangle) in TRIANGLES.iter().enumerate() {
        let topology = MeshTopology {
            scheme: Scheme::None,
            face_vertex_counts: vec![3],
            face_vertex_indices: vec![0, 1, 2],
            ..MeshTopology::default()
        };
        let mut common = PrimCommon::new(format!("/triangle{i}"));
        if i == 0 && moves {
            common.transform = vec![TransformSamples {
                times: vec![0.0, 1.0],
                matrices: vec![DMat4::IDENTITY, DMat4::from_translation(MOVE)],
                ..TransformSamples::default()
            }];
        }
        let points: Vec<Vec3> = triangle.iter().map(|p| p.as_vec3()).collect();
        let geometry = Geometry::Mesh(MeshDesc {
            topology: Arc::new(topology),
            points: PointsSamples {
                times: vec![0.0],
                points: vec![Arc::new(points)],
                ..PointsSamples::default()
            },
            ..MeshDesc::default()
        });
        let prim = PrimDesc { common, geometry };
        scene.prims.insert(PrimId(i as u64 + 1), Arc::new(prim));
    }
    scene.cameras.insert(PrimId(100), Arc::new(camera.clone()));
    scene.active_camera = Some(PrimId(100));
    scene.settings = Arc::new(RenderSettings {
        resolution: SIZE,
        samples: SAMPLES,
        filter: FilterKind::Box,
        ..RenderSettings::default()
    });
    scene
}

fn rendered(scene: &Scene) -> Vec<f32> {
    let cancel = AtomicBool::new(false);
    let preparation = prepare(scene, &NoSubdivision, None, &cancel).unwrap();
    assert_eq!(preparation.warnings, []);
    let prepared = preparation.prepared;
    let frame = Frame::new(SIZE, None, prepared.aovs()).unwrap();
    let control = RenderControl {
        cancel: &cancel,
        on_progress: &|_| {},
        on_pass: &|_, _| {},
    };
    render(&prepared, &frame, &control);
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

/// What the oracle is told, in closed form.
struct Truth {
    lens: fn(f64) -> LensSample,
    aperture: ApertureDesc,
    openness: fn(f64) -> f64,
    planes: Vec<[f64; 4]>,
    projection: Projection,
    moves: bool,
}

fn truth() -> Truth {
    Truth {
        lens: |_| camera().lens(),
        aperture: ApertureDesc::default(),
        openness: |_| 1.0,
        planes: Vec::new(),
        projection: Projection::Perspective,
        moves: false,
    }
}

/// Whether a point (in units of the round lens' radius) is in the opening: the intersection of the
/// disks whose rims the blades are, or of half planes, scaled to the disk's area.
fn is_open(aperture: &ApertureDesc, p: DVec2) -> bool {
    use std::f64::consts::{FRAC_PI_2, PI};
    let p = p / DVec2::new(aperture.ratio.sqrt(), 1.0 / aperture.ratio.sqrt());
    if aperture.blades < 3 {
        return p.length_squared() <= 1.0;
    }
    let n = f64::from(aperture.blades);
    let half = PI / n;
    let polygon = n * half.sin() * half.cos();
    let bent = aperture.roundness > 0.0;
    let radius = 1.0 / aperture.roundness;
    let angle = if bent {
        (half.sin() / radius).asin()
    } else {
        0.0
    };
    let segment = if bent {
        radius * radius * (angle - angle.sin() * angle.cos())
    } else {
        0.0
    };
    let p = p / (PI / (polygon + n * segment)).sqrt();
    (0..aperture.blades).all(|k| {
        let turn = aperture.rotation.to_radians() + FRAC_PI_2 + half * f64::from(2 * k + 1);
        let middle = DVec2::from_angle(turn);
        if bent {
            let centre = middle * (half.cos() - radius * angle.cos());
            (p - centre).length() <= radius
        } else {
            p.dot(middle) <= half.cos()
        }
    })
}

impl Truth {
    fn sample(&self, x: u32, y: u32, random: &mut Random) -> [f64; 2] {
        let time = loop {
            let time = random.next();
            if random.next() * 2.0 <= (self.openness)(time) {
                break time;
            }
        };
        let lens = (self.lens)(time);
        let sx = (f64::from(x) + random.next()) / f64::from(SIZE[0]) - 0.5;
        let sy = 0.5 - (f64::from(y) + random.next()) / f64::from(SIZE[1]);
        let film = DVec2::new(
            sx * lens.horizontal_aperture + lens.horizontal_aperture_offset,
            sy * lens.vertical_aperture + lens.vertical_aperture_offset,
        );
        let mut at = DVec2::ZERO;
        if lens.f_stop > 0.0 {
            let place = |r: f64| (r * 2.0 - 1.0) * 2.5;
            at = loop {
                let p = DVec2::new(place(random.next()), place(random.next()));
                if is_open(&self.aperture, p) {
                    break p * lens.focal_length / (2.0 * lens.f_stop);
                }
            };
        }
        let depth = lens.focus_distance;
        let (origin, focus) = match self.projection {
            Projection::Perspective => (at, film / lens.focal_length * depth),
            Projection::Orthographic => (film + at, film),
        };
        let origin = origin.extend(0.0);
        let dir = focus.extend(-depth) - origin;
        let (mut nearest, mut value) = (f64::INFINITY, [0.0; 2]);
        for (i, triangle) in TRIANGLES.iter().enumerate() {
            let shift = if i == 0 && self.moves {
                MOVE * time
            } else {
                DVec3::ZERO
            };
            let p = triangle.map(|p| p + shift);
            let (e1, e2) = (p[1] - p[0], p[2] - p[0]);
            let normal = e1.cross(e2);
            let determinant = -dir.dot(normal);
            let to = origin - p[0];
            let t = to.dot(normal) / determinant;
            let moment = to.cross(dir);
            let (u, v) = (e2.dot(moment) / determinant, -e1.dot(moment) / determinant);
            let hit = origin + dir * t;
            let is_cut = |plane: &[f64; 4]| {
                plane[0] * hit.x + plane[1] * hit.y + plane[2] * hit.z + plane[3] < 0.0
            };
            let inside = t > 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0;
            if inside && t < nearest && !self.planes.iter().any(is_cut) {
                nearest = t;
                let lit = f64::from(hdtrapeze_core::shade::camera_light_irradiance());
                let albedo = f64::from(hdtrapeze_core::shade::DEFAULT_ALBEDO[0]);
                let cosine = normal.normalize().z.abs();
                let radiance = albedo * lit * cosine / std::f64::consts::PI;
                value = [radiance * lens.exposure_scale, 1.0];
            }
        }
        value
    }

    /// Mean and variance of the mean of (red, alpha) in each pixel.
    fn integral(&self) -> Vec<([f64; 2], [f64; 2])> {
        let pixel = |i: u32| {
            let mut random = Random(u64::from(i) * 7919 + 13);
            let (mut sum, mut square) = ([0.0; 2], [0.0; 2]);
            for _ in 0..ORACLE_SAMPLES {
                let value = self.sample(i % SIZE[0], i / SIZE[0], &mut random);
                for c in 0..2 {
                    sum[c] += value[c];
                    square[c] += value[c] * value[c];
                }
            }
            let n = f64::from(ORACLE_SAMPLES);
            let mean = sum.map(|s| s / n);
            let variance = [0, 1].map(|c| (square[c] / n - mean[c] * mean[c]).max(0.0) / n);
            (mean, variance)
        };
        (0..SIZE[0] * SIZE[1]).map(pixel).collect()
    }

    /// `camera` must be what this says, and `wrong` must not.
    fn check(&self, camera: &CameraDesc, wrong: &CameraDesc) {
        let integral = self.integral();
        let compare = |camera| disagreement(&integral, &rendered(&scene(camera, self.moves)));
        let (rms, largest) = compare(camera);
        println!("rms {rms:.3}, largest {largest:.2} standard errors");
        assert!(rms < 0.8 && largest < 5.0, "rms {rms}, largest {largest}");
        let (red, reddest) = compare(wrong);
        println!("wrong: rms {red:.3}, largest {reddest:.2}");
        assert!(
            red > 1.5 * rms && reddest > 6.0,
            "{red}, {reddest} must show"
        );
    }
}

/// Root mean square of the differences in units of their standard error, and the largest. The
/// render's own error is bounded by the oracle's: fewer samples, but stratified.
fn disagreement(integral: &[([f64; 2], [f64; 2])], image: &[f32]) -> (f64, f64) {
    let (mut squares, mut largest) = (0.0, 0.0f64);
    for ((mean, variance), pixel) in integral.iter().zip(image.chunks_exact(4)) {
        for (c, at) in [(0, 0), (1, 3)] {
            let ratio = f64::from(ORACLE_SAMPLES) / f64::from(SAMPLES);
            let error = (variance[c] * (1.0 + ratio)).sqrt() + FLOOR;
            let off = (f64::from(pixel[at]) - mean[c]) / error;
            squares += off * off;
            largest = largest.max(off.abs());
        }
    }
    ((squares / (2.0 * integral.len() as f64)).sqrt(), largest)
}

fn samples(lens: fn(f64) -> LensSample, count: u32) -> Vec<LensSample> {
    let time = |i: u32| f64::from(i) / f64::from(count - 1);
    (0..count)
        .map(|i| LensSample {
            time: time(i),
            ..lens(time(i))
        })
        .collect()
}

#[test]
fn blades() {
    let aperture = ApertureDesc {
        blades: 5,
        rotation: 20.0,
        ratio: 0.6,
        roundness: 0.0,
    };
    let lens = |_| LensSample {
        f_stop: 1.5,
        ..camera().lens()
    };
    let with = |aperture| CameraDesc {
        aperture,
        f_stop: 1.5,
        ..camera()
    };
    let truth = Truth {
        lens,
        aperture,
        ..truth()
    };
    let turned = ApertureDesc {
        rotation: 56.0,
        ..aperture
    };
    truth.check(&with(aperture), &with(turned));
}

#[test]
fn bent_blades_on_an_orthographic_camera() {
    let aperture = ApertureDesc {
        blades: 3,
        rotation: -40.0,
        ratio: 1.0,
        roundness: 0.35,
    };
    let lens = |_| LensSample {
        f_stop: 3.0,
        horizontal_aperture: 8.0,
        vertical_aperture: 6.0,
        ..camera().lens()
    };
    let with = |roundness| CameraDesc {
        projection: Projection::Orthographic,
        horizontal_aperture: 8.0,
        vertical_aperture: 6.0,
        f_stop: 3.0,
        aperture: ApertureDesc {
            roundness,
            ..aperture
        },
        ..camera()
    };
    let truth = Truth {
        lens,
        aperture,
        projection: Projection::Orthographic,
        ..truth()
    };
    truth.check(&with(0.35), &with(1.0));
}

/// Focus goes from the nearest triangle to the last while the lens opens.
#[test]
fn rack_focus() {
    let lens = |t: f64| LensSample {
        focus_distance: 4.0 + 8.0 * t,
        f_stop: 5.0 - 3.0 * t,
        ..camera().lens()
    };
    let with = |count| CameraDesc {
        lens_samples: samples(lens, count),
        ..camera()
    };
    let truth = Truth { lens, ..truth() };
    // As if focus were where it is when the shutter opens.
    let mut still = with(2);
    still.lens_samples[1] = still.lens_samples[0];
    truth.check(&with(2), &still);
}

/// A zoom with a shifting film back; samples reach beyond the shutter, which sees the middle third.
#[test]
fn zoom() {
    let lens = |t: f64| LensSample {
        focal_length: 4.0 + 4.0 * t,
        horizontal_aperture_offset: 0.5 - t,
        vertical_aperture_offset: 0.4 * t,
        f_stop: 4.0,
        ..camera().lens()
    };
    let mut long = samples(lens, 2);
    // The same lines, longer at both ends.
    long[0] = LensSample {
        time: -1.0,
        ..lens(-0.5)
    };
    long[1] = LensSample {
        time: 2.0,
        ..lens(1.5)
    };
    let reach: fn(f64) -> LensSample = |t| {
        let inner = (t + 1.0) / 3.0 * 2.0 - 0.5;
        LensSample {
            focal_length: 4.0 + 4.0 * inner,
            horizontal_aperture_offset: 0.5 - inner,
            vertical_aperture_offset: 0.4 * inner,
            f_stop: 4.0,
            ..camera().lens()
        }
    };
    let with = |lens_samples| CameraDesc {
        lens_samples,
        ..camera()
    };
    let truth = Truth {
        lens: reach,
        ..truth()
    };
    truth.check(&with(long), &with(samples(lens, 2)));
}

/// Brighter towards the shutter's close, over something that moves.
#[test]
fn exposure_ramp() {
    let lens = |t: f64| LensSample {
        exposure_scale: 0.2 + 1.6 * t,
        ..camera().lens()
    };
    // Nothing behind it is seen.
    let with = |lens_samples| CameraDesc {
        lens_samples,
        clipping: [0.01, 5.0],
        ..camera()
    };
    let truth = Truth {
        lens,
        planes: vec![[0.0, 0.0, 1.0, 5.0]],
        moves: true,
        ..truth()
    };
    let level = |t: f64| LensSample {
        time: t,
        exposure_scale: 1.0 + 1e-9 * t,
        ..camera().lens()
    };
    truth.check(&with(samples(lens, 2)), &with(vec![level(0.0), level(1.0)]));
}

/// A shutter that opens slowly and closes at once.
#[test]
fn shutter_curve() {
    let truth = Truth {
        openness: |t| if t < 0.7 { 2.0 * t / 0.7 } else { 0.0 },
        moves: true,
        ..truth()
    };
    let with = |points: &[[f64; 2]]| {
        let mut camera = camera();
        camera.shutter_curve.points = points.to_vec();
        camera
    };
    truth.check(
        &with(&[[0.0, 0.0], [0.7, 5.0], [0.7, 0.0]]),
        &with(&[[0.0, 1.0], [0.7, 1.0], [0.7, 0.0]]),
    );
}

/// A slanted plane through the first two triangles, and one behind the second.
#[test]
fn clipping_planes() {
    let planes = vec![[0.4, 1.0, -0.3, -1.4], [0.1, 0.0, 1.0, 11.6]];
    let mut shifted = planes.clone();
    shifted[0][3] = -1.2;
    for (projection, f_stop, size) in [
        (Projection::Perspective, 2.5, 4.0),
        (Projection::Orthographic, 3.0, 8.0),
    ] {
        let lens: fn(f64) -> LensSample = match projection {
            Projection::Perspective => |_| LensSample {
                f_stop: 2.5,
                ..camera().lens()
            },
            Projection::Orthographic => |_| LensSample {
                f_stop: 3.0,
                horizontal_aperture: 8.0,
                vertical_aperture: 6.0,
                ..camera().lens()
            },
        };
        let with = |planes: &[[f64; 4]]| CameraDesc {
            projection,
            f_stop,
            horizontal_aperture: size,
            vertical_aperture: size * 0.75,
            clipping_planes: planes.to_vec(),
            ..camera()
        };
        let truth = Truth {
            lens,
            planes: planes.clone(),
            projection,
            ..truth()
        };
        truth.check(&with(&planes), &with(&shifted));
    }
}

/// What a pinhole and a lens with one set of numbers give is the same, however it is said.
#[test]
fn a_lens_that_stays_has_the_bits_of_one_sample() {
    let plain = CameraDesc {
        f_stop: 3.0,
        ..camera()
    };
    let sample = |time| LensSample {
        time,
        ..plain.lens()
    };
    let mut said_thrice = CameraDesc {
        lens_samples: vec![sample(0.5), sample(-3.0), sample(1.0)],
        f_stop: 77.0,
        ..plain.clone()
    };
    let settings = |camera: &CameraDesc, shutter| {
        let mut scene = scene(camera, true);
        Arc::make_mut(&mut scene.settings).samples = 16;
        Arc::make_mut(scene.cameras.get_mut(&PrimId(100)).unwrap()).shutter = shutter;
        rendered(&scene)
    };
    let expected = settings(&plain, [0.0, 1.0]);
    assert_eq!(settings(&said_thrice, [0.0, 1.0]), expected);
    // A change outside the shutter is none.
    said_thrice.lens_samples[1].f_stop = 9.0;
    said_thrice.lens_samples[1].time = -1.0;
    said_thrice.lens_samples.push(sample(-0.5));
    assert_eq!(settings(&said_thrice, [0.0, 1.0]), expected);
    assert_ne!(settings(&said_thrice, [-0.75, 0.25]), expected);
}
