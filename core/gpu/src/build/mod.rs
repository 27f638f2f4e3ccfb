//! Trees made on the device: a world's vertices go there once, and nothing below instances is built on the CPU.
//!
//! **Stages.** `bound` makes the bounds of blocks and loose groups; `morton` and `sort` put these in the order of a Morton
//! curve; `cluster` makes a binary tree of them from below, and `collapse` nodes of 8 children of that; `refit` makes the
//! bounds of nodes. What comes of it has the bytes of core's trees, so that `trace` knows no difference. Their texts say how.
//!
//! **Forests.** All objects whose vertices move have their trees made together, and so have all that do not:
//! a world of thousands of objects takes no more dispatches than one. Which items there are follows from the rates
//! of grids ([`forest`]), so that their places are known before anything runs; nodes get theirs once they are counted.
//!
//! **Where trees differ from core's.** They are not in a carried space nor turned along strands, no block is halved,
//! all strips are loose, and parts of these are always two micropolygons. Blocks are turned along their lattices, as core's.
//!
//! **Instances.** The tree over them is made in the same way, over the bounds that core proves of each, and anew whenever
//! something moves. Few that move have a tree of their own, as core's.
//!
//! **Moved vertices.** Where only vertices have changed, [`GpuScene::refit`] bounds all anew and keeps the shape of trees,
//! unless surface area says that they have become too bad: what a ray opens of a tree that meets its root is, about, the sum
//! of the areas of all nodes in parts of the root's.
//!
//! **In parts.** Bounds may be the CPU's ([`host`]), or all trees of objects, to find out which stage a difference comes from.
//!
//! A tree that needs a deeper stack than there is (boxes inside boxes, mostly) is made on the CPU instead.

pub(crate) mod forest;
mod host;
pub(crate) mod run;
mod trees;

use std::sync::Arc;
use std::time::Duration;

use bytemuck::cast_slice;
use hdtrapeze_core::bvh::LinearBox;
use hdtrapeze_core::grid::PlanarMesh;
use hdtrapeze_core::trace::World;
use hdtrapeze_core::trace::parts::Parts;
use hdtrapeze_core::trace::piece::{InWhole, Trees as WhereTrees};
use hdtrapeze_core::trace::world::{common, few_move};
use hdtrapeze_shaders::stage::BuildStage;
use wgpu::BufferUsages as Usage;

use super::early::EarlyVertices;
use super::pages::Paints;
use super::scene::{self, Arrays, MOVES, Made, Page, Start, Unit, upload};
use super::stack::{EMPTY, LEAF};
use super::{Device, FirstOnDevice, GpuError, GpuScene, Submitted, pace};
use forest::Forest;
use host::Bounded;
use run::{Clock, Runner};
use trees::{Places, Trees, Unmade};

/// Trees that are refitted may cost so much more than when they were made; beyond, they are made anew.
const WORSE: f32 = 1.25;

/// Makes trees on a device. Pipelines are compiled once for each permutation.
#[derive(Debug)]
pub struct TreeBuilder {
    runner: Runner,
}

/// How a scene is made.
#[derive(Clone, Copy, Debug)]
pub struct BuildOptions {
    /// Where the CPU's part ends; all trees are its own where that is after them.
    pub first: FirstOnDevice,
    /// What [`GpuScene::refit`] needs is kept.
    pub refits: bool,
    /// Bytes of the largest array of a page.
    pub most: u64,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            first: FirstOnDevice::default(),
            refits: false,
            most: u64::MAX,
        }
    }
}

/// Who makes the trees of a page.
pub(crate) enum Maker<'a> {
    /// The CPU has made them.
    Host(&'a Device),
    /// The device.
    Device(Making<'a>),
}

/// How the device makes trees.
#[derive(Clone, Copy)]
pub(crate) struct Making<'a> {
    builder: &'a TreeBuilder,
    /// A stage before generate: those before it are the CPU's.
    first: FirstOnDevice,
    /// What is needed to refit them is kept.
    keep: bool,
    /// Vertices that are there already.
    early: Option<&'a EarlyVertices>,
}

impl Maker<'_> {
    pub fn device(&self) -> &Device {
        match self {
            Maker::Host(device) => device,
            Maker::Device(making) => making.builder.device(),
        }
    }

    /// Whether the CPU makes trees of objects.
    pub fn trees(&self) -> WhereTrees {
        match self {
            Maker::Device(making) if making.first < FirstOnDevice::Instances => WhereTrees::Later,
            _ => WhereTrees::Now,
        }
    }

    /// Vertices that are on the device already.
    pub fn early(&self) -> Option<&EarlyVertices> {
        match self {
            Maker::Host(_) => None,
            Maker::Device(making) => making.early,
        }
    }

    /// Lays out a page; see [`Page::new`].
    pub fn page(&self, world: &World, numbers: &[InWhole], most: u64) -> Result<Page, GpuError> {
        if let Maker::Device(making) = self {
            match making.page(world, numbers, most) {
                Ok(page) => return Ok(page),
                Err(Unmade::Failed(error)) => return Err(error),
                Err(Unmade::Deep) => {}
            }
        }
        Page::new(self.device(), world, numbers, most)
    }
}

impl GpuScene {
    /// Lays out `world` and makes its trees, on the device or as [`GpuScene::new`].
    ///
    /// # Errors
    /// As [`GpuScene::new`].
    pub fn build(
        builder: &TreeBuilder,
        world: &World,
        options: &BuildOptions,
    ) -> Result<Self, GpuError> {
        Self::painted(builder, world, options, &Paints::default(), None)
    }

    /// The same where vertices of some objects are on the device.
    ///
    /// # Errors
    /// As [`GpuScene::new`].
    pub fn build_early(
        builder: &TreeBuilder,
        world: &World,
        options: &BuildOptions,
        early: &EarlyVertices,
    ) -> Result<Self, GpuError> {
        Self::painted(builder, world, options, &Paints::default(), Some(early))
    }

    /// The same with room on its pages for how objects look.
    pub(crate) fn painted(
        builder: &TreeBuilder,
        world: &World,
        options: &BuildOptions,
        paints: &Paints,
        early: Option<&EarlyVertices>,
    ) -> Result<Self, GpuError> {
        let maker = match options.first {
            first if first < FirstOnDevice::Generate => Maker::Device(Making {
                builder,
                first,
                keep: options.refits,
                early,
            }),
            _ => Maker::Host(builder.device()),
        };
        Self::made(&maker, world, options.most, paints)
    }

    /// Takes over `world`, whose vertices, matrices and key times may differ from those that the scene was made of, but not its
    /// grids; nor, on several pages, which instances there are. False where they do, where nothing was kept to refit, where
    /// other grids than before cannot be traced, or where a tree has become much worse than it was: the scene is then as it was,
    /// and is to be built anew.
    ///
    /// # Errors
    /// As [`GpuScene::new`]; the scene is as it was then, too.
    pub fn refit(&mut self, builder: &TreeBuilder, world: &World) -> Result<bool, GpuError> {
        self.refit_early(builder, world, None)
    }

    /// The same where vertices of some objects are on the device.
    pub(crate) fn refit_early(
        &mut self,
        builder: &TreeBuilder,
        world: &World,
        early: Option<&EarlyVertices>,
    ) -> Result<bool, GpuError> {
        scene::traceable(world)?;
        let parts = world.parts();
        let shapes = scene::shapes(&parts);
        if self.pages.len() > 1 && shapes != self.sets {
            return Ok(false);
        }
        let mut refitted: Vec<Page> = Vec::with_capacity(self.pages.len());
        let done = self.refit_pages((builder, early), world, &parts, &mut refitted);
        match done {
            Ok(true) => (self.pages, self.sets) = (refitted, shapes),
            // Pages that were refitted give back what they have taken over.
            Ok(false) | Err(_) => {
                for (page, now) in self.pages.iter_mut().zip(refitted) {
                    page.made.trees = now.made.trees;
                }
            }
        }
        done
    }

    /// Adds pages in place of those that there are to `refitted`; false where one is to be built anew.
    fn refit_pages(
        &mut self,
        (builder, early): (&TreeBuilder, Option<&EarlyVertices>),
        world: &World,
        parts: &Parts<'_>,
        refitted: &mut Vec<Page>,
    ) -> Result<bool, GpuError> {
        for (number, page) in self.pages.iter_mut().enumerate() {
            let now = match self.plan.get(number) {
                None => builder.refit(page, (world, &scene::all(world)), early)?,
                Some(picks) => {
                    let piece = parts.piece(picks, WhereTrees::Later)?;
                    builder.refit(page, (&piece.world, &piece.numbers), early)?
                }
            };
            match now {
                Some(now) => refitted.push(now),
                None => return Ok(false),
            }
        }
        Ok(true)
    }

    /// The seconds of each stage that made the trees on the device, by its own clock; nothing where it has none.
    pub fn build_seconds(&self) -> Vec<(BuildStage, f64)> {
        let of = |stage| {
            let all = self.pages.iter().flat_map(|page| &page.made.seconds);
            (stage, all.filter(|s| s.0 == stage).map(|s| s.1).sum())
        };
        match self.pages.iter().all(|page| page.made.seconds.is_empty()) {
            true => Vec::new(),
            false => BuildStage::ALL.map(of).to_vec(),
        }
    }
}

/// What is needed to refit the trees of a page.
#[derive(Debug)]
pub(crate) struct Refits {
    /// Of objects.
    forests: Vec<Trees>,
    /// Bytes of the largest array of the page.
    most: u64,
}

/// A world laid out, and the forests whose trees are to be made.
struct Laid<'w> {
    arrays: Arrays,
    forests: Vec<Planted<'w>>,
    /// The first unit after all blocks, and the CPU's nodes.
    end: u32,
    /// Entries of the stack that the CPU's trees need.
    deepest: u32,
}

/// A forest that has its places, and the meshes of its objects.
struct Planted<'w> {
    forest: Forest,
    places: Places,
    meshes: Vec<&'w PlanarMesh>,
}

/// The tree over instances: of all, or of those that do not move and, as one of its items, another of the few that do.
struct Tops {
    movers: Option<Trees>,
    /// None where there are no instances.
    all: Option<Trees>,
    /// Which item of `all` stands for the movers.
    apart: u32,
}

fn too_much() -> GpuError {
    GpuError::Unsupported("more than 2^30 units of nodes or 2^32 coordinates".to_owned())
}

/// Lays out a world whose objects have trees of the CPU.
fn laid_with_trees<'w>(world: &'w World, numbers: &[InWhole]) -> Result<Laid<'w>, GpuError> {
    let mut arrays = Arrays::new();
    let mut deepest = 0;
    arrays.instances(&world.parts(), numbers, |arrays, object, grids| {
        deepest = deepest.max(arrays.object(object, grids)?);
        Ok(())
    })?;
    let end = arrays.nodes.len() as u64;
    Laid {
        arrays,
        forests: Vec::new(),
        end: end as u32,
        deepest,
    }
    .checked(end)
}

/// Lays out a world; blocks come first among the nodes.
fn laid<'w>(
    world: &'w World,
    numbers: &[InWhole],
    early: Option<&EarlyVertices>,
) -> Result<Laid<'w>, GpuError> {
    let mut arrays = Arrays::new();
    let parts = world.parts();
    let mut forests = [false, true].map(|moves| {
        let forest = Forest {
            moves,
            ..Forest::default()
        };
        (forest, Vec::new())
    });
    arrays.instances(&parts, numbers, |arrays, object, grids| {
        let (mesh, number) = (object.mesh(), arrays.objects.len());
        let there = early.and_then(|early| early.take(object));
        arrays.mesh((mesh, there), grids, EMPTY, 0.0);
        let (forest, meshes) = &mut forests[usize::from(mesh.is_moving())];
        meshes.push(mesh);
        match forest.add(mesh, number as u32, &arrays.objects[number]) {
            true => Ok(()),
            false => Err(too_much()),
        }
    })?;
    let mut end = 0;
    let mut planted = Vec::new();
    let forests = forests.into_iter();
    for (forest, meshes) in forests.filter(|(forest, _)| forest.items > 0) {
        let places = Places {
            blocks: end as u32,
            frames: arrays.words.len() as u32,
        };
        end += u64::from(forest.block_units()) * u64::from(forest.blocks);
        let frames = forest.frame_words() * forest.blocks;
        arrays.words.resize(arrays.words.len() + frames as usize, 0);
        planted.push(Planted {
            forest,
            places,
            meshes,
        });
    }
    Laid {
        arrays,
        forests: planted,
        end: end as u32,
        deepest: 0,
    }
    .checked(end)
}

impl Laid<'_> {
    /// Refused where it has more than can be numbered; `end` is its end.
    fn checked(self, end: u64) -> Result<Self, GpuError> {
        let lengths = [self.arrays.vertices.len(), self.arrays.words.len()];
        match end >= u64::from(MOVES) || lengths.iter().any(|&n| u32::try_from(n).is_err()) {
            true => Err(too_much()),
            false => Ok(self),
        }
    }
}

impl Making<'_> {
    fn page(&self, world: &World, numbers: &[InWhole], most: u64) -> Result<Page, Unmade> {
        let Self {
            builder,
            first,
            keep,
            early,
        } = *self;
        let (runner, device) = (&builder.runner, builder.device());
        let mut clock = runner.clock();
        let mut laid = match first < FirstOnDevice::Instances {
            true => laid(world, numbers, early)?,
            false => laid_with_trees(world, numbers)?,
        };
        let planted = std::mem::take(&mut laid.forests);
        let bounded = planted.iter().map(|planted| match first {
            FirstOnDevice::Bound => None,
            _ => Some(Bounded::new(planted, &mut laid.arrays.words)),
        });
        let bounded: Vec<Option<Bounded>> = bounded.collect();
        let are_early = laid.arrays.vertices.are_early();
        let vertices = match (builder.vertices(&mut laid.arrays, most), early) {
            // There is room for one of both.
            (Err(GpuError::OutOfMemory { .. }), Some(early)) if are_early => {
                drop((laid, planted, bounded));
                early.close()?;
                return self.page(world, numbers, most);
            }
            (vertices, _) => vertices?,
        };
        let mut made = Vec::new();
        for (planted, bounded) in planted.into_iter().zip(bounded) {
            let Planted { forest, places, .. } = planted;
            let clock = &mut clock;
            made.push(match bounded {
                None => {
                    let vertices = (&vertices[0], &vertices[1]);
                    Trees::new(runner, clock, forest, places, vertices)?
                }
                Some(bounded) => Trees::bounded(runner, clock, forest, places, &bounded)?,
            });
        }
        let tops = builder.tops(&mut clock, world)?;
        let trees = made.iter().map(|(trees, _)| trees);
        let nodes = builder.nodes(&laid, trees.chain(tops.trees()), most)?;
        let host_nodes = cast_slice(&laid.arrays.nodes);
        device.queue.write_buffer(&nodes, 0, host_nodes);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        for (trees, blocks) in &made {
            let unit = size_of::<Unit>() as u64;
            let count = trees.forest.blocks * trees.forest.block_units();
            let (to, bytes) = (u64::from(trees.places.blocks), u64::from(count) * unit);
            encoder.copy_buffer_to_buffer(blocks, 0, &nodes, to * unit, bytes);
        }
        device.queue.submit([encoder.finish()]);
        let mut trees: Vec<Trees> = made.into_iter().map(|(trees, _)| trees).collect();
        let buffers = (nodes, vertices);
        let (mut page, costs) = builder.finished(
            &mut clock,
            (world, numbers),
            laid,
            buffers,
            (&trees, &tops),
            most,
        )?;
        for (trees, costs) in trees.iter_mut().zip(costs) {
            trees.costs = costs;
        }
        let there = first < FirstOnDevice::Instances;
        page.made = Made {
            there,
            // Refits bound on the device.
            trees: (keep && first == FirstOnDevice::Bound).then_some(Refits {
                forests: trees,
                most,
            }),
            seconds: runner.seconds(&clock)?,
        };
        Ok(page)
    }
}

impl TreeBuilder {
    /// For this device.
    pub fn new(device: Arc<Device>) -> Self {
        Self::with_target(device, pace::TARGET)
    }

    /// For this device, which should be at one submission no longer than `target`.
    pub fn with_target(device: Arc<Device>, target: Duration) -> Self {
        Self {
            runner: Runner::new(device, target),
        }
    }

    /// What a stage has submitted by now.
    pub fn submitted(&self, stage: BuildStage) -> Submitted {
        self.runner.submitted(stage)
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.runner.device
    }

    /// A page of `world` or a piece of it in place of this one, whose trees it takes over; none where it is to be built anew.
    fn refit(
        &self,
        page: &mut Page,
        (world, numbers): (&World, &[InWhole]),
        early: Option<&EarlyVertices>,
    ) -> Result<Option<Page>, GpuError> {
        let Some(Refits { forests, most }) = &mut page.made.trees else {
            return Ok(None);
        };
        let most = *most;
        let mut clock = self.runner.clock();
        let mut laid = laid(world, numbers, early)?;
        let now = laid.forests.iter().map(|planted| &planted.forest);
        let same = |(trees, now): (&Trees, &Forest)| trees.forest.is_alike(now);
        if forests.len() != now.len() || !forests.iter().zip(now).all(same) {
            return Ok(None);
        }
        for (trees, planted) in forests.iter_mut().zip(laid.forests.drain(..)) {
            let Planted { forest, places, .. } = planted;
            trees.now_at(self.device(), forest, places);
        }
        let vertices = self.vertices(&mut laid.arrays, most)?;
        let tops = match self.tops(&mut clock, world) {
            Err(Unmade::Failed(error)) => return Err(error),
            Err(Unmade::Deep) => return Ok(None),
            Ok(tops) => tops,
        };
        let nodes = self.nodes(&laid, forests.iter().chain(tops.trees()), most)?;
        for trees in &*forests {
            let vertices = (&vertices[0], &vertices[1]);
            if !trees.rebound(&self.runner, &mut clock, vertices, &nodes)? {
                return Ok(None);
            }
        }
        let buffers = (nodes, vertices);
        let refitted = self.finished(
            &mut clock,
            (world, numbers),
            laid,
            buffers,
            (forests, &tops),
            most,
        );
        let (mut refitted, costs) = match refitted {
            Err(Unmade::Failed(error)) => return Err(error),
            Err(Unmade::Deep) => return Ok(None),
            Ok(refitted) => refitted,
        };
        let mut pairs = forests
            .iter()
            .zip(&costs)
            .flat_map(|(trees, costs)| trees.costs.iter().zip(costs));
        // Also where it is NaN.
        if !pairs.all(|(before, now)| *now <= WORSE * before.max(1.0)) {
            return Ok(None);
        }
        let seconds = self.runner.seconds(&clock)?;
        refitted.made = Made {
            there: true,
            // Nothing fails from here on.
            trees: page.made.trees.take(),
            seconds,
        };
        Ok(Some(refitted))
    }

    /// Makes the tree over the instances of a world.
    fn tops(&self, clock: &mut Clock, world: &World) -> Result<Tops, Unmade> {
        let boxes = world.boxes().into_iter();
        let boxes = boxes.map(|(number, bounds)| (number | LEAF, bounds));
        let (mut moving, mut all): (Vec<_>, Vec<_>) = boxes.partition(|(_, b)| !b.is_static());
        let apart = all.len() as u32;
        if few_move(moving.len(), moving.len() + all.len()) {
            all.extend(common(&moving).map(|bounds| (EMPTY, bounds)));
        } else {
            all.append(&mut moving);
        }
        let mut over = |boxes: &[(u32, LinearBox)]| {
            if boxes.is_empty() {
                return Ok(None);
            }
            let moves = boxes.iter().any(|(_, b)| !b.is_static());
            Trees::over(&self.runner, clock, boxes, moves).map(Some)
        };
        Ok(Tops {
            movers: over(&moving)?,
            all: over(&all)?,
            apart,
        })
    }

    /// Vertices and words.
    fn vertices(&self, arrays: &mut Arrays, most: u64) -> Result<[wgpu::Buffer; 2], GpuError> {
        let device = self.device();
        Ok([
            std::mem::take(&mut arrays.vertices).upload(device, most)?,
            upload(device, most, "grids", cast_slice(&arrays.words))?,
        ])
    }

    /// A buffer for all nodes and blocks.
    fn nodes<'a>(
        &self,
        laid: &Laid<'_>,
        trees: impl Iterator<Item = &'a Trees>,
        most: u64,
    ) -> Result<wgpu::Buffer, GpuError> {
        let device = self.device();
        let units = u64::from(laid.end) + trees.map(units).sum::<u64>();
        if units >= u64::from(MOVES) {
            return Err(too_much());
        }
        let bytes = (units * size_of::<Unit>() as u64).max(64);
        if bytes > most {
            return Err(device.too_large("nodes", bytes, most));
        }
        let usage = Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
        device.buffer("nodes", bytes, usage)
    }

    /// Makes the bounds of nodes; what became of objects is known then, and all is there that rays need. Gives what the
    /// trees of each forest cost.
    fn finished(
        &self,
        clock: &mut Clock,
        (world, numbers): (&World, &[InWhole]),
        laid: Laid<'_>,
        (nodes, [vertices, words]): (wgpu::Buffer, [wgpu::Buffer; 2]),
        (forests, tops): (&[Trees], &Tops),
        most: u64,
    ) -> Result<(Page, Vec<Vec<f32>>), Unmade> {
        let Laid {
            mut arrays,
            end: mut first,
            mut deepest,
            ..
        } = laid;
        let mut refit = |trees: &Trees| {
            let outcomes = trees.refit(&self.runner, clock, &nodes, first);
            first += units(trees) as u32;
            outcomes
        };
        let mut costs = Vec::new();
        for trees in forests {
            let outcomes = refit(trees)?;
            for (&number, outcome) in trees.forest.numbers.iter().zip(&outcomes) {
                let object = &mut arrays.objects[number as usize];
                (object.root, object.radius) = (outcome.root, outcome.radius);
                deepest = deepest.max(outcome.need);
            }
            costs.push(outcomes.iter().map(|outcome| outcome.cost).collect());
        }
        let mut start = Start {
            root: EMPTY,
            need: deepest,
        };
        let mut radius = world.radius();
        for (trees, is_all) in [(&tops.movers, false), (&tops.all, true)] {
            let Some(trees) = trees else {
                continue;
            };
            arrays.time |= trees.forest.moves;
            for outcome in refit(trees)? {
                radius = radius.max(outcome.radius);
                start.need += outcome.need;
                match (is_all, &tops.all) {
                    (false, Some(all)) => all.refer(self.device(), tops.apart, outcome.root),
                    _ => start.root = outcome.root,
                }
            }
        }
        if start.stack().is_err() {
            return Err(Unmade::Deep);
        }
        let buffers = [nodes, vertices, words];
        let page = Page::of(
            self.device(),
            (world, numbers),
            &arrays,
            buffers,
            start,
            most,
        )?;
        Ok((Page { radius, ..page }, costs))
    }
}

impl Tops {
    fn trees(&self) -> impl Iterator<Item = &Trees> {
        self.movers.iter().chain(&self.all)
    }
}

/// Units of all nodes of a forest.
fn units(trees: &Trees) -> u64 {
    u64::from(trees.node_count()) * u64::from(trees.forest.node_units())
}
