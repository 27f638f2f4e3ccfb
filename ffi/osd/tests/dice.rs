//! Dicing real subdivision surfaces: closed meshes stay closed, open ones keep their outline.

mod shapes;

use glam::{DAffine3, DMat3, DVec3, Vec2, Vec3};
use hdtrapeze_core::dice::{DiceInput, DiceOutput, RasterMetric, RasterView, dice};
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::motion::PointPath;
use hdtrapeze_core::surface::{
    BoundaryInterpolation, Channel, ChannelKind, Crease, MeshTopology, Scheme, TriangleRule,
};
use hdtrapeze_osd::OsdFactory;
use shapes::{cube, grid, mesh, octahedron};
use std::collections::HashMap;
use std::sync::atomic::AtomicBool;

type Mesh = (MeshTopology, Vec<Vec3>);
type Bits = [u32; 3];

fn camera(eye: DVec3, target: DVec3) -> RasterView {
    let forward = (target - eye).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let rotation = DMat3::from_cols(right, right.cross(forward), -forward).transpose();
    RasterView {
        world_to_camera: DAffine3::from_mat3_translation(rotation, -(rotation * eye)),
        scale: Vec2::splat(400.0),
        centre: Vec2::new(320.0, 240.0),
        orthographic: false,
        near: 0.05,
        size: Vec2::new(640.0, 480.0),
    }
}

/// Dices at two keys, the second stretched and moved.
fn diced(mesh: &Mesh, view: &RasterView, rate: f32) -> (DiceOutput, RasterMetric) {
    let (topology, points) = mesh;
    let moved = points
        .iter()
        .map(|&p| p * Vec3::new(1.2, 0.9, 1.0) + Vec3::new(0.2, -0.1, 0.3))
        .collect();
    let colours = Channel {
        kind: ChannelKind::Vertex,
        width: 3,
        values: points.iter().flat_map(|p| p.to_array()).collect(),
        indices: Vec::new(),
    };
    let surface = OsdFactory::new()
        .create_surface(topology, &[points.clone(), moved], vec![colours])
        .expect("the topology is good");
    let metric = RasterMetric::new(&[vec![*view], vec![*view]], DVec3::ZERO);
    let output = dice(&DiceInput {
        surface: &surface,
        path: &PointPath::identity(&[0.0, 1.0], DVec3::ZERO),
        metric: &metric,
        shading_rate: rate,
        with_normals: true,
        polygons_coarse: rate > 50.0,
        max_micropolygons: 1 << 22,
        cancel: &AtomicBool::new(false),
    })
    .expect("dicing");
    assert!(!output.coarsened && output.dropped_faces == 0);
    (output, metric)
}

/// Sides of micropolygon triangles at key `k` that their reverses do not match.
fn outline(mesh: &DicedMesh, k: usize) -> Vec<(Bits, Bits)> {
    let mut balance: HashMap<(Bits, Bits), i64> = HashMap::new();
    for (g, grid) in mesh.grids.iter().enumerate() {
        let at = |v: usize| {
            mesh.grid_positions(g, k)[v]
                .to_array()
                .map(|x| (x + 0.0).to_bits())
        };
        let row = grid.nu as usize + 1;
        for j in 0..grid.nv as usize {
            for i in 0..grid.nu as usize {
                let v = j * row + i;
                for t in [[v, v + 1, v + row + 1], [v, v + row + 1, v + row]] {
                    let t = t.map(at);
                    if t[0] == t[1] || t[1] == t[2] || t[2] == t[0] {
                        continue;
                    }
                    for e in 0..3 {
                        let (a, b) = (t[e], t[(e + 1) % 3]);
                        let step = if a < b { 1 } else { -1 };
                        *balance.entry((a.min(b), a.max(b))).or_default() += step;
                    }
                }
            }
        }
    }
    let open = balance.into_iter().filter(|&(_, n)| n != 0);
    open.map(|(sides, _)| sides).collect()
}

/// Connected pieces of a set of sides: a crack along an inner edge adds some.
fn pieces(sides: &[(Bits, Bits)]) -> usize {
    fn root(parents: &[usize], mut i: usize) -> usize {
        while parents[i] != i {
            i = parents[i];
        }
        i
    }
    let mut names = HashMap::new();
    let mut parents: Vec<usize> = Vec::new();
    for &(a, b) in sides {
        let [a, b] = [a, b].map(|p| {
            *names.entry(p).or_insert_with(|| {
                parents.push(parents.len());
                parents.len() - 1
            })
        });
        let (a, b) = (root(&parents, a), root(&parents, b));
        parents[a] = b;
    }
    (0..parents.len()).filter(|&i| parents[i] == i).count()
}

/// A prism with n-gon caps, one of them a fan of triangles.
fn prism(n: u32) -> Mesh {
    let mut points: Vec<Vec3> = Vec::new();
    for z in [-0.6f32, 0.7] {
        points.extend((0..n).map(|i| {
            let a = std::f32::consts::TAU * i as f32 / n as f32;
            Vec3::new(a.cos(), a.sin(), z)
        }));
    }
    points.push(Vec3::new(0.1, 0.0, 1.2));
    let mut faces: Vec<Vec<u32>> = Vec::new();
    for i in 0..n {
        let j = (i + 1) % n;
        faces.push(vec![i, j, n + j, n + i]);
        faces.push(vec![n + i, n + j, 2 * n]);
    }
    faces.push((0..n).rev().collect());
    let faces: Vec<&[u32]> = faces.iter().map(Vec::as_slice).collect();
    mesh(&faces, points)
}

fn creased(mut mesh: Mesh, vertices: &[u32], sharpness: f32) -> Mesh {
    mesh.0.creases.push(Crease {
        vertices: vertices.to_vec(),
        sharpness: vec![sharpness; vertices.len() - 1],
    });
    mesh
}

fn with(mut mesh: Mesh, change: impl FnOnce(&mut MeshTopology)) -> Mesh {
    change(&mut mesh.0);
    mesh
}

/// Closed meshes of every kind, and open ones with the number of pieces of their outline.
fn cases() -> Vec<(&'static str, Mesh, usize)> {
    use BoundaryInterpolation as Boundary;
    let hole = |t: &mut MeshTopology| t.holes = vec![12];
    vec![
        ("cube", cube(), 0),
        ("creased cube", creased(cube(), &[0, 2, 3, 1], 10.0), 0),
        ("semi-sharp cube", creased(cube(), &[0, 2, 3], 2.5), 0),
        (
            "cornered cube",
            with(cube(), |t| t.corners = vec![(5, 10.0)]),
            0,
        ),
        (
            "bilinear cube",
            with(cube(), |t| t.scheme = Scheme::Bilinear),
            0,
        ),
        ("prism", prism(5), 0),
        ("wide prism", prism(9), 0),
        (
            "smooth triangles",
            with(prism(6), |t| t.triangles = TriangleRule::Smooth),
            0,
        ),
        (
            "bilinear prism",
            with(prism(6), |t| t.scheme = Scheme::Bilinear),
            0,
        ),
        ("loop", octahedron(), 0),
        ("creased loop", creased(octahedron(), &[0, 2, 1], 10.0), 0),
        ("grid", grid(5, 5), 1),
        (
            "edges only",
            with(grid(5, 5), |t| t.boundary = Boundary::EdgeOnly),
            1,
        ),
        (
            "no boundary",
            with(grid(5, 5), |t| t.boundary = Boundary::None),
            1,
        ),
        ("hole", with(grid(5, 5), hole), 2),
    ]
}

#[test]
fn subdivision_surfaces_have_no_cracks() {
    for (name, mesh, expected) in cases() {
        for (eye, target) in [
            (DVec3::new(3.0, 2.0, 4.0), DVec3::ZERO),
            (DVec3::new(0.4, 0.3, 0.6), DVec3::new(0.0, 0.2, 0.0)),
        ] {
            for rate in [3.0, 70.0] {
                let (output, _) = diced(&mesh, &camera(eye, target), rate);
                for k in 0..2 {
                    let found = pieces(&outline(&output.mesh, k));
                    assert_eq!(found, expected, "{name} from {eye} at {rate}, key {k}");
                }
            }
        }
    }
}

#[test]
fn subdivision_surfaces_keep_their_rate() {
    let view = camera(DVec3::new(3.0, 2.0, 6.0), DVec3::ZERO);
    let rate = 2.0;
    let in_image = |p: Vec3| {
        let p = view.world_to_camera.transform_point3(p.as_dvec3());
        let q = p.truncate() / -p.z * 400.0;
        q.x.abs() < 320.0 && q.y.abs() < 240.0
    };
    for (name, mesh, _) in cases() {
        let (output, metric) = diced(&mesh, &view, rate);
        let (mut longest, mut long, mut total) = (0.0f32, 0, 0);
        for (g, grid) in output.mesh.grids.iter().enumerate() {
            let row = grid.nu as usize + 1;
            for k in 0..2 {
                let at = output.mesh.grid_positions(g, k);
                for v in 0..at.len() {
                    let right = (v % row + 1 < row).then_some(v + 1);
                    let up = (v + row < at.len()).then_some(v + row);
                    for w in [right, up].into_iter().flatten() {
                        if !in_image(at[v]) || !in_image(at[w]) {
                            continue;
                        }
                        let l = metric.length(k, at[v], at[w]) / rate;
                        longest = longest.max(l);
                        long += usize::from(l > 1.5);
                        total += 1;
                    }
                }
            }
        }
        println!(
            "{name}: {} cells, longest {longest}, {long} of {total} above 1.5, {} evaluations",
            output.mesh.cell_count(),
            output.limit_evaluations
        );
        assert!(longest < 2.2 && long * 50 < total, "{name}");
    }
}
