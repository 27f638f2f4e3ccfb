//! Where the CPU's part ends: a difference is narrowed down to a stage by where it appears.

use hdtrapeze_core::render::Stage;

/// The first stage that runs on the device; those before it run on the CPU. In the order of the pipeline.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum FirstOnDevice {
    /// Bounds of blocks and loose groups, and all that follows.
    #[default]
    Bound,
    /// Trees over these.
    Build,
    /// The tree over instances.
    Instances,
    /// Samples to rays; all trees are the CPU's from here on.
    Generate,
    /// Rays to hits.
    Trace,
    /// Hits to colours.
    Shade,
    /// Colours to sums of pixels.
    Film,
}

impl FirstOnDevice {
    /// All, in their order.
    pub const ALL: [Self; 7] = [
        Self::Bound,
        Self::Build,
        Self::Instances,
        Self::Generate,
        Self::Trace,
        Self::Shade,
        Self::Film,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bound => "bound",
            Self::Build => "build",
            Self::Instances => "instances",
            Self::Generate => "generate",
            Self::Trace => "trace",
            Self::Shade => "shade",
            Self::Film => "film",
        }
    }

    /// The stage of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|stage| stage.name() == name)
    }

    /// The first stage of a sample that runs on the device.
    pub fn of_samples(self) -> Stage {
        match self {
            Self::Bound | Self::Build | Self::Instances | Self::Generate => Stage::Generate,
            Self::Trace => Stage::Trace,
            Self::Shade => Stage::Shade,
            Self::Film => Stage::Film,
        }
    }
}
