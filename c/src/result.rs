//! The result of a filter pass: image, maps, estimated error.

use std::ffi::c_char;
use std::ptr::null;

use prpf::filter::{DENOISERS, FilterResult};
use prpf::image::Planes;

use crate::arguments::{object, output, place, write};
use crate::denoisers::prpf_denoiser_name;
use crate::filter::PrpfFilter;
use crate::status::{Failure, PrpfStatus, contained, guard, invalid};

/// The image and the maps of a result.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrpfMap {
    /// Linear RGB, directly visible emission included: 3 channels.
    Image = 0,
    /// The image as the first half of the samples gives it: 3 channels.
    FirstHalf = 1,
    /// The image as the second half of the samples gives it: 3 channels.
    SecondHalf = 2,
    /// Estimated variance of the image, squared radiance: 3 channels.
    Variance = 3,
    /// Unbiased, noisy estimate of the squared error, squared radiance: 3 channels.
    Risk = 4,
    /// Estimated squared error, mean of channels, squared radiance: 1 channel.
    Error = 5,
    /// Squared difference from the unfiltered image over its expected value, about 1 where the filter is unbiased: 1 channel.
    Residual = 6,
    /// 1 where interpolation of feature weights failed, of "prpf" only: 1 channel.
    InterpolationFailure = 7,
}

impl PrpfMap {
    /// Takes a number that C passes.
    fn from_number(number: u32) -> Result<Self, Failure> {
        use PrpfMap::{Error, FirstHalf, Image, InterpolationFailure, Residual, Risk, SecondHalf, Variance};
        let all = [Image, FirstHalf, SecondHalf, Variance, Risk, Error, Residual, InterpolationFailure];
        let accepted = all.len() - 1;
        all.into_iter()
            .find(|map| *map as u32 == number)
            .ok_or_else(|| invalid(format!("map: found {number}; accepted are 0 to {accepted}")))
    }

    /// Returns the planes of a result.
    fn planes(self, result: &FilterResult) -> Result<&Planes, Failure> {
        match self {
            Self::Image => Ok(&result.image),
            Self::FirstHalf => Ok(&result.halves[0]),
            Self::SecondHalf => Ok(&result.halves[1]),
            Self::Variance => Ok(&result.variance),
            Self::Risk => Ok(&result.risk),
            Self::Error => Ok(&result.error),
            Self::Residual => Ok(&result.residual),
            Self::InterpolationFailure => {
                result.interpolation.as_ref().map(|found| &found.failure).ok_or_else(|| {
                    let found = result.made_by;
                    invalid(format!(
                        "map: found the interpolation failure of {found}; accepted is that of prpf"
                    ))
                })
            }
        }
    }
}

/// The estimated relMSE of an image; all NaN if too few pixels have samples in both halves, or squares of pixels were filtered.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PrpfEstimate {
    /// relMSE.
    pub relmse: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
}

/// Reads the image or a map of a filter's result: [height][width][channel], rows from the top.
///
/// map: one of PrpfMap.
///
/// value_count: pixels times channels.
///
/// # Safety
/// Pointers are null or point to a filter, and to as many values as their counts say.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_filter_read(
    filter: *const PrpfFilter,
    map: u32,
    values: *mut f32,
    value_count: usize,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let content = unsafe { object("filter", filter) }?.lock()?;
        let result = &content.result()?.result;
        let planes = PrpfMap::from_number(map)?.planes(result)?;
        let channels = planes.count();
        // SAFETY: the caller's promise.
        let values = unsafe { output("values", values, value_count, planes.pixels() * channels) }?;
        for channel in 0..channels {
            write(values[channel..].iter_mut().step_by(channels), planes.plane(channel));
        }
        Ok(())
    })
}

/// Reads the estimated error of a filter's image.
///
/// # Safety
/// Pointers are null or point to a filter and to one value.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_filter_estimate(
    filter: *const PrpfFilter,
    estimate: *mut PrpfEstimate,
) -> PrpfStatus {
    guard(|| {
        // SAFETY: the caller's promise.
        let (filter, place) = unsafe { (object("filter", filter)?, place("estimate", estimate)?) };
        let content = filter.lock()?;
        let found = content.result()?.estimate.as_ref();
        let [low, high] = found.map_or([f64::NAN; 2], |found| found.interval());
        place.write(PrpfEstimate { relmse: found.map_or(f64::NAN, |found| found.value), low, high });
        Ok(())
    })
}

/// Returns the name of the denoiser that made a filter's result, which lives as long as the library; NULL without a result.
///
/// # Safety
/// `filter` is null or points to a filter.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn prpf_filter_made_by(filter: *const PrpfFilter) -> *const c_char {
    let name = contained(|| {
        // SAFETY: the caller's promise.
        let content = unsafe { object("filter", filter) }?.lock()?;
        let made_by = content.result()?.result.made_by;
        let index = DENOISERS.iter().position(|denoiser| denoiser.name() == made_by);
        Ok(index.map_or(null(), |index| prpf_denoiser_name(index)))
    });
    name.unwrap_or(null())
}
