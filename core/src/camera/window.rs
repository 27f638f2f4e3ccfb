//! The film back: which part of the image plane the pixels cover.

use glam::Vec2;

use super::lens::Film;
use crate::scene::{RenderSettings, WindowPolicy};

/// A rectangle on the plane at depth 1 (perspective) or in camera space (orthographic), y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    min: Vec2,
    max: Vec2,
}

/// How a film back meets the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Framing {
    /// Width over height of the image, pixels' own shape included.
    pub aspect: f64,
    /// Which side of the film back stays.
    pub policy: WindowPolicy,
}

impl Framing {
    /// For these settings.
    pub fn new(settings: &RenderSettings) -> Self {
        let [width, height] = settings.resolution;
        let pixel_aspect = f64::from(settings.pixel_aspect);
        let usable_aspect = pixel_aspect.is_finite() && pixel_aspect > 0.0;
        Self {
            aspect: f64::from(width.max(1)) / f64::from(height.max(1))
                * if usable_aspect { pixel_aspect } else { 1.0 },
            policy: settings.window_policy,
        }
    }

    /// The film's window, conformed to the image's aspect ratio. Conforming scales about the
    /// window's centre.
    pub(super) fn window(&self, film: &Film) -> Window {
        let mut half = film.half.map(|x| x / film.distance);
        conform(&mut half, self.aspect, self.policy);
        let centre = film.offset.map(|x| x / film.distance);
        let corner = |sign: f64| {
            Vec2::new(
                (centre[0] + sign * half[0]) as f32,
                (centre[1] + sign * half[1]) as f32,
            )
        };
        Window {
            min: corner(-1.0),
            max: corner(1.0),
        }
    }
}

impl Window {
    /// Width and height.
    pub fn size(&self) -> Vec2 {
        self.max - self.min
    }

    /// Point of the window at `unit` ([0, 1], y down).
    #[inline]
    pub fn point(&self, unit: Vec2) -> Vec2 {
        Vec2::new(
            self.min.x + (self.max.x - self.min.x) * unit.x,
            self.max.y - (self.max.y - self.min.y) * unit.y,
        )
    }

    /// Inverse of [`Window::point`].
    pub fn unit(&self, point: Vec2) -> Vec2 {
        let size = self.size();
        Vec2::new(
            (point.x - self.min.x) / size.x,
            (self.max.y - point.y) / size.y,
        )
    }
}

/// Scales the half extents so that their ratio is `aspect`.
fn conform(half: &mut [f64; 2], aspect: f64, policy: WindowPolicy) {
    let wide = half[0] / half[1] > aspect;
    let keep_width = match policy {
        WindowPolicy::MatchHorizontally => true,
        WindowPolicy::MatchVertically => false,
        WindowPolicy::Fit => wide,
        WindowPolicy::Crop => !wide,
        WindowPolicy::DontConform => return,
    };
    if keep_width {
        half[1] = half[0] / aspect;
    } else {
        half[0] = half[1] * aspect;
    }
}
