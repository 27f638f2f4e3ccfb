//! Diced spheres: outlines, closed halves, facing at each key, elements, memory.

use std::collections::HashMap;
use std::sync::atomic::AtomicBool;

use glam::{DAffine3, DMat4, DVec3, Vec3};
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::camera::Camera;
use hdtrapeze_core::dice::RasterMetric;
use hdtrapeze_core::grid::{DicedMesh, octahedral};
use hdtrapeze_core::motion::{PointPath, Shutter};
use hdtrapeze_core::scene::{CameraDesc, RenderSettings, TransformSamples};
use hdtrapeze_core::sphere::{SphereDice, SphereSet, dice};
use hdtrapeze_core::translate::measure::views_at_keys;
use hdtrapeze_core::translate::points::PointKeys;
use hdtrapeze_core::translate::values::Values;
use proptest::prelude::*;

const SHUTTER: Shutter = Shutter {
    open: 0.0,
    close: 1.0,
};

/// A camera at (0, 0, 10), 100 pixels a unit at the origin, that moves by `step` over the shutter.
fn camera(step: DVec3) -> Camera {
    let at = |p: DVec3| DMat4::from_translation(DVec3::new(0.0, 0.0, 10.0) + p);
    let desc = CameraDesc {
        transform: vec![TransformSamples {
            times: vec![0.0, 1.0],
            matrices: vec![at(DVec3::ZERO), at(step)],
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

fn set(keys: &[Vec<Vec3>], widths: &[f32]) -> SphereSet {
    let last = (keys.len() - 1).max(1) as f32;
    SphereSet {
        elements: (0..keys[0].len() as u32).collect(),
        points: PointKeys {
            times: (0..keys.len()).map(|k| k as f32 / last).collect(),
            points: keys.to_vec(),
        },
        widths: match widths {
            [w] => Values::Constant(vec![*w]),
            _ => Values::Vertex(widths.to_vec()),
        },
    }
}

fn run(
    set: &SphereSet,
    path: &PointPath,
    metric: &RasterMetric,
    camera: Option<&Camera>,
) -> DicedMesh {
    let input = SphereDice {
        set,
        path,
        metric,
        camera,
        shading_rate: 1.0,
        max_micropolygons: 1 << 40,
        cancel: &AtomicBool::new(false),
    };
    dice(&input).unwrap().mesh
}

fn seen(set: &SphereSet, camera: &Camera) -> DicedMesh {
    let path = PointPath::identity(&set.points.times, DVec3::ZERO);
    let metric = RasterMetric::new(&views_at_keys(camera, path.key_times()), path.origin());
    run(set, &path, &metric, Some(camera))
}

fn instanced(set: &SphereSet, pixels: f32) -> DicedMesh {
    let path = PointPath::identity(&set.points.times, DVec3::ZERO);
    run(set, &path, &RasterMetric::uniform(pixels), None)
}

/// Area of a grid's outline as the camera at (0, 0, 10) sees it, in pixels, and the mean of the shading
/// normals' cosine over it.
fn outline(mesh: &DicedMesh, g: usize) -> (f64, f64) {
    let (p, n) = (mesh.grid_positions(g, 0), mesh.grid_normals(g, 0));
    let row = usize::from(mesh.grids[g].nu) + 1;
    let place = |i: usize| {
        let p = p[i].as_dvec3();
        p.truncate() * 1000.0 / (10.0 - p.z)
    };
    let (mut area, mut light) = (0.0, 0.0);
    for j in 0..usize::from(mesh.grids[g].nv) {
        for i in 0..usize::from(mesh.grids[g].nu) {
            let at = j * row + i;
            for t in [[at, at + 1, at + row + 1], [at, at + row + 1, at + row]] {
                let (e, f) = (place(t[1]) - place(t[0]), place(t[2]) - place(t[0]));
                let size = 0.5 * e.perp_dot(f).max(0.0);
                let normals = t.map(|v| octahedral::decode(n[v]).as_dvec3());
                const S: usize = 8;
                let mut sum = 0.0;
                for k in 0..S * S {
                    let (x, y) = (
                        (0.5 + (k % S) as f64) / S as f64,
                        (0.5 + (k / S) as f64) / S as f64,
                    );
                    let (b, c) = if x + y < 1.0 {
                        (x, y)
                    } else {
                        (1.0 - x, 1.0 - y)
                    };
                    let m = normals[0] * (1.0 - b - c) + normals[1] * b + normals[2] * c;
                    sum += m.normalize().z;
                }
                area += size;
                light += size * sum / (S * S) as f64;
            }
        }
    }
    (area, light / area)
}

#[test]
fn every_size_has_the_disks_area_and_the_spheres_brightness() {
    let camera = camera(DVec3::ZERO);
    // Radius in pixels: a hundred a unit.
    for radius in [0.05, 0.4, 0.6, 1.0, 3.0, 8.0, 15.0, 17.0, 60.0] {
        let set = set(&[vec![Vec3::ZERO]], &[(radius * 0.02) as f32]);
        let mesh = seen(&set, &camera);
        let (area, light) = outline(&mesh, 0);
        let disk = std::f64::consts::PI * radius * radius;
        let cells = mesh.cell_count();
        println!(
            "{radius} pixels: {cells} cells, area {:.4}, light {light:.4}",
            area / disk
        );
        // The outline of what is near is a little larger than the disk through its middle.
        let near = 1.0 + 0.02 * radius / 10.0;
        assert!((area / disk - 1.0).abs() < 0.004 * near, "{radius}");
        assert!(
            (light - 2.0 / 3.0).abs() < 0.01 + 0.0005 * radius,
            "{radius}"
        );
        assert_eq!(mesh.grids.len() == 1, radius <= 16.0, "{radius}");
        assert_eq!(cells == 1, radius <= 0.5, "{radius}");
    }
}

#[test]
fn full_spheres_are_closed_at_every_key() {
    let keys = [
        vec![Vec3::new(0.1, 0.2, 0.3)],
        vec![Vec3::new(0.4, -0.2, 0.3)],
    ];
    for pixels in [1.0, 50.0, 3000.0] {
        let mesh = instanced(&set(&keys, &[1.0]), pixels);
        assert_eq!(mesh.key_count(), 2);
        let mut edges: HashMap<[Vec<[u32; 3]>; 2], i32> = HashMap::new();
        for (g, grid) in mesh.grids.iter().enumerate() {
            let row = usize::from(grid.nu) + 1;
            let corner = |i: usize, j: usize| -> Vec<[u32; 3]> {
                (0..2)
                    .map(|k| mesh.grid_positions(g, k)[j * row + i].to_array())
                    .map(|p| p.map(|x| (x + 0.0).to_bits()))
                    .collect()
            };
            for j in 0..usize::from(grid.nv) {
                for i in 0..usize::from(grid.nu) {
                    let cell = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)];
                    for e in 0..4 {
                        let (a, b) = (cell[e], cell[(e + 1) % 4]);
                        let (a, b) = (corner(a.0, a.1), corner(b.0, b.1));
                        let (key, sign) = if a < b { ([a, b], 1) } else { ([b, a], -1) };
                        *edges.entry(key).or_default() += sign;
                    }
                }
            }
        }
        assert!(edges.values().all(|&n| n == 0), "open at {pixels}");
        for g in 0..mesh.grids.len() {
            for (p, n) in mesh
                .grid_positions(g, 1)
                .iter()
                .zip(mesh.grid_normals(g, 0))
            {
                let out = *p - keys[1][0];
                assert!((out.length() - 0.5).abs() < 0.01);
                assert!(octahedral::decode(*n).dot(out.normalize()) > 0.999);
            }
        }
    }
}

#[test]
fn each_has_its_element_and_width() {
    let n = 500;
    let points: Vec<Vec3> = (0..n)
        .map(|i| {
            let j = (i * 7919) % n;
            Vec3::new(
                (j % 25) as f32 * 0.15 - 2.0,
                (j / 25) as f32 * 0.15 - 2.0,
                0.0,
            )
        })
        .collect();
    let widths: Vec<f32> = (0..n).map(|i| (i % 5) as f32 * 0.02).collect();
    let mut set = set(std::slice::from_ref(&points), &widths);
    set.elements.retain(|e| e % 7 != 3);
    let mesh = seen(&set, &camera(DVec3::ZERO));
    let mut found = Vec::new();
    for (g, grid) in mesh.grids.iter().enumerate() {
        let p = mesh.grid_positions(g, 0);
        let middle = p.iter().sum::<Vec3>() / p.len() as f32;
        let e = grid.element as usize;
        assert!((middle - points[e]).length() < 0.03);
        let farthest = p
            .iter()
            .map(|p| (*p - points[e]).length())
            .fold(0.0, f32::max);
        let radius = widths[e] / 2.0;
        assert!(
            farthest > 0.99 * radius && farthest < 1.26 * radius,
            "{farthest} {radius}"
        );
        found.push(grid.element);
    }
    found.sort_unstable();
    let wanted: Vec<u32> = (0..n as u32).filter(|e| e % 7 != 3 && e % 5 != 0).collect();
    assert_eq!(found, wanted, "those without width have nothing");
}

/// Facing at each key's own time, through a transform that stretches: the rim is the outline.
#[test]
fn hemispheres_face_the_camera_through_their_transform() {
    let keys = [vec![Vec3::ZERO], vec![Vec3::new(0.5, 0.0, 1.0)]];
    let set = set(&keys, &[0.1]);
    let matrix = |t: f64| {
        DAffine3::from_rotation_z(0.6 * t) * DAffine3::from_scale(DVec3::new(1.0, 2.0, -0.7))
    };
    let path = PointPath::new(
        &[0.0, 1.0],
        vec![0.0, 0.5, 1.0],
        &[0.0, 0.5, 1.0].map(matrix),
        DVec3::ZERO,
    );
    let camera = camera(DVec3::new(1.0, 0.0, 0.0));
    let metric = RasterMetric::new(&views_at_keys(&camera, path.key_times()), DVec3::ZERO);
    let mesh = run(&set, &path, &metric, Some(&camera));
    assert_eq!(mesh.grids.len(), 1, "a hemisphere");
    let row = usize::from(mesh.grids[0].nu) + 1;
    for (k, &t) in mesh.key_times.iter().enumerate() {
        let t = f64::from(t);
        let inverse = matrix(t).inverse();
        let eye = inverse.transform_point3(DVec3::new(t, 0.0, 10.0));
        let centre = keys[0][0].as_dvec3().lerp(keys[1][0].as_dvec3(), t);
        let front = (eye - centre).normalize();
        let p = mesh.grid_positions(0, k);
        for (i, p) in p.iter().enumerate() {
            let q = inverse.transform_point3(p.as_dvec3()) - centre;
            let rim = i % row == 0 || i % row == row - 1 || i < row || i >= row * (row - 1);
            let height = q.normalize().dot(front);
            assert!(
                if rim {
                    height.abs() < 1e-4
                } else {
                    height > 0.05
                },
                "{height}"
            );
        }
    }
}

#[test]
fn a_camera_that_swings_around_sees_whole_spheres() {
    let near = set(&[vec![Vec3::new(0.0, 0.0, 8.0)]], &[0.01]);
    assert_eq!(seen(&near, &camera(DVec3::ZERO)).grids.len(), 1);
    let swung = seen(&near, &camera(DVec3::new(3.0, 0.0, 0.0)));
    assert_eq!((swung.grids.len(), swung.key_count()), (2, 1));
}

/// Particles below a pixel: what one takes.
#[test]
fn particles_are_lean() {
    let n = 20_000u32;
    let points: Vec<Vec3> = (0..n)
        .map(|i| {
            let h = |k: u32| (i.wrapping_mul(k) >> 8) as f32 / (1 << 24) as f32 - 0.5;
            Vec3::new(h(2_654_435_761), h(2_246_822_519), h(3_266_489_917)) * 4.0
        })
        .collect();
    let later: Vec<Vec3> = points
        .iter()
        .map(|p| *p + Vec3::new(0.1, 0.0, 0.0))
        .collect();
    let measure = |keys: &[Vec<Vec3>]| {
        let mesh = seen(&set(keys, &[0.005]), &camera(DVec3::ZERO));
        let stats = *ObjectGeometry::new(mesh).stats();
        let per = |n: u64| n as f64 / f64::from(stats.cells as u32);
        assert_eq!(stats.cells, u64::from(n));
        println!(
            "{} keys: {:.1} bytes of geometry, {:.1} of hierarchy a particle",
            keys.len(),
            per(stats.mesh_bytes),
            per(stats.bvh_bytes)
        );
        [per(stats.mesh_bytes), per(stats.bvh_bytes)]
    };
    let [geometry, hierarchy] = measure(std::slice::from_ref(&points));
    assert!(geometry < 76.1 && hierarchy < 30.0);
    let [geometry, hierarchy] = measure(&[points, later]);
    assert!(geometry < 140.1 && hierarchy < 50.0);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_that_is_not_finite_comes_out(
        places in prop::collection::vec(0..5usize, 1..20),
        width in prop::sample::select(vec![0.0f32, 1e-30, 1e-3, 1.0, 50.0, 1e6]),
    ) {
        // Some of them at the camera itself.
        let far = [Vec3::ZERO, Vec3::X, Vec3::new(0.0, 0.0, 10.0), Vec3::splat(1e6), -Vec3::X];
        let key = |shift: usize| -> Vec<Vec3> { places.iter().map(|p| far[(p + shift) % 5]).collect() };
        let set = set(&[key(0), key(2)], &[width]);
        for mesh in [seen(&set, &camera(DVec3::Y)), instanced(&set, 10.0)] {
            prop_assert!(mesh.positions.iter().all(|p| p.is_finite()));
        }
    }
}
