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

/// The stages of secondary rays, in their order: those before the first on the device run on the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum SecondaryStage {
    /// Hits to where rays leave them.
    #[default]
    Site,
    /// Rays from there.
    Scatter,
    /// What they are sorted by.
    Order,
    /// Their order.
    Sort,
    /// Whether they meet anything.
    Occlude,
    /// The share of those that do not.
    Share,
}

impl SecondaryStage {
    /// All, in their order.
    pub const ALL: [Self; 6] = [
        Self::Site,
        Self::Scatter,
        Self::Order,
        Self::Sort,
        Self::Occlude,
        Self::Share,
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Site => "site",
            Self::Scatter => "scatter",
            Self::Order => "order",
            Self::Sort => "sort",
            Self::Occlude => "occlude",
            Self::Share => "share",
        }
    }

    /// The stage of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|stage| stage.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each name is one stage's, be it of camera rays or of secondary ones.
    #[test]
    fn names_tell_stages_apart() {
        for stage in FirstOnDevice::ALL {
            assert_eq!(FirstOnDevice::named(stage.name()), Some(stage));
            assert_eq!(SecondaryStage::named(stage.name()), None);
        }
        for stage in SecondaryStage::ALL {
            assert_eq!(SecondaryStage::named(stage.name()), Some(stage));
            assert_eq!(FirstOnDevice::named(stage.name()), None);
        }
        assert!(SecondaryStage::ALL.is_sorted());
        assert_eq!(SecondaryStage::named(""), None);
    }
}
