//! Instancers of a commit: which ones stand above each prim, and those resolved that are needed.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::sync::Arc;

use crate::diagnostics::{Code, Warning};
use crate::motion::Shutter;
use crate::scene::{InstancerDesc, PrimDesc, PrimId, PrototypeOf, Scene};
use crate::translate::instancer::Instancer;

/// The instancers above a prim, innermost first.
pub(super) type Chain = Vec<Arc<InstancerDesc>>;

/// Why a prim has no place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Broken {
    /// An instancer above it is gone.
    Missing,
    /// This instancer is part of its own prototype.
    Loop(PrimId),
    /// It is in more than [`DEEPEST`] instancers.
    Deep,
}

/// Instancers that may be nested.
pub(super) const DEEPEST: usize = 4096;

/// Finds the instancers above a prim.
pub(super) fn chain(scene: &Scene, prim: &PrimDesc) -> Result<Chain, Broken> {
    let mut found = Vec::new();
    let mut seen = BTreeSet::new();
    let mut next = prim.common.instancer;
    while let Some((id, _)) = next {
        if !seen.insert(id) {
            return Err(Broken::Loop(id));
        }
        if seen.len() > DEEPEST {
            return Err(Broken::Deep);
        }
        let desc = scene.instancers.get(&id).ok_or(Broken::Missing)?;
        next = desc.parent;
        found.push(Arc::clone(desc));
    }
    Ok(found)
}

/// True where both place in the same way.
pub(super) fn same_chain(a: &Chain, b: &Chain) -> bool {
    let same = |(a, b): (&Arc<InstancerDesc>, &Arc<InstancerDesc>)| Arc::ptr_eq(a, b) || a == b;
    a.len() == b.len() && a.iter().zip(b).all(same)
}

/// Warns of broken chains, each once.
pub(super) fn warn_of(broken: &[(&PrimDesc, Broken)], scene: &Scene, warnings: &mut Vec<Warning>) {
    let mut loops = BTreeSet::new();
    let mut deep = None;
    for (prim, broken) in broken {
        match broken {
            Broken::Missing => {
                let text = "its instancer was removed; it is not rendered";
                warnings.push(Warning::new(&prim.common.path, Code::Topology, text));
            }
            Broken::Loop(id) => {
                loops.insert(*id);
            }
            Broken::Deep => deep = deep.or(Some(&prim.common.path)),
        }
    }
    if let Some(path) = deep {
        let text = format!(
            "it is in more than {DEEPEST} nested instancers; what is so deep is not rendered"
        );
        warnings.push(Warning::new(path, Code::Unsupported, text));
    }
    for id in loops {
        let path = scene.instancers.get(&id).map_or("", |i| i.path.as_str());
        let text = "it is part of its own prototype; what it places is not rendered";
        warnings.push(Warning::new(path, Code::Topology, text));
    }
}

/// Resolves the instancers that `parts` belong to, and those above them, with the primvars that shading
/// or `primvar_names` ask for; their warnings come in the order of creation.
pub(super) fn resolve(
    scene: &Scene,
    parts: impl IntoIterator<Item = PrototypeOf>,
    shutter: Shutter,
    primvar_names: &[String],
    warnings: &mut Vec<Warning>,
) -> HashMap<PrimId, Arc<Instancer>> {
    let mut resolved: HashMap<PrimId, Arc<Instancer>> = HashMap::new();
    let mut said: BTreeMap<PrimId, Vec<Warning>> = BTreeMap::new();
    for (id, _) in parts {
        // Outermost first; chains have been checked.
        let mut path = Vec::new();
        let mut next = Some(id);
        while let Some(id) = next.filter(|id| !resolved.contains_key(id)) {
            let Some(desc) = scene.instancers.get(&id) else {
                break;
            };
            path.push((id, desc));
            next = desc.parent.map(|(id, _)| id);
        }
        for (id, desc) in path.into_iter().rev() {
            let above =
                |(id, prototype): PrototypeOf| Some((resolved.get(&id)?.clone(), prototype));
            let parent = desc.parent.and_then(above);
            let said = said.entry(id).or_default();
            let mut instancer = Instancer::new(desc, parent, shutter, said);
            instancer.resolve_primvars(desc, primvar_names, shutter, said);
            resolved.insert(id, Arc::new(instancer));
        }
    }
    warnings.extend(said.into_values().flatten());
    resolved
}
