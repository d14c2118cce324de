#!/usr/bin/env python3
"""Compares our denoiser with Intel Open Image Denoise (OIDN) on the same samples.

Each pair is SCENE.exr:REFERENCE.exr. `prpf render` writes SCENE.exr: the filtered image in R, G, B, the unfiltered mean
in the layer Noisy, guides in Albedo and Ns. OIDN gets the unfiltered colour, albedo and normal, and its default
settings (RT filter, HDR, high quality, noisy guides). Prints a Markdown table; a ratio below 1 means that our image is
closer to the reference.

relMSE is the mean over pixels and channels of (x - r)^2 / (r^2 + 0.01), linear light, as in
`prpf compare`. Pixels that are NaN or infinite in one of the images are left out of all.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import OpenEXR
import pyoidn

RELMSE_EPSILON = 0.01


class InputError(Exception):
    """An image that cannot be used. Its message is one line."""


def read_exr(path):
    """Returns all channels of the first part as {name: float32 array of height x width}, and its header."""
    if not Path(path).is_file():
        raise InputError(f"{path}: the file does not exist")
    try:
        # Otherwise the library returns R, G, B as one array.
        part = OpenEXR.File(str(path), separate_channels=True).parts[0]
    except Exception as error:
        raise InputError(f"{path}: {error}") from error
    channels = {name: channel.pixels.astype(np.float32) for name, channel in part.channels.items()}
    return channels, part.header


def layer(path, channels, names):
    """Returns three channels as one array of height x width x 3."""
    missing = [name for name in names if name not in channels]
    if missing:
        raise InputError(f"{path}: channels {', '.join(missing)} are missing; the file has {', '.join(sorted(channels))}")
    return np.ascontiguousarray(np.stack([channels[name] for name in names], axis=-1))


def finite(image):
    """Replaces NaN and infinity, which OIDN would spread, by 0."""
    return np.nan_to_num(image, nan=0.0, posinf=0.0, neginf=0.0)


def relmse(image, reference, mask):
    image, reference = image[mask].astype(np.float64), reference[mask].astype(np.float64)
    return np.mean((image - reference) ** 2 / (reference**2 + RELMSE_EPSILON))


def denoise(colour, albedo, normal):
    """Returns OIDN's result and the elapsed seconds."""
    start = time.perf_counter()
    # Radiance is not negative, albedo is in [0, 1], normals are unit vectors.
    result = pyoidn.denoise(
        np.maximum(finite(colour), 0.0),
        albedo=np.clip(finite(albedo), 0.0, 1.0),
        normal=np.clip(finite(normal), -1.0, 1.0),
        hdr=True,
        clean_aux=False,
        quality="default",
    )
    return result, time.perf_counter() - start


def compare(scene_path, reference_path):
    """Returns the entries of one row of the table."""
    channels, header = read_exr(scene_path)
    ours = layer(scene_path, channels, ["R", "G", "B"])
    noisy = layer(scene_path, channels, ["Noisy.R", "Noisy.G", "Noisy.B"])
    albedo = layer(scene_path, channels, ["Albedo.R", "Albedo.G", "Albedo.B"])
    normal = layer(scene_path, channels, ["Ns.X", "Ns.Y", "Ns.Z"])
    reference = layer(reference_path, read_exr(reference_path)[0], ["R", "G", "B"])
    if ours.shape != reference.shape:
        sizes = [f"{image.shape[1]}x{image.shape[0]}" for image in (ours, reference)]
        raise InputError(f"{scene_path} is {sizes[0]}, {reference_path} is {sizes[1]}")

    oidn, seconds = denoise(noisy, albedo, normal)
    mask = np.logical_and.reduce([np.isfinite(image).all(axis=-1) for image in (ours, noisy, oidn, reference)])
    if not mask.any():
        raise InputError(f"{scene_path}: no pixel is finite in all images")
    errors = {name: relmse(image, reference, mask) for name, image in [("noisy", noisy), ("ours", ours), ("oidn", oidn)]}
    left_out = int(mask.size - mask.sum())
    return Path(scene_path).stem, header.get("samplesPerPixel", "?"), errors, seconds, left_out


def row(scene, spp, errors, seconds, _):
    ratio = errors["ours"] / errors["oidn"] if errors["oidn"] > 0 else float("inf")
    numbers = f"{errors['noisy']:.5f} | {errors['ours']:.5f} | {errors['oidn']:.5f} | {ratio:.2f} | {seconds:.2f}"
    return f"| {scene} | {spp} | {numbers} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("pairs", nargs="+", metavar="SCENE.exr:REFERENCE.exr")
    pairs = [pair.rpartition(":") for pair in parser.parse_args().pairs]

    # The first call builds OIDN's network, which is no part of the denoising time.
    blank = np.zeros((64, 64, 3), np.float32)
    denoise(blank, blank, blank)

    print("| scene | spp | relMSE noisy | ours | OIDN | ours / OIDN | OIDN seconds |")
    print("|---|---|---|---|---|---|---|")
    failed = False
    for scene_path, colon, reference_path in pairs:
        try:
            if not colon:
                raise InputError(f"{reference_path}: SCENE.exr:REFERENCE.exr expected")
            result = compare(scene_path, reference_path)
        except InputError as error:
            print(f"compare_oidn: {error}", file=sys.stderr)
            failed = True
            continue
        print(row(*result), flush=True)
        if result[-1]:
            print(f"compare_oidn: {scene_path}: {result[-1]} pixels are not finite, left out", file=sys.stderr)
    return 2 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
