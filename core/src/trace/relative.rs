//! Rays as [`relative`](crate::bvh::relative) trees see them: in a space that moves along with the object, at a time
//! of a part of the shutter.
//!
//! Slab tests are made there. Micropolygons are tested with the rays as they were, so hits keep their bits.
//!
//! **The pad of slab tests.** With the carrier `A` at the ray's time, whose translation is `d`, a ray from `o` along `r` is
//! seen from `o' = A^-1 (o - d)` along `A^-1 r`. In units of `U S`, `U = 2^-24`, where `S` is the sum of `max |o_i|`, the
//! object's radius in its own space, and the largest component of any `d`:
//!
//! - entries of `A`, interpolated in f32 over a difference of at most `w = 2 sin(d/2)`, `d` the angle between two keys, are
//!   off by at most `2 w + 1`, the matrix by three times that; with an inverse no longer than the stretch
//!   `s = 1 / cos(d/2)` that one is off by `3 s^2 (2 w + 1)`. Cofactors (sums of two products of components of rows no
//!   longer than 1) are off by 2 each, 6 together, the determinant, at least `1/s^2`, by 5, and there is a quotient:
//!   `6 s^2 + 5 s^3 + 2 s`. The product with a vector adds 3 roundings of each term: `5.2 s` a unit of its length. The
//!   sum of all is `q`;
//! - `o - d` is interpolated and subtracted: 6 an axis, 10.4 as a length. It is sqrt(3) `S` long at most. So `o'` is
//!   off by `10.4 s + sqrt(3) q`;
//! - the direction by `q` of its length, and over the distance to a hit, at most sqrt(3) `S` by `A^-1`, by
//!   `sqrt(3) s q`;
//! - rounded vertices and `t` ([`super::object_ray`]) are off by 29.6 in the mesh's space: `29.6 s` in carried space.
//!
//! The sum is `40 s + sqrt(3) (1 + s) q`, where nothing turns 40; [`carry_pad`] has room for terms of order `U^2`. What is
//! left of [`SLAB_PAD`] is in carried coordinates. What the bounds are short by comes on top ([`Relative::slack`]).

use glam::Vec3;
use hdtrapeze_simd::{Float, Mask, Part, Simd};

use super::cell_rays::CellRays;
use super::in_tree::InTree;
use super::object_ray::{ObjectRay, SLAB_PAD};
use super::packet::{All, LANES, PACKET, Rays, VECTORS, load3, most, part, slab_pad, sound_rays};
use super::queries::Queries;
use super::room::Room;
use crate::bvh::carrier::Carrier;
use crate::bvh::object::BlockTree;
use crate::bvh::relative::{Relative, Trees};
use crate::bvh::{CarriedSlabs, LinearSlabs, ObjectGeometry, U};
use crate::grid::locate_key;

/// Pad of slab tests for what a carrier's rounding may do; derived in the module's text.
fn carry_pad(carrier: &Carrier) -> f32 {
    let s = carrier.stretch();
    let q = if carrier.turns() {
        let w = 2.0 * (1.0 - 1.0 / (s * s)).max(0.0).sqrt();
        s * s * (3.0 * (2.0 * w + 1.0) + 6.0 + 5.0 * s) + (2.0 + 5.2) * s
    } else {
        0.0
    };
    let sum = 40.0 * s + 3.0f64.sqrt() * (1.0 + s) * q;
    (sum * CARRY_ROOM) as f32 * U
}

/// What [`carry_pad`] is larger by.
const CARRY_ROOM: f64 = 1.05;

/// One ray as a tree sees it, and that tree.
pub(super) enum Seen<'a> {
    Still(&'a BlockTree<CarriedSlabs>, ObjectRay),
    Moving(&'a BlockTree<LinearSlabs>, ObjectRay),
}

impl Relative {
    /// The tree to ask about a ray of the object's own space (origin, direction and time), and the ray as it sees
    /// it. None for a ray that cannot be traced.
    #[inline(never)]
    pub(super) fn see(
        &self,
        object: &ObjectGeometry,
        (origin, dir, time): (Vec3, Vec3, f32),
    ) -> Option<Seen<'_>> {
        let (o, d) = match &self.carrier {
            Some(carrier) => {
                let (k, f) = locate_key(&object.mesh().key_times, time);
                let (m, by) = carrier.at(k, f64::from(f));
                let inverse = m.inverse();
                (
                    (inverse * (origin.as_dvec3() - by)).as_vec3(),
                    (inverse * dir.as_dvec3()).as_vec3(),
                )
            }
            None => (origin, dir),
        };
        let pad = (o.abs().max_element() + self.radius) * SLAB_PAD
            + carried_pad(self, origin.abs().max_element(), object.radius());
        Some(match &self.trees {
            Trees::Still(tree) => Seen::Still(tree, ObjectRay::padded(o, d, 0.0, pad)?),
            Trees::Moving(trees) => {
                let part = usize::from(self.middle.is_some_and(|middle| time >= middle));
                let (from, length) = self.part(part);
                let time = ((time - from) / length).clamp(0.0, 1.0);
                let (tree, ray) = (&trees[part], ObjectRay::padded(o, d, time, pad)?);
                Seen::Moving(tree, ray.bowing(&tree.bowing))
            }
        })
    }
}

/// A packet as trees see it, and as micropolygons do.
pub(super) struct SeenMany {
    pub rays: [Rays; VECTORS],
    /// What slab tests of each ray are padded by.
    pub pads: All,
    pub cells: CellRays,
}

/// A packet in the space of an object that has relative trees.
pub(super) struct RelativeMany<'a> {
    pub relative: &'a Relative,
    pub object: &'a ObjectGeometry,
    pub instance: u32,
    pub rays: &'a [Rays],
    pub lanes: u64,
    pub scattered: bool,
    pub queries: &'a mut Queries,
    pub room: &'a mut Room,
}

impl<S: Simd> Part<S> for RelativeMany<'_> {
    type Output = ();
    #[inline(always)]
    fn run(self, simd: S) {
        let Self {
            relative,
            object,
            instance,
            rays,
            lanes,
            scattered,
            queries,
            room,
        } = self;
        let sound = sound_rays(simd, rays, lanes, object.radius());
        if sound == 0 {
            return;
        }
        let mut seen = SeenMany {
            rays: [Rays::NONE; VECTORS],
            pads: [[0.0; LANES]; VECTORS],
            cells: CellRays::NONE,
        };
        let key_times = &object.mesh().key_times;
        seen.cells.set(simd, rays, sound, key_times);
        let mut late = 0;
        for (v, rays) in rays.iter().enumerate().take(VECTORS) {
            let to = &mut seen.rays[v];
            *to = match &relative.carrier {
                Some(carrier) => carried(simd, carrier, rays, &seen.cells, (v, sound)),
                None => *rays,
            };
            let pad = slab_pad(simd, &load3(simd, &to.origin), relative.radius);
            let pad = match &relative.carrier {
                Some(carrier) => {
                    let known = simd.all16(object.radius() + carrier.reach());
                    let reach = most(&load3(simd, &rays.origin));
                    pad + (reach + known) * simd.all16(carry_pad(carrier))
                }
                None => pad,
            };
            seen.pads[v] = (pad + simd.all16(relative.slack)).to_array();
            if let Some(middle) = relative.middle {
                let after = simd.all16(middle).le(simd.from16(&rays.time)).bits();
                late |= u64::from(after) << (LANES * v);
            }
        }
        match &relative.trees {
            Trees::Still(blocks) => simd.apart(InTree {
                blocks,
                object,
                instance,
                rays,
                lanes: sound,
                scattered,
                seen: Some(&seen),
                queries,
                room,
            }),
            Trees::Moving(trees) => {
                let parts = [sound & !late, sound & late];
                for (part, lanes) in parts.into_iter().enumerate() {
                    if lanes == 0 {
                        continue;
                    }
                    let (from, length) = relative.part(part);
                    for (seen, rays) in seen.rays.iter_mut().zip(rays) {
                        let time = simd.from16(&rays.time) - simd.all16(from);
                        let time = time.over(simd.all16(length));
                        seen.time = time.max(simd.all16(0.0)).min(simd.all16(1.0)).to_array();
                    }
                    simd.apart(InTree {
                        blocks: &trees[part],
                        object,
                        instance,
                        rays,
                        lanes,
                        scattered,
                        seen: Some(&seen),
                        queries: &mut *queries,
                        room: &mut *room,
                    });
                }
            }
        }
    }
}

/// What slab tests are padded by on top of [`SLAB_PAD`]; see the module's text.
fn carried_pad(relative: &Relative, reach: f32, radius: f32) -> f32 {
    let carried = match &relative.carrier {
        Some(carrier) => (reach + (radius + carrier.reach())) * carry_pad(carrier),
        None => 0.0,
    };
    carried + relative.slack
}

/// Columns of the carrier at the time of each ray of a vector, whose number and sound rays of the packet are given:
/// the translation last, the others only where it turns.
#[inline(always)]
fn columns<S: Simd>(
    simd: S,
    carrier: &Carrier,
    cells: &CellRays,
    (v, sound): (usize, u64),
) -> [[S::F16; 3]; 4] {
    let fraction = simd.from16(&cells.fraction[v]);
    let mut out = [[simd.all16(0.0); 3]; 4];
    let mut left = part(sound, v);
    while left != 0 {
        let first = LANES * v + (left.trailing_zeros() as usize & (LANES - 1));
        let key = cells.key[first & (PACKET - 1)];
        let same = left & part(cells.like[first & (PACKET - 1)], v);
        left &= !same;
        let mask = simd.mask16(same);
        let (a, b) = (
            &carrier.maps()[key as usize],
            &carrier.maps()[key as usize + 1],
        );
        for c in 0..4 {
            if c < 3 && !carrier.turns() {
                continue;
            }
            for axis in 0..3 {
                let x = simd.all16(a[c][axis]);
                let x = x + simd.all16(b[c][axis] - a[c][axis]) * fraction;
                out[c][axis] = x.or(mask, out[c][axis]);
            }
        }
    }
    out
}

/// Rays of a vector as seen from the carrier.
#[inline(always)]
fn carried<S: Simd>(
    simd: S,
    carrier: &Carrier,
    rays: &Rays,
    cells: &CellRays,
    which: (usize, u64),
) -> Rays {
    let mut out = *rays;
    let [a, b, c, by] = columns(simd, carrier, cells, which);
    for (origin, by) in out.origin.iter_mut().zip(by) {
        *origin = (simd.from16(origin) - by).to_array();
    }
    if !carrier.turns() {
        return out;
    }
    // Rows of the inverse are cross products of columns over the determinant.
    let rows = [cross::<S>(b, c), cross::<S>(c, a), cross::<S>(a, b)];
    let det = a[0] * rows[0][0] + a[1] * rows[0][1] + a[2] * rows[0][2];
    let inverse = simd.all16(1.0).over(det);
    for v in [&mut out.origin, &mut out.dir] {
        let [x, y, z] = [simd.from16(&v[0]), simd.from16(&v[1]), simd.from16(&v[2])];
        for (to, row) in v.iter_mut().zip(&rows) {
            *to = ((row[0] * x + row[1] * y + row[2] * z) * inverse).to_array();
        }
    }
    out
}

#[inline(always)]
fn cross<S: Simd>(a: [S::F16; 3], b: [S::F16; 3]) -> [S::F16; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}
