//! The text of the stage `shade`.

/// What a scene and its AOVs ask of the stage `shade`: the fewer effects, the less code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShadePermutation {
    /// Colours are asked for.
    pub color: bool,
    /// Something moves, or changes its colour.
    pub time: bool,
    /// The camera moves.
    pub camera_moves: bool,
    /// Something is not opaque: what rays meet is taken in layer by layer.
    pub layers: bool,
}

/// Transmittance below which what lies behind cannot be seen.
pub const LEAST_TRANSMITTANCE: f32 = 1.0 / 2048.0;

/// Layers that are taken in at most.
pub const MAX_LAYERS: usize = 64;

/// Bytes before the first [`Veil`](crate::layout::Veil) of the buffer of veils: how many rays go on to each layer, and behind the last.
pub const VEILS_AT: u64 = 4 * (MAX_LAYERS as u64 + 1);

/// Invocations of a workgroup of the stage `shade`.
pub const SHADE_WORKGROUP: u32 = 64;

impl ShadePermutation {
    /// All there are.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..16).map(|i| Self {
            color: i & 1 != 0,
            time: i & 2 != 0,
            camera_moves: i & 4 != 0,
            layers: i & 8 != 0,
        })
    }

    /// The WGSL of the stage; its entry point is `shade`.
    pub fn source(self) -> String {
        let fixed = format!(
            "const COLOR: bool = {};\nconst TIME: bool = {};\nconst MOVES: bool = {};\n",
            self.color, self.time, self.camera_moves
        );
        [
            fixed.as_str(),
            crate::layout::SOURCE,
            include_str!("../wgsl/keys.wgsl"),
            include_str!("../wgsl/facet.wgsl"),
            include_str!("../wgsl/place.wgsl"),
            include_str!("../wgsl/circle.wgsl"),
            include_str!("../wgsl/pose.wgsl"),
            include_str!("../wgsl/shade.wgsl"),
            &self.main(),
        ]
        .concat()
    }

    fn main(self) -> String {
        if !self.layers {
            return include_str!("../wgsl/shade_first.wgsl").to_owned();
        }
        let layers = include_str!("../wgsl/layers.wgsl");
        // A power of two, written in full.
        let fixed = format!("const LEAST_TRANSMITTANCE: f32 = {LEAST_TRANSMITTANCE};\n");
        fixed + layers + include_str!("../wgsl/shade_layers.wgsl")
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{bindings, check, code};
    use super::*;
    use crate::layout::Veil;
    use naga::TypeInner;

    #[test]
    fn every_permutation_is_valid() {
        for permutation in ShadePermutation::all() {
            check(&permutation.source(), &[("shade", [SHADE_WORKGROUP, 1, 1])]);
        }
    }

    /// What a scene does not call for is not in the text.
    #[test]
    fn effects_are_only_where_they_are_asked_for() {
        for permutation in ShadePermutation::all() {
            let source = permutation.source();
            for word in ["veils", "hit_place"] {
                assert_eq!(code(&source).contains(word), permutation.layers, "{word}");
            }
            let buffers = bindings(&source).len();
            assert_eq!(buffers, 13 + usize::from(permutation.layers));
        }
    }

    #[test]
    fn veils_stand_where_the_text_has_them() {
        let permutation = ShadePermutation::all().find(|p| p.layers);
        let source = permutation.expect("one has layers").source();
        let module = naga::front::wgsl::parse_str(&source).expect("the stage parses");
        let veils = module
            .types
            .iter()
            .find(|(_, ty)| ty.name.as_deref() == Some("Veils"));
        let (_, veils) = veils.expect("veils are in the text");
        let TypeInner::Struct { members, .. } = &veils.inner else {
            panic!("{veils:?}");
        };
        assert_eq!(u64::from(members[1].offset), VEILS_AT);
        let TypeInner::Array { stride, .. } = module.types[members[1].ty].inner else {
            panic!("{members:?}");
        };
        assert_eq!(stride as usize, size_of::<Veil>());
    }
}
