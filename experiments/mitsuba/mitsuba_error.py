#!/usr/bin/env python3
"""Compares the error of the unfiltered image at equal time with Mitsuba 3 (llvm_ad_rgb).

    mitsuba_error.py PRPF [SCENE...]

Each program's error is the relMSE of 64 samples per pixel against its own image of 2048, so that differences between
the models do not count. Mitsuba's samples are independent, so its error after our render time follows from the
measured one.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from mitsuba_throughput import SIDE, SPP, cornell, glossy, lens, mi, seconds

REFERENCE, SEEDS = 2048, 3
SCENES = Path(__file__).resolve().parents[2] / "benches" / "throughput"


def relmse(image, reference):
    return float(np.mean((image - reference) ** 2 / (reference**2 + 0.01)))


def measure_mitsuba(make):
    """Returns the medians of relMSE and of wall time in seconds."""
    scene = mi.load_dict(make())
    image = lambda spp, seed: np.array(mi.render(scene, spp=spp, seed=seed))
    # Render in parts, because all samples at once exceed the memory.
    reference = np.mean([image(SPP, 100 + seed) for seed in range(REFERENCE // SPP)], axis=0, dtype=np.float64)
    errors = [relmse(image(SPP, seed), reference) for seed in range(1, SEEDS + 1)]
    return np.median(errors), np.median([seconds(scene, seed)[0] for seed in range(1, SEEDS + 1)])


def measure_prpf(prpf, name, folder):
    """Returns the medians of relMSE and of render time in seconds."""
    def render(spp, seed, out):
        options = ["--denoiser", "none", "--sampling", "uniform", "--quiet"]
        files = ["-o", folder / out, "--report", folder / "report.json"]
        command = [prpf, "render", SCENES / f"{name}.pbrt", "--spp", spp, "--seed", seed, *options, *files]
        subprocess.run([str(word) for word in command], check=True)
        return json.loads((folder / "report.json").read_text())["seconds"]["render"]

    render(REFERENCE, 100, "reference.exr")
    errors, times = [], []
    for seed in range(1, SEEDS + 1):
        times.append(render(SPP, seed, "image.exr"))
        compare = [prpf, "compare", str(folder / "image.exr"), str(folder / "reference.exr"), "--json"]
        errors.append(json.loads(subprocess.run(compare, check=True, capture_output=True).stdout)["relmse"])
    return np.median(errors), np.median(times)


def main():
    prpf, wanted = sys.argv[1], sys.argv[2:]
    print("scene: relMSE of 64 samples per pixel of prpf, Mitsuba; M samples per second of both; error at equal time")
    with tempfile.TemporaryDirectory() as folder:
        for name, make in {"cornell": cornell, "lens": lens, "glossy": glossy}.items():
            if wanted and name not in wanted:
                continue
            theirs, their_seconds = measure_mitsuba(make)
            ours, our_seconds = measure_prpf(prpf, name, Path(folder))
            # Mitsuba's error after our render time
            theirs_at_our_time = theirs * their_seconds / our_seconds
            speeds = [SIDE * SIDE * SPP / 1e6 / s for s in (our_seconds, their_seconds)]
            print(
                f"{name}: {ours:.3g}, {theirs:.3g}; {speeds[0]:.2f}, {speeds[1]:.2f}; "
                f"{ours:.3g} against {theirs_at_our_time:.3g}, ratio {ours / theirs_at_our_time:.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
