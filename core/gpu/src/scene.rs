//! A world as a device sees it: a few flat buffers, laid out as `slabs.wgsl` and `layout.wgsl` say.
//!
//! Trees are those of the CPU, byte for byte but for references: a child's number becomes its place in the buffer
//! of all nodes, a frame's number its place among the words. Objects that follow a carried space, or have trees for halves of
//! the shutter, get a tree of the plain kind.

use std::collections::HashMap;
use std::sync::Arc;

use glam::DAffine3;
use hdtrapeze_core::bvh::block::Block;
use hdtrapeze_core::bvh::node::Lattice8;
use hdtrapeze_core::bvh::object::{Blas, BlockTree, LOOSE};
use hdtrapeze_core::bvh::{Bounds8, Frame, Node, ObjectGeometry, Tree, U};
use hdtrapeze_core::trace::World;
use hdtrapeze_core::trace::parts::{Parts, Placement, Top};
use hdtrapeze_shaders::layout::{GridHeader, Instance, Object};
use hdtrapeze_shaders::stage::{STACKS, TracePermutation};

use super::stack;
use super::{Device, GpuError};

/// Units of 16 bytes.
type Unit = [u32; 4];

const LEAF: u32 = Tree::<()>::LEAF;
const EMPTY: u32 = Tree::<()>::EMPTY;
/// Set in a reference to a node whose bounds move.
const MOVES: u32 = 1 << 30;

/// Largest condition of a transform that is traced in f32: beyond, rays in the object's space say too little.
const LARGEST_CONDITION: f32 = 64.0;

/// What boxes of instances are short by, per unit of distance: rays are carried into objects in f32 here, with the inverse
/// of a matrix found there. Its entries are off by some 10 roundings times the condition, and so is where a ray
/// starts, as seen in the world, by once more the condition; a fixed matrix and a translation are off by less. The world's
/// boxes have room for what core rounds.
const CARRIED_PAD: f32 = 16.0 * U;

/// A world in the memory of a device.
#[derive(Debug)]
pub struct GpuScene {
    pub(crate) group: [wgpu::Buffer; 6],
    /// What the stage `trace` needs for it.
    pub permutation: TracePermutation,
    pub(crate) root: u32,
    pub(crate) radius: f32,
    pub(crate) pad: f32,
    /// Bytes on the device.
    pub bytes: u64,
}

#[derive(Default)]
struct Arrays {
    nodes: Vec<Unit>,
    planes: Vec<f32>,
    words: Vec<u32>,
    objects: Vec<Object>,
    instances: Vec<Instance>,
    matrices: Vec<[f32; 4]>,
    /// Something moves.
    time: bool,
}

impl GpuScene {
    /// Lays out `world` and uploads it.
    ///
    /// # Errors
    /// It is larger than the device takes, or holds what a GPU cannot trace.
    pub fn new(device: &Device, world: &World) -> Result<Self, GpuError> {
        let condition = world.condition();
        if condition > LARGEST_CONDITION {
            let what = format!("instances that are flattened as far as {condition}");
            return Err(GpuError::Unsupported(what));
        }
        let mut arrays = Arrays {
            // Place 0 of the words is the identity's frame.
            words: vec![0],
            ..Arrays::default()
        };
        let parts = world.parts();
        let mut known: HashMap<*const ObjectGeometry, (u32, u32)> = HashMap::new();
        let mut deepest = 0;
        for (i, object) in parts.objects().enumerate() {
            let Some(object) = object else {
                let what = "what is diced when rays first come near it".to_owned();
                return Err(GpuError::Unsupported(what));
            };
            let (number, need) = match known.get(&Arc::as_ptr(object)) {
                Some(&known) => known,
                None => {
                    let made = (arrays.objects.len() as u32, arrays.object(object)?);
                    known.insert(Arc::as_ptr(object), made);
                    made
                }
            };
            deepest = deepest.max(need);
            arrays.instance(number, &parts.placement(i as u32));
        }
        let (root, top_need) = arrays.top(&parts)?;
        let need = deepest + top_need;
        let stack = STACKS.into_iter().find(|&stack| stack >= need);
        let Some(stack) = stack else {
            let what = format!("trees that are {need} entries deep");
            return Err(GpuError::Unsupported(what));
        };
        if arrays.nodes.len() >= MOVES as usize || u32::try_from(arrays.planes.len()).is_err() {
            let what = "more than 2^30 units of nodes or 2^32 coordinates".to_owned();
            return Err(GpuError::Unsupported(what));
        }
        let group = [
            device.upload("nodes", bytemuck::cast_slice(&arrays.nodes))?,
            device.upload("vertices", bytemuck::cast_slice(&arrays.planes))?,
            device.upload("grids", bytemuck::cast_slice(&arrays.words))?,
            device.upload("objects", bytemuck::cast_slice(&arrays.objects))?,
            device.upload("instances", bytemuck::cast_slice(&arrays.instances))?,
            device.upload("matrices", bytemuck::cast_slice(&arrays.matrices))?,
        ];
        device.check()?;
        Ok(Self {
            bytes: group.iter().map(wgpu::Buffer::size).sum(),
            group,
            permutation: TracePermutation {
                time: arrays.time,
                stack,
                counts: false,
            },
            root,
            radius: world.radius(),
            pad: CARRIED_PAD * condition * condition,
        })
    }
}

impl Arrays {
    /// Adds an object; gives the entries of the stack that its tree needs.
    fn object(&mut self, object: &ObjectGeometry) -> Result<u32, GpuError> {
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
        let mesh = object.mesh();
        self.time |= mesh.is_moving();
        let grids = self.words.len() as u32;
        for grid in &mesh.grids {
            let header = GridHeader {
                first_vertex: grid.first_vertex,
                element: grid.element,
                rates: u32::from(grid.nu) | u32::from(grid.nv) << 16,
            };
            self.words.extend(bytemuck::cast::<_, [u32; 3]>(header));
        }
        let key_times = self.key_times(&mesh.key_times);
        self.objects.push(Object {
            root,
            grids,
            planes: self.planes.len() as u32,
            key_times,
            key_count: mesh.key_count() as u32,
            radius: object.radius(),
        });
        self.planes.extend_from_slice(mesh.planes());
        Ok(need)
    }

    fn key_times(&mut self, times: &[f32]) -> u32 {
        let first = self.words.len() as u32;
        self.words.extend(times.iter().map(|time| time.to_bits()));
        first
    }

    /// Adds an instance of object `object`.
    fn instance(&mut self, object: u32, placement: &Placement) {
        let mut out = Instance {
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

    /// Adds the tree over instances; gives its root, and the entries of the stack that it needs.
    fn top(&mut self, parts: &Parts<'_>) -> Result<(u32, u32), GpuError> {
        match parts.top() {
            Top::Moving(tree) => {
                self.time = true;
                Ok((
                    self.tree(tree, |item| item | LEAF),
                    stack::need(tree, |_| 0),
                ))
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
                Ok((self.tree(tree, leaf), stack::need(tree, need)))
            }
        }
    }

    /// Adds the tree of an object, with its blocks.
    fn blocks<B: Bounds8>(&mut self, blocks: &BlockTree<B>) -> (u32, u32) {
        let first_block = self.nodes.len() as u32;
        let per_block = units(block_words::<B>());
        let frames = self.frames(&blocks.tree.frames);
        for block in &blocks.blocks {
            self.block(block, &frames);
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
    fn frames(&mut self, frames: &[Frame]) -> Vec<u32> {
        let mut places = vec![0; frames.len().max(1)];
        for (place, frame) in places.iter_mut().zip(frames).skip(1) {
            *place = self.words.len() as u32;
            let axes = frame.axes.iter().flat_map(|axis| axis.to_array());
            self.words.extend(axes.map(f32::to_bits));
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
        let per_node = units(lattice_words::<B>() + 10);
        let kind = if B::MOVING { MOVES } else { 0 };
        let reference = |child: u32| match child {
            EMPTY => EMPTY,
            leaves if leaves & LEAF != 0 => leaf(leaves & !LEAF),
            node => kind | (first + node * per_node),
        };
        for node in &tree.nodes {
            self.node(node, frames, &reference);
        }
        reference(tree.root)
    }

    fn node<B: Bounds8>(
        &mut self,
        node: &Node<B>,
        frames: &[u32],
        reference: &impl Fn(u32) -> u32,
    ) {
        let mut words = lattices(&node.bounds);
        for (slot, &child) in node.children.iter().enumerate() {
            let valid = node.valid >> slot & 1 != 0;
            words.push(if valid { reference(child) } else { EMPTY });
        }
        words.push(frames[node.frame as usize]);
        words.push(node.valid);
        self.push(words);
    }

    fn block<B: Bounds8>(&mut self, block: &Block<B>, frames: &[u32]) {
        let span = &block.span;
        let rect = span.rect;
        let mut words = lattices(&block.bounds);
        words.push(span.grid);
        words.push(u32::from_le_bytes([rect.i, rect.j, rect.w, rect.h]));
        let [w, h] = span.group;
        words.push(u32::from_le_bytes([w, h, span.columns, span.count]));
        words.push(frames[block.frame as usize]);
        self.push(words);
    }

    fn push(&mut self, mut words: Vec<u32>) {
        words.resize(words.len().next_multiple_of(4), 0);
        self.nodes.extend_from_slice(bytemuck::cast_slice(&words));
    }
}

/// Words of the lattices of a node or block.
fn lattice_words<B: Bounds8>() -> u32 {
    if B::MOVING { 36 } else { 18 }
}

fn block_words<B: Bounds8>() -> u32 {
    lattice_words::<B>() + 4
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
    words.extend(lattice.origin.map(f32::to_bits));
    words.extend(lattice.step.map(f32::to_bits));
    for bytes in lattice.planes.iter().flatten() {
        words.extend_from_slice(&bytemuck::cast::<[u8; 8], [u32; 2]>(*bytes));
    }
}
