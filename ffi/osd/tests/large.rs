//! Faces with many sides and vertices with many faces: bounded memory, the library's own surface, and
//! an end soon after dicing is cancelled.

mod shapes;

use glam::{DAffine3, DVec3, Vec2, Vec3};
use hdtrapeze_core::dice::{DiceError, DiceInput, DiceOutput, RasterMetric, RasterView, dice};
use hdtrapeze_core::motion::PointPath;
use hdtrapeze_core::surface::{
    Channel, ChannelInfo, ChannelKind, LimitEvaluator, LimitSamples, LimitSurface, MeshTopology,
    PatchDomain,
};
use hdtrapeze_osd::{OsdFactory, OsdSurface};
use shapes::mesh;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

fn circle(n: u32) -> Vec<Vec3> {
    (0..n)
        .map(|i| {
            let a = f64::from(i) / f64::from(n) * std::f64::consts::TAU;
            Vec3::new(a.cos() as f32, a.sin() as f32, (7.0 * a).sin() as f32 * 0.2)
        })
        .collect()
}

fn polygon(n: u32) -> (MeshTopology, Vec<Vec3>) {
    mesh(&[&(0..n).collect::<Vec<_>>()], circle(n))
}

fn fan(n: u32) -> (MeshTopology, Vec<Vec3>) {
    let faces: Vec<[u32; 3]> = (0..n).map(|i| [i, (i + 1) % n, n]).collect();
    let faces: Vec<&[u32]> = faces.iter().map(|face| face.as_slice()).collect();
    let mut points = circle(n);
    points.push(Vec3::Z);
    mesh(&faces, points)
}

/// Two polygons with quads between them.
fn prism(n: u32) -> (MeshTopology, Vec<Vec3>) {
    let mut faces: Vec<Vec<u32>> = (0..n)
        .map(|i| vec![i, (i + 1) % n, (i + 1) % n + n, i + n])
        .collect();
    faces.push((0..n).rev().collect());
    faces.push((n..2 * n).collect());
    let faces: Vec<&[u32]> = faces.iter().map(|face| face.as_slice()).collect();
    let mut points = circle(n);
    points.extend(circle(n).iter().map(|&p| p + Vec3::Z));
    mesh(&faces, points)
}

fn surface((topology, points): &(MeshTopology, Vec<Vec3>)) -> OsdSurface {
    let values = Channel {
        kind: ChannelKind::FaceVarying,
        width: 2,
        values: points.iter().flat_map(|p| [p.x, p.y]).collect(),
        indices: topology.face_vertex_indices.clone(),
    };
    OsdFactory::new()
        .create_surface(topology, std::slice::from_ref(points), vec![values])
        .expect("the topology is good")
}

fn diced(surface: &dyn LimitSurface, cancel: &AtomicBool) -> Result<DiceOutput, DiceError> {
    let view = RasterView {
        world_to_camera: DAffine3::from_translation(DVec3::new(0.0, 0.0, -4.0)),
        scale: Vec2::splat(80.0),
        centre: Vec2::splat(40.0),
        orthographic: false,
        near: 0.05,
        size: Vec2::splat(80.0),
    };
    dice(&DiceInput {
        surface,
        path: &PointPath::identity(&[0.0], DVec3::ZERO),
        metric: &RasterMetric::new(&[vec![view]], DVec3::ZERO),
        shading_rate: 1.0,
        with_normals: true,
        polygons_coarse: false,
        max_micropolygons: 1 << 20,
        cancel,
    })
}

fn is_by_library(surface: &OsdSurface, face: u32) -> bool {
    let mut evaluator = surface.lattice_evaluator();
    evaluator.bind(face);
    evaluator.is_by_library()
}

/// Positions and a channel against the library's, in some domains of a face.
fn compare(surface: &OsdSurface, face: u32) {
    let size = surface.face_vertices(face).len() as u32;
    let st: Vec<Vec2> = (0..9)
        .map(|i| Vec2::new((i % 3) as f32 * 0.49 + 0.01, (i / 3) as f32 * 0.37))
        .collect();
    let (mut ours, mut theirs) = (surface.evaluator(), surface.library_evaluator());
    ours.bind(face);
    theirs.bind(face);
    let (mut a, mut b) = (LimitSamples::default(), LimitSamples::default());
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for corner in (0..size).step_by(size as usize / 3) {
        let domain = PatchDomain::Corner(corner);
        ours.evaluate(domain, &st, true, &mut a);
        theirs.evaluate(domain, &st, true, &mut b);
        for (p, q) in a.positions.iter().zip(&b.positions) {
            assert!((*p - *q).length() < 1e-5, "{domain:?}: {p} {q}");
        }
        ours.evaluate_channel(0, domain, &st, &mut x);
        theirs.evaluate_channel(0, domain, &st, &mut y);
        for (p, q) in x.iter().zip(&y) {
            assert!((p - q).abs() < 1e-5, "{domain:?}: {p} {q}");
        }
    }
}

#[test]
fn large_faces_are_the_librarys() {
    let go = AtomicBool::new(false);
    // What is small is still evaluated here.
    for small in [polygon(40), fan(200)] {
        assert!(!is_by_library(&surface(&small), 0));
    }
    for large in [polygon(300), polygon(1000), fan(600), prism(300)] {
        let surface = surface(&large);
        let faces = surface.face_count() as u32;
        assert!(is_by_library(&surface, faces - 1), "{faces} faces");
        assert!(surface.notes().is_empty(), "{:?}", surface.notes());
        compare(&surface, faces - 1);
        compare(&surface, 0);
        let output = diced(&surface, &go).expect("dicing");
        assert!(output.mesh.cell_count() >= 300 && output.dropped_faces == 0);
    }
}

/// Above what the library can take a face is linear, and says so.
#[test]
fn too_large_faces_are_linear() {
    let large = polygon(5000);
    let surface = surface(&large);
    assert_eq!(surface.notes().len(), 1);
    assert!(!is_by_library(&surface, 0));
    let mut evaluator = surface.evaluator();
    evaluator.bind(0);
    let mut out = LimitSamples::default();
    let st = [Vec2::ZERO, Vec2::X, Vec2::ONE];
    evaluator.evaluate(PatchDomain::Corner(1234), &st, false, &mut out);
    let (a, b) = (large.1[1234], large.1[1235]);
    assert!((out.positions[0] - a).length() < 1e-6);
    assert!((out.positions[1] - 0.5 * (a + b)).length() < 1e-6);
    assert!(out.positions[2].length() < 1e-5);
    let mut values = Vec::new();
    evaluator.evaluate_channel(0, PatchDomain::Corner(1234), &st, &mut values);
    assert!((values[0] - a.x).abs() < 1e-6 && (values[1] - a.y).abs() < 1e-6);
    let output = diced(&surface, &AtomicBool::new(false)).expect("dicing");
    assert!(output.mesh.cell_count() >= 5000 && output.dropped_faces == 0);
}

/// A surface that sets `cancel` when it was evaluated `after` times, and counts the calls.
struct Impatient<'a> {
    surface: OsdSurface,
    cancel: &'a AtomicBool,
    calls: &'a AtomicU64,
    after: u64,
}

struct ImpatientEvaluator<'a> {
    inner: Box<dyn LimitEvaluator + 'a>,
    of: &'a Impatient<'a>,
}

impl LimitSurface for Impatient<'_> {
    fn face_count(&self) -> usize {
        self.surface.face_count()
    }
    fn face_vertices(&self, face: u32) -> &[u32] {
        self.surface.face_vertices(face)
    }
    fn element(&self, face: u32) -> u32 {
        face
    }
    fn key_count(&self) -> usize {
        self.surface.key_count()
    }
    fn channels(&self) -> &[ChannelInfo] {
        self.surface.channels()
    }
    fn is_polygonal(&self) -> bool {
        false
    }
    fn evaluator(&self) -> Box<dyn LimitEvaluator + '_> {
        Box::new(ImpatientEvaluator {
            inner: self.surface.evaluator(),
            of: self,
        })
    }
}

impl LimitEvaluator for ImpatientEvaluator<'_> {
    fn bind(&mut self, face: u32) {
        self.inner.bind(face);
    }
    fn evaluate(
        &mut self,
        domain: PatchDomain,
        st: &[Vec2],
        with_normals: bool,
        out: &mut LimitSamples,
    ) {
        if self.of.calls.fetch_add(1, Ordering::Relaxed) + 1 == self.of.after {
            self.of.cancel.store(true, Ordering::Relaxed);
        }
        self.inner.evaluate(domain, st, with_normals, out);
    }
    fn evaluate_channel(
        &mut self,
        channel: usize,
        domain: PatchDomain,
        st: &[Vec2],
        out: &mut Vec<f32>,
    ) {
        self.inner.evaluate_channel(channel, domain, st, out);
    }
}

#[test]
fn a_large_face_is_left_soon_after_cancelling() {
    // Among the corners, the edges, the spokes and the patches of the one face.
    for after in [1, 100, 500, 900, 1300] {
        let (cancel, calls) = (AtomicBool::new(false), AtomicU64::new(0));
        let surface = Impatient {
            surface: surface(&polygon(300)),
            cancel: &cancel,
            calls: &calls,
            after,
        };
        let result = diced(&surface, &cancel);
        assert_eq!(result.err(), Some(DiceError::Cancelled), "after {after}");
        // At most one curve or patch more.
        let calls = calls.load(Ordering::Relaxed);
        assert!(calls <= after + 40, "{calls} calls, cancelled at {after}");
    }
}
