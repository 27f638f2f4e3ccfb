//! The text of the stage `shade`.

/// What a scene and its AOVs ask of the stage `shade`: the fewer effects, the less code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShadePermutation {
    /// Colours are asked for.
    pub color: bool,
    /// Something moves, or changes its colour.
    pub time: bool,
    /// The camera moves.
    pub camera_moves: bool,
}

/// Invocations of a workgroup of the stage `shade`.
pub const SHADE_WORKGROUP: u32 = 64;

impl ShadePermutation {
    /// All there are.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..8).map(|i| Self {
            color: i & 1 != 0,
            time: i & 2 != 0,
            camera_moves: i & 4 != 0,
        })
    }

    /// The WGSL of the stage; its entry point is `shade`.
    pub fn source(self) -> String {
        let fixed = format!(
            "const COLOR: bool = {};\nconst TIME: bool = {};\nconst MOVES: bool = {};\n",
            self.color, self.time, self.camera_moves
        );
        [
            fixed.as_str(),
            crate::layout::SOURCE,
            include_str!("../wgsl/keys.wgsl"),
            include_str!("../wgsl/facet.wgsl"),
            include_str!("../wgsl/place.wgsl"),
            include_str!("../wgsl/circle.wgsl"),
            include_str!("../wgsl/pose.wgsl"),
            include_str!("../wgsl/shade.wgsl"),
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
        for permutation in ShadePermutation::all() {
            check(&permutation.source(), &[("shade", [SHADE_WORKGROUP, 1, 1])]);
        }
    }
}
