"""Reads training data: the statistics of noisy renders, with their references."""

from collections import namedtuple
from pathlib import Path

import numpy as np

from model import STATISTICS, Statistics

# Arrays of `planes` are [channels, h, w] in half precision; `noise` is the variance of the reference's mean.
View = namedtuple("View", ["scene", "spp", "is_adaptive", "statistics", "reference", "noise"])
HALF_REFERENCE = 256


def luminance(rgb):
    return (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2])[None]


def statistics(arrays):
    """The statistics of a noisy render; `arrays` are those of a set (see README.md), without the set's name."""
    counts = np.stack([arrays["count_a"], arrays["count_b"]]).astype(np.float32)
    total = np.maximum(counts.sum(0), 1)[None]

    def read(name, default):
        found = arrays.get(name)
        return np.full((1, *total.shape[1:]), default, np.float32) if found is None else found.astype(np.float32)

    def mean_of_halves(name):
        a, b = (read(f"{name}_{half}", 0.0) for half in "ab")
        return a + counts[1] / total * (b - a)

    found = {
        "colour": mean_of_halves("colour"),
        "deviation": luminance(read("colour_deviation", 0.0)),
        "difference": luminance(read("colour_a", 0.0) - read("colour_b", 0.0)),
        "emission": mean_of_halves("emission"),
        "albedo": read("albedo_mean", 1.0),
        "albedo_deviation": read("albedo_deviation", 0.0).mean(0),
        "normal": read("normal_mean", 0.0),
        "normal_deviation": read("normal_deviation", 0.0).mean(0),
        "second_normal": read("second_normal_mean", 0.0),
        "position_deviation": read("position_deviation", 0.0).mean(0),
        "hit": read("hit_mean", 1.0),
        "count": total,
        "nlm": read("nlm", 0.0),
        "has_nlm": np.float32(1),
    }
    shape = total.shape[1:]
    return Statistics(
        **{name: np.broadcast_to(x, (STATISTICS[name], *shape)).astype(np.float16) for name, x in found.items()}
    )


def converged(of_set, halves, draw):
    """A view of the first half of the reference, whose target is the other half. So the filter learns to converge."""
    emission = of_set.emission.astype(np.float32)
    spread = 2 * of_set.deviation.astype(np.float32) / np.sqrt(HALF_REFERENCE)
    return of_set._replace(
        colour=np.maximum(halves[0] - emission, 0).astype(np.float16),
        difference=(spread * draw.normal(size=spread.shape)).astype(np.float16),
        count=np.full_like(of_set.count, HALF_REFERENCE),
        has_nlm=np.zeros_like(of_set.has_nlm),
    )


def read_views(folder, keep):
    """All views of the scenes whose number `keep` accepts."""
    views = []
    draw = np.random.default_rng(0)
    for path in sorted(Path(folder).glob("*.npz")):
        if not keep(int(path.stem)):
            continue
        with np.load(path) as loaded:
            arrays = {name: loaded[name] for name in loaded}
        halves = [arrays[f"reference_{half}"].astype(np.float32) for half in "ab"]
        reference = ((halves[0] + halves[1]) / 2).astype(np.float16)
        noise = ((halves[0] - halves[1]) ** 2 / 4).astype(np.float16)
        k, finest = 0, None
        while f"set{k}/spp" in arrays:
            of_set = {name.split("/")[1]: array for name, array in arrays.items() if name.startswith(f"set{k}/")}
            view = View(
                path.stem, int(of_set["spp"]), bool(of_set["adaptive"]), statistics(of_set), reference, noise
            )
            views.append(view)
            finest = view if finest is None or view.spp > finest.spp else finest
            k += 1
        of_half = converged(finest.statistics, halves, draw)
        views.append(View(path.stem, HALF_REFERENCE, False, of_half, halves[1].astype(np.float16), 2 * noise))
    return views
