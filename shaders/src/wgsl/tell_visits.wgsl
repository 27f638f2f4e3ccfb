// Tells for each ray which nodes and blocks it opened on the last page, the first VISITS of them: their number, then references.

@group(1) @binding(3) var<storage, read_write> visits: array<u32>;

const VISITS: u32 = 255u;

var<private> visited: u32;

fn visit(ray: u32, reference: u32) {
    if visited < VISITS {
        visited += 1u;
        visits[ray * (VISITS + 1u) + visited] = reference;
    }
}

fn tell(ray: u32, tests: vec2<u32>) {
    visits[ray * (VISITS + 1u)] = visited;
}
