// Hits are what is seen first.

fn is_seen(sample: Sample) -> bool {
    return true;
}
