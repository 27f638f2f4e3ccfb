//! Which pages a world takes: arrays that bindings can hold. Rays are traced through one page after the other.
//!
//! A page has some objects, whole or some of their grids, and all their instances, or as many as there is room
//! for. Objects come in the order of their first instance, and grids in theirs: neighbours share a page.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use hdtrapeze_core::bvh::{LinearSlabs, ObjectGeometry, StaticSlabs, object::Blas};
use hdtrapeze_core::grid::Grid;
use hdtrapeze_core::trace::parts::Parts;
use hdtrapeze_core::trace::piece::Pick;
use hdtrapeze_shaders::layout::{GridHeader, Instance};

use super::scene::{block_words, node_words};

/// Bytes of the arrays of a page.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Size {
    nodes: u64,
    planes: u64,
    words: u64,
    instances: u64,
    matrices: u64,
}

impl Size {
    fn most(&self) -> u64 {
        let Self {
            nodes,
            planes,
            words,
            instances,
            matrices,
        } = *self;
        nodes.max(planes).max(words).max(instances).max(matrices)
    }

    fn plus(&self, o: &Self, times: u64) -> Self {
        Self {
            nodes: self.nodes + o.nodes * times,
            planes: self.planes + o.planes * times,
            words: self.words + o.words * times,
            instances: self.instances + o.instances * times,
            matrices: self.matrices + o.matrices * times,
        }
    }
}

/// Part of an object, and what it takes.
type Part = (Option<Range<usize>>, Size);

/// What each page of `parts` takes, where no array may be larger than `most` bytes; at least one page. What does not fit
/// by itself has a page of its own.
pub(crate) fn plan(parts: &Parts<'_>, most: u64) -> Vec<Vec<Pick>> {
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
        for (grids, size) in cut(object, most) {
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

/// What an instance takes: its share of a tree of full nodes, about, and its rows.
fn instance(key_times: Option<&[f32]>) -> Size {
    let rows = 3 * key_times.map_or(1, <[f32]>::len);
    Size {
        nodes: u64::from(node_words::<LinearSlabs>()),
        instances: size_of::<Instance>() as u64,
        matrices: 16 * rows as u64,
        ..Size::default()
    }
}

/// The whole of an object where that fits, else parts of it that do.
fn cut(object: &ObjectGeometry, most: u64) -> Vec<Part> {
    let whole = whole(object);
    let mesh = object.mesh();
    if whole.most() <= most || mesh.grids.len() < 2 {
        return vec![(None, whole)];
    }
    // Trees of parts are not known: nodes are shared out by micropolygons, with some to spare.
    let per_cell = whole.nodes as f64 * 1.25 / mesh.cell_count().max(1) as f64;
    let of = |grid: &Grid| Size {
        nodes: (grid.cell_count() as f64 * per_cell).ceil() as u64,
        planes: 12 * (grid.vertex_count() * mesh.key_count()) as u64,
        words: size_of::<GridHeader>() as u64,
        ..Size::default()
    };
    // Instances need room, too.
    let most = most - most / 8;
    let mut parts = Vec::new();
    let (mut first, mut size) = (0, Size::default());
    for (g, grid) in mesh.grids.iter().enumerate() {
        let with = size.plus(&of(grid), 1);
        if with.most() > most && g > first {
            parts.push((Some(first..g), size));
            (first, size) = (g, of(grid));
        } else {
            size = with;
        }
    }
    parts.push((Some(first..mesh.grids.len()), size));
    parts
}

fn whole(object: &ObjectGeometry) -> Size {
    let (mesh, stats) = (object.mesh(), object.stats());
    // A relative tree becomes a plain one, of which nothing is known.
    let (node, block, spare) = match object.blas() {
        Blas::Static(_) => (node_words::<StaticSlabs>(), block_words::<StaticSlabs>(), 1),
        Blas::Moving(_) => (node_words::<LinearSlabs>(), block_words::<LinearSlabs>(), 1),
        Blas::Relative(_) => (node_words::<LinearSlabs>(), block_words::<LinearSlabs>(), 2),
    };
    let bytes = |words: u32| 16 * u64::from(words.div_ceil(4));
    let frames = stats.oriented_nodes + stats.oriented_blocks;
    Size {
        nodes: spare * (stats.nodes * bytes(node) + stats.blocks * bytes(block)),
        planes: size_of_val(mesh.planes()) as u64,
        words: (size_of::<GridHeader>() * mesh.grids.len()) as u64 + spare * 36 * frames,
        ..Size::default()
    }
}
