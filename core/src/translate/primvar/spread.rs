//! A resolved primvar over a mesh: a constant, a value a face, or a channel of the surface.

use std::collections::HashMap;

use super::{Count, Counts, Resolved};
use crate::scene::Interpolation;
use crate::surface::{Channel, ChannelKind};
use crate::translate::mesh::CheckedMesh;

/// A primvar as shading and dicing take it; each value at all keys, `[key][lane]`. Channels are of
/// the kind that the prim's surface takes.
#[derive(Clone, Debug, PartialEq)]
pub enum Spread<C> {
    /// One value for the whole prim.
    Constant(Vec<f32>),
    /// One for each authored face.
    Uniform(Vec<f32>),
    /// To be evaluated over the surface.
    Channel(C),
}

impl CheckedMesh {
    /// How many values a primvar has, by the authored mesh.
    pub fn primvar_counts(&self) -> Counts {
        let points = Count(self.topology.vertex_count, "points");
        Counts {
            prim: "mesh",
            uniform: Count(self.authored_faces, "faces"),
            varying: points,
            vertex: points,
            face_varying: Count(self.authored_face_vertices, "face-vertices"),
            more_is_fine: false,
        }
    }

    /// Spreads a primvar that was resolved with [`CheckedMesh::primvar_counts`].
    pub fn spread(&self, resolved: Resolved) -> Spread<Channel> {
        let width = resolved.stride();
        let nearest = |values, indices| {
            Spread::Channel(Channel {
                kind: ChannelKind::Nearest,
                width,
                values,
                indices,
            })
        };
        match (resolved.interpolation, resolved.is_integer) {
            (Interpolation::Constant, _) => Spread::Constant(resolved.item(0).to_vec()),
            (Interpolation::Uniform, _) => Spread::Uniform(resolved.into_items()),
            (Interpolation::Varying | Interpolation::Vertex, true) => {
                let value = |&v: &u32| match resolved.indices.get(v as usize) {
                    Some(&value) => value,
                    None => v,
                };
                let indices = self
                    .topology
                    .face_vertex_indices
                    .iter()
                    .map(value)
                    .collect();
                nearest(resolved.values, indices)
            }
            (Interpolation::Varying, false) => self.vertex(ChannelKind::Varying, resolved),
            (Interpolation::Vertex, false) => self.vertex(ChannelKind::Vertex, resolved),
            (Interpolation::FaceVarying, is_integer) => {
                let kept = self.face_vertices.iter().map(|&i| i as usize);
                if is_integer || !resolved.indices.is_empty() {
                    let value = |i: usize| resolved.indices.get(i).map_or(i as u32, |&v| v);
                    let indices = kept.map(value).collect();
                    if is_integer {
                        return nearest(resolved.values, indices);
                    }
                    return Spread::Channel(Channel {
                        kind: ChannelKind::FaceVarying,
                        width,
                        values: resolved.values,
                        indices,
                    });
                }
                let (values, indices) = self.join_equal(kept.map(|i| resolved.item(i)));
                Spread::Channel(Channel {
                    kind: ChannelKind::FaceVarying,
                    width,
                    values,
                    indices,
                })
            }
        }
    }

    fn vertex(&self, kind: ChannelKind, resolved: Resolved) -> Spread<Channel> {
        Spread::Channel(Channel {
            kind,
            width: resolved.stride(),
            values: resolved.into_items(),
            indices: Vec::new(),
        })
    }

    /// Gives equal values at one vertex the same index: without authored indices, that is where the
    /// data is continuous.
    fn join_equal<'a>(&self, values: impl Iterator<Item = &'a [f32]>) -> (Vec<f32>, Vec<u32>) {
        let mut seen: HashMap<(u32, Vec<u32>), u32> = HashMap::new();
        let mut joined = Vec::new();
        let mut count = 0;
        let vertices = self.topology.face_vertex_indices.iter();
        let indices = vertices
            .zip(values)
            .map(|(&vertex, value)| {
                let bits = value.iter().map(|x| x.to_bits()).collect();
                *seen.entry((vertex, bits)).or_insert_with(|| {
                    joined.extend_from_slice(value);
                    count += 1;
                    count - 1
                })
            })
            .collect();
        (joined, indices)
    }
}
