// Sums over the lanes of a workgroup before each, in shared memory: no subgroups are needed.
//
// The stage fixes LANES, the invocations of its workgroups.

var<workgroup> scanned: array<vec2<u32>, LANES>;

// The sum of what the lanes before give. All lanes come here, once.
fn sum_before(lane: u32, value: vec2<u32>) -> vec2<u32> {
    scanned[lane] = value;
    workgroupBarrier();
    for (var step = 1u; step < LANES; step *= 2u) {
        var sum = scanned[lane];
        if lane >= step {
            sum += scanned[lane - step];
        }
        workgroupBarrier();
        scanned[lane] = sum;
        workgroupBarrier();
    }
    return scanned[lane] - value;
}

// The sum of what all lanes gave.
fn sum_of_all() -> vec2<u32> {
    return scanned[LANES - 1u];
}
