//! [`QuadricSurface`]: spheres, and what turns about an axis (cylinders, cones, capsules), as limit
//! surfaces in closed form.
//!
//! Every face is a quad whose points lie on the exact surface, evaluated in f64 and rounded to f32
//! once; normals are the surface's own. Faces are laid out without poles, and so that cells of one
//! face are of about one size: a sphere is six faces that meet as a cube's do, a cap five around and
//! about its middle. Only the tip of a cone is a collapsed edge. Faces meet at one another's vertices
//! with the same parameter on both sides; rims of flat caps have a normal for either side.
//!
//! Object space, about the origin; sizes at each key, between which points move on straight lines.

mod revolved;
mod sphere;

use glam::{DVec3, Vec2};

pub use revolved::{Cap, Profile};

use super::{ChannelInfo, LimitEvaluator, LimitSamples, LimitSurface, Orientation, PatchDomain};
use crate::scene::Axis;
use revolved::Revolved;
use sphere::Sphere;

/// A point of the surface, and its outward normal.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sample {
    position: DVec3,
    normal: DVec3,
}

/// One kind of quadric at all of its keys, standing along z.
trait Quadric: Send + Sync {
    /// Four vertices of each face, counter-clockwise from outside.
    fn faces(&self) -> &[[u32; 4]];
    fn key_count(&self) -> usize;
    /// Calls `emit(key, sample)` for every key at `(s, t)` of a face.
    fn sample(&self, face: usize, s: f64, t: f64, emit: &mut dyn FnMut(usize, Sample));
    /// Least and greatest corner of a box around a face, at each key; nothing where it is not known.
    fn boxes(&self, _face: usize) -> Vec<[DVec3; 2]> {
        Vec::new()
    }
}

/// A sphere, cylinder, cone or capsule; see the module's text.
pub struct QuadricSurface {
    shape: Box<dyn Quadric>,
    /// Columns are where the x, y and z of the shape go.
    axes: [DVec3; 3],
    /// 1 or -1: where normals point.
    side: f64,
}

impl QuadricSurface {
    /// A sphere with one radius a key, 0 or more.
    pub fn sphere(radii: Vec<f64>, orientation: Orientation) -> Self {
        Self::new(Box::new(Sphere { radii }), Axis::Z, false, orientation)
    }

    /// A surface of revolution about `axis` with one profile a key. `reversed` stands it on its head
    /// (a half turn about an axis across). A profile without a top cap is a cone: its side closes at
    /// its top.
    pub fn revolved(
        profiles: Vec<Profile>,
        axis: Axis,
        reversed: bool,
        orientation: Orientation,
    ) -> Self {
        Self::new(
            Box::new(Revolved::new(profiles)),
            axis,
            reversed,
            orientation,
        )
    }

    fn new(shape: Box<dyn Quadric>, axis: Axis, reversed: bool, orientation: Orientation) -> Self {
        // Turned in a cycle, so that nothing is mirrored.
        let mut axes = match axis {
            Axis::X => [DVec3::Y, DVec3::Z, DVec3::X],
            Axis::Y => [DVec3::Z, DVec3::X, DVec3::Y],
            Axis::Z => [DVec3::X, DVec3::Y, DVec3::Z],
        };
        if reversed {
            axes[1] = -axes[1];
            axes[2] = -axes[2];
        }
        let side = match orientation {
            Orientation::RightHanded => 1.0,
            Orientation::LeftHanded => -1.0,
        };
        Self { shape, axes, side }
    }

    fn turn(&self, v: DVec3) -> DVec3 {
        self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z
    }
}

impl LimitSurface for QuadricSurface {
    fn face_count(&self) -> usize {
        self.shape.faces().len()
    }
    fn face_vertices(&self, face: u32) -> &[u32] {
        &self.shape.faces()[face as usize]
    }
    fn element(&self, _: u32) -> u32 {
        0
    }
    fn key_count(&self) -> usize {
        self.shape.key_count()
    }
    fn channels(&self) -> &[ChannelInfo] {
        &[]
    }
    fn is_polygonal(&self) -> bool {
        false
    }
    fn evaluator(&self) -> Box<dyn LimitEvaluator + '_> {
        Box::new(Evaluator {
            surface: self,
            face: 0,
        })
    }
}

struct Evaluator<'a> {
    surface: &'a QuadricSurface,
    face: usize,
}

impl LimitEvaluator for Evaluator<'_> {
    fn bind(&mut self, face: u32) {
        self.face = face as usize;
    }

    fn evaluate(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
        out: &mut LimitSamples,
    ) {
        debug_assert_eq!(domain, PatchDomain::Whole);
        let surface = self.surface;
        let n = st.len();
        let count = n * surface.key_count();
        out.positions.clear();
        out.positions.resize(count, glam::Vec3::ZERO);
        out.normals.clear();
        if with_normals {
            out.normals.resize(count, glam::Vec3::ZERO);
        }
        for (i, st) in st.iter().enumerate() {
            let [s, t] = [st.x, st.y].map(|x| f64::from(x).clamp(0.0, 1.0));
            surface.shape.sample(self.face, s, t, &mut |key, sample| {
                let at = key * n + i;
                out.positions[at] = surface.turn(sample.position).as_vec3();
                if with_normals {
                    out.normals[at] = surface.turn(sample.normal * surface.side).as_vec3();
                }
            });
        }
    }

    fn hull(&mut self, out: &mut Vec<glam::Vec3>) -> bool {
        out.clear();
        let boxes = self.surface.shape.boxes(self.face);
        for ends in &boxes {
            out.extend((0..8usize).map(|i| {
                let corner = DVec3::new(ends[i & 1].x, ends[i >> 1 & 1].y, ends[i >> 2].z);
                self.surface.turn(corner).as_vec3()
            }));
        }
        !boxes.is_empty()
    }

    fn evaluate_channel(&mut self, _: usize, _: PatchDomain, _: &[Vec2], out: &mut Vec<f32>) {
        out.clear(); // there are none
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
