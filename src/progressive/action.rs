//! Decides what the render loop does next: a pure function of the situation.
//!
//! Takes the position of the checkpoint, settings and measurements; gives an action. `docs/loop.md` draws positions and actions
//! ("Positions and actions").

use super::last_pass::LastPass;
use super::schedule::Plan;
use super::situation::{Mark, Situation};
use super::stopped_by::StoppedBy;
use super::time_constants::{
    GRACE, INTERIM_FRACTION, INTERIM_USE, LAST_INTERIM_FRACTION, LONGEST_STEP, NEAR_END,
    TARGET_INTERIM_FRACTION,
};
use crate::adaptive::Sampling;
use crate::filter::{Denoiser, UNFILTERED};

/// Below this ratio of an interim image's error to the target, interim passes are by the final denoiser: twice the
/// samples and the better denoiser leave 0.3 to 0.5 of the error, so the next batch may reach the target.
const NEAR_TARGET: f64 = 4.0;

/// An action of the loop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Action {
    /// Start a batch: decide which pixels get its samples.
    Allocate(Plan),
    /// Render the batch to this fraction.
    Render { to: f64 },
    /// End the batch: it is complete.
    EndBatch,
    /// Make an image and maps of the samples so far.
    Filter(&'static dyn Denoiser),
    /// Measure how long the finalisation by this denoiser takes; if it is another one than before, fall back on it.
    Calibrate(&'static dyn Denoiser),
    /// Save a checkpoint.
    Save,
    /// Make the last image.
    Finish(StoppedBy),
}

/// Returns the next action.
pub fn next_action(now: &Situation) -> Action {
    match now.mark {
        Mark::Plan => plan(now).map_or_else(Action::Finish, Action::Allocate),
        Mark::Render { done, samples } => next_of_batch(now, done, samples),
        Mark::Filter => next_after_batch(now),
    }
}

/// Returns the next batch, or what ends the render.
fn plan(now: &Situation) -> Result<Plan, StoppedBy> {
    // There has to be an image.
    if now.conditions.is_interrupted && now.samples > 0 {
        return Err(StoppedBy::Interrupt);
    }
    let schedule = now.schedule();
    // After a batch the estimate is still that of an image of fewer samples
    if now.interim_is_by_final_denoiser && schedule.reaches_target(now.error) && now.mark == Mark::Plan {
        return Err(StoppedBy::TargetError);
    }
    schedule.next_batch(now.elapsed, now.samples, now.error)
}

/// Returns the next action within a batch of `samples` samples, of which the fraction `done` is rendered.
fn next_of_batch(now: &Situation, done: f64, samples: u64) -> Action {
    // Measure the finalisation
    if let Some(denoiser) = calibration(now) {
        return Action::Calibrate(denoiser);
    }

    // End by an interruption
    let rest = now.speed.seconds_for((1.0 - done) * samples as f64);
    if done < 1.0 && now.samples > 0 && now.conditions.is_interrupted && rest > GRACE {
        return Action::Finish(StoppedBy::Interrupt);
    }

    // Save, or render the next step
    if save_is_due(now, 0.0) {
        return Action::Save;
    }
    let schedule = now.schedule();
    match schedule.step(now.elapsed, now.samples, samples).filter(|_| done < 1.0) {
        Some(fraction) => {
            let longest = now.conditions.longest_step.unwrap_or(LONGEST_STEP);
            Action::Render {
                to: (done + fraction.min(schedule.short_step(longest, now.samples, samples))).min(1.0),
            }
        }
        None => Action::EndBatch,
    }
}

/// Returns the next action after a batch, before the interim pass that may follow.
fn next_after_batch(now: &Situation) -> Action {
    if save_is_due(now, 0.0) {
        return Action::Save;
    }
    let plan = match plan(now) {
        Ok(plan) => plan,
        Err(stopped_by) => return Action::Finish(stopped_by),
    };
    let Some(denoiser) = interim_pass(now, plan.is_last) else { return Action::Allocate(plan) };
    // A pass can take longer than a checkpoint should be old.
    if save_is_due(now, now.assumed_interim_seconds(denoiser)) {
        return Action::Save;
    }
    Action::Filter(denoiser)
}

/// Returns the denoiser of the interim pass that is due before the next batch; `None` if none is.
fn interim_pass(now: &Situation, is_last: bool) -> Option<&'static dyn Denoiser> {
    let has_target = now.settings.budget.target_error.is_some();
    let is_needed = now.conditions.is_watched || now.has_reference || has_target;
    if now.sampling == Sampling::Uniform && !is_needed {
        return None;
    }
    let interim = interim_denoiser(now);
    let interim_total = now.measurements.interim_total;
    let is_often = now.has_interim && interim_total > INTERIM_FRACTION * now.elapsed;
    if now.has_region && (now.has_unsampled_pixels() || is_often) {
        // The batches of a region are small: several share one interim pass, of which the first waits for all pixels.
        return None;
    }
    let Some(left) = now.schedule().seconds_left(now.elapsed) else {
        // Without a time budget the choice does not depend on times, so that the image is the same on any machine.
        return Some(interim);
    };
    let budget = now.settings.budget.seconds.unwrap_or(0.0);
    let seconds = pass_seconds(now, interim);
    let leaves_time = INTERIM_USE * seconds <= left;
    let is_due = if !now.has_interim {
        // The first pass waits for the floor of samples, and is exempt from the fraction of the time.
        now.samples >= u64::from(now.settings.judged_spp()) * now.pixels
    } else if is_last {
        seconds <= LAST_INTERIM_FRACTION * budget
    } else {
        // A target is noticed by passes alone.
        let fraction = if has_target { TARGET_INTERIM_FRACTION } else { INTERIM_FRACTION };
        // The time of the one before the last batch is kept for it.
        let spent = interim_total + seconds;
        spent <= fraction * now.elapsed && spent + seconds <= fraction * budget
    };
    (is_due && leaves_time).then_some(interim)
}

/// Returns the denoiser of the next interim pass: that of the final image once the error to be reached may be near.
fn interim_denoiser(now: &Situation) -> &'static dyn Denoiser {
    let settings = now.settings;
    match (settings.budget.target_error, now.error) {
        (Some(target), Some(error)) if error <= NEAR_TARGET * target => settings.denoiser,
        _ => settings.interim_denoiser(),
    }
}

/// Returns the predicted seconds of an interim pass: as measured last, or as follows from the calibration if that is less,
/// since the first pass takes place in new memory.
fn pass_seconds(now: &Situation, interim: &'static dyn Denoiser) -> f64 {
    let is_measured = interim == now.settings.interim_denoiser();
    let measured = now.measurements.interim_seconds.filter(|_| is_measured).unwrap_or(f64::INFINITY);
    let finalisation = &now.measurements.finalisation;
    let last = finalisation.calibrated_denoiser().unwrap_or(now.settings.denoiser);
    let Some(filter) = finalisation.filter_seconds() else {
        // What is not calibrated is assumed until it has been measured
        let assumed =
            if last.cost().is_per_sample { now.assumed_interim_seconds(interim) } else { f64::INFINITY };
        return if measured.is_finite() { measured } else { assumed };
    };
    let ratio = if interim == last { 1.0 } else { interim.cost().pass_time / last.cost().pass_time };
    measured.min(ratio * filter)
}

/// Returns the denoiser whose finalisation has to be measured now; `None` if none has to.
fn calibration(now: &Situation) -> Option<&'static dyn Denoiser> {
    let schedule = now.schedule();
    let left = schedule.seconds_left(now.elapsed)?;
    if now.conditions.is_interrupted {
        return None;
    }
    let finalisation = &now.measurements.finalisation;
    let fresh = finalisation.calibrated_denoiser().filter(|_| finalisation.is_fresh());
    if let Some(denoiser) = fresh {
        // Judge the calibration that was just made
        let pass = LastPass::over_pixels(denoiser);
        let left = now.schedule_of(pass).seconds_left(now.elapsed)?;
        if finalisation.is_doubtful(left) {
            return Some(denoiser);
        }
    }
    let LastPass { denoiser, least_side } = now.last_pass();
    // Empty pixels add hole filling to the time, and a time that grows with the samples is soon outdated.
    let is_predictable = least_side == 1 && !now.has_unsampled_pixels() && !denoiser.cost().is_per_sample;
    // Each one is faster than the one before, so that they come to an end
    let is_next = !now.is_slower(LastPass::over_pixels(denoiser));
    let is_due = match fresh {
        Some(fresh) => denoiser != fresh && denoiser != UNFILTERED && left > 0.0,
        None => finalisation.is_due(now.elapsed, left, schedule.finalisation),
    };
    (is_predictable && is_next && is_due).then_some(denoiser)
}

/// Returns whether a checkpoint is due, if the next chance comes in `ahead` seconds.
fn save_is_due(now: &Situation, ahead: f64) -> bool {
    let Some(every) = now.conditions.checkpoint_interval else { return false };
    let left = now.schedule().seconds_left(now.elapsed);
    let is_near_end = left.is_some_and(|left| left < NEAR_END * every);
    let is_old = now.elapsed + ahead >= now.measurements.saved_at + every;
    is_old && !is_near_end && !now.measurements.is_saved
}

#[cfg(test)]
mod tests;
