//! Implicit surfaces, diced: closed, exact, and of the right size, from anywhere.

mod lattice;

use glam::{DAffine3, DVec2, DVec3, Vec2, Vec3};
use hdtrapeze_core::dice::{DiceInput, DiceOutput, RasterMetric, RasterView, dice};
use hdtrapeze_core::grid::octahedral;
use hdtrapeze_core::motion::{PointPath, Shutter};
use hdtrapeze_core::scene::{Axis, ImplicitDesc, ImplicitKind};
use hdtrapeze_core::surface::{
    ChannelInfo, LimitEvaluator, LimitSamples, LimitSurface, PatchDomain,
};
use hdtrapeze_core::translate::implicit::{CheckedImplicit, check};
use lattice::{area_and_volume, camera, open_edges};
use proptest::prelude::*;
use std::f64::consts::PI;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

fn make(kind: ImplicitKind, axis: Axis, sizes: &[[f64; 3]]) -> CheckedImplicit {
    let desc = ImplicitDesc {
        kind,
        axis,
        times: (0..sizes.len()).map(|i| i as f64).collect(),
        sizes: sizes.to_vec(),
        ..ImplicitDesc::default()
    };
    let shutter = Shutter {
        open: 0.0,
        close: (sizes.len() - 1) as f64,
    };
    let mut warnings = Vec::new();
    let out = check("/i", &desc, shutter, &mut warnings).expect("something to render");
    assert!(warnings.is_empty());
    out
}

fn diced(shape: &CheckedImplicit, metric: &RasterMetric, rate: f32) -> DiceOutput {
    let output = dice(&DiceInput {
        surface: shape.surface.as_ref(),
        path: &PointPath::identity(&shape.points.times, DVec3::ZERO),
        metric,
        shading_rate: rate,
        with_normals: true,
        polygons_coarse: true,
        max_micropolygons: 400_000,
        cancel: &AtomicBool::new(false),
    })
    .expect("dicing");
    assert_eq!(output.dropped_faces, 0);
    output
}

/// Each kind at two sizes of its own, and the distance of a point from it at the first.
const KINDS: [(ImplicitKind, [[f64; 3]; 2]); 8] = [
    (ImplicitKind::Sphere, [[1.0, 0.0, 0.0], [1.7, 0.0, 0.0]]),
    (ImplicitKind::Cylinder, [[2.0, 0.8, 0.8], [1.0, 1.2, 1.2]]),
    (ImplicitKind::Cylinder, [[1.0, 0.3, 1.1], [1.5, 0.0, 1.1]]),
    (ImplicitKind::Cone, [[2.0, 0.7, 0.0], [2.0, 0.1, 0.0]]),
    (ImplicitKind::Capsule, [[1.0, 0.5, 0.5], [2.0, 0.7, 0.7]]),
    (ImplicitKind::Capsule, [[1.5, 0.9, 0.2], [1.5, 0.2, 0.9]]),
    (ImplicitKind::Capsule, [[0.8, 0.1, 0.6], [0.8, 0.6, 0.0]]),
    (ImplicitKind::Cube, [[1.5, 0.0, 0.0], [1.0, 0.0, 0.0]]),
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 32, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any camera, inside and outside and through the surface, at any rate and at every key.
    #[test]
    fn closed_from_anywhere(
        which in 0usize..8,
        axis in 0usize..3,
        eye in prop::array::uniform3(-2.0f32..2.0),
        target in prop::array::uniform3(-1.0f32..1.0),
        pixels in 20.0f32..150.0,
        log_rate in 1.0f32..5.0,
        moving: bool,
    ) {
        let (kind, sizes) = KINDS[which];
        let axis = [Axis::X, Axis::Y, Axis::Z][axis];
        let shape = make(kind, axis, &sizes[..1 + usize::from(moving)]);
        let keys = shape.points.times.len();
        prop_assert_eq!(keys > 1, moving);
        let view = camera(eye.into(), target.into(), pixels);
        let metric = RasterMetric::new(&vec![vec![view]; keys], DVec3::ZERO);
        let mesh = diced(&shape, &metric, log_rate.exp()).mesh;
        for k in 0..keys {
            prop_assert_eq!(open_edges(&mesh, k), 0);
        }
    }
}

/// Distance to each of the closed surfaces of [`KINDS`], standing along z, at its first size.
fn off_surface(which: usize, p: DVec3) -> f64 {
    let (kind, [[a, b, c], _]) = KINDS[which];
    let q = DVec2::new(p.truncate().length(), p.z);
    let segment = |p: DVec2, q: DVec2, at: DVec2| {
        let f = ((at - p).dot(q - p) / (q - p).length_squared()).clamp(0.0, 1.0);
        (at - p.lerp(q, f)).length()
    };
    match kind {
        ImplicitKind::Sphere => (p.length() - a).abs(),
        ImplicitKind::Cube => (p.abs().max_element() - 0.5 * a).abs(),
        ImplicitKind::Capsule => {
            let lean = ((b - c) / a).atan();
            let ball = |r: f64, z: f64| {
                (q - DVec2::new(0.0, z - r * lean.tan())).length() - r / lean.cos()
            };
            let (lower, upper) = (ball(b, -0.5 * a), ball(c, 0.5 * a));
            let side = segment(DVec2::new(b, -0.5 * a), DVec2::new(c, 0.5 * a), q);
            lower.abs().min(upper.abs()).min(side)
        }
        _ => {
            let c = if kind == ImplicitKind::Cone { 0.0 } else { c };
            let (h, zero) = (0.5 * a, DVec2::ZERO);
            let (low, high) = (DVec2::new(b, -h), DVec2::new(c, h));
            let cap = |rim: DVec2| segment(zero + DVec2::Y * rim.y, rim + DVec2::X * 1e-9, q);
            segment(low, high, q).min(cap(low)).min(cap(high))
        }
    }
}

#[test]
fn every_vertex_is_on_the_surface_and_normals_point_outward() {
    for (which, &(kind, sizes)) in KINDS.iter().enumerate() {
        let shape = make(kind, Axis::Z, &sizes[..1]);
        for (rate, eye) in [
            (2.0, Vec3::new(0.3, 2.0, 3.0)),
            (30.0, Vec3::new(0.1, 0.2, 0.3)),
        ] {
            let view = camera(eye, Vec3::ZERO, 300.0);
            let metric = RasterMetric::new(&[vec![view]], DVec3::ZERO);
            let mesh = diced(&shape, &metric, rate).mesh;
            let worst = mesh
                .positions
                .iter()
                .map(|p| off_surface(which, p.as_dvec3()))
                .fold(0.0, f64::max);
            // Half a unit in the last place of each coordinate.
            assert!(worst < 2.1e-7, "{kind:?}: {worst:e}");
            for (g, _) in mesh.grids.iter().enumerate() {
                if mesh.normal_key_count == 0 {
                    continue; // flat
                }
                let normals = mesh.grid_normals(g, 0);
                for (p, n) in mesh.grid_positions(g, 0).iter().zip(normals) {
                    let n = octahedral::decode(*n).as_dvec3();
                    // All are convex: what lies farther out along the normal is outside.
                    let out = (p.as_dvec3() + n * 10.0).length();
                    let inward = (p.as_dvec3() - n * 10.0).length();
                    assert!(out > inward, "{kind:?} {p} {n}");
                }
            }
        }
    }
}

#[test]
fn area_and_volume_are_those_of_the_closed_forms() {
    let frustum = |h: f64, a: f64, b: f64| {
        let slant = ((a - b).powi(2) + h * h).sqrt();
        let area = PI * (a * a + b * b + (a + b) * slant);
        (area, PI * h / 3.0 * (a * a + a * b + b * b))
    };
    let ball = |r: f64| (4.0 * PI * r * r, 4.0 / 3.0 * PI * r.powi(3));
    let capsule = |h: f64, a: f64, b: f64| {
        // Two parts of spheres, and the part of a cone between them.
        let lean = ((a - b) / h).atan();
        let cap = |rim: f64, up: f64| {
            let r = rim / lean.cos();
            let height = r * (1.0 - up * lean.sin());
            let volume = PI * height * height * (r - height / 3.0);
            (2.0 * PI * r * height, volume)
        };
        let ((a1, v1), (a2, v2)) = (cap(a, -1.0), cap(b, 1.0));
        let slant = ((a - b).powi(2) + h * h).sqrt();
        let volume = PI * h / 3.0 * (a * a + a * b + b * b);
        (a1 + a2 + PI * (a + b) * slant, v1 + v2 + volume)
    };
    let expected = [
        ball(1.0),
        frustum(2.0, 0.8, 0.8),
        frustum(1.0, 0.3, 1.1),
        frustum(2.0, 0.7, 0.0),
        capsule(1.0, 0.5, 0.5),
        capsule(1.5, 0.9, 0.2),
        capsule(0.8, 0.1, 0.6),
        (6.0 * 1.5 * 1.5, 1.5f64.powi(3)),
    ];
    for (&(kind, sizes), (area, volume)) in KINDS.iter().zip(expected) {
        let shape = make(kind, Axis::Y, &sizes[..1]);
        let mesh = diced(&shape, &RasterMetric::uniform(100.0), 1.0).mesh;
        let found = area_and_volume(&mesh, 0);
        // A chord of 1/100 on a radius of 1 misses by 1/80000; more where radii are smaller.
        assert!(
            (found.0 / area - 1.0).abs() < 2e-4,
            "{kind:?} {found:?} {area}"
        );
        assert!(
            (found.1 / volume - 1.0).abs() < 3e-4,
            "{kind:?} {found:?} {volume}"
        );
        assert!(found.0 < area * (1.0 + 1e-6) && found.1 < volume * (1.0 + 1e-6));
    }
}

#[test]
fn cells_are_even_and_few() {
    // A sphere 200 pixels wide all around: cells of about a pixel.
    let sphere = make(ImplicitKind::Sphere, Axis::Z, &[[1.0; 3]]);
    let output = diced(&sphere, &RasterMetric::uniform(100.0), 1.0);
    let cells = output.mesh.cell_count() as f64 / (4.0 * PI * 1.0e4);
    println!("{cells} cells a square pixel");
    assert!((0.7..1.3).contains(&cells), "{cells}");
    // One that is smaller than a pixel is six cells.
    let output = diced(&sphere, &RasterMetric::uniform(0.3), 1.0);
    assert_eq!(output.mesh.cell_count(), 6);
}

#[test]
fn normals_at_the_tip_of_a_cone_are_those_of_its_side() {
    let cone = make(ImplicitKind::Cone, Axis::Z, &[[2.0, 1.0, 0.0]]);
    let mesh = diced(&cone, &RasterMetric::uniform(40.0), 1.0).mesh;
    let up = 1.0 / 5f32.sqrt();
    let mut around = Vec::new();
    for g in 0..mesh.grids.len() {
        let normals = mesh
            .grid_normals(g, 0)
            .iter()
            .map(|&n| octahedral::decode(n));
        for (p, n) in mesh.grid_positions(g, 0).iter().zip(normals) {
            if *p == Vec3::Z {
                assert!((n.z - up).abs() < 1e-3, "{n}");
                around.push(n.y.atan2(n.x));
            }
        }
    }
    around.sort_by(f32::total_cmp);
    let gap = around.windows(2).map(|w| w[1] - w[0]).fold(0.0, f32::max);
    assert!(gap < 0.5, "normals turn by up to {gap} at once");
}

/// A camera at `z`, looking down -z, with a small image.
fn small_image(z: f64, pixels: f32, orthographic: bool, near: f32) -> RasterMetric {
    let view = RasterView {
        world_to_camera: DAffine3::from_translation(DVec3::new(0.0, 0.0, -z)),
        scale: Vec2::splat(pixels),
        centre: Vec2::new(32.0, 18.0),
        orthographic,
        near,
        size: Vec2::new(64.0, 36.0),
    };
    RasterMetric::new(&[vec![view]], DVec3::ZERO)
}

#[test]
fn what_reaches_far_beyond_the_image_stays_cheap() {
    let around = make(ImplicitKind::Sphere, Axis::Z, &[[1.0e8, 0.0, 0.0]]);
    let long_lens = diced(&around, &small_image(10.0, 1.5e4, false, 0.1), 1.0);
    let wide = make(ImplicitKind::Cylinder, Axis::Z, &[[1.0, 1.0e4, 1.0e4]]);
    let orthographic = diced(&wide, &small_image(10.0, 30.0, true, 0.1), 1.0);
    for output in [long_lens, orthographic] {
        assert!(!output.coarsened);
        let cells = output.mesh.cell_count();
        assert!((64 * 36 / 2..100_000).contains(&cells), "{cells}");
    }
}

/// A surface with calm edges around noise, as numbers that f32 cannot hold make it; counts what is asked
/// of it.
struct Noisy<'a>(&'a dyn LimitSurface, AtomicU64);

impl LimitSurface for Noisy<'_> {
    fn face_count(&self) -> usize {
        self.0.face_count()
    }
    fn face_vertices(&self, face: u32) -> &[u32] {
        self.0.face_vertices(face)
    }
    fn element(&self, face: u32) -> u32 {
        self.0.element(face)
    }
    fn key_count(&self) -> usize {
        self.0.key_count()
    }
    fn channels(&self) -> &[ChannelInfo] {
        self.0.channels()
    }
    fn is_polygonal(&self) -> bool {
        self.0.is_polygonal()
    }
    fn evaluator(&self) -> Box<dyn LimitEvaluator + '_> {
        Box::new(NoisyEvaluator(self.0.evaluator(), &self.1))
    }
}

struct NoisyEvaluator<'a>(Box<dyn LimitEvaluator + 'a>, &'a AtomicU64);

impl LimitEvaluator for NoisyEvaluator<'_> {
    fn bind(&mut self, face: u32) {
        self.0.bind(face);
    }
    fn evaluate(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        normals: bool,
        out: &mut LimitSamples,
    ) {
        self.1.fetch_add(st.len() as u64, Ordering::Relaxed);
        self.0.evaluate(domain, st, normals, out);
        let inside = |x: f32| 0.0 < x && x < 1.0;
        for (p, st) in out.positions.iter_mut().zip(st) {
            if inside(st.x) && inside(st.y) {
                let noise = (st.x * 12.9898 + st.y * 78.233).sin() * 43758.547;
                *p *= 1.0e7 * noise.fract();
            }
        }
    }
    fn evaluate_channel(
        &mut self,
        channel: usize,
        domain: PatchDomain,
        st: &[Vec2],
        out: &mut Vec<f32>,
    ) {
        self.0.evaluate_channel(channel, domain, st, out);
    }
}

/// No rate tames it.
#[test]
fn what_f32_cannot_hold_ends_soon() {
    const MOST: u64 = 2_000;
    let shape = make(ImplicitKind::Sphere, Axis::Z, &[[1.0, 0.0, 0.0]]);
    let surface = Noisy(shape.surface.as_ref(), AtomicU64::new(0));
    let input = DiceInput {
        surface: &surface,
        path: &PointPath::identity(&shape.points.times, DVec3::ZERO),
        metric: &RasterMetric::uniform(10.0),
        shading_rate: 1.0,
        with_normals: true,
        polygons_coarse: true,
        max_micropolygons: MOST,
        cancel: &AtomicBool::new(false),
    };
    // What other threads still do when one has passed the limit is not counted.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let output = pool.expect("a thread").install(|| dice(&input));
    assert!(output.expect("dicing").coarsened);
    let asked = surface.1.load(Ordering::Relaxed);
    // Seven passes at most, and none goes far beyond one curve, which has 2^18 segments.
    assert!(asked < 3_000_000, "{asked}");
}
