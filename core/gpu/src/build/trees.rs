//! A forest on the device: made once, and made anew where vertices have moved.

use bytemuck::cast_slice;
use glam::Vec3;
use hdtrapeze_core::bvh::LinearBox;
use hdtrapeze_shaders::layout::{BuildLaunch, BuildOutcome, BuildState};
use hdtrapeze_shaders::stage::{BuildStage, SORT_BITS, SORT_TILE};
use wgpu::BufferUsages as Usage;

use super::forest::Forest;
use super::host::Bounded;
use super::run::{Clock, Runner, Step, sort_steps, workgroups};
use crate::{Device, GpuError};

/// Items that are bounded in one dispatch.
const BOUND_AT_ONCE: u32 = 1 << 18;
/// Rounds of clustering, and levels that are opened, before the device is asked how far it is.
const ROUNDS: u32 = 12;
const LEVELS: u32 = 8;
/// Rounds that suffice for all items that can be numbered, where two rounds join an eighth of them or more.
const MOST_ROUNDS: u32 = 360;
/// Levels that are numbered.
const LAST_LEVEL: u32 = 254;
/// Numbers about each object in `facts`.
pub(super) const FACTS: usize = 7;
const NONE: u32 = u32::MAX;

/// Where things are in the buffers of the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Places {
    /// Place of the first block.
    pub blocks: u32,
    /// First word of the blocks' frames.
    pub frames: u32,
}

/// The shape of the trees of a forest, and what their bounds are made from.
#[derive(Debug)]
pub(crate) struct Trees {
    pub forest: Forest,
    pub places: Places,
    objects: wgpu::Buffer,
    starts: wgpu::Buffer,
    facts: wgpu::Buffer,
    boxes: wgpu::Buffer,
    references: wgpu::Buffer,
    slots: wgpu::Buffer,
    roots: wgpu::Buffer,
    heights: wgpu::Buffer,
    outcomes: wgpu::Buffer,
    /// First node of each level, and the one after the last.
    levels: Vec<u32>,
    /// As `facts` has them: a bit for each grid that was left out.
    dropped: Vec<u32>,
    /// Of each object what its tree cost when it was made.
    pub costs: Vec<f32>,
}

/// Why trees of a forest are not made on the device.
pub(crate) enum Unmade {
    Failed(GpuError),
    /// Deeper than can be numbered.
    Deep,
}

impl From<GpuError> for Unmade {
    fn from(error: GpuError) -> Self {
        Self::Failed(error)
    }
}

/// The integer of a float, in the order of floats; as `boxes.wgsl` has it.
pub(super) fn ordered(x: f32) -> i32 {
    let bits = x.to_bits() as i32;
    bits ^ ((bits >> 31) & 0x7fff_ffff)
}

fn storage(device: &Device, what: &'static str, bytes: u64) -> Result<wgpu::Buffer, GpuError> {
    let usage = Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST;
    // A binding may not be empty.
    device.buffer(what, bytes.max(64), usage)
}

fn words(device: &Device, what: &'static str, count: u32) -> Result<wgpu::Buffer, GpuError> {
    storage(device, what, 4 * u64::from(count))
}

impl Trees {
    /// Makes the trees over a forest whose vertices are in `vertices`, and grids in `grids`. Its blocks are in the buffer that is
    /// given back, in their order.
    pub fn new(
        runner: &Runner,
        clock: &mut Clock,
        forest: Forest,
        places: Places,
        (vertices, grids): (&wgpu::Buffer, &wgpu::Buffer),
    ) -> Result<(Self, wgpu::Buffer), Unmade> {
        let device = &*runner.device;
        let units = forest.block_units();
        let mut trees = Self::empty(device, forest, places)?;
        let blocks = words(device, "blocks", 4 * units * trees.forest.blocks)?;
        trees.bound(
            runner,
            clock,
            (vertices, grids),
            (&blocks, trees.places.blocks),
        )?;
        trees.dropped = trees.now_dropped(device)?;
        trees.shape(runner, clock)?;
        Ok((trees, blocks))
    }

    /// The same where the items are bounded already.
    pub fn bounded(
        runner: &Runner,
        clock: &mut Clock,
        forest: Forest,
        places: Places,
        bounded: &Bounded,
    ) -> Result<(Self, wgpu::Buffer), Unmade> {
        let device = &*runner.device;
        let mut trees = Self::empty(device, forest, places)?;
        let blocks = device.upload("blocks", cast_slice(&bounded.blocks))?;
        let queue = &device.queue;
        queue.write_buffer(&trees.boxes, 0, cast_slice(&bounded.boxes));
        queue.write_buffer(&trees.references, 0, cast_slice(&bounded.references));
        queue.write_buffer(&trees.facts, 0, cast_slice(&bounded.facts));
        trees.dropped = trees.now_dropped(device)?;
        trees.shape(runner, clock)?;
        Ok((trees, blocks))
    }

    /// Makes a tree over boxes, which stand for what these references say.
    pub fn over(
        runner: &Runner,
        clock: &mut Clock,
        boxes: &[(u32, LinearBox)],
        moves: bool,
    ) -> Result<Self, Unmade> {
        let device = &*runner.device;
        let forest = Forest::over(boxes.len() as u32, moves);
        let mut trees = Self::empty(device, forest, Places::default())?;
        let floats = |b: &LinearBox| {
            let ends = [b.lo0, b.hi0, b.lo1, b.hi1].map(|v| v.to_array().map(ordered));
            ends.into_iter().take(if moves { 4 } else { 2 }).flatten()
        };
        let bounds: Vec<i32> = boxes.iter().flat_map(|(_, b)| floats(b)).collect();
        let references: Vec<u32> = boxes.iter().map(|&(reference, _)| reference).collect();
        let centres = boxes.iter().map(|(_, b)| b.centre4());
        let all = centres.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), centre| {
            (lo.min(centre), hi.max(centre))
        });
        let radius = boxes.iter().map(|(_, b)| b.max_abs()).fold(0.0, f32::max);
        let mut facts: Vec<i32> = [all.0, all.1]
            .iter()
            .flat_map(|v| v.to_array().map(ordered))
            .collect();
        // No grid is left out.
        facts.extend([ordered(radius), 0]);
        let queue = &device.queue;
        queue.write_buffer(&trees.boxes, 0, cast_slice(&bounds));
        queue.write_buffer(&trees.references, 0, cast_slice(&references));
        queue.write_buffer(&trees.facts, 0, cast_slice(&facts));
        trees.shape(runner, clock)?;
        Ok(trees)
    }

    /// Buffers for a forest.
    fn empty(device: &Device, forest: Forest, places: Places) -> Result<Self, GpuError> {
        let units = forest.block_units();
        let starts = forest.starts.iter();
        let starts: Vec<[u32; 2]> = starts
            .map(|&[item, block]| [item, places.blocks + units * block])
            .collect();
        let items = forest.items;
        let floats = if forest.moves { 12 } else { 6 };
        let facts = (FACTS * forest.objects.len() + forest.starts.len().div_ceil(32)) as u32;
        let count = forest.objects.len() as u32;
        Ok(Self {
            objects: device.upload("objects", cast_slice(&forest.objects))?,
            starts: device.upload("items", cast_slice(&starts))?,
            facts: words(device, "facts", facts)?,
            boxes: storage(device, "boxes", 8 * floats * u64::from(items))?,
            references: words(device, "items", items)?,
            slots: words(device, "slots", 8 * forest.most_nodes())?,
            roots: device.upload("roots", cast_slice(&vec![NONE; count as usize]))?,
            heights: words(device, "nodes", 3 * forest.most_nodes())?,
            outcomes: words(device, "outcomes", 4 * count)?,
            levels: Vec::new(),
            dropped: Vec::new(),
            costs: Vec::new(),
            forest,
            places,
        })
    }

    /// Finds which nodes there are, over items whose boxes are there.
    fn shape(&mut self, runner: &Runner, clock: &mut Clock) -> Result<(), Unmade> {
        let (clusters, state) = self.sorted(runner, clock)?;
        let (clusters, children) = self.clustered(runner, clock, clusters, &state)?;
        self.collapsed(runner, clock, &clusters, &children, &state)
    }

    /// Says what item `number` stands for, where that is known only now.
    pub fn refer(&self, device: &Device, number: u32, reference: u32) {
        let bytes = reference.to_ne_bytes();
        let queue = &device.queue;
        queue.write_buffer(&self.references, 4 * u64::from(number), &bytes);
    }

    /// Nodes of all trees.
    pub fn node_count(&self) -> u32 {
        self.levels.last().copied().unwrap_or(0)
    }

    fn launch(&self) -> BuildLaunch {
        let forest = &self.forest;
        BuildLaunch {
            items: forest.items,
            objects: forest.objects.len() as u32,
            grids: forest.starts.len() as u32,
            bits: forest.bits(),
            tiles: workgroups(forest.items, SORT_TILE),
            blocks: self.places.blocks,
            frames: self.places.frames,
            ..BuildLaunch::default()
        }
    }

    /// Bounds all items anew; the first unit of `nodes`, where blocks go, has place `base`.
    fn bound(
        &self,
        runner: &Runner,
        clock: &mut Clock,
        (vertices, grids): (&wgpu::Buffer, &wgpu::Buffer),
        (nodes, base): (&wgpu::Buffer, u32),
    ) -> Result<(), GpuError> {
        let queue = &runner.device.queue;
        queue.write_buffer(&self.facts, 0, cast_slice(&self.forest.no_facts()));
        let buffers = [
            &self.boxes,
            &self.objects,
            &self.starts,
            &self.facts,
            vertices,
            grids,
            nodes,
            &self.references,
        ];
        let some = |first: u32| {
            let end = self.forest.items.min(first + BOUND_AT_ONCE);
            Step {
                entry: "bound",
                launch: BuildLaunch {
                    base,
                    first,
                    end,
                    ..self.launch()
                },
                workgroups: workgroups(end - first, 64),
                set: 0,
            }
        };
        let parts = (0..self.forest.items).step_by(BOUND_AT_ONCE as usize);
        let steps: Vec<Step> = parts.map(some).collect();
        let stage = (BuildStage::Bound, self.forest.moves);
        runner.run(clock, stage, &steps, &[&buffers])
    }

    fn now_dropped(&self, device: &Device) -> Result<Vec<u32>, GpuError> {
        let first = FACTS * self.forest.objects.len();
        let mut facts = vec![0u32; first + self.forest.starts.len().div_ceil(32)];
        device.fetch(&self.facts, &mut facts)?;
        Ok(facts.split_off(first))
    }

    /// Items in the order of their keys, as the first clusters.
    fn sorted(
        &self,
        runner: &Runner,
        clock: &mut Clock,
    ) -> Result<(wgpu::Buffer, wgpu::Buffer), GpuError> {
        let device = &*runner.device;
        let (items, launch) = (self.forest.items, self.launch());
        let keys = [
            words(device, "keys", 2 * items)?,
            words(device, "keys", 2 * items)?,
        ];
        let numbers = [
            words(device, "items", items)?,
            words(device, "items", items)?,
        ];
        let key = Step {
            entry: "key",
            launch,
            workgroups: workgroups(items, 64),
            set: 0,
        };
        let buffers = [
            &self.boxes,
            &self.objects,
            &self.starts,
            &self.facts,
            &keys[0],
            &numbers[0],
        ];
        let stage = (BuildStage::Morton, self.forest.moves);
        runner.run(clock, stage, &[key], &[&buffers])?;
        let histogram = words(device, "histogram", (launch.tiles << SORT_BITS).max(1))?;
        let clusters = words(device, "clusters", 2 * items)?;
        let begun = BuildState {
            made: 1,
            ..bytemuck::Zeroable::zeroed()
        };
        let state = storage(device, "state", size_of::<BuildState>() as u64)?;
        device
            .queue
            .write_buffer(&state, 0, bytemuck::bytes_of(&begun));
        let set = |from: usize| {
            let to = 1 - from;
            [
                &keys[from],
                &numbers[from],
                &keys[to],
                &numbers[to],
                &histogram,
                &clusters,
                &state,
            ]
        };
        let (mut steps, rounds) = sort_steps(launch, self.forest.key_bits());
        steps.push(Step {
            entry: "begin",
            launch,
            workgroups: workgroups(items, 128),
            set: rounds as usize % 2,
        });
        let stage = (BuildStage::Sort, self.forest.moves);
        runner.run(clock, stage, &steps, &[&set(0), &set(1)])?;
        Ok((clusters, state))
    }

    /// The last clusters, and the children of nodes of the binary trees.
    fn clustered(
        &self,
        runner: &Runner,
        clock: &mut Clock,
        clusters: wgpu::Buffer,
        state: &wgpu::Buffer,
    ) -> Result<(wgpu::Buffer, wgpu::Buffer), Unmade> {
        let device = &*runner.device;
        let (items, launch) = (self.forest.items, self.launch());
        let other = words(device, "clusters", 2 * items)?;
        let nearest = words(device, "neighbours", items)?;
        let sums = words(device, "sums", 2 * workgroups(items, 128))?;
        let children = words(device, "children", 2 * items)?;
        let arrays = [clusters, other];
        let set = |from: usize| {
            [
                &self.boxes,
                &arrays[from],
                &arrays[1 - from],
                &nearest,
                &sums,
                &children,
                state,
            ]
        };
        let mut count = items;
        for round in (0..MOST_ROUNDS).step_by(ROUNDS as usize) {
            let groups = workgroups(count, 128);
            let steps = |round: u32| {
                let set = round as usize % 2;
                let names = ["find", "count", "sum", "join"];
                names.map(move |entry| Step {
                    entry,
                    launch,
                    workgroups: if entry == "sum" { 1 } else { groups },
                    set,
                })
            };
            let steps: Vec<Step> = (round..round + ROUNDS).flat_map(steps).collect();
            let stage = (BuildStage::Cluster, self.forest.moves);
            runner.run(clock, stage, &steps, &[&set(0), &set(1)])?;
            let now = read_state(device, state)?;
            if now.made == 0 {
                // After an even number of rounds they stand where they began.
                const { assert!(ROUNDS.is_multiple_of(2)) };
                let [clusters, _] = arrays;
                return Ok((clusters, children));
            }
            count = now.count;
        }
        Err(Unmade::Deep)
    }

    /// Nodes of 8 children.
    fn collapsed(
        &mut self,
        runner: &Runner,
        clock: &mut Clock,
        clusters: &wgpu::Buffer,
        children: &wgpu::Buffer,
        state: &wgpu::Buffer,
    ) -> Result<(), Unmade> {
        let device = &*runner.device;
        let (most, launch) = (self.forest.most_nodes(), self.launch());
        let opened = words(device, "opened", most)?;
        let sums = words(device, "sums", 2 * workgroups(most, 128))?;
        let buffers = [
            &self.boxes,
            clusters,
            children,
            &opened,
            &self.slots,
            &sums,
            &self.roots,
            state,
        ];
        let step = |entry, workgroups| Step {
            entry,
            launch,
            workgroups,
            set: 0,
        };
        let mut steps = vec![step("root", 1)];
        // Nodes of the next level, at most.
        let mut next = launch.objects.min(most);
        while self.levels.is_empty() {
            for _ in 0..LEVELS {
                let groups = workgroups(next, 128);
                steps.push(step("open", groups));
                steps.push(step("sum", 1));
                steps.push(step("place", groups));
                next = next.saturating_mul(8).min(most);
            }
            let stage = (BuildStage::Collapse, self.forest.moves);
            runner.run(clock, stage, &steps, &[&buffers])?;
            steps.clear();
            let now = read_state(device, state)?;
            let Some((levels, count)) = opened_levels(&now, most) else {
                return Err(Unmade::Failed(GpuError::Failed {
                    name: device.found().name.clone(),
                    why: "levels of its trees make no sense".to_owned(),
                }));
            };
            next = count;
            if next == 0 {
                self.levels = levels;
            } else if now.level == LAST_LEVEL {
                return Err(Unmade::Deep);
            }
        }
        Ok(())
    }

    /// Makes the bounds of all nodes, into `nodes` from place `first` on; gives what became of each object.
    pub fn refit(
        &self,
        runner: &Runner,
        clock: &mut Clock,
        nodes: &wgpu::Buffer,
        first: u32,
    ) -> Result<Vec<BuildOutcome>, GpuError> {
        let buffers = [
            &self.boxes,
            &self.slots,
            &self.references,
            nodes,
            &self.heights,
            &self.roots,
            &self.facts,
            &self.outcomes,
        ];
        let launch = BuildLaunch {
            nodes: first,
            ..self.launch()
        };
        let level = |ends: &[u32]| Step {
            entry: "refit",
            launch: BuildLaunch {
                first: ends[0],
                end: ends[1],
                ..launch
            },
            workgroups: workgroups(ends[1] - ends[0], 64),
            set: 0,
        };
        let mut steps: Vec<Step> = self.levels.windows(2).rev().map(level).collect();
        steps.push(Step {
            entry: "tell",
            launch,
            workgroups: workgroups(launch.objects, 64),
            set: 0,
        });
        let stage = (BuildStage::Refit, self.forest.moves);
        runner.run(clock, stage, &steps, &[&buffers])?;
        let mut outcomes = vec![BuildOutcome::default(); self.forest.objects.len()];
        runner.device.fetch(&self.outcomes, &mut outcomes)?;
        Ok(outcomes)
    }

    /// Takes over a forest that is alike, and has its grids and vertices in other places.
    pub fn now_at(&mut self, device: &Device, forest: Forest, places: Places) {
        let objects = cast_slice(&forest.objects);
        device.queue.write_buffer(&self.objects, 0, objects);
        (self.forest, self.places) = (forest, places);
    }

    /// Bounds all items anew, into `nodes` at their places, where vertices have moved. False where other grids than before
    /// cannot be traced: these trees are of no use then.
    pub fn rebound(
        &self,
        runner: &Runner,
        clock: &mut Clock,
        vertices: (&wgpu::Buffer, &wgpu::Buffer),
        nodes: &wgpu::Buffer,
    ) -> Result<bool, GpuError> {
        self.bound(runner, clock, vertices, (nodes, 0))?;
        Ok(self.now_dropped(&runner.device)? == self.dropped)
    }
}

/// The first node of each level that has some, and the one after the last, and how many nodes of the next level there are; none
/// where there are more than `most`, or numbers that no stage gives.
fn opened_levels(now: &BuildState, most: u32) -> Option<(Vec<u32>, u32)> {
    let level = now.level as usize;
    let all = now.levels.get(..=level.checked_add(1)?)?;
    let &[.., begin, end] = all else {
        return None;
    };
    let mut levels = all[..=level].to_vec();
    // Levels were opened that have no nodes.
    levels.dedup();
    (all.is_sorted() && end <= most).then_some((levels, end - begin))
}

fn read_state(device: &Device, state: &wgpu::Buffer) -> Result<BuildState, GpuError> {
    let mut now = [bytemuck::Zeroable::zeroed()];
    device.fetch(state, &mut now)?;
    let [now] = now;
    Ok(now)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_levels_that_ascend_are_taken() {
        let state = |level: u32, first: &[u32]| {
            let mut state: BuildState = bytemuck::Zeroable::zeroed();
            state.level = level;
            state.levels[..first.len()].copy_from_slice(first);
            state
        };
        let told = |level, first| opened_levels(&state(level, first), 100);
        assert_eq!(told(2, &[0, 1, 9, 40]), Some((vec![0, 1, 9], 31)));
        assert_eq!(told(3, &[0, 1, 9, 9, 9]), Some((vec![0, 1, 9], 0)));
        assert_eq!(told(0, &[0, 0]), Some((vec![0], 0)));
        assert_eq!(told(2, &[0, 9, 1, 40]), None);
        assert_eq!(told(2, &[0, 1, 9, 101]), None);
        for level in [255, 1000, u32::MAX] {
            assert_eq!(told(level, &[]), None);
        }
    }
}
