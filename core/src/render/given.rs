//! What instancers give to a prim that it does not have itself: primvars with a value an instance.

use std::sync::Arc;

use super::primvar_aovs::PrimPrimvar;
use crate::scene::PrimDesc;
use crate::shade::{PrimShading, Source};
use crate::translate::instancer::Placements;
use crate::translate::instancer::primvars::SHADED;
use crate::translate::primvar::Resolved;

/// See the module.
#[derive(Clone, Debug, Default)]
pub(super) struct Given {
    color: Option<Arc<Source>>,
    opacity: Option<Arc<Source>>,
    /// Those that AOVs ask for.
    pub primvars: Vec<PrimPrimvar>,
    /// The instancers that [`super::objects::PlacedSet::numbers`] lists instances of; none where hits
    /// tell the instance by its id.
    pub links: Vec<usize>,
    /// Straight segments in time of the one with the most.
    pub segments: usize,
}

impl Given {
    /// What `placements` give `prim`, for shading and for the AOVs of these names.
    pub fn new(prim: &PrimDesc, placements: &Placements, names: &[String]) -> Self {
        let mut given = Self::default();
        let [(color, _), (opacity, _)] = SHADED;
        let opaque = |resolved: &Resolved| resolved.values.iter().all(|&value| value == 1.0);
        if let Some((level, resolved)) = given.find(prim, placements, color) {
            given.color = Some(given.source(level, resolved));
        }
        if let Some((level, resolved)) = given.find(prim, placements, opacity)
            && !opaque(resolved)
        {
            given.opacity = Some(given.source(level, resolved));
        }
        for name in names {
            if let Some((level, resolved)) = given.find(prim, placements, name) {
                let source = given.source(level, resolved);
                given.primvars.push(PrimPrimvar {
                    name: name.clone(),
                    role: resolved.role,
                    source,
                });
            }
        }
        if placements.ids_are_indices() {
            given.links.clear();
        }
        given
    }

    /// The prim's own shading, with what it is given.
    pub fn shading(&self, own: &PrimShading) -> PrimShading {
        let mut shading = own.clone();
        if let Some(color) = &self.color {
            shading.color = Arc::clone(color);
        }
        if let Some(opacity) = &self.opacity {
            shading.opacity = Some(Arc::clone(opacity));
        }
        shading
    }

    /// A primvar that the prim does not have, and the number of its instancer in `links`.
    fn find<'a>(
        &mut self,
        prim: &PrimDesc,
        placements: &'a Placements,
        name: &str,
    ) -> Option<(usize, &'a Arc<Resolved>)> {
        if prim.common.primvars.contains_key(name) {
            return None;
        }
        let (link, resolved) = placements.primvar(name)?;
        let known = self.links.iter().position(|&known| known == link);
        let level = known.unwrap_or(self.links.len());
        if known.is_none() {
            self.links.push(link);
        }
        Some((level, resolved))
    }

    fn source(&mut self, level: usize, resolved: &Arc<Resolved>) -> Arc<Source> {
        let source = Source::instanced(resolved, level);
        self.segments = self.segments.max(source.segments());
        Arc::new(source)
    }
}
