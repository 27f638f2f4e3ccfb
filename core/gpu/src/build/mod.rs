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
//! **Where trees differ from core's.** They are not in a carried space nor turned along strands, no block is halved, and
//! all strips are loose. Blocks are turned along their lattices, as core's.
//!
//! **Moved vertices.** Where only vertices have changed, [`GpuScene::refit`] bounds all anew and keeps the shape of trees.
//!
//! A tree that needs a deeper stack than there is (boxes inside boxes, mostly) is made on the CPU instead.

pub(crate) mod forest;
mod kernels;
mod trees;

use std::sync::Arc;

use bytemuck::cast_slice;
use hdtrapeze_core::bvh::Tree;
use hdtrapeze_core::trace::World;
use hdtrapeze_shaders::layout::BuildOutcome;
use hdtrapeze_shaders::stage::BuildStage;
use wgpu::BufferUsages as Usage;

use super::scene::{self, Arrays, MOVES, Made, Page, Start, Unit, upload};
use super::{Device, GpuError, GpuScene};
use forest::Forest;
use kernels::{Clock, Kernels};
use trees::{Places, Unmade};

pub(crate) use trees::Trees;

/// Makes trees on a device. Pipelines are compiled once for each permutation.
#[derive(Debug)]
pub struct TreeBuilder {
    kernels: Kernels,
}

/// The first stage that runs on the device; those before it run on the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FirstOnDevice {
    /// Bounds, and all that follows.
    #[default]
    Bound,
    /// Only rays are traced there, through the CPU's trees.
    Trace,
}

/// How a scene is made.
#[derive(Clone, Copy, Debug)]
pub struct BuildOptions {
    /// Where the CPU's part ends.
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
    /// The device; what is needed to refit them is kept, or not.
    Device(&'a TreeBuilder, bool),
}

impl Maker<'_> {
    pub fn device(&self) -> &Device {
        match self {
            Maker::Host(device) => device,
            Maker::Device(builder, _) => builder.device(),
        }
    }

    /// Lays out a page; see [`Page::new`].
    pub fn page(&self, world: &World, numbers: &[(u32, u32)], most: u64) -> Result<Page, GpuError> {
        if let Maker::Device(builder, keep) = self {
            match builder.page(world, numbers, most, *keep) {
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
        let maker = match options.first {
            FirstOnDevice::Bound => Maker::Device(builder, options.refits),
            FirstOnDevice::Trace => Maker::Host(builder.device()),
        };
        Self::made(&maker, world, options.most)
    }

    /// Takes over `world`, whose vertices, matrices and key times may differ from those that the scene was made of, but not its
    /// grids. False where they do, where nothing was kept to refit, or where other grids than before cannot be traced:
    /// the scene is then as it was, and is to be built anew.
    ///
    /// # Errors
    /// As [`GpuScene::new`].
    pub fn refit(&mut self, builder: &TreeBuilder, world: &World) -> Result<bool, GpuError> {
        scene::traceable(world)?;
        let [page] = &mut self.pages[..] else {
            return Ok(false);
        };
        builder.refit(page, world)
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

/// A world laid out, and the forests whose trees are to be made.
struct Laid {
    arrays: Arrays,
    forests: Vec<(Forest, Places)>,
    start: Start,
    /// The first unit after all blocks.
    end: u32,
}

/// The tree over instances is made by the CPU, and stands before all blocks. Another world's may be larger by a quarter.
fn room(top: usize) -> usize {
    top + top / 4
}

fn too_much() -> GpuError {
    GpuError::Unsupported("more than 2^30 units of nodes or 2^32 coordinates".to_owned())
}

/// Lays out a world; blocks begin at place `first`, where that is known and there is room.
fn laid(world: &World, numbers: &[(u32, u32)], first: Option<usize>) -> Result<Laid, GpuError> {
    let mut arrays = Arrays::new();
    let parts = world.parts();
    let mut forests = [false, true].map(|moves| Forest {
        moves,
        ..Forest::default()
    });
    arrays.instances(&parts, numbers, |arrays, object, first_grid| {
        let (mesh, number) = (object.mesh(), arrays.objects.len());
        arrays.mesh(mesh, first_grid, Tree::<()>::EMPTY, 0.0);
        let forest = &mut forests[usize::from(mesh.is_moving())];
        match forest.add(mesh, number as u32, &arrays.objects[number]) {
            true => Ok(()),
            false => Err(too_much()),
        }
    })?;
    let start = arrays.top(&parts);
    let top = arrays.nodes.len();
    let first = first.unwrap_or_else(|| room(top)).max(top);
    arrays.nodes.resize(first, [0; 4]);
    let mut end = arrays.nodes.len() as u64;
    let mut placed = Vec::new();
    for forest in forests.into_iter().filter(|forest| forest.items > 0) {
        let places = Places {
            blocks: end as u32,
            frames: arrays.words.len() as u32,
        };
        end += u64::from(forest.block_units()) * u64::from(forest.blocks);
        let frames = 9 * forest.blocks as usize;
        arrays.words.resize(arrays.words.len() + frames, 0);
        placed.push((forest, places));
    }
    let lengths = [arrays.planes.len(), arrays.words.len()];
    if end >= u64::from(MOVES) || lengths.iter().any(|&n| u32::try_from(n).is_err()) {
        return Err(too_much());
    }
    Ok(Laid {
        arrays,
        forests: placed,
        start,
        end: end as u32,
    })
}

impl TreeBuilder {
    /// For this device.
    pub fn new(device: Arc<Device>) -> Self {
        Self {
            kernels: Kernels::new(device),
        }
    }

    /// The device.
    pub fn device(&self) -> &Arc<Device> {
        &self.kernels.device
    }

    fn page(
        &self,
        world: &World,
        numbers: &[(u32, u32)],
        most: u64,
        keep: bool,
    ) -> Result<Page, Unmade> {
        let device = self.device();
        let mut clock = self.kernels.clock();
        let mut laid = laid(world, numbers, None)?;
        let vertices = self.vertices(&laid.arrays, most)?;
        let mut made = Vec::new();
        for (forest, places) in std::mem::take(&mut laid.forests) {
            let vertices = (&vertices[0], &vertices[1]);
            made.push(Trees::new(
                &self.kernels,
                &mut clock,
                forest,
                places,
                vertices,
            )?);
        }
        let trees = made.iter().map(|(trees, _)| trees);
        let nodes = self.nodes(&laid, trees, most)?;
        let mut encoder = device.device.create_command_encoder(&Default::default());
        for (trees, blocks) in &made {
            let unit = size_of::<Unit>() as u64;
            let count = trees.forest.blocks * trees.forest.block_units();
            let (to, bytes) = (u64::from(trees.places.blocks), u64::from(count) * unit);
            encoder.copy_buffer_to_buffer(blocks, 0, &nodes, to * unit, bytes);
        }
        device.queue.submit([encoder.finish()]);
        let trees: Vec<Trees> = made.into_iter().map(|(trees, _)| trees).collect();
        let mut page = self.finished(&mut clock, world, laid, (nodes, vertices), &trees, most)?;
        page.made = Made {
            trees: if keep { trees } else { Vec::new() },
            seconds: self.kernels.seconds(&clock)?,
        };
        Ok(page)
    }

    fn refit(&self, page: &mut Page, world: &World) -> Result<bool, GpuError> {
        let trees = &page.made.trees;
        let Some(first) = trees.first().map(|trees| trees.places.blocks as usize) else {
            return Ok(false);
        };
        let most = self.device().largest();
        let mut clock = self.kernels.clock();
        let laid = laid(world, &scene::all(world), Some(first))?;
        let of_trees = trees.iter().map(|trees| (&trees.forest, &trees.places));
        if !of_trees.eq(laid.forests.iter().map(|(forest, places)| (forest, places))) {
            return Ok(false);
        }
        let vertices = self.vertices(&laid.arrays, most)?;
        let nodes = self.nodes(&laid, trees.iter(), most)?;
        for trees in trees {
            let vertices = (&vertices[0], &vertices[1]);
            if !trees.rebound(&self.kernels, &mut clock, vertices, &nodes)? {
                return Ok(false);
            }
        }
        let refitted = self.finished(&mut clock, world, laid, (nodes, vertices), trees, most);
        let mut refitted = match refitted {
            Err(Unmade::Failed(error)) => return Err(error),
            Err(Unmade::Deep) => return Ok(false),
            Ok(refitted) => refitted,
        };
        refitted.made = Made {
            trees: std::mem::take(&mut page.made.trees),
            seconds: self.kernels.seconds(&clock)?,
        };
        *page = refitted;
        Ok(true)
    }

    /// Vertices and words.
    fn vertices(&self, arrays: &Arrays, most: u64) -> Result<[wgpu::Buffer; 2], GpuError> {
        let device = self.device();
        Ok([
            upload(device, most, "vertices", cast_slice(&arrays.planes))?,
            upload(device, most, "grids", cast_slice(&arrays.words))?,
        ])
    }

    /// A buffer for all nodes and blocks; the tree over instances is in it.
    fn nodes<'a>(
        &self,
        laid: &Laid,
        trees: impl Iterator<Item = &'a Trees>,
        most: u64,
    ) -> Result<wgpu::Buffer, GpuError> {
        let device = self.device();
        let nodes =
            trees.map(|trees| u64::from(trees.node_count()) * u64::from(trees.forest.node_units()));
        let units = u64::from(laid.end) + nodes.sum::<u64>();
        if units >= u64::from(MOVES) {
            return Err(too_much());
        }
        let bytes = (units * size_of::<Unit>() as u64).max(64);
        if bytes > most {
            return Err(device.too_large("nodes", bytes, most));
        }
        let usage = Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
        let buffer = device.buffer("nodes", bytes, usage)?;
        let top = cast_slice(&laid.arrays.nodes);
        device.queue.write_buffer(&buffer, 0, top);
        Ok(buffer)
    }

    /// Makes the bounds of nodes; what became of objects is known then, and all is there that rays need.
    fn finished(
        &self,
        clock: &mut Clock,
        world: &World,
        laid: Laid,
        (nodes, [planes, words]): (wgpu::Buffer, [wgpu::Buffer; 2]),
        trees: &[Trees],
        most: u64,
    ) -> Result<Page, Unmade> {
        let Laid {
            mut arrays,
            start,
            end: mut first,
            ..
        } = laid;
        let mut deepest = 0;
        for trees in trees {
            let outcomes = trees.refit(&self.kernels, clock, &nodes, first)?;
            for (&number, outcome) in trees.forest.numbers.iter().zip(outcomes) {
                let BuildOutcome { root, need, radius } = outcome;
                let object = &mut arrays.objects[number as usize];
                (object.root, object.radius) = (root, radius);
                deepest = deepest.max(need);
            }
            first += trees.node_count() * trees.forest.node_units();
        }
        let start = Start {
            need: start.need + deepest,
            ..start
        };
        if start.stack().is_err() {
            return Err(Unmade::Deep);
        }
        let buffers = [nodes, planes, words];
        Ok(Page::of(
            self.device(),
            world,
            &arrays,
            buffers,
            start,
            most,
        )?)
    }
}
