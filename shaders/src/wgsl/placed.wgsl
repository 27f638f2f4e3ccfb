// How instances lie in the world. The permutation fixes TIME (something moves).

fn longest(v: vec3<f32>) -> f32 {
    let a = abs(v);
    return max(a.x, max(a.y, a.z));
}

// How an instance lies at a time.
struct Placed {
    // Columns of the matrix to the world.
    x: vec3<f32>,
    y: vec3<f32>,
    z: vec3<f32>,
    origin: vec3<f32>,
    // The largest coordinate of the origin at any key that counts.
    reach: f32,
    // False where it has no inverse.
    sound: bool,
    // The object moves by a translation alone.
    plain: bool,
}

fn placed(instance: Instance, time: f32) -> Placed {
    let at = instance.matrices;
    var out: Placed;
    out.sound = true;
    if instance.key_count == 0u {
        out.x = vec3<f32>(1.0, 0.0, 0.0);
        out.y = vec3<f32>(0.0, 1.0, 0.0);
        out.z = vec3<f32>(0.0, 0.0, 1.0);
        out.origin = matrices[at].xyz;
        out.plain = true;
        out.reach = longest(out.origin);
        return out;
    }
    let a = matrices[at];
    let b = matrices[at + 1u];
    let c = matrices[at + 2u];
    out.origin = vec3<f32>(a.w, b.w, c.w);
    out.reach = longest(out.origin);
    if !TIME || instance.key_count == 1u {
        // The matrix of which these are the inverse's columns.
        let x = cross(b.xyz, c.xyz);
        let y = cross(c.xyz, a.xyz);
        let z = cross(a.xyz, b.xyz);
        let det = dot(a.xyz, x);
        out.sound = abs(det) > 1.0e-30;
        let divisor = select(1.0, det, out.sound);
        out.x = vec3<f32>(x.x, y.x, z.x) / divisor;
        out.y = vec3<f32>(x.y, y.y, z.y) / divisor;
        out.z = vec3<f32>(x.z, y.z, z.z) / divisor;
        return out;
    }
    let place = locate(instance.key_times, instance.key_count, time);
    let k = at + 3u * place.key;
    let x = mix(matrices[k], matrices[k + 3u], place.fraction);
    let y = mix(matrices[k + 1u], matrices[k + 4u], place.fraction);
    let z = mix(matrices[k + 2u], matrices[k + 5u], place.fraction);
    out.x = x.xyz;
    out.y = y.xyz;
    out.z = z.xyz;
    out.origin = vec3<f32>(x.w, y.w, z.w);
    let from_key = vec3<f32>(matrices[k].w, matrices[k + 1u].w, matrices[k + 2u].w);
    let to_key = vec3<f32>(matrices[k + 3u].w, matrices[k + 4u].w, matrices[k + 5u].w);
    out.reach = max(longest(from_key), longest(to_key));
    out.sound = abs(dot(out.x, cross(out.y, out.z))) > 1.0e-30;
    return out;
}
