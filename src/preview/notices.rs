//! The notices to the user, of all scenes: every status lists the latest, since viewers may miss a status.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use serde::Serialize;

/// Number of the notices that a status lists.
const MOST_LISTED: usize = 6;

/// A notice to the user, such as where an image was saved.
#[derive(Clone, Debug, Serialize)]
pub struct Notice {
    /// Counts the notices of all scenes, from 1.
    pub number: u32,
    pub text: String,
    pub is_problem: bool,
}

/// The latest notices, newest last.
#[derive(Default)]
pub struct Notices(Mutex<VecDeque<Notice>>);

impl Notices {
    fn latest(&self) -> MutexGuard<'_, VecDeque<Notice>> {
        // A panic of another thread leaves the list intact.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a notice.
    pub fn add(&self, text: String, is_problem: bool) {
        let mut latest = self.latest();
        let number = latest.back().map_or(0, |last| last.number) + 1;
        latest.push_back(Notice { number, text, is_problem });
        if latest.len() > MOST_LISTED {
            latest.pop_front();
        }
    }

    /// Returns the latest notices, newest last.
    pub fn list(&self) -> Vec<Notice> {
        self.latest().iter().cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_latest_notices_are_listed_with_their_numbers() {
        let notices = Notices::default();
        (1..=MOST_LISTED + 2).for_each(|i| notices.add(format!("notice {i}"), false));
        let listed = notices.list();
        assert_eq!((listed.len(), listed[0].number), (MOST_LISTED, 3));
        assert_eq!(listed[0].text, "notice 3");
    }
}
