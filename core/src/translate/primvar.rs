//! One primvar resolved against a checked mesh: a constant, a value a face, or a channel of the
//! limit surface.

use std::collections::HashMap;

use super::mesh::CheckedMesh;
use crate::diagnostics::{Code, Warning};
use crate::scene::{Interpolation, PrimvarDesc};
use crate::surface::{Channel, ChannelKind};

/// A primvar as shading and dicing take it.
#[derive(Clone, Debug, PartialEq)]
pub enum Resolved {
    /// One value for the whole prim.
    Constant(Vec<f32>),
    /// `width` floats for each authored face.
    Uniform(Vec<f32>),
    /// To be evaluated over the surface.
    Channel(ChannelData),
}

/// A channel's spread and values; see [`Channel`].
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelData {
    /// Spread.
    pub kind: ChannelKind,
    /// Floats per value.
    pub width: usize,
    /// Values.
    pub values: Vec<f32>,
    /// Indices of face-varying data, one a kept face-vertex.
    pub indices: Vec<u32>,
}

impl From<ChannelData> for Channel {
    fn from(data: ChannelData) -> Self {
        Channel {
            kind: data.kind,
            width: data.width,
            values: data.values,
            indices: data.indices,
        }
    }
}

/// Resolves `primvar`, whose values must have `width` floats. What does not fit is left out with a
/// warning. A single value serves every interpolation.
pub fn resolve(
    path: &str,
    name: &str,
    primvar: &PrimvarDesc,
    width: usize,
    mesh: &CheckedMesh,
    warnings: &mut Vec<Warning>,
) -> Option<Resolved> {
    let mut refuse = |code: Code, text: String| {
        warnings.push(Warning::new(
            path,
            code,
            format!("primvar {name} {text}; it is ignored"),
        ));
        None
    };
    if primvar.width != width {
        let text = format!(
            "has {} floats a value where {width} are needed",
            primvar.width
        );
        return refuse(Code::PrimvarLength, text);
    }
    let value_count = primvar.values.len() / width;
    if value_count == 0 {
        return None;
    }
    if primvar.values.iter().any(|x| !x.is_finite()) {
        return refuse(Code::NotFinite, "has values that are not finite".to_owned());
    }
    let indexed = !primvar.indices.is_empty();
    let out_of_range = |&i: &i32| usize::try_from(i).map_or(true, |i| i >= value_count);
    if primvar.indices.iter().any(out_of_range) {
        let text = format!("has indices outside its {value_count} values");
        return refuse(Code::PrimvarLength, text);
    }
    let count = if indexed {
        primvar.indices.len()
    } else {
        value_count
    };
    let value_of = |i: usize| {
        if indexed {
            primvar.indices[i] as usize
        } else {
            i
        }
    };
    let value = |i: usize| &primvar.values[value_of(i) * width..][..width];

    let (expected, what) = match primvar.interpolation {
        Interpolation::Constant => (1, "value"),
        Interpolation::Uniform => (mesh.authored_faces, "faces"),
        Interpolation::Varying | Interpolation::Vertex => (mesh.topology.vertex_count, "points"),
        Interpolation::FaceVarying => (mesh.authored_face_vertices, "face-vertices"),
    };
    if count == 1 || primvar.interpolation == Interpolation::Constant {
        return Some(Resolved::Constant(value(0).to_vec()));
    }
    if count != expected {
        let text = format!("has {count} values where its mesh has {expected} {what}");
        return refuse(Code::PrimvarLength, text);
    }
    let gather = || {
        (0..count)
            .flat_map(|i| value(i).iter().copied())
            .collect::<Vec<f32>>()
    };
    Some(match primvar.interpolation {
        Interpolation::Constant => unreachable!("returned above"),
        Interpolation::Uniform => Resolved::Uniform(gather()),
        Interpolation::Varying | Interpolation::Vertex => {
            let smooth = primvar.interpolation == Interpolation::Vertex;
            let kind = if smooth {
                ChannelKind::Vertex
            } else {
                ChannelKind::Varying
            };
            Resolved::Channel(ChannelData {
                kind,
                width,
                values: gather(),
                indices: Vec::new(),
            })
        }
        Interpolation::FaceVarying => {
            let kept = mesh.face_vertices.iter().map(|&i| i as usize);
            let (values, indices) = if indexed {
                (
                    primvar.values.to_vec(),
                    kept.map(|i| value_of(i) as u32).collect(),
                )
            } else {
                join_equal(mesh, kept.map(&value))
            };
            let kind = ChannelKind::FaceVarying;
            Resolved::Channel(ChannelData {
                kind,
                width,
                values,
                indices,
            })
        }
    })
}

/// Gives equal values at one vertex the same index: without authored indices, that is where the data
/// is continuous.
fn join_equal<'a>(
    mesh: &CheckedMesh,
    values: impl Iterator<Item = &'a [f32]>,
) -> (Vec<f32>, Vec<u32>) {
    let mut seen: HashMap<(u32, Vec<u32>), u32> = HashMap::new();
    let mut joined = Vec::new();
    let mut count = 0;
    let indices = mesh
        .topology
        .face_vertex_indices
        .iter()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::MeshTopology;
    use crate::translate::points::PointKeys;
    use std::sync::Arc;

    /// Two quads of three authored ones: face 1 was dropped.
    fn mesh() -> CheckedMesh {
        CheckedMesh {
            topology: MeshTopology {
                vertex_count: 6,
                face_vertex_counts: vec![4, 4],
                face_vertex_indices: vec![0, 1, 4, 3, 1, 2, 5, 4],
                ..MeshTopology::default()
            },
            elements: vec![0, 2],
            face_vertices: vec![0, 1, 2, 3, 8, 9, 10, 11],
            authored_faces: 3,
            authored_face_vertices: 12,
            points: PointKeys {
                times: vec![0.0],
                points: Vec::new(),
            },
        }
    }

    fn primvar(interpolation: Interpolation, values: Vec<f32>, indices: Vec<i32>) -> PrimvarDesc {
        PrimvarDesc {
            interpolation,
            width: 1,
            values: Arc::new(values),
            indices: Arc::new(indices),
        }
    }

    fn run(p: &PrimvarDesc) -> (Option<Resolved>, Vec<Warning>) {
        let mut warnings = Vec::new();
        let out = resolve("/m", "displayOpacity", p, 1, &mesh(), &mut warnings);
        (out, warnings)
    }

    #[test]
    fn lengths_are_those_of_the_authored_mesh() {
        let numbers = |n: usize| (0..n).map(|i| i as f32).collect::<Vec<f32>>();
        for (interpolation, n) in [
            (Interpolation::Uniform, 3),
            (Interpolation::Varying, 6),
            (Interpolation::Vertex, 6),
            (Interpolation::FaceVarying, 12),
        ] {
            let (out, warnings) = run(&primvar(interpolation, numbers(n), vec![]));
            assert!(out.is_some() && warnings.is_empty(), "{interpolation:?}");
            let (out, warnings) = run(&primvar(interpolation, numbers(n + 1), vec![]));
            assert!(out.is_none() && warnings.len() == 1, "{interpolation:?}");
            let (out, _) = run(&primvar(interpolation, vec![0.5], vec![]));
            assert_eq!(out, Some(Resolved::Constant(vec![0.5])));
        }
    }

    #[test]
    fn face_varying_follows_the_kept_faces_and_joins_equal_values() {
        let mut values: Vec<f32> = (0..12).map(|i| i as f32).collect();
        values[8] = values[1]; // vertex 1, seen from both kept faces
        let (out, _) = run(&primvar(Interpolation::FaceVarying, values, vec![]));
        let Some(Resolved::Channel(channel)) = out else {
            panic!()
        };
        assert_eq!(channel.indices, vec![0, 1, 2, 3, 1, 4, 5, 6]);
        assert_eq!(channel.values, vec![0.0, 1.0, 2.0, 3.0, 9.0, 10.0, 11.0]);
    }

    #[test]
    fn bad_indices_and_values_are_refused() {
        let (out, w) = run(&primvar(Interpolation::Uniform, vec![1.0], vec![0, 0, -1]));
        assert!(out.is_none() && w[0].code == Code::PrimvarLength);
        let (out, w) = run(&primvar(Interpolation::Constant, vec![f32::NAN], vec![]));
        assert!(out.is_none() && w[0].code == Code::NotFinite);
        let (out, w) = run(&primvar(Interpolation::Constant, vec![], vec![]));
        assert!(out.is_none() && w.is_empty());
    }
}
