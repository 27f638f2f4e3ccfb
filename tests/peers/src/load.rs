//! Rays to trace, and how long ours and Embree take to trace them.

use std::borrow::Cow;
use std::sync::Arc;

use glam::DVec3;
use hdtrapeze_core::bvh::ObjectGeometry;
use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, TraceCounts, World};
use rayon::prelude::*;

use crate::batch::{Batch, Call, Width};
use crate::clock::Clock;
use crate::compare::{Judge, Tally};
use crate::embree::{CHUNK, Scene};
use crate::surface::{self, Square};
use crate::trace_scenes::{instance, object};

/// What is compared with each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Nearest hits of a camera's rays, in the order that suits the tracer.
    Camera,
    /// Nearest hits of rays that leave surfaces.
    Bounce,
    /// Any hits of the same.
    Shadow,
}

impl Group {
    pub const ALL: [Group; 3] = [Group::Camera, Group::Bounce, Group::Shadow];

    pub fn name(self) -> &'static str {
        match self {
            Group::Camera => "camera",
            Group::Bounce => "bounce, nearest",
            Group::Shadow => "bounce, any",
        }
    }
}

/// Rays, with the answers that are expected.
#[derive(Debug)]
pub struct Load {
    /// The order of camera rays; empty for others.
    pub name: &'static str,
    pub group: Group,
    pub rays: Vec<Ray>,
    /// Our nearest hits.
    pub hits: Vec<Hit>,
    /// Squares, in each of which ours finds an order of its own; empty in other orders.
    pub squares: Vec<Square>,
    /// That order, for Embree; empty where these rays are in order.
    pub given: Vec<u32>,
}

/// One way to trace ours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    Packets,
    Single,
    /// Packets, any hit.
    AnyPackets,
    /// Single, any hit.
    Any,
}

/// Ours.
pub fn ways(group: Group) -> &'static [Way] {
    match group {
        Group::Camera => &[Way::Packets],
        Group::Bounce => &[Way::Packets, Way::Single],
        Group::Shadow => &[Way::AnyPackets, Way::Any],
    }
}

/// Embree's.
pub fn calls(group: Group, widths: &[Width]) -> Vec<Call> {
    let any = group == Group::Shadow;
    let mut calls = Vec::new();
    for &width in widths {
        // Single rays do not look at the flag; streams of packets have no other use than it.
        let coherent: &[bool] = match (group, width) {
            (_, Width::One) => &[false],
            (Group::Camera, _) => &[true, false],
            (_, Width::Stream16) => continue,
            _ => &[false],
        };
        calls.extend(coherent.iter().map(|&coherent| Call {
            width,
            coherent,
            any,
        }));
    }
    calls
}

impl Load {
    /// One of `every` blocks of rays.
    pub fn part(&self, every: usize) -> Load {
        fn blocks<T: Copy>(of: &[T], every: usize) -> Vec<T> {
            of.chunks(1024).step_by(every).flatten().copied().collect()
        }
        let (mut rays, mut hits, mut squares) = (Vec::new(), Vec::new(), Vec::new());
        let mut given = Vec::new();
        if self.squares.is_empty() {
            rays = blocks(&self.rays, every);
            hits = blocks(&self.hits, every);
        }
        // As many of these as there would be rays; one at least.
        for square in self.squares.iter().step_by(every) {
            let own = square.rays.clone();
            let first = rays.len();
            rays.extend_from_slice(&self.rays[own.clone()]);
            hits.extend_from_slice(&self.hits[own.clone()]);
            given.extend(
                self.given[own.clone()]
                    .iter()
                    .map(|&i| i - own.start as u32 + first as u32),
            );
            squares.push(Square {
                rays: first..rays.len(),
                blocks: square.blocks.clone(),
            });
        }
        Load {
            rays,
            hits,
            squares,
            given,
            ..*self
        }
    }

    /// How these are traced, in words.
    pub fn how(&self, call: &str) -> String {
        match self.name {
            "" => call.into(),
            // No order was found anywhere.
            "surface" if self.given.is_sorted() => format!("{call} by square"),
            order => format!("{call} by {order}"),
        }
    }

    /// Number of the ray that Embree is given as number `i`.
    fn given(&self, i: usize) -> usize {
        self.given.get(i).map_or(i, |&i| i as usize)
    }

    /// The rays as Embree is given them.
    fn rays_given(&self) -> Cow<'_, [Ray]> {
        match self.given.is_empty() {
            true => (&self.rays).into(),
            false => self.given.iter().map(|&i| self.rays[i as usize]).collect(),
        }
    }

    /// Million rays a second, from seconds.
    fn rate(&self, seconds: f64) -> f64 {
        self.rays.len() as f64 / seconds * 1e-6
    }
}

/// An object, and a world of it alone.
pub fn built(mesh: DicedMesh) -> (Arc<ObjectGeometry>, World) {
    alone(object(mesh))
}

/// The same with all bounds along the axes of space.
pub fn built_upright(mesh: DicedMesh) -> (Arc<ObjectGeometry>, World) {
    alone(Arc::new(ObjectGeometry::upright(mesh)))
}

fn alone(object: Arc<ObjectGeometry>) -> (Arc<ObjectGeometry>, World) {
    let place = InstanceTransform::Translation(DVec3::ZERO);
    let world = World::build(vec![instance(&object, place)], DVec3::ZERO);
    (object, world)
}

/// Our hits, on all threads.
pub fn trace(world: &World, rays: &[Ray], way: Way, hits: &mut [Hit]) -> TraceCounts {
    let chunks = rays.par_chunks(CHUNK).zip(hits.par_chunks_mut(CHUNK));
    let each = chunks.map(|(rays, hits)| {
        let mut counts = TraceCounts::default();
        match way {
            Way::Packets => world.trace_many(rays, hits, &mut counts),
            Way::Single => {
                for (ray, hit) in rays.iter().zip(hits) {
                    *hit = world.trace(ray, &mut counts);
                }
            }
            Way::AnyPackets => {
                let mut found = vec![false; rays.len()];
                world.occluded_many(rays, &mut found, &mut counts);
                for (found, hit) in found.into_iter().zip(hits) {
                    hit.instance = u32::from(!found) * Hit::NONE;
                }
            }
            Way::Any => {
                for (ray, hit) in rays.iter().zip(hits) {
                    // Only whether there is one is asked for.
                    hit.instance = u32::from(!world.occluded(ray, &mut counts)) * Hit::NONE;
                }
            }
        }
        counts
    });
    each.reduce(TraceCounts::default, |a, b| a + b)
}

/// Times ours as Embree is timed: on rays that lie in the order that was found for them. `None` where none was.
pub fn time_given(world: &World, load: &Load, clock: Clock) -> Result<Option<f64>, String> {
    if load.given.is_sorted() {
        return Ok(None);
    }
    let rays = load.rays_given();
    let fresh = || vec![Hit::MISS; rays.len()];
    let (hits, seconds) = clock.mean(fresh, |hits| {
        trace(world, &rays, Way::Packets, hits);
    });
    let mut found = hits.iter().enumerate();
    if found.all(|(i, hit)| *hit == load.hits[load.given(i)]) {
        Ok(Some(load.rate(seconds)))
    } else {
        Err(format!("ours, given {}: answers otherwise", load.name))
    }
}

/// Times ours on a load, and checks that the answers are those that are compared with Embree's.
pub fn time_ours(world: &World, load: &Load, way: Way, clock: Clock) -> Result<f64, String> {
    let fresh = || vec![Hit::MISS; load.rays.len()];
    let (hits, seconds) = clock.mean(fresh, |hits| match &load.squares[..] {
        [] => drop(trace(world, &load.rays, way, hits)),
        squares => surface::trace(world, &load.rays, squares, hits),
    });
    let same = hits.iter().zip(&load.hits).all(|(a, b)| match way {
        Way::Any | Way::AnyPackets => a.is_hit() == b.is_hit(),
        _ => a == b,
    });
    if same {
        Ok(load.rate(seconds))
    } else {
        Err(format!("ours, {way:?} {}: answers otherwise", load.name))
    }
}

/// Times Embree on a load; `check` compares the answers.
pub fn time_peer(
    scene: &Scene<'_>,
    load: &Load,
    call: Call,
    clock: Clock,
    check: Option<&Judge<'_>>,
) -> (f64, Tally) {
    let rays = load.rays_given();
    let fresh = || Batch::new(call.width, &rays);
    let (batch, seconds) = clock.mean(fresh, |batch| scene.trace(batch, call));
    let mut tally = Tally::default();
    if let Some(judge) = check {
        let parts: Vec<Tally> = (0..load.rays.len())
            .into_par_iter()
            .fold(Tally::default, |mut tally, i| {
                let own = load.given(i);
                let (ray, hit) = (&load.rays[own], &load.hits[own]);
                if call.any {
                    judge.blocked(ray, hit, batch.occluded(i), &mut tally);
                } else {
                    judge.nearest(ray, hit, scene.answer(&batch, i), &mut tally);
                }
                tally
            })
            .collect();
        for part in parts {
            tally.add(part);
        }
    }
    (load.rate(seconds), tally)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace_scenes::ray;
    use glam::Vec3;

    #[test]
    fn embree_is_given_each_ray_of_a_part_in_the_order_of_its_square() {
        let square = |rays: std::ops::Range<usize>| Square {
            blocks: vec![0..8, 8..rays.len()],
            rays,
        };
        // Squares of 32, 16, 48 and 16 rays, each in reverse.
        let squares = [0..32, 32..48, 48..96, 96..112].map(square);
        let given = squares.iter().flat_map(|s| s.rays.clone().rev());
        let load = Load {
            name: "surface",
            group: Group::Camera,
            rays: (0..112u8)
                .map(|i| ray(Vec3::X * f32::from(i), Vec3::Z, 0.0))
                .collect(),
            hits: vec![Hit::MISS; 112],
            given: given.map(|i| i as u32).collect(),
            squares: squares.into(),
        };
        let numbers = |load: &Load| -> Vec<usize> {
            let rays = load.rays_given();
            for (i, ray) in rays.iter().enumerate() {
                assert_eq!(*ray, load.rays[load.given(i)]);
            }
            rays.iter().map(|ray| ray.origin.x as usize).collect()
        };
        let whole: Vec<usize> = [0..32, 32..48, 48..96, 96..112]
            .into_iter()
            .flat_map(Iterator::rev)
            .collect();
        assert_eq!(numbers(&load), whole);
        assert_eq!(load.how("8"), "8 by surface");

        let mut part = load.part(2);
        let first_and_third: Vec<usize> = (0..32).rev().chain((48..96).rev()).collect();
        assert_eq!(numbers(&part), first_and_third);
        assert_eq!(part.hits.len(), 80);
        let ranges: Vec<_> = part.squares.iter().map(|s| s.rays.clone()).collect();
        assert_eq!(ranges, [0..32, 32..80]);
        part.given = (0..80).collect();
        assert_eq!(part.how("8"), "8 by square");
    }
}
