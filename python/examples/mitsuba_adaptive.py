"""Adaptive sampling and denoising of Mitsuba 3's samples.

    pip install mitsuba pyoidn
    python mitsuba_adaptive.py [IMAGE.png]

Mitsuba renders one sample per pixel at a time, of the whole image or of tiles (crops of its film), with albedo and
normals. The samples go to a store of `prpf`; its filter and its allocation decide how many samples each tile gets next.
Prints the relMSE of Mitsuba's own mean of uniform samples, of what Intel Open Image Denoise and `prpf` make of it, and of the
image of adaptive samples that `prpf` has denoised, all of the same number of samples.
"""

import sys

import mitsuba as mi
import numpy as np
import pyoidn

import prpf

mi.set_variant("scalar_rgb")

SIDE, TILE = 128, 8
SPP, BATCH, REFERENCE_SPP = 16, 4, 1024
SEEDS = 3
IMAGES = ["mean", "by OIDN", "denoised", "adaptive and denoised"]
NAMES = ["R", "G", "B", "albedo.r", "albedo.g", "albedo.b", "N1.x", "N1.y", "N1.z"]


def make_scene():
    """Returns Mitsuba's Cornell box with features."""
    scene = mi.cornell_box()
    # A box filter: each sample belongs to one pixel, with weight 1.
    scene["sensor"]["film"] |= {"width": SIDE, "height": SIDE, "rfilter": {"type": "box"}}
    scene["integrator"] = {
        "type": "aov",
        "aovs": "albedo:albedo,normal:sh_normal",
        "image": {"type": "path", "max_depth": 6},
    }
    return mi.load_dict(scene)


def make_tiles():
    """Returns for each tile its corner and a sensor that sees it alone."""
    tiles = []
    for y in range(0, SIDE, TILE):
        for x in range(0, SIDE, TILE):
            sensor = mi.cornell_box()["sensor"]
            sensor["film"] |= {"width": SIDE, "height": SIDE, "rfilter": {"type": "box"}}
            sensor["film"] |= {"crop_offset_x": x, "crop_offset_y": y, "crop_width": TILE, "crop_height": TILE}
            tiles.append(((x, y), mi.load_dict(sensor)))
    return tiles


class Sampler:
    """Renders samples of Mitsuba into stores, each with a seed of its own."""

    def __init__(self, seed):
        self.scene, self.tiles = make_scene(), make_tiles()
        self.seed = seed * 1_000_000

    def one(self, sensor=0):
        """Returns one sample of each pixel: (height, width, 9)."""
        self.seed += 1
        return np.array(mi.render(self.scene, sensor=sensor, spp=1, seed=self.seed))[..., : len(NAMES)]

    def uniform(self, store, spp):
        for _ in range(spp):
            store.push(self.one())

    def adaptive(self, store, batches):
        """Adds batches of BATCH samples per pixel on average, where the maps of the filtered image ask for them."""
        for _ in range(batches):
            counts = prpf.allocate(store, prpf.denoise(store, "nlm draft"), BATCH * SIDE * SIDE)
            wanted = counts.reshape(SIDE // TILE, TILE, SIDE // TILE, TILE).mean((1, 3)).ravel()
            # Whole samples per tile: the rounding errors are passed on, so that the batch has its size
            ends = np.rint(np.cumsum(wanted)).astype(int)
            for ((x, y), sensor), count in zip(self.tiles, np.diff(ends, prepend=0)):
                for _ in range(count):
                    store.push(self.one(sensor), x=x, y=y)


def denoise_by_oidn(store):
    """Returns what Open Image Denoise makes of a store's means."""
    means = dict(zip(store.dimensions, np.moveaxis(store.mean(), -1, 0)))
    colour, albedo, normal = (
        np.ascontiguousarray(np.stack([means[name] for name in NAMES[i : i + 3]], -1), np.float32) for i in (0, 3, 6)
    )
    guides = {"albedo": np.clip(albedo, 0.0, 1.0), "normal": np.clip(normal, -1.0, 1.0)}
    return pyoidn.denoise(colour, hdr=True, quality="high", **guides)


def describe(errors):
    return ", ".join(f"{name} {error:.5f}" for name, error in zip(IMAGES, errors))


def main():
    scene = make_scene()
    reference = np.array(mi.render(scene, spp=REFERENCE_SPP, seed=12345))[..., :3]
    errors = []
    for seed in range(1, SEEDS + 1):
        sampler = Sampler(seed)
        uniform, adaptive = prpf.Store(SIDE, SIDE, NAMES), prpf.Store(SIDE, SIDE, NAMES)
        sampler.uniform(uniform, SPP)
        sampler.uniform(adaptive, BATCH)
        sampler.adaptive(adaptive, SPP // BATCH - 1)
        assert adaptive.samples + adaptive.rejected == SPP * SIDE * SIDE
        images = [
            prpf.denoise(uniform, "none").image,
            denoise_by_oidn(uniform),
            prpf.denoise(uniform).image,
            prpf.denoise(adaptive).image,
        ]
        errors.append([prpf.compare(image, reference)["relmse"] for image in images])
        print(f"seed {seed}: {describe(errors[-1])}; counts {adaptive.counts().min()} to {adaptive.counts().max()}")
    print(f"relMSE at {SPP} samples per pixel: {describe(np.exp(np.log(errors).mean(0)))}")
    if len(sys.argv) > 1:
        prpf.write_image(sys.argv[1], np.concatenate([*images, reference], 1))


if __name__ == "__main__":
    main()
