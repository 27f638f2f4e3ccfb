//! Implicit prims: sizes checked and resolved to keys, and their surfaces.
//!
//! Sizes go linearly between samples. Points of most kinds are linear in the sizes, so keys at the
//! samples follow them exactly; a capsule whose side leans over gets more keys.

use glam::{DAffine3, DVec3, Vec3};

use super::points::PointKeys;
use crate::diagnostics::{Code, Warning};
use crate::motion::rates::LARGEST_COORDINATE;
use crate::motion::transform::keys_within;
use crate::motion::{Shutter, Timeline};
use crate::scene::{Axis, ImplicitDesc, ImplicitKind};
use crate::surface::polygon::PolygonSurface;
use crate::surface::quadric::{Profile, QuadricSurface};
use crate::surface::{Channel, LimitSurface, MeshTopology, Orientation, Scheme};
use crate::translate::mesh::CheckedMesh;
use crate::translate::primvar::{Count, Counts, Resolved, Spread};

/// Largest distance of a point's path from the chord between keys, as a share of the largest size.
const CURVE_TOLERANCE: f64 = 2.5e-4;

/// An implicit prim that dicing can take.
pub struct CheckedImplicit {
    /// Sizes at the keys of `points`, without signs, as [`ImplicitKind`] lists them.
    pub sizes: Vec<[f64; 3]>,
    /// The surface, at every key.
    pub surface: Box<dyn LimitSurface>,
    /// What a cube or a plane is made of: primvars have values for its faces and vertices. Round
    /// shapes have none.
    pub faces: Option<CheckedMesh>,
    /// Points that bound it.
    pub points: PointKeys,
}

/// Checks `desc`. `None` when nothing is left to render; a prim without area is no reason to warn.
pub fn check(
    path: &str,
    desc: &ImplicitDesc,
    shutter: Shutter,
    warnings: &mut Vec<Warning>,
) -> Option<CheckedImplicit> {
    let count = desc.times.len().min(desc.sizes.len());
    if count == 0 {
        return None;
    }
    let mut warn = |code, text: String| warnings.push(Warning::new(path, code, text));
    let Some(timeline) = Timeline::new(&desc.times[..count], shutter) else {
        let text = "no size has a finite time; the prim is dropped";
        warn(Code::TimeSamples, text.to_owned());
        return None;
    };
    let names = size_names(desc.kind);
    let usable = |size: &f64| size.abs() < f64::from(LARGEST_COORDINATE);
    let mut reversed = false;
    let mut negative = None;
    for sizes in &desc.sizes[..count] {
        for (name, size) in names.iter().zip(sizes) {
            if !usable(size) {
                let text = format!("its {name} is {size}; the prim is dropped");
                warn(Code::NotFinite, text);
                return None;
            }
            if *size < 0.0 {
                negative = negative.or(Some((name, *size)));
                // What tapers along a negative height tapers the other way.
                reversed |= *name == "height" && desc.kind != ImplicitKind::Capsule;
            }
        }
    }
    if let Some((name, size)) = negative {
        let text = format!("its {name} is {size}; it is rendered with the size without its sign");
        warn(Code::NotFinite, text);
    }
    let sizes_at = |time: f64| {
        let blend = timeline.blend(time);
        let (a, b) = (&desc.sizes[blend.a], &desc.sizes[blend.b]);
        let mix = |i: usize| a[i].abs() * (1.0 - blend.f) + b[i].abs() * blend.f;
        [0, 1, 2].map(|i| if i < names.len() { mix(i) } else { 0.0 })
    };
    let mut times = timeline.key_times(shutter.is_still());
    if desc.kind == ImplicitKind::Capsule && times.len() > 1 {
        times = capsule_keys(&times, &sizes_at);
    }
    let mut sizes: Vec<[f64; 3]> = times.iter().map(|&t| sizes_at(t)).collect();
    if sizes.windows(2).all(|w| w[0] == w[1]) {
        sizes.truncate(1);
        times = vec![0.0];
    }
    if sizes.iter().all(|sizes| is_empty(desc.kind, sizes)) {
        return None;
    }
    let times = times.iter().map(|&t| t as f32).collect();
    let (surface, faces, points) = make(desc, times, &sizes, reversed);
    let mut reach = points.points.iter().flatten();
    if reach.all(|p| p.abs().max_element() < LARGEST_COORDINATE) {
        return Some(CheckedImplicit {
            sizes,
            surface,
            faces,
            points,
        });
    }
    // Also where the reach is not finite: a capsule with hardly any height and unlike radii.
    warn(
        Code::NotFinite,
        "its sizes make it too large to render; the prim is dropped".to_owned(),
    );
    None
}

impl CheckedImplicit {
    /// How many values a primvar has.
    pub fn primvar_counts(&self) -> Counts {
        match &self.faces {
            Some(faces) => Counts {
                prim: "shape",
                ..faces.primvar_counts()
            },
            None => ROUND,
        }
    }

    /// The surface with what is to be evaluated over it.
    pub fn with_channels(mut self, channels: Vec<Channel>) -> Self {
        if let Some(faces) = self.faces.as_ref().filter(|_| !channels.is_empty()) {
            self.surface = faces.polygons(channels);
        }
        self
    }

    /// Spreads a primvar that was resolved with [`CheckedImplicit::primvar_counts`].
    pub fn spread(&self, resolved: Resolved) -> Spread<Channel> {
        match &self.faces {
            Some(faces) => faces.spread(resolved),
            None => resolved.into_constant(),
        }
    }
}

/// Primvars of round shapes: Hydra's meshes for them have so many faces as it sees fit.
const ROUND: Counts = {
    let one = Count(
        1,
        "value (round shapes have no faces or vertices of their own)",
    );
    Counts {
        uniform: one,
        varying: one,
        vertex: one,
        face_varying: one,
        ..Counts::one_value("shape")
    }
};

impl CheckedMesh {
    fn polygons(&self, channels: Vec<Channel>) -> Box<dyn LimitSurface> {
        let surface = PolygonSurface::new(&self.topology, &self.points.points, channels);
        Box::new(surface.expect("quads over as many points"))
    }
}

/// What the sizes of a kind are called in USD, in the order of [`ImplicitKind`].
fn size_names(kind: ImplicitKind) -> &'static [&'static str] {
    match kind {
        ImplicitKind::Cube => &["size"],
        ImplicitKind::Plane => &["width", "length"],
        ImplicitKind::Sphere => &["radius"],
        ImplicitKind::Cylinder | ImplicitKind::Capsule => {
            &["height", "lower radius", "upper radius"]
        }
        ImplicitKind::Cone => &["height", "radius"],
    }
}

/// True where there is no area.
fn is_empty(kind: ImplicitKind, &[a, b, c]: &[f64; 3]) -> bool {
    match kind {
        ImplicitKind::Cube | ImplicitKind::Sphere => a == 0.0,
        ImplicitKind::Plane => a == 0.0 || b == 0.0,
        ImplicitKind::Cone => b == 0.0,
        ImplicitKind::Cylinder | ImplicitKind::Capsule => b == 0.0 && c == 0.0,
    }
}

fn profile(kind: ImplicitKind, &[a, b, c]: &[f64; 3]) -> Profile {
    match kind {
        ImplicitKind::Cone => Profile::cone(a, b),
        ImplicitKind::Capsule => Profile::capsule(a, b, c),
        _ => Profile::cylinder(a, b, c),
    }
}

/// Keys of a capsule: more where the rims of its caps wander.
fn capsule_keys(times: &[f64], sizes_at: &dyn Fn(f64) -> [f64; 3]) -> Vec<f64> {
    let largest = times.iter().flat_map(|&t| sizes_at(t)).fold(0.0, f64::max);
    let probe = |time: f64| {
        let probes = profile(ImplicitKind::Capsule, &sizes_at(time)).probes();
        probes.map(|p| DVec3::new(p.x, 0.0, p.y)).to_vec()
    };
    keys_within(
        &|_| DAffine3::IDENTITY,
        times,
        CURVE_TOLERANCE * largest,
        &probe,
    )
}

fn make(
    desc: &ImplicitDesc,
    times: Vec<f32>,
    sizes: &[[f64; 3]],
    reversed: bool,
) -> (Box<dyn LimitSurface>, Option<CheckedMesh>, PointKeys) {
    let orientation = desc.orientation;
    match desc.kind {
        ImplicitKind::Cube => {
            let points = sizes.iter().map(|s| cube_points(s[0])).collect();
            polygons(
                CUBE_FACES.as_flattened(),
                orientation,
                PointKeys { times, points },
            )
        }
        ImplicitKind::Plane => {
            let points = sizes.iter().map(|s| plane_points(desc.axis, s)).collect();
            polygons(&[0, 1, 2, 3], orientation, PointKeys { times, points })
        }
        ImplicitKind::Sphere => {
            let points = sizes.iter().map(|s| cube_points(2.0 * s[0])).collect();
            let radii = sizes.iter().map(|s| s[0]).collect();
            let surface = QuadricSurface::sphere(radii, orientation);
            (Box::new(surface), None, PointKeys { times, points })
        }
        kind => {
            let profiles: Vec<Profile> = sizes.iter().map(|s| profile(kind, s)).collect();
            let boxed = |p: &Profile| {
                let [radius, low, high] = p.extent();
                let ends = if reversed { [-low, -high] } else { [low, high] };
                let along = |c: DVec3| along_axis(desc.axis, c).as_vec3();
                let corner = |i: usize| {
                    let sign = |bit: usize| if i >> bit & 1 == 1 { radius } else { -radius };
                    along(DVec3::new(sign(0), sign(1), ends[i >> 2]))
                };
                (0..8).map(corner).collect()
            };
            let points = profiles.iter().map(boxed).collect();
            let surface = QuadricSurface::revolved(profiles, desc.axis, reversed, orientation);
            (Box::new(surface), None, PointKeys { times, points })
        }
    }
}

/// `p`, which stands along z, turned to stand along `axis` without being mirrored.
fn along_axis(axis: Axis, p: DVec3) -> DVec3 {
    match axis {
        Axis::X => DVec3::new(p.z, p.x, p.y),
        Axis::Y => DVec3::new(p.y, p.z, p.x),
        Axis::Z => p,
    }
}

/// In the order of the mesh that Hydra draws for a cube: around the +z face, then around the -z face.
fn cube_points(size: f64) -> Vec<Vec3> {
    let half = (0.5 * size) as f32;
    let (p, n) = (half, -half);
    let around = |z| [[p, p, z], [n, p, z], [n, n, z], [p, n, z]].map(Vec3::from_array);
    let [a, b, c, d] = around(n);
    around(p).into_iter().chain([c, b, a, d]).collect()
}

/// In Hydra's order, too: +z, -z, +y, -y, +x, -x. Counter-clockwise from outside.
const CUBE_FACES: [[u32; 4]; 6] = [
    [0, 1, 2, 3],
    [4, 5, 6, 7],
    [0, 6, 5, 1],
    [4, 7, 3, 2],
    [0, 3, 7, 6],
    [4, 2, 1, 5],
];

/// Width runs along x, or along z where the plane faces x; length along y, or along z where it faces
/// y. Counter-clockwise from where it faces, in the order of Hydra's mesh.
fn plane_points(axis: Axis, &[width, length, _]: &[f64; 3]) -> Vec<Vec3> {
    let (u, v, first) = match axis {
        Axis::Z => (width, length, 1),
        Axis::X => (length, width, 1),
        Axis::Y => (length, width, 0),
    };
    let mut corners = [(0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (-0.5, -0.5)];
    corners.rotate_left(first);
    corners
        .map(|(a, b)| along_axis(axis, DVec3::new(a * u, b * v, 0.0)).as_vec3())
        .to_vec()
}

fn polygons(
    indices: &[u32],
    orientation: Orientation,
    points: PointKeys,
) -> (Box<dyn LimitSurface>, Option<CheckedMesh>, PointKeys) {
    let topology = MeshTopology {
        scheme: Scheme::None,
        orientation,
        vertex_count: points.points[0].len(),
        face_vertex_counts: vec![4; indices.len() / 4],
        face_vertex_indices: indices.to_vec(),
        ..MeshTopology::default()
    };
    let faces = CheckedMesh {
        elements: (0..indices.len() as u32 / 4).collect(),
        face_vertices: (0..indices.len() as u32).collect(),
        authored_faces: indices.len() / 4,
        authored_face_vertices: indices.len(),
        topology,
        points: points.clone(),
    };
    let surface = faces.polygons(Vec::new());
    (surface, Some(faces), points)
}

#[cfg(test)]
#[path = "implicit_tests.rs"]
mod tests;
