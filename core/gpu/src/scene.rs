//! A world as a device sees it: a few flat buffers, laid out as `slabs.wgsl` and `layout.wgsl` say.
//!
//! Trees are made on the device ([`crate::build`]), or are those of the CPU, byte for byte but for references: a child's
//! number becomes its place in the buffer of all nodes, a frame's number its place among the words. Objects that follow a
//! carried space, or have trees for halves of the shutter, get a tree of the plain kind.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DAffine3;
use hdtrapeze_core::bvh::block::Block;
use hdtrapeze_core::bvh::build::NEVER;
use hdtrapeze_core::bvh::node::Lattice8;
use hdtrapeze_core::bvh::object::{Blas, BlockTree, LOOSE};
use hdtrapeze_core::bvh::turn::Turning;
use hdtrapeze_core::bvh::{Bounds8, Node, ObjectGeometry, Tree, U};
use hdtrapeze_core::grid::PlanarMesh;
use hdtrapeze_core::trace::parts::{Parts, Placement, Top};
use hdtrapeze_core::trace::piece::{InWhole, Pick, Trees};
use hdtrapeze_core::trace::{Culled, InstanceSet, Side, World};
use hdtrapeze_shaders::layout::{GridHeader, Instance, Object};
use hdtrapeze_shaders::stage::{BuildStage, STACKS, TracePermutation};

use super::axes::FrameWords;
use super::build::{Maker, Refits};
use super::early::There;
use super::pages::Paints;
use super::stack::{EMPTY, LEAF};
use super::vertices::Vertices;
use super::{Device, GpuError, pages, stack};

/// Units of 16 bytes.
pub(crate) type Unit = [u32; 4];

/// Set in a reference to a node whose bounds move.
pub(crate) const MOVES: u32 = 1 << 30;

/// Largest condition of a transform that is traced in f32: beyond, rays in the object's space say too little.
const LARGEST_CONDITION: f32 = 64.0;

/// What boxes of instances are short by, per unit of distance: rays are carried into objects in f32 here, with the inverse
/// of a matrix found there. Its entries are off by some 10 roundings times the condition, and so is where a ray
/// starts, as seen in the world, by once more the condition; a fixed matrix and a translation are off by less. The world's
/// boxes have room for what core rounds.
const CARRIED_PAD: f32 = 16.0 * U;

/// A world in the memory of a device: on one page, or on several where a binding holds too little.
#[derive(Debug)]
pub struct GpuScene {
    pub(crate) pages: Vec<Page>,
    /// What each page has, where there are several.
    pub(crate) plan: Vec<Vec<Pick>>,
    /// What the plan is made for.
    pub(crate) sets: Vec<SetShape>,
}

/// Instances of a set, and grids of its object.
pub(crate) type SetShape = [usize; 2];

/// What rays are traced through at once.
#[derive(Debug)]
pub(crate) struct Page {
    pub group: [wgpu::Buffer; 6],
    /// What the stage `trace` needs for it.
    pub permutation: TracePermutation,
    pub root: u32,
    pub radius: f32,
    pub pad: f32,
    /// What its instances are of the whole.
    pub numbers: Vec<InWhole>,
    /// Where the numbers of its instances are looked up.
    pub places: u32,
    /// Where the sides of its instances are, where some are passed through.
    pub sides: u32,
    /// Who made its trees.
    pub made: Made,
}

/// What is left of making trees on a device.
#[derive(Debug, Default)]
pub(crate) struct Made {
    /// The device did.
    pub there: bool,
    /// What it needs to refit them, where that was asked for.
    pub trees: Option<Refits>,
    /// The seconds of each stage, where it has a clock.
    pub seconds: Vec<(BuildStage, f64)>,
}

pub(crate) struct Arrays {
    pub nodes: Vec<Unit>,
    pub vertices: Vertices,
    pub words: Vec<u32>,
    pub objects: Vec<Object>,
    instances: Vec<Instance>,
    matrices: Vec<[f32; 4]>,
    /// Where the numbers of instances are among the words, and after them their places; `u32::MAX` where all are there, in order.
    places: u32,
    /// Where the sides of instances are among the words, a word each; `u32::MAX` where rays pass through none.
    sides: u32,
    /// Where the key times that were added last are among the words, the last of all where nothing came after.
    last_times: usize,
    /// Something moves.
    pub time: bool,
}

/// Times that pages are made smaller where trees turned out larger than was told.
const TRIES: u32 = 4;

impl GpuScene {
    /// Lays out `world` and uploads it.
    ///
    /// # Errors
    /// It is larger than the device takes, or holds what a GPU cannot trace.
    pub fn new(device: &Device, world: &World) -> Result<Self, GpuError> {
        Self::with_pages(device, world, u64::MAX)
    }

    /// The same, where no array of a page is larger than so many bytes, nor than the device binds.
    ///
    /// # Errors
    /// As [`GpuScene::new`].
    pub fn with_pages(device: &Device, world: &World, most: u64) -> Result<Self, GpuError> {
        Self::made(&Maker::Host(device), world, most, &Paints::default())
    }

    pub(crate) fn made(
        maker: &Maker<'_>,
        world: &World,
        most: u64,
        paints: &Paints,
    ) -> Result<Self, GpuError> {
        traceable(world)?;
        let parts = world.parts();
        if maker.trees() == Trees::Now {
            world.make_trees(&NEVER);
        }
        let mut most = most.min(maker.device().largest());
        for _ in 1..TRIES {
            match Self::planned(maker, &parts, most, paints) {
                Err(GpuError::TooLarge { .. }) => most /= 2,
                made => return made,
            }
        }
        Self::planned(maker, &parts, most, paints)
    }

    fn planned(
        maker: &Maker<'_>,
        parts: &Parts<'_>,
        most: u64,
        paints: &Paints,
    ) -> Result<Self, GpuError> {
        let plan = pages::plan(parts, most, maker.trees(), paints);
        if let Some(early) = maker.early() {
            let sets: Vec<_> = parts.sets().collect();
            let cut = plan.iter().flatten().filter(|pick| pick.grids.is_some());
            cut.for_each(|pick| early.forget(sets[pick.set].object()));
        }
        let device = maker.device();
        // What is uploaded is kept on the host until the device has taken it: that of two pages, no more.
        let mut on_its_way = None;
        let mut page = |world: &World, numbers: &[InWhole]| {
            let page = maker.page(world, numbers, most)?;
            if let Some(before) = on_its_way.replace(device.queue.submit([])) {
                device.wait(before)?;
            }
            Ok::<_, GpuError>(page)
        };
        let mut pages = Vec::with_capacity(plan.len());
        if plan.len() == 1 {
            pages.push(page(parts.world(), &all(parts.world()))?);
        } else {
            let cut = |number: usize| {
                let picks = plan.get(number);
                picks
                    .map(|picks| parts.piece(picks, maker.trees()))
                    .transpose()
            };
            let mut next = cut(0)?;
            while let Some(piece) = next {
                // The next is cut out of the world while this one is laid out and goes to the device.
                let number = pages.len() + 1;
                let (made, following) =
                    rayon::join(|| page(&piece.world, &piece.numbers), || cut(number));
                pages.push(made?);
                // There may be room for it once this one is gone.
                drop(piece);
                next = following.or_else(|_| cut(number))?;
            }
        }
        if let Some(last) = on_its_way {
            device.wait(last)?;
        }
        device.check()?;
        let one = pages.len() == 1;
        Ok(Self {
            pages,
            plan: if one { Vec::new() } else { plan },
            sets: shapes(parts),
        })
    }

    /// Pages that rays are traced through, one after the other.
    pub fn page_count(&self) -> usize {
        self.pages.len()
    }

    /// True where the device made all trees.
    pub fn has_own_trees(&self) -> bool {
        self.pages.iter().all(|page| page.made.there)
    }

    /// Bytes of its trees, vertices and instances on the device, without how they look.
    pub fn bytes(&self) -> u64 {
        let buffers = self.pages.iter().flat_map(|page| &page.group);
        buffers.map(wgpu::Buffer::size).sum()
    }
}

/// Of each set what plans depend on.
pub(crate) fn shapes(parts: &Parts<'_>) -> Vec<SetShape> {
    let shape = |set: &Arc<InstanceSet>| [set.len(), set.object().mesh().grids.len()];
    parts.sets().map(shape).collect()
}

/// What a GPU cannot trace is refused.
pub(crate) fn traceable(world: &World) -> Result<(), GpuError> {
    let condition = world.condition();
    if condition > LARGEST_CONDITION {
        // A plane that is flattened n times has a condition of about n times the root of 2.
        let times = condition * std::f32::consts::FRAC_1_SQRT_2;
        let what = format!("instances that are flattened some {times:.0} times");
        return Err(GpuError::Unsupported(what));
    }
    let instances = 0..world.instance_count() as u32;
    let mut culled = instances.filter_map(|instance| world.parts().culled(instance));
    if culled.any(|culled| culled.always().is_none()) {
        let what = "sides that rays pass through and that turn over while the shutter is open";
        return Err(GpuError::Unsupported(what.to_owned()));
    }
    if world.parts().sets().any(|set| set.made().is_none()) {
        let what = "what is diced when rays first come near it".to_owned();
        return Err(GpuError::Unsupported(what));
    }
    Ok(())
}

/// The numbers of all instances of a world that is on one page.
pub(crate) fn all(world: &World) -> Vec<InWhole> {
    let numbers = 0..world.instance_count() as u32;
    let whole = numbers.map(|instance| InWhole {
        instance,
        grids: None,
    });
    whole.collect()
}

/// Where a walk begins, and the entries of the stack that it needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Start {
    pub root: u32,
    pub need: u32,
}

impl Start {
    /// The size of the stack that is compiled for it.
    pub fn stack(&self) -> Result<u32, GpuError> {
        let stack = STACKS.into_iter().find(|&stack| stack >= self.need);
        stack.ok_or_else(|| {
            GpuError::Unsupported(format!("trees that are {} entries deep", self.need))
        })
    }
}

impl Page {
    /// Lays out a world or a piece of one, with the CPU's trees. `numbers` tell what each instance is of the whole.
    pub(crate) fn new(
        device: &Device,
        world: &World,
        numbers: &[InWhole],
        most: u64,
    ) -> Result<Self, GpuError> {
        world.make_trees(&NEVER);
        let mut arrays = Arrays::new();
        let parts = world.parts();
        let mut deepest = 0;
        arrays.instances(&parts, numbers, |arrays, object, grids| {
            deepest = deepest.max(arrays.object(object, grids)?);
            Ok(())
        })?;
        let Start { root, need } = arrays.top(&parts);
        let need = deepest + need;
        let start = Start { root, need };
        start.stack()?;
        if arrays.nodes.len() >= MOVES as usize || u32::try_from(arrays.vertices.len()).is_err() {
            let what = "more than 2^30 units of nodes or 2^32 coordinates".to_owned();
            return Err(GpuError::Unsupported(what));
        }
        let trees = [
            upload(device, most, "nodes", bytemuck::cast_slice(&arrays.nodes))?,
            std::mem::take(&mut arrays.vertices).upload(device, most)?,
            upload(device, most, "grids", bytemuck::cast_slice(&arrays.words))?,
        ];
        Self::of(device, (world, numbers), &arrays, trees, start, most)
    }

    /// Uploads the rest of a world whose nodes, vertices and grids are there.
    pub(crate) fn of(
        device: &Device,
        (world, numbers): (&World, &[InWhole]),
        arrays: &Arrays,
        [nodes, vertices, words]: [wgpu::Buffer; 3],
        start: Start,
        most: u64,
    ) -> Result<Self, GpuError> {
        let objects = bytemuck::cast_slice(&arrays.objects);
        let instances = bytemuck::cast_slice(&arrays.instances);
        let matrices = bytemuck::cast_slice(&arrays.matrices);
        let group = [
            nodes,
            vertices,
            words,
            upload(device, most, "objects", objects)?,
            upload(device, most, "instances", instances)?,
            upload(device, most, "matrices", matrices)?,
        ];
        let condition = world.condition();
        Ok(Self {
            group,
            permutation: TracePermutation {
                time: arrays.time,
                stack: start.stack()?,
                any: false,
                counts: false,
                layers: false,
                culls: arrays.sides != EMPTY,
            },
            root: start.root,
            radius: world.radius(),
            pad: CARRIED_PAD * condition * condition,
            numbers: numbers.to_vec(),
            places: arrays.places,
            sides: arrays.sides,
            made: Made::default(),
        })
    }

    /// Its instances, and where stages behind `trace` look their numbers up.
    pub fn instances(&self) -> [u32; 2] {
        [self.numbers.len() as u32, self.places]
    }
}

/// An array of a page, no larger than `most` bytes.
pub(crate) fn upload(
    device: &Device,
    most: u64,
    what: &'static str,
    bytes: &[u8],
) -> Result<wgpu::Buffer, GpuError> {
    match bytes.len() as u64 > most {
        true => Err(device.too_large(what, bytes.len() as u64, most)),
        false => device.upload(what, bytes),
    }
}

impl Arrays {
    pub fn new() -> Self {
        Self {
            nodes: Vec::new(),
            vertices: Vertices::default(),
            // Place 0 is the identity's frame.
            words: vec![0],
            objects: Vec::new(),
            instances: Vec::new(),
            matrices: Vec::new(),
            places: EMPTY,
            sides: EMPTY,
            last_times: 0,
            time: false,
        }
    }

    /// Adds all instances, and the object of each, once, by `add`, which is told the numbers of its grids in the whole,
    /// where they are not all there.
    pub fn instances<'w>(
        &mut self,
        parts: &Parts<'w>,
        numbers: &[InWhole],
        mut add: impl FnMut(&mut Self, &'w ObjectGeometry, Option<&[u32]>) -> Result<(), GpuError>,
    ) -> Result<(), GpuError> {
        let mut known: HashMap<*const ObjectGeometry, u32> = HashMap::new();
        let objects = parts.sets().flat_map(|set| {
            let object = set.object();
            (0..set.len()).map(move |_| object)
        });
        for ((i, object), whole) in (0..).zip(objects).zip(numbers) {
            let place = match known.get(&Arc::as_ptr(object)) {
                Some(&known) => known,
                None => {
                    let place = self.objects.len() as u32;
                    add(self, object, whole.grids.as_deref())?;
                    known.insert(Arc::as_ptr(object), place);
                    place
                }
            };
            self.instance(whole.instance, place, &parts.placement(i));
        }
        self.look_up(numbers);
        self.hide_sides(parts, numbers.len() as u32);
        Ok(())
    }

    /// Adds which side of each instance rays pass through, where there are some: as sides_some.wgsl has it.
    fn hide_sides(&mut self, parts: &Parts<'_>, count: u32) {
        let sides = (0..count).map(|instance| parts.culled(instance).and_then(Culled::always));
        if sides.clone().all(|side| side.is_none()) {
            return;
        }
        self.sides = self.words.len() as u32;
        self.words.extend(sides.map(|side| match side {
            None => 0,
            Some(Side::Front) => 1,
            Some(Side::Back) => 2,
        }));
        // Times that follow are not shared with what came before.
        self.last_times = self.words.len();
    }

    /// Adds the numbers that instances have in the whole, where those are not their places.
    fn look_up(&mut self, numbers: &[InWhole]) {
        let is_at =
            |(place, number): (u32, &InWhole)| number.instance == place && number.grids.is_none();
        if (0..).zip(numbers).all(is_at) {
            return;
        }
        self.places = self.words.len() as u32;
        let mut order: Vec<u32> = (0..numbers.len() as u32).collect();
        order.sort_by_key(|&place| numbers[place as usize].instance);
        let number = |&place: &u32| numbers[place as usize].instance;
        self.words.extend(order.iter().map(number));
        self.words.extend(order);
        // Times that follow are not shared with what came before.
        self.last_times = self.words.len();
    }

    /// Adds an object; gives the entries of the stack that its tree needs.
    pub fn object(
        &mut self,
        object: &ObjectGeometry,
        grids: Option<&[u32]>,
    ) -> Result<u32, GpuError> {
        let plain;
        let object = match object.blas() {
            Blas::Relative(_) => {
                plain = object.made_plain();
                &plain
            }
            _ => object,
        };
        let (root, need) = match object.blas() {
            Blas::Static(blocks) => self.blocks(blocks),
            Blas::Moving(blocks) => self.blocks(blocks),
            Blas::Relative(_) => {
                let what = "a tree in a space that moves along".to_owned();
                return Err(GpuError::Unsupported(what));
            }
        };
        self.mesh((object.mesh(), None), grids, root, object.radius());
        Ok(need)
    }

    /// Adds the grids and vertices of an object, which may be on the device. `in_whole` are the numbers of its grids, where some
    /// are elsewhere.
    pub fn mesh(
        &mut self,
        (mesh, there): (&PlanarMesh, Option<There>),
        in_whole: Option<&[u32]>,
        root: u32,
        radius: f32,
    ) {
        self.time |= mesh.is_moving();
        let grids = self.words.len() as u32;
        for grid in &mesh.grids {
            let header = GridHeader {
                first_vertex: grid.first_vertex,
                rates: u32::from(grid.nu) | u32::from(grid.nv) << 16,
            };
            self.words.extend(bytemuck::cast::<_, [u32; 2]>(header));
        }
        let mut numbers = EMPTY;
        if let Some(in_whole) = in_whole {
            numbers = self.words.len() as u32;
            self.words.extend_from_slice(in_whole);
        }
        let key_times = self.key_times(&mesh.key_times);
        self.objects.push(Object {
            root,
            grids,
            vertices: self.vertices.len() as u32,
            key_times,
            key_count: mesh.key_count() as u32,
            radius,
            numbers,
            grid_count: mesh.grids.len() as u32,
        });
        self.vertices.add(mesh, there);
    }

    /// Adds key times, which instances of a set share.
    fn key_times(&mut self, times: &[f32]) -> u32 {
        let words = times.iter().map(|time| time.to_bits());
        if self.words[self.last_times..]
            .iter()
            .copied()
            .eq(words.clone())
        {
            return self.last_times as u32;
        }
        self.last_times = self.words.len();
        self.words.extend(words);
        self.last_times as u32
    }

    /// Adds the instance that has this number in the whole, of object `object`.
    fn instance(&mut self, number: u32, object: u32, placement: &Placement) {
        let mut out = Instance {
            number,
            object,
            matrices: self.matrices.len() as u32,
            ..Instance::default()
        };
        let affine = |m: &DAffine3| {
            let [x, y, z, t] = m.to_cols_array_2d().map(|c| c.map(|x| x as f32));
            [0, 1, 2].map(|i| {
                let column = [x, y, z][i];
                [column[0], column[1], column[2], t[i]]
            })
        };
        match placement {
            Placement::Translated(by) => {
                let [x, y, z] = by.as_vec3().to_array();
                self.matrices.push([x, y, z, 0.0]);
            }
            Placement::Fixed { inverse, origin } => {
                let m = DAffine3 {
                    matrix3: *inverse,
                    translation: *origin,
                };
                self.matrices.extend(affine(&m));
                out.key_count = 1;
            }
            Placement::Moving {
                key_times,
                matrices,
            } => {
                self.matrices.extend(matrices.iter().flat_map(affine));
                out.key_times = self.key_times(key_times);
                out.key_count = key_times.len() as u32;
                self.time = true;
            }
        }
        self.instances.push(out);
    }

    /// Adds the tree over instances.
    pub fn top(&mut self, parts: &Parts<'_>) -> Start {
        match parts.top() {
            Top::Moving(tree) => {
                self.time = true;
                Start {
                    root: self.tree(tree, |item| item | LEAF),
                    need: stack::need(tree, |_| 0),
                }
            }
            Top::Static { tree, movers } => {
                let moving = self.tree(movers, |item| item | LEAF);
                self.time |= moving != EMPTY;
                let moving_need = stack::need(movers, |_| 0);
                let leaf = |item: u32| match item {
                    Parts::MOVERS => moving,
                    _ => item | LEAF,
                };
                let need = |item: u32| match item {
                    Parts::MOVERS => moving_need,
                    _ => 0,
                };
                Start {
                    root: self.tree(tree, leaf),
                    need: stack::need(tree, need),
                }
            }
        }
    }

    /// Adds the tree of an object, with its blocks.
    fn blocks<B: Bounds8>(&mut self, blocks: &BlockTree<B>) -> (u32, u32) {
        let first_block = self.nodes.len() as u32;
        let per_block = units(block_words::<B>());
        let frames = self.frames(&blocks.tree.frames);
        let of_blocks = self.frames(&blocks.frames);
        for block in &blocks.blocks {
            let frame = of_blocks[block.frame as usize];
            self.nodes.extend(block_of(block, frame));
        }
        let leaf = |item: u32| match item & LOOSE {
            0 => LEAF | (first_block + item * per_block),
            _ => LEAF | item,
        };
        let root = self.tree_with(&blocks.tree, &frames, leaf);
        (root, stack::need(&blocks.tree, |_| 0))
    }

    fn tree<B: Bounds8>(&mut self, tree: &Tree<B>, leaf: impl Fn(u32) -> u32) -> u32 {
        let frames = self.frames(&tree.frames);
        self.tree_with(tree, &frames, leaf)
    }

    /// Adds frames; gives the place of each, 0 for the identity.
    fn frames<T: Turning>(&mut self, frames: &[T]) -> Vec<u32> {
        let mut places = vec![0; frames.len().max(1)];
        for (place, frame) in places.iter_mut().zip(frames).skip(1) {
            let own = FrameWords::of(frame);
            *place = own.placed(self.words.len() as u32);
            self.words.extend_from_slice(own.words());
        }
        places
    }

    /// Adds the nodes of a tree; `leaf` makes references of items. Gives that of the root.
    fn tree_with<B: Bounds8>(
        &mut self,
        tree: &Tree<B>,
        frames: &[u32],
        leaf: impl Fn(u32) -> u32,
    ) -> u32 {
        let first = self.nodes.len() as u32;
        let per_node = units(node_words::<B>());
        let kind = if B::MOVING { MOVES } else { 0 };
        // A child is never empty: the last item, which stands for all that move, has the same number.
        let reference = |child: u32| match child & LEAF {
            0 => kind | (first + child * per_node),
            _ => leaf(child & !LEAF),
        };
        for node in &tree.nodes {
            self.node(node, frames, &reference);
        }
        match tree.root {
            EMPTY => EMPTY,
            root => reference(root),
        }
    }

    fn node<B: Bounds8>(
        &mut self,
        node: &Node<B>,
        frames: &[u32],
        reference: &impl Fn(u32) -> u32,
    ) {
        let mut words = lattices(&node.bounds);
        for (slot, &child) in node.children.iter().enumerate() {
            let valid = node.slots >> slot & 1 != 0;
            words.push(if valid { reference(child) } else { EMPTY });
        }
        words.push(frames[node.frame as usize]);
        words.push(node.valid());
        self.nodes.extend(in_units(words));
    }
}

/// A block, whose frame has this place among the words.
pub(crate) fn block_of<B: Bounds8>(block: &Block<B>, frame: u32) -> Vec<Unit> {
    let span = &block.span;
    let rect = span.rect;
    let mut words = lattices(&block.bounds);
    words.push(span.grid);
    words.push(u32::from_le_bytes([rect.i, rect.j, rect.w, rect.h]));
    let [w, h] = span.group;
    words.push(u32::from_le_bytes([w, h, span.columns, span.count]));
    words.push(frame);
    in_units(words)
}

fn in_units(mut words: Vec<u32>) -> Vec<Unit> {
    words.resize(words.len().next_multiple_of(4), 0);
    let (units, _) = words.as_chunks::<4>();
    units.to_vec()
}

/// Words of the lattices of a node or block.
fn lattice_words<B: Bounds8>() -> u32 {
    if B::MOVING { 36 } else { 18 }
}

/// Words of a block.
pub(crate) fn block_words<B: Bounds8>() -> u32 {
    lattice_words::<B>() + 4
}

/// Words of a node.
pub(crate) fn node_words<B: Bounds8>() -> u32 {
    lattice_words::<B>() + 10
}

fn units(words: u32) -> u32 {
    words.div_ceil(4)
}

fn lattices<B: Bounds8>(bounds: &B) -> Vec<u32> {
    let mut words = Vec::with_capacity(48);
    lattice(bounds.start(), &mut words);
    if B::MOVING {
        lattice(bounds.end(), &mut words);
    }
    words
}

fn lattice(lattice: &Lattice8, words: &mut Vec<u32>) {
    words.extend(lattice.origin().map(f32::to_bits));
    words.extend(lattice.step().map(f32::to_bits));
    for bytes in lattice.planes.iter().flatten() {
        words.extend_from_slice(&bytemuck::cast::<[u8; 8], [u32; 2]>(*bytes));
    }
}
