//! The memory limits of Linux control groups, of both versions, in which containers and batch systems put a process.

use std::fs::read_to_string;
use std::path::Path;

/// Returns the bytes that the groups of this process leave it; `None` without a limit.
pub fn available() -> Option<f64> {
    let groups = read_to_string("/proc/self/cgroup").ok()?;
    available_below(Path::new("/sys/fs/cgroup"), &groups)
}

/// Names of the files of one version.
struct Version {
    /// Folders in which the hierarchy may be mounted, below that of all groups.
    mounts: &'static [&'static str],
    limits: &'static [&'static str],
    usage: &'static str,
    /// Cached files in `memory.stat`, which the system gives up when memory is scarce.
    cached: [&'static str; 2],
}

const V1: Version = Version {
    mounts: &["memory"],
    limits: &["memory.limit_in_bytes"],
    usage: "memory.usage_in_bytes",
    cached: ["total_inactive_file", "total_active_file"],
};
const V2: Version = Version {
    mounts: &["", "unified"],
    limits: &["memory.max", "memory.high"],
    usage: "memory.current",
    cached: ["inactive_file", "active_file"],
};

/// Returns what is left to the groups listed in `groups` (the text of `/proc/self/cgroup`), mounted below `root`.
fn available_below(root: &Path, groups: &str) -> Option<f64> {
    let left = groups.lines().flat_map(|line| {
        // A line is "id:controllers:path".
        let mut fields = line.splitn(3, ':').skip(1);
        let (controllers, path) = (fields.next().unwrap_or(""), fields.next().unwrap_or(""));
        let version = match controllers {
            "" => Some(&V2),
            _ => controllers.split(',').any(|name| name == "memory").then_some(&V1),
        };
        let mounts = version.into_iter().flat_map(|version| version.mounts.iter().map(move |m| (version, m)));
        mounts.flat_map(|(version, mount)| {
            // A limit of a group holds for those inside it. In a container, the path may be one outside of it, and the
            // container's own group the root.
            let path = Path::new(path.trim_start_matches('/'));
            path.ancestors()
                .filter_map(|group| version.left(&root.join(mount).join(group)))
                .collect::<Vec<_>>()
        })
    });
    left.reduce(f64::min)
}

impl Version {
    /// Returns what is left to one group; `None` without a limit.
    fn left(&self, group: &Path) -> Option<f64> {
        let number = |name: &str| read_to_string(group.join(name)).ok()?.trim().parse::<u64>().ok();
        // "max" is no number.
        let limit = self.limits.iter().filter_map(|name| number(name)).min()?;
        let statistics = read_to_string(group.join("memory.stat")).unwrap_or_default();
        let cached = |line: &str| {
            let (name, bytes) = line.split_once(' ')?;
            self.cached.contains(&name).then(|| bytes.parse::<u64>().ok())?
        };
        let used = number(self.usage)?.saturating_sub(statistics.lines().filter_map(cached).sum());
        Some(limit.saturating_sub(used) as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes the files of a group.
    fn group(folder: &Path, files: &[(&str, &str)]) {
        std::fs::create_dir_all(folder).unwrap();
        files.iter().for_each(|(name, text)| std::fs::write(folder.join(name), text).unwrap());
    }

    #[test]
    fn the_tightest_limit_of_a_group_and_those_around_it_counts() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        group(
            &root.join("a"),
            &[("memory.max", "5000\n"), ("memory.high", "max\n"), ("memory.current", "1000\n")],
        );
        group(
            &root.join("a/b"),
            &[("memory.max", "max\n"), ("memory.high", "3000\n"), ("memory.current", "900\n")],
        );
        group(&root.join("a/b"), &[("memory.stat", "anon 500\nactive_file 100\ninactive_file 300\n")]);
        let available = |path: &str| available_below(root, &format!("0::{path}\n"));
        assert_eq!(available("/a"), Some(4000.0));
        assert_eq!(available("/a/b"), Some(2500.0));
        assert_eq!(available("/"), None);
    }

    #[test]
    fn the_first_version_is_read_also_where_the_path_is_that_of_the_host() {
        let folder = tempfile::tempdir().unwrap();
        let files = [
            ("memory.limit_in_bytes", "5000\n"),
            ("memory.usage_in_bytes", "3000\n"),
            ("memory.stat", "cache 1\ntotal_inactive_file 700\n"),
        ];
        group(&folder.path().join("memory"), &files);
        let groups = "5:cpu:/x\n4:memory,hugetlb:/docker/abc\n0::/\n";
        assert_eq!(available_below(folder.path(), groups), Some(2700.0));
        assert_eq!(available_below(folder.path(), "5:cpu:/x\n"), None);
    }
}
