//! NURBS patches, diced: closed where their boundaries meet, and of the right size.

mod lattice;

use glam::{DVec3, Vec3};
use hdtrapeze_core::dice::{DiceInput, RasterMetric, dice};
use hdtrapeze_core::grid::{DicedMesh, octahedral};
use hdtrapeze_core::motion::PointPath;
use hdtrapeze_core::nurbs::Knots;
use hdtrapeze_core::surface::Orientation;
use hdtrapeze_core::surface::nurbs::{NurbsPatch, NurbsSurface};
use lattice::{area_and_volume, camera, open_edges};
use proptest::prelude::*;
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::sync::atomic::AtomicBool;

const CIRCLE_KNOTS: [f64; 12] = [0., 0., 0., 1., 1., 2., 2., 3., 3., 4., 4., 4.];
const CIRCLE: [[f64; 2]; 9] = [
    [1., 0.],
    [1., 1.],
    [0., 1.],
    [-1., 1.],
    [-1., 0.],
    [-1., -1.],
    [0., -1.],
    [1., -1.],
    [1., 0.],
];

fn knots(order: i32, knots: &[f64]) -> Knots {
    let points = knots.len() as i32 - order;
    Knots::new(order, points, knots, None).unwrap().0
}

/// A profile of (r, z) points and weights, turned about z; a key for each offset, along which points
/// wander by themselves.
fn turned(profile: &[[f64; 2]], along: Knots, wander: &[f32]) -> NurbsSurface {
    let weight = |i: usize| if i % 2 == 1 { FRAC_1_SQRT_2 } else { 1.0 };
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    for (j, [r, z]) in profile.iter().enumerate() {
        for (i, [x, y]) in CIRCLE.iter().enumerate() {
            points.push(DVec3::new(x * r, y * r, *z).as_vec3());
            weights.push(weight(i) * weight(j));
        }
    }
    let keys = wander.iter().map(|by| {
        let moved = |p: &Vec3| *p + Vec3::new(p.z, p.x * p.y, 1.0) * *by;
        points.iter().map(moved).collect()
    });
    let patch = NurbsPatch {
        knots: [knots(3, &CIRCLE_KNOTS), along],
        points: keys.collect(),
        weights,
        usable: Vec::new(),
        orientation: Orientation::RightHanded,
    };
    NurbsSurface::new(patch, Vec::new())
}

fn sphere(wander: &[f32]) -> NurbsSurface {
    let half = knots(3, &[0., 0., 0., 1., 1., 2., 2., 2.]);
    let arc = [[0., -1.], [1., -1.], [1., 0.], [1., 1.], [0., 1.]];
    turned(&arc, half, wander)
}

fn torus(wander: &[f32]) -> NurbsSurface {
    let ring = CIRCLE.map(|[x, z]| [x * 0.25 + 0.75, z * 0.25]);
    turned(&ring, knots(3, &CIRCLE_KNOTS), wander)
}

fn diced(surface: &NurbsSurface, metric: &RasterMetric, rate: f32, keys: usize) -> DicedMesh {
    let times: Vec<f32> = (0..keys)
        .map(|k| k as f32 / (keys - 1).max(1) as f32)
        .collect();
    let output = dice(&DiceInput {
        surface,
        path: &PointPath::identity(&times, DVec3::ZERO),
        metric,
        shading_rate: rate,
        with_normals: true,
        polygons_coarse: true,
        max_micropolygons: 400_000,
        cancel: &AtomicBool::new(false),
    })
    .expect("dicing");
    assert_eq!(output.dropped_faces, 0);
    output.mesh
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any camera, inside and outside and through the surface, at any rate and at every key.
    #[test]
    fn closed_from_anywhere(
        ring: bool,
        eye in prop::array::uniform3(-2.0f32..2.0),
        target in prop::array::uniform3(-1.0f32..1.0),
        pixels in 20.0f32..120.0,
        log_rate in 1.0f32..5.0,
        moving: bool,
    ) {
        let wander = &[0.0f32, 0.3][..1 + usize::from(moving)];
        let surface = if ring { torus(wander) } else { sphere(wander) };
        let view = camera(eye.into(), target.into(), pixels);
        let metric = RasterMetric::new(&vec![vec![view]; wander.len()], DVec3::ZERO);
        let mesh = diced(&surface, &metric, log_rate.exp(), wander.len());
        for k in 0..wander.len() {
            prop_assert_eq!(open_edges(&mesh, k), 0);
        }
    }
}

#[test]
fn area_and_volume_are_those_of_the_closed_forms() {
    let metric = RasterMetric::uniform(100.0);
    for (surface, area, volume) in [
        (sphere(&[0.0]), 4.0 * PI, 4.0 / 3.0 * PI),
        (
            torus(&[0.0]),
            4.0 * PI * PI * 0.25 * 0.75,
            2.0 * PI * PI * 0.0625 * 0.75,
        ),
    ] {
        let found = area_and_volume(&diced(&surface, &metric, 1.0, 1), 0);
        assert!((found.0 / area - 1.0).abs() < 3e-4, "{found:?} {area}");
        assert!((found.1 / volume - 1.0).abs() < 6e-4, "{found:?} {volume}");
    }
}

#[test]
fn normals_at_poles_point_along_the_axis() {
    let mesh = diced(&sphere(&[0.0]), &RasterMetric::uniform(60.0), 1.0, 1);
    let mut poles = 0;
    for g in 0..mesh.grids.len() {
        let normals = mesh.grid_normals(g, 0);
        for (p, n) in mesh.grid_positions(g, 0).iter().zip(normals) {
            let n = octahedral::decode(*n);
            assert!((n - *p).length() < 2e-3, "{p} {n}");
            poles += u32::from(p.z.abs() == 1.0);
        }
    }
    assert!(poles > 0);
}
