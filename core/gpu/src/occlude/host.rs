//! The stages around `occlude` on the CPU: each reads what the device holds for it and leaves the bytes that the device would, but
//! for rounding. What stands between a stage and the next is in the layout's structs, so that the one after runs anywhere.

use glam::{DMat3, DVec3, Vec3};
use hdtrapeze_core::bvh::U;
use hdtrapeze_core::camera::concentric_disk;
use hdtrapeze_core::grid::locate_key;
use hdtrapeze_core::sample::PixelSampler;
use hdtrapeze_core::trace::parts::Placement;
use hdtrapeze_core::trace::{Hit, TraceCounts, World};
use hdtrapeze_shaders::layout::{OrderLaunch, Ray, Site};
use rayon::prelude::*;

use super::{Occlusion, PATTERN};
use crate::first::SecondaryStage;
use crate::trace::to_core;

/// Per unit of the largest coordinate, as `site.wgsl` has it: of tracing, and of the place.
const SURFACE_PAD: f64 = (2.0 * 160.0 + 16.0) * U as f64;
const MATRIX_PAD: f64 = 2.0 * 16.0 * U as f64;
const WORLD_PAD: f64 = 4.0 * U as f64;
/// Cosine of the flattest rays, as `scatter.wgsl` has it.
const FLATTEST: f32 = 1.0 / 4096.0;
/// Rays that a thread takes at once.
const CHUNK: usize = 4096;

/// The stages of secondary rays that the CPU runs.
#[derive(Clone, Copy, Debug)]
pub struct Before<'w> {
    /// Those before this one.
    pub first: SecondaryStage,
    /// What the scene on the device was made of.
    pub world: &'w World,
}

impl<'w> Before<'w> {
    /// The world where the CPU runs `stage`.
    pub(super) fn runs(self, stage: SecondaryStage) -> Option<&'w World> {
        (stage < self.first).then_some(self.world)
    }
}

/// The stage `site`: hits and sites stand by the numbers of the rays that met them.
pub fn sites(world: &World, rays: &[Ray], hits: &[Hit]) -> Vec<Site> {
    let mut sites = vec![Site::default(); hits.len()];
    for ray in rays {
        let number = ray.number as usize;
        if let (Some(to), Some(hit)) = (sites.get_mut(number), hits.get(number)) {
            *to = site(world, ray, hit).unwrap_or_default();
        }
    }
    sites
}

/// Where rays leave a hit; none where there is none, or where the surface has no normal.
fn site(world: &World, ray: &Ray, hit: &Hit) -> Option<Site> {
    let normal = world.geometric_normal(hit, ray.time)?;
    let at = world.position(hit, ray.time)?;
    if normal == Vec3::ZERO {
        return None;
    }
    let normal = match normal.dot(Vec3::from_array(ray.dir)) > 0.0 {
        true => -normal,
        false => normal,
    };
    let offset = offset(world, hit, ray.time, at, normal)? as f32;
    Some(Site {
        origin: (at + normal * offset).to_array(),
        time: ray.time,
        normal: normal.to_array(),
        offset,
    })
}

/// How far rays start off the surface: `site.wgsl` derives it.
fn offset(world: &World, hit: &Hit, time: f32, at: Vec3, normal: Vec3) -> Option<f64> {
    let mesh = world.object(hit)?.mesh();
    let (key, _) = locate_key(&mesh.key_times, time);
    let nu = usize::from(mesh.grids[hit.grid as usize].nu);
    let a = hit.cell as usize / nu * (nu + 1) + hit.cell as usize % nu;
    let corners = [a, a + 1, a + nu + 1, a + nu + 2];
    let keys = key..(key + 2).min(mesh.key_count());
    let vertices = keys.flat_map(|k| corners.map(|i| mesh.position(hit.grid as usize, k, i)));
    let size = vertices.map(longest).fold(0.0, f64::max);
    let surface = SURFACE_PAD * size;
    let far = |reach: f64| WORLD_PAD * (longest(at) + reach);
    let (matrix, reach) = match world.parts().placement(hit.instance) {
        Placement::Translated(by) => return Some(surface + far(by.abs().max_element())),
        Placement::Fixed { inverse, origin } => (inverse.inverse(), origin.abs().max_element()),
        Placement::Moving {
            key_times,
            matrices,
        } => {
            let (k, f) = locate_key(&key_times, time);
            let (from, to) = (&matrices[k], &matrices[(k + 1).min(matrices.len() - 1)]);
            let reach = from.translation.abs().max(to.translation.abs());
            let between = (to.matrix3 - from.matrix3) * f64::from(f);
            (from.matrix3 + between, reach.max_element())
        }
    };
    let (stretch, shrink) = (frobenius(&matrix), frobenius(&matrix.inverse()));
    let carried = MATRIX_PAD * shrink * stretch * stretch * size;
    // The length of M^-T n, where n has unit length and this is its direction.
    let length = 1.0 / (matrix.transpose() * normal.as_dvec3()).length();
    let offset = (surface + shrink * (carried + far(reach))) / length;
    offset.is_finite().then_some(offset)
}

fn longest(v: Vec3) -> f64 {
    f64::from(v.abs().max_element())
}

fn frobenius(m: &DMat3) -> f64 {
    let columns = [m.x_axis, m.y_axis, m.z_axis];
    columns
        .iter()
        .map(|c| c.length_squared())
        .sum::<f64>()
        .sqrt()
}

/// The stage `scatter`.
pub fn scattered(sites: &[Site], occlusion: &Occlusion) -> Vec<Ray> {
    let samples = occlusion.samples.max(1);
    let sampler = PixelSampler::new(samples, occlusion.seed);
    let of_site = |(number, site): (u32, &Site)| {
        let pattern = sampler.pixel([occlusion.first.wrapping_add(number), PATTERN]);
        let normal = Vec3::from_array(site.normal).as_dvec3();
        let ray = |i: u32| {
            let ray = Ray {
                origin: site.origin,
                t_max: -1.0,
                time: site.time,
                number: number * samples + i,
                weight: 1.0,
                ..Ray::default()
            };
            if normal == DVec3::ZERO {
                return ray;
            }
            let sample = pattern.sample(i);
            let at = concentric_disk(sample[0], sample[1]);
            let up = (1.0 - at.length_squared()).max(0.0).sqrt().max(FLATTEST);
            let dir = around(normal, at.extend(up).as_dvec3());
            Ray {
                dir: dir.as_vec3().to_array(),
                t_max: occlusion.finite_reach(),
                ..ray
            }
        };
        (0..samples).map(ray).collect::<Vec<Ray>>()
    };
    (0..).zip(sites).flat_map(of_site).collect()
}

/// A vector relative to axes of which the third is `n`, as `scatter.wgsl` has it.
fn around(n: DVec3, v: DVec3) -> DVec3 {
    let side = if n.z < 0.0 { -1.0 } else { 1.0 };
    let a = -1.0 / (side + n.z);
    let x = DVec3::new(
        1.0 + side * n.x * n.x * a,
        side * n.x * n.y * a,
        -side * n.x,
    );
    x * v.x + n.cross(x) * v.y + n * v.z
}

/// The stage `order`: the key of each ray, the lower word first.
pub fn keys(rays: &[Ray], launch: &OrderLaunch) -> Vec<[u32; 2]> {
    let cell = |x: f32, bits: u32| {
        let count = (1u32 << bits) as f32;
        (x * count).clamp(0.0, count - 1.0) as u32
    };
    let spread = |x: u32| (0..8).map(|bit| (x >> bit & 1) << (2 * bit)).sum::<u32>();
    let key = |(number, ray): (u32, &Ray)| {
        let [x, y] = unfolded(Vec3::from_array(ray.dir));
        let [x, y] = [x, y].map(|at| spread(cell(at, launch.direction_bits)));
        let run = number >> launch.run_bits;
        let key = run << (2 * launch.direction_bits) | x | y << 1;
        [
            key << launch.time_bits | cell(ray.time, launch.time_bits),
            0,
        ]
    };
    (0..).zip(rays).map(key).collect()
}

/// A direction on the unfolded octahedron, in the unit square.
fn unfolded(dir: Vec3) -> [f32; 2] {
    let size = (dir.x.abs() + dir.y.abs() + dir.z.abs()).max(1.0e-30);
    let p = dir.truncate() / size;
    let sign = |x: f32| if x < 0.0 { -1.0 } else { 1.0 };
    let at = match dir.z < 0.0 {
        true => [(1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y)],
        false => p.to_array(),
    };
    at.map(|x| 0.5 * x + 0.5)
}

/// The stage `sort`: places in the order of their keys, equal ones in the order of their numbers.
pub fn sorted(keys: &[[u32; 2]]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..keys.len() as u32).collect();
    order.sort_by_key(|&place| {
        let [low, high] = keys[place as usize];
        (high, low)
    });
    order
}

/// The stage `occlude`: bit `number % 32` of word `number / 32` tells whether the ray of this number meets anything.
pub fn occluded(world: &World, rays: &[Ray]) -> Vec<u32> {
    let mut words = vec![0; rays.len().div_ceil(32)];
    let answer = |rays: &[Ray]| {
        let asked: Vec<_> = rays.iter().map(to_core).collect();
        let mut found = vec![false; rays.len()];
        world.occluded_many(&asked, &mut found, &mut TraceCounts::default());
        found
    };
    let found: Vec<Vec<bool>> = rays.par_chunks(CHUNK).map(answer).collect();
    for (ray, found) in rays.iter().zip(found.iter().flatten()) {
        if let Some(word) = words.get_mut(ray.number as usize / 32) {
            *word |= u32::from(*found) << (ray.number % 32);
        }
    }
    words
}
