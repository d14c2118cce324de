"""Adaptive sampling and denoising of Mitsuba 3's samples.

    pip install mitsuba
    python mitsuba_adaptive.py [IMAGE.png]

Mitsuba renders one sample per pixel at a time, of the whole image or of tiles (crops of its film), with albedo and
normals. The samples go to a store of `prpf`; its filter and its allocation decide how many samples each tile gets next.
Prints the relMSE of Mitsuba's own mean, of the denoised image of uniform samples, and of the denoised image of adaptive
samples, all of the same number of samples.
"""

import sys

import mitsuba as mi
import numpy as np

import prpf

mi.set_variant("scalar_rgb")

SIDE, TILE = 96, 8
SPP, BATCH, REFERENCE_SPP = 16, 4, 1024
SEEDS = 3
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
        results = [prpf.denoise(uniform, "none"), prpf.denoise(uniform), prpf.denoise(adaptive)]
        errors.append([prpf.compare(result.image, reference)["relmse"] for result in results])
        print(f"seed {seed}: mean {errors[-1][0]:.5f}, denoised {errors[-1][1]:.5f}, "
              f"adaptive and denoised {errors[-1][2]:.5f}; counts {adaptive.counts().min()} to {adaptive.counts().max()}")
    mean, denoised, both = np.exp(np.log(errors).mean(0))
    print(f"relMSE at {SPP} samples per pixel: mean {mean:.5f}, denoised {denoised:.5f}, adaptive and denoised {both:.5f}")
    if len(sys.argv) > 1:
        images = [result.image for result in results] + [reference]
        prpf.write_image(sys.argv[1], np.concatenate(images, 1))


if __name__ == "__main__":
    main()
