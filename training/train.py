"""Trains the learned filter.

    python training/train.py FOLDER WEIGHTS.npz --steps 20000

FOLDER is that of `make_data.py`, which may go on making scenes. Every eighth scene is held out; on them the error relative to
that of `nlm` is printed (geometric mean over renders, by samples per pixel). Goes on from WEIGHTS.npz if it exists, else from
the program's weights if they are given.
"""

import argparse
import time
from collections import defaultdict
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import optax
from safetensors.numpy import load_file

import model
from data import read_views

EPSILON = 0.01
CROP = 112


def relative_error(image, reference):
    """Squared error over squared brightness, which is smoothed so that noise of the reference weighs little."""
    smooth = reference
    for axis in (2, 3):
        smooth = (jnp.roll(smooth, 1, axis) + smooth + jnp.roll(smooth, -1, axis)) / 3
    return (image - reference) ** 2 / (smooth**2 + EPSILON)


# Part of the loss that is the predicted kernels' own. Without it the mix chose `nlm` or what is not
# filtered in the first steps, and the kernels never learnt.
OF_KERNELS = 0.5


def loss(parameters, batch):
    statistics, reference = batch

    def of(image):
        error = relative_error(image, reference)
        # Robust, and its logarithm, so that every render counts alike
        size = jnp.log(jnp.mean(error / (1 + error), (1, 2, 3)) + 1e-4)
        brightness = jnp.log(jnp.mean(image, (1, 2, 3)) + 0.01) - jnp.log(jnp.mean(reference, (1, 2, 3)) + 0.01)
        return jnp.mean(size) + 2 * jnp.mean(brightness**2)

    image, kernels_image = model.denoise(parameters, statistics)
    of_mix, of_kernels = of(image), of(kernels_image)
    return (1 - OF_KERNELS) * of_mix + OF_KERNELS * of_kernels, jnp.stack([of_mix, of_kernels])


def augment(draw, view):
    """A crop, mirrored and turned, with permuted colours and axes, another exposure, with or without nlm's image."""
    h, w = view.reference.shape[1:]
    y, x = draw.integers(h - CROP + 1), draw.integers(w - CROP + 1)
    is_mirrored, turns, exposure = draw.random() < 0.5, draw.integers(4), np.exp(draw.uniform(-1, 1))
    colours, axes = draw.permutation(3), draw.permutation(3)
    signs = draw.choice([-1.0, 1.0], 3).astype(np.float32)[:, None, None]

    def moved(name, plane):
        plane = plane[:, y : y + CROP, x : x + CROP].astype(np.float32)
        plane = plane[:, :, ::-1] if is_mirrored else plane
        plane = np.rot90(plane, turns, (1, 2))
        if name in ("colour", "emission", "nlm", "reference", "deviation", "difference"):
            plane = plane * np.float32(exposure)
        if name in ("normal", "second_normal"):
            plane = plane[axes] * signs
        elif plane.shape[0] == 3:
            plane = plane[colours]
        return plane

    planes = {name: moved(name, plane) for name, plane in view.statistics._asdict().items()}
    if draw.random() < 0.4:
        planes["has_nlm"] = np.zeros_like(planes["has_nlm"])
    return model.Statistics(**planes), moved("reference", view.reference)


@partial(jax.jit, static_argnums=0)
def step(optimiser, parameters, averaged, state, batch):
    (_, values), gradient = jax.value_and_grad(loss, has_aux=True)(parameters, batch)
    updates, state = optimiser.update(gradient, state, parameters)
    parameters = optax.apply_updates(parameters, updates)
    averaged = jax.tree.map(lambda a, p: a + 0.002 * (p - a), averaged, parameters)
    return parameters, averaged, state, values


def evaluate(parameters, views):
    """Prints the ratio of errors to `nlm`, the references' own noise taken off, by samples per pixel: with nlm's image
    among the candidates, and without it; and the brightness over the reference's.
    """
    denoise = jax.jit(model.denoise)
    for has_nlm in (1, 0):
        ratios = defaultdict(list)
        for view in views:
            statistics = model.Statistics(*(x.astype(np.float32)[None] for x in view.statistics))
            candidate = statistics._replace(has_nlm=statistics.has_nlm * has_nlm)
            image = np.asarray(denoise(parameters, candidate)[0])[0]
            reference, noise = view.reference.astype(np.float32), view.noise.astype(np.float32)
            # Of the converged views there is no image of nlm; they are compared with what is not filtered
            other = statistics.nlm if statistics.has_nlm.any() else statistics.colour + statistics.emission
            weight = 1 / (reference**2 + EPSILON)

            def error(image):
                errors = np.mean((image - reference) ** 2 * weight, 0).ravel()
                kept = np.argsort(errors)[: -errors.size // 1000]
                return max(errors[kept].mean() - np.mean(noise * weight, 0).ravel()[kept].mean(), 1e-7)

            ratio = np.log(error(image) / error(other[0]))
            ratios[view.spp].append((ratio, np.log(image.mean() / reference.mean())))
        line = []
        for spp in sorted(ratios):
            ratio, brightness = np.mean(ratios[spp], 0)
            line.append(f"{spp}: {np.exp(ratio):.2f} ({np.exp(brightness):.3f})")
        every = np.concatenate([np.array(r) for spp, r in ratios.items() if spp <= 64])
        kind = "mixed" if has_nlm else "alone"
        print(f"{kind} over nlm (brightness) {np.exp(every[:, 0].mean()):.3f} | " + ", ".join(line), flush=True)


def save(path, parameters):
    arrays = {f"{name}/{part}": np.asarray(x) for name, pair in parameters.items() for part, x in zip("wb", pair)}
    np.savez(path.with_suffix(".part.npz"), **arrays)
    path.with_suffix(".part.npz").rename(path)


def load(path):
    with np.load(path) as loaded:
        return {name: (loaded[f"{name}/w"], loaded[f"{name}/b"]) for name, *_ in model.LAYERS}


def load_exported(path):
    """The weights of a file that `export.py` wrote."""
    loaded = load_file(path)
    parts = ("weight", "bias")
    return {name: tuple(loaded[f"{name}.{part}"].astype(np.float32) for part in parts) for name, *_ in model.LAYERS}


class Scenes:
    """The views of a folder's scenes."""

    def __init__(self, folder, limit):
        self.folder, self.limit = folder, limit
        self.seen, self.training, self.held_out = set(), [], []

    def refresh(self):
        """Reads the scenes that have been made since the last call."""
        found = {int(path.stem) for path in self.folder.glob("*.npz")}
        new = sorted(found - self.seen)
        self.seen |= found
        self.held_out += read_views(self.folder, lambda n: n in new and n % 8 == 0)
        taken = sorted(n for n in self.seen if n % 8)[: self.limit]
        self.training += read_views(self.folder, lambda n: n in new and n in taken)
        print(len(self.training), "renders to train on,", len(self.held_out), "held out", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--steps", type=int, default=20000)
    parser.add_argument("--start", type=Path, help="exported weights to start from")
    parser.add_argument("--batch", type=int, default=6)
    parser.add_argument("--rate", type=float, default=5e-4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scenes", type=int, help="train on this many scenes only")
    arguments = parser.parse_args()

    scenes = Scenes(arguments.folder, arguments.scenes)
    scenes.refresh()
    if arguments.weights.exists():
        parameters = load(arguments.weights)
    elif arguments.start:
        parameters = load_exported(arguments.start)
    else:
        parameters = model.initial(arguments.seed)
    parameters = jax.tree.map(jnp.asarray, parameters)
    averaged = parameters
    schedule = optax.warmup_cosine_decay_schedule(0, arguments.rate, 100, arguments.steps, 0.01 * arguments.rate)
    optimiser = optax.chain(optax.clip_by_global_norm(1.0), optax.adamw(schedule, weight_decay=1e-4))
    state = optimiser.init(parameters)
    draw = np.random.default_rng(arguments.seed)
    started, losses = time.monotonic(), []
    for k in range(1, arguments.steps + 1):
        chosen = draw.integers(len(scenes.training), size=arguments.batch)
        crops = [augment(draw, scenes.training[i]) for i in chosen]
        batch = jax.tree.map(lambda *planes: np.stack(planes), *crops)
        parameters, averaged, state, values = step(optimiser, parameters, averaged, state, batch)
        losses.append(np.asarray(values))
        if k % 50 == 0 or k == arguments.steps:
            of_mix, of_kernels = np.mean(losses[-250:], 0)
            waited = time.monotonic() - started
            print(f"{k} {waited:.0f} s, loss of the mix {of_mix:.3f}, of the kernels {of_kernels:.3f}", flush=True)
        if k % 500 == 0 or k == arguments.steps:
            save(arguments.weights, averaged)
            scenes.refresh()
            evaluate(averaged, scenes.held_out)


if __name__ == "__main__":
    main()
