//! A surface cut into *clusters* of neighbouring faces, each of which can be diced on its own, later and in any
//! order: what no ray ever comes near is never diced.
//!
//! **Bounds before dicing.** [`LimitEvaluator::hull`](crate::surface::LimitEvaluator::hull) gives points whose
//! hull contains a face; a path takes positions to each output key by an affine map, so the mapped points
//! contain the mapped face. Their box at the keys becomes a [`LinearBox`], as for diced vertices. Rounding
//! is bounded by [`HULL_ROUNDING`] of the largest coordinate, carried through the matrix.
//!
//! A face copies vertices of its edges and corners, which another face may have evaluated. On a manifold mesh
//! both describe the same limit, so the copy is within rounding of the face's own hull; other meshes are
//! not cut.
//!
//! **The same bits.** What a cluster is diced to depends on the surface, the rate and the cluster's faces
//! alone. Edges keep the rates and vertices that [`super::dice`] gives them: a cluster evaluates the edges it
//! shares with another by the face that owns them, wherever that is. So clusters meet without cracks, and
//! nothing depends on which of them were diced before. The budget is the same for each: a surface is cut
//! only where it is far from its budget of micropolygons, and a cluster that goes beyond it all the same is
//! made coarser inside its faces, while its edges stay.
//!
//! Clusters are diced on the calling thread alone, without rayon: rays that wait for the same cluster must not
//! be made to wait for each other.

use super::base::{BaseMesh, usable};
use super::budget::{Budget, Halt};
use super::edges::BaseCurves;
use super::face::{FaceBudgets, FaceDicer, Leave};
use super::lattice::Part;
use super::sampler::Sampler;
use super::{COARSEST, DiceError, DiceInput, DiceOutput, chunk_faces, join, normal_key_count};
use crate::bvh::linear::round_up;
use crate::bvh::{COORDINATE_LIMIT, LinearBox, U};
use crate::surface::{HULL_ROUNDING, PatchDomain};
use glam::{Vec2, Vec3};
use rayon::prelude::*;

/// Which surfaces are cut, and how finely. Micropolygons are those expected from the corners of faces.
#[derive(Clone, Copy, Debug)]
pub struct ClusterRule {
    /// Surfaces of fewer micropolygons are not cut.
    pub least: f64,
    /// Nor are those with fewer micropolygons a face: a hull costs nearly what the micropolygons do.
    pub least_a_face: f64,
    /// A cluster of more than one face has at most so many.
    pub most: f64,
}

/// Faces that are looked at before all are.
const PROBES: usize = 64;

/// A surface is cut where its budget is at least so many times what is expected.
const BUDGET_RESERVE: f64 = 8.0;

/// A surface cut into clusters; see the module's text.
#[derive(Debug)]
pub struct Clusters {
    base: BaseMesh,
    /// Cluster after cluster; ascending in each.
    faces: Vec<u32>,
    /// First of each cluster in `faces`, and the end.
    first: Vec<u32>,
    bounds: Vec<LinearBox>,
    expected: Vec<f64>,
}

/// What is known of a face before it is diced.
#[derive(Clone, Copy, Debug)]
struct Survey {
    /// Contains the face, but for rounding.
    bounds: LinearBox,
    /// Largest coordinate of the hull, object space.
    reach: f32,
    /// Micropolygons.
    expected: f64,
}

impl Survey {
    /// Of a face without a surface.
    const NOTHING: Self = Self {
        bounds: LinearBox::EMPTY,
        reach: 0.0,
        expected: 0.0,
    };
}

impl Clusters {
    /// Cuts a surface; nothing where `rule` says that it does not pay, or nothing is known that contains it.
    ///
    /// # Errors
    /// As [`super::dice`]; keys that do not belong together give nothing.
    pub fn new(input: &DiceInput<'_>, rule: &ClusterRule) -> Result<Option<Self>, DiceError> {
        let keys = input.path.key_times().len();
        let sound = input.shading_rate > 0.0
            && input.path.point_key_count() == input.surface.key_count()
            && input.metric.key_count().is_none_or(|k| k == keys);
        if !sound || input.is_coarse() {
            return Ok(None);
        }
        let face_count = input.surface.face_count();
        let pays = |expected: f64, faces: usize, margin: f64| {
            let sum = expected * face_count as f64 / faces.max(1) as f64;
            sum >= rule.least * margin && sum >= rule.least_a_face * margin * face_count as f64
        };
        let step = face_count.div_ceil(PROBES).max(1);
        let probes: Vec<u32> = (0..face_count as u32).step_by(step).collect();
        let Some(probed) = survey(input, &probes) else {
            return Ok(None);
        };
        let expected = probed.iter().map(|face| face.expected).sum();
        if !pays(expected, probes.len(), 0.5) {
            return Ok(None);
        }
        let chunk = chunk_faces(face_count);
        let chunks: Option<Vec<Vec<Survey>>> = (0..face_count.div_ceil(chunk))
            .into_par_iter()
            .map(|c| {
                let end = ((c + 1) * chunk).min(face_count);
                let faces: Vec<u32> = (c as u32 * chunk as u32..end as u32).collect();
                survey(input, &faces)
            })
            .collect();
        let Some(surveys) = chunks.map(|chunks| chunks.concat()) else {
            return Ok(None);
        };
        let expected: f64 = surveys.iter().map(|face| face.expected).sum();
        let far_off = expected * BUDGET_RESERVE > input.max_micropolygons as f64;
        let pad = padding(input, &surveys);
        let bounded = surveys
            .iter()
            .fold(pad, |most, s| match s.bounds == LinearBox::EMPTY {
                true => most,
                false => most.max(s.bounds.max_abs()),
            });
        // Written so that what is not finite is refused. Half the limit leaves room for what is stored.
        let finite = bounded < COORDINATE_LIMIT * 0.5;
        if !pays(expected, face_count, 1.0) || far_off || !finite {
            return Ok(None);
        }
        let base = BaseMesh::new(input.surface)?;
        if !base.is_manifold() {
            return Ok(None);
        }
        let mut faces: Vec<u32> = (0..face_count as u32)
            .filter(|&face| !base.face_edges(face).is_empty())
            .collect();
        if faces.is_empty() {
            return Ok(None);
        }
        let mut first = vec![0];
        cut(&mut faces, &surveys, rule.most, &mut first);
        let mut clusters = Self {
            base,
            faces,
            first,
            bounds: Vec::new(),
            expected: Vec::new(),
        };
        for cluster in 0..clusters.len() {
            let own = clusters.faces(cluster).iter();
            let own = own.map(|&face| &surveys[face as usize]);
            let none = (LinearBox::EMPTY, 0.0);
            let (bounds, expected) = own.fold(none, |(bounds, expected), face| {
                (bounds.union(&face.bounds), expected + face.expected)
            });
            clusters.bounds.push(bounds.widen(pad));
            clusters.expected.push(expected);
        }
        Ok(Some(clusters))
    }

    /// Number of clusters.
    pub fn len(&self) -> usize {
        self.first.len() - 1
    }

    /// True where there is none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Faces of a cluster, ascending.
    pub fn faces(&self, cluster: usize) -> &[u32] {
        &self.faces[self.first[cluster] as usize..self.first[cluster + 1] as usize]
    }

    /// Contains every vertex of a cluster over the shutter, in the space of the path, relative to its origin.
    pub fn bounds(&self, cluster: usize) -> &LinearBox {
        &self.bounds[cluster]
    }

    /// Micropolygons that are expected of a cluster.
    pub fn expected(&self, cluster: usize) -> f64 {
        self.expected[cluster]
    }

    /// The same of some of its faces, at most `most` of them, each for itself, as `input`'s metric sees them.
    pub fn expected_of_faces(
        &self,
        input: &DiceInput<'_>,
        cluster: usize,
        most: usize,
    ) -> Vec<f64> {
        let faces = self.faces(cluster);
        let mut sampler = Sampler::new(input.surface, input.path, input.metric);
        let step = faces.len().div_ceil(most.max(1)).max(1);
        let of = |&face: &u32| {
            let corners = usable(input.surface.face_vertices(face)).len();
            sampler.bind(face);
            expected(&mut sampler, corners, input.shading_rate)
        };
        faces.iter().step_by(step).map(of).collect()
    }

    /// Bytes on the heap.
    pub fn bytes(&self) -> usize {
        let faces = size_of_val(self.faces.as_slice()) + size_of_val(self.first.as_slice());
        self.base.bytes() + faces + self.len() * (size_of::<LinearBox>() + size_of::<f64>())
    }

    /// Dices a cluster on this thread; `input` is what the clusters were made of.
    ///
    /// # Errors
    /// [`DiceError`]: cancelled, or no memory.
    pub fn dice(&self, input: &DiceInput<'_>, cluster: usize) -> Result<DiceOutput, DiceError> {
        let (part, rate) = self.dice_part(input, cluster)?;
        let mut output = join(input, vec![part])?;
        output.shading_rate = rate;
        output.coarsened = rate > input.shading_rate;
        Ok(output)
    }

    /// Dices all clusters in parallel; their grids are those of [`Self::dice`], one cluster after the other.
    ///
    /// # Errors
    /// [`DiceError`]: cancelled, or no memory.
    pub fn dice_all(&self, input: &DiceInput<'_>) -> Result<DiceOutput, DiceError> {
        let parts: Vec<(Part, f32)> = (0..self.len())
            .into_par_iter()
            .map(|cluster| self.dice_part(input, cluster))
            .collect::<Result<_, DiceError>>()?;
        let coarsest = parts.iter().fold(0.0f32, |most, &(_, rate)| most.max(rate));
        let mut output = join(input, parts.into_iter().map(|(part, _)| part).collect())?;
        output.shading_rate = coarsest;
        output.coarsened = coarsest > input.shading_rate;
        Ok(output)
    }

    fn dice_part(&self, input: &DiceInput<'_>, cluster: usize) -> Result<(Part, f32), DiceError> {
        let faces = self.faces(cluster);
        let base = self.base.part(faces);
        let failed = |halt: Halt| match halt {
            Halt::Failed(error) => error,
            Halt::OverBudget => DiceError::TooLarge, // not within u64
        };
        let all = Budget::new(u64::MAX, input.cancel);
        let (edges, evaluations) =
            BaseCurves::evaluate_part(input, &self.base, &base, input.shading_rate, &all)
                .map_err(failed)?;
        let mut rate = input.shading_rate;
        loop {
            let limit = match rate < COARSEST {
                true => input.max_micropolygons,
                false => u64::MAX,
            };
            let budgets = FaceBudgets {
                cells: Budget::new(limit, input.cancel),
                segments: Budget::new(limit.saturating_mul(4), input.cancel),
            };
            let mut dicer = FaceDicer::new(input, &base.rows, &edges, &budgets, rate);
            let channels = input.surface.channels().len();
            let mut part = Part::new(channels, normal_key_count(input));
            let diced = faces.iter().zip(0..).try_for_each(|(&face, row)| {
                match dicer.dice(row, face, &mut part) {
                    Ok(()) => Ok(()),
                    Err(Leave::NotFinite) => {
                        part.drop_face();
                        Ok(())
                    }
                    Err(Leave::Halt(halt)) => Err(halt),
                }
            });
            match diced {
                Ok(()) => {
                    part.evaluations = evaluations + dicer.evaluations();
                    return Ok((part, rate));
                }
                Err(Halt::OverBudget) => rate = (rate * 4.0).min(COARSEST),
                Err(Halt::Failed(error)) => return Err(error),
            }
        }
    }
}

/// Looks at some faces; nothing where one of them has no hull.
fn survey(input: &DiceInput<'_>, faces: &[u32]) -> Option<Vec<Survey>> {
    let mut sampler = Sampler::new(input.surface, input.path, input.metric);
    let mut hull = Vec::new();
    let of = |&face: &u32| {
        let corners = usable(input.surface.face_vertices(face)).len();
        if corners == 0 {
            return Some(Survey::NOTHING);
        }
        sampler.bind(face);
        let expected = expected(&mut sampler, corners, input.shading_rate);
        let reach = sampler.hull(&mut hull)?;
        let bounds = bounds_of(input.path.key_times(), &hull);
        Some(Survey {
            bounds,
            reach,
            expected,
        })
    };
    faces.iter().map(of).collect()
}

/// Bounds of points `[key][n]`.
fn bounds_of(key_times: &[f32], points: &[Vec3]) -> LinearBox {
    let n = points.len() / key_times.len();
    let at = |key: usize| {
        let points = points[key * n..][..n].iter();
        let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        points.fold(none, |(lo, hi), &p| (lo.min(p), hi.max(p)))
    };
    let last = key_times.len() - 1;
    let ((lo0, hi0), (lo1, hi1)) = (at(0), at(last));
    let mut bounds = LinearBox { lo0, hi0, lo1, hi1 };
    for (key, &time) in key_times.iter().enumerate().take(last).skip(1) {
        let (lo, hi) = at(key);
        bounds.raise(time, lo, hi);
    }
    bounds
}

/// What bounds are widened by; see the module's text.
fn padding(input: &DiceInput<'_>, surveys: &[Survey]) -> f32 {
    let reach = surveys.iter().fold(0.0f32, |most, s| most.max(s.reach));
    let stretch = (0..input.path.key_times().len()).map(|k| {
        let m = input.path.matrix(k).matrix3;
        let rows = m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs();
        rows.max_element()
    });
    let stretch = stretch.fold(0.0, f64::max);
    // Mapped points, of the hull and of the surface, are rounded to f32 once.
    let mapped = surveys
        .iter()
        .filter(|s| s.bounds != LinearBox::EMPTY)
        .fold(0.0f32, |most, s| most.max(s.bounds.max_abs()));
    round_up(HULL_ROUNDING * f64::from(reach) * stretch + 4.0 * f64::from(U * mapped))
}

/// About how many micropolygons the bound face has: by the distances of its corners.
fn expected(sampler: &mut Sampler<'_>, corners: usize, rate: f32) -> f64 {
    const QUAD: [Vec2; 4] = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
    let keys = sampler.key_count();
    // `[corner][key]`, and the first corner again.
    let mut points: Vec<Vec3> = Vec::with_capacity((corners + 1) * keys);
    let mut add = |domain, st: &[Vec2]| {
        let positions = sampler.unchecked(domain, st);
        for i in 0..st.len() {
            points.extend((0..keys).map(|k| positions[k * st.len() + i]));
        }
    };
    match corners {
        3 => add(PatchDomain::Collapsed, &QUAD[..3]),
        4 => add(PatchDomain::Whole, &QUAD),
        n => (0..n as u32).for_each(|k| add(PatchDomain::Corner(k), &QUAD[..1])),
    }
    points.extend_from_within(..keys);
    let sides = points.windows(2 * keys).step_by(keys);
    let rates = sides.map(|ends| f64::from((sampler.polyline(ends).0 / rate).max(1.0)));
    match rates.collect::<Vec<f64>>()[..] {
        [a, b, c, d] => a.max(c) * b.max(d),
        ref rates => {
            let most = rates.iter().fold(1.0f64, |most, &x| most.max(x));
            (0.25 * most * most * rates.len() as f64).max(1.0)
        }
    }
}

/// Cuts faces in halves of the same work, across the longest extent of their middles, until each piece has at
/// most `most` micropolygons or one face. `ends` gets the end of each piece.
fn cut(faces: &mut [u32], surveys: &[Survey], most: f64, ends: &mut Vec<u32>) {
    let expected = |face: u32| surveys[face as usize].expected;
    let sum: f64 = faces.iter().map(|&face| expected(face)).sum();
    if faces.len() < 2 || sum <= most {
        faces.sort_unstable();
        if !faces.is_empty() {
            let start = ends.last().copied().unwrap_or(0);
            ends.push(start + faces.len() as u32);
        }
        return;
    }
    let middle = |face: u32| surveys[face as usize].bounds.centre4();
    let none = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let (lo, hi) = faces.iter().fold(none, |(lo, hi), &face| {
        (lo.min(middle(face)), hi.max(middle(face)))
    });
    let extent = hi - lo;
    let axis = extent.max_position();
    faces.sort_unstable_by(|&a, &b| {
        let order = middle(a)[axis].total_cmp(&middle(b)[axis]);
        order.then(a.cmp(&b))
    });
    let mut passed = 0.0;
    let half = faces.iter().position(|&face| {
        passed += expected(face);
        passed >= 0.5 * sum
    });
    let at = half.map_or(1, |i| i + 1).clamp(1, faces.len() - 1);
    let (a, b) = faces.split_at_mut(at);
    cut(a, surveys, most, ends);
    cut(b, surveys, most, ends);
}
