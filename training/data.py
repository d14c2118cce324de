"""Reads training data and turns statistics into the network's inputs."""

from pathlib import Path

import numpy as np

from model import ALBEDO_FLOOR, INPUTS


def mean_of_halves(arrays, name, counts):
    a, b = (arrays[f"{name}_{half}"].astype(np.float32) for half in "ab")
    fraction = counts[1] / np.maximum(counts[0] + counts[1], 1)
    return a + fraction * (b - a), a - b


def luminance(rgb):
    return (0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2])[None]


def statistics(arrays):
    """Inputs, colour, albedo and emission of a noisy render, each [h, w, channels].

    `arrays` has the arrays of a set (see README.md), without the set's name.
    """
    counts = np.stack([arrays["count_a"], arrays["count_b"]]).astype(np.float32)
    total = np.maximum(counts.sum(0), 1)[None]
    shape = total.shape[1:]

    def read(name, channels, default):
        found = arrays.get(name)
        return np.full((channels, *shape), default, np.float32) if found is None else found.astype(np.float32)

    colour, difference = mean_of_halves(arrays, "colour", counts)
    if "emission_a" in arrays:
        emission, _ = mean_of_halves(arrays, "emission", counts)
    else:
        emission = np.zeros_like(colour)
    albedo = read("albedo_mean", 3, 1.0)
    divisor = np.maximum(albedo, ALBEDO_FLOOR)
    level = luminance(colour)
    deviation = luminance(read("colour_deviation", 3, 0.0)) / np.sqrt(total)
    hit = read("hit_mean", 1, 1.0)
    inputs = [
        np.log1p(10 * colour / divisor),
        np.log1p(10 * level),
        np.log1p(10 * deviation / (level + 0.01)),
        np.log1p(10 * np.abs(luminance(difference)) / (level + 0.01)),
        albedo,
        read("albedo_deviation", 3, 0.0).mean(0, keepdims=True),
        read("normal_mean", 3, 0.0),
        read("normal_deviation", 3, 0.0).mean(0, keepdims=True),
        read("second_normal_mean", 3, 0.0),
        np.log1p(1e3 * read("position_deviation", 3, 0.0).mean(0, keepdims=True)),
        hit,
        np.log1p(luminance(emission)),
        np.log2(total) / 6,
    ]
    inputs = np.concatenate(inputs)
    assert inputs.shape[0] == INPUTS, inputs.shape
    return [np.moveaxis(x, 0, -1) for x in (inputs, colour, albedo, emission)]


class Views:
    """All noisy renders of a folder, held in half precision."""

    def __init__(self, folder, keep):
        self.entries = []
        for path in sorted(Path(folder).glob("*.npz")):
            if not keep(int(path.stem)):
                continue
            with np.load(path) as loaded:
                arrays = {name: loaded[name] for name in loaded}
            halves = [np.moveaxis(arrays[f"reference_{half}"].astype(np.float32), 0, -1) for half in "ab"]
            reference = (halves[0] + halves[1]) / 2
            noise = (halves[0] - halves[1]) ** 2 / 4
            k = 0
            while f"set{k}/spp" in arrays:
                of_set = {name.split("/")[1]: array for name, array in arrays.items() if name.startswith(f"set{k}/")}
                inputs, colour, albedo, emission = statistics(of_set)
                nlm = np.moveaxis(of_set["nlm"], 0, -1)
                planes = [x.astype(np.float16) for x in (inputs, colour, albedo, emission, nlm, reference, noise)]
                self.entries.append((path.stem, int(of_set["spp"]), bool(of_set["adaptive"]), planes))
                k += 1
