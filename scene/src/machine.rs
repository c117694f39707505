//! Memory and processor of the machine, as far as the system tells.

use std::fs;

/// Memory that new allocations can have, bytes, by the kernel's own estimate; `None` on other
/// systems than Linux.
pub fn available_memory() -> Option<u64> {
    memory("MemAvailable:")
}

/// Memory that the machine has, bytes; `None` as with [`available_memory`].
pub fn total_memory() -> Option<u64> {
    memory("MemTotal:")
}

fn memory(key: &str) -> Option<u64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find(|line| line.starts_with(key))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib * 1024)
}

/// The processor's name, as its maker gives it; `None` where the system does not tell.
pub fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// Vector instructions that the processor has and compiled code chooses between, widest first.
pub fn vector_instructions() -> Vec<&'static str> {
    #[cfg(target_arch = "x86_64")]
    let found = [
        ("AVX-512", std::arch::is_x86_feature_detected!("avx512f")),
        ("AVX2", std::arch::is_x86_feature_detected!("avx2")),
        ("FMA", std::arch::is_x86_feature_detected!("fma")),
        ("SSE4.1", std::arch::is_x86_feature_detected!("sse4.1")),
    ];
    #[cfg(target_arch = "aarch64")]
    let found = [("NEON", std::arch::is_aarch64_feature_detected!("neon"))];
    #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
    let found: [(&str, bool); 0] = [];
    let present = found.into_iter().filter(|(_, is_there)| *is_there);
    present.map(|(name, _)| name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn linux_tells_its_memory() {
        let (total, available) = (total_memory().unwrap(), available_memory().unwrap());
        assert!(
            available > 0 && available <= total,
            "{available} of {total}"
        );
    }
}
