//! Every constant of time keeping: how long steps are, when filter passes, calibrations and checkpoints are due, and how
//! far predictions are trusted. Seconds, or fractions of a time or of memory.

// Steps of a sample batch

/// Longest step where nobody asks for shorter ones, in seconds: an interruption is noticed between two.
pub const LONGEST_STEP: f64 = 1.0;
/// Under a time budget, the shortest step that is begun, in seconds.
pub const SHORTEST_TIMED_STEP: f64 = 0.01;
/// Under a time budget, the longest step, in seconds.
pub const LONGEST_TIMED_STEP: f64 = 0.25;
/// Largest fraction of the time left for samples that a step takes.
pub const STEP_FRACTION: f64 = 0.5;
/// An interrupted batch is finished if that takes at most this long, in seconds.
pub const GRACE: f64 = 1.0;
/// Fading time of the measured sampling speed, in seconds: other programs come and go.
pub const SPEED_MEMORY: f64 = 0.5;

// Time budgets

/// Fraction of a time budget that is kept back for wrong predictions. Exceeding the budget by 1 % breaks it, and leaving
/// 5 % wastes it; this lies between.
pub const MARGIN: f64 = 0.02;
/// A time budget is broken if it is exceeded by more than the larger of these seconds and this fraction of it.
pub const TOLERANCE: (f64, f64) = (0.1, 0.01);
/// Seconds by which a finalisation may be predicted to end too late before a faster one takes its place: a step may take longer than
/// predicted, and the faster one is worse by more than it saves.
pub const SLACK: f64 = 0.03;
/// Ratio of the time that is kept for a pass over pixels by the denoiser of squares, if nothing is calibrated, to what is assumed. Where
/// samples are few it often stays so, and on a busy machine such passes took up to 1.5 times as long.
pub const ASSUMED_EXCESS: f64 = 1.25;
/// Ratio of the time of a sample among the first to that of a later one, whose pixel gets several at a time (measured on three
/// scenes: 1.1, 1.3 and 1.8).
pub const FIRST_SAMPLES_EXCESS: f64 = 1.5;
/// The last batch under a time budget is planned larger by this factor than its expected size: the clock ends it.
pub const LAST_BATCH_EXCESS: f64 = 1.25;

// Interim filter passes

/// Largest fraction of the time that interim passes take under a time budget.
pub const INTERIM_FRACTION: f64 = 0.1;
/// The same where a target error ends the render.
pub const TARGET_INTERIM_FRACTION: f64 = 1.0 / 3.0;
/// Largest fraction of the budget that the pass before the last batch takes by itself, however short the budget:
/// without it the error of an image like the last one is unknown.
pub const LAST_INTERIM_FRACTION: f64 = 0.08;
/// An interim pass is followed by at least this many times its own time for the samples that it directs.
pub const INTERIM_USE: f64 = 3.0;

// New memory

/// Bytes that are taken to measure what they cost. The filter needs them later.
pub const PROBE_BYTES: usize = 32 << 20;
/// Least assumed seconds of one core for a byte of new memory, however little those few bytes took. Where they took 0.1 nanoseconds each,
/// single pieces that were taken later took up to 4.
pub const LEAST_MEMORY_SECONDS: f64 = 3e-10;

// Calibration of the finalisation

/// Largest fraction of the time that calibrations take.
pub const CALIBRATION_FRACTION: f64 = 0.02;
/// A calibration is followed by more than this many times its own time for samples.
pub const CALIBRATION_USE: f64 = 2.0;
/// Ratio of the time of the first calibration to what its rows take of a pass: memory is prepared before it, its data is in no
/// cache, and of an image of few rows it takes more of them.
pub const FIRST_CALIBRATION_EXCESS: f64 = 3.0;
/// A calibration above this many times what was assumed or predicted is doubted.
pub const DOUBTED_EXCESS: f64 = 1.25;
/// A last calibration is due when this many times its result is left for samples: the machine may be busier by then.
pub const LAST_CALIBRATION: f64 = 1.0;
/// Fraction of a filter pass's memory that is prepared: more does not save it time, since it takes the rest in blocks of other
/// sizes.
pub const PREPARED: f64 = 0.8;
/// Ratio of the filter's time for a whole image to that extrapolated from some of its rows (measured: 1 to 1.18, growing
/// with the image): less of it is in the cache. The budget's margin covers what this leaves.
pub const FILTER_EXCESS: f64 = 1.06;
/// The same of the time to encode and write it (measured: 1.0 to 2.5, in the median 1.5): it takes new memory, and a disk.
pub const WRITE_EXCESS: f64 = 1.5;
/// Number of the latest calibrations that a prediction averages.
pub const CALIBRATIONS: f64 = 2.0;
/// Assumed relative deviation of the first calibration (measured on 0.9 megapixels: 0.1 to 0.2).
pub const FIRST_DEVIATION: f64 = 0.1;
/// Assumed seconds per pixel to write a checkpoint at the end.
pub const CHECKPOINT_SECONDS: f64 = 2e-6;

// Checkpoints

/// No checkpoint is saved for its age alone if the end, which saves another, is nearer than this fraction of the time
/// between two: it would still be on its way to the disk.
pub const NEAR_END: f64 = 0.25;
