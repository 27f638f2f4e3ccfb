//! Walks through what the device holds of trees: all is contained by what is above it, and all is there once.

use std::collections::HashMap;
use std::rc::Rc;

use glam::DVec3;
use hdtrapeze_core::bvh::LinearBox;
use hdtrapeze_core::bvh::object::loose_group;
use hdtrapeze_core::grid::{DicedMesh, PlanarMesh};
use hdtrapeze_core::trace::World;
use hdtrapeze_gpu::contents::Contents;
use hdtrapeze_gpu::{GpuScene, Tracer};
use hdtrapeze_shaders::layout::Object;
use libtest_mimic::Failed;

use crate::trace_scenes::*;

const LEAF: u32 = 1 << 31;
const MOVES: u32 = 1 << 30;
const LOOSE: u32 = 1 << 30;
const EMPTY: u32 = u32::MAX;
/// Of a frame that turns.
const TURNS: u32 = 1 << 31;

/// Planes of a child on the axes of its node, at both ends of the shutter.
struct Slabs {
    axes: [DVec3; 3],
    /// What the third axis is at the end of the shutter, and bows along all three, where it turns.
    turns: Option<(DVec3, DVec3)>,
    ends: [[DVec3; 2]; 2],
}

impl Slabs {
    /// An error where a position is outside at a time, at which bows are multiplied by `part`: not by rounding in f64, of
    /// which there is none at the ends.
    fn hold(&self, p: DVec3, (time, part): (f64, f64)) -> Result<(), Failed> {
        let (mut axes, mut bow) = (self.axes, DVec3::ZERO);
        if let Some((end, most)) = self.turns {
            axes[2] = axes[2] * (1.0 - time) + end * time;
            bow = most * part;
        }
        for (axis, a) in axes.iter().enumerate() {
            let x = a.dot(p) + bow[axis];
            let plane = |side: usize| {
                let [from, to] = [self.ends[0][side][axis], self.ends[1][side][axis]];
                from * (1.0 - time) + to * time
            };
            let (lo, hi) = (plane(0), plane(1));
            let exact = a.abs().element_sum() == 1.0 && (time == 0.0 || time == 1.0);
            let slack = match exact {
                true => 0.0,
                false => 1e-14 * (lo.abs() + hi.abs() + p.abs().element_sum() + bow[axis].abs()),
            };
            if !(lo - slack <= x && x <= hi + slack) {
                return Err(format!("{x:e} at {time} is not in {lo:e} .. {hi:e}").into());
            }
        }
        Ok(())
    }
}

fn parabola(time: f64) -> f64 {
    time * (1.0 - time)
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
        let word = |i: usize| {
            let at = (frame & !TURNS) as usize + i;
            f64::from(f32::from_bits(self.contents.words[at]))
        };
        let vector = |i: usize| DVec3::new(word(3 * i), word(3 * i + 1), word(3 * i + 2));
        let axes = match frame {
            0 => DVec3::AXES,
            _ => [0, 1, 2].map(vector),
        };
        Slabs {
            axes,
            turns: (frame & TURNS != 0).then(|| (vector(3), vector(4))),
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
            let (g, slot) = loose_group(reference & !LEAF).ok_or("a loose group is a block")?;
            let g = g as usize;
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
                    slabs.hold(at_key(k), (time, parabola(time)))?;
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
                let fraction = (time - from) / (to - from);
                let p = at_key(k).lerp(at_key(k + 1), fraction);
                // From 3 to 9 keys bows go straight from one to the next.
                let part = match keys.len() {
                    3..=9 => parabola(from) + (parabola(to) - parabola(from)) * fraction,
                    _ => parabola(time),
                };
                for slabs in above {
                    slabs.hold(p, (time, part))?;
                }
            }
        }
        Ok(())
    }
}

/// Walks through the tree of each object: everything is contained by all that is above it, and each cell of a grid that can
/// be traced is there once. Gives the nodes, blocks and loose groups that there are.
pub fn contained(
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
                let start = mesh.first_float(&mesh.grids[g], 0);
                let floats = 3 * mesh.grids[g].vertex_count() * mesh.key_count();
                let all = &mesh.floats()[start..][..floats];
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

/// The box of each instance is in all slabs above it, at both ends of the shutter, and each is there once.
pub fn over_instances(tracer: &Tracer, world: &World, scene: &GpuScene) -> Result<usize, Failed> {
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
                    slabs.hold(lo.as_dvec3(), (time, parabola(time)))?;
                    slabs.hold(hi.as_dvec3(), (time, parabola(time)))?;
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
