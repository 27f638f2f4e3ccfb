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

// True where bows of frames go straight from key to key, as in core's bvh/bowing.rs.
fn goes_straight(count: u32) -> bool {
    return count > 2u && count <= 9u;
}

// What bows are multiplied by there: at keys `T (1 - T)`. In units of U it is off by 2 of each end, which both are at most
// 1/4, by 1/4 for their difference, 7/4 for the fraction of it, 1/4 for their product and 1/4 for the sum: 3.
fn straight_bow(times: u32, count: u32, time: f32) -> f32 {
    let place = locate(times, count, time);
    let a = bitcast<f32>(words[times + place.key]);
    let b = bitcast<f32>(words[times + place.key + 1u]);
    let from_key = a * (1.0 - a);
    return from_key + (b * (1.0 - b) - from_key) * place.fraction;
}
