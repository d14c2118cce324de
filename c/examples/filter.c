/* Filters an image from files: two renders of one frame with different seeds, and features, in PFM files.
 *
 *     filter OUT.pfm A.pfm B.pfm [ALBEDO.pfm NORMALS.pfm]
 *
 * Writes the filtered image and prints its estimated error. The features are free of noise, or means of the samples of
 * both renders. */

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "prpf.h"

typedef struct {
    size_t width, height;
    float *rgb; /* [height][width][3], rows from the top */
} Image;

static void fail(const char *what, const char *why) {
    fprintf(stderr, "filter: %s: %s\n", what, why);
    exit(1);
}

/* Ends the program with the library's message if a call has failed. */
static void check(PrpfStatus status) {
    if (status != PRPF_STATUS_OK)
        fail("prpf", prpf_error_message());
}

/* Reads a colour PFM file in the byte order of this machine, if that is little-endian. */
static Image read_pfm(const char *path) {
    Image image;
    double scale;
    size_t y;
    FILE *file = fopen(path, "rb");
    if (!file)
        fail(path, "cannot be opened");
    if (fscanf(file, "PF %zu %zu %lf", &image.width, &image.height, &scale) != 3 || scale >= 0.0 ||
        fgetc(file) != '\n' || image.width == 0 || image.width > 65535 || image.height > 65535)
        fail(path, "not a little-endian colour PFM file");
    image.rgb = calloc(image.width * image.height + 1, 3 * sizeof(float));
    if (!image.rgb)
        fail(path, "too large");
    for (y = image.height; y-- > 0;) /* rows are stored from the bottom */
        if (fread(image.rgb + 3 * image.width * y, 3 * sizeof(float), image.width, file) != image.width)
            fail(path, "ends early");
    fclose(file);
    return image;
}

static void write_pfm(const char *path, Image image) {
    size_t y;
    int failed;
    FILE *file = fopen(path, "wb");
    if (!file)
        fail(path, "cannot be opened");
    fprintf(file, "PF\n%zu %zu\n-1\n", image.width, image.height);
    for (y = image.height; y-- > 0;)
        fwrite(image.rgb + 3 * image.width * y, 3 * sizeof(float), image.width, file);
    failed = ferror(file);
    if (fclose(file) || failed)
        fail(path, "cannot be written");
}

/* Shows how far the pass is; never cancels it. */
static int show_progress(void *user, double fraction) {
    fprintf((FILE *)user, "\r%3.0f %%", 100.0 * fraction);
    return 0;
}

int main(int count, char **paths) {
    static const char *const NAMES[] = {"R", "G", "B", "albedo.r", "albedo.g", "albedo.b", "N1.x", "N1.y", "N1.z"};
    size_t files = (size_t)count - 2, groups = files == 4 ? 3 : 1, columns = 3 * groups, pixels, i, k;
    Image images[4];
    uint32_t *counts;
    float *means[2], *variances;
    PrpfHalfMoments halves[2];
    PrpfStore *store;
    PrpfFilter *filter;
    PrpfEstimate estimate;

    /* Take no library of another version, whose functions may differ */
    if (strcmp(prpf_version(), PRPF_VERSION) != 0)
        fail("the library's version, where " PRPF_VERSION " is needed", prpf_version());

    /* Read the images */
    if (count != 4 && count != 6)
        fail("usage", "filter OUT.pfm A.pfm B.pfm [ALBEDO.pfm NORMALS.pfm]");
    for (k = 0; k < files; k++) {
        images[k] = read_pfm(paths[2 + k]);
        if (images[k].width != images[0].width || images[k].height != images[0].height)
            fail(paths[2 + k], "has another size");
    }

    /* Make each render one half: one sample per pixel, with its features */
    pixels = images[0].width * images[0].height;
    counts = calloc(pixels + 1, sizeof *counts);
    variances = calloc(pixels * columns + 1, sizeof *variances);
    if (!counts || !variances)
        fail(paths[2], "too large");
    for (i = 0; i < pixels; i++)
        counts[i] = 1;
    for (k = 0; k < 2; k++) {
        means[k] = calloc(pixels * columns + 1, sizeof *means[k]);
        if (!means[k])
            fail(paths[2], "too large");
        for (i = 0; i < pixels; i++) {
            memcpy(means[k] + i * columns, images[k].rgb + 3 * i, 3 * sizeof(float));
            if (groups == 3) {
                memcpy(means[k] + i * columns + 3, images[2].rgb + 3 * i, 3 * sizeof(float));
                memcpy(means[k] + i * columns + 6, images[3].rgb + 3 * i, 3 * sizeof(float));
            }
        }
        halves[k].counts = counts;
        halves[k].means = means[k];
        halves[k].variances = variances;
    }

    /* Filter them */
    check(prpf_set_threads(2));
    check(prpf_store_create_from_moments(images[0].width, images[0].height, NAMES, columns, halves, 0, &store));
    check(prpf_filter_create("nlm", &filter));
    check(prpf_filter_set_progress(filter, show_progress, stderr));
    check(prpf_filter_run(filter, store));
    check(prpf_filter_read(filter, PRPF_MAP_IMAGE, images[0].rgb, 3 * pixels));
    check(prpf_filter_estimate(filter, &estimate));
    write_pfm(paths[1], images[0]);
    printf("\r%s: estimated relMSE %.4f (%.4f to %.4f)\n", prpf_filter_made_by(filter), estimate.relmse, estimate.low,
           estimate.high);

    prpf_filter_free(filter);
    prpf_store_free(store);
    for (k = 0; k < files; k++)
        free(images[k].rgb);
    for (k = 0; k < 2; k++)
        free(means[k]);
    free(counts);
    free(variances);
    return 0;
}
