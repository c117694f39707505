// Numbers of workgroups and invocations.

#import declarations

// Number of a workgroup among all: one dimension of a dispatch holds only 65,535 of them.
fn group_number(workgroup: vec3u, workgroups: vec3u) -> u32 {
    return workgroup.x + workgroup.y * workgroups.x;
}

// Number of an invocation among those of all workgroups of GROUP_SIZE.
fn invocation_number(workgroup: vec3u, workgroups: vec3u, thread: u32) -> u32 {
    return group_number(workgroup, workgroups) * GROUP_SIZE + thread;
}
