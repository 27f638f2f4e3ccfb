//! Prims prepared before their scene is complete: a host that reads its scene prim by prim hands each
//! one on as soon as it has read it, and the reading, translating and dicing overlap.

use std::collections::HashMap;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

use super::chains::Chain;
use super::earlier::same_dicing;
use super::objects::prepare_prim;
use super::prepare::View;
use super::prepared::CacheEntry;
use super::watcher::Watcher;
use crate::scene::{PrimDesc, PrimId, Scene};
use crate::surface::SubdivisionFactory;

/// Prims prepared for one camera and settings. Shared by the threads that add to it.
#[derive(Debug)]
pub struct Ahead {
    view: View,
    entries: Mutex<HashMap<PrimId, CacheEntry>>,
}

impl Ahead {
    /// For the camera and settings of `scene`, whose prims do not matter; `None` where nothing can be
    /// prepared for them: then [`super::prepare`] will say why.
    pub fn new(scene: &Scene) -> Option<Self> {
        let view = View::new(scene, &mut Vec::new()).ok()?;
        Some(Self {
            view,
            entries: Mutex::default(),
        })
    }

    /// Prepares one prim, on the calling thread's rayon pool, and tells `watcher` of what it becomes. What `cancel` interrupts
    /// is not kept.
    pub fn prepare(
        &self,
        id: PrimId,
        desc: &Arc<PrimDesc>,
        factory: &dyn SubdivisionFactory,
        watcher: Option<&dyn Watcher>,
        cancel: &AtomicBool,
    ) {
        // Where parts of instancers are is known at the commit.
        if !desc.common.visible || desc.common.instancer.is_some() {
            return;
        }
        let instancers = HashMap::new();
        let context = self.view.context(&instancers, factory, watcher, cancel);
        let chain = Chain::new();
        let objects = prepare_prim(desc, &chain, None, &context);
        if cancel.load(std::sync::atomic::Ordering::Relaxed) {
            return;
        }
        let entry = CacheEntry {
            desc: Arc::clone(desc),
            chain,
            objects: Arc::new(objects),
        };
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        entries.insert(id, entry);
    }

    /// Takes the entries out, where they were prepared for `view`.
    pub(super) fn take_for(&self, view: &View) -> HashMap<PrimId, CacheEntry> {
        let own = &self.view;
        let mut entries = self.entries.lock().unwrap_or_else(PoisonError::into_inner);
        let entries = std::mem::take(&mut *entries);
        match same_dicing(own.shutter, &own.camera_desc, &own.settings, view) {
            true => entries,
            false => HashMap::new(),
        }
    }
}
