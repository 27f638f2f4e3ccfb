//! Lattice evaluation against single calls of the library, on random meshes with everything that a
//! mesh can have.

mod shapes;

use glam::{Vec2, Vec3};
use hdtrapeze_core::surface::{
    BoundaryInterpolation, Channel, ChannelKind, FaceVaryingLinear, LimitEvaluator, LimitSamples,
    LimitSurface, MeshTopology, PatchDomain, Scheme, TriangleRule,
};
use hdtrapeze_osd::{OsdFactory, OsdSurface};
use shapes::{Random, cube, grid, octahedron, patchwork, sharpen};

/// Positions of both ways are sums of at most 20 products of weights below 1 and control points below
/// 16, with weights good to a few units in the last place: 20 * 16 * 2^-24 is 2e-5.
const POSITION_TOLERANCE: f32 = 2e-5;

fn domains(surface: &OsdSurface, face: u32) -> Vec<PatchDomain> {
    let size = surface.face_vertices(face).len() as u32;
    let mut domains: Vec<PatchDomain> = (0..size).map(PatchDomain::Corner).collect();
    match size {
        3 => domains.push(PatchDomain::Collapsed),
        4 => domains.push(PatchDomain::Whole),
        _ => {}
    }
    domains
}

fn places(random: &mut Random) -> Vec<Vec2> {
    let mut places: Vec<Vec2> = (0..5)
        .flat_map(|t| (0..5).map(move |s| Vec2::new(s as f32, t as f32) / 4.0))
        .collect();
    places.extend((0..12).map(|_| Vec2::new(random.unit(), random.unit())));
    places
}

/// Compares everything; gives the number of faces and of those that the library evaluated.
fn compare(surface: &OsdSurface, random: &mut Random) -> (usize, usize) {
    let mut ours = surface.evaluator();
    let mut asked = (0, 0);
    let mut theirs = surface.library_evaluator();
    let mut probe = surface.lattice_evaluator();
    let (mut a, mut b) = (LimitSamples::default(), LimitSamples::default());
    let (mut va, mut vb) = (Vec::new(), Vec::new());
    for face in 0..surface.face_count() as u32 {
        if surface.face_vertices(face).is_empty() {
            continue;
        }
        probe.bind(face);
        asked.0 += 1;
        asked.1 += usize::from(probe.is_by_library());
        ours.bind(face);
        theirs.bind(face);
        for domain in domains(surface, face) {
            let st = places(random);
            ours.evaluate(domain, &st, true, &mut a);
            theirs.evaluate(domain, &st, true, &mut b);
            for i in 0..a.positions.len() {
                let at = st[i % st.len()];
                let (p, q) = (a.positions[i], b.positions[i]);
                let error = (p - q).length();
                assert!(
                    error < POSITION_TOLERANCE,
                    "face {face} {domain:?} {at}: {p} {q}"
                );
                let (p, q) = (a.normals[i], b.normals[i]);
                // At a place without a normal both look next to it; a boundary corner's derivatives
                // nearly cancel there.
                let turn = p.dot(q);
                assert!(
                    turn > 0.999 || p == q,
                    "face {face} {domain:?} {at}: normals {p} {q}"
                );
            }
            for channel in 0..surface.channels().len() {
                ours.evaluate_channel(channel, domain, &st, &mut va);
                theirs.evaluate_channel(channel, domain, &st, &mut vb);
                for (i, (x, y)) in va.iter().zip(&vb).enumerate() {
                    assert!(
                        (x - y).abs() < POSITION_TOLERANCE,
                        "channel {channel} {i}: {x} {y}"
                    );
                }
            }
        }
    }
    asked
}

/// Values with seams: every face-vertex has its vertex's value, or one of its own.
fn face_varying(random: &mut Random, topology: &MeshTopology, width: usize) -> Channel {
    let mut indices = topology.face_vertex_indices.clone();
    let mut count = topology.vertex_count;
    for index in &mut indices {
        if random.chance(0.2) {
            *index = count as u32;
            count += 1;
        }
    }
    Channel {
        kind: ChannelKind::FaceVarying,
        width,
        values: (0..count * width).map(|_| random.unit()).collect(),
        indices,
    }
}

fn channels(random: &mut Random, topology: &MeshTopology) -> Vec<Channel> {
    let mut smooth = |kind, width: usize| Channel {
        kind,
        width,
        values: (0..topology.vertex_count * width)
            .map(|_| random.unit())
            .collect(),
        indices: Vec::new(),
    };
    let mut channels = vec![
        smooth(ChannelKind::Vertex, 3),
        smooth(ChannelKind::Varying, 1),
    ];
    channels.push(face_varying(random, topology, 2));
    channels.push(face_varying(random, topology, 5));
    channels
}

#[test]
fn lattices_agree_with_the_library() {
    let factory = OsdFactory::new();
    let mut total = (0, 0);
    for seed in 0..60u64 {
        let mut random = Random(seed);
        let is_loop = seed % 4 == 3;
        let (mut topology, points) = patchwork(&mut random, 7, is_loop);
        if seed % 4 == 2 {
            topology.scheme = Scheme::Bilinear;
        }
        topology.boundary = [
            BoundaryInterpolation::EdgeAndCorner,
            BoundaryInterpolation::EdgeOnly,
            BoundaryInterpolation::None,
        ][random.below(3) as usize];
        topology.triangles =
            [TriangleRule::CatmullClark, TriangleRule::Smooth][random.below(2) as usize];
        topology.face_varying = [
            FaceVaryingLinear::None,
            FaceVaryingLinear::CornersOnly,
            FaceVaryingLinear::CornersPlus1,
            FaceVaryingLinear::CornersPlus2,
            FaceVaryingLinear::Boundaries,
            FaceVaryingLinear::All,
        ][random.below(6) as usize];
        let share = [0.0, 0.05, 0.3][random.below(3) as usize];
        sharpen(&mut random, &mut topology, share);
        let moved: Vec<Vec3> = points.iter().map(|&p| p + random.vec3()).collect();
        let keys = if seed % 2 == 0 {
            vec![points, moved]
        } else {
            vec![points]
        };
        let channels = channels(&mut random, &topology);
        let surface = factory
            .create_surface(&topology, &keys, channels)
            .expect("the topology is good");
        let (faces, by_library) = compare(&surface, &mut random);
        if !is_loop {
            total.0 += faces;
            total.1 += by_library;
        }
    }
    // Quad schemes are evaluated here, all but oddities.
    println!("{} of {} faces by the library", total.1, total.0);
    assert!(total.0 > 500 && total.1 * 50 <= total.0, "{total:?}");
}

#[test]
fn small_closed_meshes_agree_with_the_library() {
    let factory = OsdFactory::new();
    let mut random = Random(7);
    for (topology, points) in [cube(), octahedron(), grid(5, 5), grid(1, 1), grid(1, 4)] {
        let surface = factory
            .create_surface(&topology, &[points], Vec::new())
            .unwrap();
        compare(&surface, &mut random);
    }
}
