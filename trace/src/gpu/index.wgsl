// Number of a workgroup among all: one dimension of a dispatch holds only 65,535 of them.
fn group_number(workgroup: vec3u, workgroups: vec3u) -> u32 {
    return workgroup.x + workgroup.y * workgroups.x;
}
