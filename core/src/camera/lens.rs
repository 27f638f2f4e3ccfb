//! Film back, lens and exposure over the shutter: one set of numbers, or several for rack focus and
//! zoom.
//!
//! What is authored is interpolated linearly (apertures, focal length, f-number...), and what rays
//! need (the window on the plane at depth 1, the lens' radius) is computed from that at the ray's own
//! time. A pinhole has no f-number to interpolate: towards it the radius is.

use super::window::{Framing, Window};
use super::{CameraNotes, Projection};
use crate::diagnostics::number;
use crate::motion::keys::Blend;
use crate::motion::{Shutter, Timeline};
use crate::scene::{CameraDesc, LensSample, RenderSettings};

/// Farthest plane in focus and largest lens that are used, scene units: their squares fit f32.
const LARGEST_LENGTH: f64 = 1.0e18;

/// What rays need of a lens at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// What the image shows of the plane at depth 1, or of camera space.
    pub window: Window,
    /// Radius of the round opening, scene units; 0 for a pinhole.
    pub radius: f32,
    /// Depth in focus, scene units.
    pub focus_distance: f32,
    /// Linear factor on radiance.
    pub exposure: f32,
}

/// One sample, checked: every number can be used.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Numbers {
    film: Film,
    focal_length: f64,
    /// 0 for a pinhole.
    f_stop: f64,
    focus_distance: f64,
    exposure: f64,
}

/// The film back, and its distance from the lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Film {
    pub half: [f64; 2],
    pub offset: [f64; 2],
    pub distance: f64,
}

/// A lens over the shutter.
#[derive(Clone, Debug)]
pub struct LensPath {
    framing: Framing,
    timeline: Timeline,
    samples: Vec<Numbers>,
    key_times: Vec<f64>,
}

/// What is authored of a changing lens at an instant; straight from one to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensKey {
    /// In [0, 1] across the shutter.
    pub time: f64,
    /// Half the film back's width and height.
    pub half: [f64; 2],
    /// Where its middle is.
    pub offset: [f64; 2],
    /// How far from the lens it is.
    pub distance: f64,
    /// 0 for a pinhole.
    pub focal_length: f64,
    /// 0 for a pinhole.
    pub f_stop: f64,
    /// Depth in focus, scene units.
    pub focus_distance: f64,
    /// Linear factor on radiance.
    pub exposure: f64,
    /// Of the opening, scene units.
    pub radius: f64,
    /// Up to the next key the radius goes straight: there is a pinhole at one end.
    pub is_straight: bool,
}

impl Numbers {
    fn new(
        from: &LensSample,
        projection: Projection,
        settings: &RenderSettings,
        notes: &mut CameraNotes,
    ) -> Self {
        let film = Film::new(from, projection).unwrap_or_else(|| {
            let [width, height, focal] = [
                from.horizontal_aperture,
                from.vertical_aperture,
                from.focal_length,
            ]
            .map(tenths);
            notes.push(format!(
                "apertures {width} x {height} with focal length {focal} (tenths of scene units) give \
                 no view; the default is used"
            ));
            Film::default_of(projection)
        });
        let has_focus = from.focus_distance > 0.0 && from.focus_distance < LARGEST_LENGTH;
        let mut f_stop = if settings.disable_defocus {
            0.0
        } else {
            from.f_stop
        };
        if f_stop != 0.0 {
            let radius = from.focal_length / (2.0 * f_stop);
            if !(radius > 0.0 && radius < LARGEST_LENGTH) {
                notes.push(format!(
                    "fStop {} with focal length {} (tenths of scene units) gives no lens; a pinhole \
                     is used",
                    number(f_stop),
                    tenths(from.focal_length)
                ));
                f_stop = 0.0;
            } else if !has_focus {
                notes.push(format!(
                    "fStop is {} but focusDistance is {}; with no distance in focus, a pinhole is \
                     used",
                    number(f_stop),
                    number(from.focus_distance)
                ));
                f_stop = 0.0;
            }
        }
        let mut exposure = from.exposure_scale;
        if !(exposure.is_finite() && exposure >= 0.0) {
            notes.push(format!(
                "exposure scale {} is not usable; 1 is used",
                number(exposure)
            ));
            exposure = 1.0;
        }
        Self {
            film,
            // Only a pinhole may have none.
            focal_length: if f_stop == 0.0 {
                0.0
            } else {
                from.focal_length
            },
            f_stop,
            focus_distance: if has_focus { from.focus_distance } else { 0.0 },
            exposure,
        }
    }

    fn radius(&self) -> f64 {
        if self.f_stop == 0.0 {
            0.0
        } else {
            self.focal_length / (2.0 * self.f_stop)
        }
    }

    fn lens(&self, framing: &Framing) -> Lens {
        Lens {
            window: framing.window(&self.film),
            radius: self.radius() as f32,
            focus_distance: if self.focus_distance > 0.0 {
                self.focus_distance as f32
            } else {
                1.0
            },
            exposure: self.exposure as f32,
        }
    }
}

impl Film {
    fn new(from: &LensSample, projection: Projection) -> Option<Self> {
        let distance = match projection {
            Projection::Perspective => from.focal_length,
            Projection::Orthographic => 1.0,
        };
        let sizes = [from.horizontal_aperture, from.vertical_aperture, distance];
        let offset = [
            from.horizontal_aperture_offset,
            from.vertical_aperture_offset,
        ];
        let film = Self {
            half: [sizes[0] / 2.0, sizes[1] / 2.0],
            offset,
            distance,
        };
        // Above 0, and of a size on the plane at depth 1 that f32 holds.
        let is_size = |x: f64| x > 1.0 / LARGEST_LENGTH && x < LARGEST_LENGTH;
        let usable = is_size(distance)
            && film.half.iter().all(|x| is_size(x / distance))
            && offset.iter().all(|x| (x / distance).abs() < LARGEST_LENGTH);
        usable.then_some(film)
    }

    fn default_of(projection: Projection) -> Self {
        let lens = CameraDesc::default().lens();
        let distance = match projection {
            Projection::Perspective => lens.focal_length,
            Projection::Orthographic => 1.0,
        };
        Self {
            half: [lens.horizontal_aperture / 2.0, lens.vertical_aperture / 2.0],
            offset: [0.0; 2],
            distance,
        }
    }
}

/// Resolves a camera's lens: as it is at `shutter`'s opening, and its path where it changes.
pub(super) fn resolve(
    desc: &CameraDesc,
    settings: &RenderSettings,
    shutter: Shutter,
    notes: &mut CameraNotes,
) -> (Lens, Option<LensPath>) {
    let framing = Framing::new(settings);
    let single = |notes: &mut CameraNotes| {
        let numbers = Numbers::new(&desc.lens(), desc.projection, settings, notes);
        (numbers.lens(&framing), None)
    };
    if desc.lens_samples.is_empty() {
        return single(notes);
    }
    let times: Vec<f64> = desc.lens_samples.iter().map(|s| s.time).collect();
    let Some(timeline) = Timeline::new(&times, shutter) else {
        notes.push("its lens samples have no time that is finite; they are ignored".to_owned());
        return single(notes);
    };
    let path = LensPath::new(desc, settings, framing, timeline, shutter, notes);
    let open = path.numbers(0.0);
    let is_constant = path.key_times.iter().all(|&t| path.numbers(t) == open);
    (path.at(0.0), (!is_constant).then_some(path))
}

impl LensPath {
    fn new(
        desc: &CameraDesc,
        settings: &RenderSettings,
        framing: Framing,
        timeline: Timeline,
        shutter: Shutter,
        notes: &mut CameraNotes,
    ) -> Self {
        // What is wrong with one sample is mostly wrong with all: told once.
        let mut own = CameraNotes::new();
        let numbers = |s| {
            let mut of_sample = CameraNotes::new();
            let numbers = Numbers::new(s, desc.projection, settings, &mut of_sample);
            if own.is_empty() {
                own = of_sample;
            }
            numbers
        };
        let mut samples: Vec<Numbers> = desc.lens_samples.iter().map(numbers).collect();
        notes.append(&mut own);
        // A pinhole need not say where it is in focus: it follows the lens that it becomes.
        let focus = samples.iter().map(|s| s.focus_distance).find(|&d| d > 0.0);
        for sample in samples.iter_mut().filter(|s| s.focus_distance == 0.0) {
            sample.focus_distance = focus.unwrap_or(1.0);
        }
        let key_times = timeline.key_times(shutter.is_still());
        Self {
            framing,
            timeline,
            samples,
            key_times,
        }
    }

    /// Key times of the change, in [0, 1]: between them all is linear.
    pub fn key_times(&self) -> &[f64] {
        &self.key_times
    }

    /// The lens at `time` (in [0, 1] across the shutter).
    #[inline]
    pub fn at(&self, time: f32) -> Lens {
        let Blend { a, b, f } = self.timeline.blend(f64::from(time));
        let (a, b) = (&self.samples[a], &self.samples[b]);
        let mut lens = mix(a, b, f).lens(&self.framing);
        if (a.f_stop == 0.0) != (b.f_stop == 0.0) {
            lens.radius = lerp(a.radius(), b.radius(), f) as f32;
        }
        lens
    }

    /// How it meets the image.
    pub fn framing(&self) -> &Framing {
        &self.framing
    }

    /// The lens at 0, at each sample in between, and at 1, for those that compute [`LensPath::at`] elsewhere.
    pub fn keys(&self) -> Vec<LensKey> {
        let inside = self.timeline.times().iter().copied();
        let inside = inside.filter(|&time| time > 0.0 && time < 1.0);
        let times = [0.0].into_iter().chain(inside).chain([1.0]);
        let key = |time: f64| {
            let Blend { a, b, f } = self.timeline.blend(time);
            let (a, b) = (&self.samples[a], &self.samples[b]);
            let now = mix(a, b, f);
            let is_straight = a.f_stop == 0.0 || b.f_stop == 0.0;
            LensKey {
                time,
                half: now.film.half,
                offset: now.film.offset,
                distance: now.film.distance,
                focal_length: now.focal_length,
                f_stop: now.f_stop,
                focus_distance: now.focus_distance,
                exposure: now.exposure,
                radius: match is_straight {
                    true => lerp(a.radius(), b.radius(), f),
                    false => now.radius(),
                },
                is_straight,
            }
        };
        times.map(key).collect()
    }

    fn numbers(&self, time: f64) -> Numbers {
        let Blend { a, b, f } = self.timeline.blend(time);
        mix(&self.samples[a], &self.samples[b], f)
    }
}

/// A length in the units that UsdGeomCamera has it in.
fn tenths(length: f64) -> String {
    number(length * 10.0)
}

/// Exact where both are the same.
fn lerp(a: f64, b: f64, f: f64) -> f64 {
    a + (b - a) * f
}

fn mix(a: &Numbers, b: &Numbers, f: f64) -> Numbers {
    let pair = |a: [f64; 2], b: [f64; 2]| [lerp(a[0], b[0], f), lerp(a[1], b[1], f)];
    Numbers {
        film: Film {
            half: pair(a.film.half, b.film.half),
            offset: pair(a.film.offset, b.film.offset),
            distance: lerp(a.film.distance, b.film.distance, f),
        },
        focal_length: lerp(a.focal_length, b.focal_length, f),
        f_stop: lerp(a.f_stop, b.f_stop, f),
        focus_distance: lerp(a.focus_distance, b.focus_distance, f),
        exposure: lerp(a.exposure, b.exposure, f),
    }
}
