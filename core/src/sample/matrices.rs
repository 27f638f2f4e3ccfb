//! Generator matrices of the two point sets, as binary columns.
//!
//! Both are *digital*: the coordinates of point `i` are the XOR of one column for each set bit of `i`.
//! Columns are kept with their bits reversed (bit 0 is the half), as the scrambler wants them.
//!
//! * Sobol: the first five dimensions of Joe and Kuo (2008, "new-joe-kuo-6"), whose primitive
//!   polynomials have degree 0, 1, 2, 3, 3: a (5, 5)-sequence in base 2.
//! * Net: Faure's sequence over GF(4) (Niederreiter 1987): dimension j uses the Pascal matrix with powers
//!   of the j-th field element, which gives a (0, 4)-sequence in base 4; the index read backwards is
//!   the fifth dimension and makes its first 4^m points a (0, m, 5)-net. The index is first multiplied by
//!   an invertible matrix, which changes only the order in which the points of the net are visited.

/// Dimensions of a sample.
pub(super) const DIMS: usize = 5;

/// Columns of one digital point set: `columns[b][d]` is XORed into dimension `d` for bit `b` of the index.
pub(super) type Columns = Vec<[u32; DIMS]>;

/// Largest `m` for which a net is offered: 4^8 = 65536 samples a pixel.
pub(super) const MAX_NET_DIGITS: u32 = 8;

/// Degree, inner coefficients and initial direction numbers of dimensions 1 to 4 (0 is van der Corput).
const JOE_KUO: [(usize, u32, &[u32]); DIMS - 1] = [
    (1, 0, &[1]),
    (2, 1, &[1, 3]),
    (3, 1, &[1, 3, 1]),
    (3, 2, &[1, 1, 1]),
];

/// Columns of the Sobol sequence for indices of 32 bits.
pub(super) fn sobol() -> Columns {
    let mut columns = vec![[0u32; DIMS]; 32];
    for (b, column) in columns.iter_mut().enumerate() {
        column[0] = 1 << b;
    }
    for (d, &(degree, inner, initial)) in JOE_KUO.iter().enumerate() {
        let mut v = [0u32; 32];
        for b in 0..32 {
            v[b] = if b < degree {
                initial[b] << (31 - b)
            } else {
                let mut x = v[b - degree] ^ (v[b - degree] >> degree);
                for k in 1..degree {
                    if (inner >> (degree - 1 - k)) & 1 == 1 {
                        x ^= v[b - k];
                    }
                }
                x
            };
            columns[b][d + 1] = v[b].reverse_bits();
        }
    }
    columns
}

/// Product in GF(4) = {0, 1, w, w + 1}, encoded as 0 to 3.
fn multiply(a: u32, b: u32) -> u32 {
    let by_w = ((a << 1) ^ if a & 2 != 0 { 0b111 } else { 0 }) & 3;
    (if b & 1 != 0 { a } else { 0 }) ^ (if b & 2 != 0 { by_w } else { 0 })
}

/// Entry (row, column) of the generator matrix of dimension `d` of the net with `m` digits.
fn net_entry(d: usize, row: u32, column: u32, m: u32) -> u32 {
    if d == DIMS - 1 {
        return u32::from(row + column + 1 == m);
    }
    // The binomial coefficient (column over row) is odd exactly when row's bits are among column's.
    if column & row != row {
        return 0;
    }
    (row..column).fold(1, |power, _| multiply(power, d as u32))
}

/// Columns of the net of 4^m points, 1 <= m <= [`MAX_NET_DIGITS`], visited in the order of [`ORDER`].
pub(super) fn net(m: u32) -> Columns {
    let mut natural = vec![[0u32; DIMS]; 2 * m as usize];
    for column in 0..m {
        for half in 0..2 {
            for (d, word) in natural[(2 * column + half) as usize].iter_mut().enumerate() {
                for row in 0..m {
                    let digit = multiply(net_entry(d, row, column, m), 1 << half);
                    // Reversed: the digit's high bit first.
                    let reversed = ((digit >> 1) | (digit << 1)) & 3;
                    *word |= reversed << (2 * row);
                }
            }
        }
    }
    ORDER[m as usize - 1]
        .iter()
        .map(|&combination| {
            let mut sum = [0; DIMS];
            for (b, column) in natural.iter().enumerate() {
                if combination >> b & 1 == 1 {
                    for d in 0..DIMS {
                        sum[d] ^= column[d];
                    }
                }
            }
            sum
        })
        .collect()
}

/// The order in which the points of the net of 4^m points are visited, for m = 1 to [`MAX_NET_DIGITS`]: bit `b` of the
/// visiting index adds (in GF(2)) the natural index `ORDER[m - 1][b]`.
///
/// Any invertible matrix visits the whole net. These were found by a randomised greedy search over
/// binary matrices, column by column, for two things at each prefix of 2^j points: no more than two points of
/// the first 4^k in any interval of length 4^-k of any axis, and the least expected variance under Owen scrambling
/// of a random integrand whose variance falls tenfold from one base-4 digit to the next and by half for each
/// further dimension of an interaction. No order can keep the full net property for every prefix: it
/// would be a (0, m, 6)-net in base 4, and none exists for m >= 2.
const ORDER: [&[u32]; MAX_NET_DIGITS as usize] = [
    &[0x1, 0x2],
    &[0x9, 0x4, 0xa, 0xf],
    &[0x19, 0x37, 0x1c, 0x3c, 0x2f, 0x31],
    &[0x9b, 0xc7, 0xf2, 0xe8, 0xe2, 0xb5, 0xcf, 0xdb],
    &[
        0x185, 0x34f, 0x134, 0x218, 0x16d, 0x07c, 0x3dc, 0x338, 0x266, 0x2b7,
    ],
    &[
        0xb9b, 0xf02, 0xc13, 0x6cf, 0x457, 0xf7e, 0xafd, 0x669, 0xff1, 0xecc, 0xb10, 0x594,
    ],
    &[
        0x3ecf, 0x1ad1, 0x081d, 0x0e06, 0x25df, 0x028e, 0x3325, 0x211f, 0x36c8, 0x329b, 0x3f11,
        0x0684, 0x3e72, 0x39d4,
    ],
    &[
        0x4da2, 0xce45, 0x2d2e, 0xda8b, 0xbcb6, 0x9931, 0x4303, 0xea86, 0x1725, 0xeee4, 0x3b7e,
        0xff24, 0x6c2a, 0x7b00, 0x0ef9, 0x2afa,
    ],
];
