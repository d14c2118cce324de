/* prpf: pixel statistics, denoisers and adaptive allocation for any renderer's samples.
 *
 * Made by `cargo run -p prpf-c --example header`; docs/c.md explains it.
 *
 * Arrays of pixels are in rows from the top. Every array but those of PrpfHalfMoments comes with its number of values, which
 * is checked. Functions that can fail return a status; prpf_error_message() says why. No value that they are given ends the
 * process. */

#ifndef PRPF_H
#define PRPF_H

#include <stddef.h>
#include <stdint.h>

/* The version of this header; prpf_version() returns the library's. */
#define PRPF_VERSION "0.1.0"

/**
 * What became of a call. prpf_error_message() has details of every status but PRPF_STATUS_OK.
 */
typedef enum {
    /**
     * Done.
     */
    PRPF_STATUS_OK = 0,
    /**
     * An argument cannot be used. Nothing has changed.
     */
    PRPF_STATUS_INVALID_ARGUMENT = 1,
    /**
     * There is too little memory, or the system starts no more threads. Nothing has changed.
     */
    PRPF_STATUS_OUT_OF_MEMORY = 2,
    /**
     * A progress callback has cancelled the call.
     */
    PRPF_STATUS_CANCELLED = 3,
    /**
     * The library is at fault. The objects of the call can only be freed.
     */
    PRPF_STATUS_INTERNAL_ERROR = 4,
    /**
     * A library that the denoiser uses has failed. The filter keeps its latest result.
     */
    PRPF_STATUS_DENOISER_FAILED = 5,
} PrpfStatus;

/**
 * The image and the maps of a result.
 */
typedef enum {
    /**
     * Linear RGB, directly visible emission included: 3 channels.
     */
    PRPF_MAP_IMAGE = 0,
    /**
     * The image as the first half of the samples gives it: 3 channels.
     */
    PRPF_MAP_FIRST_HALF = 1,
    /**
     * The image as the second half of the samples gives it: 3 channels.
     */
    PRPF_MAP_SECOND_HALF = 2,
    /**
     * Estimated variance of the image, squared radiance: 3 channels.
     */
    PRPF_MAP_VARIANCE = 3,
    /**
     * Unbiased, noisy estimate of the squared error, squared radiance: 3 channels.
     */
    PRPF_MAP_RISK = 4,
    /**
     * Estimated squared error, mean of channels, squared radiance: 1 channel.
     */
    PRPF_MAP_ERROR = 5,
    /**
     * Squared difference from the unfiltered image over its expected value, about 1 where the filter is unbiased: 1 channel.
     */
    PRPF_MAP_RESIDUAL = 6,
    /**
     * 1 where interpolation of feature weights failed, of "prpf" only: 1 channel.
     */
    PRPF_MAP_INTERPOLATION_FAILURE = 7,
} PrpfMap;

/**
 * A denoiser, and the result of its latest pass. One thread uses a filter at a time.
 */
typedef struct PrpfFilter PrpfFilter;

/**
 * Statistics of the samples of every pixel of an image. Several threads may use one store at a time; their calls wait for
 * each other.
 */
typedef struct PrpfStore PrpfStore;

/**
 * Half of the samples of every pixel, which a renderer has reduced to moments. Pixels are in rows from the top.
 * The buffers have as many values as these shapes say. All values are finite, also those of pixels without samples.
 */
typedef struct {
    /**
     * Number of samples, at most 1073741823: [height][width].
     */
    const uint32_t *counts;
    /**
     * Means of the samples, from -1e15 to 1e15, those of radiance from 0: [height][width][dimension].
     */
    const float *means;
    /**
     * Unbiased variances of the samples, not of their mean, from 0 to 1e30: [height][width][dimension].
     */
    const float *variances;
} PrpfHalfMoments;

/**
 * A function that is called on the thread of prpf_filter_run() about 50 times a second during a pass.
 *
 * user: as given to prpf_filter_set_progress().
 *
 * fraction: of the pass, in [0, 1), estimated from the time of the filter's latest pass, or from an assumed time.
 *
 * Returns 0 to go on, anything else to cancel the pass. It must not use the filter, throw an exception or jump out.
 */
typedef int (*PrpfProgress)(void *user, double fraction);

/**
 * The estimated relMSE of an image; all NaN if too few pixels have samples in both halves, or squares of pixels were filtered.
 */
typedef struct {
    /**
     * relMSE.
     */
    double relmse;
    /**
     * Lower end of the 95 % interval.
     */
    double low;
    /**
     * Upper end of the 95 % interval.
     */
    double high;
} PrpfEstimate;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * Returns the version of the library, such as "0.1.0"; it lives as long as the library. A program that is compiled with
 * another PRPF_VERSION must be compiled anew: functions and structures may differ.
 */
const char *prpf_version(void);

/**
 * Returns what went wrong in the calling thread's last call that returns a status: one line of UTF-8 that says what was
 * found and what is accepted. NULL if nothing did. The text lives until that thread's next such call.
 */
const char *prpf_error_message(void);

/**
 * Sets the number of threads that a call works on at most; 0 stands for one on each core, the default. It holds for the
 * whole process and can be set once, before stores and filters are created. If the system starts no more threads the status is
 * PRPF_STATUS_OUT_OF_MEMORY, and another number can be set.
 */
PrpfStatus prpf_set_threads(size_t threads);

/**
 * Returns the name of a denoiser, such as "nlm draft": the default's for index 0, NULL behind the last one. Names live as
 * long as the library. Those of "oidn" are in the list also where that is not installed: prpf_filter_create() then fails.
 */
const char *prpf_denoiser_name(size_t index);

/**
 * Filters by other weights of "learned", in the whole process: before the first pass, and once. The same file again changes
 * nothing.
 *
 * path: of a file that training/export.py has written, in UTF-8.
 *
 * `path` is null or points to a text.
 */
PrpfStatus prpf_use_weights(const char *path);

/**
 * Creates an empty store for samples of any renderer.
 *
 * width, height: of the image in pixels.
 *
 * dimensions: the names of the values of a sample, in the order in which samples are pushed. "R", "G" and "B" are required
 * (linear radiance, not negative). Features improve the image: "albedo.r", "albedo.g", "albedo.b" in [0, 1]; unit normals
 * "N1.x", "N1.y", "N1.z" of the first hit and "N2.x", "N2.y", "N2.z" of the second; positions "P1.x", ... and "P2.x", ... in units of the
 * scene's diameter. Random parameters in [0, 1) are read by "prpf" and "rpf": "lens.u", "lens.v", "time", "light1.u", "light1.v",
 * "bsdf1.u", "bsdf1.v". "film.x" and "film.y" are the film position in pixels, the pixel's centre by default. "radiance.r", ...,
 * "emission.r", ... and "hit" are auxiliary. The names of a group are given together.
 *
 * reservoir: sample vectors that are kept of each pixel: 0, or 8 for "prpf", or all for "rpf".
 *
 * seed: of the reservoir and of filters.
 *
 * store: becomes the store, to be freed with prpf_store_free(); NULL if there is none.
 *
 * Pointers are null or point to as many values as their counts say.
 */
PrpfStatus prpf_store_create(size_t width,
                             size_t height,
                             const char *const *dimensions,
                             size_t dimension_count,
                             size_t reservoir,
                             uint64_t seed,
                             PrpfStore **store);

/**
 * Creates a store of buffers that a renderer has reduced its samples to.
 *
 * halves: two independent halves of the samples of each pixel, such as two renders with different seeds. A half may have one
 * sample, of variance 0. There are no sample vectors, so that "prpf" and "rpf" cannot filter the store.
 *
 * The other arguments are those of prpf_store_create().
 *
 * Pointers are null or point to as many values as their counts say, the buffers of the halves to as many as pixels, and
 * pixels times dimensions.
 */
PrpfStatus prpf_store_create_from_moments(size_t width,
                                          size_t height,
                                          const char *const *dimensions,
                                          size_t dimension_count,
                                          const PrpfHalfMoments *halves,
                                          uint64_t seed,
                                          PrpfStore **store);

/**
 * Adds the samples of a rectangle of pixels, equally many of each. Samples must be independent, each with weight 1 in one pixel,
 * as from a box filter. One with a value that is not finite or beyond 1e15, or with negative radiance, is rejected alone.
 *
 * x, y: the pixel of the rectangle's upper left corner. width, height: its size in pixels.
 *
 * samples: samples of each pixel.
 *
 * values: [height][width][samples][dimension]. value_count: their number.
 *
 * Pointers are null or point to a store, and to as many values as their counts say.
 */
PrpfStatus prpf_store_push(PrpfStore *store,
                           size_t x,
                           size_t y,
                           size_t width,
                           size_t height,
                           size_t samples,
                           const float *values,
                           size_t value_count);

/**
 * Adds samples of pixels in any order. See prpf_store_push() for what is rejected.
 *
 * pixels: an x and a y for each sample: [sample][2].
 *
 * values: [sample][dimension].
 *
 * Pointers are null or point to a store, and to as many values as their counts say.
 */
PrpfStatus prpf_store_push_pixels(PrpfStore *store,
                                  const uint32_t *pixels,
                                  size_t pixel_value_count,
                                  const float *values,
                                  size_t value_count);

/**
 * Reads the number of valid samples of each pixel: [height][width].
 *
 * Pointers are null or point to a store, and to as many values as their counts say.
 */
PrpfStatus prpf_store_counts(const PrpfStore *store, uint32_t *counts, size_t value_count);

/**
 * Reads the number of samples of the whole image. valid: those that are in the statistics. rejected: those that are not; see
 * prpf_store_push(). Either may be NULL.
 *
 * Pointers are null or point to a store, and to one value.
 */
PrpfStatus prpf_store_samples(const PrpfStore *store,
                              uint64_t *valid,
                              uint64_t *rejected);

/**
 * Frees a store, which no other thread uses. NULL is ignored.
 *
 * `store` is null or comes from a function that creates stores and has not been freed.
 */
void prpf_store_free(PrpfStore *store);

/**
 * Creates a filter.
 *
 * denoiser: a name that prpf_denoiser_name() gives, such as "nlm draft"; without its second word the method's default.
 *
 * filter: becomes the filter, to be freed with prpf_filter_free(); NULL if there is none.
 *
 * Pointers are null or point to a text and to one value.
 */
PrpfStatus prpf_filter_create(const char *denoiser,
                              PrpfFilter **filter);

/**
 * Sets the function that is called during the passes of a filter and may cancel them; NULL for none. "oidn" is cancelled only
 * after its pass.
 *
 * `filter` is null or points to a filter; `progress` may be called with `user` during each of its passes.
 */
PrpfStatus prpf_filter_set_progress(PrpfFilter *filter,
                                    PrpfProgress progress,
                                    void *user);

/**
 * Filters a store, and keeps the result until the filter's next completed pass. The calling thread waits. Others may add
 * samples to the store meanwhile; the pass does not see them, but the store is then copied.
 *
 * A store with fewer samples than pixels may be filtered by a faster denoiser; see prpf_filter_made_by(). If the library of "oidn"
 * fails the status is PRPF_STATUS_DENOISER_FAILED.
 *
 * Pointers are null or point to a filter and a store.
 */
PrpfStatus prpf_filter_run(PrpfFilter *filter,
                           const PrpfStore *store);

/**
 * Frees a filter, which no other thread uses. NULL is ignored.
 *
 * `filter` is null or comes from prpf_filter_create() and has not been freed.
 */
void prpf_filter_free(PrpfFilter *filter);

/**
 * Reads the image or a map of a filter's result: [height][width][channel], rows from the top.
 *
 * map: one of PrpfMap.
 *
 * value_count: pixels times channels.
 *
 * Pointers are null or point to a filter, and to as many values as their counts say.
 */
PrpfStatus prpf_filter_read(const PrpfFilter *filter, uint32_t map, float *values, size_t value_count);

/**
 * Reads the estimated error of a filter's image.
 *
 * Pointers are null or point to a filter and to one value.
 */
PrpfStatus prpf_filter_estimate(const PrpfFilter *filter, PrpfEstimate *estimate);

/**
 * Returns the name of the denoiser that made a filter's result, which lives as long as the library; NULL without a result.
 *
 * `filter` is null or points to a filter.
 */
const char *prpf_filter_made_by(const PrpfFilter *filter);

/**
 * Computes the priority of each pixel from the maps of a filter's result: [height][width]. Total sample counts should be
 * proportional to it.
 *
 * store: the one that was filtered.
 *
 * Pointers are null or point to a filter, a store, and to as many values as their counts say.
 */
PrpfStatus prpf_filter_priority(const PrpfFilter *filter,
                                const PrpfStore *store,
                                float *priority,
                                size_t value_count);

/**
 * Computes the sample counts of the next batch: [height][width].
 *
 * priority: a number from 0 up for each pixel, to which total counts, with the samples that the store has, become proportional
 * as far as the batch allows; 15 % of it is distributed uniformly, and no pixel gets more than about 8 times its mean.
 *
 * samples: of the batch.
 *
 * min_spp, max_spp: bounds of a pixel's total; no upper bound for a max_spp of 0.
 *
 * Pointers are null or point to a store, and to as many values as their counts say.
 */
PrpfStatus prpf_store_allocate(const PrpfStore *store,
                               const float *priority,
                               size_t priority_count,
                               uint64_t samples,
                               uint32_t min_spp,
                               uint32_t max_spp,
                               uint32_t *counts,
                               size_t value_count);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PRPF_H */
