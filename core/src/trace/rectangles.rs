//! Orders places along a surface so that packets of those that follow each other fill small rectangles.
//!
//! What a tile sweeps is long and thin where it moves, and goes any way across the image: it is cut across its length into slabs with
//! about as many places each, and along each, forth and back, by narrow bins. Places are sorted by counting, in two passes over them.

use hdtrapeze_simd::{Float, Kernel, Level, Simd};

use super::expected::Places;
use super::packet::{LANES, PACKET, WHOLE};

/// Columns along what is swept, of which slabs are made.
const COLUMNS: usize = 1024;
/// Bins across it.
const BINS: usize = 64;
/// Slabs that columns become, at the most.
const MOST_SLABS: usize = 256;
/// What columns and bins reach, of what uniform places sweep.
const REACH: f32 = 1.2;
/// One of so many vectors is counted for the columns, where there are [`MANY`].
const EVERY: usize = 4;
/// Vectors of 1024 places.
const MANY: usize = 64;

/// Numbers of columns, and of bins of all slabs, are of 16 bits; bins are counted backward by their bits.
const _: () = assert!(COLUMNS <= 1 << 16 && MOST_SLABS * BINS <= 1 << 16);
const _: () = assert!(BINS.is_power_of_two() && COLUMNS.is_power_of_two());

/// The order, as numbers of places; `None` where places are not finite, or all the same.
pub fn in_rectangles(level: Level, places: &Places) -> Option<Vec<u32>> {
    level.run(Cut { places })
}

struct Cut<'a> {
    places: &'a Places,
}

impl Kernel for Cut<'_> {
    type Output = Option<Vec<u32>>;
    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> Option<Vec<u32>> {
        let Places { at, count } = self.places;
        let swept = Swept::of(simd, at)?;
        let (along, across) = (swept.along(), swept.across());

        let mut columns = [0u32; COLUMNS];
        // Of each four vectors one, which a sample of 64 pixels has: other pixels from sample to sample, and from block to block.
        let every = if at.len() < MANY { 1 } else { EVERY };
        let counted = (0..at.len().div_ceil(every)).map(|k| every * k + (k + k / every) % every);
        for at in counted.filter_map(|k| at.get(k)) {
            for column in along.numbers(simd, at) {
                columns[usize::from(column)] += 1;
            }
        }
        // The first bin of each column's slab, and the way along it.
        let total: u32 = columns.iter().sum();
        let slabs = swept.slabs(*count);
        let mut before = 0;
        let slab_of = columns.map(|own| {
            let slab = (before as usize + own as usize / 2) * slabs / total as usize;
            before += own;
            // Columns at the end may have places of which none was counted.
            let slab = slab.min(slabs - 1);
            let flip = if slab.is_multiple_of(2) { 0 } else { BINS - 1 };
            (slab * BINS) as u16 | flip as u16
        });

        let mut begin = vec![0u32; slabs * BINS];
        let mut keys = vec![[0u16; LANES]; at.len()];
        for (at, own) in at.iter().zip(&mut keys) {
            let (columns, bins) = (along.numbers(simd, at), across.numbers(simd, at));
            for (key, (column, bin)) in own.iter_mut().zip(columns.into_iter().zip(bins)) {
                *key = slab_of[usize::from(column) & (COLUMNS - 1)] ^ bin;
            }
        }
        let keys = &keys.as_flattened()[..*count];
        for &key in keys {
            begin[usize::from(key)] += 1;
        }
        let mut sum = 0;
        for begin in &mut begin {
            sum += std::mem::replace(begin, sum);
        }
        let mut order = vec![0; *count];
        for (i, &key) in (0..).zip(keys) {
            let begin = &mut begin[usize::from(key)];
            order[*begin as usize] = i;
            *begin += 1;
        }
        Some(order)
    }
}

/// A rectangle over which places are spread about uniformly, as their mean and squares tell.
struct Swept {
    middle: [f32; 2],
    /// Direction of its length, as cosine and sine.
    direction: [f32; 2],
    /// Halves of its length and width.
    halves: [f32; 2],
}

impl Swept {
    #[inline(always)]
    fn of<S: Simd>(simd: S, at: &[[[f32; LANES]; 2]]) -> Option<Self> {
        let none = simd.all16(0.0);
        let (mut sum, mut squares) = ([none; 2], [none; 3]);
        // About the first, so that squares are of small numbers.
        let first = at.first()?.map(|lanes| lanes[0]);
        for at in at {
            let x = simd.from16(&at[0]) - simd.all16(first[0]);
            let y = simd.from16(&at[1]) - simd.all16(first[1]);
            sum = [sum[0] + x, sum[1] + y];
            squares = [squares[0] + x * x, squares[1] + x * y, squares[2] + y * y];
        }
        let all = (at.len() * LANES) as f32;
        let mean = |lanes: [f32; LANES]| lanes.iter().sum::<f32>() / all;
        let [x, y] = [sum[0].to_array(), sum[1].to_array()].map(mean);
        let squares = [
            squares[0].to_array(),
            squares[1].to_array(),
            squares[2].to_array(),
        ];
        let [xx, xy, yy] = squares.map(mean);
        let (xx, xy, yy) = (xx - x * x, xy - x * y, yy - y * y);
        let half = (0.25 * (xx - yy).powi(2) + xy * xy).sqrt();
        let (long, wide) = (0.5 * (xx + yy) + half, 0.5 * (xx + yy) - half);
        if !(long > 0.0 && long.is_finite()) {
            return None;
        }
        let (sin, cos) = (0.5 * (2.0 * xy).atan2(xx - yy)).sin_cos();
        Some(Self {
            middle: [first[0] + x, first[1] + y],
            direction: [cos, sin],
            // Uniform over a length, this is from its middle to an end.
            halves: [long, wide.max(1e-4 * long)].map(|square| (3.0 * square).sqrt()),
        })
    }

    /// So many that packets along one are about as long as wide.
    fn slabs(&self, count: usize) -> usize {
        let [long, wide] = self.halves;
        let slabs = (count as f32 / PACKET as f32 * long / wide).sqrt();
        (slabs.round() as usize).clamp(1, MOST_SLABS)
    }

    /// Columns along its length.
    fn along(&self) -> Ruler {
        Ruler::new(self.middle, self.direction, self.halves[0], COLUMNS)
    }

    /// Bins across it.
    fn across(&self) -> Ruler {
        let [cos, sin] = self.direction;
        Ruler::new(self.middle, [-sin, cos], self.halves[1], BINS)
    }
}

/// Numbers places along a direction. What is beyond an end has the first or last number.
struct Ruler {
    by: [f32; 2],
    plus: f32,
    last: f32,
}

impl Ruler {
    fn new(middle: [f32; 2], direction: [f32; 2], half: f32, numbers: usize) -> Self {
        let numbers = numbers as f32;
        let by = direction.map(|d| d * 0.5 * numbers / (REACH * half));
        Self {
            by,
            plus: 0.5 * numbers - by[0] * middle[0] - by[1] * middle[1] - 0.5,
            last: numbers - 1.0,
        }
    }

    #[inline(always)]
    fn numbers<S: Simd>(&self, simd: S, at: &[[f32; LANES]; 2]) -> [u16; LANES] {
        let x = simd.from16(&at[0]) * simd.all16(self.by[0]);
        let y = simd.from16(&at[1]) * simd.all16(self.by[1]);
        let along = x + y + simd.all16(self.plus);
        let along = along.max(simd.all16(0.0)).min(simd.all16(self.last));
        // The nearest whole numbers, side by side: `plus` is half less.
        let whole = along + simd.all16(WHOLE);
        whole.to_array().map(|x| x.to_bits() as u16)
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec2;

    use super::*;
    use crate::trace::random::unit;

    /// The order, which all levels agree on.
    fn in_order(places: &[[f32; 2]]) -> Option<Vec<u32>> {
        let lanes = |places: &[[f32; 2]]| {
            let of = |lane: usize| places[lane.min(places.len() - 1)];
            [0, 1].map(|axis| std::array::from_fn(|lane| of(lane)[axis]))
        };
        let places = Places {
            at: places.chunks(LANES).map(lanes).collect(),
            count: places.len(),
        };
        let order = in_rectangles(Level::SCALAR, &places);
        for level in Level::available() {
            assert_eq!(in_rectangles(level, &places), order, "{level:?}");
        }
        order
    }

    /// Mean area of the boxes around packets, to what it would be if they covered all once.
    fn boxes(places: &[[f32; 2]], order: &[u32], all: f32) -> f32 {
        let (packets, _) = order.as_chunks::<PACKET>();
        let area = |packet: &[u32; PACKET]| {
            let at = packet.iter().map(|&i| Vec2::from(places[i as usize]));
            let low = at.clone().fold(Vec2::INFINITY, Vec2::min);
            (at.fold(Vec2::NEG_INFINITY, Vec2::max) - low).element_product()
        };
        packets.iter().map(area).sum::<f32>() / all
    }

    #[test]
    fn packets_fill_small_rectangles_whatever_the_direction() {
        for (long, wide) in [(1.0f32, 1.0f32), (20.0, 1.0), (300.0, 0.5)] {
            for angle in [0.0f32, 0.5, 1.3, 2.5] {
                let state = &mut 11;
                let place = |_| {
                    let at = Vec2::new((unit(state) - 0.5) * long, (unit(state) - 0.5) * wide);
                    (Vec2::from_angle(angle).rotate(at) + 7.0).to_array()
                };
                let places: Vec<[f32; 2]> = (0..8192).map(place).collect();
                let order = in_order(&places).unwrap();
                let mut all = order.clone();
                all.sort_unstable();
                assert!(all.into_iter().eq(0..8192));
                // Turned back, so that boxes lie along rectangles.
                let back = Vec2::from_angle(-angle);
                let along = |p: &[f32; 2]| back.rotate(Vec2::from(*p)).to_array();
                let turned: Vec<[f32; 2]> = places.iter().map(along).collect();
                let share = boxes(&turned, &order, long * wide);
                // A square has no direction, so that it may be cut any way.
                let most = if long == wide { 2.4 } else { 1.8 };
                assert!(
                    (0.5..most).contains(&share),
                    "{long} {wide} {angle}: {share}"
                );
            }
        }
    }

    #[test]
    fn any_number_of_places_is_ordered() {
        let state = &mut 9;
        for count in [2, 15, 16, 17, 273, 1000, 1025, 5001] {
            let places: Vec<[f32; 2]> = (0..count).map(|_| [unit(state), unit(state)]).collect();
            let mut all = in_order(&places).unwrap();
            all.sort_unstable();
            assert!(all.into_iter().eq(0..count), "{count}");
        }
    }

    #[test]
    fn what_is_not_counted_has_a_slab_too() {
        let state = &mut 6;
        let mut places: Vec<[f32; 2]> = (0..2048).map(|_| [unit(state), unit(state)]).collect();
        // In the second vector, behind all that are counted.
        places[LANES + 3][0] += 40.0;
        let order = in_order(&places).unwrap();
        assert_eq!(
            order.iter().map(|&i| i as usize).sum::<usize>(),
            2048 * 2047 / 2
        );
        assert!(order[1536..].contains(&(LANES as u32 + 3)));
    }

    #[test]
    fn places_far_off_and_none_are_no_trouble() {
        let state = &mut 5;
        let mut places: Vec<[f32; 2]> = (0..2048).map(|_| [unit(state), unit(state)]).collect();
        // A ray in a hundred ends far behind.
        for place in places.iter_mut().step_by(100) {
            place[0] += 4.0;
        }
        let order = in_order(&places).unwrap();
        let inside: Vec<u32> = order
            .into_iter()
            .filter(|&i| places[i as usize][0] <= 1.0)
            .collect();
        let share = boxes(&places, &inside, 1.0);
        assert!(share < 4.0, "{share}");

        assert!(in_order(&[]).is_none());
        assert!(in_order(&[[0.5, 0.5]; 64]).is_none());
        for bad in [f32::NAN, f32::INFINITY, f32::MAX] {
            places[77] = [bad, 0.0];
            let order = in_order(&places);
            assert!(order.is_none(), "{bad}");
        }
        // A line.
        let line: Vec<[f32; 2]> = (0..1024u16).map(|i| [f32::from(i), 0.0]).collect();
        let mut all = in_order(&line).unwrap();
        all.sort_unstable();
        assert!(all.into_iter().eq(0..1024));
    }
}
