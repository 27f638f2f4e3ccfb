//! Frames of nodes and blocks as `slabs.wgsl` reads them.

use hdtrapeze_core::bvh::turn::{Turn, Turning};

/// Words of a frame.
pub(crate) const FRAME_WORDS: u32 = 9;
/// Words of one that turns: its third axis at the end of the shutter, and its bow along each axis, follow.
pub(crate) const TURN_WORDS: u32 = 15;
/// Set in the place of a frame that turns.
const TURNS: u32 = 1 << 31;

/// A frame among the words of a scene.
pub(crate) struct FrameWords {
    words: [u32; TURN_WORDS as usize],
    turns: bool,
}

impl FrameWords {
    pub fn of<T: Turning>(frame: &T) -> Self {
        let turn = frame.turn();
        let Turn { axes, normals, bow } = &turn;
        let mut words = [0; TURN_WORDS as usize];
        let vectors = axes.iter().chain(normals).chain([bow]);
        for (to, vector) in words.chunks_exact_mut(3).zip(vectors) {
            to.copy_from_slice(&vector.to_array().map(f32::to_bits));
        }
        Self {
            words,
            turns: turn.turns(),
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
