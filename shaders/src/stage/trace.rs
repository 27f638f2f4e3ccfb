//! The stages `trace` and `occlude`: the nearest hit of each ray, or whether there is any.

/// What a scene and a launch ask of the stage `trace`: the fewer effects, the less code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TracePermutation {
    /// Something moves: vertices, or instances.
    pub time: bool,
    /// Entries of the stack of a ray: one of [`STACKS`].
    pub stack: u32,
    /// Any hit will do.
    pub any: bool,
    /// What rays cost is told.
    pub counts: bool,
}

/// What is told of the work of rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Told {
    /// Nothing.
    #[default]
    None,
    /// Nodes opened and micropolygons tested, a ray.
    Counts,
    /// Which nodes were opened: [`VISITS`] at most.
    Visits,
}

/// What a scene and a launch ask of the stage `occlude`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct OccludePermutation {
    /// Something moves: vertices, or instances.
    pub time: bool,
    /// Entries of the stack of a ray: one of [`STACKS`].
    pub stack: u32,
    /// Rays are taken in an order that is given.
    pub ordered: bool,
    /// What is told besides.
    pub told: Told,
}

/// Sizes of stacks that are compiled.
pub const STACKS: [u32; 4] = [32, 64, 128, 256];

/// Invocations of a workgroup of the stages `trace` and `occlude`.
pub const TRACE_WORKGROUP: u32 = 64;

/// Nodes that are told of a ray, of those that it opens.
pub const VISITS: u32 = 255;

impl Told {
    fn source(self) -> &'static str {
        match self {
            Self::None => include_str!("../wgsl/tell_none.wgsl"),
            Self::Counts => include_str!("../wgsl/tell_counts.wgsl"),
            Self::Visits => include_str!("../wgsl/tell_visits.wgsl"),
        }
    }
}

/// A walk, and what it needs.
fn walk(time: bool, stack: u32, any: bool, told: Told) -> String {
    let fixed = format!(
        "const TIME: bool = {time};\nconst STACK: u32 = {stack}u;\nconst ANY: bool = {any};\n"
    );
    [
        fixed.as_str(),
        crate::layout::SOURCE,
        include_str!("../wgsl/slabs.wgsl"),
        include_str!("../wgsl/keys.wgsl"),
        include_str!("../wgsl/cells.wgsl"),
        match any {
            true => include_str!("../wgsl/waiting_any.wgsl"),
            false => include_str!("../wgsl/waiting_near.wgsl"),
        },
        include_str!("../wgsl/walk.wgsl"),
        told.source(),
    ]
    .concat()
}

impl TracePermutation {
    /// All there are.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..8 * STACKS.len()).map(|i| Self {
            time: i & 1 != 0,
            counts: i & 2 != 0,
            any: i & 4 != 0,
            stack: STACKS[i / 8],
        })
    }

    /// The WGSL of the stage; its entry point is `trace`.
    pub fn source(self) -> String {
        let told = match self.counts {
            true => Told::Counts,
            false => Told::None,
        };
        walk(self.time, self.stack, self.any, told) + include_str!("../wgsl/trace.wgsl")
    }
}

impl OccludePermutation {
    /// All there are.
    pub fn all() -> impl Iterator<Item = Self> {
        let told = [Told::None, Told::Counts, Told::Visits];
        (0..12 * STACKS.len()).map(move |i| Self {
            time: i & 1 != 0,
            ordered: i & 2 != 0,
            told: told[i / 4 % 3],
            stack: STACKS[i / 12],
        })
    }

    /// The WGSL of the stage; its entry point is `occlude`.
    pub fn source(self) -> String {
        [
            walk(self.time, self.stack, true, self.told).as_str(),
            match self.ordered {
                true => include_str!("../wgsl/taken_sorted.wgsl"),
                false => include_str!("../wgsl/taken_as_they_stand.wgsl"),
            },
            include_str!("../wgsl/occlude.wgsl"),
        ]
        .concat()
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::check;
    use super::*;

    #[test]
    fn every_permutation_is_valid() {
        let workgroup = [TRACE_WORKGROUP, 1, 1];
        for permutation in TracePermutation::all() {
            check(&permutation.source(), &[("trace", workgroup)]);
        }
        for permutation in OccludePermutation::all() {
            check(&permutation.source(), &[("occlude", workgroup)]);
        }
    }

    #[test]
    fn visits_are_as_many_as_the_text_has() {
        let fixed = format!("const VISITS: u32 = {VISITS}u;");
        assert!(Told::Visits.source().contains(&fixed));
    }
}
