// Hits are the first of all: a matte surface is not there.

fn is_seen(sample: Sample) -> bool {
    return sample.color.w != 0.0;
}
