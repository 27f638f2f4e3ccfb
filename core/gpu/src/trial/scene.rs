//! The frame of a trial: a sheet that ripples across the view, and balls on their way before and behind it, out of focus.

use std::f32::consts::TAU;
use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3};
use hdtrapeze_core::scene::{
    CameraDesc, Geometry, ImplicitDesc, ImplicitKind, Interpolation, MeshDesc, PointsSamples,
    PrimCommon, PrimDesc, PrimId, PrimvarDesc, RenderSettings, Scene, TransformSamples,
};
use hdtrapeze_core::surface::{
    Channel, LimitSurface, MeshTopology, Scheme, SubdivisionFactory, SurfaceError,
};

use super::Size;

/// Polygons along the sheet.
const POLYGONS: u32 = 60;
const BALLS: u64 = 24;

/// Its polygons need no subdivision library.
pub(super) struct NoSubdivision;

impl SubdivisionFactory for NoSubdivision {
    fn create(
        &self,
        _: &MeshTopology,
        _: &[Vec<Vec3>],
        _: Vec<Channel>,
    ) -> Result<Box<dyn LimitSurface>, SurfaceError> {
        let why = "a trial frame has no subdivision surfaces".to_owned();
        Err(SurfaceError::Library(why))
    }
}

fn at(matrices: Vec<DMat4>) -> Vec<TransformSamples> {
    let last = (matrices.len() - 1).max(1) as f64;
    vec![TransformSamples {
        times: (0..matrices.len()).map(|i| i as f64 / last).collect(),
        matrices,
        ..TransformSamples::default()
    }]
}

fn color(interpolation: Interpolation, count: u32, first: u32) -> PrimvarDesc {
    let value = |i: u32| 0.1 + 0.8 * ((i + first) % 13) as f32 / 13.0;
    let values = (0..3 * count).map(value).collect();
    PrimvarDesc::still(interpolation, 3, values, vec![])
}

/// A sheet that ripples across the view.
fn sheet() -> PrimDesc {
    let row = POLYGONS + 1;
    let corner = |i: u32, j: u32| j * row + i;
    let quads = (0..POLYGONS).flat_map(|j| (0..POLYGONS).map(move |i| (i, j)));
    let faces = quads.flat_map(|(i, j)| {
        [
            corner(i, j),
            corner(i + 1, j),
            corner(i + 1, j + 1),
            corner(i, j + 1),
        ]
    });
    let points = |phase: f32| {
        let vertex = |k: u32| {
            let [x, y] = [k % row, k / row].map(|i| i as f32 / POLYGONS as f32 - 0.5);
            let z = 0.3 * (3.0 * TAU * x + phase).sin() * (2.0 * TAU * y).cos();
            Vec3::new(16.0 * x, 10.0 * y, z - 4.0)
        };
        Arc::new((0..row * row).map(vertex).collect())
    };
    let topology = MeshTopology {
        scheme: Scheme::None,
        face_vertex_counts: vec![4; (POLYGONS * POLYGONS) as usize],
        face_vertex_indices: faces.collect(),
        ..MeshTopology::default()
    };
    let geometry = Geometry::Mesh(MeshDesc {
        topology: Arc::new(topology),
        points: PointsSamples {
            times: vec![0.0, 1.0],
            points: vec![points(0.0), points(0.6)],
            ..PointsSamples::default()
        },
        ..MeshDesc::default()
    });
    let mut common = PrimCommon::new("/sheet");
    let color = color(Interpolation::Vertex, row * row, 0);
    common.primvars.insert("displayColor".to_owned(), color);
    PrimDesc { common, geometry }
}

/// A ball on its way.
fn ball(i: u64) -> PrimDesc {
    let geometry = Geometry::Implicit(ImplicitDesc {
        kind: ImplicitKind::Sphere,
        times: vec![0.0],
        sizes: vec![[0.5, 0.0, 0.0]],
        ..ImplicitDesc::default()
    });
    let mut common = PrimCommon::new(format!("/ball{i}"));
    common.pick_id = i as i32 + 1;
    let i = i as f64;
    let from = DVec3::new(
        (i * 1.7).sin() * 4.0,
        (i * 2.9).cos() * 2.2,
        (i * 0.8).sin() * 2.0,
    );
    let to = from + DVec3::new((i * 3.1).cos(), (i * 1.3).sin(), 0.2) * 0.4;
    common.transform = at([from, to].map(DMat4::from_translation).to_vec());
    let color = color(Interpolation::Constant, 1, i as u32);
    common.primvars.insert("displayColor".to_owned(), color);
    PrimDesc { common, geometry }
}

/// The scene, seen in an image of this size: at a shading rate of 1, its micropolygons are about 1.35 times as many as pixels.
pub fn scene(size: &Size) -> Scene {
    let mut scene = Scene::default();
    scene.prims.insert(PrimId(1), Arc::new(sheet()));
    for i in 0..BALLS {
        scene.prims.insert(PrimId(i + 2), Arc::new(ball(i)));
    }
    let camera = CameraDesc {
        path: "/camera".to_owned(),
        transform: at(vec![DMat4::from_translation(DVec3::Z * 7.0)]),
        focal_length: 2.4,
        f_stop: 1.8,
        focus_distance: 7.0,
        clipping: [0.1, 100.0],
        shutter: [0.0, 1.0],
        ..CameraDesc::default()
    };
    scene.cameras.insert(PrimId(0), Arc::new(camera));
    scene.active_camera = Some(PrimId(0));
    scene.settings = Arc::new(RenderSettings {
        resolution: size.resolution,
        samples: size.samples,
        shading_rate: size.shading_rate,
        ..RenderSettings::default()
    });
    scene
}
