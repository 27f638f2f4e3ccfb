//! Tests of [`super::PolygonSurface`].

use super::*;

fn topology(faces: &[&[u32]], vertex_count: usize) -> MeshTopology {
    MeshTopology {
        vertex_count,
        face_vertex_counts: faces.iter().map(|face| face.len() as u32).collect(),
        face_vertex_indices: faces.concat(),
        ..MeshTopology::default()
    }
}

fn evaluate(
    surface: &PolygonSurface,
    face: u32,
    domain: PatchDomain,
    st: &[[f32; 2]],
) -> LimitSamples {
    let mut evaluator = surface.evaluator();
    let mut out = LimitSamples::default();
    evaluator.bind(face);
    let st: Vec<Vec2> = st.iter().map(|&st| Vec2::from(st)).collect();
    evaluator.evaluate(domain, &st, true, &mut out);
    out
}

fn bits(p: Vec3) -> [u32; 3] {
    p.to_array().map(f32::to_bits)
}

/// A quad, a triangle beside it, a concave pentagon and a concave quad.
fn mixed() -> (MeshTopology, Vec<Vec3>) {
    let points = vec![
        Vec3::new(-0.0, 0.1, 0.2),
        Vec3::new(1.3, -0.0, 0.7),
        Vec3::new(1.1, 1.7, -0.3),
        Vec3::new(0.1, 1.3, 0.6),
        Vec3::new(2.9, 0.9, 0.3),
        Vec3::new(0.6, 1.45, 0.1),
        Vec3::new(1.0, 3.0, 0.0),
        Vec3::new(-1.0, 3.0, 0.0),
        Vec3::new(3.0, 3.0, 0.0),
        Vec3::new(2.0, 2.5, 0.0),
    ];
    let faces: &[&[u32]] = &[
        &[0, 1, 2, 3],
        &[1, 4, 2],
        &[3, 5, 2, 6, 7],
        &[2, 8, 6, 9],
        &[4, 8, 8, 2],
        &[0, 0, 1],
    ];
    (topology(faces, points.len()), points)
}

#[test]
fn corners_are_the_base_vertices_bit_by_bit() {
    let (topology, points) = mixed();
    let surface =
        PolygonSurface::new(&topology, std::slice::from_ref(&points), Vec::new()).unwrap();
    for face in 0..surface.face_count() as u32 {
        let vertices = surface.face_vertices(face);
        let corners: &[[f32; 2]] = &[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let domain = match vertices.len() {
            4 => PatchDomain::Whole,
            _ => PatchDomain::Collapsed,
        };
        let out = evaluate(&surface, face, domain, corners);
        for (i, &p) in out.positions.iter().enumerate() {
            let v = vertices[i.min(vertices.len() - 1)];
            assert_eq!(bits(p), bits(points[v as usize]), "face {face} corner {i}");
        }
        for i in 0..vertices.len() {
            let out = evaluate(&surface, face, PatchDomain::Corner(i as u32), corners);
            assert_eq!(bits(out.positions[0]), bits(points[vertices[i] as usize]));
            let next = vertices[(i + 1) % vertices.len()];
            let middle = 0.5 * points[vertices[i] as usize] + 0.5 * points[next as usize];
            assert_eq!(out.positions[1], middle);
            let centre: Vec3 = vertices.iter().map(|&v| points[v as usize]).sum();
            let centre = centre / vertices.len() as f32;
            assert!((out.positions[2] - centre).length() < 1e-6);
        }
    }
}

#[test]
fn faces_keep_their_element() {
    let (mut topology, points) = mixed();
    let surface =
        PolygonSurface::new(&topology, std::slice::from_ref(&points), Vec::new()).unwrap();
    let elements: Vec<u32> = (0..surface.face_count() as u32)
        .map(|face| surface.element(face))
        .collect();
    // The pentagon gives three triangles, the concave quad two; a quad with a repeated corner is a
    // triangle; a face with two corners is none.
    assert_eq!(elements, [0, 1, 2, 2, 2, 3, 3, 4]);
    assert!(surface.is_polygonal());
    topology.holes = vec![0, 2];
    let surface = PolygonSurface::new(&topology, &[points], Vec::new()).unwrap();
    assert_eq!(surface.face_count(), 4);
    assert_eq!(surface.element(0), 1);
}

#[test]
fn concave_faces_stay_inside_their_outline() {
    // An arrow head: the middle of the outline's bounding box is outside.
    let points = vec![
        Vec3::new(0.0, 0.0, 0.0),
        Vec3::new(4.0, 0.0, 0.0),
        Vec3::new(1.0, 1.0, 0.0),
        Vec3::new(0.0, 4.0, 0.0),
    ];
    for turn in 0..4 {
        let mut face: Vec<u32> = (0..4).collect();
        face.rotate_left(turn);
        let surface = PolygonSurface::new(
            &topology(&[&face], 4),
            std::slice::from_ref(&points),
            Vec::new(),
        )
        .unwrap();
        assert_eq!(surface.face_count(), 2);
        let mut area = 0.0;
        for face in 0..2 {
            let v = surface.face_vertices(face);
            let [a, b, c] = [v[0], v[1], v[2]].map(|v| points[v as usize]);
            area += 0.5 * (b - a).cross(c - a).z;
            let out = evaluate(&surface, face, PatchDomain::Collapsed, &[[0.5, 0.4]]);
            assert_eq!(out.normals[0], Vec3::Z);
        }
        assert!((area - 4.0).abs() < 1e-6);
    }
}

#[test]
fn quads_are_bilinear_with_their_normals() {
    let points = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.5), Vec3::Y];
    let mut topology = topology(&[&[0, 1, 2, 3]], 4);
    let surface = PolygonSurface::new(&topology, &[points.to_vec()], Vec::new()).unwrap();
    let out = evaluate(&surface, 0, PatchDomain::Whole, &[[0.25, 0.75]]);
    // z = s t / 2.
    assert!((out.positions[0] - Vec3::new(0.25, 0.75, 0.09375)).length() < 1e-7);
    let normal = Vec3::new(-0.375, -0.125, 1.0).normalize();
    assert!((out.normals[0] - normal).length() < 1e-6);
    topology.orientation = Orientation::LeftHanded;
    let surface = PolygonSurface::new(&topology, &[points.to_vec()], Vec::new()).unwrap();
    let out = evaluate(&surface, 0, PatchDomain::Whole, &[[0.25, 0.75]]);
    assert!((out.normals[0] + normal).length() < 1e-6);
}

#[test]
fn degenerate_faces_have_finite_samples() {
    let topology = topology(&[&[0, 1, 2, 3], &[0, 1, 2], &[0, 1, 2, 3, 4]], 5);
    let surface = PolygonSurface::new(&topology, &[vec![Vec3::ONE; 5]], Vec::new()).unwrap();
    for face in 0..surface.face_count() as u32 {
        let out = evaluate(&surface, face, PatchDomain::Corner(1), &[[0.3, 0.6]]);
        assert!((out.positions[0] - Vec3::ONE).length() < 1e-6);
        assert_eq!(out.normals[0], Vec3::ZERO);
    }
}

#[test]
fn several_keys_are_evaluated_side_by_side() {
    let (topology, points) = mixed();
    let moved: Vec<Vec3> = points.iter().map(|&p| p * 2.0 + Vec3::X).collect();
    let both =
        PolygonSurface::new(&topology, &[points.clone(), moved.clone()], Vec::new()).unwrap();
    let alone = [points, moved].map(|p| PolygonSurface::new(&topology, &[p], Vec::new()).unwrap());
    let st = [[0.2, 0.3], [0.9, 0.1]];
    let out = evaluate(&both, 0, PatchDomain::Whole, &st);
    for (key, surface) in alone.iter().enumerate() {
        let expected = evaluate(surface, 0, PatchDomain::Whole, &st);
        assert_eq!(out.positions[key * 2..][..2], expected.positions);
        assert_eq!(out.normals[key * 2..][..2], expected.normals);
    }
}

#[test]
fn channels_reproduce_linear_functions() {
    let (topology, points) = mixed();
    let function = |p: Vec3| [p.x + 2.0 * p.y, 1.0 - p.z];
    let values: Vec<f32> = points.iter().flat_map(|&p| function(p)).collect();
    let channel = |kind, indices| Channel {
        kind,
        width: 2,
        values: values.clone(),
        indices,
    };
    let channels = vec![
        channel(ChannelKind::Vertex, Vec::new()),
        channel(ChannelKind::Varying, Vec::new()),
        channel(
            ChannelKind::FaceVarying,
            topology.face_vertex_indices.clone(),
        ),
    ];
    let surface = PolygonSurface::new(&topology, &[points], channels).unwrap();
    let mut evaluator = surface.evaluator();
    for face in 0..surface.face_count() as u32 {
        for (domain, st) in [
            (PatchDomain::Corner(2), [0.4, 0.7]),
            (PatchDomain::Collapsed, [1.0, 0.0]),
            (PatchDomain::Collapsed, [0.3, 0.6]),
        ] {
            evaluator.bind(face);
            let st = [Vec2::from(st)];
            let (mut out, mut values) = (LimitSamples::default(), Vec::new());
            evaluator.evaluate(domain, &st, false, &mut out);
            assert!(out.normals.is_empty());
            let expected = function(out.positions[0]);
            for channel in 0..3 {
                evaluator.evaluate_channel(channel, domain, &st, &mut values);
                assert!((values[0] - expected[0]).abs() < 2e-6);
                assert!((values[1] - expected[1]).abs() < 2e-6);
            }
        }
    }
}

#[test]
fn contradictions_are_errors() {
    let (good, points) = mixed();
    let bad = |change: &dyn Fn(&mut MeshTopology)| {
        let mut topology = good.clone();
        change(&mut topology);
        PolygonSurface::new(&topology, std::slice::from_ref(&points), Vec::new()).is_err()
    };
    assert!(bad(&|t| t.face_vertex_counts[0] = 9));
    assert!(bad(&|t| t.face_vertex_indices[0] = 10));
    assert!(bad(&|t| t.vertex_count = 11));
    assert!(PolygonSurface::new(&good, &[], Vec::new()).is_err());
    let short = Channel {
        kind: ChannelKind::FaceVarying,
        width: 1,
        values: vec![0.0; 4],
        indices: vec![0; 3],
    };
    assert!(PolygonSurface::new(&good, &[points], vec![short]).is_err());
}
