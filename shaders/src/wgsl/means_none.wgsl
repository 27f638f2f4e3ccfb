// No AOV shows means of values.

struct Means {
    none: u32,
}

fn take_in(means: ptr<function, Means>, number: u32, sees: bool) {
}

fn put(means: ptr<function, Means>, place: u32) {
}
