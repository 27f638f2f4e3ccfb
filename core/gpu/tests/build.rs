//! Trees that the device makes: what they contain, what they hold, and what is hit through them, on any device there is.

mod support;
#[path = "../../tests/trace_scenes/mod.rs"]
mod trace_scenes;

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::{Arc, OnceLock};

use glam::{DVec3, Vec3};
use hdtrapeze_core::bvh::{LinearBox, ObjectGeometry};
use hdtrapeze_core::grid::{DicedMesh, PlanarMesh};
use hdtrapeze_core::trace::{Hit, InstanceTransform, Ray, World};
use hdtrapeze_gpu::contents::Contents;
use hdtrapeze_gpu::{BuildOptions, FirstOnDevice, GpuScene, Tracer, TreeBuilder};
use hdtrapeze_shaders::layout::Object;
use libtest_mimic::Failed;
use support::*;
use trace_scenes::*;

const LEAF: u32 = 1 << 31;
const MOVES: u32 = 1 << 30;
const LOOSE: u32 = 1 << 30;
const EMPTY: u32 = u32::MAX;

/// Planes of a child on the axes of its node, at both ends of the shutter.
struct Slabs {
    axes: [DVec3; 3],
    ends: [[DVec3; 2]; 2],
}

impl Slabs {
    /// An error where a position is outside at `time`: not by rounding in f64, of which there is none at the ends.
    fn hold(&self, p: DVec3, time: f64) -> Result<(), Failed> {
        for (axis, a) in self.axes.iter().enumerate() {
            let x = a.dot(p);
            let plane = |side: usize| {
                let [from, to] = [self.ends[0][side][axis], self.ends[1][side][axis]];
                from * (1.0 - time) + to * time
            };
            let (lo, hi) = (plane(0), plane(1));
            let exact = a.abs().element_sum() == 1.0 && (time == 0.0 || time == 1.0);
            let slack = match exact {
                true => 0.0,
                false => 1e-14 * (lo.abs() + hi.abs() + p.abs().element_sum()),
            };
            if !(lo - slack <= x && x <= hi + slack) {
                return Err(format!("{x:e} at {time} is not in {lo:e} .. {hi:e}").into());
            }
        }
        Ok(())
    }
}

/// A tree, as the device has it, and the mesh that it is of.
struct Walk<'a> {
    contents: &'a Contents,
    object: Object,
    mesh: &'a PlanarMesh,
    times: Vec<f64>,
    /// How often each cell of each grid was met.
    met: Vec<Vec<u32>>,
    /// Nodes, blocks and loose groups.
    counts: [usize; 3],
}

impl Walk<'_> {
    fn words(&self, reference: u32) -> &[u32] {
        let place = (reference & !(LEAF | MOVES)) as usize;
        &bytemuck::cast_slice(&self.contents.nodes)[4 * place..]
    }

    fn slabs(&self, words: &[u32], moves: bool, slot: usize, frame: u32) -> Slabs {
        let lattice = |words: &[u32]| {
            let float = |i: usize| f64::from(f32::from_bits(words[i]));
            let bytes: &[u8] = bytemuck::cast_slice(&words[6..18]);
            [0, 1].map(|side| {
                let plane = |axis: usize| {
                    let q = f64::from(bytes[16 * axis + 8 * side + slot]);
                    float(axis) + float(3 + axis) * q
                };
                DVec3::from_array([0, 1, 2].map(plane))
            })
        };
        let start = lattice(words);
        let end = if moves { lattice(&words[18..]) } else { start };
        let axes = [0, 1, 2].map(|axis| {
            let at = frame as usize + 3 * axis;
            let float = |i: usize| f64::from(f32::from_bits(self.contents.words[at + i]));
            match frame {
                0 => DVec3::AXES[axis],
                _ => DVec3::new(float(0), float(1), float(2)),
            }
        });
        Slabs {
            axes,
            ends: [start, end],
        }
    }

    /// Gives the entries of the stack that a walk below needs.
    fn visit(&mut self, reference: u32, above: &mut Vec<Slabs>) -> Result<u32, Failed> {
        if above.len() > 300 {
            return Err("a tree without an end".into());
        }
        if reference & LEAF == 0 {
            self.counts[0] += 1;
            let moves = reference & MOVES != 0;
            let words = self.words(reference).to_vec();
            let children = if moves { 36 } else { 18 };
            let (frame, valid) = (words[children + 8], words[children + 9]);
            let mut need = 0;
            for slot in (0..8).filter(|slot| valid >> slot & 1 != 0) {
                above.push(self.slabs(&words, moves, slot, frame));
                need = need.max(self.visit(words[children + slot], above)?);
                above.pop();
            }
            return Ok(need + valid.count_ones() - 1);
        }
        if reference & LOOSE != 0 {
            self.counts[2] += 1;
            let item = reference & !(LEAF | LOOSE);
            let (g, slot) = ((item >> 3) as usize, item & 7);
            let [w, h] = self.rates(g);
            let rect = match (w, h) {
                _ if w <= 4 && h <= 2 => [0, 0, w, h],
                (1, _) => [0, 2 * slot, 1, 2.min(h - 2 * slot)],
                _ => [2 * slot, 0, 2.min(w - 2 * slot), 1],
            };
            self.group(g, rect, above)?;
            return Ok(0);
        }
        self.counts[1] += 1;
        let moves = self.mesh.is_moving();
        let words = self.words(reference).to_vec();
        let tail = if moves { 36 } else { 18 };
        let g = words[tail] as usize;
        let [i, j, w, h] = words[tail + 1].to_le_bytes().map(u32::from);
        let [cw, ch, columns, count] = words[tail + 2].to_le_bytes().map(u32::from);
        for slot in 0..count {
            let (x, y) = (slot % columns * cw, slot / columns * ch);
            above.push(self.slabs(&words, moves, slot as usize, words[tail + 3]));
            self.group(g, [i + x, j + y, cw.min(w - x), ch.min(h - y)], above)?;
            above.pop();
        }
        Ok(0)
    }

    fn rates(&self, g: usize) -> [u32; 2] {
        let grid = &self.mesh.grids[g];
        [grid.nu.into(), grid.nv.into()]
    }

    /// All vertices of a group are in all slabs above, at all keys and some times between.
    fn group(&mut self, g: usize, rect: [u32; 4], above: &[Slabs]) -> Result<(), Failed> {
        let [i, j, w, h] = rect.map(|x| x as usize);
        let nu = self.rates(g)[0] as usize;
        for y in j..j + h {
            for x in i..i + w {
                self.met[g][y * nu + x] += 1;
            }
        }
        let keys = &self.mesh.key_times;
        for (y, x) in (j..=j + h).flat_map(|y| (i..=i + w).map(move |x| (y, x))) {
            let vertex = y * (nu + 1) + x;
            let at_key = |k: usize| self.mesh.position(g, k, vertex).as_dvec3();
            for (k, &time) in keys.iter().enumerate() {
                // A mesh of one key is there at all times.
                let time = if keys.len() == 1 {
                    0.5
                } else {
                    f64::from(time)
                };
                for slabs in above {
                    slabs.hold(at_key(k), time)?;
                }
            }
            if keys.len() == 1 {
                continue;
            }
            for &time in &self.times {
                let k = keys[1..keys.len() - 1]
                    .iter()
                    .filter(|&&key| f64::from(key) <= time)
                    .count();
                let [from, to] = [keys[k], keys[k + 1]].map(f64::from);
                let p = at_key(k).lerp(at_key(k + 1), (time - from) / (to - from));
                for slabs in above {
                    slabs.hold(p, time)?;
                }
            }
        }
        Ok(())
    }
}

/// Walks through the tree of each object: everything is contained by all that is above it, and each cell of a grid that can
/// be traced is there once. Gives the nodes, blocks and loose groups that there are.
fn contained(
    tracer: &Tracer,
    scene: &GpuScene,
    meshes: &[&DicedMesh],
) -> Result<[usize; 3], Failed> {
    let pages = scene.contents(tracer.device())?;
    let [contents] = &pages[..] else {
        return Err("more than a page".into());
    };
    let mut rng = Rng(23);
    let times: Vec<f64> = (0..4).map(|_| f64::from(rng.unit())).collect();
    let mut counts = [0; 3];
    for (&object, &mesh) in contents.objects.iter().zip(meshes) {
        let mesh = PlanarMesh::from(mesh.clone());
        let met = mesh.grids.iter().map(|grid| vec![0; grid.cell_count()]);
        let mut walk = Walk {
            contents,
            object,
            met: met.collect(),
            times: times.clone(),
            mesh: &mesh,
            counts: [0; 3],
        };
        if object.root != EMPTY {
            let need = walk.visit(object.root, &mut Vec::new())?;
            if need > contents.stack {
                return Err(format!("{need} entries in a stack of {}", contents.stack).into());
            }
        }
        let limit = hdtrapeze_core::bvh::COORDINATE_LIMIT;
        for (g, (met, sound)) in walk.met.iter().zip(mesh.sound_grids()).enumerate() {
            let traced = sound && {
                let start = mesh.plane_start(&mesh.grids[g], 0);
                let floats = 3 * mesh.grids[g].vertex_count() * mesh.key_count();
                let all = &mesh.planes()[start..][..floats];
                let reach = all.iter().fold(0.0f32, |most, x| most.max(x.abs()));
                if all.iter().all(|x| x.abs() < limit) && reach > walk.object.radius {
                    return Err(format!("{reach} is beyond {}", walk.object.radius).into());
                }
                all.iter().all(|x| x.abs() < limit)
            };
            if met.iter().any(|&n| n != u32::from(traced)) {
                return Err(format!("cells of grid {g} ({traced}): {met:?}").into());
            }
        }
        for (sum, n) in counts.iter_mut().zip(walk.counts) {
            *sum += n;
        }
    }
    Ok(counts)
}

/// Pipelines are compiled once.
static BUILDER: OnceLock<TreeBuilder> = OnceLock::new();

fn builder(tracer: &Tracer) -> &'static TreeBuilder {
    BUILDER.get_or_init(|| TreeBuilder::new(Arc::clone(tracer.device())))
}

fn built(tracer: &Tracer, world: &World, refits: bool) -> Result<GpuScene, Failed> {
    let options = BuildOptions {
        refits,
        ..BuildOptions::default()
    };
    Ok(GpuScene::build(builder(tracer), world, &options)?)
}

/// Hits have the bits of those through the CPU's trees: they do not depend on the order of the walk.
fn as_with_host_trees(
    tracer: &Tracer,
    world: &World,
    scene: &GpuScene,
    rays: usize,
    least_hits: usize,
) -> Result<(), Failed> {
    let rays = random_rays(rays);
    let mut hits = vec![Hit::MISS; rays.len()];
    let mut expected = hits.clone();
    tracer.trace(scene, &rays, false, &mut hits)?;
    let host = GpuScene::new(tracer.device(), world)?;
    tracer.trace(&host, &rays, false, &mut expected)?;
    let found = hits.iter().filter(|hit| hit.is_hit()).count();
    if hits != expected || found < least_hits {
        let other = hits.iter().zip(&expected).find(|(a, b)| a != b);
        return Err(format!("{found} of {} hit; {other:?}", rays.len()).into());
    }
    Ok(())
}

fn random_rays(count: usize) -> Vec<Ray> {
    let mut rng = Rng(41);
    (0..count).map(|_| random_ray(&mut rng)).collect()
}

/// A scene is contained, with trees of the device and of the CPU; rays hit what they should.
fn sound(tracer: &Tracer, mesh: &DicedMesh, least_hits: usize) -> Result<(), Failed> {
    let world = world_of(mesh.clone());
    let scene = built(tracer, &world, false)?;
    contained(tracer, &scene, &[mesh])?;
    agree(tracer, &world, &scene, least_hits)?;
    for first in [
        FirstOnDevice::Build,
        FirstOnDevice::Instances,
        FirstOnDevice::Generate,
    ] {
        let options = BuildOptions {
            first,
            ..BuildOptions::default()
        };
        let other = GpuScene::build(builder(tracer), &world, &options)?;
        contained(tracer, &other, &[mesh])
            .map_err(|e| format!("from {} on: {e:?}", first.name()))?;
        as_with_host_trees(tracer, &world, &other, RAYS, least_hits)?;
    }
    as_with_host_trees(tracer, &world, &scene, RAYS, least_hits)
}

fn single_cells(count: usize, at: impl Fn(usize, f32, f32, f32) -> Vec3) -> DicedMesh {
    mesh(&vec![(1, 1); count], &[0.0], at)
}

/// Very many equal boxes, which no order tells apart. A ray asks each of them; Mesa's software device gives up after some
/// 65,536 turns of loops, so that rays are tried with fewer.
fn equal_boxes(tracer: &Tracer) -> Result<(), Failed> {
    for (count, rays) in [(50_000, 0), (1000, 100)] {
        let mesh = single_cells(count, |_, u, v, _| Vec3::new(u, v, 0.3 * u));
        let world = world_of(mesh.clone());
        let scene = built(tracer, &world, false)?;
        let [nodes, _, loose] = contained(tracer, &scene, &[&mesh])?;
        if loose != count || nodes > count * 4 / 7 {
            return Err(format!("{nodes} nodes over {loose} groups").into());
        }
        as_with_host_trees(tracer, &world, &scene, rays, rays / 20)?;
    }
    Ok(())
}

/// Boxes inside boxes, of which no two find each other but the smallest.
fn nested_boxes(tracer: &Tracer) -> Result<(), Failed> {
    let mesh = single_cells(3000, |g, u, v, _| {
        let size = 1.002f32.powi(g as i32 - 3000);
        Vec3::new((u - 0.5) * size, (v - 0.5) * size, u * v * size)
    });
    let world = world_of(mesh.clone());
    let scene = built(tracer, &world, false)?;
    if tracer.device().found().timestamps && scene.build_seconds().is_empty() {
        return Err("made by the CPU".into());
    }
    contained(tracer, &scene, &[&mesh])?;
    as_with_host_trees(tracer, &world, &scene, 200, 10)
}

/// What has no thickness, on one axis, on two, or on all.
fn flat(tracer: &Tracer) -> Result<(), Failed> {
    for extent in [Vec3::new(1.0, 1.0, 0.0), Vec3::X, Vec3::ZERO] {
        for key_count in [1, 3] {
            let mesh = mesh(&[(9, 9); 30], &keys(key_count), |g, u, v, t| {
                let p = Vec3::new(u + g as f32 * 0.1, v, 1.0) * extent;
                p + Vec3::Y * t * t * extent.y
            });
            let world = world_of(mesh.clone());
            let scene = built(tracer, &world, false)?;
            contained(tracer, &scene, &[&mesh])?;
            as_with_host_trees(tracer, &world, &scene, 300, 0)?;
        }
    }
    Ok(())
}

/// Coordinates as large as can be traced, and as small as floats can be.
fn all_sizes(tracer: &Tracer) -> Result<(), Failed> {
    for exponent in [-149, -140, -126, -100, -40, 30, 58] {
        let size = (f64::from(exponent)).exp2() as f32;
        for key_count in [1, 2, 4] {
            for mut mesh in [
                sheet(3, 9, &keys(key_count)),
                patches(20, 7, &keys(key_count), 5),
                fur(40, &keys(key_count), 6),
            ] {
                for p in &mut mesh.positions {
                    *p *= size;
                }
                let world = world_of(mesh.clone());
                let scene = built(tracer, &world, false)?;
                contained(tracer, &scene, &[&mesh])
                    .map_err(|e| format!("2^{exponent}, {key_count} keys: {e:?}"))?;
            }
        }
    }
    Ok(())
}

/// Paths of single points, whose bounds leave nothing to spare: all vertices of a grid are in one place, as
/// far from the origin as they move, or much farther or nearer.
fn paths(tracer: &Tracer) -> Result<(), Failed> {
    let mut rng = Rng(77);
    for key_count in [2, 3, 4, 7] {
        let paths: Vec<Vec<Vec3>> = (0..3000)
            .map(|_| {
                let [at, far] = [-140.0, -20.0].map(|low| (low * rng.unit() * rng.unit()).exp2());
                let at = rng.cube() * at;
                let mut step = || at + rng.cube() * rng.unit() * far;
                (0..key_count).map(|_| step()).collect()
            })
            .collect();
        let key_times = keys(key_count);
        let mesh = mesh(&vec![(2, 3); paths.len()], &key_times, |g, _, _, t| {
            let k = key_times.iter().position(|&time| time == t);
            paths[g][k.unwrap_or(0)]
        });
        let scene = built(tracer, &world_of(mesh.clone()), false)?;
        contained(tracer, &scene, &[&mesh])?;
    }
    Ok(())
}

/// Grids that cannot be traced are left out whole, and the others are there.
fn bad_grids(tracer: &Tracer) -> Result<(), Failed> {
    for bad in [f32::NAN, f32::NEG_INFINITY, -1.2e18, f32::INFINITY] {
        for key_count in [1, 3] {
            let mut mesh = sheet(4, 13, &keys(key_count));
            let n = mesh.grids[0].vertex_count();
            // A vertex at some key, of every third grid.
            for g in (0..16).step_by(3) {
                let key = g % key_count;
                mesh.positions[(g * key_count + key) * n + 7 * g].y = bad;
            }
            mesh.grids[10].nu = 99;
            let world = world_of(mesh.clone());
            let scene = built(tracer, &world, false)?;
            contained(tracer, &scene, &[&mesh])?;
            as_with_host_trees(tracer, &world, &scene, 500, 50)?;
        }
    }
    Ok(())
}

/// One item, two, none, and no grid that can be traced.
fn few_items(tracer: &Tracer) -> Result<(), Failed> {
    let mut lost = sheet(1, 8, &[0.0]);
    lost.positions[3].x = f32::NAN;
    let strip = mesh(&[(1, 3)], &keys(2), |_, u, v, t| Vec3::new(u, v + t, v));
    for mesh in [
        sheet(1, 8, &[0.0]),
        sheet(1, 1, &keys(3)),
        strip,
        DicedMesh {
            key_times: vec![0.0],
            ..DicedMesh::default()
        },
        lost,
    ] {
        let world = world_of(mesh.clone());
        let scene = built(tracer, &world, false)?;
        contained(tracer, &scene, &[&mesh])?;
        as_with_host_trees(tracer, &world, &scene, 300, 0)?;
    }
    Ok(())
}

/// All kinds of grids in one object, beside objects that move and that do not.
fn mixed() -> Vec<DicedMesh> {
    let mut rng = Rng(3);
    let mut meshes = Vec::new();
    for key_count in [1, 2, 1, 5, 1, 2] {
        let rate = |rng: &mut Rng| 1 + rng.below(16) as u16;
        let rates: Vec<_> = (0..60).map(|_| (rate(&mut rng), rate(&mut rng))).collect();
        let who: Vec<_> = (0..60).map(|_| (rng.cube(), rng.direction())).collect();
        meshes.push(mesh(&rates, &keys(key_count), |g, u, v, t| {
            let (at, axis) = who[g];
            let turn = glam::Quat::from_axis_angle(axis, 2.0 * t + g as f32);
            at + turn * Vec3::new(u * 0.4, v * 0.1, 0.1 * u * u)
        }));
    }
    meshes
}

fn several_objects(tracer: &Tracer) -> Result<(), Failed> {
    let meshes = mixed();
    let objects: Vec<_> = meshes.iter().cloned().map(object).collect();
    let at = |i: usize| DVec3::splat(0.1) * i as f64;
    let place = |i| InstanceTransform::Translation(at(i));
    let instances = (0..12).map(|i| instance(&objects[i % 6], place(i)));
    let world = World::build(instances.collect(), DVec3::ZERO);
    let scene = built(tracer, &world, false)?;
    let [_, blocks, loose] = contained(tracer, &scene, &meshes.iter().collect::<Vec<_>>())?;
    if blocks == 0 || loose == 0 {
        return Err("not of all kinds".into());
    }
    agree(tracer, &world, &scene, 200)
}

/// Objects of so many items that their keys take more than 32 bits.
fn many_items(tracer: &Tracer) -> Result<(), Failed> {
    let mut rng = Rng(91);
    let meshes = [20_000, 30_000, 10].map(|count| {
        let who: Vec<_> = (0..count).map(|_| rng.cube()).collect();
        single_cells(count, |g, u, v, _| who[g] + Vec3::new(u, v, u * v) * 0.01)
    });
    let at = |i| InstanceTransform::Translation(DVec3::splat(i));
    let objects = meshes.iter().cloned().map(object).zip([0.0, 0.3, 0.6]);
    let instances = objects.map(|(object, i)| instance(&object, at(i)));
    let world = World::build(instances.collect(), DVec3::ZERO);
    let scene = built(tracer, &world, false)?;
    contained(tracer, &scene, &meshes.iter().collect::<Vec<_>>())?;
    as_with_host_trees(tracer, &world, &scene, 500, 50)
}

/// Rays open about as many nodes, and test about as many micropolygons, as through the CPU's trees.
fn costs(tracer: &Tracer) -> Result<(), Failed> {
    let meshes = [
        sheet(8, 16, &keys(1)),
        sheet(8, 16, &keys(2)),
        patches(60, 16, &keys(2), 3),
        single_cells(5000, |g, u, v, _| {
            let [x, y] = [g % 71, g / 71].map(|i| i as f32 / 35.0 - 1.0);
            Vec3::new(x + 0.02 * u, y + 0.02 * v, 0.1 * (5.0 * x).sin())
        }),
    ];
    for mesh in meshes {
        let world = world_of(mesh);
        let scenes = [
            built(tracer, &world, false)?,
            GpuScene::new(tracer.device(), &world)?,
        ];
        let rays = random_rays(3000);
        let mut costs = [0.0; 2];
        for (cost, scene) in costs.iter_mut().zip(&scenes) {
            let batch = tracer.batch(scene, &rays, false, true)?;
            tracer.run(&batch)?;
            let counts = tracer.counts(&batch)?.unwrap_or_default();
            *cost = (counts.node_tests + counts.cell_tests) as f64;
        }
        if costs[0] > 1.25 * costs[1] {
            return Err(format!("{costs:?}").into());
        }
    }
    Ok(())
}

/// Trees over pages hit what trees on one page hit, and no trees of the CPU are asked for.
fn paged(tracer: &Tracer) -> Result<(), Failed> {
    let one = |mesh| {
        let object = Arc::new(ObjectGeometry::later(mesh));
        let at = InstanceTransform::Translation(DVec3::ZERO);
        World::build_later(vec![instance(&object, at)], DVec3::ZERO)
    };
    let mut unsound = patches(300, 7, &keys(2), 6);
    unsound.grids[5].nu = 99;
    unsound.positions[9000].x = f32::NAN;
    for (world, most, pages) in [
        (one(sheet(8, 9, &keys(2))), 20_000, 5..=20),
        (one(patches(300, 7, &[0.0], 6)), 40_000, 5..=30),
        (one(fur(2000, &keys(2), 6)), 100_000, 8..=40),
        (one(unsound), 60_000, 5..=30),
        (crowd(12), 8_000, 3..=40),
    ] {
        let options = BuildOptions {
            most,
            ..BuildOptions::default()
        };
        let scene = GpuScene::build(builder(tracer), &world, &options)?;
        if !pages.contains(&scene.page_count()) || !scene.has_own_trees() {
            return Err(format!("{} pages, not {pages:?}", scene.page_count()).into());
        }
        let later = world.stats();
        if later.top_nodes == 0 && later.trees > 0 {
            return Err("the CPU has made trees".into());
        }
        as_with_host_trees(tracer, &world, &scene, RAYS, 50)?;
    }
    Ok(())
}

/// Pages hold what is near each other: but for the roots of all pages, rays open few more nodes than where all is on one.
fn pages_cost_little(tracer: &Tracer) -> Result<(), Failed> {
    for (mesh, most, more) in [
        (patches(600, 7, &[0.0], 6), 80_000, 1.1),
        (fur(3000, &[0.0], 6), 150_000, 1.1),
        (sheet(12, 9, &[0.0]), 30_000, 1.1),
    ] {
        let world = world_of(mesh);
        let rays = random_rays(3000);
        for first in [FirstOnDevice::Bound, FirstOnDevice::Generate] {
            let mut nodes = [0.0; 2];
            let mut pages = 0;
            for (nodes, most) in nodes.iter_mut().zip([u64::MAX, most]) {
                let options = BuildOptions {
                    first,
                    most,
                    ..BuildOptions::default()
                };
                let scene = GpuScene::build(builder(tracer), &world, &options)?;
                pages = scene.page_count();
                let batch = tracer.batch(&scene, &rays, false, true)?;
                tracer.run(&batch)?;
                *nodes = tracer.counts(&batch)?.unwrap_or_default().node_tests as f64;
            }
            let roots = (pages * rays.len()) as f64;
            let times = (nodes[1] - roots) / nodes[0];
            let all = nodes[1] / nodes[0];
            println!("{pages} pages: {all:.2} times the nodes, {times:.2} without roots");
            if pages < 6 || times > more {
                return Err(format!("{pages} pages: {nodes:?}").into());
            }
        }
    }
    Ok(())
}

/// The box of each instance is in all slabs above it, at both ends of the shutter, and each is there once.
fn over_instances(tracer: &Tracer, world: &World, scene: &GpuScene) -> Result<usize, Failed> {
    let pages = scene.contents(tracer.device())?;
    let [contents] = &pages[..] else {
        return Err("more than a page".into());
    };
    let nothing = PlanarMesh::default();
    let walk = Walk {
        contents,
        object: Object::default(),
        mesh: &nothing,
        times: Vec::new(),
        met: Vec::new(),
        counts: [0; 3],
    };
    let boxes: HashMap<u32, LinearBox> = world.boxes().into_iter().collect();
    let mut met: Vec<u32> = Vec::new();
    let mut nodes = 0;
    // A reference, the slabs that were stored for it, and how much may wait on a ray's stack meanwhile.
    let mut rest: Vec<(u32, Vec<Rc<Slabs>>, u32)> = vec![(contents.root, Vec::new(), 0)];
    while let Some((reference, above, waiting)) = rest.pop() {
        if waiting > contents.stack {
            return Err(format!("{waiting} entries in a stack of {}", contents.stack).into());
        }
        if reference == EMPTY {
            continue;
        }
        if reference & LEAF != 0 {
            let number = reference & !LEAF;
            let own = boxes.get(&number).ok_or(format!("no instance {number}"))?;
            for slabs in &above {
                for (time, lo, hi) in [(0.0, own.lo0, own.hi0), (1.0, own.lo1, own.hi1)] {
                    slabs.hold(lo.as_dvec3(), time)?;
                    slabs.hold(hi.as_dvec3(), time)?;
                }
            }
            met.push(number);
            continue;
        }
        nodes += 1;
        let moves = reference & MOVES != 0;
        let words = walk.words(reference);
        let children = if moves { 36 } else { 18 };
        for slot in (0..8).filter(|slot| words[children + 9] >> slot & 1 != 0) {
            let mut above = above.clone();
            above.push(Rc::new(walk.slabs(words, moves, slot, words[children + 8])));
            let waiting = waiting + words[children + 9].count_ones() - 1;
            rest.push((words[children + slot], above, waiting));
        }
    }
    met.sort_unstable();
    let mut all: Vec<u32> = boxes.into_keys().collect();
    all.sort_unstable();
    match met == all {
        true => Ok(nodes),
        false => Err(format!("{} of {} instances", met.len(), all.len()).into()),
    }
}

/// So many instances, of which some move, one of the others is flattened to nothing, and one is nowhere.
fn instances(count: usize, moving: usize) -> World {
    let objects = [
        Arc::new(ObjectGeometry::later(sheet(1, 5, &[0.0]))),
        Arc::new(ObjectGeometry::later(patches(3, 5, &keys(2), 4))),
    ];
    let mut rng = Rng(count as u64);
    let size = 1.5 / (count as f64).cbrt();
    let one = |i: usize| {
        let at = rng.cube().as_dvec3();
        let turn = f64::from(rng.unit()) * 6.0;
        let scale = DVec3::new(size, 1.2 * size, 0.8 * size);
        let transform = match i % 5 {
            _ if i < moving => spinning(2 + i % 3, 1.0, scale, at),
            2 if i == 7 => InstanceTransform::Static(affine(DVec3::X, 1.0, DVec3::ZERO, at)),
            3 if i == 8 => InstanceTransform::Translation(DVec3::NAN),
            _ => InstanceTransform::Static(affine(DVec3::new(1.0, 2.0, 0.3), turn, scale, at)),
        };
        // Few objects move by themselves.
        instance(&objects[usize::from(moving > 0 && i % 16 == 5)], transform)
    };
    World::build_later((0..count).map(one).collect(), DVec3::ZERO)
}

/// The tree over instances is made on the device as well, over none, one, as many as a node has, and more.
fn many_instances(tracer: &Tracer) -> Result<(), Failed> {
    for (count, moving) in [
        (0, 0),
        (1, 0),
        (1, 1),
        (2, 1),
        (8, 0),
        (8, 8),
        (9, 0),
        (9, 9),
        (9, 1),
        (20, 2),
        (1000, 0),
        (1000, 3),
        (1000, 1000),
        (20_000, 0),
    ] {
        let fail = |e: Failed| format!("{moving} of {count} move: {e:?}");
        let world = instances(count, moving);
        let scene = built(tracer, &world, false)?;
        let stats = world.stats();
        if (stats.trees, stats.top_nodes) != (0, 0) || !scene.has_own_trees() {
            return Err("the CPU has made trees".into());
        }
        let nodes = over_instances(tracer, &world, &scene).map_err(fail)?;
        if nodes > count * 4 / 7 + 1 {
            return Err(format!("{nodes} nodes over {count} instances").into());
        }
        as_with_host_trees(tracer, &world, &scene, RAYS, 0).map_err(fail)?;
        // Brute force asks each instance.
        if count < 100 {
            agree(tracer, &world, &scene, count / 4).map_err(fail)?;
        }
    }
    Ok(())
}

/// Few that move stand apart: rays open about as many nodes as with the CPU's tree over the same instances.
fn tops_cost_as_much(tracer: &Tracer) -> Result<(), Failed> {
    for (count, moving) in [(300, 0), (300, 12), (300, 300), (1000, 0)] {
        let world = instances(count, moving);
        let rays = random_rays(3000);
        let mut nodes = [0.0; 2];
        for (nodes, first) in nodes
            .iter_mut()
            .zip([FirstOnDevice::Bound, FirstOnDevice::Generate])
        {
            let options = BuildOptions {
                first,
                ..BuildOptions::default()
            };
            let scene = GpuScene::build(builder(tracer), &world, &options)?;
            let batch = tracer.batch(&scene, &rays, false, true)?;
            tracer.run(&batch)?;
            *nodes = tracer.counts(&batch)?.unwrap_or_default().node_tests as f64;
        }
        println!("{moving} of {count} move: {:.3}", nodes[0] / nodes[1]);
        if nodes[0] > 1.3 * nodes[1] {
            return Err(format!("{moving} of {count} move: {nodes:?}").into());
        }
    }
    Ok(())
}

/// Trees whose vertices have moved contain them, as trees that are built anew would.
fn refitted(tracer: &Tracer) -> Result<(), Failed> {
    let moved = |mesh: &DicedMesh| {
        let mut mesh = mesh.clone();
        for p in &mut mesh.positions {
            *p += Vec3::new(0.3, 0.1 * (3.0 * p.x).sin(), 0.1 * (4.0 * p.y).cos());
        }
        mesh
    };
    for before in [
        patches(40, 7, &[0.0], 3),
        patches(40, 7, &keys(3), 3),
        fur(150, &keys(2), 4),
        sheet(1, 8, &keys(2)),
    ] {
        let after = moved(&before);
        let (world, moved) = (world_of(before), world_of(after.clone()));
        let mut scene = built(tracer, &world, true)?;
        if !scene.refit(builder(tracer), &moved)? {
            return Err("not refitted".into());
        }
        contained(tracer, &scene, &[&after])?;
        agree(tracer, &moved, &scene, 5)?;
        // And back again.
        if !scene.refit(builder(tracer), &world)? {
            return Err("not refitted again".into());
        }
        agree(tracer, &world, &scene, 5)?;
    }
    Ok(())
}

/// So are those of scenes on several pages; where that cannot be, all pages stay as they were.
fn refitted_on_pages(tracer: &Tracer) -> Result<(), Failed> {
    let moved = |mesh: &DicedMesh| {
        let mut mesh = mesh.clone();
        for p in &mut mesh.positions {
            *p += Vec3::new(0.3, 0.1 * (3.0 * p.x).sin(), 0.1 * (4.0 * p.y).cos());
        }
        mesh
    };
    for (before, most) in [
        (patches(300, 7, &[0.0], 6), 40_000),
        (sheet(8, 9, &keys(2)), 20_000),
    ] {
        let mut lost = moved(&before);
        // Of the last page only.
        if let Some(p) = lost.positions.last_mut() {
            p.z = f32::NAN;
        }
        let worlds = [before.clone(), moved(&before), before, lost].map(world_of);
        let options = BuildOptions {
            refits: true,
            most,
            ..BuildOptions::default()
        };
        let mut scene = GpuScene::build(builder(tracer), &worlds[0], &options)?;
        if scene.page_count() < 5 {
            return Err(format!("{} pages", scene.page_count()).into());
        }
        for world in &worlds[1..3] {
            if !scene.refit(builder(tracer), world)? {
                return Err("not refitted".into());
            }
            as_with_host_trees(tracer, world, &scene, RAYS, 50)?;
        }
        let one_more = World::build(
            [0.0, 0.1]
                .map(|x| {
                    let at = InstanceTransform::Translation(DVec3::X * x);
                    instance(&object(sheet(8, 9, &keys(2))), at)
                })
                .into(),
            DVec3::ZERO,
        );
        for world in [&worlds[3], &one_more] {
            if scene.refit(builder(tracer), world)? {
                return Err("refitted to another scene".into());
            }
            as_with_host_trees(tracer, &worlds[0], &scene, RAYS, 50)?;
        }
        if !scene.refit(builder(tracer), &worlds[1])? {
            return Err("not refitted after that".into());
        }
        as_with_host_trees(tracer, &worlds[1], &scene, RAYS, 50)?;
    }
    Ok(())
}

/// Instances that move, appear or go are no reason to make objects' trees anew.
fn refitted_instances(tracer: &Tracer) -> Result<(), Failed> {
    let meshes = [sheet(2, 7, &[0.0]), patches(12, 5, &keys(3), 9)];
    let objects = meshes.map(object);
    let crowd = |count: usize, seed: u64| {
        let mut rng = Rng(seed);
        let at = |i: usize| {
            let at = rng.cube().as_dvec3();
            instance(
                &objects[i % 2],
                spinning(2 + i % 2, 0.5, DVec3::splat(0.4), at),
            )
        };
        World::build_later((0..count).map(at).collect(), DVec3::ZERO)
    };
    let mut scene = built(tracer, &crowd(12, 1), true)?;
    for (count, seed) in [(12, 2), (20, 3), (2, 4)] {
        let world = crowd(count, seed);
        if !scene.refit(builder(tracer), &world)? {
            return Err(format!("not refitted to {count}").into());
        }
        over_instances(tracer, &world, &scene)?;
        agree(tracer, &world, &scene, 20)?;
    }
    Ok(())
}

/// Where all go elsewhere, trees over what was near are of no use: scenes are to be built anew.
fn too_bad_to_refit(tracer: &Tracer) -> Result<(), Failed> {
    for (before, after) in [
        (patches(80, 7, &[0.0], 3), patches(80, 7, &[0.0], 4)),
        (patches(80, 7, &keys(3), 3), patches(80, 7, &keys(3), 4)),
        (fur(300, &keys(2), 4), fur(300, &keys(2), 5)),
    ] {
        let (world, moved) = (world_of(before.clone()), world_of(after));
        let mut scene = built(tracer, &world, true)?;
        if scene.refit(builder(tracer), &moved)? {
            return Err("refitted".into());
        }
        contained(tracer, &scene, &[&before])?;
        agree(tracer, &world, &scene, 5)?;
    }
    Ok(())
}

/// Where grids differ, or others than before cannot be traced, scenes are to be built anew, and are as they were.
fn not_refitted(tracer: &Tracer) -> Result<(), Failed> {
    let mesh = sheet(3, 9, &keys(2));
    let world = world_of(mesh.clone());
    let mut lost = mesh.clone();
    lost.positions[1000].z = f32::NAN;
    let others = [
        sheet(3, 8, &keys(2)),
        sheet(2, 9, &keys(2)),
        sheet(3, 9, &keys(3)),
        sheet(3, 9, &[0.0]),
        lost,
    ];
    let mut scene = built(tracer, &world, true)?;
    for other in others {
        if scene.refit(builder(tracer), &world_of(other))? {
            return Err("refitted to another mesh".into());
        }
        contained(tracer, &scene, &[&mesh])?;
    }
    agree(tracer, &world, &scene, 300)?;
    // One item each, a loose group or a block: those of what moves lie behind it.
    let floor = |rate: (u16, u16)| {
        let floor = trace_scenes::mesh(&[rate], &[0.0], |_, u, v, _| Vec3::new(u, v, 0.0));
        let still = instance(&object(floor), InstanceTransform::Translation(DVec3::ZERO));
        let moving = instance(
            &object(patches(6, 16, &keys(2), 3)),
            InstanceTransform::Translation(DVec3::ONE),
        );
        World::build(vec![still, moving], DVec3::ZERO)
    };
    for (before, after) in [((4, 2), (8, 8)), ((8, 8), (4, 2))] {
        let world = floor(before);
        let mut scene = built(tracer, &world, true)?;
        if scene.refit(builder(tracer), &floor(after))? {
            return Err("refitted to blocks in other places".into());
        }
        agree(tracer, &world, &scene, 100)?;
    }
    let mut scene = built(tracer, &world, false)?;
    match scene.refit(builder(tracer), &world)? {
        true => Err("refitted from nothing".into()),
        false => Ok(()),
    }
}

fn main() {
    let mut checks: Vec<(String, Check)> = Vec::new();
    let mut add = |name: String, run: Check| checks.push((name, run));
    /// A name, a mesh with these keys, and rays that hit it at least.
    type Meshes = (&'static str, fn(&[f32]) -> DicedMesh, usize);
    let meshes: [Meshes; 6] = [
        ("sheet", |keys| sheet(3, 9, keys), 300),
        ("patches", |keys| patches(40, 7, keys, 3), 100),
        ("large_patches", |keys| patches(20, 16, keys, 3), 100),
        ("fur", |keys| fur(200, keys, 4), 30),
        ("combed", |keys| combed(200, 0.05, keys, 4), 100),
        ("fan", |keys| curved::fan(2, 6, keys, 3.0), 50),
    ];
    for (name, make, least) in meshes {
        for key_count in [1, 2, 3, 5] {
            add(
                format!("{name}_with_{key_count}_keys"),
                Box::new(move |tracer| sound(tracer, &make(&keys(key_count)), least)),
            );
        }
    }
    for (name, make, least) in objects() {
        add(
            format!("world_of_{name}"),
            Box::new(move |tracer| {
                let world = make(&keys(2));
                agree(tracer, &world, &built(tracer, &world, false)?, least)
            }),
        );
    }
    for moving in [0, 3, 40] {
        add(
            format!("instances_of_which_{moving}_move"),
            Box::new(move |tracer| {
                let world = crowd(moving);
                agree(tracer, &world, &built(tracer, &world, false)?, 200)
            }),
        );
    }
    add(
        "surfaces_that_coincide".to_owned(),
        Box::new(|tracer| {
            let world = coincident(5);
            agree(tracer, &world, &built(tracer, &world, false)?, 300)
        }),
    );
    /// A name and a test.
    type Named = (&'static str, fn(&Tracer) -> Result<(), Failed>);
    let others: [Named; 19] = [
        ("equal_boxes", equal_boxes),
        ("nested_boxes", nested_boxes),
        ("flat", flat),
        ("all_sizes", all_sizes),
        ("paths", paths),
        ("bad_grids", bad_grids),
        ("few_items", few_items),
        ("several_objects", several_objects),
        ("many_items", many_items),
        ("costs", costs),
        ("paged", paged),
        ("pages_cost_little", pages_cost_little),
        ("many_instances", many_instances),
        ("tops_cost_as_much", tops_cost_as_much),
        ("refitted", refitted),
        ("refitted_on_pages", refitted_on_pages),
        ("refitted_instances", refitted_instances),
        ("too_bad_to_refit", too_bad_to_refit),
        ("not_refitted", not_refitted),
    ];
    for (name, check) in others {
        add(name.to_owned(), Box::new(check));
    }
    run(checks);
}
