//! The stage `generate` on a device: camera rays of tiles, in the numbers and the order of core's
//! [`Generator`], without any that crosses the bus.
//!
//! Samples have the bits of core's. What core computes in f32 is computed here in the same way; where it uses f64 for
//! each ray, the host prepares numbers with which f32 does:
//!
//! - shutter curves: numbers are 24 bits and stay whole, distances from a piece's darker end are exact, and nothing cancels;
//! - poses: each turn is given by two quaternions at right angles and its angle, places are relative to the camera's;
//! - bent blades: Kepler's equation in a form that does not cancel.
//!
//! What is left is some roundings in time, lens point and direction; the tests state how many.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use glam::{DVec4, Vec2};
use hdtrapeze_core::camera::aperture::Aperture;
use hdtrapeze_core::camera::lens::{LensKey, LensPath};
use hdtrapeze_core::camera::opening::Times;
use hdtrapeze_core::camera::pose::Poses;
use hdtrapeze_core::render::Generator;
use hdtrapeze_core::sample::PixelSampler;
use hdtrapeze_core::scene::{Projection, WindowPolicy};
use hdtrapeze_shaders::layout::{Camera, Ray};
use hdtrapeze_shaders::stage::{GeneratePermutation, LensKind, TimeKind};
use wgpu::BufferUsages as Usage;

use super::kernel::{Binding, Kernel, Kernels};
use super::tiles::GpuTiles;
use super::{Device, GpuError};

/// Steps of a number in [0, 1).
const NUMBERS: f64 = 16_777_216.0;
/// Largest rate of opening: f32 holds its products.
const STEEPEST: f64 = 1.0e30;

/// A camera and what is drawn for it, on a device.
#[derive(Debug)]
pub struct GpuCamera {
    /// What the stage `generate` needs for it.
    pub permutation: GeneratePermutation,
    pub(crate) camera: wgpu::Buffer,
    pub(crate) tables: wgpu::Buffer,
    sampler: PixelSampler,
    /// Samples have times.
    pub has_time: bool,
}

/// Draws camera rays on a device.
#[derive(Debug)]
pub struct RayMaker {
    device: Arc<Device>,
    kernels: Kernels<GeneratePermutation>,
}

impl GpuCamera {
    /// Lays out what `generator` draws with.
    ///
    /// # Errors
    /// Its lens changes while the shutter is open, and is of numbers that f32 does not hold; or the device has no memory.
    pub fn new(device: &Device, generator: &Generator<'_>) -> Result<Self, GpuError> {
        let keys = generator.camera.lens_path().map(LensPath::keys);
        let mut numbers = keys.iter().flatten().flat_map(lens_numbers);
        if !numbers.all(f32::is_finite) {
            let what = "a lens that changes, of numbers beyond 10^38".to_owned();
            return Err(GpuError::Unsupported(what));
        }
        let mut tables = Tables::default();
        let (camera, permutation) = tables.camera(generator);
        Ok(Self {
            permutation,
            camera: device.uniform("camera", &camera)?,
            tables: device.upload("tables", bytemuck::cast_slice(&tables.words))?,
            sampler: generator.sampler.clone(),
            has_time: generator.has_time,
        })
    }
}

impl RayMaker {
    /// For this device.
    pub fn new(device: Arc<Device>) -> Self {
        Self {
            device,
            kernels: Kernels::default(),
        }
    }

    /// Draws the rays of tiles, by their numbers, as the stage `trace` reads them; gives the seconds that the device took where
    /// that is asked for and it can tell.
    ///
    /// # Errors
    /// They are more than the device takes at once, or it is lost.
    pub fn draw(
        &self,
        camera: &GpuCamera,
        tiles: &GpuTiles,
        timed: bool,
    ) -> Result<(wgpu::Buffer, Option<f64>), GpuError> {
        let device = &*self.device;
        device.check()?;
        let [first, end] = tiles.samples;
        let words: Vec<[u32; 5]> = (first..end).map(|i| camera.sampler.word(i)).collect();
        let words = device.upload("samples", bytemuck::cast_slice(&words))?;
        let bytes = (tiles.rays.max(1) * size_of::<Ray>()) as u64;
        let rays = device.buffer("rays", bytes, Usage::STORAGE | Usage::COPY_SRC)?;
        let groups: [&[&wgpu::Buffer]; 2] = [
            &[&camera.camera, &camera.tables],
            &[&tiles.tiles, &tiles.launch, &words, &rays],
        ];
        let kernel = self.kernel(camera.permutation)?;
        let launch = kernel.launch(device, &groups, tiles.workgroups);
        let seconds = launch.run(device, timed)?;
        Ok((rays, seconds))
    }

    fn kernel(&self, permutation: GeneratePermutation) -> Result<Arc<Kernel>, GpuError> {
        self.kernels.get(permutation, || {
            let groups: [&[Binding]; 2] = [
                &[Binding::Uniform, Binding::Read],
                &[
                    Binding::Read,
                    Binding::Uniform,
                    Binding::Read,
                    Binding::Write,
                ],
            ];
            let source = permutation.source();
            Kernel::new(&self.device, "generate", &source, &groups)
        })
    }
}

/// A key of a lens, as `lens.wgsl` has it.
fn lens_numbers(key: &LensKey) -> [f32; 12] {
    let ([width, height], [x, y]) = (key.half, key.offset);
    let numbers = [
        key.time,
        width,
        height,
        x,
        y,
        key.distance,
        key.focal_length,
        key.f_stop,
        key.focus_distance,
        key.exposure,
        key.radius,
        f64::from(u8::from(key.is_straight)),
    ];
    numbers.map(|x| x as f32)
}

/// The words that a camera's places are in.
#[derive(Default)]
struct Tables {
    words: Vec<u32>,
}

impl Tables {
    fn here(&self) -> u32 {
        self.words.len() as u32
    }

    fn numbers(&mut self, numbers: impl IntoIterator<Item = f32>) {
        self.words.extend(numbers.into_iter().map(f32::to_bits));
    }

    fn camera(&mut self, generator: &Generator<'_>) -> (Camera, GeneratePermutation) {
        let camera = generator.camera;
        let lens = camera.lens(0.0);
        let (rotation, place) = camera.pose(0.0);
        let column = |v: glam::Vec3| v.extend(0.0).to_array();
        let top_left = lens.window.point(Vec2::ZERO);
        let seed = generator.sampler.seed();
        let mut out = Camera {
            column_x: column(rotation.x_axis),
            column_y: column(rotation.y_axis),
            column_z: column(rotation.z_axis),
            place: column(place),
            corner: top_left.to_array(),
            window_size: lens.window.size().to_array(),
            resolution: camera.resolution().map(|x| x as f32),
            clipping: camera.clipping(),
            time_window: generator.times.window(),
            seed: [seed as u32, (seed >> 32) as u32],
            digits: generator.sampler.digits(),
            orthographic: (camera.projection() == Projection::Orthographic).into(),
            lens_radius: lens.radius,
            focus_distance: lens.focus_distance,
            ..Camera::default()
        };
        self.filter(generator, &mut out);
        if generator.has_time {
            self.times(&generator.times, &mut out);
        }
        let moves = generator.has_time && camera.poses().is_moving();
        if moves {
            self.poses(camera.poses(), generator, &mut out);
        }
        out.planes = self.here();
        for (normal, offset) in camera.planes().iter() {
            self.numbers(normal.extend(offset).to_array());
            out.plane_count += 1;
        }
        let lens = match generator.has_lens {
            false => LensKind::Pinhole,
            true => self.lens(generator, &mut out),
        };
        let time = match (generator.has_time, moves) {
            (false, _) => TimeKind::Still,
            (true, false) => TimeKind::Time,
            (true, true) => TimeKind::CameraMoves,
        };
        if let Some(path) = camera.lens_path() {
            self.lens_path(path, &mut out);
        }
        let permutation = GeneratePermutation {
            net: out.digits > 0,
            lens,
            time,
            lens_changes: camera.lens_changes(),
        };
        (out, permutation)
    }

    fn filter(&mut self, generator: &Generator<'_>, out: &mut Camera) {
        let filter = &generator.filter;
        out.filter_width = filter.width();
        out.filter_weight = filter.axis_weight();
        out.filter_cells = filter.cells().len() as u32;
        out.filter_table = self.here();
        for cell in filter.cells() {
            self.numbers([cell.share, cell.start, cell.slope, cell.sign]);
        }
        out.filter_guide = self.here();
        self.words
            .extend(filter.guide().iter().copied().map(u32::from));
    }

    /// Pieces of the shutter's curve, as `time_of` of `camera.wgsl` reads them.
    fn times(&mut self, times: &Times, out: &mut Camera) {
        out.curve = self.here();
        let Some((opening, first, span)) = times.drawn() else {
            return;
        };
        out.curve_step = (span / NUMBERS) as f32;
        let [open, close] = times.window().map(f64::from);
        for corners in opening.corners().windows(2) {
            let (a, b) = (&corners[0], &corners[1]);
            let slope = (b.openness - a.openness) / (b.time - a.time);
            // The part of it that is in the window: time, openness and number of its ends.
            let end = |time: f64| {
                let passed = time - a.time;
                let share = a.share + passed * (a.openness + 0.5 * slope * passed);
                let number = (share - first) / span * NUMBERS;
                (
                    time,
                    a.openness + slope * passed,
                    number.clamp(0.0, NUMBERS),
                )
            };
            let (from, to) = (a.time.max(open), b.time.min(close));
            if from >= to {
                continue;
            }
            let (start, stop) = (end(from), end(to));
            let begin = start.2.ceil() as u32;
            let (dark, direction) = match stop.1 < start.1 {
                true => (stop, -1.0),
                false => (start, 1.0),
            };
            self.words.extend([begin, dark.2.floor() as u32]);
            let steepness = slope.abs().min(STEEPEST);
            let numbers = [dark.2.fract(), dark.0, direction, dark.1, steepness];
            self.numbers(numbers.map(|x| x as f32));
            out.curve_pieces += 1;
        }
    }

    /// Keys of the camera's path, as `posed` of `camera.wgsl` reads them.
    fn poses(&mut self, poses: &Poses, generator: &Generator<'_>, out: &mut Camera) {
        out.keys = self.here();
        let origin = generator.camera.origin();
        let poses_at = poses.poses();
        for (i, (pose, time)) in poses_at.iter().zip(poses.key_times()).enumerate() {
            let here = DVec4::from(pose.polar.rotation);
            let next = poses_at.get(i + 1).unwrap_or(pose);
            let mut to = DVec4::from(next.polar.rotation);
            // The shorter way.
            if here.dot(to) < 0.0 {
                to = -to;
            }
            let across = to - here * here.dot(to);
            let angle = across.length().atan2(here.dot(to)).clamp(0.0, FRAC_PI_2);
            self.numbers([*time as f32]);
            self.numbers(here.as_vec4().to_array());
            self.numbers(across.normalize_or_zero().as_vec4().to_array());
            self.numbers([angle as f32]);
            self.numbers(pose.polar.stretch.as_mat3().to_cols_array());
            self.numbers((pose.translation - origin).as_vec3().to_array());
            out.key_count += 1;
        }
    }

    /// A lens that changes, as `lens.wgsl` has it.
    fn lens_path(&mut self, path: &LensPath, out: &mut Camera) {
        out.lens_path = self.here();
        let framing = path.framing();
        self.numbers([framing.aspect as f32]);
        self.words.push(match framing.policy {
            WindowPolicy::MatchHorizontally => 0,
            WindowPolicy::MatchVertically => 1,
            WindowPolicy::Fit => 2,
            WindowPolicy::Crop => 3,
            WindowPolicy::DontConform => 4,
        });
        let mut keys = path.keys();
        // What is at the end goes on: no two times at the end are the same, in f32 either.
        let end = keys.last().map(|&key| LensKey { time: 2.0, ..key });
        keys.extend(end);
        for key in &keys {
            self.numbers(lens_numbers(key));
            out.lens_keys += 1;
        }
    }

    fn lens(&mut self, generator: &Generator<'_>, out: &mut Camera) -> LensKind {
        if let Some(point) = generator.lens_point {
            out.lens_offset = point;
            return LensKind::Round;
        }
        match generator.camera.aperture() {
            Aperture::Round => out.half_axes = [1.0; 2],
            Aperture::Oval(half_axes) => out.half_axes = half_axes.to_array(),
            Aperture::Blades(blades) => {
                out.blades = blades.sides.len() as u32;
                out.blade_start = blades.start;
                out.blade_sides = self.here();
                for [middle, end] in &blades.sides {
                    self.numbers([middle.x, middle.y, end.x, end.y]);
                }
                if let Some(arc) = &blades.arc {
                    let e = arc.eccentricity;
                    out.arc = [1.0 - e, e, arc.half_angle, arc.half_area].map(|x| x as f32);
                    out.arc_along = arc.along.as_vec2().to_array();
                }
                return LensKind::Blades;
            }
        }
        LensKind::Round
    }
}
