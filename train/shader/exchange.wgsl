// Exchanges the light of a scene for the stored one of another; see lights.rs.

#import declarations
#import training
#import workgroup

@group(0) @binding(0) var<uniform> exchanged: ExchangeParameters;
// [n, row] each.
@group(0) @binding(1) var<storage, read_write> values: array<f32>;
@group(0) @binding(2) var<storage, read_write> first: array<f32>;
@group(0) @binding(3) var<storage, read_write> second: array<f32>;
// [n, num_lanes] each.
@group(0) @binding(4) var<storage, read_write> stored_values: array<f32>;
@group(0) @binding(5) var<storage, read_write> stored_first: array<f32>;
@group(0) @binding(6) var<storage, read_write> stored_second: array<f32>;

@compute @workgroup_size(GROUP_SIZE)
fn exchange(
    @builtin(workgroup_id) workgroup: vec3u,
    @builtin(num_workgroups) workgroups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let index = invocation_number(workgroup, workgroups, thread);
    if index >= exchanged.num_rows {
        return;
    }
    for (var k = 0u; k < exchanged.num_lanes; k++) {
        let at = index * exchanged.row + exchanged.first_lane + k;
        let place = index * exchanged.num_lanes + k;
        let kept = vec3f(values[at], first[at], second[at]);
        values[at] = stored_values[place];
        first[at] = stored_first[place];
        second[at] = stored_second[place];
        stored_values[place] = kept.x;
        stored_first[place] = kept.y;
        stored_second[place] = kept.z;
    }
}
