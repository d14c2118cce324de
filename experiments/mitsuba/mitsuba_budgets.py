#!/usr/bin/env python3
"""Compares the denoised image after equal time with Mitsuba 3 (llvm_ad_rgb) and Intel Open Image Denoise.

    mitsuba_budgets.py PRPF [SCENE...] [--budgets 0.5,1,2,4,8,16] [--seeds 3] [--reference-spp 3072]

Of `prpf render --time T` the whole command counts: reading, building, rendering, filtering, writing. Of Mitsuba only
rendering counts, with albedo and normals, after its kernels are compiled, and of OIDN only its filter: as many samples as the
time that the filter leaves allows, by measured seconds per sample. OIDN gets noisy and prefiltered guides; the better image
counts. Programs and budgets alternate.

The reference is the mean of both programs' images of many samples; Mitsuba's is the mirror image. An error is the mean of
(x - r)² / (r² + 0.01) over pixels and channels less that of the reference, which follows from its variance and half the
difference of both programs, in which their models and filters may disagree. Below a fifth of the reference's own error the
figure is NaN. Prints a Markdown table: the geometric mean over the seeds, and the factor by which they spread.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import OpenEXR
import pyoidn
from mitsuba_throughput import SIDE, cornell, dr, glossy, lens, mi

# Most samples per pixel that Mitsuba's memory holds at once
PART = 64
SCENE_FILES = Path(__file__).resolve().parents[2] / "benches" / "throughput"
SCENES = {"cornell": cornell, "lens": lens, "glossy": glossy}
EPSILON = 0.01
# Least error that the reference resolves, in units of its own
LEAST_ERROR = 0.2


class Prpf:
    """Renders by whole commands."""

    def __init__(self, program, name, folder):
        self.command = [program, "render", str(SCENE_FILES / f"{name}.pbrt"), "--quiet"]
        self.image = folder / "image.exr"

    def render(self, *options):
        """Returns all layers of an image as Mitsuba sees it, and the seconds of the command."""
        start = time.perf_counter()
        subprocess.run([*self.command, *map(str, options), "-o", str(self.image)], check=True)
        seconds = time.perf_counter() - start
        with OpenEXR.File(str(self.image)) as file:
            return {name: channel.pixels[:, ::-1] for name, channel in file.channels().items()}, seconds

    def reference(self, spp):
        """Returns the mean of many samples, and its variance."""
        options = ["--spp", spp, "--seed", 1000, "--denoiser", "none", "--sampling", "uniform"]
        layers, _ = self.render(*options)
        return layers["RGB"].astype(float), layers["Variance"].astype(float)


class Mitsuba:
    """Renders colour, albedo and normals, and filters them by OIDN."""

    def __init__(self, make):
        scene = make()
        aovs = {"type": "aov", "aovs": "albedo:albedo,normal:sh_normal", "colour": scene["integrator"]}
        self.scene = mi.load_dict({**scene, "integrator": aovs})
        self.device = pyoidn.Device()
        self.device.commit()
        # Compile the kernels and the network
        self.filter(self.samples(1, 0), is_prefiltered=True)
        self.seconds_per_sample = min(self.timed_samples(16, seed)[1] for seed in range(3)) / 16
        self.filter_seconds = {
            is_prefiltered: min(self.timed_filter(self.samples(4, seed), is_prefiltered)[1] for seed in range(3))
            for is_prefiltered in (False, True)
        }

    def samples(self, spp, seed):
        """Returns colour, albedo and normal of height x width x 3."""
        image = mi.render(self.scene, spp=spp, seed=seed)
        dr.eval(image)
        dr.sync_thread()
        layers = np.array(image)
        return [np.ascontiguousarray(layers[..., i : i + 3]) for i in (0, 3, 6)]

    def timed_samples(self, spp, seed):
        start = time.perf_counter()
        layers = self.samples(spp, seed)
        return layers, time.perf_counter() - start

    def prefilter(self, name, guide):
        """Returns a guide without noise."""
        output = np.empty_like(guide)
        prefilter = pyoidn.Filter(self.device, "RT")
        for name, image in {name: guide, "output": output}.items():
            prefilter.set_image(name, image, pyoidn.OIDN_FORMAT_FLOAT3, image.shape[1], image.shape[0])
        prefilter.commit()
        prefilter.execute()
        return output

    def filter(self, layers, is_prefiltered):
        colour, albedo, normal = layers
        albedo, normal = np.clip(albedo, 0.0, 1.0), np.clip(normal, -1.0, 1.0)
        if is_prefiltered:
            albedo, normal = self.prefilter("albedo", albedo), self.prefilter("normal", normal)
        guides = {"albedo": albedo, "normal": normal, "clean_aux": is_prefiltered}
        return pyoidn.denoise(np.maximum(colour, 0.0), hdr=True, quality="high", **guides)

    def timed_filter(self, layers, is_prefiltered):
        start = time.perf_counter()
        return self.filter(layers, is_prefiltered), time.perf_counter() - start

    def render(self, budget, seed):
        """Returns the images that OIDN makes within `budget` seconds with noisy and with prefiltered guides."""
        images = []
        for is_prefiltered, filter_seconds in self.filter_seconds.items():
            spp = max(1, int((budget - filter_seconds) / self.seconds_per_sample))
            images.append(self.filter(self.accumulated(spp, seed), is_prefiltered))
        return images

    def accumulated(self, spp, seed):
        """Returns the mean of `spp` samples, in parts that fit into memory."""
        counts = [min(PART, spp - done) for done in range(0, spp, PART)]
        parts = [self.samples(count, 1000 * seed + part) for part, count in enumerate(counts)]
        return [np.average(part, axis=0, weights=counts).astype(np.float32) for part in zip(*parts)]

    def reference(self, spp):
        """Returns the mean of many samples, and its variance."""
        parts = np.array([self.samples(PART, 10**6 + part)[0] for part in range(spp // PART)], dtype=float)
        return parts.mean(axis=0), parts.var(axis=0, ddof=1) / len(parts)


def compare(scene, program, budgets, seeds, reference_spp, folder):
    """Yields, for each budget, the error of each program with each seed and the longest command."""
    ours, theirs = Prpf(program, scene, folder), Mitsuba(SCENES[scene])
    (mean, variance), (their_mean, their_variance) = (each.reference(reference_spp) for each in (ours, theirs))
    reference = (mean + their_mean) / 2
    weight = 1 / (reference**2 + EPSILON)
    noise = np.mean((variance + their_variance) / 4 * weight)
    difference = np.mean(((mean - their_mean) ** 2 - variance - their_variance) / 4 * weight)
    print(f"{scene}: relMSE of the reference {noise:.2g}, of half the programs' difference {difference:.2g}", file=sys.stderr)

    def error(image):
        error = np.mean((image - reference) ** 2 * weight) - noise - max(difference, 0)
        return error if error > LEAST_ERROR * noise else np.nan

    for budget in budgets:
        errors, longest = [], 0
        for seed in range(1, seeds + 1):
            layers, seconds = ours.render("--time", f"{budget}s", "--seed", seed)
            longest = max(longest, seconds)
            errors.append((error(layers["RGB"]), min(map(error, theirs.render(budget, seed)))))
        yield budget, np.array(errors), longest


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("program", metavar="PRPF")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=", ".join(SCENES))
    parser.add_argument("--budgets", default="0.5,1,2,4,8,16")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--reference-spp", type=int, default=3072)
    arguments = parser.parse_args()
    budgets = [float(budget) for budget in arguments.budgets.split(",")]
    ratios = {budget: [] for budget in budgets}
    print("| scene | budget, s | relMSE | Mitsuba and OIDN | ratio | spread | longest command, s |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for scene in arguments.scenes or SCENES:
            settings = (budgets, arguments.seeds, arguments.reference_spp)
            for budget, errors, longest in compare(scene, arguments.program, *settings, Path(folder)):
                ours, theirs = np.exp(np.log(errors).mean(axis=0))
                logs = np.log(errors[:, 0] / errors[:, 1])
                ratios[budget].append(logs.mean())
                ratio, spread = np.exp(logs.mean()), np.exp(logs.std(ddof=1) if len(logs) > 1 else 0)
                row = f"{ours:.3g} | {theirs:.3g} | {ratio:.2f} | {spread:.2f} | {longest:.2f}"
                print(f"| {scene} | {budget:g} | {row} |", flush=True)
    for budget, logs in ratios.items():
        print(f"| geometric mean | {budget:g} | | | {np.exp(np.nanmean(logs)):.2f} | | |")


if __name__ == "__main__":
    main()
