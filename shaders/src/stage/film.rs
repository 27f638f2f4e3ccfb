//! The text of the stage `film`.

/// The WGSL of the stage; its entry point is `film`.
pub fn film_source() -> String {
    [
        crate::layout::SOURCE,
        include_str!("../wgsl/tiles.wgsl"),
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
    fn it_is_valid() {
        let [side, _] = TILE_SQUARE;
        check(&film_source(), &[("film", [side * side, 1, 1])]);
    }
}
