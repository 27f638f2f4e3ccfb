//! Keys of curves whose cross-sections turn within the shutter.
//!
//! Between keys every vertex goes straight. A ribbon's edge, or a tube's side, that turns by phi between
//! two keys is nearer to the middle by `r phi^2 / 8` half way; where that can be seen, there are
//! more keys. What stands still before a camera that moves stays still for as long as it cannot be seen
//! that it does not turn.

use glam::DVec3;

use super::layout::Form;
use super::set::{CurveSet, Station};
use super::strand::{Section, Strand, carry, face, lie_across, view_of};
use crate::camera::Camera;
use crate::dice::{Eye, RasterMetric};
use crate::motion::PointPath;

/// Pixels that an edge may be off by between keys...
const TOLERANCE: f64 = 0.1;
/// ...and share of its distance from the middle: what is thinner than a pixel must not lose coverage.
const SHARE: f64 = 0.02;
/// Curves that are looked at, at most.
const PROBES: usize = 512;
/// Keys, at most.
const MOST_KEYS: usize = 65;
/// Most that normals turn over the shutter, in radians, where one key of them serves: half a step of 8
/// bits in shading.
const STEADY: f64 = 0.01;

/// The keys that a set of curves gets.
pub struct Keys {
    /// The path with all keys.
    pub path: PointPath,
    /// The camera at each; none where nothing may depend on it.
    pub eyes: Option<Vec<Eye>>,
    /// Keys of the normals: 1 or all.
    pub normals: usize,
}

/// One cross-section that is watched over the shutter: its edge and its normal where it is placed.
#[derive(Clone, Copy)]
struct Watched {
    edge: DVec3,
    normal: DVec3,
    p: DVec3,
}

/// Finds the keys of curves with the given forms, `path` being the path of their points.
pub fn find(
    set: &CurveSet,
    forms: &[(u32, Form)],
    path: &PointPath,
    metric: &RasterMetric,
    camera: Option<&Camera>,
) -> Keys {
    let with_eyes = |path: &PointPath| camera.map(|c| Eye::at_keys(c, path));
    let still = path.key_times().len() == 1;
    let faces = forms.iter().any(|(_, form)| *form == Form::Facing);
    let camera_moves = camera.is_some_and(Camera::is_moving);
    if still && !(faces && camera_moves) {
        return Keys {
            path: path.clone(),
            eyes: with_eyes(path),
            normals: 1,
        };
    }
    let step = forms.len().div_ceil(PROBES).max(1);
    let chosen: Vec<(u32, Form)> = forms.iter().step_by(step).copied().collect();

    let mut probe = path.clone();
    if still {
        // As it is in mid-shutter, against both ends.
        probe = path.with_keys(vec![0.0, 0.5, 1.0]);
    }
    let seen = watch(set, &chosen, &probe, with_eyes(&probe).as_deref());
    let key_of = |k: usize| if still { 0 } else { k };
    if still {
        let worst = (0..3).map(|k| off(metric, 0, &seen[1], &seen[k], 0.5));
        if worst.fold(0.0, f64::max) <= 1.0 {
            return Keys {
                path: path.clone(),
                eyes: with_eyes(path),
                normals: 1,
            };
        }
        probe = path.with_keys(vec![0.0, 1.0]);
    }
    let seen = if still {
        vec![seen[0].clone(), seen[2].clone()]
    } else {
        seen
    };
    let times = probe.key_times().to_vec();
    let room = (MOST_KEYS.saturating_sub(times.len()) / (times.len() - 1)).max(1);
    let mut keys = vec![times[0]];
    for k in 1..times.len() {
        let off = off(metric, key_of(k), &seen[k - 1], &seen[k], 1.0);
        let parts = off.sqrt().ceil().clamp(1.0, room as f64);
        let (a, b) = (times[k - 1], times[k]);
        keys.extend((1..parts as usize).map(|i| a + (b - a) * (i as f32 / parts as f32)));
        keys.push(b);
    }
    let turned = seen
        .iter()
        .flat_map(|now| now.iter().zip(&seen[0]))
        .map(|(now, first)| {
            let edges = [now.edge, first.edge].map(DVec3::normalize_or_zero);
            let edge = edges[0].cross(edges[1]).length();
            now.normal.cross(first.normal).length().max(edge)
        })
        .fold(0.0f64, f64::max);
    let path = path.with_keys(keys);
    let normals = if turned < STEADY {
        1
    } else {
        path.key_times().len()
    };
    let eyes = with_eyes(&path);
    Keys {
        path,
        eyes,
        normals,
    }
}

/// By how much edges that turn from `a` to `b` come nearer to the middle, in units of what they may: all
/// of the turn between two keys (`share` 1), or all of it against one that stands still (`share`
/// 1/2 of a turn twice as far).
fn off(metric: &RasterMetric, key: usize, a: &[Watched], b: &[Watched], share: f64) -> f64 {
    let of = |(a, b): (&Watched, &Watched)| {
        let cosine = a.edge.dot(b.edge) / (a.edge.length() * b.edge.length());
        if !cosine.is_finite() {
            return 0.0;
        }
        let turn = cosine.clamp(-1.0, 1.0).acos() / share;
        let near = 1.0 - (0.5 * turn).cos().max(0.0);
        let p = a.p.as_vec3();
        let pixels = f64::from(metric.length(key, p, p + (a.edge * near).as_vec3()));
        (near / SHARE).max(pixels / TOLERANCE)
    };
    a.iter().zip(b).map(of).fold(0.0, f64::max)
}

/// The ends and the middle of each chosen curve at every key.
fn watch(
    set: &CurveSet,
    chosen: &[(u32, Form)],
    path: &PointPath,
    eyes: Option<&[Eye]>,
) -> Vec<Vec<Watched>> {
    let mut strand = Strand::new(set);
    let (mut sections, mut radii): (Vec<Section>, Vec<f64>) = Default::default();
    let count = path.key_times().len();
    let mut out = vec![Vec::with_capacity(3 * chosen.len()); count];
    for &(span, form) in chosen {
        let span = &set.curves.spans[span as usize];
        let station = |segment: u32, t: f32| Station {
            segment,
            t,
            corner: false,
        };
        let last = span.segments - 1;
        let stations = [station(0, 0.0), station(last / 2, 0.5), station(last, 1.0)];
        let mut before = Vec::new();
        set.radii(span, &stations, &mut radii);
        for (key, out) in out.iter_mut().enumerate() {
            strand.load(span, path, key);
            strand.sections(&stations, &radii, &mut sections);
            let matrix = path.matrix(key);
            match (form, eyes) {
                (Form::Facing, Some(eyes)) => {
                    let to_eye = view_of(path, key, eyes[key]);
                    face(&mut sections, &matrix.matrix3, to_eye, &mut before);
                }
                (Form::Flat, _) => lie_across(&mut sections, |i| {
                    super::rate::normal_at(set, span, &stations[i])
                }),
                _ => carry(&mut sections, false, &mut before),
            }
            for s in &sections {
                let normal = path.normal_matrix(key) * s.along.cross(s.side);
                out.push(Watched {
                    edge: matrix.matrix3 * (s.side * s.radius),
                    normal: normal.normalize_or_zero(),
                    p: matrix.transform_point3(s.p) - path.origin(),
                });
            }
        }
    }
    out
}
