//! Diced curves: closed, evaluated right, as wide as they should be, steady between keys, lean.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use glam::{DAffine3, DMat4, DVec3, Vec3};
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::camera::Camera;
use hdtrapeze_core::curve::{CurveDice, CurveSet, dice};
use hdtrapeze_core::dice::RasterMetric;
use hdtrapeze_core::grid::{DicedMesh, Grid, octahedral};
use hdtrapeze_core::motion::{PointPath, Shutter};
use hdtrapeze_core::scene::{
    CameraDesc, CurveBasis, CurveForm, CurveWrap, CurvesDesc, PointsSamples, RenderSettings,
    TransformSamples,
};
use hdtrapeze_core::translate::curves::check;
use hdtrapeze_core::translate::measure::views_at_keys;
use hdtrapeze_core::translate::points::Bends;
use hdtrapeze_core::translate::values::Values;
use proptest::prelude::*;

const SHUTTER: Shutter = Shutter {
    open: 0.0,
    close: 1.0,
};
const BASES: [CurveBasis; 5] = [
    CurveBasis::Linear,
    CurveBasis::Bezier,
    CurveBasis::Bspline,
    CurveBasis::CatmullRom,
    CurveBasis::Hermite,
];
const WRAPS: [CurveWrap; 3] = [
    CurveWrap::Nonperiodic,
    CurveWrap::Periodic,
    CurveWrap::Pinned,
];

fn set(basis: CurveBasis, wrap: CurveWrap, counts: &[i32], keys: &[Vec<Vec3>]) -> CurveSet {
    let times = (0..keys.len()).map(|k| k as f64 / (keys.len() - 1).max(1) as f64);
    let desc = CurvesDesc {
        basis,
        wrap,
        vertex_counts: Arc::new(counts.to_vec()),
        points: PointsSamples {
            times: times.collect(),
            points: keys.iter().map(|k| Arc::new(k.clone())).collect(),
            ..PointsSamples::default()
        },
        form: None,
    };
    let mut warnings = Vec::new();
    let curves = check("/c", &desc, SHUTTER, Bends::Samples(2), &mut warnings).unwrap();
    CurveSet {
        curves,
        widths: Values::Constant(vec![0.2]),
        normals: None,
        channels: vec![],
    }
}

/// A camera of 1000 pixels across that sees 1 unit at distance 1.
fn camera_at(matrices: &[DMat4]) -> Camera {
    let desc = CameraDesc {
        transform: vec![TransformSamples {
            times: (0..matrices.len()).map(|i| i as f64).collect(),
            matrices: matrices.to_vec(),
            ..TransformSamples::default()
        }],
        horizontal_aperture: 1.0,
        vertical_aperture: 1.0,
        focal_length: 1.0,
        clipping: [0.1, 1000.0],
        ..CameraDesc::default()
    };
    let settings = RenderSettings {
        resolution: [1000, 1000],
        ..RenderSettings::default()
    };
    Camera::new(&desc, &settings, SHUTTER).unwrap().0
}

/// A camera at (0, 0, 10), 100 pixels a unit at the origin, that moves by `step` over the shutter.
fn camera(step: DVec3) -> Camera {
    let at = |p: DVec3| DMat4::from_translation(DVec3::new(0.0, 0.0, 10.0) + p);
    camera_at(&[at(DVec3::ZERO), at(step)])
}

/// A camera at `eye` that looks at the origin.
fn camera_towards_origin(eye: DVec3) -> Camera {
    let z = eye.normalize();
    let x = DVec3::new(0.1, 1.0, 0.0).cross(z).normalize();
    let y = z.cross(x);
    camera_at(&[DMat4::from_cols(
        x.extend(0.0),
        y.extend(0.0),
        z.extend(0.0),
        eye.extend(1.0),
    )])
}

fn run(
    set: &CurveSet,
    path: &PointPath,
    metric: &RasterMetric,
    camera: Option<&Camera>,
    form: CurveForm,
) -> DicedMesh {
    let input = CurveDice {
        set,
        path,
        metric,
        camera,
        form,
        shading_rate: 1.0,
        max_micropolygons: 1 << 30,
        cancel: &AtomicBool::new(false),
    };
    let diced = dice(&input).unwrap();
    assert!(!diced.coarsened);
    diced.mesh
}

/// As instances have it: object space, a fixed scale, nothing faces the camera.
fn tubes(set: &CurveSet, pixels: f32) -> DicedMesh {
    let path = PointPath::identity(&set.curves.points.times, DVec3::ZERO);
    run(
        set,
        &path,
        &RasterMetric::uniform(pixels),
        None,
        CurveForm::Auto,
    )
}

/// As a prim that stands still in the world has it.
fn seen(set: &CurveSet, camera: &Camera, form: CurveForm) -> DicedMesh {
    let path = PointPath::identity(&set.curves.points.times, DVec3::ZERO);
    placed(set, camera, form, &path)
}

fn placed(set: &CurveSet, camera: &Camera, form: CurveForm, path: &PointPath) -> DicedMesh {
    let metric = RasterMetric::new(&views_at_keys(camera, path.key_times()), path.origin());
    run(set, path, &metric, Some(camera), form)
}

/// Points that no curve of any basis runs straight through.
fn wiggle(count: usize, phase: f32) -> Vec<Vec3> {
    let point = |i: usize| {
        let a = i as f32 * 2.2 + phase;
        Vec3::new(i as f32 * 0.4 - 2.0, a.sin() * 0.7, (1.3 * a).cos() * 0.7)
    };
    (0..count).map(point).collect()
}

/// Counts that fit every basis: 9 for periodic Bezier curves, else 10.
fn fitting(basis: CurveBasis, wrap: CurveWrap) -> usize {
    match (basis, wrap) {
        (CurveBasis::Bezier, CurveWrap::Periodic) => 9,
        _ => 10,
    }
}

type Corner = Vec<[u32; 3]>;

/// How often each edge of a cell occurs, by the bits of its ends at every key; edges without length
/// are left out.
fn edges(mesh: &DicedMesh) -> HashMap<[Corner; 2], i32> {
    let mut edges = HashMap::new();
    for (g, grid) in mesh.grids.iter().enumerate() {
        let row = usize::from(grid.nu) + 1;
        let corner = |i: usize, j: usize| -> Corner {
            let at = |k| mesh.grid_positions(g, k)[j * row + i].to_array();
            // -0 is 0.
            (0..mesh.key_count())
                .map(|k| at(k).map(|x| (x + 0.0).to_bits()))
                .collect()
        };
        for j in 0..usize::from(grid.nv) {
            for i in 0..usize::from(grid.nu) {
                let cell = [
                    corner(i, j),
                    corner(i + 1, j),
                    corner(i + 1, j + 1),
                    corner(i, j + 1),
                ];
                for e in 0..4 {
                    let (a, b) = (cell[e].clone(), cell[(e + 1) % 4].clone());
                    if a != b {
                        let (key, sign) = if a < b { ([a, b], 1) } else { ([b, a], -1) };
                        let count: &mut i32 = edges.entry(key).or_default();
                        // Once in each direction: the cells on both sides have their outsides alike.
                        *count += sign;
                    }
                }
            }
        }
    }
    edges
}

#[test]
fn tubes_are_closed_at_every_key() {
    for basis in BASES {
        for wrap in WRAPS {
            let n = fitting(basis, wrap);
            let keys = [wiggle(n, 0.0), wiggle(n, 0.5)];
            for pixels in [12.0, 300.0] {
                let set = set(basis, wrap, &[n as i32], &keys);
                let mesh = tubes(&set, pixels);
                assert!(mesh.key_count() > 1);
                let open = edges(&mesh).values().filter(|&&n| n != 0).count();
                assert_eq!(open, 0, "{basis:?} {wrap:?} at {pixels}");
            }
        }
    }
}

/// The outside of every cell of a straight tube is out.
#[test]
fn tubes_show_their_outside() {
    let line = vec![vec![Vec3::new(-1.0, 0.1, 0.3), Vec3::new(2.0, 1.0, 0.0)]];
    let set = set(CurveBasis::Linear, CurveWrap::Nonperiodic, &[2], &line);
    let mesh = tubes(&set, 100.0);
    let (a, b) = (line[0][0].as_dvec3(), line[0][1].as_dvec3());
    let along = (b - a).normalize();
    let mut caps = 0;
    for (g, grid) in mesh.grids.iter().enumerate() {
        let (p, n) = (mesh.grid_positions(g, 0), mesh.grid_normals(g, 0));
        let row = usize::from(grid.nu) + 1;
        for j in 0..usize::from(grid.nv) {
            for i in 0..usize::from(grid.nu) {
                let at = j * row + i;
                let q = [at, at + 1, at + row + 1, at + row].map(|v| p[v].as_dvec3());
                let normal = (q[2] - q[0]).cross(q[3] - q[1]).normalize();
                let middle = (q[0] + q[1] + q[2] + q[3]) / 4.0;
                let cap = normal.dot(along).abs() > 0.99;
                caps += usize::from(cap);
                let out = if cap {
                    middle - (a + b) / 2.0
                } else {
                    middle - (a + along * (middle - a).dot(along))
                };
                assert!(normal.dot(out) > 0.0, "grid {g} cell {i} {j}");
                let stored = octahedral::decode(n[at]).as_dvec3();
                assert!(stored.dot(normal) > 0.7);
            }
        }
    }
    assert!(caps >= 2 * 5, "both ends are closed: {caps}");
}

/// An independent evaluation: every segment as a polynomial through its values at four places, which
/// are found with repeated linear interpolation only.
fn reference(basis: CurveBasis, wrap: CurveWrap, p: &[DVec3]) -> Vec<DVec3> {
    let n = p.len();
    let periodic = wrap == CurveWrap::Periodic;
    let mut p = p.to_vec();
    if wrap == CurveWrap::Pinned && matches!(basis, CurveBasis::Bspline | CurveBasis::CatmullRom) {
        p.insert(0, p[0] * 2.0 - p[1]);
        p.push(p[n] * 2.0 - p[n - 1]);
    }
    let (step, take) = match basis {
        CurveBasis::Linear => (1, 2),
        CurveBasis::Bezier => (3, 4),
        CurveBasis::Hermite => (2, 4),
        CurveBasis::Bspline | CurveBasis::CatmullRom => (1, 4),
    };
    let mut out = Vec::new();
    let mut first = 0;
    while if periodic {
        first < n
    } else {
        first + take <= p.len()
    } {
        let q: Vec<DVec3> = (0..take).map(|i| p[(first + i) % p.len()]).collect();
        for i in 0..129 {
            let t = f64::from(i) / 128.0;
            let bezier = |mut q: Vec<DVec3>| {
                while q.len() > 1 {
                    q = q.windows(2).map(|w| w[0].lerp(w[1], t)).collect();
                }
                q[0]
            };
            out.push(match basis {
                CurveBasis::Linear | CurveBasis::Bezier => bezier(q.clone()),
                CurveBasis::Hermite => {
                    bezier(vec![q[0], q[0] + q[1] / 3.0, q[2] - q[3] / 3.0, q[2]])
                }
                // Knot insertion: the Bezier points of a uniform B-spline.
                CurveBasis::Bspline => {
                    let third = |a: DVec3, b: DVec3| (a * 2.0 + b) / 3.0;
                    let (b, c) = (third(q[1], q[2]), third(q[2], q[1]));
                    let a = (third(q[1], q[0]) + b) / 2.0;
                    let d = (third(q[2], q[3]) + c) / 2.0;
                    bezier(vec![a, b, c, d])
                }
                // Tangents are half the chord of the neighbours.
                CurveBasis::CatmullRom => bezier(vec![
                    q[1],
                    q[1] + (q[2] - q[0]) / 6.0,
                    q[2] - (q[3] - q[1]) / 6.0,
                    q[2],
                ]),
            });
        }
        first += step;
    }
    out
}

fn distance_to(polyline: &[DVec3], p: DVec3) -> f64 {
    polyline
        .windows(2)
        .map(|w| {
            let d = w[1] - w[0];
            let f = ((p - w[0]).dot(d) / d.length_squared().max(1e-30)).clamp(0.0, 1.0);
            (w[0] + d * f - p).length()
        })
        .fold(f64::INFINITY, f64::min)
}

/// What is at both edges of a ribbon, from station to station: across it is u.
fn pairs<'a, T>(grid: &Grid, at_vertices: &'a [T]) -> &'a [[T; 2]] {
    assert_eq!(grid.nu, 1);
    at_vertices.as_chunks().0
}

/// The middles of a ribbon's lattice, in order.
fn middles(mesh: &DicedMesh, key: usize) -> Vec<DVec3> {
    let mut out: Vec<DVec3> = Vec::new();
    for (g, grid) in mesh.grids.iter().enumerate() {
        let p = mesh.grid_positions(g, key);
        out.extend(
            pairs(grid, p)
                .iter()
                .map(|[a, b]| (a.as_dvec3() + b.as_dvec3()) / 2.0),
        );
    }
    out
}

#[test]
fn every_basis_and_wrap_follows_an_independent_evaluation() {
    let camera = camera(DVec3::ZERO);
    for basis in BASES {
        for wrap in WRAPS {
            let n = fitting(basis, wrap);
            let points = wiggle(n, 0.3);
            let mut set = set(basis, wrap, &[n as i32], std::slice::from_ref(&points));
            set.widths = Values::Constant(vec![0.002]);
            let mesh = seen(&set, &camera, CurveForm::Auto);
            let diced = middles(&mesh, 0);
            let doubles: Vec<DVec3> = points.iter().map(|p| p.as_dvec3()).collect();
            let exact = reference(basis, wrap, &doubles);
            // A tenth of a pixel is a thousandth of a unit; depth is seen at up to 20 times less.
            let tolerance = 0.03;
            let name = format!("{basis:?} {wrap:?}");
            for p in &diced {
                assert!(
                    distance_to(&exact, *p) < 2e-4,
                    "{name}: {p} is not on the curve"
                );
            }
            for p in &exact {
                let off = distance_to(&diced, *p);
                assert!(off < tolerance, "{name}: {p} is missed by {off}");
                let on_screen = |p: DVec3| DVec3::new(p.x, p.y, 0.0) * (1000.0 / (10.0 - p.z));
                let flat: Vec<DVec3> = diced.iter().map(|&p| on_screen(p)).collect();
                let off = distance_to(&flat, on_screen(*p));
                assert!(off < 0.13, "{name}: {off} pixels off");
            }
            for (a, b) in [
                (exact[0], diced[0]),
                (exact[exact.len() - 1], diced[diced.len() - 1]),
            ] {
                assert!(
                    (a - b).length() < 1e-5,
                    "{name}: ends at {b} rather than {a}"
                );
            }
        }
    }
}

#[test]
fn widths_are_interpolated_as_their_kind_says() {
    use CurveBasis::{Bezier, Bspline};
    let camera = camera(DVec3::ZERO);
    let line: Vec<Vec3> = (0..7)
        .map(|i| Vec3::new(i as f32 * 0.5 - 1.5, 0.0, 0.0))
        .collect();
    // (basis, widths, width at x)
    type Width = Box<dyn Fn(f64) -> f64>;
    let ramp = |x: f64, a: f64, b: f64| a + (b - a) * x.clamp(0.0, 1.0);
    let cases: Vec<(CurveBasis, Values, Width)> = vec![
        (Bezier, Values::Constant(vec![0.03]), Box::new(|_| 0.03)),
        (Bezier, Values::Uniform(vec![0.02]), Box::new(|_| 0.02)),
        // Two segments from -1.5 to 0 and on to 1.5: three values.
        (
            Bezier,
            Values::Varying(vec![0.01, 0.03, 0.02]),
            Box::new(move |x| {
                if x < 0.0 {
                    ramp((x + 1.5) / 1.5, 0.01, 0.03)
                } else {
                    ramp(x / 1.5, 0.03, 0.02)
                }
            }),
        ),
        // Cubic: 0.02 plus a bump of the middle control value, 3 s^2 t or 3 s t^2 times it.
        (
            Bezier,
            Values::Vertex(vec![0.02, 0.02, 0.02, 0.02, 0.035, 0.02, 0.02]),
            Box::new(|x| {
                let t = (x / 1.5).max(0.0);
                0.02 + 0.015 * 3.0 * t * (1.0 - t) * (1.0 - t)
            }),
        ),
        // Four segments of a B-spline, from -1 to 1: five varying values, linear in between.
        (
            Bspline,
            Values::Varying(vec![0.01, 0.02, 0.03, 0.02, 0.01]),
            Box::new(move |x: f64| ramp(1.0 - x.abs(), 0.01, 0.03)),
        ),
    ];
    for (basis, widths, expected) in cases {
        let mut set = set(
            basis,
            CurveWrap::Nonperiodic,
            &[7],
            std::slice::from_ref(&line),
        );
        set.widths = widths.clone();
        let mesh = seen(&set, &camera, CurveForm::Auto);
        let mut cells = 0;
        for (g, grid) in mesh.grids.iter().enumerate() {
            let p = mesh.grid_positions(g, 0);
            for edges in pairs(grid, p) {
                let [a, b] = edges.map(Vec3::as_dvec3);
                let want = expected(a.x);
                assert!(
                    ((a - b).length() - want).abs() < 1e-6,
                    "{widths:?}: {} at {} rather than {want}",
                    (a - b).length(),
                    a.x
                );
            }
            cells += grid.nv;
        }
        // What lies between is followed to a tenth of a pixel.
        let wants_more = matches!(widths, Values::Vertex(_));
        assert!(!wants_more || cells > 6, "{cells} cells");
    }
}

#[test]
fn ribbons_face_the_camera_with_their_full_width() {
    for eye in [
        DVec3::ZERO,
        DVec3::new(8.0, 0.0, -4.0),
        DVec3::new(0.0, -9.0, -9.0),
        DVec3::new(-3.0, 5.0, -16.0),
    ] {
        let camera = camera_towards_origin(DVec3::new(0.0, 0.0, 10.0) + eye);
        let at = DVec3::new(0.0, 0.0, 10.0) + eye;
        let basis = CurveBasis::Bspline;
        let mut set = set(basis, CurveWrap::Pinned, &[10], &[wiggle(10, 0.3)]);
        set.widths = Values::Constant(vec![0.02]);
        let mesh = seen(&set, &camera, CurveForm::Ribbons);
        assert_eq!(mesh.key_count(), 1);
        for g in 0..mesh.grids.len() {
            let p = mesh.grid_positions(g, 0);
            let n = mesh.grid_normals(g, 0);
            let grid = &mesh.grids[g];
            for (edges, normals) in pairs(grid, p).iter().zip(pairs(grid, n)) {
                let [a, b] = edges.map(Vec3::as_dvec3);
                assert!(((b - a).length() - 0.02).abs() < 1e-6);
                let view = (at - (a + b) / 2.0).normalize();
                assert!((b - a).normalize().dot(view).abs() < 1e-3);
                // Shaded round: towards the camera in the middle, to its own side at each edge.
                let [l, r] = normals.map(|n| octahedral::decode(n).as_dvec3());
                assert!((l + r).dot(view) > 0.0);
                let lean = (r - l).normalize().dot((b - a).normalize());
                assert!(lean > 0.999, "{lean}");
            }
        }
    }
}

#[test]
fn flat_ribbons_lie_across_their_normals() {
    let camera = camera(DVec3::ZERO);
    let line: Vec<Vec3> = (0..7)
        .map(|i| Vec3::new(i as f32 * 0.5 - 1.5, 0.0, 0.0))
        .collect();
    let mut set = set(CurveBasis::Bezier, CurveWrap::Nonperiodic, &[7], &[line]);
    // A quarter turn over the first segment, none over the second.
    let quarter = vec![0.0, 0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0];
    set.normals = Some(Values::Varying(quarter));
    for camera in [Some(&camera), None] {
        let mesh = match camera {
            Some(camera) => seen(&set, camera, CurveForm::Tubes),
            None => tubes(&set, 100.0),
        };
        for g in 0..mesh.grids.len() {
            let p = mesh.grid_positions(g, 0);
            let (grid, n) = (&mesh.grids[g], mesh.grid_normals(g, 0));
            for (i, (edges, normals)) in pairs(grid, p).iter().zip(pairs(grid, n)).enumerate() {
                let [a, b] = edges.map(Vec3::as_dvec3);
                let t = ((a.x + 1.5) / 1.5).min(1.0);
                let normal = DVec3::new(0.0, t, 1.0 - t).normalize();
                assert!(((b - a).length() - 0.2).abs() < 1e-6);
                assert!((b - a).dot(normal).abs() < 1e-6);
                let stored = octahedral::decode(normals[0]).as_dvec3();
                assert!((stored - normal).length() < 1e-3, "{stored} {normal}");
                let out = (p[1] - p[0]).as_dvec3().cross((p[2] - p[0]).as_dvec3());
                assert!(out.dot(stored) > 0.0 || i > 1);
            }
        }
    }
}

/// Corners: straight pieces keep their width up to the miter.
#[test]
fn polylines_are_mitred() {
    let points = vec![
        Vec3::new(-1.0, 0.0, 0.0),
        Vec3::new(0.0, 0.0, 0.0),
        Vec3::new(0.0, 1.0, 0.0),
    ];
    let camera = camera(DVec3::ZERO);
    let set = set(CurveBasis::Linear, CurveWrap::Nonperiodic, &[3], &[points]);
    let round = tubes(&set, 100.0);
    let ribbon = seen(&set, &camera, CurveForm::Ribbons);
    for (mesh, slack) in [(&ribbon, 1e-6), (&round, 0.01)] {
        let p: Vec<Vec3> = (0..mesh.grids.len())
            .flat_map(|g| mesh.grid_positions(g, 0).to_vec())
            .collect();
        let most = |f: fn(&Vec3) -> f32| p.iter().map(f).fold(f32::NEG_INFINITY, f32::max);
        assert!(
            (most(|p| p.x) - 0.1).abs() < slack,
            "right edge {}",
            most(|p| p.x)
        );
        assert!((most(|p| -p.y) - 0.1).abs() < slack, "lower edge");
        let corner = p
            .iter()
            .any(|p| (*p - Vec3::new(0.1, -0.1, p.z)).length() < 2.0 * slack);
        assert!(corner || slack > 1e-3, "the outer corner is sharp");
    }
}

/// Frames do not flip from key to key, nor where a curve turns by half between two keys.
#[test]
fn tubes_do_not_twist_between_keys() {
    for basis in [CurveBasis::Linear, CurveBasis::CatmullRom] {
        let turn = |angle: f32| -> Vec<Vec3> {
            wiggle(10, 0.0)
                .into_iter()
                .map(|p| glam::Quat::from_rotation_z(angle) * p)
                .collect()
        };
        let keys: Vec<Vec<Vec3>> = (0..9).map(|i| turn(i as f32 * 0.4)).collect();
        let set = set(basis, CurveWrap::Pinned, &[10], &keys);
        let mesh = tubes(&set, 30.0);
        // Opposite vertices of a cross-section stay apart: chords between keys do not cut through it.
        for g in 0..mesh.grids.len() {
            let (nu, nv) = (mesh.grids[g].nu, mesh.grids[g].nv);
            if nu == 1 {
                continue;
            }
            let row = usize::from(nu) + 1;
            for k in 1..mesh.key_count() {
                let half = |i: usize, j: usize| {
                    let at = |k: usize| mesh.grid_positions(g, k)[j * row + i].as_dvec3();
                    (at(k - 1) + at(k)) / 2.0
                };
                let far = usize::from(nv) / 2;
                for i in 0..row {
                    let width = (half(i, 0) - half(i, far)).length();
                    assert!(width > 0.14, "{basis:?}: {width} between keys {k}");
                }
            }
        }
    }
}

#[test]
fn keys_are_added_where_facing_turns_and_only_there() {
    let hair = |z: f32| vec![vec![Vec3::new(-1.0, 0.0, z), Vec3::new(1.0, 0.3, z)]];
    let near = set(CurveBasis::Linear, CurveWrap::Nonperiodic, &[2], &hair(9.0));
    let far = set(
        CurveBasis::Linear,
        CurveWrap::Nonperiodic,
        &[2],
        &hair(-50.0),
    );
    let fly = camera(DVec3::new(0.0, 1.5, 0.0));
    let mesh = seen(&near, &fly, CurveForm::Ribbons);
    assert!(mesh.key_count() > 2, "{} keys", mesh.key_count());
    assert_eq!(seen(&far, &fly, CurveForm::Ribbons).key_count(), 1);
    assert_eq!(seen(&near, &fly, CurveForm::Tubes).key_count(), 1);
    // At each key the edge is where that key's camera sees it.
    let p = |k: usize| mesh.grid_positions(0, k);
    for (k, &time) in mesh.key_times.iter().enumerate() {
        let eye = DVec3::new(0.0, 1.5 * f64::from(time), 10.0);
        let [a, b] = pairs(&mesh.grids[0], p(k))[0].map(Vec3::as_dvec3);
        let view = (eye - (a + b) / 2.0).normalize();
        assert!((b - a).normalize().dot(view).abs() < 1e-3);
    }
}

/// Where M(t) shears and turns what moves itself, a ribbon's middle follows its points, and its edges
/// are the outline of the sheared tube.
#[test]
fn ribbons_follow_their_points_and_transform() {
    let keys = [
        vec![Vec3::new(-1.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 0.0)],
        vec![Vec3::new(-1.0, 0.5, 0.0), Vec3::new(1.0, 0.0, 0.5)],
    ];
    let mut set = set(CurveBasis::Linear, CurveWrap::Nonperiodic, &[2], &keys);
    set.widths = Values::Constant(vec![0.03]);
    let shear = |s: f64| {
        DAffine3::from_cols_array(&[1.0, 0.0, 0.0, s, 1.0, 0.0, 0.0, 0.0, 2.0, 0.2 * s, 0.0, 0.0])
    };
    let matrices = [shear(0.0), shear(0.8)];
    let path = PointPath::new(&[0.0, 1.0], vec![0.0, 1.0], &matrices, DVec3::X);
    let mesh = placed(&set, &camera(DVec3::ZERO), CurveForm::Ribbons, &path);
    for (k, &time) in mesh.key_times.iter().enumerate() {
        let t = f64::from(time);
        let m = shear(0.8 * t);
        let points = [0, 1].map(|i| keys[0][i].as_dvec3().lerp(keys[1][i].as_dvec3(), t));
        let way = points[1] - points[0];
        let ends = pairs(&mesh.grids[0], mesh.grid_positions(0, k))[0];
        let [a, b] = ends.map(|p| p.as_dvec3() + DVec3::X);
        let middle = m.transform_point3(points[0]);
        assert!(((a + b) / 2.0 - middle).length() < 1e-5);
        // Back in object space the edge is at a right angle to the curve and to the ray to the eye.
        let inverse = m.inverse();
        let edge = inverse.transform_vector3(b - a);
        let eye = inverse.transform_point3(DVec3::new(0.0, 0.0, 10.0)) - points[0];
        assert!((edge.length() - 0.03).abs() < 1e-5);
        assert!(edge.normalize().dot(way.normalize()).abs() < 1e-3);
        assert!(edge.normalize().dot(eye.normalize()).abs() < 1e-3);
    }
}

#[test]
fn far_hair_is_a_few_cells_and_near_hair_follows_its_bends() {
    let hair: Vec<Vec3> = (0..11)
        .map(|i| {
            let t = i as f32 / 10.0;
            Vec3::new(0.1 * (5.0 * t).sin(), t, 0.1 * (4.0 * t).cos())
        })
        .collect();
    let camera = camera(DVec3::ZERO);
    let cells = |z: f32| {
        let placed = hair.iter().map(|p| *p + Vec3::Z * z).collect();
        let mut set = set(CurveBasis::Bspline, CurveWrap::Pinned, &[11], &[placed]);
        set.widths = Values::Constant(vec![0.002]);
        seen(&set, &camera, CurveForm::Auto).cell_count()
    };
    // 100, 10 and 2 pixels long, of 10 segments each.
    let found = [cells(0.0), cells(-90.0), cells(-490.0)];
    assert!((8..=32).contains(&found[0]), "{found:?}");
    assert!((2..=6).contains(&found[1]), "{found:?}");
    assert!((1..=2).contains(&found[2]), "{found:?}");
}

/// 1000 hairs of 8 cubic segments, 100 pixels long: what a segment takes.
#[test]
fn fur_is_lean() {
    let count = 1000;
    let mut points = Vec::new();
    for h in 0..count {
        let root = Vec3::new((h % 40) as f32 * 0.05 - 1.0, (h / 40) as f32 * 0.05, 0.0);
        points.extend((0..9).map(|i| {
            let t = i as f32 / 8.0;
            root + Vec3::new(0.1 * (4.0 * t + h as f32).sin(), t, 0.2 * t * t)
        }));
    }
    let counts = vec![9; count];
    let later: Vec<Vec3> = points
        .iter()
        .map(|p| *p + Vec3::new(0.2 * p.y, 0.0, 0.0))
        .collect();
    let segments = (count * 8) as f64;
    let measure = |keys: &[Vec<Vec3>]| {
        let mut set = set(CurveBasis::CatmullRom, CurveWrap::Pinned, &counts, keys);
        set.widths = Values::Constant(vec![0.004]);
        let mesh = seen(&set, &camera(DVec3::ZERO), CurveForm::Auto);
        let stats = *ObjectGeometry::new(mesh).stats();
        println!(
            "{} keys: {:.1} cells, {:.0} bytes of geometry, {:.0} of hierarchy a segment",
            keys.len(),
            stats.cells as f64 / segments,
            stats.mesh_bytes as f64 / segments,
            stats.bvh_bytes as f64 / segments
        );
        [stats.cells, stats.mesh_bytes, stats.bvh_bytes].map(|n| n as f64 / segments)
    };
    let [cells, geometry, hierarchy] = measure(&[points.clone()]);
    assert!(cells < 2.5 && geometry < 90.0 && hierarchy < 75.0);
    let [cells, geometry, hierarchy] = measure(&[points, later]);
    assert!(cells < 2.5 && geometry < 150.0 && hierarchy < 130.0);
}

#[test]
fn a_budget_makes_curves_coarser() {
    let set = set(
        CurveBasis::CatmullRom,
        CurveWrap::Pinned,
        &[10],
        &[wiggle(10, 0.0)],
    );
    let path = PointPath::identity(&[0.0], DVec3::ZERO);
    let mut input = CurveDice {
        set: &set,
        path: &path,
        metric: &RasterMetric::uniform(1000.0),
        camera: None,
        form: CurveForm::Auto,
        shading_rate: 1.0,
        max_micropolygons: 1 << 30,
        cancel: &AtomicBool::new(false),
    };
    let all = dice(&input).unwrap().mesh.cell_count() as u64;
    input.max_micropolygons = all / 3;
    let less = dice(&input).unwrap();
    assert!(less.coarsened && less.mesh.cell_count() as u64 <= all / 3);
    let stop = AtomicBool::new(true);
    input.cancel = &stop;
    assert!(dice(&input).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever points coincide, reverse, or lie far off, everything is finite.
    #[test]
    fn nothing_that_is_not_finite_comes_out(
        basis in 0..5usize,
        wrap in 0..3usize,
        form in 0..3usize,
        counts in prop::collection::vec(1..9i32, 1..4),
        places in prop::collection::vec(0..5usize, 64),
        widths in prop::collection::vec(0.0f32..2.0, 4),
        flat in any::<bool>(),
    ) {
        let far = [Vec3::ZERO, Vec3::X, Vec3::new(0.0, 0.0, 10.0), Vec3::splat(1e6), -Vec3::X];
        let total = counts.iter().sum::<i32>() as usize;
        let key = |shift: usize| -> Vec<Vec3> {
            (0..total).map(|i| far[places[(i + shift) % 64]]).collect()
        };
        let desc = CurvesDesc {
            basis: BASES[basis],
            wrap: WRAPS[wrap],
            vertex_counts: Arc::new(counts.clone()),
            points: PointsSamples {
                times: vec![0.0, 1.0],
                points: vec![Arc::new(key(0)), Arc::new(key(7))],
                ..PointsSamples::default()
            },
            form: None,
        };
        let Some(curves) = check("/c", &desc, SHUTTER, Bends::Samples(2), &mut Vec::new()) else {
            return Ok(());
        };
        let uniform = counts.iter().enumerate().map(|(i, _)| widths[i % 4]).collect();
        let set = CurveSet {
            curves,
            widths: Values::Uniform(uniform),
            normals: flat.then(|| Values::Constant(vec![0.0, 0.0, 1.0])),
            channels: vec![],
        };
        let form = [CurveForm::Auto, CurveForm::Ribbons, CurveForm::Tubes][form];
        let camera = camera(DVec3::new(0.0, 3.0, 0.0));
        for mesh in [seen(&set, &camera, form), tubes(&set, 50.0)] {
            prop_assert!(mesh.positions.iter().all(|p| p.is_finite()));
            prop_assert!(mesh.positions.len() < 40_000_000);
        }
    }
}
