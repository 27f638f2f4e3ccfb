//! The text of the stage `film`.

/// What is filmed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct FilmPermutation {
    /// Hits are what is seen first, else what is met first.
    pub seen: bool,
    /// Floats of each sample that are summed up beside its colour.
    pub values: u32,
}

impl FilmPermutation {
    /// The WGSL of the stage; its entry point is `film`.
    pub fn source(self) -> String {
        let fixed = match self.values {
            0 => String::new(),
            values => format!("const VALUES: u32 = {values}u;\n"),
        };
        [
            fixed.as_str(),
            crate::layout::SOURCE,
            include_str!("../wgsl/tiles.wgsl"),
            match self.seen {
                true => include_str!("../wgsl/seen_as_told.wgsl"),
                false => include_str!("../wgsl/seen_where_opaque.wgsl"),
            },
            match self.values {
                0 => include_str!("../wgsl/means_none.wgsl"),
                _ => include_str!("../wgsl/means_some.wgsl"),
            },
            include_str!("../wgsl/film.wgsl"),
        ]
        .concat()
    }
}

#[cfg(test)]
mod tests {
    use super::super::TILE_SQUARE;
    use super::super::tests::{bindings, check, code};
    use super::*;

    #[test]
    fn every_permutation_is_valid() {
        let [side, _] = TILE_SQUARE;
        for seen in [false, true] {
            for values in [0, 1, 8] {
                let source = FilmPermutation { seen, values }.source();
                check(&source, &[("film", [side * side, 1, 1])]);
            }
        }
    }

    /// What nobody asks for is not in the text.
    #[test]
    fn sums_are_only_where_they_are_asked_for() {
        for values in [0, 2] {
            let source = FilmPermutation {
                values,
                ..FilmPermutation::default()
            }
            .source();
            for word in ["values", "sums"] {
                assert_eq!(code(&source).contains(word), values > 0, "{word}");
            }
            assert_eq!(bindings(&source).len(), if values > 0 { 7 } else { 5 });
        }
    }
}
