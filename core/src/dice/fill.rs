//! Diced meshes of known size, filled in parallel: chunks of a shape's parts first tell how many grids
//! and vertices they make, then each fills its own part of arrays that are made once. Nothing is
//! copied, and the result does not depend on the number of threads.

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use super::DiceError;
use crate::grid::{DicedMesh, Grid, GridChannel};

/// What one chunk makes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Size {
    /// Grids.
    pub grids: usize,
    /// Vertices of all of them, per key.
    pub vertices: usize,
    /// Micropolygons.
    pub cells: u64,
}

impl Size {
    /// Adds a grid.
    pub fn add(&mut self, nu: usize, nv: usize) {
        self.grids += 1;
        self.vertices += (nu + 1) * (nv + 1);
        self.cells += (nu * nv) as u64;
    }

    /// Adds up two.
    pub fn plus(self, o: Size) -> Size {
        Size {
            grids: self.grids + o.grids,
            vertices: self.vertices + o.vertices,
            cells: self.cells + o.cells,
        }
    }
}

/// What all grids of a mesh have alike.
#[derive(Clone, Debug)]
pub struct Frame<'a> {
    /// What positions are relative to.
    pub origin: DVec3,
    /// Position keys.
    pub key_times: &'a [f32],
    /// Keys of normals: 1, or as many as positions have.
    pub normal_keys: usize,
    /// Floats a vertex of each channel.
    pub channels: &'a [usize],
}

/// The part of the arrays that one chunk fills.
pub struct Part<'a> {
    grids: &'a mut [Grid],
    positions: &'a mut [Vec3],
    normals: &'a mut [u32],
    channels: Vec<&'a mut [f32]>,
    first_vertex: u32,
    keys: usize,
    normal_keys: usize,
    filled: usize,
    vertices: usize,
}

/// A grid of a part, to be filled: vertices are numbered row by row, `u` fastest.
pub struct Slot {
    /// Number of its first vertex within the part.
    first: usize,
    /// Vertices.
    count: usize,
}

impl Part<'_> {
    /// Takes the next grid. More than the chunk's [`Size`] is a mistake, and panics.
    pub fn grid(&mut self, element: u32, nu: usize, nv: usize) -> Slot {
        let slot = Slot {
            first: self.vertices,
            count: (nu + 1) * (nv + 1),
        };
        self.grids[self.filled] = Grid {
            first_vertex: self.first_vertex + slot.first as u32,
            element,
            nu: nu as u16,
            nv: nv as u16,
        };
        self.filled += 1;
        self.vertices += slot.count;
        slot
    }

    /// Writes a vertex at key `key`; the normal too, where it is stored for this key.
    #[inline]
    pub fn vertex(&mut self, slot: &Slot, key: usize, vertex: usize, p: Vec3, normal: u32) {
        self.positions[slot.first * self.keys + key * slot.count + vertex] = p;
        if key < self.normal_keys {
            self.normals[slot.first * self.normal_keys + key * slot.count + vertex] = normal;
        }
    }

    /// Writes a vertex's value of a channel.
    #[inline]
    pub fn value(&mut self, slot: &Slot, channel: usize, vertex: usize, value: &[f32]) {
        let at = (slot.first + vertex) * value.len();
        self.channels[channel][at..at + value.len()].copy_from_slice(value);
    }
}

/// Makes a mesh of chunks with the given sizes; `fill` is called for each, from several threads.
///
/// # Errors
/// Not enough memory, or more vertices than 32-bit numbers can tell apart.
pub fn fill(
    frame: &Frame<'_>,
    sizes: &[Size],
    fill: impl Fn(usize, &mut Part<'_>) + Sync,
) -> Result<DicedMesh, DiceError> {
    let total = sizes.iter().fold(Size::default(), |a, &b| a.plus(b));
    if u32::try_from(total.vertices).is_err() || u32::try_from(total.grids).is_err() {
        return Err(DiceError::TooLarge);
    }
    let keys = frame.key_times.len();
    let empty = Grid {
        first_vertex: 0,
        element: 0,
        nu: 1,
        nv: 1,
    };
    let mut mesh = DicedMesh {
        origin: frame.origin,
        key_times: frame.key_times.to_vec(),
        grids: filled(total.grids, empty)?,
        vertex_count: total.vertices,
        positions: Vec::new(),
        normal_key_count: frame.normal_keys,
        normals: filled(total.vertices * frame.normal_keys, 0)?,
        channels: Vec::with_capacity(frame.channels.len()),
    };
    mesh.reserve_positions(total.vertices)?;
    mesh.positions.resize(total.vertices * keys, Vec3::ZERO);
    for &width in frame.channels {
        let values = filled(total.vertices * width, 0.0)?;
        mesh.channels.push(GridChannel { width, values });
    }

    let mut parts = Vec::with_capacity(sizes.len());
    let (mut grids, mut positions) = (&mut mesh.grids[..], &mut mesh.positions[..]);
    let mut normals = &mut mesh.normals[..];
    let mut channels: Vec<&mut [f32]> = mesh
        .channels
        .iter_mut()
        .map(|c| &mut c.values[..])
        .collect();
    let mut first_vertex = 0;
    for (chunk, size) in sizes.iter().enumerate() {
        let n = size.vertices;
        let part = Part {
            grids: split(&mut grids, size.grids),
            positions: split(&mut positions, n * keys),
            normals: split(&mut normals, n * frame.normal_keys),
            channels: channels
                .iter_mut()
                .zip(frame.channels)
                .map(|(rest, width)| split(rest, n * width))
                .collect(),
            first_vertex,
            keys,
            normal_keys: frame.normal_keys,
            filled: 0,
            vertices: 0,
        };
        parts.push((chunk, part));
        first_vertex += n as u32;
    }
    parts
        .into_par_iter()
        .for_each(|(chunk, mut part)| fill(chunk, &mut part));
    Ok(mesh)
}

/// The first `count` elements of a slice, which becomes the rest.
fn split<'a, T>(rest: &mut &'a mut [T], count: usize) -> &'a mut [T] {
    let (first, others) = std::mem::take(rest).split_at_mut(count);
    *rest = others;
    first
}

fn filled<T: Clone>(count: usize, value: T) -> Result<Vec<T>, DiceError> {
    let mut v = Vec::new();
    v.try_reserve_exact(count)?;
    hdtrapeze_pages::expect_large(&mut v);
    v.resize(count, value);
    Ok(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chunks_land_where_their_sizes_say() {
        let mut sizes = [Size::default(); 3];
        sizes[0].add(1, 1);
        sizes[0].add(2, 1);
        sizes[2].add(1, 2);
        let frame = Frame {
            origin: DVec3::ONE,
            key_times: &[0.0, 1.0],
            normal_keys: 1,
            channels: &[2],
        };
        let rates = [vec![(1, 1), (2, 1)], vec![], vec![(1, 2)]];
        let mesh = fill(&frame, &sizes, |chunk, part| {
            for &(nu, nv) in &rates[chunk] {
                let slot = part.grid(chunk as u32, nu, nv);
                for vertex in 0..(nu + 1) * (nv + 1) {
                    for key in 0..2 {
                        let p = Vec3::new(chunk as f32, key as f32, vertex as f32);
                        part.vertex(&slot, key, vertex, p, vertex as u32);
                    }
                    part.value(&slot, 0, vertex, &[chunk as f32, vertex as f32]);
                }
            }
        })
        .unwrap();
        assert_eq!((mesh.grids.len(), mesh.vertex_count), (3, 16));
        let elements: Vec<u32> = mesh.grids.iter().map(|g| g.element).collect();
        assert_eq!(elements, [0, 0, 2]);
        assert_eq!(mesh.grids[2].first_vertex, 10);
        for (g, &element) in elements.iter().enumerate() {
            for key in 0..2 {
                for (v, p) in mesh.grid_positions(g, key).iter().enumerate() {
                    assert_eq!(p.z, v as f32);
                    assert_eq!((p.x, p.y), (element as f32, key as f32));
                }
            }
            assert_eq!(mesh.grid_normals(g, 0)[1], 1);
        }
        assert_eq!(mesh.channels[0].values[20..24], [2.0, 0.0, 2.0, 1.0]);
    }
}
