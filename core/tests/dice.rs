//! Dicing: closed meshes stay closed, rates hold, work stays bounded, bits do not depend on threads.

mod analytic;
mod lattice;

use analytic::{Analytic, Bend};
use glam::{DVec3, Vec3};
use hdtrapeze_core::dice::{DiceError, DiceInput, DiceOutput, RasterMetric, RasterView, dice};
use hdtrapeze_core::grid::{DicedMesh, octahedral};
use hdtrapeze_core::motion::PointPath;
use hdtrapeze_core::surface::polygon::PolygonSurface;
use hdtrapeze_core::surface::{ChannelInfo, LimitSurface, MeshTopology, Scheme};
use lattice::{camera, each_triangle, open_edges};
use proptest::prelude::*;
use std::sync::atomic::AtomicBool;

struct Setup {
    surface: Analytic,
    path: PointPath,
    metric: RasterMetric,
    rate: f32,
    limit: u64,
    coarse: bool,
    normals: bool,
}

impl Setup {
    fn new(surface: Analytic, view: RasterView, rate: f32) -> Self {
        let keys = surface.keys.len();
        let times: Vec<f32> = if keys == 1 {
            vec![0.0]
        } else {
            (0..keys).map(|k| k as f32 / (keys - 1) as f32).collect()
        };
        Self {
            surface,
            path: PointPath::identity(&times, DVec3::ZERO),
            metric: RasterMetric::new(&vec![vec![view]; keys], DVec3::ZERO),
            rate,
            limit: 4_000_000,
            coarse: false,
            normals: false,
        }
    }

    fn try_dice(&self) -> Result<DiceOutput, DiceError> {
        dice(&DiceInput {
            surface: &self.surface,
            path: &self.path,
            metric: &self.metric,
            shading_rate: self.rate,
            with_normals: self.normals,
            polygons_coarse: self.coarse,
            max_micropolygons: self.limit,
            cancel: &AtomicBool::new(false),
        })
    }

    fn dice(&self) -> DiceOutput {
        let output = self.try_dice().expect("dicing");
        check_layout(&output.mesh, &self.surface);
        output
    }
}

fn check_layout(mesh: &DicedMesh, surface: &Analytic) {
    let mut next = 0;
    for grid in &mesh.grids {
        assert_eq!(grid.first_vertex as usize, next);
        assert!((1..=16).contains(&grid.nu) && (1..=16).contains(&grid.nv));
        assert!((grid.element as usize) < surface.faces.len());
        next += grid.vertex_count();
    }
    assert_eq!(mesh.vertex_count, next);
    assert_eq!(mesh.positions.len(), next * mesh.key_count());
    assert_eq!(mesh.normals.len(), next * mesh.normal_key_count);
    assert_eq!(mesh.channels.len(), surface.channels.len());
    for (channel, info) in mesh.channels.iter().zip(surface.channels()) {
        assert_eq!(channel.values.len(), next * info.width);
    }
    assert!(mesh.positions.iter().all(|p| p.is_finite()));
}

fn assert_closed(output: &DiceOutput) {
    for k in 0..output.mesh.key_count() {
        assert_eq!(open_edges(&output.mesh, k), 0, "key {k}");
    }
}

fn meshes() -> Vec<Analytic> {
    let mut list = vec![
        Analytic::cube(1, Bend::Sphere, |_| false),
        Analytic::cube(2, Bend::Sphere, |f| f % 3 == 0),
        Analytic::cube(3, Bend::None, |f| f % 2 == 0),
        Analytic::prism(5, false, Bend::Sphere),
        Analytic::prism(7, true, Bend::None),
        Analytic::prism(3, true, Bend::Waves(0.2)),
        Analytic::prism(4, false, Bend::Waves(0.3)),
        Analytic::cube(8, Bend::Sphere, |f| f % 5 == 0),
    ];
    list[1].keys = vec![(1.0, Vec3::ZERO), (1.5, Vec3::new(0.5, 0.0, -0.3))];
    list[3].keys = vec![
        (1.0, Vec3::ZERO),
        (0.3, Vec3::X),
        (2.0, Vec3::new(0.0, 1.0, 3.0)),
    ];
    list
}

#[test]
fn closed_meshes_stay_closed() {
    for mesh in meshes() {
        for rate in [0.7, 3.0, 11.0, 60.0] {
            let view = camera(Vec3::new(2.5, 1.0, 3.0), Vec3::ZERO, 300.0);
            let output = Setup::new(mesh.clone(), view, rate).dice();
            assert!(!output.coarsened && output.dropped_faces == 0);
            assert_closed(&output);
        }
    }
}

#[test]
fn the_closed_test_can_fail() {
    let view = camera(Vec3::new(2.5, 1.0, 3.0), Vec3::ZERO, 300.0);
    let mesh = Analytic::cube(2, Bend::Sphere, |_| false);
    let mut output = Setup::new(mesh, view, 5.0).dice();
    let p = &mut output.mesh.positions[1];
    p.x = p.x.next_up();
    assert!(open_edges(&output.mesh, 0) > 0);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any camera, inside and outside and through the surface, at any rate.
    #[test]
    fn closed_from_anywhere(
        which in 0usize..8,
        eye in prop::array::uniform3(-2.0f32..2.0),
        target in prop::array::uniform3(-1.0f32..1.0),
        pixels in 20.0f32..400.0,
        log_rate in 0.0f32..5.0,
    ) {
        let mesh = meshes().swap_remove(which);
        let view = camera(eye.into(), target.into(), pixels);
        let mut setup = Setup::new(mesh, view, log_rate.exp());
        setup.limit = 400_000;
        let output = setup.dice();
        prop_assert_eq!(output.dropped_faces, 0);
        prop_assert!(output.mesh.cell_count() <= 400_000);
        for k in 0..output.mesh.key_count() {
            prop_assert_eq!(open_edges(&output.mesh, k), 0);
        }
    }
}

/// Raster lengths of all cell edges that have a length, longest first, and the raster area.
fn raster(output: &DiceOutput, metric: &RasterMetric, view: &RasterView) -> (Vec<f32>, f64) {
    let mut lengths = Vec::new();
    let mut area = 0.0f64;
    let project = |p: Vec3| {
        let p = view.world_to_camera.transform_point3(p.as_dvec3());
        p.truncate() / -p.z * view.scale.as_dvec2()
    };
    each_triangle(&output.mesh, 0, |[a, b, c]| {
        lengths.push(metric.length(0, a, b));
        lengths.push(metric.length(0, b, c));
        let (a, b, c) = (project(a), project(b), project(c));
        area += 0.5 * (b - a).perp_dot(c - a).abs();
    });
    lengths.sort_by(|a, b| b.total_cmp(a));
    (lengths, area)
}

#[test]
fn rates_hold() {
    for (mesh, most) in [
        (Analytic::plane(1, 1.0, Bend::None), 1.6),
        (Analytic::plane(7, 1.0, Bend::Waves(0.1)), 2.0),
        (Analytic::cube(2, Bend::Sphere, |_| false), 3.0),
        (Analytic::cube(2, Bend::Sphere, |_| true), 4.0),
        (Analytic::prism(7, true, Bend::Sphere), 4.0),
    ] {
        for rate in [1.0, 2.5, 9.0] {
            let view = camera(Vec3::new(0.3, 6.0, 0.5), Vec3::ZERO, 900.0);
            let setup = Setup::new(mesh.clone(), view, rate);
            let output = setup.dice();
            let (lengths, area) = raster(&output, &setup.metric, &view);
            let longest = lengths[0] / rate;
            let count = output.mesh.cell_count() as f64;
            let ratio = count * f64::from(rate * rate) / area;
            println!("rate {rate}: longest {longest}, cells over area {ratio}");
            assert!(longest < 1.9, "longest {longest} at {rate}");
            let long = lengths.iter().filter(|&&l| l > 1.5 * rate).count();
            assert!(long * 200 < lengths.len(), "{long} of {}", lengths.len());
            assert!((0.5..most).contains(&ratio), "{ratio} at {rate}");
        }
    }
}

#[test]
fn a_plane_to_the_horizon_is_bounded() {
    for n in [1, 6] {
        for half in [10.0, 1000.0, 1.0e6] {
            for target in [Vec3::new(0.0, 0.9, -1.0), Vec3::new(0.3, 0.5, -1.0)] {
                let view = camera(Vec3::new(0.0, 1.0, 0.0), target, 640.0);
                let mesh = Analytic::plane(n, half, Bend::None);
                let setup = Setup::new(mesh, view, 1.0);
                let output = setup.dice();
                let count = output.mesh.cell_count();
                println!(
                    "{n} {half}: {count}, {} evaluations",
                    output.limit_evaluations
                );
                assert!(!output.coarsened && count < 1_500_000, "{count}");
            }
        }
    }
    // The camera inside the plane, and a hair above.
    for height in [0.0, 1.0e-4, 0.01] {
        let view = camera(
            Vec3::new(0.0, height, 0.0),
            Vec3::new(0.1, -0.3, -1.0),
            640.0,
        );
        let mesh = Analytic::plane(1, 100.0, Bend::None);
        let output = Setup::new(mesh, view, 1.0).dice();
        let count = output.mesh.cell_count();
        println!("height {height}: {count}");
        assert!(count < 1_500_000, "{count}");
    }
}

#[test]
fn threads_do_not_change_bits() {
    let mut mesh = meshes().swap_remove(1);
    mesh.channels = vec![ChannelInfo { width: 3 }];
    let view = camera(Vec3::new(0.5, 0.8, 1.4), Vec3::ZERO, 500.0);
    let mut setup = Setup::new(mesh, view, 2.0);
    setup.normals = true;
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(|| setup.dice())
    };
    let one = with(1);
    for threads in [2, 3, 8] {
        let many = with(threads);
        assert!(one.mesh == many.mesh, "{threads}");
        assert_eq!(one.limit_evaluations, many.limit_evaluations);
    }
}

#[test]
fn small_faces_are_cheap() {
    let mesh = Analytic::cube(60, Bend::Sphere, |_| false);
    let faces = mesh.faces.len();
    let view = camera(Vec3::new(0.0, 2.0, 8.0), Vec3::ZERO, 100.0);
    let mut setup = Setup::new(mesh, view, 1.0);
    setup.normals = true;
    let output = setup.dice();
    assert_eq!(output.mesh.cell_count(), faces);
    let each = output.limit_evaluations as f64 / faces as f64;
    assert!(each < 10.5, "{each} evaluations a face");
    assert_closed(&output);
}

#[test]
fn polygons_stay_coarse() {
    for mut mesh in [
        Analytic::cube(2, Bend::None, |f| f % 2 == 0),
        Analytic::prism(5, false, Bend::None),
    ] {
        mesh.polygonal = true;
        let cells: usize = mesh
            .faces
            .iter()
            .map(|f| if f.len() > 4 { f.len() } else { 1 })
            .sum();
        let view = camera(Vec3::new(0.5, 0.8, 4.0), Vec3::ZERO, 2000.0);
        let mut setup = Setup::new(mesh, view, 1.0);
        setup.coarse = true;
        let output = setup.dice();
        assert_eq!(output.mesh.cell_count(), cells);
        assert_closed(&output);
    }
}

#[test]
fn the_budget_coarsens() {
    let view = camera(Vec3::new(0.5, 0.8, 4.0), Vec3::ZERO, 1000.0);
    let mut setup = Setup::new(Analytic::cube(2, Bend::Sphere, |_| false), view, 0.25);
    setup.limit = 20_000;
    let output = setup.dice();
    assert!(output.coarsened && output.shading_rate > 0.25);
    let count = output.mesh.cell_count();
    assert!((3_000..=20_000).contains(&count), "{count}");
    assert_closed(&output);
    // Even a budget that cannot be met ends: one cell a patch.
    setup.limit = 0;
    assert_eq!(setup.dice().mesh.cell_count(), 24);
}

#[test]
fn bad_faces_are_dropped() {
    let mut mesh = Analytic::cube(4, Bend::None, |_| false);
    let mut alone = mesh.clone();
    mesh.points[7].x = f32::NAN;
    let touched = mesh.faces.iter().filter(|f| f.contains(&7)).count() as u64;
    let view = camera(Vec3::new(0.5, 0.8, 4.0), Vec3::ZERO, 300.0);
    let output = Setup::new(mesh, view, 3.0).dice();
    // The face that a shared vertex or edge is evaluated from may be among them: then its
    // neighbours go too.
    assert!((touched..=touched + 12).contains(&output.dropped_faces));
    assert!(output.mesh.cell_count() > 1000);
    // Faces that are no faces, and wild ones.
    alone.faces.push(vec![]);
    alone.faces.push(vec![1, 2]);
    alone.faces.push(vec![1, 1, 1]);
    alone.faces.push(vec![1, 2, 1, 2]);
    alone.points[9] = Vec3::splat(1.0e38);
    alone.points[11] = Vec3::splat(-1.0e25);
    let mut setup = Setup::new(alone, view, 3.0);
    setup.limit = 100_000;
    setup.normals = true;
    let output = setup.dice();
    assert!(output.mesh.cell_count() <= 100_000);
}

#[test]
fn normals_and_channels_belong_to_their_vertices() {
    let mut mesh = Analytic::cube(2, Bend::Sphere, |f| f % 3 == 0);
    mesh.channels = vec![ChannelInfo { width: 3 }, ChannelInfo { width: 1 }];
    let view = camera(Vec3::new(0.5, 0.8, 4.0), Vec3::ZERO, 300.0);
    let mut setup = Setup::new(mesh, view, 4.0);
    setup.normals = true;
    let mesh = setup.dice().mesh;
    assert_eq!(mesh.normal_key_count, 1);
    // A sphere: normal, position and flat position are parallel, but for vertices copied from the
    // end of an inner curve, which may be half a step off.
    let (mut far, mut total) = (0, 0);
    for (g, grid) in mesh.grids.iter().enumerate() {
        let n = grid.vertex_count();
        let first = grid.first_vertex as usize;
        for i in 0..n {
            let p = mesh.grid_positions(g, 0)[i];
            let normal = octahedral::decode(mesh.grid_normals(g, 0)[i]);
            let flat = Vec3::from_slice(&mesh.channels[0].values[(first + i) * 3..]).normalize();
            assert_eq!(
                mesh.channels[1].values[first + i],
                mesh.channels[0].values[(first + i) * 3]
            );
            total += 1;
            assert!((normal - flat).length() < 3.0e-4);
            far += usize::from((normal - p).length() > 3.0e-4);
            assert!(setup.metric.length(0, flat, p) < 0.8 * setup.rate);
        }
    }
    assert!(far * 50 < total, "{far} of {total}");
}

#[test]
fn wrong_keys_and_rates_are_refused() {
    let view = camera(Vec3::new(0.5, 0.8, 4.0), Vec3::ZERO, 300.0);
    let mut setup = Setup::new(Analytic::cube(2, Bend::Sphere, |_| false), view, f32::NAN);
    assert_eq!(setup.try_dice().err(), Some(DiceError::ShadingRate));
    setup.rate = 1.0;
    setup.metric = RasterMetric::new(&[vec![view], vec![view]], DVec3::ZERO);
    assert_eq!(setup.try_dice().err(), Some(DiceError::KeyCount));
}

#[test]
fn cancel_is_heard() {
    let view = camera(Vec3::new(0.5, 0.8, 4.0), Vec3::ZERO, 300.0);
    let setup = Setup::new(Analytic::cube(2, Bend::Sphere, |_| false), view, 1.0);
    let result = dice(&DiceInput {
        surface: &setup.surface,
        path: &setup.path,
        metric: &setup.metric,
        shading_rate: 1.0,
        with_normals: false,
        polygons_coarse: false,
        max_micropolygons: 1 << 30,
        cancel: &AtomicBool::new(true),
    });
    assert_eq!(result.err(), Some(DiceError::Cancelled));
}

/// Surfaces over `faces`, as hosts describe polygons.
fn polygons(faces: &[&[u32]], points: &[Vec3]) -> PolygonSurface {
    let topology = MeshTopology {
        scheme: Scheme::None,
        vertex_count: points.len(),
        face_vertex_counts: faces.iter().map(|face| face.len() as u32).collect(),
        face_vertex_indices: faces.concat(),
        ..MeshTopology::default()
    };
    PolygonSurface::new(&topology, &[points.to_vec()], Vec::new()).expect("good polygons")
}

fn dice_polygons(surface: &PolygonSurface, rate: f32, coarse: bool) -> DiceOutput {
    dice(&DiceInput {
        surface,
        path: &PointPath::identity(&[0.0], DVec3::ZERO),
        metric: &RasterMetric::uniform(50.0),
        shading_rate: rate,
        with_normals: true,
        polygons_coarse: coarse,
        max_micropolygons: 1 << 20,
        cancel: &AtomicBool::new(false),
    })
    .expect("dicing")
}

#[test]
fn concave_polygons_are_closed() {
    // A prism over an L.
    let outline = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]];
    let at = |z: f32| outline.map(|[x, y]| Vec3::new(x as f32, y as f32, z));
    let points = [at(0.0), at(1.0)].concat();
    let sides: Vec<[u32; 4]> = (0..6)
        .map(|i| [i, (i + 1) % 6, 6 + (i + 1) % 6, 6 + i])
        .collect();
    let mut faces: Vec<&[u32]> = sides.iter().map(|f| f.as_slice()).collect();
    faces.push(&[5, 4, 3, 2, 1, 0]);
    faces.push(&[6, 7, 8, 9, 10, 11]);
    let surface = polygons(&faces, &points);
    let output = dice_polygons(&surface, 1.0, true);
    assert_eq!(output.mesh.cell_count(), 6 + 2 * 4);
    assert_closed(&output);
    let elements: Vec<u32> = output.mesh.grids.iter().map(|g| g.element).collect();
    assert_eq!(elements, [0, 1, 2, 3, 4, 5, 6, 6, 6, 6, 7, 7, 7, 7]);
    for rate in [2.0, 7.0, 31.0] {
        assert_closed(&dice_polygons(&surface, rate, false));
    }
}

#[test]
fn three_faces_on_an_edge_agree() {
    // Pages of a book, of different widths, spine along y.
    let mut points = vec![Vec3::ZERO, Vec3::Y];
    let mut faces = Vec::new();
    for (i, width) in [0.3f32, 1.0, 4.0].into_iter().enumerate() {
        let (sin, cos) = (i as f32 * 2.0).sin_cos();
        let page = Vec3::new(cos, 0.1, sin) * width;
        let n = points.len() as u32;
        points.extend([page, page + Vec3::Y]);
        // Along the spine in both directions.
        faces.push(if i == 1 {
            [1, 0, n, n + 1]
        } else {
            [0, 1, n + 1, n]
        });
    }
    let faces: Vec<&[u32]> = faces.iter().map(|f| f.as_slice()).collect();
    let output = dice_polygons(&polygons(&faces, &points), 3.0, false);
    let mut spines = vec![std::collections::BTreeSet::new(); 3];
    for (g, grid) in output.mesh.grids.iter().enumerate() {
        let on_spine = output.mesh.grid_positions(g, 0).iter();
        let on_spine = on_spine.filter(|p| p.x == 0.0 && p.z == 0.0);
        spines[grid.element as usize].extend(on_spine.map(|p| p.y.to_bits()));
    }
    assert!(spines[0].len() > 15);
    assert_eq!(spines[0], spines[1]);
    assert_eq!(spines[0], spines[2]);
}
