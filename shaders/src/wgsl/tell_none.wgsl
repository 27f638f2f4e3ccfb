// What rays cost is not told.

fn visit(ray: u32, reference: u32) {}

fn tell(ray: u32, tests: vec2<u32>) {}
