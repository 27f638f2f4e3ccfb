//! Rays of a packet as micropolygons see them: sheared, at a place between two keys.

use hdtrapeze_simd::{Float, Mask, Part, Simd};

use super::cell::CellRay;
use super::packet::{All, LANES, Lanes, PACKET, Rays, VECTORS, WHOLE, load3, part, split};

/// Rays prepared for the micropolygons of one mesh; see [`CellRay`].
pub struct CellRays {
    /// Those that agree with each ray on axes and key: they are tested together.
    pub like: [u64; PACKET],
    /// Axis that is z in each ray's sheared space.
    pub z_axis: [u8; PACKET],
    /// Segment of keys.
    pub key: [u32; PACKET],
    /// Fraction inside the segment of keys.
    pub fraction: All,
    /// Each ray's numbers.
    pub rays: [CellLanes; PACKET],
}

/// What micropolygons ask of a ray: its origin mirrored, in the order of its axes, and the fraction inside its segment of keys; then
/// `dir[x] / dir[z]` and `dir[y] / dir[z]` in these axes, `dir[z]`, and a number without meaning.
pub type CellLanes = [f32; 8];

impl CellRays {
    /// Nothing.
    pub const NONE: CellRays = CellRays {
        like: [0; PACKET],
        z_axis: [0; PACKET],
        key: [0; PACKET],
        fraction: [[0.0; LANES]; VECTORS],
        rays: [[0.0; 8]; PACKET],
    };

    /// What must not be read.
    pub(super) const SPOILED: CellRays = CellRays {
        like: [u64::MAX; PACKET],
        z_axis: [u8::MAX; PACKET],
        key: [u32::MAX; PACKET],
        fraction: [[f32::NAN; LANES]; VECTORS],
        rays: [[f32::NAN; 8]; PACKET],
    };

    /// Prepares the rays `sound`, of which there is one or more. Of others nothing is said.
    #[inline(always)]
    pub fn set<S: Simd>(&mut self, simd: S, rays: &[Rays], sound: u64, key_times: &[f32]) {
        simd.apart(SetCells {
            cells: self,
            rays,
            sound,
            key_times,
        });
    }

    #[inline(always)]
    fn prepare<S: Simd>(&mut self, simd: S, rays: &[Rays], sound: u64, key_times: &[f32]) {
        let out = self;
        let mut agree = true;
        out.like = [sound; PACKET];
        out.key = [0; PACKET];
        let mut sheared = [Sheared::default(); VECTORS];
        let (v, lane) = split(sound.trailing_zeros() as usize);
        let Some(first) = rays.get(v) else {
            return;
        };
        let axes = CellRay::axes_of(first.dir_of(lane));
        out.z_axis = [axes[2] as u8; PACKET];
        for (v, rays) in rays.iter().enumerate().take(VECTORS) {
            let sound = part(sound, v);
            let (x, y, z) = (
                simd.from16(&rays.dir[axes[0]]),
                simd.from16(&rays.dir[axes[1]]),
                simd.from16(&rays.dir[axes[2]]),
            );
            // The rules of `axes_of`: a component wins ties against those before it in x, y, z.
            let same = wins(z, x, axes[2] < axes[0]) & wins(z, y, axes[2] < axes[1]);
            agree &= same.bits() & sound == sound;
            sheared[v] = Sheared {
                origin: axes.map(|axis| rays.origin[axis]),
                slope: [x.over(z).to_array(), y.over(z).to_array()],
                dir_z: rays.dir[axes[2]],
            };
            if let [a, b] = key_times {
                // As `locate_key` has it.
                let (zero, one) = (simd.all16(0.0), simd.all16(1.0));
                let f = simd.from16(&rays.time) - simd.all16(*a);
                let f = f.over(simd.all16(b - a));
                out.fraction[v] = f.max(zero).min(one).to_array();
            }
        }
        if !agree {
            out.each_with_its_axes(simd, rays, &mut sheared);
        }
        let mut kinds = [[0.0; LANES]; VECTORS];
        if key_times.len() > 2 {
            for (v, rays) in rays.iter().enumerate().take(VECTORS) {
                kinds[v] = out.locate(simd, v, rays, key_times);
            }
        }
        if !agree {
            let axes = out.z_axis.iter();
            for (kind, &axis) in kinds.as_flattened_mut().iter_mut().zip(axes) {
                *kind = 4.0 * *kind + f32::from(axis);
            }
        }
        if !agree || key_times.len() > 2 {
            out.sort(simd, sound, &kinds);
        }
        let runs = out.rays.chunks_exact_mut(LANES);
        for (v, (sheared, to)) in sheared[..rays.len().min(VECTORS)]
            .iter()
            .zip(runs)
            .enumerate()
        {
            // With one key or none, fractions are what they were: nobody asks for them.
            sheared.lanes(simd, &out.fraction[v], to);
        }
    }

    /// As [`CellRay::axes_of`] and [`axes_with`](super::packet::axes_with) have it, for rays that do not agree.
    #[inline(always)]
    fn each_with_its_axes<S: Simd>(
        &mut self,
        simd: S,
        rays: &[Rays],
        sheared: &mut [Sheared; VECTORS],
    ) {
        for (v, rays) in rays.iter().enumerate().take(VECTORS) {
            let (dir, origin) = (load3(simd, &rays.dir), load3(simd, &rays.origin));
            let [x, y, z] = [dir[0].abs(), dir[1].abs(), dir[2].abs()];
            let (along_x, along_y) = (y.le(x) & z.le(x), z.le(y));
            let turned = |[x, y, z]: [S::F16; 3]| {
                [
                    y.or(along_x, z.or(along_y, x)),
                    z.or(along_x, x.or(along_y, y)),
                    x.or(along_x, y.or(along_y, z)),
                ]
            };
            let (dir, origin) = (turned(dir), turned(origin));
            sheared[v] = Sheared {
                origin: origin.map(S::F16::to_array),
                slope: [dir[0].over(dir[2]), dir[1].over(dir[2])].map(S::F16::to_array),
                dir_z: dir[2].to_array(),
            };
            let (along_x, along_y) = (along_x.bits(), along_y.bits());
            for (lane, z_axis) in self.z_axis[LANES * v..].iter_mut().take(LANES).enumerate() {
                let is = |along: u32| along >> lane & 1 == 1;
                *z_axis = match (is(along_x), is(along_y)) {
                    (true, _) => 0,
                    (false, true) => 1,
                    (false, false) => 2,
                };
            }
        }
    }

    /// Segments of keys, and fractions inside them: as `locate_key` has it. Gives the segments.
    #[inline(always)]
    fn locate<S: Simd>(&mut self, simd: S, v: usize, rays: &Rays, key_times: &[f32]) -> Lanes {
        let (zero, one) = (simd.all16(0.0), simd.all16(1.0));
        let time = simd.from16(&rays.time);
        let (mut from, mut to) = (simd.all16(key_times[0]), simd.all16(key_times[1]));
        let mut key = zero;
        for at in key_times[1..].windows(2) {
            let after = simd.all16(at[0]).le(time);
            from = simd.all16(at[0]).or(after, from);
            to = simd.all16(at[1]).or(after, to);
            key = key + one.or(after, zero);
        }
        let fraction = (time - from).over(to - from);
        self.fraction[v] = fraction.max(zero).min(one).to_array();
        let whole = (key + simd.all16(WHOLE)).to_array();
        for (to, whole) in self.key.as_chunks_mut::<LANES>().0[v].iter_mut().zip(whole) {
            *to = whole.to_bits() - WHOLE.to_bits();
        }
        key.to_array()
    }

    /// Finds which of the rays `sound` agree, by numbers which are the same for those that do.
    #[inline(always)]
    fn sort<S: Simd>(&mut self, simd: S, sound: u64, kinds: &All) {
        let mut rest = sound;
        while rest != 0 {
            let (v, lane) = split(rest.trailing_zeros() as usize);
            let kind = simd.all16(kinds[v][lane]);
            let mut like = 0;
            for (v, kinds) in kinds.iter().enumerate() {
                let kinds = simd.from16(kinds);
                let same = kinds.le(kind) & kind.le(kinds);
                like |= u64::from(same.bits()) << (LANES * v);
            }
            like &= rest;
            if like == sound {
                // As they are taken to be.
                return;
            }
            rest &= !like;
            // Those of one kind follow each other, most often: times in order.
            let (from, behind) = (like.trailing_zeros(), like.leading_zeros());
            let run = u64::MAX << from & u64::MAX >> behind;
            if sound & run == like {
                self.like[from as usize..PACKET - behind as usize].fill(like);
                continue;
            }
            let mut left = like;
            while left != 0 {
                self.like[left.trailing_zeros() as usize & (PACKET - 1)] = like;
                left &= left - 1;
            }
        }
    }
}

/// Rays of a vector, as they are sheared.
#[derive(Clone, Copy, Default)]
struct Sheared {
    origin: [Lanes; 3],
    slope: [Lanes; 2],
    dir_z: Lanes,
}

impl Sheared {
    /// Each ray's numbers.
    #[inline(always)]
    fn lanes<S: Simd>(&self, simd: S, fraction: &Lanes, to: &mut [CellLanes]) {
        let from = |lanes: &Lanes| simd.from16(lanes);
        let ([x, y, z], [slope_x, slope_y]) = (self.origin.each_ref(), self.slope.each_ref());
        let [x, y, z, fraction] = [-from(x), -from(y), -from(z), from(fraction)];
        let [slope_x, slope_y, dir_z] = [from(slope_x), from(slope_y), from(&self.dir_z)];
        // Numbers four apart, two apart and next to each other come together in turns.
        let first = [simd.zip(x, slope_x), simd.zip(z, dir_z)];
        let second = [simd.zip(y, slope_y), simd.zip(fraction, dir_z)];
        for half in 0..2 {
            let even = simd.zip(first[0][half], first[1][half]);
            let odd = simd.zip(second[0][half], second[1][half]);
            for quarter in 0..2 {
                for (i, two) in simd
                    .zip(even[quarter], odd[quarter])
                    .into_iter()
                    .enumerate()
                {
                    let at = 8 * half + 4 * quarter + 2 * i;
                    let two = two.to_array();
                    to[at..at + 2].as_flattened_mut().copy_from_slice(&two);
                }
            }
        }
    }
}

/// Rays to be prepared for micropolygons.
struct SetCells<'a> {
    cells: &'a mut CellRays,
    rays: &'a [Rays],
    sound: u64,
    key_times: &'a [f32],
}

impl<S: Simd> Part<S> for SetCells<'_> {
    type Output = ();
    #[inline(always)]
    fn run(self, simd: S) {
        self.cells
            .prepare(simd, self.rays, self.sound, self.key_times);
    }
}

#[inline(always)]
fn wins<F: Float<LANES>>(of: F, other: F, first: bool) -> F::Mask {
    if first {
        other.abs().le(of.abs())
    } else {
        other.abs().lt(of.abs())
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;
    use hdtrapeze_simd::{Kernel, Level};

    use super::*;
    use crate::grid::locate_key;
    use crate::trace::random::{cube, unit};

    /// Rays that are in order of time or not, which go one way or several, all of them sound or some.
    struct Prepares;

    impl Kernel for Prepares {
        type Output = [usize; 2];
        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [usize; 2] {
            let state = &mut 5;
            let (mut whole, mut split) = (0, 0);
            for case in 0..400 {
                let count = [1, 2, 3, 9][case % 4];
                let (in_order, one_way, all) = (case & 4 != 0, case & 8 != 0, case & 16 != 0);
                let key_times: Vec<f32> = (0..count).map(|k| k as f32 / 8.0).collect();
                let mut times: Vec<f32> = (0..PACKET).map(|_| unit(state)).collect();
                if in_order {
                    times.sort_by(f32::total_cmp);
                }
                let mut rays = [Rays::NONE; VECTORS];
                let mut sound = 0u64;
                for (i, &time) in times.iter().enumerate() {
                    let dir = match one_way {
                        true => Vec3::new(0.1, 0.2, 1.0) + 0.3 * cube(state),
                        false => cube(state),
                    };
                    let rays = &mut rays[i / LANES];
                    for axis in 0..3 {
                        rays.dir[axis][i % LANES] = dir[axis];
                    }
                    rays.time[i % LANES] = time;
                    sound |= u64::from(all || unit(state) < 0.7) << i;
                }
                let mut cells = CellRays::SPOILED;
                cells.set(simd, &rays, sound, &key_times);
                let kind = |i: usize| {
                    let rays = &rays[i / LANES];
                    let (key, fraction) = locate_key(&key_times, rays.time[i % LANES]);
                    let dir = Vec3::from_array(rays.dir.map(|d| d[i % LANES]));
                    (key as u32, CellRay::axes_of(dir)[2] as u8, fraction)
                };
                let is_sound = |i: &usize| sound >> i & 1 == 1;
                for i in (0..PACKET).filter(is_sound) {
                    let (key, axis, fraction) = kind(i);
                    assert_eq!((cells.key[i], cells.z_axis[i]), (key, axis), "{case}, {i}");
                    if count > 1 {
                        assert_eq!(
                            cells.fraction[i / LANES][i % LANES],
                            fraction,
                            "{case}, {i}"
                        );
                    }
                    let agree = |&j: &usize| is_sound(&j) && (kind(j).0, kind(j).1) == (key, axis);
                    let like = (0..PACKET)
                        .filter(agree)
                        .fold(0, |like, j| like | 1u64 << j);
                    assert_eq!(cells.like[i], like, "{case}, {i}");
                    let (from, to) = (like.trailing_zeros(), like.leading_zeros());
                    let apart = (sound << to >> to >> from << from) != like;
                    *(if apart { &mut split } else { &mut whole }) += 1;
                }
            }
            [whole, split]
        }
    }

    #[test]
    fn rays_agree_with_those_that_have_their_axes_and_key() {
        for level in Level::available() {
            let [whole, split] = level.run(Prepares);
            assert!(whole > 5000 && split > 5000, "{whole}, {split}");
        }
    }
}
