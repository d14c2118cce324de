"""Reads training data: the statistics of noisy renders, with their references."""

from collections import namedtuple

import numpy as np

from model import STATISTICS, Statistics

# Arrays are [channels, h, w] in half precision; `noise` is the variance of the reference's mean. A converged view is one half of
# the reference.
View = namedtuple("View", ["scene", "spp", "is_adaptive", "is_converged", "statistics", "reference", "noise"])


def half(values):
    """Half precision, finite."""
    return np.clip(values, -6e4, 6e4).astype(np.float16)


def luminance(rgb):
    return (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2])[None]


def brightness(colour):
    """The unit of radiance: the mean luminance, where luminances above eight times the median are clamped.

    Pixels without light do not count for the median.
    """
    level = luminance(colour)
    lit = level[level > 0]
    return np.minimum(level, 8 * np.median(lit)).mean() if lit.size else 1.0


def relative(deviation):
    """A deviation in units of its mean over the image, so that the scene's size does not matter."""
    mean = deviation.mean()
    return deviation / mean if mean > 0 else deviation


def statistics(arrays):
    """The statistics of a noisy render, and the factor that brought radiance to units of `brightness`.

    `arrays` are those of a set (see README.md), without the set's name.
    """
    counts = np.stack([arrays["count_a"], arrays["count_b"]]).astype(np.float32)
    total = np.maximum(counts.sum(0), 1)[None]

    def read(name, default):
        found = arrays.get(name)
        return np.full((1, *total.shape[1:]), default, np.float32) if found is None else found.astype(np.float32)

    def mean_of_halves(name):
        a, b = (read(f"{name}_{half}", 0.0) for half in "ab")
        return a + counts[1] / total * (b - a)

    colour = mean_of_halves("colour")
    scale = np.float32(1 / brightness(colour))
    found = {
        "colour": scale * colour,
        "deviation": scale * luminance(read("colour_deviation", 0.0)),
        "difference": scale * luminance(read("colour_a", 0.0) - read("colour_b", 0.0)),
        "emission": scale * mean_of_halves("emission"),
        "albedo": read("albedo_mean", 1.0),
        "albedo_deviation": read("albedo_deviation", 0.0).mean(0),
        "normal": read("normal_mean", 0.0),
        "normal_deviation": read("normal_deviation", 0.0).mean(0),
        "second_normal": read("second_normal_mean", 0.0),
        "position_deviation": relative(read("position_deviation", 0.0).mean(0)),
        "hit": read("hit_mean", 1.0),
        "count": total,
        "nlm": scale * read("nlm", 0.0),
        "has_nlm": np.float32(1),
    }
    shape = total.shape[1:]
    planes = {name: half(np.broadcast_to(x, (STATISTICS[name], *shape))) for name, x in found.items()}
    return Statistics(**planes), scale


def converged(of_set, halves, spp, draw):
    """A view of the first half of the reference, whose target is the other half. So the filter learns to converge."""
    emission = of_set.emission.astype(np.float32)
    spread = 2 * of_set.deviation.astype(np.float32) / np.sqrt(spp)
    return of_set._replace(
        colour=half(np.maximum(halves[0] - emission, 0)),
        difference=half(spread * draw.normal(size=spread.shape)),
        count=np.full_like(of_set.count, spp),
        has_nlm=np.zeros_like(of_set.has_nlm),
    )


def read_views(paths):
    """All views of the scenes in these files."""
    views = []
    draw = np.random.default_rng(0)
    for path in paths:
        with np.load(path) as loaded:
            arrays = {name: loaded[name] for name in loaded}
        halves = [arrays[f"reference_{half}"].astype(np.float32) for half in "ab"]
        reference, noise = (halves[0] + halves[1]) / 2, (halves[0] - halves[1]) ** 2 / 4
        half_spp = int(arrays["reference_spp"]) // 2
        k, finest, scale_of_finest = 0, None, None
        while f"set{k}/spp" in arrays:
            of_set = {name.split("/")[1]: array for name, array in arrays.items() if name.startswith(f"set{k}/")}
            found, scale = statistics(of_set)
            spp, is_adaptive = int(of_set["spp"]), bool(of_set["adaptive"])
            views.append(
                View(path.stem, spp, is_adaptive, False, found, half(scale * reference), half(scale**2 * noise))
            )
            if finest is None or spp > finest.spp:
                finest, scale_of_finest = views[-1], scale
            k += 1
        halves = [scale_of_finest * x for x in halves]
        of_half = converged(finest.statistics, halves, half_spp, draw)
        of_target = half(2 * scale_of_finest**2 * noise)
        views.append(View(path.stem, half_spp, False, True, of_half, half(halves[1]), of_target))
    return views
