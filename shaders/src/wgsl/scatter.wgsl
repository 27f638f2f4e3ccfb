// Stage `scatter`: rays from each site into the half space that its normal points to, as many for a solid angle as its cosine
// with the normal is large, at the site's time. Ray `i` of a site has number `samples * site + i`.
//
// Directions come from the first two of the dimensions of sample.wgsl, for a pixel that is named by the site's number and
// by PATTERN: sites have patterns that are scrambled apart, and apart from those of camera rays. A disk with as many samples
// everywhere, raised to the hemisphere, is that distribution.

// The permutation fixes NET, as sample.wgsl has it; without lens and time.

@group(0) @binding(0) var<uniform> launch: ScatterLaunch;
@group(0) @binding(1) var<storage, read> words: array<u32>;
@group(0) @binding(2) var<storage, read> sites: array<Site>;
@group(0) @binding(3) var<storage, read_write> rays: array<Ray>;

const WORKGROUP: u32 = 64u;
// The row that sites are pixels of: below all that cameras have.
const PATTERN: i32 = 0x40000000;
// Cosine of the flattest rays: samples on the rim of the disk would run along the surface.
const FLATTEST: f32 = 1.0 / 4096.0;

// A vector relative to axes of which the third is `n`, and the others are any at right angles (Duff et al., "Building an
// Orthonormal Basis, Revisited", JCGT 6(1), 2017).
fn around(n: vec3<f32>, v: vec3<f32>) -> vec3<f32> {
    let side = select(1.0, -1.0, n.z < 0.0);
    let a = -1.0 / (side + n.z);
    let b = n.x * n.y * a;
    let x = vec3<f32>(1.0 + side * n.x * n.x * a, side * b, -side * n.x);
    let y = vec3<f32>(b, side + n.y * n.y * a, -n.y);
    return x * v.x + y * v.y + n * v.z;
}

@compute @workgroup_size(64)
fn scatter(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) lane: u32) {
    let index = group.y * launch.row + group.x * WORKGROUP + lane;
    if group.x * WORKGROUP + lane >= launch.row || index >= launch.ray_count {
        return;
    }
    let number = index / launch.samples;
    let site = sites[number];
    // A site without normal has rays that meet nothing.
    var ray = Ray(site.origin, 0.0, vec3<f32>(0.0), -1.0, site.time, index, 1.0, 0.0);
    if any(site.normal != vec3<f32>(0.0)) {
        let pattern = pattern_of(launch.seed, launch.digits, vec2<i32>(i32(launch.first + number), PATTERN));
        let at = disk(sample_of(pattern, 5u * (index % launch.samples)).pixel);
        let up = max(sqrt(max(1.0 - dot(at, at), 0.0)), FLATTEST);
        ray.dir = around(site.normal, vec3<f32>(at, up));
        ray.t_max = launch.reach;
    }
    rays[index] = ray;
}
