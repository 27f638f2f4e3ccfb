//! Primvars as AOVs: what they hold, decided by the prims that have them, and their values at a hit.

use std::sync::Arc;

use super::chains::Chain;
use super::prepared::{Prepared, PreparedPrim};
use crate::aov::{PRIMVAR_PREFIX, PrimvarAov, WIDEST_PRIMVAR, primvar_of};
use crate::diagnostics::{Code, Warning};
use crate::film::tile::PrimvarSample;
use crate::scene::{PrimDesc, PrimvarRole, RenderSettings};
use crate::shade::{ChannelAccess, Source};

/// A primvar of a prim that an AOV asks for.
#[derive(Clone, Debug)]
pub(super) struct PrimPrimvar {
    pub name: String,
    pub role: PrimvarRole,
    pub source: Arc<Source>,
}

/// What AOVs ask for of one prim.
#[derive(Clone, Debug, Default)]
pub(super) struct PrimPrimvars {
    /// Names that the prim or an instancer of it has, usable or not; ascending.
    pub asked: Vec<String>,
    /// Those that are usable.
    pub sources: Vec<PrimPrimvar>,
    /// Straight segments in time of the primvar in use with the most, those for shading too; 0 when
    /// none changes.
    pub segments: usize,
}

impl PrimPrimvars {
    /// True where they are what `names` ask for of `prim`, which is part of the instancers of `chain`.
    pub fn fit(&self, prim: &PrimDesc, chain: &Chain, names: &[String]) -> bool {
        asked_of(prim, chain, names).eq(&self.asked)
    }
}

/// Those of `names` that the prim or an instancer of it has.
pub(super) fn asked_of<'a>(
    prim: &PrimDesc,
    chain: &Chain,
    names: &'a [String],
) -> impl Iterator<Item = &'a String> {
    names.iter().filter(|name| {
        let given = || chain.iter().any(|i| i.primvars.contains_key(*name));
        prim.common.primvars.contains_key(*name) || given()
    })
}

/// Names of the primvars that the settings' AOVs ask for, ascending.
pub(super) fn names(settings: &RenderSettings) -> Vec<String> {
    let asked = settings.aovs.iter().filter_map(|aov| primvar_of(aov));
    let mut names: Vec<String> = asked.map(str::to_owned).collect();
    names.sort();
    names.dedup();
    names
}

/// The AOVs of `names`, in their order; every prim gets its sources in the same order.
pub(super) fn assign(
    names: &[String],
    prims: &mut [PreparedPrim],
    warnings: &mut Vec<Warning>,
) -> Vec<Arc<PrimvarAov>> {
    let mut aovs = Vec::with_capacity(names.len());
    let (mut floats, mut integers) = (0, 0);
    for name in names {
        let mut aov = decide(name, prims, warnings);
        let taken = match aov.is_integer {
            true => &mut integers,
            false => &mut floats,
        };
        aov.first = *taken;
        *taken += aov.components;
        aovs.push(Arc::new(aov));
    }
    for prim in prims.iter_mut().filter(|_| !names.is_empty()) {
        let objects = &prim.objects;
        let source = |name: &String| {
            let found = objects.sources().find(|primvar| primvar.name == *name)?;
            Some(found.source.clone())
        };
        prim.primvars = names.iter().map(source).collect();
    }
    aovs
}

/// What the AOV of one primvar holds: the widest that a prim has, floats where they differ.
fn decide(name: &str, prims: &[PreparedPrim], warnings: &mut Vec<Warning>) -> PrimvarAov {
    let found: Vec<_> = prims
        .iter()
        .filter_map(|prim| {
            let mut sources = prim.objects.sources();
            Some((prim, sources.find(|primvar| primvar.name == name)?))
        })
        .collect();
    let aov = format!("{PRIMVAR_PREFIX}{name}");
    let mut warn = |path: &str, text: String| {
        let text = format!("AOV {aov}: {text}");
        warnings.push(Warning::new(path, Code::Unsupported, text));
    };
    let width = found.iter().map(|(_, p)| p.source.width()).max();
    let is_integer = !found.is_empty() && found.iter().all(|(_, p)| p.source.is_integer());
    match found.first() {
        None => warn(
            "",
            "no prim has such a primvar of numbers; it is left empty".to_owned(),
        ),
        Some((_, first)) => {
            let kind = |p: &Source| (p.width(), p.is_integer());
            let expected = kind(&first.source);
            if let Some((prim, _)) = found.iter().find(|(_, p)| kind(&p.source) != expected) {
                let numbers = if is_integer {
                    "whole numbers"
                } else {
                    "floats"
                };
                let width = width.unwrap_or(1);
                let text = format!(
                    "its type differs from that of {}; the AOV has {} {numbers}, of which narrower \
                     primvars leave the rest 0",
                    found[0].0.path,
                    width.min(WIDEST_PRIMVAR)
                );
                warn(&prim.path, text);
            } else if let Some((prim, p)) = found
                .iter()
                .find(|(_, p)| p.source.width() > WIDEST_PRIMVAR)
            {
                let width = p.source.width();
                let text =
                    format!("it has {width} numbers a value; the first {WIDEST_PRIMVAR} are kept");
                warn(&prim.path, text);
            }
        }
    }
    PrimvarAov {
        components: width.unwrap_or(1).min(WIDEST_PRIMVAR),
        is_integer,
        is_color: found
            .first()
            .is_some_and(|(_, p)| p.role == PrimvarRole::Color),
        first: 0,
        name: aov,
    }
}

impl Prepared {
    /// Values of all primvar AOVs at a hit of `prim`.
    pub(super) fn read_primvars(
        &self,
        prim: &PreparedPrim,
        element: u32,
        time: f32,
        channels: &impl ChannelAccess,
        out: &mut PrimvarSample,
    ) {
        for (aov, source) in self.primvar_aovs.iter().zip(&prim.primvars) {
            let range = aov.first..aov.first + aov.components;
            if aov.is_integer {
                let values = &mut out.integers[range];
                match source {
                    None => values.fill(-1),
                    Some(source) => {
                        values.fill(0);
                        source.read_integers(element, time, channels, values);
                    }
                }
                continue;
            }
            let values = &mut out.floats[range];
            values.fill(0.0);
            match source {
                None => {}
                Some(source) if source.is_integer() => {
                    let mut whole = [0; WIDEST_PRIMVAR];
                    source.read_integers(element, time, channels, &mut whole);
                    for (value, whole) in values.iter_mut().zip(whole) {
                        *value = whole as f32;
                    }
                }
                Some(source) => source.read(element, time, channels, values),
            }
        }
    }
}
