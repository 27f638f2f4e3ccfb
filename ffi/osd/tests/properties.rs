//! What every limit surface must hold to: the same bits alone, in a lattice and from any thread;
//! keys that do not know of each other; sub-faces that meet; a limit that subdividing the mesh does
//! not change; bad meshes that end in an error or an empty face.

mod shapes;
mod subdivide;

use glam::{Vec2, Vec3};
use hdtrapeze_core::surface::{
    BoundaryInterpolation, Channel, ChannelKind, FaceVaryingLinear, LimitSamples, LimitSurface,
    MeshTopology, PatchDomain, Scheme,
};
use hdtrapeze_osd::{OsdFactory, OsdSurface};
use shapes::{Random, cube, grid, icosahedron, patchwork, sharpen, thirds};
use subdivide::catmull_clark;

fn surface(topology: &MeshTopology, keys: &[Vec<Vec3>], channels: Vec<Channel>) -> OsdSurface {
    OsdFactory::new()
        .create_surface(topology, keys, channels)
        .expect("the topology is good")
}

fn patches(surface: &OsdSurface) -> Vec<(u32, PatchDomain)> {
    (0..surface.face_count() as u32)
        .flat_map(|face| match surface.face_vertices(face).len() as u32 {
            4 => vec![(face, PatchDomain::Whole)],
            n => (0..n).map(|i| (face, PatchDomain::Corner(i))).collect(),
        })
        .collect()
}

fn lattice(rate: u32) -> Vec<Vec2> {
    (0..=rate)
        .flat_map(|t| (0..=rate).map(move |s| Vec2::new(s as f32, t as f32) / rate as f32))
        .collect()
}

fn evaluate(surface: &OsdSurface, (face, domain): (u32, PatchDomain), st: &[Vec2]) -> LimitSamples {
    let mut evaluator = surface.evaluator();
    let mut out = LimitSamples::default();
    evaluator.bind(face);
    evaluator.evaluate(domain, st, true, &mut out);
    out
}

fn bits(points: &[Vec3]) -> Vec<[u32; 3]> {
    points
        .iter()
        .map(|p| p.to_array().map(f32::to_bits))
        .collect()
}

/// Meshes of every kind, with creases.
fn all_kinds() -> Vec<(MeshTopology, Vec<Vec3>)> {
    let mut random = Random(3);
    let mut meshes = vec![
        cube(),
        thirds(icosahedron()),
        patchwork(&mut random, 5, false),
    ];
    let (mut creased, points) = patchwork(&mut random, 5, false);
    sharpen(&mut random, &mut creased, 0.2);
    let (mut bilinear, bilinear_points) = patchwork(&mut random, 4, false);
    bilinear.scheme = Scheme::Bilinear;
    meshes.extend([(creased, points), (bilinear, bilinear_points)]);
    meshes.push(patchwork(&mut random, 5, true));
    meshes
}

#[test]
fn a_sample_has_the_same_bits_alone_and_in_a_lattice() {
    for (topology, points) in all_kinds() {
        let moved = points.iter().map(|&p| p * 1.7 + Vec3::X).collect();
        let surface = surface(&topology, &[points, moved], Vec::new());
        let st = lattice(7);
        let n = st.len();
        for patch in patches(&surface) {
            let all = evaluate(&surface, patch, &st);
            let mut evaluator = surface.evaluator();
            let mut one = LimitSamples::default();
            // Backwards, in columns, and without normals: nothing may lean on what came before.
            evaluator.bind(patch.0);
            for i in (0..n).rev() {
                let i = i % 8 * 8 + i / 8;
                let with_normals = i % 3 != 0;
                evaluator.evaluate(patch.1, &st[i..=i], with_normals, &mut one);
                for key in 0..2 {
                    let at = key * n + i;
                    assert_eq!(
                        bits(&one.positions[key..=key]),
                        bits(&all.positions[at..=at])
                    );
                    if with_normals {
                        assert_eq!(bits(&one.normals[key..=key]), bits(&all.normals[at..=at]));
                    }
                }
            }
        }
    }
}

#[test]
fn threads_get_the_same_bits() {
    for (topology, points) in all_kinds() {
        let surface = surface(&topology, &[points], Vec::new());
        let (st, all) = (lattice(5), patches(&surface));
        let run = |turn: usize| -> Vec<_> {
            let mut order: Vec<usize> = (0..all.len()).collect();
            order.rotate_left(turn * all.len() / 4);
            let mut results = vec![Vec::new(); all.len()];
            for i in order {
                results[i] = bits(&evaluate(&surface, all[i], &st).positions);
            }
            results
        };
        let results: Vec<_> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|turn| scope.spawn(move || turn)).collect();
            let turns: Vec<usize> = threads.into_iter().map(|t| t.join().unwrap()).collect();
            let run = &run;
            let threads: Vec<_> = turns
                .into_iter()
                .map(|turn| scope.spawn(move || run(turn)))
                .collect();
            threads.into_iter().map(|t| t.join().unwrap()).collect()
        });
        assert!(results.windows(2).all(|pair| pair[0] == pair[1]));
    }
}

#[test]
fn keys_do_not_know_of_each_other() {
    for (topology, points) in all_kinds() {
        let mut random = Random(5);
        let keys: Vec<Vec<Vec3>> = (0..3)
            .map(|_| points.iter().map(|&p| p + random.vec3()).collect())
            .collect();
        let together = surface(&topology, &keys, Vec::new());
        let st = lattice(3);
        for patch in patches(&together) {
            let all = evaluate(&together, patch, &st);
            for (i, key) in keys.iter().enumerate() {
                let alone = surface(&topology, std::slice::from_ref(key), Vec::new());
                let one = evaluate(&alone, patch, &st);
                let part = i * st.len()..(i + 1) * st.len();
                assert_eq!(bits(&all.positions[part.clone()]), bits(&one.positions));
                assert_eq!(bits(&all.normals[part]), bits(&one.normals));
            }
            if patch.0 > 12 {
                break;
            }
        }
    }
}

#[test]
fn sub_faces_meet_at_middles_and_centres() {
    let mut random = Random(11);
    for triangles_only in [false, true] {
        let (topology, points) = patchwork(&mut random, 6, triangles_only);
        let surface = surface(&topology, &[points], Vec::new());
        let near = |a: Vec3, b: Vec3| assert!((a - b).length() < 2e-6, "{a} {b}");
        for face in 0..surface.face_count() as u32 {
            let n = surface.face_vertices(face).len() as u32;
            let at = |i: u32, s: f32, t: f32| {
                let out = evaluate(
                    &surface,
                    (face, PatchDomain::Corner(i % n)),
                    &[Vec2::new(s, t)],
                );
                out.positions[0]
            };
            for i in 0..n {
                near(at(i, 1.0, 1.0), at(0, 1.0, 1.0));
                for x in [0.0, 0.3, 1.0] {
                    near(at(i, 1.0, x), at(i + 1, x, 1.0));
                }
            }
        }
        // Across an edge: the same curve from both faces, backwards.
        let mut edges = std::collections::HashMap::new();
        let mut shared = 0;
        for face in 0..surface.face_count() as u32 {
            let vertices = surface.face_vertices(face);
            let n = vertices.len();
            for i in 0..n {
                let (a, b) = (vertices[i], vertices[(i + 1) % n]);
                let half = |i: usize, st: Vec2| {
                    evaluate(&surface, (face, PatchDomain::Corner(i as u32)), &[st]).positions[0]
                };
                let curve = [
                    half(i, Vec2::ZERO),
                    half(i, Vec2::new(0.4, 0.0)),
                    half(i, Vec2::X),
                    half((i + 1) % n, Vec2::new(0.0, 0.4)),
                    half((i + 1) % n, Vec2::ZERO),
                ];
                if let Some(other) = edges.insert((a, b), curve) {
                    panic!("two faces run along {a} {b} the same way: {other:?}");
                }
                if let Some(other) = edges.get(&(b, a)) {
                    shared += 1;
                    for (p, q) in curve.iter().zip(other.iter().rev()) {
                        near(*p, *q);
                    }
                }
            }
        }
        assert!(shared > 30);
    }
}

/// The limit surface of a mesh is that of the mesh subdivided once by the textbook rules, in f64.
/// The Gregory patches at extraordinary vertices are twice as wide in one as in the other: there they
/// differ by the approximation.
#[test]
fn subdividing_does_not_change_the_limit() {
    let mut random = Random(2);
    let mut worst = (0.0f32, 0.0f32);
    for round in 0..8 {
        let (mut topology, mut points) = match round {
            0 => cube(),
            1 => thirds(icosahedron()),
            _ => patchwork(&mut random, 5, false),
        };
        if round > 4 {
            // One sharpness an edge.
            (topology, points) = thirds(patchwork(&mut random, 4, true));
            topology.scheme = Scheme::CatmullClark;
            sharpen(&mut random, &mut topology, 0.1);
            topology.corners.clear();
            let mut seen = std::collections::HashSet::new();
            topology.creases.retain(|crease| {
                let (a, b) = (crease.vertices[0], crease.vertices[1]);
                seen.insert((a.min(b), a.max(b)))
            });
        }
        let (finer, finer_points) = catmull_clark(&topology, &points);
        let coarse = surface(&topology, &[points], Vec::new());
        let fine = surface(&finer, &[finer_points], Vec::new());
        let st = lattice(4);
        let mut quad = 0;
        for face in 0..coarse.face_count() as u32 {
            let n = coarse.face_vertices(face).len() as u32;
            for i in 0..n {
                let a = evaluate(&coarse, (face, PatchDomain::Corner(i)), &st);
                let b = evaluate(&fine, (quad, PatchDomain::Whole), &st);
                quad += 1;
                for (j, (p, q)) in a.positions.iter().zip(&b.positions).enumerate() {
                    let d = (*p - *q).length();
                    worst.0 = worst.0.max(d);
                    assert!(
                        d < 3e-3,
                        "{round} face {face} corner {i} {}: {p} {q}",
                        st[j]
                    );
                    // At base vertices both are the limit itself, but at the loose end of an infinitely
                    // sharp crease.
                    let at_vertices = if round > 4 { 2e-3 } else { 1e-5 };
                    if st[j] == Vec2::ZERO {
                        worst.1 = worst.1.max(d);
                        assert!(d < at_vertices, "{round} face {face} corner {i}: {p} {q}");
                    }
                }
            }
        }
    }
    println!("at most {} apart, {} at base vertices", worst.0, worst.1);
}

/// How far the approximation at extraordinary vertices is from the limit, on a cube of size 2, where
/// every vertex is one: the bound that the bridge promises.
#[test]
fn the_limit_is_met_within_the_promise() {
    let (topology, points) = cube();
    let reference = {
        let (mut t, mut p) = (topology.clone(), points.clone());
        for _ in 0..5 {
            (t, p) = catmull_clark(&t, &p);
        }
        (surface(&t, std::slice::from_ref(&p), Vec::new()), p)
    };
    let coarse = surface(&topology, &[points], Vec::new());
    let mut error = 0.0f32;
    // Quads of the fifth step in order: four a quad of the step before, by its corners.
    for quad in 0..6 * 4u32.pow(5) {
        let (mut o, mut sx, mut sy) = (Vec2::ZERO, Vec2::X, Vec2::Y);
        let face = quad / 4u32.pow(5);
        for level in (0..5).rev() {
            let i = quad / 4u32.pow(level) % 4;
            let c = [o, o + sx, o + sx + sy, o + sy][i as usize];
            let next = [sx, sy, -sx, -sy][i as usize];
            let before = [sy, -sx, -sy, sx][i as usize];
            (o, sx, sy) = (c, 0.5 * next, 0.5 * before);
        }
        for at in [Vec2::ZERO, Vec2::new(0.5, 0.0), Vec2::splat(0.5)] {
            let st = o + sx * at.x + sy * at.y;
            let a = evaluate(&coarse, (face, PatchDomain::Whole), &[st]).positions[0];
            let b = evaluate(&reference.0, (quad, PatchDomain::Whole), &[at]).positions[0];
            error = error.max((a - b).length());
        }
    }
    println!("at most {error} from the limit");
    assert!(error < 0.002);
}

#[test]
fn channels_reproduce_linear_functions() {
    let mut random = Random(9);
    for scheme in [Scheme::CatmullClark, Scheme::Loop, Scheme::Bilinear] {
        let (mut topology, points) = patchwork(&mut random, 5, scheme == Scheme::Loop);
        topology.scheme = scheme;
        // A flat sheet: vertex data that are linear in the position stay so at the limit, and
        // values without seams under `CornersOnly` follow the vertices.
        topology.face_varying = FaceVaryingLinear::None;
        topology.boundary = BoundaryInterpolation::EdgeOnly;
        let value = |p: Vec3| [2.0 * p.x - p.y, p.z + 1.0, 0.5 * p.x + p.y + p.z];
        let values: Vec<f32> = points.iter().flat_map(|&p| value(p)).collect();
        let channel = |kind, indices: &[u32]| Channel {
            kind,
            width: 3,
            values: values.clone(),
            indices: indices.to_vec(),
        };
        let channels = vec![
            channel(ChannelKind::Vertex, &[]),
            channel(ChannelKind::FaceVarying, &topology.face_vertex_indices),
            channel(ChannelKind::Varying, &[]),
        ];
        let surface = surface(&topology, std::slice::from_ref(&points), channels);
        let st = lattice(3);
        let mut evaluator = surface.evaluator();
        let (mut out, mut got) = (LimitSamples::default(), Vec::new());
        for (face, domain) in patches(&surface) {
            evaluator.bind(face);
            evaluator.evaluate(domain, &st, false, &mut out);
            for channel in 0..2 {
                evaluator.evaluate_channel(channel, domain, &st, &mut got);
                for (p, v) in out.positions.iter().zip(got.chunks(3)) {
                    let expected = Vec3::from(value(*p));
                    assert!(
                        (Vec3::from_slice(v) - expected).length() < 3e-5,
                        "{channel} {face}"
                    );
                }
            }
            // Varying: the vertex's own value at a corner.
            evaluator.evaluate_channel(2, domain, &[Vec2::ZERO], &mut got);
            let corner = match domain {
                PatchDomain::Corner(i) => i as usize,
                _ => 0,
            };
            let v = surface.face_vertices(face)[corner];
            assert_eq!(got, value(points[v as usize]));
        }
    }
}

#[test]
fn normals_of_closed_meshes_point_out() {
    for (topology, points) in [cube(), thirds(icosahedron())] {
        let surface = surface(&topology, &[points], Vec::new());
        for patch in patches(&surface) {
            let out = evaluate(&surface, patch, &lattice(6));
            for (p, n) in out.positions.iter().zip(&out.normals) {
                assert!(n.dot(p.normalize()) > 0.85 && n.is_normalized(), "{p} {n}");
            }
        }
    }
}

/// Faces that nobody should author: they must not crash, and give finite samples or nothing.
#[test]
fn bad_faces_do_no_harm() {
    let mut random = Random(21);
    for seed in 0..400u64 {
        random.0 = seed;
        let scheme = [Scheme::CatmullClark, Scheme::Loop, Scheme::Bilinear][seed as usize % 3];
        let vertex_count = 3 + random.below(7);
        let mut topology = MeshTopology {
            scheme,
            vertex_count: vertex_count as usize,
            ..MeshTopology::default()
        };
        for _ in 0..1 + random.below(9) {
            let size = if scheme == Scheme::Loop {
                3
            } else {
                random.below(6)
            };
            topology.face_vertex_counts.push(size);
            for _ in 0..size {
                topology
                    .face_vertex_indices
                    .push(random.below(vertex_count));
            }
        }
        topology.boundary = [
            BoundaryInterpolation::None,
            BoundaryInterpolation::EdgeOnly,
            BoundaryInterpolation::EdgeAndCorner,
        ][random.below(3) as usize];
        topology.holes = vec![random.below(5)];
        if seed % 2 == 0 {
            sharpen(&mut random, &mut topology, 0.3);
        }
        let indices: Vec<u32> = topology
            .face_vertex_indices
            .iter()
            .map(|_| random.below(4))
            .collect();
        let channel = Channel {
            kind: ChannelKind::FaceVarying,
            width: 2,
            values: vec![0.5; 8],
            indices,
        };
        let points: Vec<Vec3> = (0..vertex_count).map(|_| random.vec3()).collect();
        let Ok(surface) = OsdFactory::new().create_surface(&topology, &[points], vec![channel])
        else {
            continue;
        };
        let mut evaluator = surface.evaluator();
        let mut values = Vec::new();
        for patch in patches(&surface) {
            let out = evaluate(&surface, patch, &lattice(3));
            assert!(
                out.positions
                    .iter()
                    .chain(&out.normals)
                    .all(|p| p.is_finite())
            );
            evaluator.bind(patch.0);
            evaluator.evaluate_channel(0, patch.1, &lattice(2), &mut values);
            assert!(
                values.iter().all(|v| (v - 0.5).abs() < 1e-4),
                "{seed}: {values:?}"
            );
        }
    }
}

#[test]
fn repeated_vertices_make_a_smaller_face() {
    let (mut topology, points) = grid(2, 1);
    // The second quad's third corner is given twice: still a quad; then a face with two corners.
    topology.face_vertex_counts = vec![4, 5, 4];
    topology.face_vertex_indices = vec![0, 1, 4, 3, 1, 2, 5, 5, 4, 0, 0, 1, 1];
    let surface = surface(&topology, &[points], Vec::new());
    assert_eq!(surface.face_count(), 3);
    assert_eq!(surface.face_vertices(1), [1, 2, 5, 4]);
    assert!(surface.face_vertices(2).is_empty());
    assert_eq!(surface.element(1), 1);
    let out = evaluate(&surface, (1, PatchDomain::Whole), &[Vec2::splat(0.5)]);
    assert!(out.normals[0].z > 0.99);
}
