// Nothing is kept beside colours.

const KEEPS: bool = false;

fn keep(ray: Ray, hit: Hit, number: u32, instance: Instance, object: Object, cell: Cell, n: vec3<f32>) {
}
