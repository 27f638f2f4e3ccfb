//! The film back: which part of the image plane the pixels cover.

use glam::Vec2;

use crate::scene::{CameraDesc, Projection, RenderSettings, WindowPolicy};

/// A rectangle on the plane at depth 1 (perspective) or in camera space (orthographic), y up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    min: Vec2,
    max: Vec2,
}

impl Window {
    /// The camera's window, conformed to the image's aspect ratio. Conforming scales about the
    /// window's centre.
    pub fn new(desc: &CameraDesc, settings: &RenderSettings) -> (Self, Option<String>) {
        let [width, height] = settings.resolution;
        let pixel_aspect = f64::from(settings.pixel_aspect);
        let usable_aspect = pixel_aspect.is_finite() && pixel_aspect > 0.0;
        let image_aspect = f64::from(width.max(1)) / f64::from(height.max(1))
            * if usable_aspect { pixel_aspect } else { 1.0 };
        let perspective = desc.projection == Projection::Perspective;
        let distance = if perspective { desc.focal_length } else { 1.0 };
        let lengths = [desc.horizontal_aperture, desc.vertical_aperture, distance];
        let offsets = [
            desc.horizontal_aperture_offset,
            desc.vertical_aperture_offset,
        ];
        let usable = lengths.iter().all(|x| x.is_finite() && *x > 0.0)
            && offsets.iter().all(|x| x.is_finite());
        if !usable {
            let fallback = CameraDesc {
                projection: desc.projection,
                ..CameraDesc::default()
            };
            let text = format!(
                "apertures {} x {} with focal length {} give no view; the default is used",
                desc.horizontal_aperture, desc.vertical_aperture, desc.focal_length
            );
            return (Self::new(&fallback, settings).0, Some(text));
        }
        let mut half = [lengths[0] / distance / 2.0, lengths[1] / distance / 2.0];
        conform(&mut half, image_aspect, settings.window_policy);
        let centre = offsets.map(|x| x / distance);
        let corner = |sign: f64| {
            Vec2::new(
                (centre[0] + sign * half[0]) as f32,
                (centre[1] + sign * half[1]) as f32,
            )
        };
        (
            Self {
                min: corner(-1.0),
                max: corner(1.0),
            },
            None,
        )
    }

    /// Width and height.
    pub fn size(&self) -> Vec2 {
        self.max - self.min
    }

    /// Point of the window at `unit` ([0, 1], y down).
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
