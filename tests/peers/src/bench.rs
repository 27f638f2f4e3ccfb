//! One scene: builds, rays by each tracer, comparison, times.
//!
//! First every variant of Embree is built once and every way to call it tried on a part of the rays; then
//! the best ones, Embree's grids, and ours are timed in turns. Nothing is timed for the report before all
//! its answers were compared.

use std::iter::once;

use hdtrapeze_core::grid::DicedMesh;
use hdtrapeze_core::trace::by_direction::{BATCH, by_direction};
use hdtrapeze_core::trace::{Hit, Ray, TraceCounts, World, brute};
use hdtrapeze_simd::Level;

use crate::batch::Call;
use crate::clock::{Clock, forget_peak, free_memory, peak_memory};
use crate::compare::{Judge, MOST_EDGES, MOST_EDGES_OF_THIN, THIN, Tally};
use crate::embree::{CHUNK, Embree, Refusal, Scene, Variant};
use crate::ffi::RayHit;
use crate::load::{
    Group, Load, Way, built, built_upright, calls, time_given, time_ours, time_peer, trace, ways,
};
use crate::rays::{by_block, by_pixel, by_square, secondary};
use crate::scenes::{Family, Indices, Shape, Vertices, frozen};
use crate::surface::{self, Square};
use crate::table::{best, number};
use crate::trace_scenes::Rng;

/// Orders of camera rays.
pub const ORDERS: [&str; 4] = ["tile", "block", "pixel", "surface"];

/// An order of rays that leave hits, for Embree.
const BY_DIRECTION: &str = "direction";

/// What to run.
#[derive(Clone, Debug)]
pub struct Options {
    pub millions: f64,
    pub image: [usize; 2],
    /// Pixels across the whole picture, of which the image is the middle.
    pub across: usize,
    pub samples: usize,
    /// Rays that leave hits, about.
    pub secondary: usize,
    pub rounds: usize,
    pub clock: Clock,
    pub orders: Vec<&'static str>,
    pub variants: Vec<Variant>,
    /// Rays that brute force checks on a small scene.
    pub checks: usize,
    /// One of so many blocks of rays is tried first.
    pub screen: usize,
    /// Without Embree, also where it is installed.
    pub alone: bool,
    /// Ours also without oriented frames.
    pub frames: bool,
}

/// Rays that leave surfaces that each way of tracing is tried on, about.
const TRIAL_LEAVING: usize = 1 << 17;

impl Options {
    /// About how many bytes camera rays take at the most: each order has them with their hits, and a part of both for
    /// trials; besides there is one order more while they are made, or what one tracer is given, which is more for Embree.
    pub fn ray_memory(&self) -> f64 {
        let kept = (size_of::<Ray>() + size_of::<Hit>()) as f64;
        let given = if self.alone {
            kept
        } else {
            kept.max(size_of::<RayHit<1>>() as f64)
        };
        let orders = self.orders.len() as f64 * (1.0 + 1.0 / self.screen as f64);
        self.rays() * (orders * kept + given)
    }

    fn rays(&self) -> f64 {
        (self.image[0] * self.image[1] * self.samples) as f64
    }

    /// Whether so many bytes are enough for all rays; 0 where that is not known.
    ///
    /// # Errors
    /// They are not.
    pub fn fit(&self, free: u64) -> Result<(), String> {
        let gib = |bytes: f64| number(bytes / f64::from(1 << 30));
        let needed = self.ray_memory();
        if free == 0 || needed <= free as f64 {
            return Ok(());
        }
        Err(format!(
            "{} million rays take about {} GiB, and {} GiB are free: ask for fewer --samples, a smaller --image or one --order",
            number(self.rays() * 1e-6),
            gib(needed),
            gib(free as f64)
        ))
    }
}

/// Rates of one tracer on one group: million rays a second, in each round.
#[derive(Clone, Debug)]
pub struct Traced {
    pub how: String,
    pub rates: Vec<f64>,
}

impl Traced {
    pub fn best(&self) -> f64 {
        best(&self.rates).max(0.0)
    }
}

/// One tracer on one scene.
#[derive(Clone, Debug, Default)]
pub struct Tracer {
    pub name: String,
    /// Million micropolygons a second.
    pub builds: Vec<f64>,
    /// Bytes of the hierarchy a micropolygon.
    pub bytes: f64,
    /// The most while building, where known.
    pub peak_bytes: f64,
    /// Bytes of index buffers a micropolygon.
    pub index_bytes: f64,
    /// By [`Group`], in the best way.
    pub traced: [Option<Traced>; 3],
    /// Ours on camera rays, by [`ORDERS`].
    pub orders: [Option<Traced>; ORDERS.len()],
    /// Ours on camera rays that lie in the order that ours found.
    pub given: Option<Traced>,
    /// Why there is nothing.
    pub refused: Option<String>,
}

impl Tracer {
    /// The best rate on a group; 0 without.
    pub fn rate(&self, group: Group) -> f64 {
        let traced = self.traced[group as usize].as_ref();
        traced.map_or(0.0, Traced::best)
    }

    /// The best rate on camera rays in one of [`ORDERS`]; 0 without.
    pub fn rate_by(&self, order: &str) -> f64 {
        let traced = ORDERS.iter().zip(&self.orders).find(|(o, _)| **o == order);
        traced
            .and_then(|(_, t)| t.as_ref())
            .map_or(0.0, Traced::best)
    }
}

/// All that was found out about a scene.
#[derive(Clone, Debug)]
pub struct Report {
    pub name: String,
    pub family: Family,
    pub moving: bool,
    pub cells: f64,
    pub hit_share: f64,
    pub nodes: f64,
    pub tested: f64,
    pub ours: Tracer,
    /// Million camera rays a second of ours, a part of them, each traced by itself.
    pub single: f64,
    /// Nodes and blocks of ours that have a frame.
    pub oriented: [u64; 2],
    /// Ours without frames, where that was asked for.
    pub upright: Option<Tracer>,
    /// Those that were timed, in the order of the options.
    pub peers: Vec<Tracer>,
    /// All that were tried, once, on a part of the rays.
    pub tried: Vec<Tracer>,
    pub tallies: Vec<(Group, Tally)>,
    /// The most memory of the process while building ours, and in all.
    pub peaks: [u64; 2],
}

/// Checks a sample of our hits against brute force, on the same scene with fewer micropolygons.
fn check_ours(family: Family, moving: bool, checks: usize) -> Result<(), String> {
    let mesh = family.moving(0.01);
    let mesh = if moving { mesh } else { frozen(&mesh, 0.5) };
    let (_, world) = built(mesh);
    let rays = family.lens().rays([64, 64], 64, 4);
    let mut rng = Rng(5);
    for _ in 0..checks {
        let ray = rays[rng.below(rays.len())];
        let hit = world.trace(&ray, &mut TraceCounts::default());
        brute::verify(&world, &ray, None, &hit)
            .map_err(|e| format!("{}: brute force disagrees: {e}", family.name()))?;
    }
    Ok(())
}

/// Rates of a tracer of ours or of Embree's in one way; the best way on each group is kept.
#[derive(Clone, Copy, Debug)]
struct Tried<C> {
    load: usize,
    call: C,
    rate: f64,
}

fn best_of<C: Copy>(tried: &[Tried<C>], loads: &[Load], group: Group) -> Option<Tried<C>> {
    let of_group = tried.iter().filter(|t| loads[t.load].group == group);
    of_group.max_by(|a, b| a.rate.total_cmp(&b.rate)).copied()
}

/// Memory that Embree may take: what is free but a GiB.
fn limit() -> u64 {
    free_memory().saturating_sub(1 << 30)
}

fn refusal(r: Refusal) -> String {
    match r {
        Refusal::Memory => "no memory".into(),
        Refusal::Error(code) => format!("error {code}"),
    }
}

fn describe(variant: Variant, scene: &Scene<'_>, indices: &Indices, cells: f64) -> Tracer {
    Tracer {
        name: variant.name(),
        bytes: scene.bytes as f64 / cells,
        peak_bytes: scene.peak_bytes as f64 / cells,
        index_bytes: indices.bytes() as f64 / cells,
        ..Tracer::default()
    }
}

/// Numbers of rays in an order by direction, where that is another: as many at a time as are traced together.
fn by_directions(rays: &[Ray]) -> Vec<usize> {
    let mut out = Vec::with_capacity(rays.len());
    for chunk in rays.chunks(CHUNK.min(BATCH)) {
        let first = out.len();
        match by_direction(Level::best(), chunk) {
            Some(order) => out.extend(order.iter().map(|&i| first + usize::from(i))),
            None => out.extend(first..first + chunk.len()),
        }
    }
    out
}

/// Runs one scene.
///
/// # Errors
/// Answers are wrong, or differ more often than stated in [`crate::compare`].
pub fn run(
    family: Family,
    moving: bool,
    mesh: &DicedMesh,
    options: &Options,
    embree: Option<&Embree>,
) -> Result<Report, String> {
    let clock = options.clock;
    let name = format!(
        "{} {}",
        family.name(),
        if moving { "moving" } else { "static" }
    );
    check_ours(family, moving, options.checks)?;
    let cells = mesh.cell_count() as f64;
    let copy = mesh.clone();
    forget_peak();
    // In memory that is new to the process: Embree's first build is none of its rounds either.
    let (object, mut world) = built(copy);
    let mut peaks = [peak_memory(), 0];
    let mut ours = Tracer {
        name: "ours".into(),
        bytes: object.stats().bvh_bytes as f64 / cells,
        ..Tracer::default()
    };

    let stats = object.stats();
    let oriented = [stats.oriented_nodes, stats.oriented_blocks];
    let mut upright = options.frames.then(|| {
        let copy = mesh.clone();
        let (object, world) = built_upright(copy);
        let tracer = Tracer {
            name: "without frames".into(),
            bytes: object.stats().bvh_bytes as f64 / cells,
            ..Tracer::default()
        };
        (world, tracer)
    });

    let (image, samples) = (options.image, options.samples);
    let rays = family.lens().rays(image, options.across, samples);
    let mut hits = vec![Hit::MISS; rays.len()];
    let counts = trace(&world, &rays, Way::Packets, &mut hits);
    let count = rays.len() as f64;
    let hit_share = hits.iter().filter(|h| h.is_hit()).count() as f64 / count;
    let leaving = {
        let (rays, squares) = by_square(&rays, image, samples);
        let (hits, _) = by_square(&hits, image, samples);
        secondary(object.mesh(), (&rays, &hits), &squares, options.secondary)
    };
    let mut leaving_hits = vec![Hit::MISS; leaving.len()];
    trace(&world, &leaving, Way::Packets, &mut leaving_hits);
    let mut loads = Vec::new();
    let mut load = |name, group, rays: Vec<Ray>, hits: Vec<Hit>, squares: Vec<Square>| {
        if !rays.is_empty() {
            let given = surface::order(&world, &rays, &squares);
            loads.push(Load {
                name,
                group,
                rays,
                hits,
                squares,
                given,
            });
        }
    };
    for &order in &options.orders {
        let mut squares = Vec::new();
        let (rays, hits) = match order {
            "tile" => (rays.clone(), hits.clone()),
            "block" => (
                by_block(&rays, image, samples),
                by_block(&hits, image, samples),
            ),
            "pixel" => (by_pixel(&rays, samples), by_pixel(&hits, samples)),
            _ => {
                let (rays, of_rays) = by_square(&rays, image, samples);
                squares = of_rays;
                (rays, by_square(&hits, image, samples).0)
            }
        };
        load(order, Group::Camera, rays, hits, squares);
    }
    drop((rays, hits));
    let sorted = by_directions(&leaving);
    let in_order = |hits: &[Hit]| sorted.iter().map(|&i| hits[i]).collect();
    let sorted_rays: Vec<Ray> = sorted.iter().map(|&i| leaving[i]).collect();
    for group in [Group::Bounce, Group::Shadow] {
        let (rays, hits) = (leaving.clone(), leaving_hits.clone());
        load("", group, rays, hits, Vec::new());
        if !sorted.is_sorted() {
            let hits = in_order(&leaving_hits);
            load(BY_DIRECTION, group, sorted_rays.clone(), hits, Vec::new());
        }
    }
    let parts: Vec<Load> = loads
        .iter()
        .map(|load| match load.group {
            Group::Camera => load.part(options.screen),
            // There are fewer, and so few of them that caches hold what they meet would tell nothing of the rest.
            _ => load.part((load.rays.len() / TRIAL_LEAVING).clamp(1, options.screen)),
        })
        .collect();

    // Ours, each way on a part, the best for each load. Processor time, so that the choice does not depend on what
    // else runs.
    let trial = Clock::Cpu;
    let best_ways = |world: &World| -> Result<Vec<Tried<Way>>, String> {
        let mut best = Vec::new();
        // That order ours finds by itself.
        let own = parts.iter().enumerate();
        for (i, load) in own.filter(|(_, load)| load.name != BY_DIRECTION) {
            let mut tried = Vec::new();
            for &way in ways(load.group) {
                let mut rate = time_ours(world, load, way, trial)?;
                rate = rate.max(time_ours(world, load, way, trial)?);
                tried.push(Tried {
                    load: i,
                    call: way,
                    rate,
                });
            }
            best.extend(best_of(&tried, &loads, load.group));
        }
        Ok(best)
    };
    let ways_ours = best_ways(&world)?;
    let ways_upright = match &upright {
        Some((world, _)) => best_ways(world)?,
        None => Vec::new(),
    };

    // What sharing between rays does not change.
    let mut single = 0.0f64;
    if let Some(part) = parts.iter().find(|part| part.group == Group::Camera) {
        for _ in 0..options.rounds {
            single = single.max(time_ours(&world, part, Way::Single, clock)?);
        }
    }

    // Embree, each variant and call on a part.
    let judge = Judge::new(object.mesh(), world.radius());
    let most_edges = match family {
        Family::Fur | Family::Combed if options.millions > THIN => MOST_EDGES_OF_THIN,
        _ => MOST_EDGES,
    };
    let mut tallies: Vec<(Group, Tally)> = Group::ALL.map(|g| (g, Tally::default())).into();
    let mut settle = |group: Group, tally: Tally, what: &str| {
        let failure = tally.failure(most_edges);
        tallies[group as usize].1.add(tally);
        failure.map_or(Ok(()), |f| Err(format!("{what}: {f}")))
    };
    let vertices = embree.map(|_| Vertices::new(object.mesh()));
    let mut tried: Vec<Tracer> = Vec::new();
    let mut tried_calls: Vec<(Variant, Vec<Tried<Call>>)> = Vec::new();
    if let (Some(embree), Some(vertices)) = (embree, &vertices) {
        let widths = embree.widths();
        for &variant in &options.variants {
            let indices = Indices::new(variant.shape, vertices);
            let (scene, seconds) =
                clock.time(|| embree.scene(variant, vertices, &indices, limit()));
            let scene = match scene {
                Ok(scene) => scene,
                Err(r) => {
                    let refused = Some(refusal(r));
                    let name = variant.name();
                    tried.push(Tracer {
                        name,
                        refused,
                        ..Tracer::default()
                    });
                    continue;
                }
            };
            let mut tracer = describe(variant, &scene, &indices, cells);
            tracer.builds.push(cells / seconds * 1e-6);
            let mut of_variant = Vec::new();
            for (i, load) in parts.iter().enumerate() {
                for call in calls(load.group, &widths) {
                    let (first, tally) = time_peer(&scene, load, call, trial, Some(&judge));
                    settle(
                        load.group,
                        tally,
                        &format!("{name}, {} {call:?}", variant.name()),
                    )?;
                    // Once more where it may be the best.
                    let most = best_of(&of_variant, &loads, load.group).map_or(0.0, |t| t.rate);
                    let mut rate = first;
                    if first > 0.8 * most {
                        rate = rate.max(time_peer(&scene, load, call, trial, None).0);
                    }
                    of_variant.push(Tried {
                        load: i,
                        call,
                        rate,
                    });
                }
            }
            for group in Group::ALL {
                tracer.traced[group as usize] =
                    best_of(&of_variant, &loads, group).map(|t| Traced {
                        how: loads[t.load].how(&t.call.name()),
                        rates: vec![t.rate],
                    });
            }
            tried.push(tracer);
            tried_calls.push((variant, of_variant));
        }
    }
    drop(parts);

    // The best on each group, and grids.
    let mut kept: Vec<usize> = Vec::new();
    for group in Group::ALL {
        let rate = |i: &usize| best_of(&tried_calls[*i].1, &loads, group).map_or(0.0, |t| t.rate);
        kept.extend((0..tried_calls.len()).max_by(|a, b| rate(a).total_cmp(&rate(b))));
    }
    kept.extend(tried_calls.iter().position(|(v, _)| v.shape == Shape::Grid));
    kept.sort_unstable();
    kept.dedup();

    let indices: Vec<Indices> = match &vertices {
        Some(vertices) => {
            let of = |&i: &usize| Indices::new(tried_calls[i].0.shape, vertices);
            kept.iter().map(of).collect()
        }
        None => Vec::new(),
    };
    let mut peers: Vec<Tracer> = Vec::new();
    let mut scenes: Vec<Option<Scene<'_>>> = kept.iter().map(|_| None).collect();
    for round in 0..options.rounds {
        let copy = mesh.clone();
        let (_, seconds) = clock.time(|| built(copy));
        ours.builds.push(cells / seconds * 1e-6);
        if let Some((_, upright)) = &mut upright {
            let copy = mesh.clone();
            let (_, seconds) = clock.time(|| built_upright(copy));
            upright.builds.push(cells / seconds * 1e-6);
        }
        let (Some(embree), Some(vertices)) = (embree, &vertices) else {
            continue;
        };
        for (k, &i) in kept.iter().enumerate() {
            let variant = tried_calls[i].0;
            scenes[k] = None;
            let (scene, seconds) =
                clock.time(|| embree.scene(variant, vertices, &indices[k], limit()));
            let scene = scene.map_err(|r| format!("{name}, {}: {}", variant.name(), refusal(r)))?;
            if round == 0 {
                peers.push(describe(variant, &scene, &indices[k], cells));
            }
            peers[k].builds.push(cells / seconds * 1e-6);
            scenes[k] = Some(scene);
        }
    }

    // Rays, in turns.
    for round in 0..options.rounds {
        // Where in memory a tree lies tells as much as a few hundredths: with and without frames, each round has its own.
        if let Some((of_upright, _)) = &mut upright {
            let ours_first = round % 2 == 0;
            if ours_first {
                world = built(mesh.clone()).1;
            }
            *of_upright = built_upright(mesh.clone()).1;
            if !ours_first {
                world = built(mesh.clone()).1;
            }
        }
        for group in Group::ALL {
            // Ours in turns, so that whatever ran before does not always run before the same.
            let mut own = vec![(&world, &mut ours, &ways_ours)];
            if let Some((world, upright)) = &mut upright {
                own.push((world, upright, &ways_upright));
            }
            if round % 2 == 1 {
                own.reverse();
            }
            for (world, tracer, ways) in own {
                // Camera rays in every order.
                for t in ways.iter().filter(|t| loads[t.load].group == group) {
                    let load = &loads[t.load];
                    let how = load.how(&format!("{:?}", t.call).to_lowercase());
                    let rate = time_ours(world, load, t.call, clock)?;
                    let order = ORDERS.iter().position(|&order| order == load.name);
                    let traced = match order {
                        Some(order) => &mut tracer.orders[order],
                        None => &mut tracer.traced[group as usize],
                    };
                    note(traced, how, rate);
                    if let Some(rate) = time_given(world, load, clock)? {
                        note(&mut tracer.given, String::new(), rate);
                    }
                }
            }
            for (k, &i) in kept.iter().enumerate() {
                let (variant, calls) = &tried_calls[i];
                let (Some(scene), Some(t)) = (&scenes[k], best_of(calls, &loads, group)) else {
                    continue;
                };
                let load = &loads[t.load];
                let how = load.how(&t.call.name());
                let check = (round == 0).then_some(&judge);
                let (rate, tally) = time_peer(scene, load, t.call, clock, check);
                if round == 0 {
                    settle(group, tally, &format!("{name}, {} {how}", variant.name()))?;
                }
                note(&mut peers[k].traced[group as usize], how, rate);
            }
        }
    }
    for tracer in once(&mut ours).chain(upright.iter_mut().map(|(_, tracer)| tracer)) {
        let orders = tracer.orders.iter().flatten();
        let best = orders.max_by(|a, b| a.best().total_cmp(&b.best()));
        tracer.traced[Group::Camera as usize] = best.cloned();
    }
    peaks[1] = peak_memory();
    Ok(Report {
        name,
        family,
        moving,
        cells,
        hit_share,
        nodes: counts.node_tests as f64 / count,
        tested: counts.cell_tests as f64 / count,
        ours,
        single,
        oriented,
        upright: upright.map(|(_, tracer)| tracer),
        peers,
        tried,
        tallies,
        peaks,
    })
}

fn note(traced: &mut Option<Traced>, how: String, rate: f64) {
    let none = || Traced {
        how,
        rates: Vec::new(),
    };
    traced.get_or_insert_with(none).rates.push(rate);
}
