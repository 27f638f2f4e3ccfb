//! The text of the stage `generate`, and of samples alone.

/// What lens rays go through.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LensKind {
    /// None.
    Pinhole,
    /// A disk, an oval, or one point of it.
    Round,
    /// Straight or bent blades.
    Blades,
}

/// What changes from ray to ray.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TimeKind {
    /// Nothing: no time is drawn.
    Still,
    /// The time, and not the camera.
    Time,
    /// The camera's pose too.
    CameraMoves,
}

/// What a camera and its settings ask of the stage `generate`: the fewer effects, the less code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GeneratePermutation {
    /// Samples are a net's, else Sobol's.
    pub net: bool,
    /// The lens.
    pub lens: LensKind,
    /// Time.
    pub time: TimeKind,
    /// The lens or the film back changes while the shutter is open.
    pub lens_changes: bool,
}

/// Side of the square of pixels that a workgroup takes where stages go by pixel, and such squares along a tile.
pub const TILE_SQUARE: [u32; 2] = [8, 2];

impl GeneratePermutation {
    /// All there are.
    pub fn all() -> impl Iterator<Item = Self> {
        let lenses = [LensKind::Pinhole, LensKind::Round, LensKind::Blades];
        let times = [TimeKind::Still, TimeKind::Time, TimeKind::CameraMoves];
        (0..36).map(move |i| Self {
            net: i % 2 != 0,
            lens: lenses[i / 2 % 3],
            time: times[i / 6 % 3],
            lens_changes: i / 18 != 0,
        })
    }

    /// The WGSL of the stage; its entry point is `generate`.
    pub fn source(self) -> String {
        [
            self.samples().as_str(),
            crate::layout::SOURCE,
            include_str!("../wgsl/circle.wgsl"),
            include_str!("../wgsl/pose.wgsl"),
            include_str!("../wgsl/lens.wgsl"),
            include_str!("../wgsl/camera.wgsl"),
            include_str!("../wgsl/tiles.wgsl"),
            include_str!("../wgsl/generate.wgsl"),
        ]
        .concat()
    }

    /// The WGSL of its samples alone: `sample_of` and what it needs, but for `words`.
    pub fn samples(self) -> String {
        let fixed = format!(
            "const NET: bool = {};\nconst LENS: u32 = {}u;\nconst TIME: bool = {};\nconst MOVES: bool = {};\nconst LENS_CHANGES: bool = {};\n",
            self.net,
            self.lens as u32,
            self.time != TimeKind::Still,
            self.time == TimeKind::CameraMoves,
            self.lens_changes,
        );
        fixed + include_str!("../wgsl/sample.wgsl")
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::check;
    use super::*;

    #[test]
    fn every_permutation_is_valid() {
        for permutation in GeneratePermutation::all() {
            let [side, _] = TILE_SQUARE;
            check(&permutation.source(), &[("generate", [side * side, 1, 1])]);
        }
    }
}
