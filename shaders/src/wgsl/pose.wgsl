// Where the camera is: the twin of core's camera/pose.rs, in f32.
//
// Core turns poses in f64. Here a turn is given by two quaternions at right angles, and places relative to the camera's:
// what comes out is off by a few roundings. Tables stand in `tables`, as words; places in it are
// those of `camera`. The permutation fixes MOVES: the camera does.

fn number_at(i: u32) -> f32 {
    return bitcast<f32>(tables[i]);
}

fn pair_at(i: u32) -> vec2<f32> {
    return vec2<f32>(number_at(i), number_at(i + 1u));
}

fn triple_at(i: u32) -> vec3<f32> {
    return vec3<f32>(number_at(i), number_at(i + 1u), number_at(i + 2u));
}

fn quadruple_at(i: u32) -> vec4<f32> {
    return vec4<f32>(triple_at(i), number_at(i + 3u));
}

// Words of a key of the camera's path: its time, and, up to the next one, where the turn is and which way it goes (two
// quaternions at right angles), its angle, the columns of the stretch, and the place.
const KEY: u32 = 22u;

fn turned_by(rotation: vec4<f32>, v: vec3<f32>) -> vec3<f32> {
    let t = 2.0 * cross(rotation.xyz, v);
    return v + rotation.w * t + cross(rotation.xyz, t);
}

// Camera to world.
struct Pose {
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
    place: vec3<f32>,
}

fn pose_at(time: f32) -> Pose {
    if !MOVES {
        return Pose(camera.column_x.xyz, camera.column_y.xyz, camera.column_z.xyz, camera.place.xyz);
    }
    var low = 0u;
    while low + 2u < camera.key_count && number_at(camera.keys + KEY * (low + 1u)) <= time {
        low += 1u;
    }
    let a = camera.keys + KEY * low;
    let b = a + KEY;
    let start = number_at(a);
    let f = clamp((time - start) / (number_at(b) - start), 0.0, 1.0);
    let angle = f * number_at(a + 9u);
    let rotation = quadruple_at(a + 1u) * cosine(angle) + quadruple_at(a + 5u) * sine(angle);
    let p = triple_at(a + 19u);
    return Pose(
        turned_by(rotation, mix(triple_at(a + 10u), triple_at(b + 10u), f)),
        turned_by(rotation, mix(triple_at(a + 13u), triple_at(b + 13u), f)),
        turned_by(rotation, mix(triple_at(a + 16u), triple_at(b + 16u), f)),
        p + (triple_at(b + 19u) - p) * f,
    );
}
