//! Rays of a camera with a lens and a shutter, in several orders, and rays that leave what they hit.

use std::f32::consts::TAU;

use glam::Vec3;
use hdtrapeze_core::grid::{PlanarMesh, lerp_position, locate_key};
use hdtrapeze_core::trace::{Hit, Ray};

use crate::surface::Square;
use crate::trace_scenes::{Rng, ray};

/// A thin lens that looks from `eye` at `target`, in focus there.
#[derive(Clone, Debug)]
pub struct Lens {
    eye: Vec3,
    axes: [Vec3; 3],
    focus: f32,
    radius: f32,
    half_width: f32,
}

/// Pixels of a tile: a packet is one stratum of them.
const TILE: usize = 16;
/// Pixels along a block.
const BLOCK: usize = 8;
/// Pixels along a square.
const SQUARE: usize = 32;

impl Lens {
    pub fn new(eye: Vec3, target: Vec3, radius: f32, half_width: f32) -> Self {
        let forward = (target - eye).normalize();
        let right = forward.cross(Vec3::Y).normalize();
        Lens {
            eye,
            axes: [right, right.cross(forward), forward],
            focus: (target - eye).length(),
            radius,
            half_width,
        }
    }

    /// Rays of an image, the middle of a picture that is `across` pixels wide; the samples of a pixel have a stratum of the shutter
    /// each. By tiles of 4x4 pixels, and in each by strata: 16 rays in a row are neighbours in space and time.
    pub fn rays(&self, [width, height]: [usize; 2], across: usize, samples: usize) -> Vec<Ray> {
        let mut rng = Rng(42);
        let [right, up, forward] = self.axes;
        let scale = 2.0 * self.half_width * self.focus / across as f32;
        let mut rays = Vec::with_capacity(width * height * samples);
        for tile in 0..width / 4 * (height / 4) {
            for stratum in 0..samples {
                for pixel in 0..TILE {
                    let x = (tile % (width / 4) * 4 + pixel % 4) as f32 + rng.unit();
                    let y = (tile / (width / 4) * 4 + pixel / 4) as f32 + rng.unit();
                    let time = (stratum as f32 + rng.unit()) / samples as f32;
                    let (r, phi) = (rng.unit().sqrt() * self.radius, rng.unit() * TAU);
                    let lens = right * (r * phi.cos()) + up * (r * phi.sin());
                    let focus = right * ((x - width as f32 / 2.0) * scale)
                        + up * ((y - height as f32 / 2.0) * scale)
                        + forward * self.focus;
                    rays.push(ray(self.eye + lens, (focus - lens).normalize(), time));
                }
            }
        }
        rays
    }
}

/// Rays, or what belongs to each, with the samples of each pixel together.
pub fn by_pixel<T: Copy>(of_rays: &[T], samples: usize) -> Vec<T> {
    let mut out = Vec::with_capacity(of_rays.len());
    for tile in of_rays.chunks_exact(TILE * samples) {
        for pixel in 0..TILE {
            out.extend((0..samples).map(|stratum| tile[stratum * TILE + pixel]));
        }
    }
    out
}

/// Rays, or what belongs to each, by blocks of 8x8 pixels, and in each by strata: 64 rays in a row are neighbours
/// in space and time. What does not fill a block of four tiles follows by tile.
pub fn by_block<T: Copy>(of_rays: &[T], image: [usize; 2], samples: usize) -> Vec<T> {
    let mut out = Vec::with_capacity(of_rays.len());
    for y in (0..image[1]).step_by(BLOCK) {
        for x in (0..image[0]).step_by(BLOCK) {
            block(of_rays, image, samples, [x, y], &mut out);
        }
    }
    out
}

/// Adds those of the block whose first pixel is `at`.
fn block<T: Copy>(
    of_rays: &[T],
    [width, height]: [usize; 2],
    samples: usize,
    [x, y]: [usize; 2],
    out: &mut Vec<T>,
) {
    let (columns, rows) = (width / 4, height / 4);
    let (x, y) = (x / 4, y / 4);
    let tiles: Vec<&[T]> = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)]
        .into_iter()
        .filter(|&(x, y)| x < columns && y < rows)
        .map(|(x, y)| &of_rays[(y * columns + x) * TILE * samples..][..TILE * samples])
        .collect();
    for stratum in 0..samples {
        for tile in &tiles {
            out.extend_from_slice(&tile[stratum * TILE..][..TILE]);
        }
    }
}

/// Rays, or what belongs to each, by squares of 32x32 pixels, and in each by blocks, with the rays of each square.
pub fn by_square<T: Copy>(
    of_rays: &[T],
    image: [usize; 2],
    samples: usize,
) -> (Vec<T>, Vec<Square>) {
    let mut out = Vec::with_capacity(of_rays.len());
    let mut squares = Vec::new();
    for top in (0..image[1]).step_by(SQUARE) {
        for left in (0..image[0]).step_by(SQUARE) {
            let first = out.len();
            let mut blocks = Vec::new();
            for y in (top..image[1].min(top + SQUARE)).step_by(BLOCK) {
                for x in (left..image[0].min(left + SQUARE)).step_by(BLOCK) {
                    let begin = out.len() - first;
                    block(of_rays, image, samples, [x, y], &mut out);
                    blocks.push(begin..out.len() - first);
                }
            }
            squares.push(Square {
                rays: first..out.len(),
                blocks,
            });
        }
    }
    (out, squares)
}

/// One ray from each hit of some squares, one of each so many, so that they are about `count`, at a time of its own: from where
/// the point that was hit is then, into the cosine-weighted hemisphere on the side that the ray came from. A multiple of 16 of
/// them. `rays` and `hits` lie by square.
pub fn secondary(
    mesh: &PlanarMesh,
    (rays, hits): (&[Ray], &[Hit]),
    squares: &[Square],
    count: usize,
) -> Vec<Ray> {
    let mut rng = Rng(17);
    let found = hits.iter().filter(|h| h.is_hit()).count();
    let step = (found / count.max(1)).max(1);
    let mut out = Vec::with_capacity(found / step + 1);
    // Any of them: those at equal distances may all lie in one column of the image.
    let some: Vec<&Square> = squares
        .chunks(step)
        .map(|squares| &squares[rng.below(squares.len())])
        .collect();
    let hits = some.into_iter().flat_map(|square| {
        let of_square = square.rays.clone();
        rays[of_square.clone()].iter().zip(&hits[of_square])
    });
    for (r, hit) in hits.filter(|(_, hit)| hit.is_hit()) {
        let time = rng.unit();
        let (point, normal, size) = spot(mesh, hit, time);
        let normal = if normal.dot(r.dir) > 0.0 {
            -normal
        } else {
            normal
        };
        // A point on the unit sphere about the normal's tip: cosine-weighted.
        let dir = (normal + 0.999 * rng.direction()).normalize();
        out.push(ray(point + normal * (0.05 * size), dir, time));
    }
    out.truncate(out.len() / 16 * 16);
    out
}

/// Where the point of a hit is at a time, and its micropolygon's unit normal and size.
fn spot(mesh: &PlanarMesh, hit: &Hit, time: f32) -> (Vec3, Vec3, f32) {
    let g = hit.grid as usize;
    let nu = usize::from(mesh.grids[g].nu);
    let first = hit.cell as usize / nu * (nu + 1) + hit.cell as usize % nu;
    let (key, f) = locate_key(&mesh.key_times, time);
    let next = (key + 1).min(mesh.key_count() - 1);
    let at = |i: usize| lerp_position(mesh.position(g, key, i), mesh.position(g, next, i), f);
    let [p00, p10, p11, p01] = [first, first + 1, first + nu + 2, first + nu + 1].map(at);
    let (u, v) = (hit.u, hit.v);
    let point = if u >= v {
        p00 * (1.0 - u) + p10 * (u - v) + p11 * v
    } else {
        p00 * (1.0 - v) + p01 * (v - u) + p11 * u
    };
    let normal = (p11 - p00).cross(p01 - p10);
    (point, normal.normalize_or(Vec3::Z), normal.length().sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenes::Family;
    use crate::trace_scenes::{object, world_of};
    use hdtrapeze_core::trace::TraceCounts;

    #[test]
    fn rays_leave_what_was_hit_where_it_is_at_times_of_their_own() {
        for family in [Family::Sheet, Family::Patches] {
            let mesh = family.moving(0.01);
            let (object, world) = (object(mesh.clone()), world_of(mesh));
            let rays = family.lens().rays([32, 32], 32, 4);
            let trace = |r: &Ray| world.trace(r, &mut TraceCounts::default());
            let hits: Vec<Hit> = rays.iter().map(trace).collect();
            let (mut halves, mut moved) = ([0, 0], 0.0f32);
            for (r, hit) in rays.iter().zip(&hits).filter(|(_, hit)| hit.is_hit()) {
                let (point, ..) = spot(object.mesh(), hit, r.time);
                let off = (r.origin + r.dir * hit.t - point).length();
                assert!(off < 5e-6, "{}: {off}", family.name());
                halves[usize::from(hit.u < hit.v)] += 1;
                let (begin, ..) = spot(object.mesh(), hit, 0.0);
                let (end, ..) = spot(object.mesh(), hit, 1.0);
                moved = moved.max((end - begin).length());
            }
            assert!(halves[0] > 100 && halves[1] > 100, "{halves:?}");
            assert!(moved > 0.01, "{moved}");

            let all = [Square {
                rays: 0..rays.len(),
                blocks: Vec::new(),
            }];
            let leaving = secondary(object.mesh(), (&rays, &hits), &all, rays.len());
            let found = rays.iter().zip(&hits).filter(|(_, hit)| hit.is_hit());
            let mut sum = 0.0;
            for ((from, hit), r) in found.zip(&leaving) {
                assert!((0.0..1.0).contains(&r.time));
                let (point, normal, size) = spot(object.mesh(), hit, r.time);
                assert!((r.origin - point).length() < 0.051 * size + 5e-6);
                // Away from the side that was seen.
                assert!(normal.dot(r.dir) * normal.dot(from.dir) <= 1e-6);
                sum += (r.time - from.time).abs();
            }
            // A third for times that have nothing to do with each other.
            let mean = sum / leaving.len() as f32;
            assert!((mean - 1.0 / 3.0).abs() < 0.05, "{mean}");
        }
    }

    #[test]
    fn the_middle_of_a_picture_has_its_pixels() {
        let lens = Lens::new(Vec3::new(0.0, -2.0, 1.0), Vec3::ZERO, 0.0, 0.5);
        let [right, up, forward] = lens.axes;
        for (image, across) in [([32, 16], 32), ([32, 16], 64), ([8, 32], 256)] {
            let mut most = [0.0f32; 2];
            for r in lens.rays(image, across, 16) {
                for (most, axis) in most.iter_mut().zip([right, up]) {
                    *most = most.max((r.dir.dot(axis) / r.dir.dot(forward)).abs());
                }
            }
            for (most, pixels) in most.into_iter().zip(image) {
                let reach = 0.5 * pixels as f32 / across as f32;
                let share = most / reach;
                assert!(
                    (0.95..1.0001).contains(&share),
                    "{image:?} {across}: {share}"
                );
            }
        }
    }

    #[test]
    fn orders_hold_every_ray_once() {
        let rays: Vec<usize> = (0..12 * 20 * 4).collect();
        let mut by_block = by_block(&rays, [12, 20], 4);
        // A stratum of the first tile, of its neighbour, and of those below.
        let first = [0, 64, 192, 256]
            .into_iter()
            .flat_map(|tile| tile..tile + 16);
        assert!(first.eq(by_block[..64].iter().copied()));
        let mut by_pixel = by_pixel(&rays, 4);
        let (mut by_square, squares) = by_square(&rays, [12, 20], 4);
        assert_eq!(by_square, by_block, "all in one square");
        assert_eq!(squares.len(), 1);
        assert_eq!(squares[0].blocks[..2], [0..256, 256..384]);
        by_block.sort_unstable();
        by_square.sort_unstable();
        by_pixel.sort_unstable();
        assert_eq!(by_block, rays);
        assert_eq!(by_square, rays);
        assert_eq!(by_pixel, rays);
    }

    #[test]
    fn squares_hold_what_is_near() {
        let image = [72, 40];
        // The pixel of each ray, as [`Lens::rays`] has them.
        let pixels: Vec<[usize; 2]> = (0..image[0] / 4 * (image[1] / 4))
            .flat_map(|tile| {
                let first = [tile % (image[0] / 4) * 4, tile / (image[0] / 4) * 4];
                (0..4 * TILE).map(move |i| [first[0] + i % 4, first[1] + i % TILE / 4])
            })
            .collect();
        let (by_square, squares) = by_square(&pixels, image, 4);
        assert_eq!(squares.len(), 6);
        let mut end = 0;
        for (i, square) in squares.iter().enumerate() {
            assert_eq!(square.rays.start, end);
            end = square.rays.end;
            let first = [i % 3 * SQUARE, i / 3 * SQUARE];
            let own = &by_square[square.rays.clone()];
            let mut begin = 0;
            for block in &square.blocks {
                assert_eq!(block.start, begin);
                begin = block.end;
                let corner = own[block.start];
                for at in &own[block.clone()] {
                    for axis in 0..2 {
                        assert!((first[axis]..first[axis] + SQUARE).contains(&at[axis]));
                        assert!((corner[axis]..corner[axis] + BLOCK).contains(&at[axis]));
                    }
                }
            }
            assert_eq!(begin, own.len());
        }
        assert_eq!(end, pixels.len());
    }
}
