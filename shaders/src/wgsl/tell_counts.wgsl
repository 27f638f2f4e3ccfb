// Tells for each ray the nodes that were opened and the micropolygons that were tested, page upon page.

@group(1) @binding(3) var<storage, read_write> counts: array<vec2<u32>>;

fn visit(ray: u32, reference: u32) {}

fn tell(ray: u32, tests: vec2<u32>) {
    counts[ray] += tests;
}
