//! The limits that a shell's `ulimit -v` and `ulimit -d` set (`RLIMIT_AS`, `RLIMIT_DATA`).

/// Returns the bytes that the limits leave; `None` without a limit.
///
/// Memory that is mapped and not touched yet counts as available: most of it is what the allocator holds in reserve, a
/// gibibyte at a time.
#[cfg(target_os = "linux")]
pub fn available() -> Option<f64> {
    use rustix::process::{Resource, getrlimit};

    use super::status_bytes;

    let [space, data] = [Resource::As, Resource::Data].map(|resource| getrlimit(resource).current);
    if space.is_none() && data.is_none() {
        return None;
    }
    let untouched = status_bytes("VmData")?.saturating_sub(status_bytes("RssAnon")?);
    let left = |limit: Option<u64>, field| {
        Some(limit?.saturating_add(untouched).saturating_sub(status_bytes(field)?) as f64)
    };
    [left(space, "VmSize"), left(data, "VmData")].into_iter().flatten().reduce(f64::min)
}

/// Other systems do not tell how much of a limit is used.
#[cfg(not(target_os = "linux"))]
pub fn available() -> Option<f64> {
    None
}
