"""Renders training data: noisy statistics and references of random scenes.

    python training/make_data.py FOLDER --count 300

Each random scene of `prpf-scenes random` gives one file `NNNN.npz`: a view with a few noisy renders (uniform and
adaptive, 1 to 64 samples per pixel) and the halves of a reference. Scenes whose file exists are skipped, so that the
command goes on where it was stopped. A file takes about 3 MB. README.md describes the arrays.
"""

import argparse
import os
import random
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

FEW = [1, 2, 4, 8]
MANY = [16, 32, 64]
# Width of the whole image in units of the view's: what is seen large in a large image is smooth over many pixels.
ZOOMS = [1, 2, 4, 6]
# Samples per pixel of references. More scenes teach more than cleaner references, whose noise the loss subtracts; some clean ones
# teach convergence.
REFERENCES = [128] * 7 + [512]
SCENE_SEED = 2027


def run(*arguments):
    done = subprocess.run([str(a) for a in arguments], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, arguments))}: {done.stderr.strip()[-300:]}")


def render(prpf, scene, folder, window, spp, seed, *options):
    """Renders a view and returns the arrays of its state. `window` are the options that choose it."""
    state, image, arrays = (folder / name for name in ["a.state", "a.exr", "a.npz"])
    run(prpf, "render", scene, *window, "--spp", spp, "--seed", seed, "--state", state,
        "-o", image, "--quiet", *options)
    run(prpf, "export", state, "-o", arrays, "--quiet")
    with np.load(arrays) as loaded:
        names = [str(name) for name in loaded["dimension_names"]]
        keys = ["count_a", "count_b", "mean", "m2", "mean_a", "mean_b", "image"]
        found = {key: loaded[key] for key in keys}
    state.unlink()
    return names, found


def half(values):
    """Half precision, finite."""
    return np.clip(np.nan_to_num(values), -6e4, 6e4).astype(np.float16)


def planes(names, found, dimensions):
    """Means and sample deviations of dimensions and the means of both halves; None if the layout lacks one of them."""
    if any(name not in names for name in dimensions):
        return None
    index = [names.index(name) for name in dimensions]
    count = found["count_a"] + found["count_b"]
    deviation = np.sqrt(found["m2"][index] / np.maximum(count.astype(float) - 1, 1))
    return found["mean"][index], deviation, found["mean_a"][index], found["mean_b"][index]


GROUPS = {
    "colour": ["R", "G", "B"],
    "emission": ["emission.r", "emission.g", "emission.b"],
    "albedo": ["albedo.r", "albedo.g", "albedo.b"],
    "normal": ["N1.x", "N1.y", "N1.z"],
    "second_normal": ["N2.x", "N2.y", "N2.z"],
    "position": ["P1.x", "P1.y", "P1.z"],
    "hit": ["hit"],
}
# Groups whose halves are kept.
WITH_HALVES = {"colour", "emission"}


def pack(names, found, scale):
    """The arrays of a noisy render; radiance in units of the image's mean."""
    packed = {"count_a": found["count_a"].astype(np.uint16), "count_b": found["count_b"].astype(np.uint16)}
    packed["nlm"] = half(found["image"] * scale)
    for group, dimensions in GROUPS.items():
        values = planes(names, found, dimensions)
        if values is None:
            continue
        factor = scale if group in WITH_HALVES else 1.0
        mean, deviation, mean_a, mean_b = (array * factor for array in values)
        packed[f"{group}_deviation"] = half(deviation)
        if group in WITH_HALVES:
            packed[f"{group}_a"], packed[f"{group}_b"] = half(mean_a), half(mean_b)
        else:
            packed[f"{group}_mean"] = half(mean)
    return packed


def radiance(names, part):
    dimensions = ["radiance.r", "radiance.g", "radiance.b"] if "radiance.r" in names else ["R", "G", "B"]
    return part[[names.index(name) for name in dimensions]]


def make(number, arguments):
    """Makes the file of a scene. Returns False if its view shows nothing."""
    draw = random.Random(number)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        run(arguments.scenes, "random", folder, "--first", number, "--count", 1, "--seed", SCENE_SEED)
        scene = folder / f"scene-{number:04d}" / "view-0.pbrt"
        size, zoom = arguments.size, draw.choice(ZOOMS)
        x, y = (draw.randint(0, (zoom - 1) * size) for _ in "xy")
        reference_spp = draw.choice(REFERENCES)
        window = ["--resolution", f"{zoom * size}x{zoom * size}", "--pixelbounds", f"{x},{x + size},{y},{y + size}"]
        names, reference = render(arguments.prpf, scene, folder, window, reference_spp, 1, "--sampling", "uniform",
                                  "--denoiser", "none")
        halves = [radiance(names, reference[f"mean_{part}"]) for part in "ab"]
        level = float(np.mean(halves))
        if not np.isfinite(level) or level <= 0:
            return False
        scale = 1 / level
        arrays = {f"reference_{part}": half(values * scale) for part, values in zip("ab", halves)}
        arrays["reference_spp"] = np.array(reference_spp)
        sets = [(spp, "uniform") for spp in [*draw.sample(FEW, 3), draw.choice(MANY)]]
        sets += [(draw.choice([8, *MANY]), "adaptive")]
        for k, (spp, sampling) in enumerate(sets):
            names, found = render(arguments.prpf, scene, folder, window, spp, 100 + k, "--sampling", sampling,
                                  "--denoiser", "nlm")
            arrays[f"set{k}/spp"] = np.array(spp)
            arrays[f"set{k}/adaptive"] = np.array(sampling == "adaptive")
            arrays |= {f"set{k}/{name}": values for name, values in pack(names, found, scale).items()}
        file = arguments.folder / f"{number:04d}.npz"
        unfinished = file.with_suffix(".part")
        with open(unfinished, "wb") as out:
            np.savez_compressed(out, **arrays)
        unfinished.rename(file)
        return True


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--count", type=int, default=300, help="number of scenes")
    parser.add_argument("--size", type=int, default=128, help="width and height of the views")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="number of scenes that are made at once")
    for option, program in [("--prpf", "prpf"), ("--scenes", "prpf-scenes")]:
        parser.add_argument(option, default=f"target/release/{program}", type=lambda path: Path(path).resolve())
    arguments = parser.parse_args()
    if arguments.size < 112 or arguments.size % 16:
        parser.error(f"--size: found {arguments.size}; accepted are multiples of 16 from 112 up")
    arguments.folder.mkdir(parents=True, exist_ok=True)
    # Scenes in parallel scale better than threads within a small image
    os.environ["RAYON_NUM_THREADS"] = "1"

    def attempt(number):
        """Returns whether nothing has failed."""
        try:
            print(number, "made" if make(number, arguments) else "shows nothing", flush=True)
        except RuntimeError as error:
            print(number, error, file=sys.stderr, flush=True)
            return False
        return True

    numbers = range(arguments.first, arguments.first + arguments.count)
    with ThreadPoolExecutor(arguments.jobs) as pool:
        results = list(pool.map(attempt, (n for n in numbers if not (arguments.folder / f"{n:04d}.npz").exists())))
    if not all(results):
        sys.exit(1)


if __name__ == "__main__":
    main()
