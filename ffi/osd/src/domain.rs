//! From the unit squares that dicing knows to OpenSubdiv's parameterization of a face.
//!
//! * `Quad`: (u, v) = (s, t) of `Whole`.
//! * `Triangle` (Loop): corners at (0,0) (1,0) (0,1).
//! * `SubFaces` (any face but a quad in a quad scheme): sub-face `i` is a square of side 1/2 at an
//!   integer origin.

use glam::Vec2;
use hdtrapeze_core::surface::PatchDomain;

use crate::bridge::ffi;

/// OpenSubdiv's parameterization of a face.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Parameterization {
    /// One square.
    Quad,
    /// One triangle.
    Triangle,
    /// A square at each of this many corners.
    SubFaces(u32),
}

impl Parameterization {
    /// The parameterization of a face of `size` vertices.
    pub(crate) fn of_face(is_loop: bool, size: usize) -> Self {
        match (is_loop, size) {
            (true, _) => Self::Triangle,
            (false, 4) => Self::Quad,
            _ => Self::SubFaces(size as u32),
        }
    }

    /// `st` of `domain` in a unit square, quadrant or triangle of the face: the sub-face number (0
    /// for quads and triangles) and coordinates in it, for sub-faces in the unit square.
    pub(crate) fn locate(self, domain: PatchDomain, st: Vec2) -> (u32, Vec2) {
        let st = st.clamp(Vec2::ZERO, Vec2::ONE);
        match (self, domain) {
            (Self::Quad, PatchDomain::Corner(i)) => (0, quadrant(i, st)),
            (Self::Quad, _) => (0, st),
            (Self::Triangle, PatchDomain::Corner(i)) => {
                let b = triangle_corner(i, st);
                (0, Vec2::new(b[1], b[2]))
            }
            (Self::Triangle, _) => (0, Vec2::new((1.0 - st.y) * st.x, st.y)),
            (Self::SubFaces(n), PatchDomain::Corner(i)) => (i.min(n - 1), st),
            (Self::SubFaces(3), _) => triangle_sub_face(st),
            (Self::SubFaces(_), _) => (0, st),
        }
    }

    /// Appends the library's (u, v) of each `st`.
    pub(crate) fn append_uv(self, domain: PatchDomain, st: &[Vec2], uv: &mut Vec<f32>) {
        let mut origin = None;
        for &st in st {
            let (sub_face, at) = self.locate(domain, st);
            let at = match self {
                Self::SubFaces(n) => {
                    let corner = match origin {
                        Some((face, corner)) if face == sub_face => corner,
                        _ => {
                            let corner =
                                Vec2::from(ffi::sub_face_origin(n as i32, sub_face as i32));
                            origin = Some((sub_face, corner));
                            corner
                        }
                    };
                    corner + 0.5 * at
                }
                _ => at,
            };
            uv.extend_from_slice(&[at.x, at.y]);
        }
    }
}

/// The quarter of a quad at corner `i`, with `s` along the edge that leaves it.
fn quadrant(i: u32, st: Vec2) -> Vec2 {
    let (a, b) = (0.5 * st.x, 0.5 * st.y);
    match i & 3 {
        0 => Vec2::new(a, b),
        1 => Vec2::new(1.0 - b, a),
        2 => Vec2::new(1.0 - a, 1.0 - b),
        _ => Vec2::new(b, 1.0 - a),
    }
}

/// Barycentric coordinates of `st` in the bilinear sub-quad at corner `i` of a triangle.
pub(crate) fn triangle_corner(i: u32, st: Vec2) -> [f32; 3] {
    let (s, t) = (st.x, st.y);
    let i = (i % 3) as usize;
    let mut b = [0.0; 3];
    // The corner is (1,0,0) turned by i, edge middles have two halves, the centre three thirds.
    let along = s * (1.0 - t) * 0.5 + s * t / 3.0;
    let across = t * (1.0 - s) * 0.5 + s * t / 3.0;
    b[(i + 1) % 3] = along;
    b[(i + 2) % 3] = across;
    b[i] = 1.0 - along - across;
    b
}

/// A triangle of a quad scheme as one collapsed quad: the sub-face under a barycentric point, and a
/// place in it. One-to-one and continuous over the triangle.
fn triangle_sub_face(st: Vec2) -> (u32, Vec2) {
    let b = [(1.0 - st.y) * (1.0 - st.x), (1.0 - st.y) * st.x, st.y];
    let i = if b[0] >= b[1] && b[0] >= b[2] {
        0
    } else if b[1] >= b[2] {
        1
    } else {
        2
    };
    let at = Vec2::new(b[(i + 1) % 3], b[(i + 2) % 3]) / b[i];
    (i as u32, at.min(Vec2::ONE))
}
