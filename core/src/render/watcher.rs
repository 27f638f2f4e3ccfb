//! Who is told of objects while others are still being diced.

use std::sync::Arc;

use crate::bvh::ObjectGeometry;

/// Is told of each object that is diced, by the thread that has diced it: it goes on with others once this returns.
pub trait Watcher: Sync {
    /// The object's vertices are final. It may still be that it does not come into the scene: the commit is interrupted, or
    /// the prim is edited before.
    fn diced(&self, object: &Arc<ObjectGeometry>);
}
