//! Models: a mesh with the positions that a tree of [`super::relative`] sees, at some instants and in a space that may move along.

use std::ops::RangeInclusive;

use glam::Vec3;
use rayon::prelude::*;

use super::carrier::Carrier;
use crate::grid::DicedMesh;

/// Where strands go apart, the shutter is parted this near to its half, or not at all.
const MOST_OFF: f32 = 0.25;

/// An instant that trees see: a key, or half way from it to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instant {
    /// The key, or the one before.
    pub key: usize,
    between: bool,
}

impl Instant {
    /// That of a key.
    pub fn at(key: usize) -> Self {
        Self {
            key,
            between: false,
        }
    }

    /// Near half of the shutter: the key that is nearest, or what is between two keys where there are no others.
    pub fn half_way(mesh: &DicedMesh) -> Option<Self> {
        let off = |key: usize| (mesh.key_times[key] - 0.5).abs();
        match mesh.key_count() {
            2 => Some(Self {
                key: 0,
                between: true,
            }),
            keys => (1..keys - 1)
                .min_by(|&a, &b| off(a).total_cmp(&off(b)))
                .filter(|&key| off(key) < MOST_OFF)
                .map(Self::at),
        }
    }

    /// When that is.
    pub fn time(self, mesh: &DicedMesh) -> f32 {
        let time = mesh.key_times[self.key];
        match self.between {
            true => 0.5 * (time + mesh.key_times[self.key + 1]),
            false => time,
        }
    }

    /// The first part of the shutter, which ends here, or the second: all that a tree of it sees.
    pub fn part(self, second: bool, last: usize) -> Vec<Self> {
        let keys = |keys: RangeInclusive<usize>| keys.map(Self::at);
        let here = std::iter::once(self);
        match second {
            false => keys(0..=self.key)
                .chain(here.filter(|i| i.between))
                .collect(),
            true => here.chain(keys(self.key + 1..=last)).collect(),
        }
    }
}

/// The mesh as seen at some instants, from first to last, in carried space: grids and positions alone. Where there is a carrier all
/// are keys.
pub fn model(mesh: &DicedMesh, carrier: Option<&Carrier>, instants: &[Instant]) -> DicedMesh {
    let times: Vec<f32> = instants.iter().map(|i| i.time(mesh)).collect();
    let (a, b) = (times[0], times[times.len() - 1]);
    debug_assert!(carrier.is_none() || instants.iter().all(|i| !i.between));
    let key_times = match times.len() {
        1 => vec![0.0],
        _ => times.iter().map(|t| (t - a) / (b - a)).collect(),
    };
    let maps: Vec<_> = instants
        .iter()
        .map(|i| carrier.map(|carrier| carrier.inverse_at_key(i.key)))
        .collect();
    let count = key_times.len();
    let mut model = DicedMesh {
        key_times,
        grids: mesh.grids.clone(),
        vertex_count: mesh.vertex_count,
        ..DicedMesh::default()
    };
    model.zero_positions();
    let (mut rest, mut from) = (&mut model.positions[..], 0);
    let mut parts: Vec<(usize, &mut [Vec3])> = Vec::with_capacity(mesh.grids.len());
    for (g, grid) in mesh.grids.iter().enumerate() {
        let (start, n) = (grid.first_vertex as usize, grid.vertex_count());
        let (_, after) = rest.split_at_mut((start - from) * count);
        let (own, after) = after.split_at_mut(n * count);
        parts.push((g, own));
        (rest, from) = (after, start + n);
    }
    parts.into_par_iter().with_min_len(16).for_each(|(g, own)| {
        let n = mesh.grids[g].vertex_count();
        for ((instant, map), own) in instants.iter().zip(&maps).zip(own.chunks_exact_mut(n)) {
            let old = mesh.grid_positions(g, instant.key);
            if let Some((m, by)) = map {
                for (to, p) in own.iter_mut().zip(old) {
                    *to = (*m * (p.as_dvec3() - *by)).as_vec3();
                }
            } else if instant.between {
                let next = mesh.grid_positions(g, instant.key + 1);
                for (to, (p, q)) in own.iter_mut().zip(old.iter().zip(next)) {
                    *to = ((p.as_dvec3() + q.as_dvec3()) * 0.5).as_vec3();
                }
            } else {
                own.copy_from_slice(old);
            }
        }
    });
    model
}
