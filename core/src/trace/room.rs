//! What a thread keeps between packets, so that nothing large is made, cleared or copied for each of them.

use super::cell_rays::CellRays;
use super::opened::Opened;
use super::packet::{LANES, PACKET, Rays, Record, Slabs, VECTORS};
use super::pairs::Pairs;
use super::queries::Queries;
use super::scattered::Turns;
use super::traverse_packet::Waiting;

/// What a thread keeps between packets; taken while in use.
#[derive(Default)]
pub(super) struct Room {
    /// Subtrees still to visit; those of each ray farthest first.
    pub waiting: Vec<Waiting>,
    /// Pairs of rays and groups.
    pub pairs: Pairs,
    /// Blocks that wait.
    pub opened: Opened,
    /// What rays look for.
    queries: Option<Box<Queries>>,
    /// Those that nobody uses.
    spaces: Vec<Box<Space>>,
}

/// A packet in one space: of the world, of an object, of a tree. What was there last is there still, so it is written
/// before it is read.
pub(super) struct Space {
    /// The rays.
    pub rays: [Rays; VECTORS],
    /// The same for slab tests in the identity frame.
    pub slabs: Slabs,
    /// In the frame of nodes.
    pub turned: Slabs,
    /// In the frame of a block.
    pub in_block: Slabs,
    /// To be turned into the frame of a block.
    pub records: [Record; PACKET],
    /// For micropolygons.
    pub cells: CellRays,
    /// Rays that take turns.
    pub turns: Turns,
    /// To be turned into the frames of nodes, by those.
    pub turns_records: [Record; PACKET],
}

impl Space {
    const NONE: Space = Space {
        rays: [Rays::NONE; VECTORS],
        slabs: Slabs::NONE,
        turned: Slabs::NONE,
        in_block: Slabs::NONE,
        records: [[0.0; 8]; PACKET],
        cells: CellRays::NONE,
        turns: Turns::filled(0.0),
        turns_records: [[0.0; 8]; PACKET],
    };

    /// What must not be read: in tests, every space that is taken holds this.
    const SPOILED: Space = {
        let slabs = Slabs::SPOILED;
        Space {
            rays: [Rays {
                origin: [[f32::NAN; LANES]; 3],
                dir: [[f32::NAN; LANES]; 3],
                time: [f32::NAN; LANES],
            }; VECTORS],
            slabs,
            turned: slabs,
            in_block: slabs,
            records: [[f32::NAN; 8]; PACKET],
            cells: CellRays::SPOILED,
            turns: Turns::filled(f32::NAN),
            turns_records: [[f32::NAN; 8]; PACKET],
        }
    };
}

impl Room {
    /// What the rays of a packet look for: of an earlier one, still.
    #[inline(always)]
    pub fn take_queries(&mut self) -> Box<Queries> {
        let mut queries = self.queries.take().unwrap_or_else(new_queries);
        if cfg!(debug_assertions) {
            *queries = Queries::SPOILED;
        }
        queries
    }

    /// Gives them back.
    #[inline(always)]
    pub fn give_back_queries(&mut self, queries: Box<Queries>) {
        self.queries = Some(queries);
    }

    /// A space that nobody else uses.
    #[inline(always)]
    pub fn take(&mut self) -> Box<Space> {
        let mut space = self.spaces.pop().unwrap_or_else(new_space);
        if cfg!(debug_assertions) {
            spoil(&mut space);
        }
        space
    }

    /// Gives one back.
    #[inline(always)]
    pub fn give_back(&mut self, space: Box<Space>) {
        self.spaces.push(space);
    }
}

#[cold]
#[inline(never)]
fn new_queries() -> Box<Queries> {
    Box::new(Queries::NONE)
}

/// Apart, so that what is so large is copied in one place of the code.
#[cold]
#[inline(never)]
fn spoil(space: &mut Space) {
    *space = Space::SPOILED;
}

#[cold]
#[inline(never)]
fn new_space() -> Box<Space> {
    Box::new(Space::NONE)
}
