// What rays cost is not told.

fn tell(ray: u32, tests: vec2<u32>) {}
