//! Whole trees of any size, from below f32's normal numbers to its limits, against all cells tested one by one:
//! the same hits, to the bit, alone, in packets, for any hit, on every instruction set.

use glam::{DVec3, Vec3};
use hdtrapeze_core::bvh::block::CellRect;
use hdtrapeze_core::grid::{DicedMesh, PlanarMesh};
use hdtrapeze_core::trace::cell::CellRay;
use hdtrapeze_core::trace::object_ray::ObjectRay;
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World};
use hdtrapeze_simd::{Kernel, Level, Scalar, Simd};

use crate::trace_scenes::{Rng, combed, fur, instance, keys, mesh, object, patches, sheet, thin};

/// The nearest hit, of all cells of a mesh.
struct Exhaustive<'a>(&'a PlanarMesh, &'a Ray, f32);

impl Kernel for Exhaustive<'_> {
    type Output = Hit;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Hit {
        let Self(mesh, ray, radius) = self;
        let Some(prepared) = ObjectRay::new(ray.origin, ray.dir, ray.time, radius) else {
            return Hit::MISS;
        };
        let cells = CellRay::new(&prepared, &mesh.key_times);
        let mut best = Hit {
            t: ray.t_max,
            ..Hit::MISS
        };
        for (g, grid) in mesh.grids.iter().enumerate() {
            let (nu, nv) = (grid.nu as u8, grid.nv as u8);
            for j in (0..nv).step_by(2) {
                for i in (0..nu).step_by(4) {
                    let rect = CellRect {
                        i,
                        j,
                        w: 4.min(nu - i),
                        h: 2.min(nv - j),
                    };
                    let accept = |cell, hit: hdtrapeze_core::trace::cell::CellHit| {
                        let hit = hit.of(0, g as u32, cell);
                        if hit.t >= ray.t_min && hit.t <= ray.t_max && hit.is_before(&best) {
                            best = hit;
                        }
                    };
                    if mesh.is_moving() {
                        cells
                            .test_group::<S, true, false>(simd, mesh, g as u32, rect, None, accept);
                    } else {
                        cells.test_group::<S, false, false>(
                            simd, mesh, g as u32, rect, None, accept,
                        );
                    }
                }
            }
        }
        if best.is_hit() { best } else { Hit::MISS }
    }
}

fn scene(rng: &mut Rng) -> DicedMesh {
    let k = keys(1 + rng.below(3));
    let seed = rng.bits();
    let mut out = match rng.below(6) {
        0 => sheet(2, 9, &k),
        1 => patches(6, 7, &k, seed),
        2 => fur(20, &k, seed),
        3 => combed(30, 0.01, &k, seed),
        4 => thin(30, &k, seed),
        _ => {
            let noise: Vec<Vec3> = (0..256).map(|_| rng.cube()).collect();
            mesh(&[(5, 3), (1, 1), (2, 9)], &k, |g, u, v, t| {
                noise[(g * 91
                    + (u * 15.0) as usize * 13
                    + (v * 18.0) as usize * 7
                    + (t * 2.0) as usize)
                    % 256]
            })
        }
    };
    // Of any size, anywhere, turned any way, flat in one axis or not.
    let size = (rng.below(208) as f32 - 149.0).min(58.0);
    let by = rng.cube() * (size - rng.below(20) as f32 + 8.0).min(58.0).exp2();
    let turn = glam::Quat::from_axis_angle(rng.direction(), 6.0 * rng.unit());
    let flat = rng.below(12);
    for p in &mut out.positions {
        *p = (turn * *p).as_dvec3().as_vec3() * size.exp2();
        if flat < 3 {
            p[flat] = 0.0;
        }
        *p += by;
    }
    out
}

/// Smaller directions than this part of what coordinates are up to may miss: `t` would leave f32's range.
const LEAST: f32 = 1.0 / (1u64 << 62) as f32 / (1 << 24) as f32;

fn rays(mesh: &PlanarMesh, rng: &mut Rng) -> Vec<Ray> {
    let at = |g: usize, i: usize| mesh.position(g, rng_key(mesh), i);
    let count = 48;
    (0..count)
        .map(|n| {
            let slowest = mesh.floats().iter().fold(0.0f32, |m, x| m.max(x.abs())) * LEAST;
            let g = rng.below(mesh.grids.len());
            let target = at(g, rng.below(mesh.grids[g].vertex_count()));
            let near = at(g, rng.below(mesh.grids[g].vertex_count()));
            // Some along an axis, some with components next to nothing.
            let size = (target - at(0, 0))
                .abs()
                .max_element()
                .max(f32::MIN_POSITIVE);
            let mut from = rng.direction() * size * (rng.below(12) as f32 - 4.0).exp2();
            if n % 3 == 0 {
                from[rng.below(3)] *= [0.0, -0.0, f32::MIN_POSITIVE][rng.below(3)];
            }
            let target = target.lerp(near, 0.3 * rng.unit());
            let mut dir = -from * (rng.below(64) as f32 - 32.0).exp2();
            if n % 5 == 0 {
                dir = -from.normalize_or(Vec3::X) * (rng.below(122) as f32 - 61.0).exp2();
            }
            if dir.abs().max_element() < slowest {
                dir = -from;
            }
            Ray {
                origin: target + from,
                dir,
                time: rng.unit(),
                t_min: 0.0,
                t_max: f32::INFINITY,
            }
        })
        .collect()
}

fn rng_key(mesh: &PlanarMesh) -> usize {
    mesh.key_count() / 2
}

#[test]
fn trees_answer_as_all_cells_do() {
    let times: u64 = std::env::var("HDTRAPEZE_HUNT")
        .ok()
        .and_then(|n| n.parse().ok())
        .unwrap_or(1);
    let mut rng = Rng(40 + times);
    let mut found = 0;
    for _ in 0..60 * times {
        let object = object(scene(&mut rng));
        let place = InstanceTransform::Translation(DVec3::ZERO);
        let world = World::build(vec![instance(&object, place)], DVec3::ZERO);
        // Beyond about 2^58, sums of squares leave the range.
        if world.stats().left_out > 0 {
            continue;
        }
        let rays = rays(object.mesh(), &mut rng);
        let expected: Vec<Hit> = rays
            .iter()
            .map(|ray| Exhaustive(object.mesh(), ray, object.radius()).run(Scalar))
            .collect();
        found += expected.iter().filter(|h| h.is_hit()).count();
        for level in Level::available() {
            let world = world.clone().with_level(level);
            let mut hits = vec![Hit::MISS; rays.len()];
            world.trace_many(&rays, &mut hits, &mut TraceCounts::default());
            for ((ray, many), want) in rays.iter().zip(&hits).zip(&expected) {
                let alone = world.trace(ray, &mut TraceCounts::default());
                let any = world.occluded(ray, &mut TraceCounts::default());
                let told = || format!("{} {ray:?} radius {}", level.name(), object.radius());
                assert_eq!(alone, *want, "alone {}", told());
                assert_eq!(*many, *want, "of many {}", told());
                assert_eq!(any, want.is_hit(), "any {}", told());
            }
        }
    }
    println!("{found} hits");
    assert!(found > 500 * times as usize, "{found}");
}
