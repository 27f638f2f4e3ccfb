//! Limit surfaces against closed forms.

mod shapes;

use glam::{Vec2, Vec3};
use hdtrapeze_core::surface::{
    BoundaryInterpolation, Crease, LimitSamples, LimitSurface, MeshTopology, Orientation,
    PatchDomain, Scheme, SubdivisionFactory, SurfaceError,
};
use hdtrapeze_osd::{OsdFactory, OsdSurface};
use shapes::{cube, grid, octahedron};

/// Derivatives at extraordinary vertices are differences over a patch 1/16 wide or less, so they have
/// lost 4 bits and more of 24.
const NORMAL: f32 = 1e-4;

fn surface(topology: &MeshTopology, points: &[Vec3]) -> OsdSurface {
    OsdFactory::new()
        .create_surface(topology, &[points.to_vec()], Vec::new())
        .expect("the topology is good")
}

fn sample(surface: &OsdSurface, face: u32, domain: PatchDomain, st: [f32; 2]) -> (Vec3, Vec3) {
    let mut evaluator = surface.evaluator();
    let mut out = LimitSamples::default();
    evaluator.bind(face);
    evaluator.evaluate(domain, &[Vec2::from(st)], true, &mut out);
    (out.positions[0], out.normals[0])
}

fn near(a: Vec3, b: Vec3, tolerance: f32) {
    assert!((a - b).length() <= tolerance, "{a} is not {b}");
}

const CORNERS: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

/// The limit of a smooth vertex of valence n: (n^2 v + 4 sum e + sum f) / (n (n + 5)), with edge
/// neighbours e and diagonal neighbours f. For the cube: n = 3, so a corner c goes to
/// (9 c + 4 (3 c - c 2/3 ...)) / 24: with the cube's symmetry e sum to c, f sum to -c: 12/24 c.
#[test]
fn cube_corners_go_to_half() {
    let (topology, points) = cube();
    let surface = surface(&topology, &points);
    for face in 0..6 {
        for (i, &st) in CORNERS.iter().enumerate() {
            let base = points[surface.face_vertices(face)[i] as usize];
            let (p, n) = sample(&surface, face, PatchDomain::Whole, st);
            near(p, base * 0.5, 1e-6);
            near(n, base.normalize(), NORMAL);
        }
        let base: Vec3 = surface
            .face_vertices(face)
            .iter()
            .map(|&v| points[v as usize])
            .sum();
        let (_, n) = sample(&surface, face, PatchDomain::Whole, [0.5, 0.5]);
        near(n, base.normalize(), NORMAL);
    }
}

#[test]
fn left_handed_meshes_flip_normals() {
    let (mut topology, points) = cube();
    let right = surface(&topology, &points);
    topology.orientation = Orientation::LeftHanded;
    let left = surface(&topology, &points);
    for st in [[0.0, 0.0], [0.3, 0.7]] {
        let (p0, n0) = sample(&right, 2, PatchDomain::Whole, st);
        let (p1, n1) = sample(&left, 2, PatchDomain::Whole, st);
        assert_eq!(p0, p1);
        assert_eq!(n0, -n1);
    }
}

#[test]
fn infinitely_sharp_cube_is_a_cube() {
    let (mut topology, points) = cube();
    let mut start = 0;
    for &count in &topology.face_vertex_counts {
        let face = &topology.face_vertex_indices[start..start + count as usize];
        let mut vertices = face.to_vec();
        vertices.push(face[0]);
        topology.creases.push(Crease {
            vertices,
            sharpness: vec![10.0; count as usize],
        });
        start += count as usize;
    }
    let surface = surface(&topology, &points);
    for face in 0..6 {
        let corner = |i: usize| points[surface.face_vertices(face)[i] as usize];
        let normal = (corner(1) - corner(0))
            .cross(corner(3) - corner(0))
            .normalize();
        for (i, &st) in CORNERS.iter().enumerate() {
            near(
                sample(&surface, face, PatchDomain::Whole, st).0,
                corner(i),
                1e-6,
            );
        }
        for st in [[0.1, 0.2], [0.5, 0.5], [0.9, 0.4]] {
            let (p, n) = sample(&surface, face, PatchDomain::Whole, st);
            assert!(((p - corner(0)).dot(normal)).abs() < 1e-6);
            near(n, normal, NORMAL);
        }
    }
}

/// Loop, valence 4: beta = 3/64 * ... in the limit (v + 4 w e) with w = 1 / (4 + 3/(8 b)), b by Loop's
/// formula; e sum to nothing on the octahedron.
#[test]
fn octahedron_under_loop() {
    let (topology, points) = octahedron();
    let surface = surface(&topology, &points);
    let n = 4.0f64;
    let c = 0.375 + 0.25 * (std::f64::consts::TAU / n).cos();
    let beta = (0.625 - c * c) / n;
    let w = 1.0 / (n + 0.375 / beta);
    let factor = (1.0 - n * w) as f32;
    for face in 0..8 {
        for i in 0..3u32 {
            let base = points[surface.face_vertices(face)[i as usize] as usize];
            let (p, normal) = sample(&surface, face, PatchDomain::Corner(i), [0.0, 0.0]);
            near(p, base * factor, 1e-6);
            near(normal, base.normalize(), NORMAL);
        }
        let (p, normal) = sample(&surface, face, PatchDomain::Corner(0), [1.0, 1.0]);
        near(normal, p.normalize(), NORMAL);
    }
}

#[test]
fn bilinear_scheme_is_bilinear() {
    let (mut topology, points) = cube();
    topology.scheme = Scheme::Bilinear;
    let surface = surface(&topology, &points);
    assert!(
        !surface.is_polygonal(),
        "a warped quad has shape between its corners"
    );
    let corner = |i: usize| points[surface.face_vertices(3)[i] as usize];
    let (s, t) = (0.3, 0.8);
    let expected = corner(0) * ((1.0 - s) * (1.0 - t))
        + corner(1) * (s * (1.0 - t))
        + corner(2) * (s * t)
        + corner(3) * ((1.0 - s) * t);
    near(
        sample(&surface, 3, PatchDomain::Whole, [s, t]).0,
        expected,
        1e-6,
    );
}

#[test]
fn holes_have_no_limit() {
    let (mut topology, points) = cube();
    topology.holes = vec![1, 4, 99];
    let surface = surface(&topology, &points);
    assert_eq!(surface.face_count(), 6);
    for face in 0..6 {
        assert_eq!(
            surface.face_vertices(face).is_empty(),
            face == 1 || face == 4
        );
    }
}

#[test]
fn boundary_rules() {
    let (mut topology, points) = grid(4, 3);
    topology.boundary = BoundaryInterpolation::None;
    let none = surface(&topology, &points);
    for face in 0..12u32 {
        let inner = face == 5 || face == 6;
        assert_eq!(!none.face_vertices(face).is_empty(), inner, "face {face}");
    }
    topology.boundary = BoundaryInterpolation::EdgeAndCorner;
    let sharp = surface(&topology, &points);
    near(
        sample(&sharp, 0, PatchDomain::Whole, [0.0, 0.0]).0,
        points[0],
        1e-6,
    );
    topology.boundary = BoundaryInterpolation::EdgeOnly;
    let round = surface(&topology, &points);
    let (p, n) = sample(&round, 0, PatchDomain::Whole, [0.0, 0.0]);
    // A cubic B-spline curve through the corner: (1 4 1) / 6.
    near(p, (points[1] + points[0] * 4.0 + points[5]) / 6.0, 1e-6);
    // Both derivatives run along the curve there; the normal comes from next to it.
    assert!(n.z > 0.9, "{n}");
}

#[test]
fn loop_refuses_quads() {
    let (mut topology, points) = cube();
    topology.scheme = Scheme::Loop;
    let error = OsdFactory::new()
        .create(&topology, &[points], Vec::new())
        .err();
    assert!(
        matches!(error, Some(SurfaceError::Topology(_))),
        "{error:?}"
    );
}

#[test]
fn creases_that_are_left_out_are_noted() {
    let (mut topology, points) = cube();
    // 0 and 7 are opposite corners: no edge joins them.
    topology.creases = vec![Crease {
        vertices: vec![0, 7],
        sharpness: vec![2.0],
    }];
    assert_eq!(surface(&topology, &points).notes().len(), 1);
    topology.creases.clear();
    assert!(surface(&topology, &points).notes().is_empty());
}
