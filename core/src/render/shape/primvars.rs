//! Primvars of a prim while its shape is made: resolved, spread over the shape, each only once.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::diagnostics::Warning;
use crate::motion::Shutter;
use crate::render::objects::{Context, PrimObjects};
use crate::render::primvar_aovs::PrimPrimvar;
use crate::scene::{PrimCommon, PrimvarRole};
use crate::shade::{DEFAULT_ALBEDO, PrimShading, Source};
use crate::translate::primvar::{Counts, Resolved, Spread, resolve, resolve_floats};

/// See the module.
pub(super) struct Primvars<'a, C> {
    common: &'a PrimCommon,
    counts: Counts,
    shutter: Shutter,
    spread: &'a dyn Fn(Resolved) -> Spread<C>,
    made: BTreeMap<&'a str, (PrimvarRole, Arc<Source>)>,
    channels: Vec<C>,
}

impl<'a, C> Primvars<'a, C> {
    /// For a prim whose values count so, and are carried over its shape by `spread`.
    pub fn new(
        common: &'a PrimCommon,
        counts: Counts,
        shutter: Shutter,
        spread: &'a dyn Fn(Resolved) -> Spread<C>,
    ) -> Self {
        Self {
            common,
            counts,
            shutter,
            spread,
            made: BTreeMap::new(),
            channels: Vec::new(),
        }
    }

    /// The primvar of that name, if its values are `width` floats.
    pub fn floats(
        &mut self,
        name: &str,
        width: usize,
        warnings: &mut Vec<Warning>,
    ) -> Option<Arc<Source>> {
        let (name, primvar) = self.common.primvars.get_key_value(name)?;
        let path = &self.common.path;
        let (counts, shutter) = (&self.counts, self.shutter);
        let resolved = resolve_floats(path, name, primvar, width, counts, shutter, warnings)?;
        Some(self.keep(name, resolved))
    }

    /// displayColor and displayOpacity.
    pub fn shading(&mut self, out: &mut PrimObjects) {
        let color = self.floats("displayColor", 3, &mut out.warnings);
        let opacity = self.floats("displayOpacity", 1, &mut out.warnings);
        let color = color.unwrap_or_else(|| Arc::new(Source::constant(&DEFAULT_ALBEDO)));
        let opacity = opacity.filter(|opacity| !opacity.is_constant(&[1.0]));
        let fades = opacity.as_ref().map_or(0, |opacity| opacity.segments());
        out.primvars.segments = color.segments().max(fades);
        out.shading = PrimShading { color, opacity };
    }

    /// Those that AOVs ask for, and the channels of all.
    pub fn finish(mut self, context: &Context<'_>, out: &mut PrimObjects) -> Vec<C> {
        out.primvars.sources.clear();
        for name in context.primvar_aovs {
            let Some((name, primvar)) = self.common.primvars.get_key_value(name) else {
                continue;
            };
            if !self.made.contains_key(name.as_str()) {
                let (path, counts) = (&self.common.path, &self.counts);
                let warnings = &mut out.warnings;
                match resolve(path, name, primvar, counts, self.shutter, warnings) {
                    Some(resolved) => self.keep(name, resolved),
                    None => continue,
                };
            }
            if let Some((role, source)) = self.made.get(name.as_str()) {
                let used = &mut out.primvars;
                used.segments = used.segments.max(source.segments());
                used.sources.push(PrimPrimvar {
                    name: name.clone(),
                    role: *role,
                    source: Arc::clone(source),
                });
            }
        }
        self.channels
    }

    fn keep(&mut self, name: &'a str, resolved: Resolved) -> Arc<Source> {
        let role = resolved.role;
        let source = Arc::new(Source::new(resolved, self.spread, &mut self.channels));
        self.made.insert(name, (role, Arc::clone(&source)));
        source
    }
}
