//! Batch ray queries in world space, for tools and tests.

use std::sync::atomic::AtomicBool;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::prepared::Prepared;
use crate::trace::{Ray, TraceCounts};

/// A ray in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldRay {
    /// Origin, scene units.
    pub origin: DVec3,
    /// Direction; need not be unit length.
    pub dir: Vec3,
    /// In [0, 1] across the shutter; clamped.
    pub time: f32,
    /// Nearest distance, in units of `dir`; below 0 is 0.
    pub t_min: f32,
    /// Farthest distance.
    pub t_max: f32,
}

/// What a ray met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WorldHit {
    /// Distance in units of `dir`; infinity for a miss.
    pub t: f32,
    /// Position in the micropolygon, see [`crate::trace::Hit`].
    pub u: f32,
    /// Position in the micropolygon.
    pub v: f32,
    /// Geometric normal, world space, unit length; zero for a miss.
    pub normal: Vec3,
    /// primId; -1 for a miss.
    pub prim_id: i32,
    /// instanceId; -1 for a miss.
    pub instance_id: i32,
    /// Authored face; -1 for a miss.
    pub element_id: i32,
    /// Grid of the object.
    pub grid: u32,
    /// Micropolygon of the grid.
    pub cell: u32,
}

impl Prepared {
    /// Traces `rays` in parallel; `hits` are overwritten. Slices of different length are traced as
    /// far as the shorter goes.
    pub fn trace_world(&self, rays: &[WorldRay], hits: &mut [WorldHit]) {
        if !self.world.has_tree() {
            self.world.make_trees(&AtomicBool::new(false));
        }
        rays.par_iter()
            .zip(hits.par_iter_mut())
            .with_min_len(256)
            .for_each(|(ray, out)| {
                *out = self.trace_one(ray);
            });
    }

    fn trace_one(&self, ray: &WorldRay) -> WorldHit {
        // Traced with a direction of unit length, so that its length does not matter to f32.
        let dir = ray.dir.as_dvec3();
        let length = dir.length();
        // NaN stays what it is, and misses.
        let scaled = |t: f32| (f64::from(if t < 0.0 { 0.0 } else { t }) * length) as f32;
        let local = Ray {
            origin: (ray.origin - self.camera.origin()).as_vec3(),
            dir: (dir / length).as_vec3(),
            time: ray.time,
            t_min: scaled(ray.t_min),
            t_max: scaled(ray.t_max),
        };
        let hit = self.world.trace(&local, &mut TraceCounts::default());
        let t = (f64::from(hit.t) / length) as f32;
        // What is too far to be told in units of a tiny direction is not there.
        if !hit.is_hit() || !t.is_finite() {
            return WorldHit {
                t: f32::INFINITY,
                u: 0.0,
                v: 0.0,
                normal: Vec3::ZERO,
                prim_id: -1,
                instance_id: -1,
                element_id: -1,
                grid: 0,
                cell: 0,
            };
        }
        let (_, prim) = self.hit_prim(&hit);
        WorldHit {
            t,
            u: hit.u,
            v: hit.v,
            normal: self
                .world
                .geometric_normal(&hit, ray.time)
                .unwrap_or(Vec3::ZERO),
            prim_id: prim.pick_id,
            instance_id: self.world.instance_id(&hit).unwrap_or(-1),
            element_id: self.world.element(&hit).map_or(-1, |e| e as i32),
            grid: hit.grid,
            cell: hit.cell,
        }
    }
}
