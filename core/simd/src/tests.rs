//! Every level against plain Rust, operation by operation, bit by bit.

use super::*;

/// Numbers with all signs and sizes, from `seed`.
fn numbers<const N: usize>(seed: u32) -> [f32; N] {
    std::array::from_fn(|i| {
        let h = (seed.wrapping_mul(0x9e37_79b9) ^ (i as u32).wrapping_mul(0x85eb_ca6b))
            .wrapping_mul(0xc2b2_ae35);
        match h >> 29 {
            0 => 0.0,
            1 => -0.0,
            2 => (h & 7) as f32 - 3.0,
            _ => f32::from_bits(h & 0xbfff_ffff | 0x2000_0000),
        }
    })
}

/// Bits of everything that a level computes of some numbers.
struct Everything {
    seed: u32,
}

impl Everything {
    #[inline(always)]
    fn floats<const N: usize, F: Float<N>>(&self, a: F, b: F, out: &mut Vec<u32>) {
        let mut put = |f: F| out.extend(f.to_array().map(f32::to_bits));
        put(a + b);
        put(a - b);
        put(a * b);
        put(-a);
        put(a.min(b));
        put(a.max(b));
        put(a.over(b));
        put(a.sqrt());
        put(a.abs());
        put(a.or(a.lt(b), b));
        let masks = [a.lt(b), a.le(b), a.lt(b) & b.le(a), a.lt(b) | b.lt(a)];
        out.extend(masks.map(Mask::bits));
        out.extend([a.least(), a.most()].map(|x| (x + 0.0).to_bits()));
    }
}

impl Kernel for Everything {
    type Output = Vec<u32>;
    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> Vec<u32> {
        let mut out = Vec::new();
        let (a, b) = (numbers::<16>(self.seed), numbers::<16>(self.seed + 1));
        self.floats(s.from16(&a), s.from16(&b), &mut out);
        let (a8, b8) = (numbers::<8>(self.seed), numbers::<8>(self.seed + 2));
        self.floats(s.from8(&a8), s.from8(&b8), &mut out);
        let put8 = |x: S::F8| x.to_array().map(f32::to_bits);
        out.extend(put8(s.halves_swapped(s.from8(&a8))));
        let rows = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| s.from8(&numbers::<8>(self.seed + i)));
        out.extend(s.transposed(rows).map(put8).as_flattened());
        let rows: [[f32; 8]; 16] = std::array::from_fn(|i| numbers(self.seed + i as u32));
        let pairs: [[f32; 2]; 16] = std::array::from_fn(|i| [rows[i][3], rows[i][6]]);
        let columns = s.columns(rows.each_ref()).into_iter();
        for column in columns.chain(s.unzipped(pairs.each_ref())) {
            out.extend(column.to_array().map(f32::to_bits));
        }
        for (bits, places) in [
            (0xffff, 0xf0f0_1234_8001_0103),
            (self.seed * 0x1235, u64::MAX),
            (5, 0),
        ] {
            let spread = s.spread(bits & 0xffff, places);
            assert_eq!(spread & !places, 0);
            out.extend([spread as u32, (spread >> 32) as u32]);
        }
        let bytes = std::array::from_fn(|i| (self.seed * 37 + i as u32 * 53) as u8);
        out.extend(s.bytes8(&bytes).to_array().map(f32::to_bits));
        let other = bytes.map(|b: u8| b.wrapping_mul(91));
        let mut put = |x: S::F16| out.extend(x.to_array().map(f32::to_bits));
        put(s.bytes_in_turns(&bytes, &other));
        put(s.in_turns(&[a[0], a[1]]));
        let (a16, b16) = (s.from16(&a), s.from16(&b));
        put(s.swapped(a16));
        s.zip(a16, b16).into_iter().for_each(&mut put);
        put(s.in_pairs(s.from8(&a8), s.from8(&b8)));
        put(s.halves(s.from8(&a8), s.from8(&b8)));
        let [x, y, z, w, ..] = a;
        put(s.quarters(&[x, y, z, w]));
        put(s.over_quarters::<0>(a16));
        put(s.over_quarters::<1>(a16));
        put(s.over_quarters::<2>(a16));
        put(s.over_quarters::<3>(a16));
        let order = std::array::from_fn(|i| (i as u32 * 7 + self.seed) as u8 & 15);
        put(s.bytes16(&[bytes, other], &order));
        let pairs: [[f32; 2]; 8] = std::array::from_fn(|i| [rows[i][1], rows[i][7]]);
        for half in s
            .of_halves(a16)
            .into_iter()
            .chain(s.unzipped8(pairs.each_ref()))
        {
            out.extend(put8(half));
        }
        let mask = self.seed.wrapping_mul(0x9e37_79b1) >> 24;
        let (mut kept, mut words) = ([0.0; 8], [0; 8]);
        s.kept(
            mask,
            s.from8(&a8),
            &b8.map(f32::to_bits),
            &mut kept,
            &mut words,
        );
        let count = mask.count_ones() as usize;
        out.extend(
            kept[..count]
                .iter()
                .map(|x| x.to_bits())
                .chain(words[..count].iter().copied()),
        );
        // Also lanes that are equal but for the last bits, and negative ones.
        let mut near = a8;
        near[self.seed as usize & 7] = near[self.seed as usize >> 3 & 7].next_up();
        for near in [near, near.map(f32::abs), [0.0; 8]] {
            let (mut falling, mut words) = ([0.0; 8], [0; 8]);
            let own = b8.map(f32::to_bits);
            s.falling(mask, s.from8(&near), &own, &mut falling, &mut words);
            out.extend(falling[..count].iter().map(|x| x.to_bits()));
            out.extend(words[..count].iter().copied());
        }
        let less = a16.lt(s.swapped(a16));
        let (less, equal) = (less | s.swapped(a16).lt(a16), b16.le(-s.swapped(b16)));
        let bits = s.more_bits(s.no_bits(), less, 63);
        let bits = s.more_bits(bits, equal, self.seed as usize & 63);
        out.push(s.some_bits(bits));
        let words = |bits: u64| [bits as u32, (bits >> 32) as u32];
        out.extend(s.bits_of(bits).into_iter().flat_map(words));
        out.extend(s.all8(a[3]).to_array().map(f32::to_bits));
        out.extend(s.all16(a[3]).to_array().map(f32::to_bits));
        for by in [0.0, 1.0 / 3.0, -1e9, 1e-40] {
            out.extend(s.less16(s.from16(&a), by).to_array().map(f32::to_bits));
        }
        let mask = s.mask8(self.seed.wrapping_mul(0x1234_5671));
        out.push(mask.bits());
        out.extend(put8(s.from8(&a8).or(mask, s.from8(&b8))));
        out.push(s.high_bits(&a8.map(f32::to_bits)));
        let mask = s.mask16(self.seed.wrapping_mul(0x1234_5671));
        out.push(mask.bits());
        out.extend(
            s.from16(&a)
                .or(mask, s.from16(&b))
                .to_array()
                .map(f32::to_bits),
        );
        for [low, high] in [[a8, b8], [bytes.map(f32::from), a8.map(|x| x * 100.0)]] {
            let bytes = s.outward8(s.from8(&low), s.from8(&high));
            out.extend(bytes.iter().flatten().map(|&x| u32::from(x)));
        }
        for fours in [
            s.least_of_fours(s.from16(&a), s.from16(&b)),
            s.most_of_fours(s.from16(&a), s.from16(&b)),
        ] {
            out.extend(fours.to_array().map(f32::to_bits));
        }
        let plane: Vec<f32> = (0..60).map(|i| i as f32).collect();
        for rows in [[0, 1, 2, 3], [55, 0, 55, 7], [9, 9, 30, 55]] {
            for row in s.rows(&plane, rows) {
                out.extend(row.to_array().map(f32::to_bits));
            }
            for row in s.long_rows(&plane, [rows[1], rows[2] - 4 * (rows[2] / 55)]) {
                out.extend(row.to_array().map(f32::to_bits));
            }
        }
        for (first, stride) in [(3, 5), (3, 9), (3, 17), (0, 1), (0, 2), (5, 4)] {
            // Only a hint: rows that are not there do no harm.
            s.expect_lattices::<2>(&plane, first, stride, 9);
            s.expect_lattices::<2>(&plane, usize::MAX, stride, 9);
            let lattice = s.lattice(&plane, first, stride);
            let triangles = s.triangles(lattice);
            for corner in triangles {
                out.extend(corner.to_array().map(f32::to_bits));
            }
            for l in 0..16 {
                for (corner, lane) in triangles.iter().zip(s.corners(l)) {
                    assert_eq!(lattice.to_array()[lane], corner.to_array()[l]);
                }
            }
        }
        let floats: Vec<f32> = (0..200).map(|i| i as f32).collect();
        for (first, columns, key) in [(3, 17, 7), (0, 2, 99), (5, 1, 3)] {
            let lattices = s.lattices::<2>(&floats, first, columns, key, [2, 0, 1]);
            for (k, lattices) in lattices.iter().enumerate() {
                for (lattice, axis) in lattices.iter().zip([2, 0, 1]) {
                    let at = first + k * key + axis * columns;
                    let alone = s.lattice(&floats, at, 3 * columns);
                    assert_eq!(lattice.to_array(), alone.to_array());
                }
            }
        }
        out
    }
}

#[test]
fn levels_agree() {
    for seed in 0..200 {
        let expected = Level::SCALAR.run(Everything { seed });
        for level in Level::available() {
            assert!(
                level.run(Everything { seed }) == expected,
                "{} differs for {seed}",
                level.name()
            );
        }
    }
}

struct MulAdd;

impl Kernel for MulAdd {
    type Output = [f32; 16];
    #[inline(always)]
    fn run<S: Simd>(self, s: S) -> [f32; 16] {
        let (a, b, c) = (numbers(5), numbers(9), numbers(11));
        s.from16(&a).mul_add(s.from16(&b), s.from16(&c)).to_array()
    }
}

#[test]
fn lanes_that_are_asked_for_fall() {
    let (inf, nan) = (f32::INFINITY, f32::NAN);
    let falling = [
        -nan,
        -inf,
        -1.0,
        -0.0,
        nan,
        inf,
        f32::MAX,
        3.0,
        0.5,
        1e-30,
        0.0,
    ];
    for turn in 0..falling.len() {
        let order: [usize; 8] = std::array::from_fn(|i| (i * 7 + turn) % falling.len());
        let x = Scalar.from8(&order.map(|i| falling[i]));
        for mask in 0..256u32 {
            let some = (0..8).filter(|i| mask >> i & 1 == 1);
            let mut some: Vec<usize> = some.map(|i| order[i]).collect();
            some.sort_unstable();
            let (mut found, mut words) = ([0.0; 8], [0; 8]);
            let numbers = order.map(|i| i as u32);
            Scalar.falling(mask, x, &numbers, &mut found, &mut words);
            for (k, &i) in some.iter().enumerate() {
                assert_eq!(words[k], i as u32, "{order:?} {mask:b}");
                assert_eq!(found[k].to_bits(), falling[i].to_bits());
            }
        }
    }
}

#[test]
fn mul_add_rounds_once_or_twice() {
    let (a, b, c): ([f32; 16], [f32; 16], [f32; 16]) = (numbers(5), numbers(9), numbers(11));
    for level in Level::available() {
        let found = level.run(MulAdd);
        for i in 0..16 {
            let exact = f64::from(a[i]) * f64::from(b[i]) + f64::from(c[i]);
            let size = (f64::from(a[i]) * f64::from(b[i])).abs() + f64::from(c[i]).abs();
            assert!((f64::from(found[i]) - exact).abs() <= size * 2f64.powi(-23));
        }
    }
}

#[test]
fn fours_are_joined_and_bytes_rounded_outward() {
    let a = std::array::from_fn(|i| (i * 7 % 16) as f32);
    let b = a.map(|x| -x);
    let of = |x: &[f32; 16], i: usize, join: fn(f32, f32) -> f32| {
        x[4 * i..4 * i + 4].iter().copied().reduce(join).unwrap()
    };
    let (a16, b16) = (Scalar.from16(&a), Scalar.from16(&b));
    let least = Scalar.least_of_fours(a16, b16).to_array();
    let most = Scalar.most_of_fours(a16, b16).to_array();
    for i in 0..4 {
        assert_eq!(
            [least[i], most[i]],
            [of(&a, i, f32::min), of(&a, i, f32::max)]
        );
        assert_eq!(
            [least[i + 4], most[i + 4]],
            [of(&b, i, f32::min), of(&b, i, f32::max)]
        );
    }
    let x = [-3.5, -0.0, 0.2, 1.0, 254.9, 255.0, 255.1, 1e30];
    let bytes = Scalar.outward8(Scalar.from8(&x), Scalar.from8(&x));
    assert_eq!(bytes[0], [0, 0, 0, 1, 254, 255, 255, 255]);
    assert_eq!(bytes[1], [0, 0, 1, 1, 255, 255, 255, 255]);
    let rows = Scalar.rows(&a, [0, 11, 3, 5]);
    assert_eq!(rows[0].to_array()[4..8], a[11..15]);
    assert_eq!(rows[1].to_array()[4..8], a[12..16]);
    let rows = Scalar.long_rows(&a, [0, 7]);
    assert_eq!(rows[0].to_array()[8..], a[7..15]);
    assert_eq!(rows[1].to_array()[8..], a[8..16]);
}

#[test]
#[should_panic]
fn rows_end_with_the_plane() {
    Level::best().run(LastRow);
}

#[test]
#[should_panic]
fn long_rows_end_with_the_plane() {
    Level::best().run(LastLongRow);
}

struct LastLongRow;

impl Kernel for LastLongRow {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        s.long_rows(&[0.0; 20], [12, 0]);
    }
}

struct LastRow;

impl Kernel for LastRow {
    type Output = ();
    #[inline(always)]
    fn run<S: Simd>(self, s: S) {
        s.rows(&[0.0; 20], [0, 16, 0, 0]);
    }
}

#[test]
fn pairs_are_lanes_in_turns() {
    let a: [f32; 16] = std::array::from_fn(|i| i as f32);
    let b = a.map(|x| -x);
    let (even, odd) = (Scalar.from16(&a), Scalar.from16(&b));
    let pairs = Scalar.zip(even, odd);
    assert_eq!(pairs[0].to_array()[4..8], [2.0, -2.0, 3.0, -3.0]);
    assert_eq!(pairs[1].to_array()[4..8], [10.0, -10.0, 11.0, -11.0]);
    let eight = [&a, &b].map(|x| Scalar.from8(&std::array::from_fn(|i| x[i])));
    let joined = Scalar.in_pairs(eight[0], eight[1]).to_array();
    assert_eq!(joined, pairs[0].to_array());
    let swapped = Scalar.swapped(pairs[0]).to_array();
    assert_eq!(swapped[4..8], [-2.0, 2.0, -3.0, 3.0]);
    let bytes = Scalar.bytes_in_turns(&[7; 8], &[1, 2, 3, 4, 5, 6, 7, 8]);
    assert_eq!(bytes.to_array()[10..], [7.0, 6.0, 7.0, 7.0, 7.0, 8.0]);
}

#[test]
fn bits_are_set_in_pairs_of_lanes() {
    let bits = Scalar.more_bits(Scalar.no_bits(), Scalar.mask16(0b11_0011), 40);
    let bits = Scalar.more_bits(bits, Scalar.mask16(0b11_0000), 1);
    assert_eq!(Scalar.bits_of(bits)[..4], [1 << 40, 0, 1 << 40 | 2, 0]);
    assert_eq!(Scalar.some_bits(bits), 0b101);
}

#[test]
fn triangles_are_those_of_the_lattice() {
    // Vertex (i, j) is the number 10 j + i.
    let plane: Vec<f32> = (0..30).map(|n| (n / 5 * 10 + n % 5) as f32).collect();
    let corners = Scalar.triangles(Scalar.lattice(&plane, 0, 5));
    for l in 0..8 {
        let at = |corner: usize, lane: usize| corners[corner].to_array()[lane];
        let first = (10 * (l / 4) + l % 4) as f32;
        assert_eq!(
            [0, 1, 2].map(|c| at(c, l)),
            [first, first + 1.0, first + 11.0]
        );
        assert_eq!(
            [0, 1, 2].map(|c| at(c, l + 8)),
            [first, first + 11.0, first + 10.0]
        );
    }
}
