//! How a curve is laid out in grids, once its stations are chosen. On a tube u runs along the curve, and v around it. On a
//! ribbon v runs along it, and u across: so what a few of its micropolygons need is side by side in memory, not in a row of each
//! coordinate of each edge ([`crate::grid::planar`]).

use std::ops::Range;

use super::set::Station;
use crate::dice::fill::Size;
use crate::grid::MAX_GRID_RATE;

const MOST: usize = MAX_GRID_RATE as usize;

/// What a curve is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A flat ribbon across its normals.
    Flat,
    /// A ribbon that faces the camera, shaded round.
    Facing,
    /// A closed tube.
    Tube {
        /// Of its cross-section.
        sides: u16,
        /// Whether its ends are worth closing.
        caps: bool,
    },
}

/// A curve that will be rendered.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Which of the set's spans.
    pub span: u32,
    /// Form.
    pub form: Form,
    /// Its stations in those of its chunk.
    pub stations: Range<u32>,
}

/// Parts of at most 16 cells that `cells` are cut into, evenly.
pub fn pieces(cells: usize) -> impl Iterator<Item = Range<usize>> {
    let count = cells.div_ceil(MOST);
    (0..count).map(move |i| cells * i / count..cells * (i + 1) / count)
}

/// Ranges of stations that become one grid's length each: they end at corners too.
pub fn runs(stations: &[Station]) -> impl Iterator<Item = Range<usize>> {
    let last = stations.len() - 1;
    let mut start = 0;
    std::iter::from_fn(move || {
        if start >= last {
            return None;
        }
        let end = (start + 1..last)
            .find(|&i| stations[i].corner)
            .unwrap_or(last);
        let run = start..end;
        start = end;
        Some(run)
    })
    .flat_map(|run| pieces(run.len()).map(move |p| run.start + p.start..run.start + p.end))
}

impl Form {
    /// Adds what a curve with these stations takes.
    pub fn measure(self, stations: &[Station], size: &mut Size) {
        for run in runs(stations) {
            match self {
                Form::Flat | Form::Facing => size.add(1, run.len()),
                Form::Tube { sides, .. } => {
                    for piece in pieces(sides.into()) {
                        size.add(run.len(), piece.len());
                    }
                }
            }
        }
        if let Form::Tube { sides, caps: true } = self {
            for piece in pieces(sides.into()) {
                size.add(1, piece.len());
                size.add(1, piece.len());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_cover_a_curve_and_end_at_corners() {
        let station = |corner| Station {
            segment: 0,
            t: 0.0,
            corner,
        };
        for n in 2..70 {
            let mut stations = vec![station(false); n];
            stations[n / 3].corner = true;
            stations[0].corner = true;
            let all: Vec<_> = runs(&stations).collect();
            assert_eq!((all[0].start, all[all.len() - 1].end), (0, n - 1));
            assert!(all.windows(2).all(|w| w[0].end == w[1].start));
            assert!(all.iter().all(|r| (1..=MOST).contains(&r.len())));
            assert!(n / 3 == 0 || all.iter().any(|r| r.end == n / 3));
        }
        assert_eq!(pieces(17).map(|p| p.len()).collect::<Vec<_>>(), [8, 9]);
    }
}
