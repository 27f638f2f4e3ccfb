// Sums of values of what samples see first. The permutation fixes VALUES: floats of a sample.

@group(2) @binding(0) var<storage, read> values: array<f32>;
// Of each pixel the sums, and how many samples see anything.
@group(2) @binding(1) var<storage, read_write> sums: array<f32>;

struct Means {
    sums: array<f32, VALUES>,
    hits: u32,
}

fn take_in(means: ptr<function, Means>, number: u32, sees: bool) {
    if !sees {
        return;
    }
    for (var i = 0u; i < VALUES; i += 1u) {
        (*means).sums[i] += values[number * VALUES + i];
    }
    (*means).hits += 1u;
}

fn put(means: ptr<function, Means>, place: u32) {
    let at = place * (VALUES + 1u);
    for (var i = 0u; i < VALUES; i += 1u) {
        sums[at + i] = (*means).sums[i];
    }
    sums[at + VALUES] = f32((*means).hits);
}
