//! How long things are in raster space: pixels, at each output key of a path.
//!
//! **What the camera sees** is measured as it is projected, foreshortening included. **What it
//! cannot see** (segments wholly beyond one side of the image, or nearer than the near depth) is
//! measured by the angle under which it stands, which stays finite for geometry beside and behind
//! the camera, and counts [`OFF_SCREEN`] times as much as it would in the image, and less the farther
//! it is from the image: what surrounds the camera of a long lens costs little more than what is seen
//! of it. A segment that pierces the near depth inside the image is measured as if it stood there: such segments are
//! long, so dicing bisects them until their pieces are on one side or tiny.

use glam::{DAffine3, DVec3, Mat3, Vec2, Vec3};

/// A camera at one instant, as dicing sees it. Camera space looks down -z; depth is `-z_cam`.
#[derive(Clone, Copy, Debug)]
pub struct RasterView {
    /// World to camera.
    pub world_to_camera: DAffine3,
    /// Pixels per unit at depth 1 (perspective), or per unit (orthographic), in x and y.
    pub scale: Vec2,
    /// Raster position of the camera axis, pixels.
    pub centre: Vec2,
    /// Orthographic instead of perspective.
    pub orthographic: bool,
    /// Nearest depth used for measuring: things nearer are measured as if here. Positive.
    pub near: f32,
    /// Raster size in pixels; what lies outside is diced more coarsely. Zero or less: there is no
    /// outside.
    pub size: Vec2,
}

/// Weight of a pixel outside the image: dicing there is 8 times as coarse in each direction.
pub const OFF_SCREEN: f32 = 1.0 / 8.0;

/// What is this many diagonals of the image (halved, with its margin) away from it counts half of that.
const FALLOFF: f32 = 2.0;

/// The image is taken to reach this share of its half size further on each side...
const MARGIN_SHARE: f32 = 0.1;
/// ...and this many pixels: filters and the discs of slightly defocused points reach over the rim.
const MARGIN_PIXELS: f32 = 16.0;

/// Longest length reported, pixels: stands for overflow too.
const LONGEST: f32 = 1.0e9;

/// Half-spaces that a position lies outside of, as bits.
const BEHIND: u8 = 1 << 4;

impl RasterView {
    /// Counts the pixels from corner `window[0]` to `window[1]` as image too, where they reach
    /// beyond the margin that the image has in any case: a little overscan dices as none does.
    pub fn widen(&mut self, window: [Vec2; 2]) {
        let [min, max] = window;
        let reach = (min - self.centre).abs().max((max - self.centre).abs());
        if reach.cmpgt(self.reach() * (1.0 + MARGIN_SHARE)).any() {
            let origin = min.min(Vec2::ZERO);
            self.size = max.max(self.size) - origin;
            self.centre -= origin;
        }
    }

    /// False for a sphere (camera space) that lies wholly behind the camera, or outside of the image and
    /// its margin.
    pub fn may_show(&self, centre: DVec3, radius: f64) -> bool {
        if self.size.min_element() <= 0.0 {
            return true;
        }
        let reach = (self.reach() * (1.0 + MARGIN_SHARE) + MARGIN_PIXELS) / self.scale;
        let (reach, across) = (reach.as_dvec2(), centre.truncate().abs());
        if self.orthographic {
            return (across - reach).max_element() <= radius;
        }
        // Planes through the eye and the margin's edges.
        let inside =
            |slope: f64, across: f64| across + slope * centre.z <= radius * slope.hypot(1.0);
        centre.z <= radius && inside(reach.x, across.x) && inside(reach.y, across.y)
    }

    /// How far the image reaches from the axis, pixels; the larger of two sides.
    fn reach(&self) -> Vec2 {
        self.centre.abs().max((self.size - self.centre).abs())
    }
}

#[derive(Clone, Copy, Debug)]
struct LocalView {
    rotation: Mat3,
    translation: Vec3,
    view: RasterView,
    /// Half extents of the image about the axis with the margin, pixels; infinite where there is
    /// no outside. The larger of the two sides, so that it does not matter which way y points.
    extent: Vec2,
    /// Pixels per radian off screen.
    angular: f32,
    /// Angle from the axis to the farthest corner of the extent; a quarter turn where there is none.
    half_view: f32,
    /// Pixels from the image at which what is off screen counts half.
    falloff: f32,
}

/// A position ready to be measured from.
#[derive(Clone, Copy, Debug, Default)]
pub struct Measured {
    /// As given.
    position: Vec3,
    /// In the first view's camera space.
    p: Vec3,
    outside: u8,
}

/// Measures segments in pixels at each output key.
#[derive(Clone, Debug)]
pub struct RasterMetric {
    views: Vec<LocalView>,
    /// Further views at a key, for a camera that moves more than the path does.
    more: Vec<Vec<LocalView>>,
    uniform: f32,
}

impl RasterMetric {
    /// Measures positions that are relative to `origin` (world space): `views[k]` are the cameras
    /// that see the path at output key `k`, one or more; the largest measure counts.
    pub fn new(views: &[Vec<RasterView>], origin: DVec3) -> Self {
        let local = |views: &[RasterView]| -> Vec<LocalView> {
            views
                .iter()
                .map(|view| LocalView::new(view, origin))
                .collect()
        };
        let first = views
            .iter()
            .flat_map(|v| local(&v[..v.len().min(1)]))
            .collect();
        let more = views
            .iter()
            .map(|v| local(v.get(1..).unwrap_or_default()))
            .collect();
        Self {
            views: first,
            more,
            uniform: 0.0,
        }
    }

    /// Measures in a fixed scale, in pixels per unit, everywhere (instanced prototypes: the scale of
    /// the largest instance on screen).
    pub fn uniform(pixels_per_unit: f32) -> Self {
        Self {
            views: Vec::new(),
            more: Vec::new(),
            uniform: pixels_per_unit,
        }
    }

    /// Number of output keys that this metric knows; `None` where it measures all alike.
    pub fn key_count(&self) -> Option<usize> {
        (!self.views.is_empty()).then_some(self.views.len())
    }

    /// Raster length of the segment from `a` to `b` at output key `key`, in pixels: see the
    /// module's text. Finite, and never NaN.
    pub fn length(&self, key: usize, a: Vec3, b: Vec3) -> f32 {
        self.length_between(key, &self.measure(key, a), &self.measure(key, b))
    }

    /// Prepares a position at output key `key`, for use in several segments.
    #[inline]
    pub fn measure(&self, key: usize, p: Vec3) -> Measured {
        match self.views.get(key) {
            None => Measured {
                position: p,
                p,
                outside: 0,
            },
            Some(local) => local.measure(p),
        }
    }

    /// [`Self::length`] between prepared positions.
    #[inline]
    pub fn length_between(&self, key: usize, a: &Measured, b: &Measured) -> f32 {
        let length = match self.views.get(key) {
            None => (b.p - a.p).length() * self.uniform,
            Some(local) => self.more[key]
                .iter()
                .map(|view| view.length(&view.measure(a.position), &view.measure(b.position)))
                .fold(local.length(a, b), f32::max),
        };
        // Also where it is NaN.
        if length < LONGEST { length } else { LONGEST }
    }
}

impl LocalView {
    fn new(view: &RasterView, origin: DVec3) -> Self {
        let m = &view.world_to_camera;
        let reach = view.reach();
        let bounded = view.size.min_element() > 0.0 && reach.is_finite();
        let extent = if bounded {
            reach * (1.0 + MARGIN_SHARE) + MARGIN_PIXELS
        } else {
            Vec2::INFINITY
        };
        Self {
            rotation: m.matrix3.as_mat3(),
            translation: m.transform_point3(origin).as_vec3(),
            view: *view,
            extent,
            angular: view.scale.max_element() * if bounded { OFF_SCREEN } else { 1.0 },
            half_view: (extent / view.scale).length().atan(),
            falloff: FALLOFF * extent.length(),
        }
    }

    /// How much less what is off screen counts, `away` pixels from the image.
    fn fade(&self, away: f32) -> f32 {
        (1.0 + away.max(0.0) / self.falloff).recip()
    }

    /// Pixels from the image to a direction, round about the axis.
    fn angle_away(&self, direction: Vec3) -> f32 {
        let angle = direction.truncate().length().atan2(-direction.z);
        (angle - self.half_view) * self.view.scale.max_element()
    }

    /// Pixels from the image to a position, orthographic.
    fn distance_away(&self, p: Vec3) -> f32 {
        ((p.truncate() * self.view.scale).abs() - self.extent).max_element()
    }

    fn measure(&self, position: Vec3) -> Measured {
        let p = self.rotation * position + self.translation;
        let depth = -p.z;
        // The half-spaces are linear in p, so they hold behind the camera as well.
        let reach = if self.view.orthographic {
            self.extent
        } else {
            self.extent * depth
        };
        let q = p.truncate() * self.view.scale;
        let mut outside = 0;
        outside |= u8::from(q.x > reach.x);
        outside |= u8::from(q.x < -reach.x) << 1;
        outside |= u8::from(q.y > reach.y) << 2;
        outside |= u8::from(q.y < -reach.y) << 3;
        if !self.view.orthographic && depth < self.view.near {
            outside |= BEHIND;
        }
        Measured {
            position,
            p,
            outside,
        }
    }

    fn length(&self, a: &Measured, b: &Measured) -> f32 {
        let view = &self.view;
        let off_screen = a.outside & b.outside != 0;
        let (a, b) = (a.p, b.p);
        if view.orthographic {
            let weight = if off_screen {
                OFF_SCREEN * self.fade(self.distance_away(a).min(self.distance_away(b)))
            } else {
                1.0
            };
            return ((b - a).truncate() * view.scale).length() * weight;
        }
        if off_screen {
            let (a, b) = (direction(a), direction(b));
            let away = self.angle_away(a).min(self.angle_away(b));
            return a.cross(b).length().atan2(a.dot(b)) * self.angular * self.fade(away);
        }
        let (da, db) = (-a.z, -b.z);
        if da >= view.near && db >= view.near {
            return ((b.truncate() / db - a.truncate() / da) * view.scale).length();
        }
        (b - a).length() * view.scale.max_element() / view.near
    }
}

/// Unit direction; zero at the camera. The first division keeps squares from overflowing.
fn direction(p: Vec3) -> Vec3 {
    let largest = p.abs().max_element();
    if largest > 0.0 && largest.is_finite() {
        (p / largest).normalize()
    } else {
        Vec3::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn view() -> RasterView {
        RasterView {
            world_to_camera: DAffine3::IDENTITY,
            scale: Vec2::splat(1000.0),
            centre: Vec2::new(320.0, 240.0),
            orthographic: false,
            near: 0.1,
            size: Vec2::new(640.0, 480.0),
        }
    }

    #[test]
    fn visible_segments_are_projected() {
        let metric = RasterMetric::new(&[vec![view()]], DVec3::ZERO);
        let a = Vec3::new(0.0, 0.0, -10.0);
        let b = Vec3::new(1.0, 0.0, -10.0);
        assert!((metric.length(0, a, b) - 100.0).abs() < 1.0e-3);
        let deep = Vec3::new(0.0, 0.0, -1000.0);
        assert!(metric.length(0, a, deep) < 1.0e-3);
    }

    #[test]
    fn what_is_not_seen_is_an_angle() {
        let metric = RasterMetric::new(&[vec![view()]], DVec3::ZERO);
        // A quarter turn behind the camera: an angle, which counts less the farther it is.
        let l = metric.length(0, Vec3::new(-3.0, 0.0, 3.0), Vec3::new(7.0, 0.0, 7.0));
        assert!(l < std::f32::consts::FRAC_PI_2 * 125.0);
        let image = Vec2::new(368.0, 280.0); // half, with the margin
        let half_view = (image / 1000.0).length().atan();
        let away = 1000.0 * (0.75 * std::f32::consts::PI - half_view);
        let fade = 1.0 / (1.0 + away / (FALLOFF * image.length()));
        assert!((l - std::f32::consts::FRAC_PI_2 * 125.0 * fade).abs() < 1.0e-2);
        // To the left of the image, from before to behind the camera.
        let l = metric.length(0, Vec3::new(-5.0, 0.0, -1.0), Vec3::new(-5.0, 0.0, 1.0));
        assert!(l < 2.0 * 0.21 * 125.0);
    }

    #[test]
    fn beside_the_image_an_eighth_counts_and_far_from_it_less() {
        let mut orthographic = view();
        orthographic.orthographic = true;
        for view in [view(), orthographic] {
            let metric = RasterMetric::new(&[vec![view]], DVec3::ZERO);
            let pixels = |x: f32| {
                let a = Vec3::new(x, 0.0, -1.0);
                metric.length(0, a, a + Vec3::Y * 1.0e-3)
            };
            assert!((pixels(0.3) - 1.0).abs() < 1.0e-3);
            let [near, far] = [pixels(0.4), pixels(400.0)];
            assert!((0.1..0.125).contains(&near), "{near}");
            assert!(far < 0.25 * near, "{far}");
            // From either end.
            let (a, b) = (Vec3::new(0.5, 0.0, -1.0), Vec3::new(3.0, 0.0, 1.0));
            assert_eq!(metric.length(0, a, b), metric.length(0, b, a));
        }
    }

    #[test]
    fn lengths_are_finite() {
        let metric = RasterMetric::new(&[vec![view()]], DVec3::ZERO);
        let wild = [0.0, 1.0, -1.0, 1.0e-30, 1.0e30, f32::MAX, f32::MIN];
        for x in wild {
            for z in wild {
                for y in wild {
                    let l = metric.length(0, Vec3::new(x, y, z), Vec3::new(y, z, x));
                    assert!((0.0..=LONGEST).contains(&l), "{x} {y} {z}: {l}");
                }
            }
        }
    }
}
