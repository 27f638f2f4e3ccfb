//! One instancer of a dump: which instances of which prototype there are, and their matrices at the keys
//! of the arrays' own samples.

use super::prim::write_resolved;
use super::text::{Page, at, integers, matrix};
use super::{write_motion, write_transform, write_warnings};
use crate::motion::Shutter;
use crate::scene::{InstancerDesc, PrototypeOf, Scene};
use crate::translate::blur::prim_shutter;
use crate::translate::instancer::primvars::primvar_counts;
use crate::translate::instancer::{Instancer, instance_count};
use crate::translate::primvar::resolve;

/// Instances of a prototype that are printed; of more, the number.
const WHOLE: usize = 24;

pub(super) fn write(page: &mut Page, desc: &InstancerDesc, scene: &Scene, shutter: Shutter) {
    page.line(&format!("instancer {}", desc.path));
    page.indented(|page| {
        let mut warnings = Vec::new();
        if !desc.visible {
            page.line("invisible");
        }
        write_motion(page, desc.blur_scale, desc.nonlinear_samples);
        write_part_of(page, desc.parent, scene);
        let instancer = Instancer::new(desc, None, shutter, &mut warnings);
        let own = prim_shutter(&desc.path, desc.blur_scale, shutter, &mut Vec::new());
        write_transform(page, &desc.transform, own);
        let counts = primvar_counts(instance_count(&desc.arrays));
        for (name, primvar) in &desc.primvars {
            let path = &desc.path;
            let resolved = resolve(path, name, primvar, &counts, own, &mut warnings);
            if let Some(resolved) = resolved {
                write_resolved(page, name, &resolved);
            }
        }
        if instancer.matrices_turn() {
            page.line("matrices turn between samples");
        }
        for prototype in instancer.prototypes() {
            let members = instancer.members(prototype);
            page.line(&format!("prototype {prototype}: {}", integers(members)));
            page.indented(|page| {
                for &i in members.iter().take(WHOLE) {
                    for &time in instancer.key_times() {
                        let m = instancer.instance(i as usize, time);
                        let at = at(instancer.key_times().len(), time);
                        page.line(&format!("{i}{at}: {}", matrix(&m)));
                    }
                }
                if members.len() > WHOLE {
                    page.line(&format!("and {} more", members.len() - WHOLE));
                }
            });
        }
        write_warnings(page, &warnings);
    });
}

/// The prototype that something is part of.
pub(super) fn write_part_of(page: &mut Page, part: Option<PrototypeOf>, scene: &Scene) {
    if let Some((id, prototype)) = part {
        let path = scene.instancers.get(&id).map_or("?", |i| i.path.as_str());
        page.line(&format!("part of prototype {prototype} of {path}"));
    }
}
