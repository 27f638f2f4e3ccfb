//! Answers of two tracers to the same rays, compared one by one; f64 decides where they differ.
//!
//! **Tolerances**, with `U = 2^-24` and `S = max |origin_i| + radius` of the world.
//! *Across* the ray, to an edge: [`TOLERANCE`] `S` as for the brute-force oracle, 128 U S. We are
//! within 102 of it. Embree interpolates a vertex (5 U S with the time's own rounding), moves it to the
//! ray's origin (1), and finds an edge function as a cross product and a scalar product: about 6 U times the
//! lengths of the vertex, the direction and the edge, which is 6 U S as a distance across where the edge does
//! not point along the ray; we allow for it seen under 1 : 10.
//! *Along* the ray: a triangle's normal is a cross product of its edges, each off by the vertices' 12 U S
//! relative to its length, and itself rounded by 3 U |e| |f|. With `stretch = |e| |f| / |e x f|` the plane's
//! distance is off by about `(12 + 3) U S stretch`, which the cosine between ray and normal divides;
//! we allow `(128 + 16 stretch) U S / cosine`.
//!
//! Where the tracers name other micropolygons at the same distance to within these, it is a *tie*. Else
//! the nearer hit is examined: if it is beyond doubt, the other tracer passed over it; if it is
//! nearer to an edge than the tolerance, either may be right (*edge*). A hit that is not on its
//! micropolygon to within the tolerances is *wrong*.

use glam::{DVec2, DVec3};
use hdtrapeze_core::bvh::U;
use hdtrapeze_core::grid::{PlanarMesh, locate_key};
use hdtrapeze_core::trace::brute::TOLERANCE;
use hdtrapeze_core::trace::{Hit, Ray};

use crate::batch::Answer;

/// Share of rays that a tracer may answer wrongly, beyond doubt, before the bench fails; ours none.
pub const MOST_WRONG: f64 = 1e-4;
/// Share of rays near edges that may differ.
pub const MOST_EDGES: f64 = 1e-3;
/// The same among strands of more than [`THIN`] million micropolygons. At 16 million they are some 25 tolerances wide at their roots
/// and a tenth of that at their tips: a thousandth of the rays is that near to an edge.
pub const MOST_EDGES_OF_THIN: f64 = 2e-3;
/// See [`MOST_EDGES_OF_THIN`].
pub const THIN: f64 = 4.0;

/// How rays were answered.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    pub rays: u64,
    /// Other micropolygons at the same distance: shared edges.
    pub ties: u64,
    /// Different answers, the nearer one too near to an edge to tell.
    pub edges: u64,
    /// Beyond doubt, we were wrong.
    pub ours_wrong: u64,
    /// Beyond doubt, the peer was wrong.
    pub peer_wrong: u64,
    /// The first of our errors, or else of the peer's.
    pub first: Option<String>,
}

impl Tally {
    pub fn add(&mut self, o: Tally) {
        self.rays += o.rays;
        self.ties += o.ties;
        self.edges += o.edges;
        if self.first.is_none() || (self.ours_wrong == 0 && o.ours_wrong > 0) {
            self.first = o.first;
        }
        self.ours_wrong += o.ours_wrong;
        self.peer_wrong += o.peer_wrong;
    }

    /// What is too much, if anything; `most_edges` is [`MOST_EDGES`], or what strands have in its place.
    pub fn failure(&self, most_edges: f64) -> Option<String> {
        let share = |n: u64| n as f64 / self.rays.max(1) as f64;
        (self.ours_wrong > 0
            || share(self.peer_wrong) > MOST_WRONG
            || share(self.edges) > most_edges)
            .then(|| format!("{self:?}"))
    }
}

/// The micropolygons, as f64 sees them.
#[derive(Debug)]
pub struct Judge<'a> {
    mesh: &'a PlanarMesh,
    radius: f32,
    /// Number of each grid's first micropolygon.
    first_cell: Vec<usize>,
}

/// A triangle as a ray's line sees it.
struct Seen {
    t: f64,
    /// Distance across to the nearest edge, positive inside.
    inside: f64,
    /// What `t` may be off by.
    along: f64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Standing {
    Sure,
    Doubtful,
    Wrong,
}

impl<'a> Judge<'a> {
    /// For a world of this mesh in its place, whose radius is given.
    pub fn new(mesh: &'a PlanarMesh, radius: f32) -> Self {
        let cells = |first: &mut usize, n: usize| {
            *first += n;
            Some(*first - n)
        };
        let counts = mesh.grids.iter().map(|g| g.cell_count());
        Self {
            mesh,
            radius,
            first_cell: counts.scan(0, cells).collect(),
        }
    }

    /// Our hit as Embree's are told.
    pub fn answer(&self, hit: &Hit) -> Option<Answer> {
        hit.is_hit().then(|| Answer {
            t: hit.t,
            cell: self.first_cell[hit.grid as usize] + hit.cell as usize,
        })
    }

    fn across(&self, ray: &Ray) -> f64 {
        TOLERANCE * f64::from(ray.origin.abs().max_element() + self.radius)
    }

    /// The triangle of a cell that the ray's line is deepest inside of, or nearest to.
    fn seen(&self, ray: &Ray, cell: usize) -> Option<Seen> {
        let g = self.first_cell.partition_point(|&first| first <= cell) - 1;
        let nu = usize::from(self.mesh.grids[g].nu);
        let cell = cell - self.first_cell[g];
        let first = cell / nu * (nu + 1) + cell % nu;
        let times = &self.mesh.key_times;
        let (key, _) = locate_key(times, ray.time);
        let next = (key + 1).min(times.len() - 1);
        let span = f64::from(times[next]) - f64::from(times[key]);
        let f = if span > 0.0 {
            (f64::from(ray.time) - f64::from(times[key])) / span
        } else {
            0.0
        };
        let origin = ray.origin.as_dvec3();
        let at = |i: usize| {
            let (a, b) = (
                self.mesh.position(g, key, i),
                self.mesh.position(g, next, i),
            );
            a.as_dvec3() * (1.0 - f) + b.as_dvec3() * f - origin
        };
        let p = [first, first + 1, first + nu + 2, first + nu + 1].map(at);
        let halves = [[p[0], p[1], p[2]], [p[0], p[2], p[3]]];
        let seen = halves.into_iter().filter_map(|p| self.triangle(ray, p));
        seen.max_by(|a, b| a.inside.total_cmp(&b.inside))
    }

    fn triangle(&self, ray: &Ray, p: [DVec3; 3]) -> Option<Seen> {
        let dir = ray.dir.as_dvec3();
        let d = dir.normalize();
        let (x, y) = d.any_orthonormal_pair();
        let normal = (p[1] - p[0]).cross(p[2] - p[0]);
        let area = normal.dot(d);
        let flat = p.map(|p| DVec2::new(p.dot(x), p.dot(y)));
        let (mut inside, mut product) = (f64::INFINITY, 0.0f64);
        for i in 0..3 {
            let (a, b) = (flat[i], flat[(i + 1) % 3]);
            let length = (b - a).length();
            if length > 0.0 {
                inside = inside.min(a.perp_dot(b) * area.signum() / length);
            }
            let edge = |i: usize| (p[(i + 1) % 3] - p[i % 3]).length();
            product = product.max(edge(i) * edge(i + 1));
        }
        let t = p[0].dot(normal) / area / dir.length();
        if !(inside.is_finite() && t.is_finite()) {
            return None;
        }
        let (stretch, cosine) = (product / normal.length(), area.abs() / normal.length());
        let reach = f64::from(ray.origin.abs().max_element() + self.radius);
        let along = f64::from(U) * reach * (128.0 + 16.0 * stretch) / cosine / dir.length();
        Some(Seen { t, inside, along })
    }

    /// How a hit stands, and what its `t` may be off by.
    fn standing(&self, ray: &Ray, answer: &Answer) -> (Standing, f64) {
        let across = self.across(ray);
        match self.seen(ray, answer.cell) {
            // Edge-on to the last bit: nothing can be said.
            None => (Standing::Doubtful, f64::INFINITY),
            Some(seen) => {
                let off = (seen.t - f64::from(answer.t)).abs();
                if seen.inside < -across || off > seen.along {
                    (Standing::Wrong, seen.along)
                } else if seen.inside > across {
                    (Standing::Sure, seen.along)
                } else {
                    (Standing::Doubtful, seen.along)
                }
            }
        }
    }

    /// Compares the nearest hits of one ray.
    pub fn nearest(&self, ray: &Ray, ours: &Hit, peer: Option<Answer>, tally: &mut Tally) {
        tally.rays += 1;
        let ours = self.answer(ours);
        match (&ours, &peer) {
            (None, None) => return,
            // The least that `along` can be.
            (Some(a), Some(b))
                if a.cell == b.cell
                    && f64::from((a.t - b.t).abs() * ray.dir.length()) <= self.across(ray) =>
            {
                return;
            }
            _ => {}
        }
        let stands = |a: &Option<Answer>| a.as_ref().map(|a| self.standing(ray, a));
        let (a, b) = (stands(&ours), stands(&peer));
        let told = |who: &str| Some(format!("{who}: {ray:?}, ours {ours:?}, peer {peer:?}"));
        let wrong = |s: &Option<(Standing, f64)>| s.is_some_and(|s| s.0 == Standing::Wrong);
        let t = |a: &Option<Answer>| a.map_or(f64::INFINITY, |a| f64::from(a.t));
        let slack = |s: &Option<(Standing, f64)>| s.map_or(0.0, |s| s.1);
        let verdict = if wrong(&a) {
            Verdict::OursWrong
        } else if wrong(&b) {
            Verdict::PeerWrong
        } else if a.is_some() && b.is_some() && (t(&ours) - t(&peer)).abs() <= slack(&a) + slack(&b)
        {
            Verdict::Tie
        } else {
            let (nearer, passed_over_by) = if t(&ours) < t(&peer) {
                (&a, Verdict::PeerWrong)
            } else {
                (&b, Verdict::OursWrong)
            };
            match nearer {
                Some((Standing::Sure, _)) => passed_over_by,
                _ => Verdict::Edge,
            }
        };
        match verdict {
            Verdict::Tie => tally.ties += 1,
            Verdict::Edge => tally.edges += 1,
            Verdict::OursWrong => {
                if tally.ours_wrong == 0 {
                    tally.first = told("ours");
                }
                tally.ours_wrong += 1;
            }
            Verdict::PeerWrong => {
                tally.first = tally.first.take().or_else(|| told("peer"));
                tally.peer_wrong += 1;
            }
        }
    }

    /// Compares whether one ray is blocked; `ours` is our nearest hit, which says by what. The peer does
    /// not say: a ray that only it calls blocked counts among the edges.
    pub fn blocked(&self, ray: &Ray, ours: &Hit, peer: bool, tally: &mut Tally) {
        tally.rays += 1;
        match (self.answer(ours), peer) {
            (Some(answer), false) => match self.standing(ray, &answer).0 {
                Standing::Sure => {
                    let told = || format!("peer: {ray:?} is not blocked by {answer:?}");
                    tally.first = tally.first.take().or_else(|| Some(told()));
                    tally.peer_wrong += 1;
                }
                Standing::Doubtful => tally.edges += 1,
                Standing::Wrong => {
                    tally.first = Some(format!("ours: {ray:?}, {answer:?}"));
                    tally.ours_wrong += 1;
                }
            },
            (None, true) => tally.edges += 1,
            _ => {}
        }
    }
}

enum Verdict {
    Tie,
    Edge,
    OursWrong,
    PeerWrong,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace_scenes::{keys, object, ray, sheet, world_of};
    use glam::Vec3;
    use hdtrapeze_core::trace::TraceCounts;

    #[test]
    fn too_many_wrong_answers_and_edges_fail() {
        let of = |ours_wrong, peer_wrong, edges| Tally {
            rays: 100_000,
            ours_wrong,
            peer_wrong,
            edges,
            ..Tally::default()
        };
        let fails = |tally: Tally, most| tally.failure(most).is_some();
        assert!(!fails(of(0, 10, 100), MOST_EDGES));
        for tally in [of(1, 0, 0), of(0, 11, 0), of(0, 0, 101)] {
            assert!(fails(tally, MOST_EDGES));
        }
        assert!(!fails(of(0, 0, 200), MOST_EDGES_OF_THIN));
        for tally in [of(1, 0, 0), of(0, 11, 0), of(0, 0, 201)] {
            assert!(fails(tally, MOST_EDGES_OF_THIN));
        }
    }

    #[test]
    fn answers_that_are_wrong_are_told_from_edges_and_ties() {
        let mesh = sheet(2, 8, &keys(2));
        let (object, world) = (object(mesh.clone()), world_of(mesh));
        let judge = Judge::new(object.mesh(), world.radius());
        // Straight down, inside a cell away from its edges and its diagonal.
        let step = 2.0 / 16.0;
        let origin = Vec3::new(step * 3.7, step * 2.2, 2.0);
        let r = ray(origin, Vec3::NEG_Z, 0.3);
        let hit = world.trace(&r, &mut TraceCounts::default());
        let right = judge.answer(&hit).expect("a hit");
        let judged = |ours: &Hit, peer: Option<Answer>| {
            let mut tally = Tally::default();
            judge.nearest(&r, ours, peer, &mut tally);
            (tally.ties, tally.edges, tally.ours_wrong, tally.peer_wrong)
        };
        assert_eq!(judged(&hit, Some(right)), (0, 0, 0, 0));
        assert_eq!(judged(&hit, None), (0, 0, 0, 1));
        assert_eq!(judged(&Hit::MISS, Some(right)), (0, 0, 1, 0));
        let (near, t) = (right.t - 1e-3, right.t);
        let elsewhere = |t: f32| Answer { t, ..right };
        assert_eq!(judged(&hit, Some(elsewhere(near))), (0, 0, 0, 1));
        assert_eq!(judged(&Hit { t: near, ..hit }, Some(right)), (0, 0, 1, 0));
        let other = Answer {
            t,
            cell: right.cell + 1,
        };
        assert_eq!(judged(&hit, Some(other)), (0, 0, 0, 1));
        // On the border between two cells either is a tie, and missing both is an edge.
        let r = ray(Vec3::new(step * 3.0, step * 2.2, 2.0), Vec3::NEG_Z, 0.3);
        let hit = world.trace(&r, &mut TraceCounts::default());
        let left = judge.answer(&hit).expect("a hit");
        let beside = Answer {
            cell: left.cell + 1,
            ..left
        };
        let mut tally = Tally::default();
        judge.nearest(&r, &hit, Some(beside), &mut tally);
        judge.nearest(&r, &hit, None, &mut tally);
        judge.blocked(&r, &hit, false, &mut tally);
        assert_eq!((tally.ties, tally.edges), (1, 2), "{tally:?}");
        assert_eq!((tally.ours_wrong, tally.peer_wrong), (0, 0), "{tally:?}");
    }
}
