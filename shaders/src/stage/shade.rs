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
    /// Its lens, film back or exposure changes.
    pub lens_changes: bool,
    /// Something is not opaque: what rays meet is taken in layer by layer.
    pub layers: bool,
    /// What is kept beside colours.
    pub values: KeptValues,
}

/// Values of what rays see first that are kept, whose means AOVs show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct KeptValues {
    /// Normals.
    pub normal: bool,
    /// Normals in camera space.
    pub n_eye: bool,
    /// Where things go in the image.
    pub motion: bool,
    /// Primvars, of which each instance has a look.
    pub primvars: u32,
    /// Floats of all of them.
    pub floats: u32,
}

impl KeptValues {
    /// None, each alone, and all together.
    pub fn all() -> impl Iterator<Item = Self> {
        [0, 1, 2, 4, 8, 15].into_iter().map(|i| Self {
            normal: i & 1 != 0,
            n_eye: i & 2 != 0,
            motion: i & 4 != 0,
            primvars: i >> 3,
            floats: 3 * (i >> 3),
        })
    }

    /// Floats of a ray.
    pub fn count(self) -> u32 {
        let normals = 3 * u32::from(self.normal) + 3 * u32::from(self.n_eye);
        normals + 2 * u32::from(self.motion) + self.floats
    }

    /// The WGSL of `keep`, and of what it needs.
    fn source(self) -> String {
        if self.count() == 0 {
            return include_str!("../wgsl/keep_none.wgsl").to_owned();
        }
        let fixed = format!(
            "const VALUES: u32 = {}u;\nconst NORMAL: bool = {};\nconst NEYE: bool = {};\nconst MOTION: bool = {};\nconst PRIMVARS: u32 = {}u;\n",
            self.count(),
            self.normal,
            self.n_eye,
            self.motion,
            self.primvars,
        );
        let motion: &[&str] = match self.motion {
            true => &[
                include_str!("../wgsl/placed.wgsl"),
                include_str!("../wgsl/motion.wgsl"),
            ],
            false => &[include_str!("../wgsl/motion_none.wgsl")],
        };
        fixed + &motion.concat() + include_str!("../wgsl/keep_values.wgsl")
    }
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
    /// All there are, but not all that may be kept together.
    pub fn all() -> impl Iterator<Item = Self> {
        KeptValues::all().flat_map(|values| {
            (0..32).map(move |i| Self {
                color: i & 1 != 0,
                time: i & 2 != 0,
                camera_moves: i & 4 != 0,
                layers: i & 8 != 0,
                lens_changes: i & 16 != 0,
                values,
            })
        })
    }

    /// Looks of an instance: its own, its opacity where there are layers, and primvars.
    pub fn looks(self) -> u32 {
        1 + u32::from(self.layers) + self.values.primvars
    }

    /// The WGSL of the stage; its entry point is `shade`.
    pub fn source(self) -> String {
        let fixed = format!(
            "const COLOR: bool = {};\nconst TIME: bool = {};\nconst MOVES: bool = {};\nconst LENS_CHANGES: bool = {};\nconst NORMALS: bool = {};\nconst LOOKS: u32 = {}u;\n",
            self.color,
            self.time,
            self.camera_moves,
            self.lens_changes,
            self.values.normal || self.values.n_eye,
            self.looks(),
        );
        [
            fixed.as_str(),
            crate::layout::SOURCE,
            include_str!("../wgsl/keys.wgsl"),
            include_str!("../wgsl/facet.wgsl"),
            include_str!("../wgsl/place.wgsl"),
            include_str!("../wgsl/circle.wgsl"),
            include_str!("../wgsl/pose.wgsl"),
            include_str!("../wgsl/lens.wgsl"),
            include_str!("../wgsl/shade.wgsl"),
            &self.values.source(),
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
            let kept = permutation.values;
            for (word, asked) in [
                ("values", kept.count() > 0),
                ("projected", kept.motion),
                ("placed", kept.motion),
                ("DOUBLE_SIDED", kept.count() > 0),
            ] {
                assert_eq!(code(&source).contains(word), asked, "{word}");
            }
            let buffers = bindings(&source).len();
            let more = usize::from(permutation.layers) + usize::from(kept.count() > 0);
            assert_eq!(buffers, 13 + more);
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
