//! The text of the stage `film`.

/// The WGSL of the stage; its entry point is `film`. With `layers` hits are what is seen first, else what is met first.
pub fn film_source(layers: bool) -> String {
    [
        crate::layout::SOURCE,
        include_str!("../wgsl/tiles.wgsl"),
        match layers {
            true => include_str!("../wgsl/seen_as_told.wgsl"),
            false => include_str!("../wgsl/seen_where_opaque.wgsl"),
        },
        include_str!("../wgsl/film.wgsl"),
    ]
    .concat()
}

#[cfg(test)]
mod tests {
    use super::super::TILE_SQUARE;
    use super::super::tests::check;
    use super::*;

    #[test]
    fn every_permutation_is_valid() {
        let [side, _] = TILE_SQUARE;
        for layers in [false, true] {
            check(&film_source(layers), &[("film", [side * side, 1, 1])]);
        }
    }
}
