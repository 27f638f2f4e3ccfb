//! Instancers that place more than there is memory for: found by counting, before anything is placed.
//!
//! An instancer that is part of no other places a *nest*: its instances, times those of the instancers in
//! its prototypes, and so on. Counts multiply, so a few authored lines may ask for 10^12 instances.
//! What a nest places is the product of counts that are known, summed over its prims; a nest that does
//! not fit is left out as a whole, for which part of it were to stay would be arbitrary.

use std::collections::HashMap;
use std::sync::Arc;

use super::chains::Chain;
use super::objects::PrimObjects;
use crate::diagnostics::{Code, Warning};
use crate::memory;
use crate::scene::{InstancerDesc, PrimDesc, PrimId};
use crate::translate::instancer::Instancer;

/// Bytes that an instance takes at most while a world is made: its record, its box, its share of the tree
/// twice, its numbers. Moving ones take more; this is what keeps a mistaken count from ending the process.
const BYTES_PER_INSTANCE: u64 = 300;
/// Bytes for instances that are never asked about.
const LEAST_MEMORY: u64 = 64 << 20;

/// A prim with the instancers that it is part of, and what it became where that is known already.
pub(super) struct Member<'a> {
    pub prim: &'a PrimDesc,
    pub chain: &'a Chain,
    pub known: Option<&'a PrimObjects>,
}

/// Whether each prim is left out, its nest being more than fits into the memory that is free; with a
/// warning for each such nest.
pub(super) fn beyond_memory(
    members: &[Member<'_>],
    instancers: &HashMap<PrimId, Arc<Instancer>>,
    warnings: &mut Vec<Warning>,
) -> Vec<bool> {
    let fits = |bytes: u64| bytes < LEAST_MEMORY || memory::check(bytes, "").is_ok();
    beyond(members, instancers, &fits, warnings)
}

fn beyond(
    members: &[Member<'_>],
    instancers: &HashMap<PrimId, Arc<Instancer>>,
    fits: &dyn Fn(u64) -> bool,
    warnings: &mut Vec<Warning>,
) -> Vec<bool> {
    let mut nest_of: HashMap<*const InstancerDesc, usize> = HashMap::new();
    let mut nests: Vec<(&InstancerDesc, u64)> = Vec::new();
    let mut numbers = Vec::with_capacity(members.len());
    let mut alone = 0u64;
    for member in members {
        let Some(outermost) = member.chain.last() else {
            alone += 1;
            numbers.push(None);
            continue;
        };
        let nest = *nest_of.entry(Arc::as_ptr(outermost)).or_insert_with(|| {
            nests.push((outermost, 0));
            nests.len() - 1
        });
        nests[nest].1 = nests[nest].1.saturating_add(count(member, instancers));
        numbers.push(Some(nest));
    }
    let mut total = alone.saturating_mul(BYTES_PER_INSTANCE);
    let mut out = Vec::with_capacity(nests.len());
    for (outermost, count) in nests {
        let with = total.saturating_add(count.saturating_mul(BYTES_PER_INSTANCE));
        out.push(!fits(with));
        if fits(with) {
            total = with;
            continue;
        }
        let count = match count {
            u64::MAX => "more than 10^19".to_owned(),
            count => count.to_string(),
        };
        let text = format!(
            "it places {count} instances, counted with the instancers in its prototypes, which do not \
             fit into memory; they are left out"
        );
        warnings.push(Warning::new(&outermost.path, Code::Budget, text));
    }
    let left_out = |nest: Option<usize>| nest.is_some_and(|nest| out[nest]);
    numbers.into_iter().map(left_out).collect()
}

fn count(member: &Member<'_>, instancers: &HashMap<PrimId, Arc<Instancer>>) -> u64 {
    if let Some(objects) = member.known {
        return objects.placed.iter().map(|p| p.set.len() as u64).sum();
    }
    let part = member.prim.common.instancer;
    let found = part.and_then(|(id, prototype)| Some((instancers.get(&id)?, prototype)));
    found.map_or(0, |(instancer, prototype)| {
        instancer.placement_count(prototype)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Shutter;
    use crate::render::chains;
    use crate::scene::{Geometry, InstanceArrays, MeshDesc, PrimCommon, Scene};

    /// A chain of instancers with `each` instances, a prim in each of them; and one prim alone.
    fn nested(depth: u64, each: usize) -> Scene {
        let mut scene = Scene::default();
        let arrays = Arc::new(InstanceArrays {
            instance_count: each,
            ..InstanceArrays::default()
        });
        let mut add = |id: u64, instancer| {
            let mut common = PrimCommon::new(format!("/Prim{id}"));
            common.instancer = instancer;
            let geometry = Geometry::Mesh(MeshDesc::default());
            let prim = PrimDesc { common, geometry };
            scene.prims.insert(PrimId(1000 + id), Arc::new(prim));
        };
        add(0, None);
        for level in 1..=depth {
            add(level, Some((PrimId(level), 0)));
        }
        for level in 1..=depth {
            let mut desc = InstancerDesc::new(format!("/Level{level}"));
            desc.parent = (level > 1).then(|| (PrimId(level - 1), 0));
            desc.arrays = Arc::clone(&arrays);
            scene.instancers.insert(PrimId(level), Arc::new(desc));
        }
        scene
    }

    fn left_out(scene: &Scene, most: u64) -> (Vec<bool>, Vec<String>) {
        let chains: Vec<Chain> = scene
            .prims
            .values()
            .map(|prim| chains::chain(scene, prim).expect("a sound chain"))
            .collect();
        let parts = scene.prims.values().filter_map(|p| p.common.instancer);
        let mut warnings = Vec::new();
        let instancers = chains::resolve(scene, parts, Shutter::default(), &[], &mut warnings);
        let members: Vec<Member<'_>> = scene
            .prims
            .values()
            .zip(&chains)
            .map(|(prim, chain)| Member {
                prim,
                chain,
                known: None,
            })
            .collect();
        let fits = |bytes: u64| bytes <= most * BYTES_PER_INSTANCE;
        let left_out = beyond(&members, &instancers, &fits, &mut warnings);
        let said = warnings
            .into_iter()
            .map(|w| format!("{} {}", w.prim, w.text));
        (left_out, said.collect())
    }

    #[test]
    fn a_nest_that_does_not_fit_is_left_out_whole_with_one_warning() {
        let scene = nested(12, 10);
        let (out, said) = left_out(&scene, 100_000_000);
        assert!(!out[0] && out[1..].iter().all(|&out| out), "{out:?}");
        assert_eq!(said.len(), 1, "{said:?}");
        assert!(said[0].starts_with("/Level1 it places 1111111111110 instances"));
    }

    #[test]
    fn a_nest_that_fits_stays() {
        let (out, said) = left_out(&nested(3, 10), 1111);
        assert_eq!((out, said), (vec![false; 4], Vec::new()));
        assert_eq!(
            left_out(&nested(3, 10), 1110).1.len(),
            1,
            "the prim alone counts"
        );
    }

    #[test]
    fn as_many_levels_as_are_allowed_are_counted_and_dropped_again() {
        let last_only = |depth: usize| {
            let mut scene = nested(depth as u64, 1);
            let (id, last) = scene.prims.pop_last().expect("prims");
            scene.prims = [(id, last)].into();
            scene
        };
        let (out, said) = left_out(&last_only(chains::DEEPEST), 1);
        assert_eq!((out, said), (vec![false], Vec::new()));
        let deeper = last_only(chains::DEEPEST + 1);
        let prim = deeper.prims.values().next().expect("a prim");
        assert_eq!(chains::chain(&deeper, prim), Err(chains::Broken::Deep));
    }

    #[test]
    fn counts_that_no_number_holds() {
        let (_, said) = left_out(&nested(30, 10), 1 << 40);
        assert!(said[0].contains("more than 10^19"), "{said:?}");
    }
}
