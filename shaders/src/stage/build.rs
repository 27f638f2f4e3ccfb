//! The stages that make trees out of diced vertices, in their order, and the bindings of each.

use super::Binding;

/// A stage of the build. One text has all its entry points, which see the same bindings, all of group 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum BuildStage {
    /// Bounds of blocks and loose groups.
    Bound,
    /// What they are sorted by.
    Morton,
    /// Sorts them.
    Sort,
    /// A binary tree.
    Cluster,
    /// Nodes of 8 children out of it.
    Collapse,
    /// Bounds of nodes, and what became of trees.
    Refit,
}

/// A name, and the invocations of a workgroup.
pub type EntryPoint = (&'static str, u32);

impl BuildStage {
    /// All, in their order.
    pub const ALL: [Self; 6] = [
        Self::Bound,
        Self::Morton,
        Self::Sort,
        Self::Cluster,
        Self::Collapse,
        Self::Refit,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bound => "bound",
            Self::Morton => "morton",
            Self::Sort => "sort",
            Self::Cluster => "cluster",
            Self::Collapse => "collapse",
            Self::Refit => "refit",
        }
    }

    /// The WGSL of the stage, for bounds that move or do not.
    pub fn source(self, moves: bool) -> String {
        let fixed = format!("const MOVES: bool = {moves};\n");
        let boxes = include_str!("../wgsl/boxes.wgsl");
        let items = include_str!("../wgsl/items.wgsl");
        let pack = include_str!("../wgsl/pack.wgsl");
        let scan = include_str!("../wgsl/scan.wgsl");
        let own: &[&str] = match self {
            Self::Bound => &[boxes, items, pack, include_str!("../wgsl/bound.wgsl")],
            Self::Morton => &[boxes, items, include_str!("../wgsl/morton.wgsl")],
            Self::Sort => &[scan, include_str!("../wgsl/sort.wgsl")],
            Self::Cluster => &[boxes, scan, include_str!("../wgsl/cluster.wgsl")],
            Self::Collapse => &[boxes, scan, include_str!("../wgsl/collapse.wgsl")],
            Self::Refit => &[boxes, pack, include_str!("../wgsl/refit.wgsl")],
        };
        [&[fixed.as_str(), crate::layout::SOURCE], own]
            .concat()
            .concat()
    }

    /// Its entry points.
    pub fn entry_points(self) -> &'static [EntryPoint] {
        match self {
            Self::Bound => &[("bound", 64)],
            Self::Morton => &[("key", 64)],
            Self::Sort => &[
                ("count", 128),
                ("sum", 128),
                ("scatter", 128),
                ("begin", 128),
            ],
            Self::Cluster => &[("find", 128), ("count", 128), ("sum", 128), ("join", 128)],
            Self::Collapse => &[("root", 128), ("open", 128), ("sum", 128), ("place", 128)],
            Self::Refit => &[("refit", 64), ("tell", 64)],
        }
    }

    /// Its bindings, by number; the first is a [`BuildLaunch`](crate::layout::BuildLaunch).
    pub fn bindings(self) -> &'static [Binding] {
        use Binding::{Read, Uniform, Write};
        match self {
            Self::Bound => &[Uniform, Write, Read, Read, Write, Read, Write, Write, Write],
            Self::Morton => &[Uniform, Write, Read, Read, Write, Write, Write],
            Self::Sort => &[Uniform, Read, Read, Write, Write, Write, Write, Write],
            Self::Cluster => &[Uniform, Write, Write, Write, Write, Write, Write, Write],
            Self::Collapse => &[
                Uniform, Write, Read, Read, Write, Write, Write, Write, Write,
            ],
            Self::Refit => &[Uniform, Write, Read, Read, Write, Write, Read, Read, Write],
        }
    }
}

/// Items of a workgroup of the stage `sort`.
pub const SORT_TILE: u32 = 1024;
/// Bits that a round of the stage `sort` sorts by, and how many values they have.
pub const SORT_BITS: u32 = 4;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_permutation_is_valid() {
        for stage in BuildStage::ALL {
            for moves in [false, true] {
                let entries = stage.entry_points().iter();
                let entries: Vec<_> = entries.map(|&(name, size)| (name, [size, 1, 1])).collect();
                super::super::tests::check(&stage.source(moves), &entries);
            }
        }
    }

    /// Devices need not bind more than 8 storage buffers.
    #[test]
    fn bindings_are_those_of_the_text() {
        for stage in BuildStage::ALL {
            let source = stage.source(true);
            let found = super::super::tests::bindings(&source);
            let numbers = (0..).map(|number| [0, number]);
            let told: Vec<_> = numbers.zip(stage.bindings().iter().copied()).collect();
            assert_eq!(found, told, "{stage:?}");
            assert!(told.len() <= 9, "{stage:?}");
        }
    }

    #[test]
    fn tiles_are_as_the_text_has_them() {
        let source = BuildStage::Sort.source(false);
        for fixed in [
            "const LANES: u32 = 128u;",
            "const RUN: u32 = 8u;",
            "const DIGITS: u32 = 16u;",
        ] {
            assert!(source.contains(fixed), "{fixed}");
        }
        assert_eq!((SORT_TILE, 1 << SORT_BITS), (128 * 8, 16));
    }
}
