//! Scene-wide rendering options: camera, film, pixel filter, integrator and sampler.

mod camera;
mod film;
mod option_entity;
mod options_block;
mod pixel_filter;
mod white_balance;
