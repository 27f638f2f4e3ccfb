//! The device's samples and camera rays against the CPU's.
//!
//! Samples have the same bits. Of rays, times are compared with the CPU's, and the rest with the CPU's rays at the
//! device's own times, so that a bound need not know how fast anything moves.

mod device;

use std::sync::Arc;

use device::Check;
use glam::{DMat4, DQuat, DVec3};
use hdtrapeze_core::camera::Camera;
use hdtrapeze_core::camera::opening::Times;
use hdtrapeze_core::film::filter::Filter;
use hdtrapeze_core::motion::Shutter;
use hdtrapeze_core::render::{Generator, Job, TileSamples};
use hdtrapeze_core::sample::PixelSampler;
use hdtrapeze_core::scene::{
    ApertureDesc, CameraDesc, FilterKind, LensSample, Projection, RenderSettings, ShutterCurveDesc,
    ShutterCurveKind, TransformSamples, WindowPolicy,
};
use hdtrapeze_gpu::kernel::{Binding, Kernel};
use hdtrapeze_gpu::{Device, GpuCamera, GpuError, GpuTiles, RayMaker};
use hdtrapeze_shaders::layout::Ray;
use hdtrapeze_shaders::stage::{GeneratePermutation, LensKind, TimeKind};
use libtest_mimic::Failed;
use wgpu::BufferUsages as Usage;

/// One rounding of a number near 1.
const U: f32 = 1.0 / 16_777_216.0;
/// Times are off by no more.
const TIME: f32 = 4.0 * U;
/// Offsets from the pixel's centre, in parts of the filter's width.
const OFFSET: f32 = 4.0 * U;
/// Directions and origins, in parts of the largest number that they are made of.
const RAY: f32 = 16.0 * U;

const PIXELS: [[i32; 2]; 12] = [
    [0, 0],
    [1, 0],
    [0, 1],
    [-1, -1],
    [17, 2303],
    [1279, 719],
    [65_535, 65_535],
    [-65_536, 4],
    [123, -7],
    [4096, 4096],
    [255, 256],
    [2048, 1],
];

/// Writes the samples of pixels as they are drawn.
const TELL_SAMPLES: &str = "
struct Launch { seed: vec2<u32>, digits: u32, count: u32 }
@group(0) @binding(0) var<storage, read> words: array<u32>;
@group(0) @binding(1) var<storage, read> pixels: array<vec2<i32>>;
@group(0) @binding(2) var<storage, read> launch: Launch;
@group(0) @binding(3) var<storage, read_write> told: array<f32>;
@compute @workgroup_size(1)
fn tell_samples(@builtin(workgroup_id) group: vec3<u32>) {
    let pattern = pattern_of(launch.seed, launch.digits, pixels[group.x]);
    for (var i = 0u; i < launch.count; i += 1u) {
        let drawn = sample_of(pattern, 5u * i);
        let at = 5u * (group.x * launch.count + i);
        told[at] = drawn.pixel.x;
        told[at + 1u] = drawn.pixel.y;
        told[at + 2u] = drawn.lens.x;
        told[at + 3u] = drawn.lens.y;
        told[at + 4u] = unit(drawn.time);
    }
}";

fn bits_are_the_same(device: &Device) -> Result<(), Failed> {
    for (lens, time) in [(false, false), (true, false), (false, true), (true, true)] {
        for (count, seed) in [
            (1, 0),
            (4, 3),
            (9, 1),
            (16, 0),
            (64, 77),
            (100, 5),
            (1024, 2),
        ] {
            let sampler = PixelSampler::new(count, seed);
            let permutation = GeneratePermutation {
                net: sampler.digits() > 0,
                lens: if lens {
                    LensKind::Round
                } else {
                    LensKind::Pinhole
                },
                time: if time {
                    TimeKind::Time
                } else {
                    TimeKind::Still
                },
                lens_changes: false,
            };
            let source = permutation.samples() + TELL_SAMPLES;
            let bound = [Binding::Read, Binding::Read, Binding::Read, Binding::Write];
            let kernel = Kernel::new(device, "tell_samples", &source, &[&bound])?;
            let words: Vec<[u32; 5]> = (0..count).map(|i| sampler.word(i)).collect();
            let seed64 = sampler.seed();
            let launch = [
                seed64 as u32,
                (seed64 >> 32) as u32,
                sampler.digits(),
                count,
            ];
            let mut told = vec![[0f32; 5]; PIXELS.len() * count as usize];
            let bytes = size_of_val(&told[..]) as u64;
            let out = device.buffer("told", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
            let words = device.upload("words", bytemuck::cast_slice(&words))?;
            let pixels = device.upload("pixels", bytemuck::cast_slice(&PIXELS))?;
            let launch = device.upload("launch", bytemuck::cast_slice(&launch))?;
            let buffers = [&words, &pixels, &launch, &out];
            let workgroups = PIXELS.len() as u32;
            kernel
                .launch(device, &[&buffers], workgroups)
                .run(device, false)?;
            device.fetch(&out, &mut told)?;
            for (pixel, told) in PIXELS.iter().zip(told.chunks(count as usize)) {
                let pattern = sampler.pixel(pixel.map(i32::cast_unsigned));
                for (i, told) in (0u32..).zip(told) {
                    let mut expected = pattern.sample(i);
                    if !lens {
                        expected[2..4].fill(0.0);
                    }
                    if !time {
                        expected[4] = 0.0;
                    }
                    if told.map(f32::to_bits) != expected.map(f32::to_bits) {
                        let what = format!("{pixel:?} {i} of {count}, seed {seed}");
                        return Err(format!("{what}: {told:?}, not {expected:?}").into());
                    }
                }
            }
        }
    }
    Ok(())
}

/// A camera, and what it is drawn with.
#[derive(Clone)]
struct Case {
    desc: CameraDesc,
    settings: RenderSettings,
    lens_point: Option<[f32; 2]>,
    time: bool,
}

impl Case {
    fn new(time: bool) -> Self {
        let desc = CameraDesc {
            path: "/camera".to_owned(),
            focal_length: 3.0,
            focus_distance: 7.0,
            clipping: [0.1, 1000.0],
            shutter: [0.0, 1.0],
            horizontal_aperture_offset: 0.2,
            transform: vec![TransformSamples {
                times: vec![0.0],
                matrices: vec![
                    DMat4::from_translation(DVec3::new(1.0e5, -3.0, 20.0))
                        * DMat4::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, 1.1, -0.2)),
                ],
                ..TransformSamples::default()
            }],
            ..CameraDesc::default()
        };
        let settings = RenderSettings {
            resolution: [100, 60],
            samples: 16,
            ..RenderSettings::default()
        };
        Self {
            desc,
            settings,
            lens_point: None,
            time,
        }
    }

    fn with(mut self, change: impl FnOnce(&mut CameraDesc)) -> Self {
        change(&mut self.desc);
        self
    }

    fn set(mut self, change: impl FnOnce(&mut RenderSettings)) -> Self {
        change(&mut self.settings);
        self
    }

    fn camera(&self) -> Camera {
        let shutter = Shutter {
            open: 0.0,
            close: 1.0,
        };
        let (camera, notes) = Camera::new(&self.desc, &self.settings, shutter).expect("a camera");
        assert!(notes.is_empty(), "{notes:?}");
        camera
    }

    fn generator<'a>(&self, camera: &'a Camera) -> Generator<'a> {
        let settings = &self.settings;
        Generator {
            camera,
            sampler: PixelSampler::new(settings.samples, settings.seed),
            filter: Filter::new(settings.filter, settings.filter_width),
            times: Times::new(camera.opening(), settings.time_window),
            lens_point: self.lens_point,
            has_lens: camera.lens_radius() > 0.0,
            has_time: self.time,
        }
    }
}

/// Whole tiles, parts of tiles, below 0 and beyond the image, with as many samples, and from others on.
fn tiles(samples: u32) -> Vec<TileSamples> {
    let tile = |x, y, width, height, samples| TileSamples {
        x,
        y,
        width,
        height,
        samples,
    };
    vec![
        tile(0, 0, 16, 16, 0..samples),
        tile(-16, 32, 16, 16, 0..samples),
        tile(48, 16, 5, 13, samples / 2..samples),
        tile(96, 48, 4, 12, 0..samples.min(3)),
        tile(16, 0, 9, 16, 1..samples),
        tile(16, 16, 16, 16, samples..samples),
    ]
}

fn turning(angle: f64, keys: usize) -> Vec<TransformSamples> {
    let at = |k: usize| {
        let f = k as f64 / (keys - 1) as f64;
        let place = DVec3::new(1.0e5 + 3.0 * f, 2.0 * f * f, -8.0 * f);
        let turn = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), angle * f);
        (f, DMat4::from_rotation_translation(turn, place))
    };
    let (times, matrices) = (0..keys).map(at).unzip();
    vec![TransformSamples {
        times,
        matrices,
        ..TransformSamples::default()
    }]
}

/// A lens that has these focal lengths, f-numbers and distances in focus, with the film back shifted and scaled between.
fn changing(keys: &[[f64; 3]]) -> impl FnOnce(&mut CameraDesc) {
    let keys = keys.to_vec();
    move |desc| {
        let last = (keys.len() - 1) as f64;
        let sample =
            |(i, &[focal_length, f_stop, focus_distance]): (usize, &[f64; 3])| LensSample {
                // From before the shutter opens to after it closes.
                time: 1.3 * i as f64 / last - 0.2,
                focal_length,
                f_stop,
                focus_distance,
                vertical_aperture_offset: 0.1 * i as f64,
                horizontal_aperture: 2.0 + 0.3 * i as f64,
                ..desc.lens()
            };
        desc.lens_samples = keys.iter().enumerate().map(sample).collect();
    }
}

fn curve(kind: ShutterCurveKind, points: &[[f64; 2]]) -> ShutterCurveDesc {
    ShutterCurveDesc {
        kind,
        points: points.to_vec(),
    }
}

fn blades(blades: u32, roundness: f64) -> ApertureDesc {
    ApertureDesc {
        blades,
        roundness,
        rotation: 17.0,
        ratio: 1.3,
    }
}

fn cases() -> Vec<(&'static str, Case)> {
    let still = || Case::new(false);
    let timed = || Case::new(true);
    let lens = |d: &mut CameraDesc| d.f_stop = 0.8;
    let with_blades = |n, roundness| {
        still()
            .with(lens)
            .with(|d| d.aperture = blades(n, roundness))
    };
    let filter = |kind, width| still().set(|s| (s.filter, s.filter_width) = (kind, width));
    let conformed = |policy| {
        let zoom = changing(&[[2.0, 0.0, 7.0], [3.0, 0.0, 7.0], [2.5, 0.0, 7.0]]);
        timed().with(zoom).set(|s| s.window_policy = policy)
    };
    let ramps = [
        [0.0, 0.0],
        [0.25, 1.0],
        [0.5, 1.0],
        [0.5, 0.3],
        [0.7, 0.0],
        [0.8, 0.0],
        [1.0, 2.0],
    ];
    let third = 1.0 / 3.0;
    let bezier = [[0.0, 0.0], [third, 0.0], [2.0 * third, 1.0], [1.0, 1.0]];
    vec![
        ("pinhole", still()),
        ("sobol", still().set(|s| s.samples = 7)),
        ("many_samples", timed().set(|s| s.samples = 100)),
        ("another_seed", still().set(|s| s.seed = 1234)),
        ("box_filter", filter(FilterKind::Box, 1.0)),
        ("gaussian_filter", filter(FilterKind::Gaussian, 2.5)),
        ("mitchell_filter", filter(FilterKind::Mitchell, 4.0)),
        (
            "blackman_harris_filter",
            filter(FilterKind::BlackmanHarris, 3.0),
        ),
        (
            "orthographic",
            still().with(|d| d.projection = Projection::Orthographic),
        ),
        ("round_lens", still().with(lens)),
        ("oval_lens", with_blades(0, 0.0)),
        (
            "orthographic_lens",
            still()
                .with(lens)
                .with(|d| d.projection = Projection::Orthographic),
        ),
        ("blades", with_blades(5, 0.0)),
        ("bent_blades", with_blades(3, 0.5)),
        ("hardly_bent_blades", with_blades(6, 1.0e-5)),
        ("nearly_round_blades", with_blades(4, 0.999)),
        ("one_lens_point", {
            let mut case = still().with(lens);
            case.lens_point = Some([0.3, -0.8]);
            case
        }),
        (
            "clipping_planes",
            still()
                .with(|d| d.clipping_planes = vec![[0.1, 0.0, -1.0, -3.0], [1.0, 0.2, 0.0, 0.5]]),
        ),
        ("time", timed()),
        ("time_and_lens", timed().with(lens)),
        (
            "part_of_the_shutter",
            timed().set(|s| s.time_window = [0.25, 0.5]),
        ),
        (
            "shutter_curve",
            timed().with(|d| d.shutter_curve = curve(ShutterCurveKind::Linear, &ramps)),
        ),
        (
            "part_of_a_curve",
            timed()
                .with(|d| d.shutter_curve = curve(ShutterCurveKind::Linear, &ramps))
                .set(|s| s.time_window = [0.3, 0.65]),
        ),
        (
            "bezier_curve",
            timed().with(|d| d.shutter_curve = curve(ShutterCurveKind::Bezier, &bezier)),
        ),
        (
            "camera_moves",
            timed().with(|d| d.transform = turning(0.7, 2)),
        ),
        (
            "camera_turns_half",
            timed().with(lens).with(|d| d.transform = turning(3.1, 2)),
        ),
        (
            "camera_at_many_keys",
            timed().with(|d| d.transform = turning(5.0, 9)),
        ),
        (
            "camera_hardly_turns",
            timed().with(|d| d.transform = turning(1.0e-7, 3)),
        ),
        (
            "rack_focus",
            timed().with(changing(&[[3.0, 0.8, 5.0], [3.0, 0.8, 9.0]])),
        ),
        (
            "zoom",
            timed().with(changing(&[
                [2.0, 0.0, 7.0],
                [3.0, 0.0, 7.0],
                [2.5, 0.0, 7.0],
            ])),
        ),
        (
            "zoom_of_a_lens",
            timed()
                .with(|d| d.transform = turning(0.7, 2))
                .with(|d| d.aperture = blades(5, 0.0))
                .with(changing(&[[2.0, 0.7, 7.0], [3.0, 1.1, 6.0]])),
        ),
        (
            "from_a_pinhole",
            timed().with(changing(&[
                [2.0, 0.0, 7.0],
                [3.0, 0.9, 6.0],
                [3.0, 0.0, 6.0],
            ])),
        ),
        (
            "keys_at_one_instant",
            timed()
                .with(changing(&[[2.0, 0.7, 7.0], [3.0, 1.1, 6.0]]))
                .with(|d| {
                    let at = [0.5, 0.5 + 1.0e-9];
                    for (sample, time) in d.lens_samples.iter_mut().zip(at) {
                        sample.time = time;
                    }
                }),
        ),
        (
            "orthographic_zoom",
            timed()
                .with(|d| d.projection = Projection::Orthographic)
                .with(changing(&[[2.0, 0.7, 7.0], [3.0, 1.1, 6.0]])),
        ),
        ("width_stays", conformed(WindowPolicy::MatchHorizontally)),
        ("height_stays", conformed(WindowPolicy::MatchVertically)),
        ("all_fits", conformed(WindowPolicy::Fit)),
        ("cropped", conformed(WindowPolicy::Crop)),
        ("stretched", conformed(WindowPolicy::DontConform)),
        (
            "nobody_asks_for_time",
            still().with(|d| d.transform = turning(1.0, 2)),
        ),
    ]
}

/// All rays are there once, and each is that of its number.
fn same_rays(device: &Arc<Device>, name: &str, case: &Case) -> Result<(), Failed> {
    let camera = case.camera();
    let generator = case.generator(&camera);
    let maker = RayMaker::new(Arc::clone(device));
    let there = GpuCamera::new(device, &generator)?;
    let tiles = tiles(case.settings.samples);
    let tiles_there = GpuTiles::new(device, &tiles, case.time)?;
    let (drawn, _) = maker.draw(&there, &tiles_there, false)?;
    let mut rays = vec![Ray::default(); tiles_there.rays];
    device.fetch(&drawn, &mut rays)?;
    let expected = tiles.iter().flat_map(|tile| {
        let jobs = generator.draw_tile(tile).into_iter();
        jobs.map(|(slot, job)| {
            let (x, y) = (slot as u32 % tile.width, slot as u32 / tile.width);
            ([tile.x + x as i32, tile.y + y as i32], job)
        })
    });
    let expected: Vec<([i32; 2], Job)> = expected.collect();
    if expected.len() != rays.len() {
        return Err(format!("{} rays, not {}", rays.len(), expected.len()).into());
    }
    let mut seen = vec![false; rays.len()];
    let mut worst = [0.0f32; 4];
    for ray in &rays {
        let number = ray.number as usize;
        if std::mem::replace(&mut seen[number], true) {
            return Err(format!("two rays have number {number}").into());
        }
        let (pixel, job) = &expected[number];
        let off = differences(&generator, ray, job);
        for (worst, off) in worst.iter_mut().zip(off) {
            *worst = worst.max(off);
        }
        let bounds = [TIME, OFFSET, RAY, RAY];
        let bad = off
            .iter()
            .zip(bounds)
            .any(|(off, bound)| off.is_nan() || *off > bound);
        if bad || ray.weight != job.weight {
            return Err(format!("{pixel:?} {number}: {ray:?}, not {job:?}: {off:?}").into());
        }
    }
    println!(
        "{name}: time, offset, ray, range off by {:?} roundings",
        worst.map(|x| x / U)
    );
    Ok(())
}

/// Time, squared distance, origin and direction, range: each in parts of what it is made of.
fn differences(generator: &Generator<'_>, ray: &Ray, job: &Job) -> [f32; 4] {
    let camera = generator.camera;
    let time = (ray.time - job.ray.time).abs();
    let width = generator.filter.width();
    let offset = (ray.distance2 - job.distance2).abs() / (width * width);
    // The CPU's ray at this time: poses are linear maps of what the camera makes of place and lens.
    let moved = |v: glam::Vec3, at: f32, to: f32| {
        if at == to {
            return v;
        }
        let (from, to) = (camera.pose(at).0, camera.pose(to).0);
        to * (from.inverse() * v)
    };
    let at = job.ray.time;
    let dir = moved(job.ray.dir, at, ray.time);
    let origin = moved(job.ray.origin - camera.pose(at).1, at, ray.time) + camera.pose(ray.time).1;
    let lens = camera.lens(ray.time);
    let corners = lens.window.point(glam::Vec2::ZERO).abs() + lens.window.size().abs();
    let place = camera.pose(ray.time).1.abs().max_element();
    let size = corners.max_element().max(1.0) + 2.0 * lens.radius;
    let off = (glam::Vec3::from_array(ray.dir) - dir).length() / size;
    let off_origin = (glam::Vec3::from_array(ray.origin) - origin).length() / size.max(place);
    let range = [ray.t_min, ray.t_max]
        .into_iter()
        .zip([job.ray.t_min, job.ray.t_max]);
    let range = range.map(|(a, b)| (a - b).abs() / a.abs().max(b.abs()).max(1.0));
    [time, offset, off.max(off_origin), range.fold(0.0, f32::max)]
}

/// The rays of a block that stand together are of nearly one instant.
fn order_follows_time(device: &Arc<Device>) -> Result<(), Failed> {
    for samples in [16, 64] {
        let case = Case::new(true).set(|s| s.samples = samples);
        let camera = case.camera();
        let generator = case.generator(&camera);
        let there = GpuCamera::new(device, &generator)?;
        let tile = TileSamples {
            x: 32,
            y: 16,
            width: 16,
            height: 16,
            samples: 0..samples,
        };
        let tiles = GpuTiles::new(device, &[tile], true)?;
        let (drawn, _) = RayMaker::new(Arc::clone(device)).draw(&there, &tiles, false)?;
        let mut rays = vec![Ray::default(); tiles.rays];
        device.fetch(&drawn, &mut rays)?;
        for packet in rays.chunks(64) {
            let times = packet.iter().map(|ray| ray.time);
            let (least, most) = times.fold((1.0f32, 0.0f32), |(a, b), t| (a.min(t), b.max(t)));
            // A net's samples have one interval each.
            if most - least > 1.0 / samples as f32 {
                return Err(format!("{least} to {most} of {samples} samples").into());
            }
        }
    }
    Ok(())
}

/// What is not drawn there is refused in words.
fn lenses_beyond_f32_are_refused(device: &Arc<Device>) -> Result<(), Failed> {
    let samples = [1.0e60, 2.0e60].map(|f_stop| LensSample {
        f_stop,
        focus_distance: 7.0,
        time: f_stop / 1.0e60 - 1.0,
        ..CameraDesc::default().lens()
    });
    let case = Case::new(true).with(|d| d.lens_samples = samples.to_vec());
    let camera = case.camera();
    match GpuCamera::new(device, &case.generator(&camera)) {
        Err(error @ GpuError::Unsupported(_)) if error.to_string().contains("lens") => Ok(()),
        other => Err(format!("{other:?}").into()),
    }
}

/// A text that does not parse is an error in the words of who reads it, and the device goes on. What a driver rejects of
/// sound text is told in the same way; no device can be made to do so here.
fn unsound_stages_are_errors(device: &Arc<Device>) -> Result<(), Failed> {
    let source = "@compute @workgroup_size(64) fn broken() { let x: u32 = 1.0; }";
    match Kernel::new(device, "broken", source, &[]) {
        Err(GpuError::Failed { why, .. }) if why.contains("broken") => {}
        other => return Err(format!("{other:?}").into()),
    }
    device.check()?;
    let there = device.upload("numbers", &7u64.to_le_bytes())?;
    let mut back = [0u64];
    device.fetch(&there, &mut back)?;
    match back {
        [7] => Ok(()),
        _ => Err(format!("{back:?}").into()),
    }
}

fn main() {
    let mut trials: Vec<(String, Check)> = vec![
        (
            "bits".to_owned(),
            Box::new(|device| bits_are_the_same(device)),
        ),
        ("order".to_owned(), Box::new(order_follows_time)),
        (
            "lens_beyond_f32".to_owned(),
            Box::new(lenses_beyond_f32_are_refused),
        ),
        (
            "unsound_stages".to_owned(),
            Box::new(unsound_stages_are_errors),
        ),
    ];
    for (name, case) in cases() {
        trials.push((
            format!("rays_of_{name}"),
            Box::new(move |device| same_rays(device, name, &case)),
        ));
    }
    device::run(trials);
}
