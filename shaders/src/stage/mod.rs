//! The text of each stage: what it needs, one after the other, with what its permutation fixes.

mod build;
mod film;
mod generate;
mod scatter;
mod shade;
mod trace;

pub use build::{BuildStage, EntryPoint, SORT_BITS, SORT_TILE};
pub use film::FilmPermutation;
pub use generate::{GeneratePermutation, LensKind, TILE_SQUARE, TimeKind};
pub use scatter::{SCATTER_WORKGROUP, order_source, scatter_source, share_source, site_source};
pub use shade::{
    KeptValues, LEAST_TRANSMITTANCE, MAX_LAYERS, SHADE_WORKGROUP, ShadePermutation, VEILS_AT,
};
pub use trace::{OccludePermutation, STACKS, TRACE_WORKGROUP, Told, TracePermutation, VISITS};

/// How a stage sees a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binding {
    /// Reads it.
    Read,
    /// Reads and writes it.
    Write,
    /// Reads it: one struct, the same for all.
    Uniform,
}

#[cfg(test)]
mod tests {
    use super::Binding;
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    use naga::{AddressSpace, StorageAccess};

    /// Panics unless a device without optional features takes this text, and has these entry points in it, each with
    /// its workgroup.
    pub(super) fn check(source: &str, entries: &[(&str, [u32; 3])]) {
        let module = naga::front::wgsl::parse_str(source)
            .map_err(|e| e.emit_to_string(source))
            .expect("the stage parses");
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
        let valid = validator.validate(&module);
        assert!(valid.is_ok(), "{:?} in {source}", valid.err());
        let found: Vec<(&str, [u32; 3])> = module
            .entry_points
            .iter()
            .map(|entry| (entry.name.as_str(), entry.workgroup_size))
            .collect();
        assert_eq!(found, entries);
    }

    /// The buffers of a text, by group and number.
    pub(super) fn bindings(source: &str) -> Vec<([u32; 2], Binding)> {
        let module = naga::front::wgsl::parse_str(source).expect("the stage parses");
        let variables = module.global_variables.iter();
        let mut found: Vec<_> = variables
            .filter_map(|(_, variable)| {
                let kind = match variable.space {
                    AddressSpace::Uniform => Binding::Uniform,
                    AddressSpace::Storage { access } if access == StorageAccess::LOAD => {
                        Binding::Read
                    }
                    AddressSpace::Storage { .. } => Binding::Write,
                    _ => return None,
                };
                let at = variable.binding.expect("bound");
                Some(([at.group, at.binding], kind))
            })
            .collect();
        found.sort_by_key(|&(at, _)| at);
        found
    }

    /// A text without its comments.
    pub(super) fn code(source: &str) -> String {
        let lines = source.lines();
        let lines: Vec<&str> = lines.filter_map(|line| line.split("//").next()).collect();
        lines.join("\n")
    }
}
