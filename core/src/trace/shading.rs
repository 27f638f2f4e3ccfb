//! What shading asks about a hit: positions, normals and channels, at any time of the shutter.
//!
//! Everything is in world space relative to the world's origin. All accessors take a hit that this world
//! answered; for a miss they answer `None`.

use glam::{DVec3, Vec3};
use hdtrapeze_simd::{Kernel, Simd};

use super::world::{Numbered, World, clamp_time};
use super::{Hit, Ray};
use crate::bvh::ObjectGeometry;
use crate::grid::{Grid, PlanarMesh, lerp_position, locate_key, octahedral};

/// Weights of a cell's corners `(i,j) (i+1,j) (i+1,j+1) (i,j+1)` at a hit; one of them is 0.
pub fn corner_weights(u: f32, v: f32) -> [f32; 4] {
    if u >= v {
        [1.0 - u, u - v, v, 0.0]
    } else {
        [1.0 - v, 0.0, u, v - u]
    }
}

impl World {
    fn hit_instance(&self, hit: &Hit) -> Option<(&Numbered, usize)> {
        let known = (hit.instance as usize) < self.instance_count();
        known.then(|| self.find(hit.instance))
    }

    /// The object that was hit.
    pub fn object(&self, hit: &Hit) -> Option<&ObjectGeometry> {
        self.hit_instance(hit).map(|(set, _)| &**set.set.object())
    }

    /// The caller's number of the set of the instance that was hit.
    pub fn user(&self, hit: &Hit) -> Option<u32> {
        self.hit_instance(hit).map(|(set, _)| set.user)
    }

    /// The number of the instance that was hit among those of its set.
    pub fn number_in_set(&self, hit: &Hit) -> Option<usize> {
        self.hit_instance(hit).map(|(_, i)| i)
    }

    /// The number of the instance that was hit, as the host knows it.
    pub fn instance_id(&self, hit: &Hit) -> Option<i32> {
        self.hit_instance(hit).map(|(set, i)| set.set.id(i))
    }

    /// The authored face that was hit.
    pub fn element(&self, hit: &Hit) -> Option<u32> {
        let mesh = self.object(hit)?.mesh();
        mesh.grids.get(hit.grid as usize).map(|g| g.element)
    }

    /// The cell's corners `(i,j) (i+1,j) (i+1,j+1) (i,j+1)` at `time`.
    pub fn cell_vertices(&self, hit: &Hit, time: f32) -> Option<[Vec3; 4]> {
        let (set, i) = self.hit_instance(hit)?;
        let time = clamp_time(time);
        let p = cell_positions(set.set.object().mesh(), hit, time)?;
        let m = set.set.to_world(i, time, self.origin);
        Some(p.map(|p| m.transform_point3(p.as_dvec3()).as_vec3()))
    }

    /// Where the point that was hit is at `time`: at the ray's own time, the hit point, on the surface
    /// rather than on the ray.
    pub fn position(&self, hit: &Hit, time: f32) -> Option<Vec3> {
        let (set, i) = self.hit_instance(hit)?;
        let time = clamp_time(time);
        let p = blended(&cell_positions(set.set.object().mesh(), hit, time)?, hit);
        let m = set.set.to_world(i, time, self.origin);
        Some(m.transform_point3(p).as_vec3())
    }

    /// [`World::position`] when the shutter opens and when it closes.
    pub fn end_positions(&self, hit: &Hit) -> Option<[Vec3; 2]> {
        let (set, i) = self.hit_instance(hit)?;
        let ends = end_positions(set.set.object().mesh(), hit)?;
        let m = set.set.to_world_at_ends(i, self.origin);
        Some([0, 1].map(|end: usize| {
            let p = blended(&ends[end], hit);
            m[end].transform_point3(p).as_vec3()
        }))
    }

    /// Unit normal of the triangle that was hit, at `time`, in the direction of `dP/du x dP/dv` of the
    /// lattice (carried through mirroring transforms, so that it keeps its side). Zero for a
    /// triangle without area.
    pub fn geometric_normal(&self, hit: &Hit, time: f32) -> Option<Vec3> {
        let (set, i) = self.hit_instance(hit)?;
        let time = clamp_time(time);
        let p = cell_positions(set.set.object().mesh(), hit, time)?.map(Vec3::as_dvec3);
        let n = if hit.u >= hit.v {
            (p[1] - p[0]).cross(p[2] - p[0])
        } else {
            (p[2] - p[0]).cross(p[3] - p[0])
        };
        // Scaled first: areas of small cells must not underflow.
        let n = set.set.normal_to_world(i, time, n.normalize_or_zero());
        Some(n.normalize_or_zero().as_vec3())
    }

    /// Unit shading normal at `time`, interpolated between keys and over the cell; the geometric one
    /// where the mesh stores none, or where the stored ones cancel.
    pub fn shading_normal(&self, hit: &Hit, time: f32) -> Option<Vec3> {
        let (set, i) = self.hit_instance(hit)?;
        let mesh = set.set.object().mesh();
        let time = clamp_time(time);
        if mesh.normal_key_count == 0 {
            return self.geometric_normal(hit, time);
        }
        let corners = cell_corners(mesh, hit)?;
        let grid = hit.grid as usize;
        let (k, f) = if mesh.normal_key_count == mesh.key_count() {
            locate_key(&mesh.key_times, time)
        } else {
            (0, 0.0)
        };
        let next = (k + 1).min(mesh.normal_key_count - 1);
        let (a, b) = (mesh.grid_normals(grid, k), mesh.grid_normals(grid, next));
        let codes = [a, b].map(|codes| corners.map(|i| codes[i]));
        let n = octahedral::blended(self.level, codes, f, corner_weights(hit.u, hit.v));
        let n = set.set.normal_to_world(i, time, n.as_dvec3());
        let n = n.normalize_or_zero();
        if n == DVec3::ZERO {
            self.geometric_normal(hit, time)
        } else {
            Some(n.as_vec3())
        }
    }

    /// Says that [`World::shading_normal`] will be asked for these hits soon, each at its time, so that what it needs comes from memory
    /// meanwhile.
    pub fn expect_normals(&self, hits: impl Iterator<Item = (Hit, f32)>) {
        self.level.run(ExpectNormals { world: self, hits });
    }

    /// Writes channel `channel` at the hit to `out`, up to the channel's width or `out`'s length, and
    /// returns the number of floats written.
    pub fn channel(&self, hit: &Hit, channel: usize, out: &mut [f32]) -> Option<usize> {
        self.channel_from(hit, channel, 0, out)
    }

    /// [`World::channel`] from float `first` of the channel's values on.
    pub fn channel_from(
        &self,
        hit: &Hit,
        channel: usize,
        first: usize,
        out: &mut [f32],
    ) -> Option<usize> {
        self.blend(hit, channel, first, corner_weights(hit.u, hit.v), out)
    }

    /// [`World::channel_from`] without interpolation: the values at the cell's corner that is nearest
    /// to the hit, each having its quarter.
    pub fn channel_nearest(
        &self,
        hit: &Hit,
        channel: usize,
        first: usize,
        out: &mut [f32],
    ) -> Option<usize> {
        let nearest = match (hit.u >= 0.5, hit.v >= 0.5) {
            (false, false) => [1.0, 0.0, 0.0, 0.0],
            (true, false) => [0.0, 1.0, 0.0, 0.0],
            (true, true) => [0.0, 0.0, 1.0, 0.0],
            (false, true) => [0.0, 0.0, 0.0, 1.0],
        };
        self.blend(hit, channel, first, nearest, out)
    }

    fn blend(
        &self,
        hit: &Hit,
        channel: usize,
        start: usize,
        w: [f32; 4],
        out: &mut [f32],
    ) -> Option<usize> {
        let mesh = self.object(hit)?.mesh();
        let corners = cell_corners(mesh, hit)?;
        let first = mesh.grids.get(hit.grid as usize)?.first_vertex as usize;
        let channel = mesh.channels.get(channel)?;
        let width = channel.width.saturating_sub(start).min(out.len());
        for (c, value) in out.iter_mut().enumerate().take(width) {
            *value = 0.0;
            for i in 0..4 {
                if w[i] != 0.0 {
                    let at = (first + corners[i]) * channel.width + start + c;
                    *value += w[i] * channel.values.get(at)?;
                }
            }
        }
        Some(width)
    }

    /// The ray's point at the hit, on the ray. [`World::position`] is nearer to the surface.
    pub fn ray_point(&self, ray: &Ray, hit: &Hit) -> Vec3 {
        ray.origin + ray.dir * hit.t
    }
}

struct ExpectNormals<'w, I> {
    world: &'w World,
    hits: I,
}

impl<I: Iterator<Item = (Hit, f32)>> Kernel for ExpectNormals<'_, I> {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        for (hit, time) in self.hits {
            let Some(mesh) = self.world.object(&hit).map(ObjectGeometry::mesh) else {
                continue;
            };
            let keys = mesh.normal_key_count;
            let (Some(grid), Some(corners)) =
                (mesh.grids.get(hit.grid as usize), cell_corners(mesh, &hit))
            else {
                continue;
            };
            let n = grid.vertex_count();
            let first = grid.first_vertex as usize * keys;
            let k = match keys > 2 && keys == mesh.key_count() {
                true => locate_key(&mesh.key_times, clamp_time(time)).0,
                false => 0,
            };
            for key in k..keys.min(k + 2) {
                simd.expect(&mesh.normals, first + key * n + corners[0]);
                simd.expect(&mesh.normals, first + key * n + corners[2]);
            }
        }
    }
}

/// Vertices of the hit cell inside its grid, in corner order.
fn cell_corners(mesh: &PlanarMesh, hit: &Hit) -> Option<[usize; 4]> {
    let (grid, i, j) = cell_of(mesh, hit)?;
    let columns = usize::from(grid.nu) + 1;
    let a = j * columns + i;
    Some([a, a + 1, a + columns + 1, a + columns])
}

/// The grid, column and row of the hit cell.
fn cell_of<'a>(mesh: &'a PlanarMesh, hit: &Hit) -> Option<(&'a Grid, usize, usize)> {
    let grid = mesh.grids.get(hit.grid as usize)?;
    if hit.cell as usize >= grid.cell_count() {
        return None;
    }
    let nu = u32::from(grid.nu);
    let j = hit.cell / nu;
    Some((grid, (hit.cell - j * nu) as usize, j as usize))
}

/// Object-space corners of the hit cell at a time in [0, 1].
fn cell_positions(mesh: &PlanarMesh, hit: &Hit, time: f32) -> Option<[Vec3; 4]> {
    let (grid, i, j) = cell_of(mesh, hit)?;
    let (k, f) = locate_key(&mesh.key_times, time);
    let a = mesh.corners(grid, k, i, j);
    if !mesh.is_moving() {
        return Some(a);
    }
    Some(between(&a, &mesh.corners(grid, k + 1, i, j), f))
}

/// [`cell_positions`] at both ends of the shutter.
fn end_positions(mesh: &PlanarMesh, hit: &Hit) -> Option<[[Vec3; 4]; 2]> {
    let (grid, i, j) = cell_of(mesh, hit)?;
    let at = |k: usize| mesh.corners(grid, k, i, j);
    let start = at(0);
    Some(match mesh.key_count() {
        0 | 1 => [start, start],
        2 => [start, between(&start, &at(1), 1.0)],
        n => [start, between(&at(n - 2), &at(n - 1), 1.0)],
    })
}

fn between(a: &[Vec3; 4], b: &[Vec3; 4], f: f32) -> [Vec3; 4] {
    std::array::from_fn(|i| lerp_position(a[i], b[i], f))
}

/// The point of a cell that was hit.
#[inline]
fn blended(corners: &[Vec3; 4], hit: &Hit) -> DVec3 {
    let w = corner_weights(hit.u, hit.v);
    (0..4).fold(DVec3::ZERO, |s, i| {
        s + corners[i].as_dvec3() * f64::from(w[i])
    })
}
