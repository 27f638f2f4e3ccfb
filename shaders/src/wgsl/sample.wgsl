// Joint 5D samples, with the bits of core's sample: (x, y) in the pixel, (u, v) on the lens, the instant.
//
// Numbers of 64 bits are two words, the lower one first. Points before they are scrambled are the same for all pixels: the
// host gives them, as `words`. The permutation fixes NET (scrambled by digits in base 4 too), LENS (one of those below)
// and TIME (a time is drawn); what is not drawn is 0.

const PINHOLE: u32 = 0u;
// A disk, an oval, or one point of it.
const ROUND: u32 = 1u;
const BLADES: u32 = 2u;

// Increment of SplitMix64.
const STEP: vec2<u32> = vec2<u32>(0x7f4a7c15u, 0x9e3779b9u);
// Low bit of every digit of a bit-reversed word.
const DIGITS: u32 = 0x55555555u;

// How one dimension of one pixel is scrambled: core's Scramble.
struct Scramble {
    seed: u32,
    mixes: u32,
    high_keeps: u32,
    low_keeps: u32,
}

// All of a pixel.
struct Pattern {
    x: Scramble,
    y: Scramble,
    u: Scramble,
    v: Scramble,
    time: Scramble,
}

struct Drawn {
    pixel: vec2<f32>,
    lens: vec2<f32>,
    // In units of 2^-24.
    time: u32,
}

fn add64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = a.x + b.x;
    return vec2<u32>(low, a.y + b.y + select(0u, 1u, low < a.x));
}

// All bits of a product.
fn wide_product(a: u32, b: u32) -> vec2<u32> {
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = b & 0xffffu;
    let b1 = b >> 16u;
    let low = a0 * b0;
    let middle = a0 * b1 + (low >> 16u);
    let other = a1 * b0 + (middle & 0xffffu);
    return vec2<u32>((other << 16u) | (low & 0xffffu), a1 * b1 + (middle >> 16u) + (other >> 16u));
}

fn mul64(a: vec2<u32>, b: vec2<u32>) -> vec2<u32> {
    let low = wide_product(a.x, b.x);
    return vec2<u32>(low.x, low.y + a.x * b.y + a.y * b.x);
}

// x ^ (x >> n), n from 1 to 31.
fn xor_shifted(x: vec2<u32>, n: u32) -> vec2<u32> {
    return x ^ vec2<u32>((x.x >> n) | (x.y << (32u - n)), x.y >> n);
}

fn mix64(x: vec2<u32>) -> vec2<u32> {
    let a = mul64(xor_shifted(x, 30u), vec2<u32>(0x1ce4e5b9u, 0xbf58476du));
    let b = mul64(xor_shifted(a, 27u), vec2<u32>(0x133111ebu, 0x94d049bbu));
    return xor_shifted(b, 31u);
}

// What all of a pixel's scrambles come from; `seed` is the sampler's.
fn pixel_seed(seed: vec2<u32>, pixel: vec2<i32>) -> vec2<u32> {
    return mix64(seed ^ mix64(add64(bitcast<vec2<u32>>(pixel), STEP)));
}

fn scramble_of(state: vec2<u32>, digits: u32) -> Scramble {
    let drawn = mix64(state);
    var out = Scramble(drawn.x, 0u, DIGITS, DIGITS);
    if NET {
        var bits = mix64(drawn ^ STEP);
        for (var digit = 0u; digit < digits; digit += 1u) {
            // What three times the bits carry out of them is 0, 1 or 2 alike.
            let low = wide_product(bits.x, 3u);
            let high = wide_product(bits.y, 3u);
            bits = vec2<u32>(low.x, high.x + low.y);
            let factor = high.y + select(0u, 1u, bits.y < high.x);
            let bit = 1u << (2u * digit);
            if factor != 0u {
                out.mixes |= bit;
            }
            if factor == 1u {
                out.low_keeps &= ~bit;
            } else if factor == 2u {
                out.high_keeps &= ~bit;
            }
        }
    }
    return out;
}

fn pattern_of(seed: vec2<u32>, digits: u32, pixel: vec2<i32>) -> Pattern {
    var out: Pattern;
    var state = add64(pixel_seed(seed, pixel), STEP);
    out.x = scramble_of(state, digits);
    state = add64(state, STEP);
    out.y = scramble_of(state, digits);
    state = add64(state, STEP);
    if LENS != PINHOLE {
        out.u = scramble_of(state, digits);
    }
    state = add64(state, STEP);
    if LENS != PINHOLE {
        out.v = scramble_of(state, digits);
    }
    state = add64(state, STEP);
    if TIME {
        out.time = scramble_of(state, digits);
    }
    return out;
}

// A coordinate in units of 2^-24.
fn scrambled(word: u32, by: Scramble) -> u32 {
    var x = word;
    if NET {
        let high = x & DIGITS;
        let low = (x >> 1u) & DIGITS;
        let new_high = (high & by.high_keeps) ^ (low & by.mixes);
        let new_low = (low & by.low_keeps) ^ (high & by.mixes);
        x = new_high | (new_low << 1u);
    }
    x ^= x * 0x3d20adeau;
    x += by.seed;
    x *= (by.seed >> 16u) | 1u;
    x ^= x * 0x05526c56u;
    x ^= x * 0x53a22864u;
    return reverseBits(x) >> 8u;
}

fn unit(x: u32) -> f32 {
    return f32(x) * (1.0 / 16777216.0);
}

// `word` is the first of a sample's 5 in `words`.
fn sample_of(by: Pattern, word: u32) -> Drawn {
    var out: Drawn;
    out.pixel = vec2<f32>(unit(scrambled(words[word], by.x)), unit(scrambled(words[word + 1u], by.y)));
    if LENS != PINHOLE {
        let u = unit(scrambled(words[word + 2u], by.u));
        out.lens = vec2<f32>(u, unit(scrambled(words[word + 3u], by.v)));
    }
    if TIME {
        out.time = scrambled(words[word + 4u], by.time);
    }
    return out;
}
