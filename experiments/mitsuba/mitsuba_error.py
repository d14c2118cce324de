#!/usr/bin/env python3
"""Error of the unfiltered image after equal time, here and in Mitsuba 3 (llvm_ad_rgb).

    mitsuba_error.py PRPF [SCENE...]

Each program's error is the relMSE of 64 samples per pixel against its own image of 2048 (so that
differences of the models do not count), and is then held against the other's after the same time
of rendering on the same machine. Mitsuba's samples are independent, so its error after another
number of samples follows from the one measured.
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


def of_mitsuba(make):
    """relMSE, and seconds of wall time, medians."""
    scene = mi.load_dict(make())
    image = lambda spp, seed: np.array(mi.render(scene, spp=spp, seed=seed))
    # Parts, as all samples at once would take too much memory.
    reference = np.mean([image(SPP, 100 + seed) for seed in range(REFERENCE // SPP)], axis=0, dtype=np.float64)
    errors = [relmse(image(SPP, seed), reference) for seed in range(1, SEEDS + 1)]
    return np.median(errors), np.median([seconds(scene, seed)[0] for seed in range(1, SEEDS + 1)])


def of_prpf(prpf, name, folder):
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
    print("scene: relMSE of 64 samples per pixel here, in Mitsuba; samples a second, M; error after equal time")
    with tempfile.TemporaryDirectory() as folder:
        for name, make in {"cornell": cornell, "lens": lens, "glossy": glossy}.items():
            if wanted and name not in wanted:
                continue
            theirs, their_seconds = of_mitsuba(make)
            ours, our_seconds = of_prpf(prpf, name, Path(folder))
            # What Mitsuba has after our time.
            theirs_then = theirs * their_seconds / our_seconds
            speeds = [SIDE * SIDE * SPP / 1e6 / s for s in (our_seconds, their_seconds)]
            print(
                f"{name}: {ours:.3g}, {theirs:.3g}; {speeds[0]:.2f}, {speeds[1]:.2f}; "
                f"{ours:.3g} against {theirs_then:.3g}, ratio {ours / theirs_then:.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
