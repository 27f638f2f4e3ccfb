//! Sides of surfaces: which way the lattices of a set face, and which side rays pass through.
//!
//! A lattice's front is where its `dP/du x dP/dv` points, in the space that it was diced in. Matrices of
//! instances leave it in front, also where they mirror: rays are carried into the lattice's own space.
//! Vertices that were placed in the world before dicing are another matter: a matrix that mirrors turns
//! the lattice's front to the back of what was authored, and one that passes through a mirror while the
//! shutter is open does so at some times only. [`Winding`] knows.

use std::sync::Arc;

use glam::DMat3;

use crate::grid::locate_key;

/// A side of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Where normals point.
    Front,
    /// The other.
    Back,
}

impl Side {
    /// The other side.
    pub fn other(self) -> Self {
        match self {
            Side::Front => Side::Back,
            Side::Back => Side::Front,
        }
    }
}

/// Whether the authored front is the lattices' front.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Winding {
    /// It is.
    #[default]
    Same,
    /// It is the lattices' back.
    Inverted,
    /// It is the one or the other, by the time.
    Changes(Arc<WindingPath>),
}

/// The matrices that vertices were placed by, straight between keys.
#[derive(Clone, Debug, PartialEq)]
pub struct WindingPath {
    key_times: Vec<f32>,
    matrices: Vec<DMat3>,
    left_handed: bool,
}

impl Winding {
    /// Of lattices that no matrix has placed; left-handed ones have their outside at their back.
    pub fn of(left_handed: bool) -> Self {
        match left_handed {
            true => Self::Inverted,
            false => Self::Same,
        }
    }

    /// Of lattices whose vertices were placed by `matrices`, one for each of `key_times` (ascending in
    /// [0, 1], at least one).
    pub fn placed(left_handed: bool, key_times: &[f32], matrices: Vec<DMat3>) -> Self {
        let mirrors = |m: &DMat3| m.determinant() < 0.0;
        let first = matrices.first().is_some_and(mirrors);
        let stays = matrices.iter().all(|m| mirrors(m) == first)
            && matrices.windows(2).all(|w| keeps_sign(&w[0], &w[1]));
        if stays {
            return Self::of(first != left_handed);
        }
        Self::Changes(Arc::new(WindingPath {
            key_times: key_times.to_vec(),
            matrices,
            left_handed,
        }))
    }

    /// True where the authored front is the lattices' back at a time in [0, 1].
    #[inline]
    pub fn is_inverted(&self, time: f32) -> bool {
        match self {
            Self::Same => false,
            Self::Inverted => true,
            Self::Changes(path) => path.is_inverted(time),
        }
    }
}

impl WindingPath {
    fn is_inverted(&self, time: f32) -> bool {
        let (k, f) = locate_key(&self.key_times, time);
        let a = self.matrices[k];
        let m = match self.matrices.get(k + 1) {
            Some(b) => a + (*b - a) * f64::from(f),
            None => a,
        };
        (m.determinant() < 0.0) != self.left_handed
    }
}

/// True where the determinant surely has one sign all the way from `a` to `b`. It is a cubic, which
/// lies between the least and the largest of its Bernstein coefficients.
fn keeps_sign(a: &DMat3, b: &DMat3) -> bool {
    let at = |f: f64| (*a + (*b - *a) * f).determinant();
    let [d0, d1, d2, d3] = [0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0].map(at);
    let inner = [
        (-5.0 * d0 + 18.0 * d1 - 9.0 * d2 + 2.0 * d3) / 6.0,
        (2.0 * d0 - 9.0 * d1 + 18.0 * d2 - 5.0 * d3) / 6.0,
    ];
    let all = [d0, inner[0], inner[1], d3];
    all.iter().all(|d| *d > 0.0) || all.iter().all(|d| *d < 0.0)
}

/// The side of a set's surfaces that rays pass through.
#[derive(Clone, Debug, PartialEq)]
pub struct Culled {
    /// Of the authored surface.
    pub side: Side,
    /// How the lattices lie to it.
    pub winding: Winding,
}

impl Culled {
    /// That side of the lattices; nothing where it is the one or the other, by the time.
    pub fn always(&self) -> Option<Side> {
        match self.winding {
            Winding::Same => Some(self.side),
            Winding::Inverted => Some(self.side.other()),
            Winding::Changes(_) => None,
        }
    }

    /// That side of the lattices, at a time in [0, 1].
    #[inline]
    pub(super) fn of_lattices(&self, time: f32) -> Side {
        match self.winding.is_inverted(time) {
            true => self.side.other(),
            false => self.side,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn scale(x: f64, y: f64, z: f64) -> DMat3 {
        DMat3::from_diagonal(DVec3::new(x, y, z))
    }

    #[test]
    fn one_mirror_turns_the_front_and_two_do_not() {
        let at = |left, m| Winding::placed(left, &[0.0], vec![m]);
        assert_eq!(at(false, scale(1.0, 2.0, 3.0)), Winding::Same);
        assert_eq!(at(false, scale(-1.0, 2.0, 3.0)), Winding::Inverted);
        assert_eq!(at(false, scale(-1.0, -2.0, 3.0)), Winding::Same);
        assert_eq!(at(true, scale(-1.0, -2.0, -3.0)), Winding::Same);
        assert_eq!(at(true, scale(1.0, 1.0, 1.0)), Winding::Inverted);
    }

    #[test]
    fn paths_that_pass_through_a_mirror_change() {
        let path = |a, b| Winding::placed(false, &[0.0, 1.0], vec![a, b]);
        let through = path(scale(1.0, 1.0, 1.0), scale(-3.0, 1.0, 1.0));
        for (time, inverted) in [(0.0, false), (0.24, false), (0.26, true), (1.0, true)] {
            assert_eq!(through.is_inverted(time), inverted, "{time}");
        }
        // Both ends are unmirrored; between thirds of the way it is not.
        let dips = path(scale(1.0, 0.5, 1.0), scale(-0.5, -1.0, 1.0));
        for (time, inverted) in [(0.0, false), (0.5, true), (1.0, false)] {
            assert_eq!(dips.is_inverted(time), inverted, "{time}");
        }
        let quarter = DMat3::from_rotation_y(1.5);
        assert_eq!(path(DMat3::IDENTITY, quarter), Winding::Same);
        assert_eq!(
            path(scale(-1.0, 1.0, 1.0), scale(-2.0, 1.0, 1.0)),
            Winding::Inverted
        );
    }
}
