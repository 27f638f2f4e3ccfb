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
    /// Rays go on behind what they meet: layer after layer, the next hit after the last is looked for. Neither any hit will
    /// do then, nor is told what rays cost.
    pub layers: bool,
    /// Rays pass through one side of some surfaces; not where any hit will do.
    pub culls: bool,
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
fn walk(permutation: TracePermutation, told: Told) -> String {
    let TracePermutation {
        time,
        stack,
        any,
        layers,
        culls,
        ..
    } = permutation;
    let fixed = format!(
        "const TIME: bool = {time};\nconst STACK: u32 = {stack}u;\nconst ANY: bool = {any};\n"
    );
    [
        fixed.as_str(),
        crate::layout::SOURCE,
        include_str!("../wgsl/slabs.wgsl"),
        include_str!("../wgsl/keys.wgsl"),
        include_str!("../wgsl/cells.wgsl"),
        match culls {
            true => include_str!("../wgsl/sides_some.wgsl"),
            false => include_str!("../wgsl/sides_all.wgsl"),
        },
        match layers {
            true => include_str!("../wgsl/met_before.wgsl"),
            false => include_str!("../wgsl/met_none.wgsl"),
        },
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
        let each = (0..32 * STACKS.len()).map(|i| Self {
            time: i & 1 != 0,
            counts: i & 2 != 0,
            any: i & 4 != 0,
            layers: i & 8 != 0,
            culls: i & 16 != 0,
            stack: STACKS[i / 32],
        });
        each.filter(|p| !(p.any && (p.layers || p.culls) || p.layers && p.counts))
    }

    /// The WGSL of the stage; its entry point is `trace`.
    pub fn source(self) -> String {
        let told = match self.counts {
            true => Told::Counts,
            false => Told::None,
        };
        let walk = walk(self, told);
        match self.layers {
            true => {
                let layers = include_str!("../wgsl/layers.wgsl");
                walk + layers + include_str!("../wgsl/trace_layers.wgsl")
            }
            false => walk + include_str!("../wgsl/trace.wgsl"),
        }
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
        let any = TracePermutation {
            time: self.time,
            stack: self.stack,
            any: true,
            counts: false,
            layers: false,
            culls: false,
        };
        [
            walk(any, self.told).as_str(),
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
    use super::super::tests::{bindings, check};
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

    /// What a scene does not call for is not in the text.
    #[test]
    fn effects_are_only_where_they_are_asked_for() {
        let (layers, culls) = (["veils", "hit_place"], ["hidden_side", "launch.sides"]);
        let has = |source: &str, words: [&str; 2]| words.map(|word| source.contains(word));
        for permutation in TracePermutation::all() {
            let source = permutation.source();
            let code = super::super::tests::code(&source);
            assert_eq!(has(&code, layers), [permutation.layers; 2]);
            assert_eq!(has(&code, culls), [permutation.culls; 2]);
            // All buffers that every device binds.
            let buffers = bindings(&source).len();
            assert_eq!(
                buffers,
                9 + usize::from(permutation.counts || permutation.layers)
            );
        }
    }

    #[test]
    fn visits_are_as_many_as_the_text_has() {
        let fixed = format!("const VISITS: u32 = {VISITS}u;");
        assert!(Told::Visits.source().contains(&fixed));
    }
}
