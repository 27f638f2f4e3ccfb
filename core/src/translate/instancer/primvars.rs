//! Primvars of instancers: what each instance gives to all that it places.
//!
//! UsdGeomPointInstancer's rule: a value goes to an instance as if it were a constant primvar, authored
//! at the root of the instance. So what a prim of the prototype has itself wins, and of nested
//! instancers the innermost that has one. Values belong to instances by their index, whatever their
//! ids, and whichever are masked.

use std::sync::Arc;

use super::placements::Link;
use super::{Instancer, Placements};
use crate::diagnostics::Warning;
use crate::motion::Shutter;
use crate::scene::InstancerDesc;
use crate::translate::blur::prim_shutter;
use crate::translate::primvar::{Count, Counts, Resolved, resolve, resolve_floats};

/// What shading reads of instancers: names, and floats a value.
pub const SHADED: [(&str, usize); 2] = [("displayColor", 3), ("displayOpacity", 1)];

/// How many values a primvar of an instancer has.
pub fn primvar_counts(instance_count: usize) -> Counts {
    let each = Count(instance_count, "instances");
    Counts {
        prim: "instancer",
        uniform: each,
        varying: each,
        vertex: each,
        face_varying: each,
        more_is_fine: false,
    }
}

impl Instancer {
    /// Resolves those primvars of `desc` that shading or `names` ask for.
    pub fn resolve_primvars(
        &mut self,
        desc: &InstancerDesc,
        names: &[String],
        shutter: Shutter,
        warnings: &mut Vec<Warning>,
    ) {
        if desc.primvars.is_empty() || self.members.is_empty() {
            return;
        }
        let shutter = prim_shutter(&desc.path, desc.blur_scale, shutter, &mut Vec::new());
        let counts = primvar_counts(self.arrays.count);
        for (name, primvar) in &desc.primvars {
            let path = &desc.path;
            let shaded = SHADED.iter().find(|(shaded, _)| shaded == name);
            let resolved = match shaded {
                Some((_, width)) => {
                    resolve_floats(path, name, primvar, *width, &counts, shutter, warnings)
                }
                None if names.contains(name) => {
                    resolve(path, name, primvar, &counts, shutter, warnings)
                }
                None => None,
            };
            if let Some(resolved) = resolved {
                self.primvars.insert(name.clone(), Arc::new(resolved));
            }
        }
    }
}

impl Placements {
    /// The primvar of that name of the innermost instancer that has it, and the instancer's number
    /// for [`Placements::instance_of`].
    pub fn primvar(&self, name: &str) -> Option<(usize, &Arc<Resolved>)> {
        let links = self.links.iter().enumerate().rev();
        let mut found =
            links.filter_map(|(link, of)| Some((link, of.instancer.primvars.get(name)?)));
        found.next()
    }

    /// True where [`Placements::id`] is the instance's own index in the one instancer.
    pub fn ids_are_indices(&self) -> bool {
        let plain = |link: &Link| {
            let given = &link.instancer.arrays.given;
            given.ids.is_empty() && given.lists.is_empty()
        };
        matches!(&self.links[..], [link] if plain(link))
    }

    /// The index of an instancer's instance that a placement is in.
    pub fn instance_of(&self, number: u64, link: usize) -> u32 {
        let (mut at, mut found) = (0, 0);
        self.digits(number, |of, member| {
            if at == link {
                found = of.members().instances[member];
            }
            at += 1;
        });
        found
    }
}
