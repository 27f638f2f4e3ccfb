//! Instances: where a hit is in the world, against the box of the instance before it is widened, and against the
//! condition that pads are made for.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3, Vec3};
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::grid::locate_key;
use hdtrapeze_core::trace::instance::{CONDITION_LIMIT, INSTANCE_PAD, world_bounds};
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World};

use crate::boxes::vec3;
use crate::climb::{Genes, climb};
use crate::trace_scenes::{instance, mesh, object};

fn norm(m: &DMat3) -> f64 {
    m.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// A matrix whose numbers are f32: a scaled rotation, or anything.
fn linear(genes: &mut Genes<'_>, scale: i32) -> DMat3 {
    let spread = genes.whole(0, 12);
    let m = if genes.below(2) == 0 {
        DMat3::from_cols_array(&std::array::from_fn(|_| {
            f64::from(genes.float(scale - spread, scale))
        }))
    } else {
        let axis = vec3(genes, -3, 0).as_dvec3().normalize_or(DVec3::X);
        DMat3::from_axis_angle(axis, f64::from(genes.unit()) * 6.3) * f64::from(scale).exp2()
    };
    DMat3::from_cols_array(&m.to_cols_array().map(|x| f64::from(x as f32)))
}

/// An instance of one cell, and a ray at it.
struct Case {
    object: Arc<ObjectGeometry>,
    keys: Vec<f32>,
    matrices: Vec<DAffine3>,
    ray: Ray,
    beside: DVec3,
}

impl Case {
    fn new(genes: &mut Genes<'_>) -> Case {
        let keys: &[f32] = if genes.below(2) == 0 {
            &[0.0]
        } else {
            &[0.0, 1.0]
        };
        let (size, flat, offset) = (genes.whole(-4, 4), genes.below(4), vec3(genes, -6, 6));
        let corners: [Vec3; 8] = std::array::from_fn(|_| {
            let mut p = vec3(genes, size - 4, size);
            if flat < 3 {
                p[flat] = 0.0;
            }
            p + offset
        });
        let number = |u: f32, v: f32, t: f32| u as usize + 2 * v as usize + 4 * t as usize;
        let object = object(mesh(&[(1, 1)], keys, |_, u, v, t| corners[number(u, v, t)]));
        let (time, scale) = (genes.unit(), genes.whole(-8, 8));
        let mut key_times = vec![0.0];
        match genes.below(3) {
            0 => {}
            1 => key_times.push(1.0),
            _ => key_times.extend([genes.unit().clamp(0.01, 0.99), 1.0]),
        }
        let matrices: Vec<DAffine3> = key_times
            .iter()
            .map(|_| {
                let m = linear(genes, scale);
                DAffine3 {
                    // What is stored of a fixed one is the inverse.
                    matrix3: if key_times.len() == 1 { m.inverse() } else { m },
                    translation: vec3(genes, -6, 6).as_dvec3(),
                }
            })
            .collect();
        // At a point of a triangle, from anywhere.
        let (a, b) = (genes.unit(), genes.unit());
        let p = |i: usize| match keys.len() {
            1 => corners[i],
            _ => corners[i].lerp(corners[4 + i], time),
        };
        let target = p(0) + (p(1) - p(0)) * a.max(b) + (p(3) - p(1)) * a.min(b);
        let target = matrix_at(&key_times, &matrices, time).transform_point3(target.as_dvec3());
        let reach = genes.whole(-2, 12);
        let origin = vec3(genes, reach - 3, reach);
        let ray = Ray {
            origin,
            dir: (target - origin.as_dvec3()).as_vec3() * (genes.whole(-10, 10) as f32).exp2(),
            time,
            t_min: f32::NEG_INFINITY,
            t_max: f32::INFINITY,
        };
        let beside = vec3(genes, -6, 8).as_dvec3();
        Case {
            object,
            keys: key_times,
            matrices,
            ray,
            beside,
        }
    }

    fn transform(&self) -> InstanceTransform {
        match &self.matrices[..] {
            [m] => InstanceTransform::Static(*m),
            _ => InstanceTransform::Moving {
                key_times: self.keys.clone(),
                matrices: self.matrices.clone(),
            },
        }
    }

    /// The nearest hit on the instance alone, where no box of it is tested, and whether a world of it and of another
    /// object gives the same.
    fn hits(&self) -> (Hit, bool) {
        let one = |transform| instance(&self.object, transform);
        let other = InstanceTransform::Translation(self.beside);
        let trace =
            |list| World::build(list, DVec3::ZERO).trace(&self.ray, &mut TraceCounts::default());
        let alone = trace(vec![one(self.transform())]);
        let mut beside = trace(vec![one(other.clone())]);
        beside.instance = beside.instance.saturating_add(1);
        let nearest = if !beside.is_hit() || alone.is_hit() && alone.is_before(&beside) {
            alone
        } else {
            beside
        };
        let both = trace(vec![one(self.transform()), one(other)]);
        (
            alone,
            both == nearest || !both.is_hit() && !nearest.is_hit(),
        )
    }
}

fn matrix_at(keys: &[f32], matrices: &[DAffine3], time: f32) -> DAffine3 {
    if keys.len() == 1 {
        return matrices[0];
    }
    let (k, _) = locate_key(keys, time);
    let [t, a, b] = [time, keys[k], keys[k + 1]].map(f64::from);
    let (m, n) = (&matrices[k], &matrices[k + 1]);
    let s = (t - a) / (b - a);
    DAffine3 {
        matrix3: m.matrix3 + (n.matrix3 - m.matrix3) * s,
        translation: m.translation + (n.translation - m.translation) * s,
    }
}

#[test]
fn hits_of_instances_are_in_their_boxes() {
    let found = climb(8000, 64, 30, |genes| {
        let case = Case::new(genes);
        let (hit, same) = case.hits();
        if !same {
            return 2.0;
        }
        if !hit.is_hit() {
            return f64::NEG_INFINITY;
        }
        let m = matrix_at(&case.keys, &case.matrices, case.ray.time).matrix3;
        let condition = norm(&m) * norm(&m.inverse());
        let bounds = world_bounds(case.object.bounds(), &case.keys, &case.matrices);
        let reach = case
            .matrices
            .iter()
            .fold(bounds.max_abs().into(), |r: f64, m| {
                let linear = norm(&m.matrix3) * f64::from(case.object.radius()) * 3f64.sqrt();
                r.max(m.translation.abs().max_element()).max(linear)
            });
        let (lo, hi) = bounds.at(case.ray.time.into());
        let p = case.ray.origin.as_dvec3() + case.ray.dir.as_dvec3() * f64::from(hit.t);
        let beyond = (lo - p).max(p - hi).max_element();
        let from = f64::from(case.ray.origin.abs().max_element());
        beyond / (f64::from(INSTANCE_PAD) * condition * (from + reach))
    });
    found.check("instances", 0.003);
}

/// The widening of a box is made for a condition that holds at all times: an instance that is nearly singular somewhere
/// between its keys is widened for that.
#[test]
fn conditions_between_keys_are_bounded() {
    let object = object(mesh(&[(1, 1)], &[0.0], |_, u, v, _| Vec3::new(u, v, 0.0)));
    let found = climb(6000, 40, 31, |genes| {
        let scale = genes.whole(-3, 3);
        let matrices: Vec<DAffine3> = (0..2)
            .map(|_| DAffine3::from_mat3(linear(genes, scale)))
            .collect();
        let transform = InstanceTransform::Moving {
            key_times: vec![0.0, 1.0],
            matrices: matrices.clone(),
        };
        let world = World::build(vec![instance(&object, transform)], DVec3::ZERO);
        if world.stats().left_out > 0 {
            return f64::NEG_INFINITY;
        }
        let time = f64::from(genes.unit());
        let m = matrices[0].matrix3 + (matrices[1].matrix3 - matrices[0].matrix3) * time;
        let condition = norm(&m) * norm(&m.inverse());
        if condition < CONDITION_LIMIT {
            condition / f64::from(world.condition())
        } else {
            f64::NEG_INFINITY
        }
    });
    found.check("conditions", 0.9);
}
