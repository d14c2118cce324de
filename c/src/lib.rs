//! The C library `libprpf`: pixel statistics of any renderer's samples, denoisers, and allocation.
//!
//! Each module wraps one part of the library's public face, checks pointers and sizes, and turns errors and panics into a
//! [`PrpfStatus`](status::PrpfStatus) with a message; nothing is computed here.
//! `examples/header.rs` makes `prpf.h` of the functions, with their comments.

mod allocation;
mod arguments;
mod denoisers;
mod filter;
mod result;
mod status;
mod store;
mod threads;
mod version;

#[cfg(test)]
mod tests;
