// Where the point that was hit goes in the image while the shutter is open; the twin of core's camera::Projector and World::end_positions.

// Where it is at a time.
fn position_at(instance: Instance, object: Object, cell: Cell, time: f32) -> vec3<f32> {
    let keys = key_at(object.key_times, object.key_count, time);
    var p = vec3<f32>(0.0);
    for (var i = 0u; i < 4u; i += 1u) {
        p += cell.weights[i] * vertex_at(object, cell, cell.corners[i], keys);
    }
    let m = placed(instance, time);
    return m.x * p.x + m.y * p.y + m.z * p.z + m.origin;
}

// A place in the image, in pixels.
struct Raster {
    at: vec2<f32>,
    // False behind the camera.
    is_there: bool,
}

fn projected(p: vec3<f32>, time: f32) -> Raster {
    let pose = pose_at(time);
    let from_camera = p - pose.place;
    let x = cross(pose.y, pose.z);
    let y = cross(pose.z, pose.x);
    let z = cross(pose.x, pose.y);
    let seen = vec3<f32>(dot(x, from_camera), dot(y, from_camera), dot(z, from_camera)) / dot(pose.x, x);
    var at = seen.xy;
    if camera.orthographic == 0u {
        if !(seen.z < 0.0) {
            return Raster(vec2<f32>(0.0), false);
        }
        at /= -seen.z;
    }
    let now = lens_at(time);
    let unit = vec2<f32>(at.x - now.corner.x, now.corner.y - at.y) / now.window_size;
    return Raster(unit * camera.resolution, true);
}

// In pixels, from the shutter's opening to its closing.
fn motion(instance: Instance, object: Object, cell: Cell) -> vec2<f32> {
    let a = projected(position_at(instance, object, cell, 0.0), 0.0);
    let b = projected(position_at(instance, object, cell, 1.0), 1.0);
    return select(vec2<f32>(0.0), b.at - a.at, a.is_there && b.is_there);
}
