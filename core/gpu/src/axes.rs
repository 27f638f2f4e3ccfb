//! Frames of nodes and blocks as `slabs.wgsl` reads them.

use hdtrapeze_core::bvh::turn::{Turn, Turning};

/// Words of a frame.
pub(crate) const FRAME_WORDS: u32 = 9;
/// Words of one that turns: its third axis at the end of the shutter, and its bow, follow.
pub(crate) const TURN_WORDS: u32 = 13;
/// Set in the place of a frame that turns.
const TURNS: u32 = 1 << 31;

/// A frame among the words of a scene.
pub(crate) struct FrameWords {
    words: [u32; TURN_WORDS as usize],
    turns: bool,
}

impl FrameWords {
    pub fn of<T: Turning>(frame: &T) -> Self {
        let Turn { axes, normals, bow } = frame.turn();
        let mut words = [bow.to_bits(); TURN_WORDS as usize];
        for (to, axis) in words.chunks_exact_mut(3).zip(axes.iter().chain(&normals)) {
            to.copy_from_slice(&axis.to_array().map(f32::to_bits));
        }
        Self {
            words,
            turns: normals[0] != normals[1],
        }
    }

    /// Its words.
    pub fn words(&self) -> &[u32] {
        let count = if self.turns { TURN_WORDS } else { FRAME_WORDS };
        &self.words[..count as usize]
    }

    /// What nodes and blocks refer to it by where its words begin at `first`.
    pub fn placed(&self, first: u32) -> u32 {
        if self.turns { first | TURNS } else { first }
    }
}
