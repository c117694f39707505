// Counter-based random numbers with the bits of rng.rs (pcg4d of Jarzynski and Olano, JCGT 2020).

fn pcg4d(input: vec4u) -> vec4u {
    var v = input * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4u(16u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// The first words of the stream of one element and one sample of it.
fn stream_words(key: vec4u, element: u32, sample: u32) -> vec4u {
    return pcg4d(vec4u(element ^ key.x, sample ^ key.y, key.z, key.w));
}
