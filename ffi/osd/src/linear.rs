//! Linear interpolation over a face: varying channels, linear face-varying channels, and the same
//! rule that OpenSubdiv uses (n-gons through edge middles and their centre).

use glam::Vec2;
use hdtrapeze_core::surface::PatchDomain;

use crate::domain::{Parameterization, triangle_corner};

/// Interpolates `corner(i)` (`width` floats each) of a face of `size` vertices at every `st`, and
/// appends `width` floats a sample to `out`.
pub(crate) fn interpolate<'a>(
    is_loop: bool,
    size: usize,
    width: usize,
    corner: impl Fn(usize) -> &'a [f32],
    domain: PatchDomain,
    st: &[Vec2],
    out: &mut Vec<f32>,
) {
    let param = Parameterization::of_face(is_loop, size);
    match param {
        Parameterization::Quad => {
            for &st in st {
                let at = param.locate(domain, st).1;
                bilinear(width, [corner(0), corner(1), corner(2), corner(3)], at, out);
            }
        }
        Parameterization::Triangle => {
            let [a, b, c] = [corner(0), corner(1), corner(2)];
            for &st in st {
                let w = match domain {
                    PatchDomain::Corner(i) => triangle_corner(i, st.clamp(Vec2::ZERO, Vec2::ONE)),
                    _ => {
                        let at = param.locate(domain, st).1;
                        [1.0 - at.x - at.y, at.x, at.y]
                    }
                };
                out.extend((0..width).map(|j| w[0] * a[j] + w[1] * b[j] + w[2] * c[j]));
            }
        }
        Parameterization::SubFaces(_) => {
            let mut centre = vec![0.0f32; width];
            for i in 0..size {
                for (sum, value) in centre.iter_mut().zip(corner(i)) {
                    *sum += value / size as f32;
                }
            }
            let middle = |i: usize| -> Vec<f32> {
                let (a, b) = (corner(i), corner((i + 1) % size));
                a.iter().zip(b).map(|(a, b)| 0.5 * (a + b)).collect()
            };
            let mut current = None;
            for &st in st {
                let (sub_face, at) = param.locate(domain, st);
                let i = sub_face as usize;
                if current.as_ref().is_none_or(|&(face, _, _)| face != i) {
                    current = Some((i, middle(i), middle((i + size - 1) % size)));
                }
                if let Some((_, next, previous)) = &current {
                    bilinear(width, [corner(i), next, &centre, previous], at, out);
                }
            }
        }
    }
}

fn bilinear(width: usize, p: [&[f32]; 4], at: Vec2, out: &mut Vec<f32>) {
    let (s, t) = (at.x, at.y);
    out.extend((0..width).map(|j| {
        let (low, high) = (
            p[0][j] + (p[1][j] - p[0][j]) * s,
            p[3][j] + (p[2][j] - p[3][j]) * s,
        );
        low * (1.0 - t) + high * t
    }));
}
