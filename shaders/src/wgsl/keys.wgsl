// Keys and times: the twin of core's locate_key. Words of key times are in `words`.

// Segment of keys that holds a time, and the fraction inside it.
struct KeyPlace {
    key: u32,
    fraction: f32,
}

// `count` is 2 or more.
fn locate(times: u32, count: u32, time: f32) -> KeyPlace {
    var key = 0u;
    while key + 2u < count && bitcast<f32>(words[times + key + 1u]) <= time {
        key += 1u;
    }
    let a = bitcast<f32>(words[times + key]);
    let b = bitcast<f32>(words[times + key + 1u]);
    return KeyPlace(key, clamp((time - a) / (b - a), 0.0, 1.0));
}
