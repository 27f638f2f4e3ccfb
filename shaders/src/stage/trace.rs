//! The stage `trace`: the nearest hit of each ray.

/// What a scene and a launch ask of the stage `trace`: the fewer effects, the less code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TracePermutation {
    /// Something moves: vertices, or instances.
    pub time: bool,
    /// Entries of the stack of a ray: one of [`STACKS`].
    pub stack: u32,
    /// What rays cost is told.
    pub counts: bool,
}

/// Sizes of stacks that are compiled.
pub const STACKS: [u32; 4] = [32, 64, 128, 256];

/// Invocations of a workgroup of the stage `trace`.
pub const TRACE_WORKGROUP: u32 = 64;

impl TracePermutation {
    /// All there are.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..4 * STACKS.len()).map(|i| Self {
            time: i & 1 != 0,
            stack: STACKS[i / 4],
            counts: i & 2 != 0,
        })
    }

    /// The WGSL of the stage; its entry point is `trace`.
    pub fn source(self) -> String {
        let fixed = format!(
            "const TIME: bool = {};\nconst STACK: u32 = {}u;\n",
            self.time, self.stack
        );
        [
            fixed.as_str(),
            crate::layout::SOURCE,
            include_str!("../wgsl/slabs.wgsl"),
            include_str!("../wgsl/keys.wgsl"),
            include_str!("../wgsl/cells.wgsl"),
            include_str!("../wgsl/trace.wgsl"),
            match self.counts {
                true => include_str!("../wgsl/tell_counts.wgsl"),
                false => include_str!("../wgsl/tell_none.wgsl"),
            },
        ]
        .concat()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_permutation_is_valid() {
        for permutation in TracePermutation::all() {
            let source = permutation.source();
            let workgroup = [TRACE_WORKGROUP, 1, 1];
            super::super::tests::check(&source, &[("trace", workgroup)]);
        }
    }
}
