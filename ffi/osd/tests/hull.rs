//! The hull of a face contains every position of it, in all directions and at each key, and fits it closely.

mod shapes;

use glam::{Vec2, Vec3};
use hdtrapeze_core::surface::{
    BoundaryInterpolation, HULL_ROUNDING, LimitSamples, LimitSurface, MeshTopology, PatchDomain,
    Scheme, TriangleRule,
};
use hdtrapeze_osd::OsdFactory;
use shapes::{Random, cube, grid, icosahedron, octahedron, patchwork, sharpen, thirds};

fn domains(surface: &dyn LimitSurface, face: u32) -> Vec<PatchDomain> {
    match surface.face_vertices(face).len() as u32 {
        0 => Vec::new(),
        4 => vec![PatchDomain::Whole],
        3 => (0..3)
            .map(PatchDomain::Corner)
            .chain([PatchDomain::Collapsed])
            .collect(),
        n => (0..n).map(PatchDomain::Corner).collect(),
    }
}

/// Shares of the size of a mesh that positions reach out of their hulls (largest, of `HULL_ROUNDING`), and the
/// means of how much of the length of a hull positions take up.
fn check(topology: &MeshTopology, points: Vec<Vec3>, random: &mut Random) -> (f64, f64) {
    let moved: Vec<Vec3> = points.iter().map(|&p| p * 1.7 + random.vec3()).collect();
    let surface = OsdFactory::new()
        .create_surface(topology, &[points, moved], Vec::new())
        .expect("the topology is good");
    let mut evaluator = surface.evaluator();
    let (mut hull, mut out) = (Vec::new(), LimitSamples::default());
    let mut st: Vec<Vec2> = (0..81)
        .map(|i| Vec2::new((i % 9) as f32, (i / 9) as f32) / 8.0)
        .collect();
    st.extend((0..20).map(|_| Vec2::new(random.unit(), random.unit())));
    let directions: Vec<Vec3> = [
        Vec3::X,
        Vec3::NEG_X,
        Vec3::Y,
        Vec3::NEG_Y,
        Vec3::Z,
        Vec3::NEG_Z,
    ]
    .into_iter()
    .chain((0..10).map(|_| (random.vec3() - 0.5).normalize()))
    .collect();
    let (mut worst, mut filled, mut count) = (f64::NEG_INFINITY, 0.0, 0);
    let mut largest = 0.0f32;
    for face in 0..surface.face_count() as u32 {
        for domain in domains(&surface, face) {
            evaluator.bind(face);
            assert!(evaluator.hull(&mut hull), "face {face} has no hull");
            evaluator.evaluate(domain, &st, false, &mut out);
            let controls = hull.len() / 2;
            largest = hull
                .iter()
                .fold(largest, |m, p| m.max(p.abs().max_element()));
            for key in 0..2 {
                let hull = &hull[key * controls..][..controls];
                for d in &directions {
                    let reach = |points: &[Vec3]| {
                        let along = points.iter().map(|p| p.as_dvec3().dot(d.as_dvec3()));
                        along.fold(f64::NEG_INFINITY, f64::max)
                    };
                    let back = |points: &[Vec3]| {
                        let along = points.iter().map(|p| p.as_dvec3().dot(d.as_dvec3()));
                        along.fold(f64::INFINITY, f64::min)
                    };
                    let n = st.len();
                    let at = &out.positions[key * n..][..n];
                    worst = worst.max(reach(at) - reach(hull));
                    let length = reach(hull) - back(hull);
                    if length > 1e-3 {
                        filled += (reach(at) - back(at)) / length;
                        count += 1;
                    }
                }
            }
        }
    }
    let filled = filled / f64::from(count.max(1));
    (worst / (HULL_ROUNDING * f64::from(largest)), filled)
}

#[test]
fn hulls_contain_their_faces() {
    let mut random = Random(11);
    let boundaries = [
        BoundaryInterpolation::EdgeAndCorner,
        BoundaryInterpolation::EdgeOnly,
        BoundaryInterpolation::None,
    ];
    let mut meshes = vec![cube(), grid(4, 3), thirds(icosahedron()), octahedron()];
    for boundary in boundaries {
        for i in 0..8 {
            let is_loop = i % 4 == 3;
            let (mut topology, points) = patchwork(&mut random, 4, is_loop);
            topology.boundary = boundary;
            if i % 2 == 1 {
                sharpen(&mut random, &mut topology, 0.3);
            }
            match i {
                2 => topology.scheme = Scheme::Bilinear,
                4 => topology.triangles = TriangleRule::Smooth,
                _ => {}
            }
            meshes.push((topology, points));
        }
    }
    let mut empty = 0;
    for (number, (topology, points)) in meshes.into_iter().enumerate() {
        let (worst, filled) = check(&topology, points, &mut random);
        assert!(worst < 0.5, "mesh {number}: {worst}");
        println!("mesh {number}: out by {worst:.4} of the allowance, {filled:.3} of the hull");
        // A sub-face has part of its face; irregular Loop triangles have all their patch points.
        let least = if topology.scheme == Scheme::Loop {
            0.1
        } else {
            0.4
        };
        let none = worst == f64::NEG_INFINITY; // all faces are dropped
        assert!(none || filled > least, "mesh {number}: {filled}");
        empty += usize::from(none);
    }
    assert!(empty < 4, "{empty}");
}
