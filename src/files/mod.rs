//! Files on disk: atomic replacement, locking, direct I/O and opening regular files.
//!
//! | file | holds |
//! | --- | --- |
//! | [`atomic`] | [`replace_file`]: replaces a file whole or not at all |
//! | [`exclusive`] | [`ExclusiveFile`]: a file that only this process may replace |
//! | `temporary` | temporary files beside their target |
//! | `lock` | advisory locks and the identity of files |
//! | `direct` | writes that bypass the page cache; reserving disk space |
//! | [`links`] | the target of symbolic links |
//! | [`regular`] | opening regular files only |
//! | `error_message` | [`error_message()`]: errors of the file system in plain words |

pub mod atomic;
mod direct;
mod error_message;
pub mod exclusive;
pub mod links;
mod lock;
pub mod regular;
mod temporary;

pub use atomic::{can_replace, replace_file};
pub use error_message::error_message;
pub use exclusive::ExclusiveFile;
pub use links::resolve_links;
pub use regular::open_regular;
