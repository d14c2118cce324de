//! Carries out directives: the table of all of them, and those that are not about shapes,
//! materials, textures, lights or rendering options.

mod attributes;
mod directive_table;
mod include;
pub mod objects;
mod scopes;
pub mod transforms;
mod unsupported;
