//! Tests the live page in a real browser: it loads, shows the image as it converges, and steers the render.
//!
//! Without Chromium these tests print so and pass. `PRPF_SCREENSHOTS=FOLDER` saves screenshots.

mod browser;
mod live;
mod page;
mod process;
