//! Processes of tests.

use std::io::{BufRead, BufReader};
use std::process::Child;

/// A process that ends with its owner.
pub struct Running(pub Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Lines that a process prints, until one that `pick` takes.
pub fn first_line<T>(output: impl std::io::Read, pick: impl Fn(&str) -> Option<T>) -> Option<T> {
    BufReader::new(output).lines().map_while(Result::ok).find_map(|line| pick(&line))
}
