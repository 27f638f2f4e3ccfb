//! Which pages a world takes: arrays that bindings can hold. Rays are traced through one page after the other.
//!
//! A page has some objects, whole or some of their grids, and all their instances, or as many as there is room
//! for. Objects come in the order of their first instance. What of an object is on a page is near each other: it is halved
//! along its longest side until all parts fit, so that few rays come by many pages.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;
use hdtrapeze_core::bvh::{LinearSlabs, ObjectGeometry, StaticSlabs, object::Blas};
use hdtrapeze_core::grid::{Grid, PlanarMesh};
use hdtrapeze_core::trace::parts::Parts;
use hdtrapeze_core::trace::piece::{Pick, Trees};
use hdtrapeze_shaders::layout::{GridHeader, Instance};

use super::axes::{FRAME_WORDS, TURN_WORDS};
use super::build::forest::items_of;
use super::scene::{block_words, node_words};

/// Bytes of the arrays of a page.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Size {
    nodes: u64,
    vertices: u64,
    words: u64,
    instances: u64,
    matrices: u64,
    /// Normals and colours.
    paints: u64,
}

impl Size {
    fn most(&self) -> u64 {
        let Self {
            nodes,
            vertices,
            words,
            instances,
            matrices,
            paints,
        } = *self;
        let trees = nodes.max(vertices).max(words);
        trees.max(instances).max(matrices).max(paints)
    }

    fn plus(&self, o: &Self, times: u64) -> Self {
        Self {
            nodes: self.nodes + o.nodes * times,
            vertices: self.vertices + o.vertices * times,
            words: self.words + o.words * times,
            instances: self.instances + o.instances * times,
            matrices: self.matrices + o.matrices * times,
            paints: self.paints + o.paints * times,
        }
    }
}

/// Bytes of normals and colours of an object that are laid out beside it.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Paint {
    pub a_vertex: u64,
    pub a_grid: u64,
}

/// Of each object, where the device shades.
pub(crate) type Paints = HashMap<*const ObjectGeometry, Paint>;

/// Part of an object, and what it takes.
type Part = (Option<Arc<[u32]>>, Size);

/// What each page of `parts` takes, where no array may be larger than `most` bytes; at least one page. What does not fit
/// by itself has a page of its own.
pub(crate) fn plan(parts: &Parts<'_>, most: u64, trees: Trees, paints: &Paints) -> Vec<Vec<Pick>> {
    let sets: Vec<_> = parts.sets().collect();
    let mut objects: Vec<(&Arc<ObjectGeometry>, Vec<usize>)> = Vec::new();
    let mut known: HashMap<*const ObjectGeometry, usize> = HashMap::new();
    for (number, set) in sets.iter().enumerate() {
        let object = set.object();
        let place = *known.entry(Arc::as_ptr(object)).or_insert_with(|| {
            objects.push((object, Vec::new()));
            objects.len() - 1
        });
        objects[place].1.push(number);
    }
    let mut pages = Vec::new();
    let mut page: Vec<Pick> = Vec::new();
    let mut used = Size::default();
    for (object, numbers) in &objects {
        let paint = paints.get(&Arc::as_ptr(object));
        for (grids, size) in cut(object, most, trees, paint.copied().unwrap_or_default()) {
            // Whether this page has it already.
            let mut there = false;
            for &set in numbers {
                let each = instance(sets[set].key_times());
                let mut next = 0;
                while next < sets[set].len() {
                    let base = used.plus(&size, u64::from(!there));
                    let room = room(&base, &each, most);
                    if room == 0 && !page.is_empty() {
                        pages.push(std::mem::take(&mut page));
                        (used, there) = (Size::default(), false);
                        continue;
                    }
                    let count = room.max(1).min(sets[set].len() - next);
                    (used, there) = (base.plus(&each, count as u64), true);
                    page.push(Pick {
                        set,
                        instances: next..next + count,
                        grids: grids.clone(),
                    });
                    next += count;
                }
            }
        }
    }
    pages.push(page);
    pages
}

/// How many times `each` fits beside `base`.
fn room(base: &Size, each: &Size, most: u64) -> usize {
    if base.most() > most {
        return 0;
    }
    let fits = |base: u64, each: u64| (most - base).checked_div(each).unwrap_or(u64::MAX);
    let least = fits(base.nodes, each.nodes)
        .min(fits(base.words, each.words))
        .min(fits(base.instances, each.instances))
        .min(fits(base.matrices, each.matrices));
    usize::try_from(least).unwrap_or(usize::MAX)
}

/// What an instance takes: its share of a tree of full nodes, about, which is more than how it looks; its rows; its number
/// and its place, to look it up, and its side.
fn instance(key_times: Option<&[f32]>) -> Size {
    let rows = 3 * key_times.map_or(1, <[f32]>::len);
    Size {
        nodes: u64::from(node_words::<LinearSlabs>()),
        instances: size_of::<Instance>() as u64,
        matrices: 16 * rows as u64,
        words: 3 * size_of::<u32>() as u64,
        ..Size::default()
    }
}

/// The whole of an object where that fits, else parts of it that do.
fn cut(object: &ObjectGeometry, most: u64, trees: Trees, paint: Paint) -> Vec<Part> {
    let mesh = object.mesh();
    let count = mesh.grids.len() as u32;
    let sound = mesh.sound_grids();
    let sizes: Vec<Size> = match trees {
        Trees::Now => {
            let whole = whole(object, paint);
            if whole.most() <= most || count < 2 {
                return vec![(None, whole)];
            }
            // Trees of parts are not known: nodes are shared out by micropolygons, with some to spare.
            let per_cell = whole.nodes as f64 * 1.25 / mesh.cell_count().max(1) as f64;
            let nodes = |grid: &Grid| (grid.cell_count() as f64 * per_cell).ceil() as u64;
            let grids = mesh.grids.iter();
            grids
                .map(|grid| grid_size(grid, mesh, nodes(grid), paint))
                .collect()
        }
        Trees::Later => {
            let grids = (0..).zip(&mesh.grids).zip(&sound);
            let size = |((g, grid), &sound): ((u32, &Grid), &bool)| match sound {
                true => later_size(g, grid, mesh, paint),
                false => grid_size(grid, mesh, 0, paint),
            };
            let sizes: Vec<Size> = grids.map(size).collect();
            let whole = sizes.iter();
            let whole = whole.fold(Size::default(), |sum, size| sum.plus(size, 1));
            if whole.most() <= most || count < 2 {
                return vec![(None, whole)];
            }
            sizes
        }
    };
    let grids = (0..count).zip(sizes).zip(sound);
    let grids = grids.map(|((number, size), sound)| Placed {
        number,
        centre: match sound {
            true => centre(mesh, number as usize),
            false => Vec3::ZERO,
        },
        size,
    });
    let mut grids: Vec<Placed> = grids.collect();
    let mut parts = Vec::new();
    // Instances need room, too.
    halve(&mut grids, most - most / 8, &mut parts);
    parts
}

/// A grid, and where it is.
struct Placed {
    number: u32,
    centre: Vec3,
    size: Size,
}

/// Parts of these grids that each fit, or have a single grid: as few as there can be, about.
fn halve(grids: &mut [Placed], most: u64, parts: &mut Vec<Part>) {
    let sum = |grids: &[Placed]| {
        let sizes = grids.iter().map(|grid| &grid.size);
        sizes.fold(Size::default(), |sum, size| sum.plus(size, 1))
    };
    let whole = sum(grids);
    if whole.most() <= most || grids.len() < 2 {
        let mut numbers: Vec<u32> = grids.iter().map(|grid| grid.number).collect();
        numbers.sort_unstable();
        parts.push((Some(numbers.into()), whole));
        return;
    }
    let (lo, hi) = grids
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), grid| {
            (lo.min(grid.centre), hi.max(grid.centre))
        });
    let axis = (hi - lo).max_position();
    grids.sort_unstable_by(|a, b| {
        let order = a.centre[axis].total_cmp(&b.centre[axis]);
        order.then(a.number.cmp(&b.number))
    });
    // A side has as many pages' worth as it has pages.
    let pages = whole.most().div_ceil(most);
    let share = whole.most() / pages * (pages / 2);
    let mut near = Size::default();
    let full = grids.iter().position(|grid| {
        near = near.plus(&grid.size, 1);
        near.most() > share
    });
    let at = full.unwrap_or(1).clamp(1, grids.len() - 1);
    let (near, far) = grids.split_at_mut(at);
    halve(near, most, parts);
    halve(far, most, parts);
}

/// The centre of a grid's corners while the shutter is open.
fn centre(mesh: &PlanarMesh, g: usize) -> Vec3 {
    let grid = &mesh.grids[g];
    let (across, last) = (usize::from(grid.nu), grid.vertex_count() - 1);
    let corners = [0, across, last - across, last];
    let keys = [0, mesh.key_count() - 1];
    let points = keys
        .iter()
        .flat_map(|&k| corners.map(|i| mesh.position(g, k, i)));
    points.sum::<Vec3>() / 8.0
}

/// What a grid takes, whose share of nodes and blocks has so many bytes.
fn grid_size(grid: &Grid, mesh: &PlanarMesh, nodes: u64, paint: Paint) -> Size {
    Size {
        nodes,
        vertices: 12 * (grid.vertex_count() * mesh.key_count()) as u64,
        words: (size_of::<GridHeader>() + size_of::<u32>()) as u64,
        paints: grid.vertex_count() as u64 * paint.a_vertex + paint.a_grid,
        ..Size::default()
    }
}

/// What a grid takes whose object has its tree made on the device: all blocks may have frames, and nodes are more than
/// half full.
fn later_size(g: u32, grid: &Grid, mesh: &PlanarMesh, paint: Paint) -> Size {
    let (items, blocks) = items_of(g, grid);
    let (node, block) = match mesh.is_moving() {
        true => (node_words::<LinearSlabs>(), block_words::<LinearSlabs>()),
        false => (node_words::<StaticSlabs>(), block_words::<StaticSlabs>()),
    };
    let nodes = (2 * u64::from(items) * bytes(node)).div_ceil(7) + u64::from(blocks) * bytes(block);
    let frame = if mesh.is_moving() {
        TURN_WORDS
    } else {
        FRAME_WORDS
    };
    let size = grid_size(grid, mesh, nodes, paint);
    Size {
        words: size.words + u64::from(4 * frame * blocks),
        ..size
    }
}

/// Bytes of a node or block of so many words.
fn bytes(words: u32) -> u64 {
    16 * u64::from(words.div_ceil(4))
}

/// What an object takes with the CPU's tree.
fn whole(object: &ObjectGeometry, paint: Paint) -> Size {
    // A relative tree becomes a plain one, of which nothing is known.
    let still = (
        node_words::<StaticSlabs>(),
        block_words::<StaticSlabs>(),
        FRAME_WORDS,
    );
    let moving = (
        node_words::<LinearSlabs>(),
        block_words::<LinearSlabs>(),
        TURN_WORDS,
    );
    let ((node, block, frame), spare) = match object.blas() {
        Blas::Static(_) => (still, 1),
        Blas::Moving(_) => (moving, 1),
        Blas::Relative(_) => (moving, 2),
    };
    let (mesh, stats) = (object.mesh(), object.stats());
    let frames = (stats.oriented_nodes + stats.oriented_blocks) * u64::from(frame);
    Size {
        nodes: spare * (stats.nodes * bytes(node) + stats.blocks * bytes(block)),
        vertices: size_of_val(mesh.floats()) as u64,
        words: (size_of::<GridHeader>() * mesh.grids.len()) as u64 + spare * 4 * frames,
        paints: mesh.vertex_count as u64 * paint.a_vertex + mesh.grids.len() as u64 * paint.a_grid,
        ..Size::default()
    }
}
