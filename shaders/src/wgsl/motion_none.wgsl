// Nobody asks where things go in the image.

fn motion(instance: Instance, object: Object, cell: Cell) -> vec2<f32> {
    return vec2<f32>(0.0);
}
