//! Clusters are diced to the very grids that the whole surface is diced to, whichever comes first, and lie
//! within the bounds that were known before.

mod shapes;

use std::sync::atomic::AtomicBool;

use glam::{DAffine3, DQuat, DVec3, Vec2, Vec3};
use hdtrapeze_core::dice::{
    ClusterRule, Clusters, DiceInput, DiceOutput, RasterMetric, RasterView, dice,
};
use hdtrapeze_core::motion::PointPath;
use hdtrapeze_core::nurbs::Knots;
use hdtrapeze_core::surface::LimitSurface;
use hdtrapeze_core::surface::nurbs::{NurbsPatch, NurbsSurface};
use hdtrapeze_core::surface::quadric::QuadricSurface;
use hdtrapeze_core::surface::{
    BoundaryInterpolation, Channel, ChannelKind, MeshTopology, Orientation, Scheme,
};
use hdtrapeze_osd::OsdFactory;
use shapes::{Random, cube, grid, icosahedron, octahedron, patchwork, sharpen, thirds};

/// Every surface is cut, as finely as can be.
const ALL: ClusterRule = ClusterRule {
    least: 0.0,
    least_a_face: 0.0,
    most: 150.0,
};

fn view() -> RasterView {
    RasterView {
        world_to_camera: DAffine3::from_translation(DVec3::new(-2.0, -2.0, -9.0)),
        scale: Vec2::splat(300.0),
        centre: Vec2::new(320.0, 240.0),
        orthographic: false,
        near: 0.05,
        size: Vec2::new(640.0, 480.0),
    }
}

/// A path that spins and falls, with keys between those of the points.
fn path(random: &mut Random, point_keys: &[f32]) -> PointPath {
    let times = vec![0.0, 0.3, 0.8, 1.0];
    let axis = (random.vec3() - 0.5).as_dvec3().normalize_or(DVec3::X);
    let far = DVec3::splat(1.0e4);
    let matrices: Vec<DAffine3> = times
        .iter()
        .map(|&t| {
            let turn = DQuat::from_axis_angle(axis, 1.5 * f64::from(t));
            DAffine3::from_rotation_translation(turn, far + axis * f64::from(t))
        })
        .collect();
    PointPath::new(point_keys, times, &matrices, far)
}

fn with_input<R>(
    surface: &dyn LimitSurface,
    path: &PointPath,
    run: impl FnOnce(&DiceInput<'_>) -> R,
) -> R {
    let views: Vec<_> = path.key_times().iter().map(|_| vec![view()]).collect();
    let metric = RasterMetric::new(&views, DVec3::ZERO);
    run(&DiceInput {
        surface,
        path,
        metric: &metric,
        shading_rate: 4.0,
        with_normals: true,
        polygons_coarse: true,
        max_micropolygons: 1 << 22,
        cancel: &AtomicBool::new(false),
    })
}

/// Adds the bits of each grid.
fn grids(output: &DiceOutput, into: &mut Vec<Vec<u32>>) {
    let mesh = &output.mesh;
    for (g, grid) in mesh.grids.iter().enumerate() {
        let mut bits = vec![grid.element, u32::from(grid.nu), u32::from(grid.nv)];
        for key in 0..mesh.key_count() {
            let positions = mesh.grid_positions(g, key).iter();
            bits.extend(positions.flat_map(|p| p.to_array().map(f32::to_bits)));
        }
        for key in 0..mesh.normal_key_count {
            bits.extend_from_slice(mesh.grid_normals(g, key));
        }
        for channel in &mesh.channels {
            let first = grid.first_vertex as usize * channel.width;
            let values = &channel.values[first..][..grid.vertex_count() * channel.width];
            bits.extend(values.iter().map(|x| x.to_bits()));
        }
        into.push(bits);
    }
}

/// How far vertices reach out of the bounds of their cluster, at their worst, and how much of the bounds'
/// diagonals they take up.
fn reach(clusters: &Clusters, input: &DiceInput<'_>, random: &mut Random) -> (f64, f64) {
    let (mut worst, mut filled) = (f64::NEG_INFINITY, 0.0);
    for cluster in 0..clusters.len() {
        let mesh = clusters.dice(input, cluster).expect("dicing").mesh;
        let keys = mesh.key_times.clone();
        let bounds = clusters.bounds(cluster);
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for round in 0..keys.len() + 4 {
            let time = keys.get(round).copied().unwrap_or_else(|| random.unit());
            let (k, f) = hdtrapeze_core::grid::locate_key(&keys, time);
            let next = (k + 1).min(keys.len() - 1);
            let (low, high) = bounds.at(f64::from(time));
            for g in 0..mesh.grids.len() {
                let ends = mesh
                    .grid_positions(g, k)
                    .iter()
                    .zip(mesh.grid_positions(g, next));
                for (a, b) in ends {
                    let (a, b) = (a.as_dvec3(), b.as_dvec3());
                    let p = a + (b - a) * f64::from(f);
                    worst = worst.max((low - p).max(p - high).max_element());
                    if time == 0.0 {
                        (lo, hi) = (lo.min(p), hi.max(p));
                    }
                }
            }
        }
        let (low, high) = bounds.at(0.0);
        filled += (hi - lo).length() / (high - low).length();
    }
    (worst, filled / clusters.len() as f64)
}

fn check(surface: &dyn LimitSurface, path: &PointPath, random: &mut Random) -> (usize, f64) {
    with_input(surface, path, |input| {
        let clusters = Clusters::new(input, &ALL).expect("no error").expect("cut");
        let (mut whole, mut parts, mut joined) = (Vec::new(), Vec::new(), Vec::new());
        grids(&dice(input).expect("dicing"), &mut whole);
        // Backwards: nothing may lean on what came before.
        for cluster in (0..clusters.len()).rev() {
            let at = parts.len();
            let diced = clusters.dice(input, cluster).expect("dicing");
            grids(&diced, &mut parts);
            parts[at..].reverse();
        }
        parts.reverse();
        grids(&clusters.dice_all(input).expect("dicing"), &mut joined);
        assert!(!whole.is_empty() && parts == joined);
        whole.sort();
        joined.sort();
        assert!(whole == joined);
        let (worst, filled) = reach(&clusters, input, random);
        assert!(worst <= 0.0, "{worst}");
        (clusters.len(), filled)
    })
}

fn meshes(random: &mut Random) -> Vec<(MeshTopology, Vec<Vec3>)> {
    let mut meshes = vec![cube(), grid(5, 4), thirds(icosahedron()), octahedron()];
    for i in 0..12 {
        let is_loop = i % 4 == 3;
        let (mut topology, points) = patchwork(random, 5, is_loop);
        topology.boundary = match i % 3 {
            0 => BoundaryInterpolation::EdgeAndCorner,
            1 => BoundaryInterpolation::EdgeOnly,
            _ => BoundaryInterpolation::None,
        };
        if i % 2 == 1 {
            sharpen(random, &mut topology, 0.3);
        }
        if i % 4 == 2 {
            topology.scheme = Scheme::Bilinear;
        }
        meshes.push((topology, points));
    }
    meshes
}

#[test]
fn clusters_are_the_surface_and_lie_within_their_bounds() {
    let mut random = Random(29);
    let (mut cut, mut all) = (0, 0);
    for (number, (topology, points)) in meshes(&mut random).into_iter().enumerate() {
        let moved = points.iter().map(|&p| p + random.vec3() * 0.5).collect();
        let colours = Channel {
            kind: ChannelKind::Vertex,
            width: 3,
            values: points.iter().flat_map(|p| p.to_array()).collect(),
            indices: Vec::new(),
        };
        let surface = OsdFactory::new()
            .create_surface(&topology, &[points, moved], vec![colours])
            .expect("the topology is good");
        let path = path(&mut random, &[0.0, 1.0]);
        all += 1;
        let manifold = with_input(&surface, &path, |input| {
            Clusters::new(input, &ALL).unwrap().is_some()
        });
        if manifold {
            let (count, filled) = check(&surface, &path, &mut random);
            println!("mesh {number}: {count} clusters, {filled:.3} of their bounds");
            cut += usize::from(count > 1);
        }
    }
    // Holes of patchworks that touch at a vertex make them more than one piece there.
    assert!(3 * cut >= 2 * all, "{cut} of {all}");
}

#[test]
fn spheres_and_nurbs_are_cut_too() {
    let mut random = Random(31);
    let sphere = QuadricSurface::sphere(vec![2.0, 2.5], Orientation::RightHanded);
    let moving = path(&mut random, &[0.0, 1.0]);
    assert_eq!(check(&sphere, &moving, &mut random).0, 6);
    let knots = [0., 0., 0., 0., 1., 1.5, 3., 4., 4., 4., 4.];
    let along = Knots::new(4, 7, &knots, None).expect("knots").0;
    let points = |random: &mut Random| {
        let at = |i: usize| Vec3::new((i % 7) as f32, (i / 7) as f32, 0.0);
        (0..49).map(|i| at(i) + random.vec3()).collect::<Vec<_>>()
    };
    let patch = NurbsPatch {
        knots: [along.clone(), along],
        points: vec![points(&mut random), points(&mut random)],
        weights: (0..49).map(|_| 0.2 + f64::from(random.unit())).collect(),
        usable: Vec::new(),
        orientation: Orientation::RightHanded,
    };
    let surface = NurbsSurface::new(patch, Vec::new());
    assert!(check(&surface, &moving, &mut random).0 > 8);
}
