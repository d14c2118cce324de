"""Trains the learned filter.

    python training/train.py FOLDER WEIGHTS.npz --steps 20000

FOLDER is that of `make_data.py`, which may go on making scenes. Every eighth scene is held out; on them the error relative to
that of `nlm` is printed (geometric mean over renders, by samples per pixel). Starts from the weights of WEIGHTS.npz if it exists,
else from those of `--start` if it is given, else from random ones.
"""

import argparse
import sys
import time
from collections import defaultdict, namedtuple
from concurrent.futures import ThreadPoolExecutor
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

# A training example, or a batch of them: statistics, reference, and the variance of the reference's mean.
Example = namedtuple("Example", ["statistics", "reference", "noise"])

# Number of new scenes that are added at once.
BLOCK = 16
# Steps over which the rate rises at the start.
WARMUP = 100

# Part of the loss that is the predicted kernels' own. Without it the mix chose `nlm` or what is not
# filtered in the first steps, and the kernels never learnt.
OF_KERNELS = 0.5
# A pixel's relative squared error is bounded by this.
LIMIT = 3
# Least fraction of an error that stays when the reference's noise is subtracted.
LEAST_ERROR = 0.25


def loss(parameters, batch):
    # Smoothed, so that noise of the reference weighs little
    padded = jnp.pad(batch.reference, ((0, 0), (0, 0), (1, 1), (1, 1)), "edge")
    rows = padded[:, :, :-2] + padded[:, :, 1:-1] + padded[:, :, 2:]
    smooth = (rows[..., :-2] + rows[..., 1:-1] + rows[..., 2:]) / 9
    weight = 1 / (smooth**2 + EPSILON)

    def robust(squares):
        error = weight * squares
        return jnp.mean(error / (1 + error / LIMIT), (1, 2, 3))

    reference_noise = robust(batch.noise)

    def image_loss(image):
        error = robust((image - batch.reference) ** 2)
        # Subtract the noise of the reference, approximately; the logarithm weighs all renders alike
        size = jnp.log(jnp.maximum(error - reference_noise, LEAST_ERROR * error) + 1e-4)
        brightness = jnp.log(jnp.mean(image, (1, 2, 3)) + 0.01) - jnp.log(jnp.mean(batch.reference, (1, 2, 3)) + 0.01)
        return jnp.mean(size) + 2 * jnp.mean(brightness**2)

    image, kernels_image = model.denoise(parameters, batch.statistics)
    of_mix, of_kernels = image_loss(image), image_loss(kernels_image)
    return (1 - OF_KERNELS) * of_mix + OF_KERNELS * of_kernels, jnp.stack([of_mix, of_kernels])


def augment(key, example):
    """A crop, mirrored and turned, with permuted colours and axes, another exposure, with or without nlm's image."""
    keys = iter(jax.random.split(key, 9))
    h, w = example.reference.shape[1:]
    y, x = (jax.random.randint(next(keys), (), 0, side - CROP + 1) for side in (h, w))
    is_mirrored = jax.random.bernoulli(next(keys))
    turns = jax.random.randint(next(keys), (), 0, 4)
    exposure = jnp.exp(jax.random.uniform(next(keys), minval=-1, maxval=1))
    colours, axes = (jax.random.permutation(next(keys), 3) for _ in range(2))
    signs = jax.random.rademacher(next(keys), (3, 1, 1), jnp.float32)
    with_nlm = jax.random.bernoulli(next(keys), 0.6)

    def moved(name, plane):
        plane = jax.lax.dynamic_slice(plane, (0, y, x), (plane.shape[0], CROP, CROP)).astype(jnp.float32)
        plane = jnp.where(is_mirrored, plane[:, :, ::-1], plane)
        plane = jax.lax.switch(turns, [partial(jnp.rot90, k=k, axes=(1, 2)) for k in range(4)], plane)
        if name in ("colour", "emission", "nlm", "reference", "deviation", "difference"):
            plane = plane * exposure
        if name == "noise":
            plane = plane * exposure**2
        if name in ("normal", "second_normal"):
            return plane[axes] * signs
        return plane[colours] if plane.shape[0] == 3 else plane

    planes = {name: moved(name, plane) for name, plane in example.statistics._asdict().items()}
    planes["has_nlm"] *= with_nlm
    statistics = model.Statistics(**planes)
    return Example(statistics, moved("reference", example.reference), moved("noise", example.noise))


@partial(jax.jit, static_argnums=3)
def draw_batch(key, examples, count, size):
    """Draws crops of the first `count` examples."""
    which, how = jax.random.split(key)
    chosen = jax.random.randint(which, (size,), 0, count)
    return jax.vmap(augment)(jax.random.split(how, size), jax.tree.map(lambda planes: planes[chosen], examples))


@partial(jax.jit, donate_argnums=0)
def put(examples, new, start):
    """Writes new examples over those from `start` on."""
    return jax.tree.map(lambda x, y: jax.lax.dynamic_update_slice(x, y, (start, *[0] * (x.ndim - 1))), examples, new)


def rate_at(progress, k):
    """The factor of the rate in step k: rises, then falls along a cosine."""
    return min(1, k / WARMUP) * (0.01 + 0.99 * (1 + np.cos(np.pi * progress)) / 2)


@partial(jax.jit, static_argnums=0)
def step(optimiser, rate, parameters, averaged, state, batch):
    (_, values), gradient = jax.value_and_grad(loss, has_aux=True)(parameters, batch)
    updates, state = optimiser.update(gradient, state, parameters)
    parameters = jax.tree.map(lambda p, u: p - rate * u, parameters, updates)
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
            other = statistics.colour + statistics.emission if view.is_converged else statistics.nlm
            weight = 1 / (reference**2 + EPSILON)

            def error(image):
                errors = np.mean((image - reference) ** 2 * weight, 0).ravel()
                kept = np.argsort(errors)[: -errors.size // 1000]
                return max(errors[kept].mean() - np.mean(noise * weight, 0).ravel()[kept].mean(), 1e-7)

            ratio = np.log(error(image) / error(other[0]))
            ratios["converged" if view.is_converged else view.spp].append((ratio, np.log(image.mean() / reference.mean())))
        line = []
        for spp in sorted(ratios, key=lambda spp: (isinstance(spp, str), spp)):
            ratio, brightness = np.mean(ratios[spp], 0)
            line.append(f"{spp}: {np.exp(ratio):.2f} ({np.exp(brightness):.3f})")
        every = np.concatenate([np.array(r) for spp, r in ratios.items() if spp != "converged"])
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
    """The views of a folder's scenes. Those to train on are kept on the device."""

    def __init__(self, folder, limit):
        self.folder, self.limit = folder, limit
        self.seen, self.examples, self.count, self.held_out = set(), None, 0, []
        # Reads while the training goes on
        self.reader = ThreadPoolExecutor(1)
        self.take(self.read(1))
        self.coming = self.reader.submit(self.read, BLOCK)

    def read(self, least):
        """New views to train on, and to hold out; none if fewer scenes than `least` are new."""
        new = sorted(set(self.folder.glob("[0-9]*.npz")) - self.seen)
        if len(new) < least:
            return [], []
        self.seen |= set(new)
        held_out = [path for path in new if int(path.stem) % 8 == 0]
        training = [path for path in new if int(path.stem) % 8 and (not self.limit or int(path.stem) < self.limit)]
        return read_views(training), read_views(held_out)

    def take(self, views):
        training, held_out = views
        self.held_out += held_out
        if training:
            examples = [Example(view.statistics, view.reference, view.noise) for view in training]
            new = jax.tree.map(lambda *planes: np.stack(planes), *examples)
            if not self.count:
                self.examples = jax.tree.map(jnp.zeros_like, new)
            # When the memory is full, it is doubled, and `draw_batch` compiled anew
            while len(self.examples.noise) < self.count + len(training):
                self.examples = jax.tree.map(lambda x: jnp.concatenate([x, jnp.zeros_like(x)]), self.examples)
            self.examples = put(self.examples, new, self.count)
            self.count += len(training)

    def refresh(self):
        """Takes in the scenes that have been made meanwhile, if they have been read."""
        if self.coming.done():
            self.take(self.coming.result())
            self.coming = self.reader.submit(self.read, BLOCK)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--steps", type=int, help="20000 if there is no --minutes")
    minutes_help = "ends after this time, and the rate falls accordingly; the weights then depend on the machine's speed"
    parser.add_argument("--minutes", type=float, default=np.inf, help=minutes_help)
    parser.add_argument("--start", type=Path, help="exported weights to start from")
    parser.add_argument("--batch", type=int, default=6)
    parser.add_argument("--rate", type=float, default=5e-4)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scenes", type=int, help="train only on scenes whose number is below this")
    parser.add_argument("--every", type=int, default=500, help="steps between evaluations")
    arguments = parser.parse_args()

    scenes = Scenes(arguments.folder, arguments.scenes)
    if scenes.examples is None:
        sys.exit(f"{arguments.folder}: found no scene to train on; make_data.py makes some")
    if arguments.weights.exists():
        parameters = load(arguments.weights)
    elif arguments.start:
        parameters = load_exported(arguments.start)
    else:
        parameters = model.initial(arguments.seed)
    parameters = jax.tree.map(jnp.asarray, parameters)
    averaged = parameters
    optimiser = optax.chain(optax.clip_by_global_norm(1.0), optax.scale_by_adam(), optax.add_decayed_weights(1e-4))
    state = optimiser.init(parameters)
    key = jax.random.key(arguments.seed)
    started, losses = time.monotonic(), []
    steps = arguments.steps or (20000 if np.isinf(arguments.minutes) else np.inf)
    k, progress = 0, 0.0
    while progress < 1:
        k += 1
        progress = max(k / steps, (time.monotonic() - started) / (60 * arguments.minutes))
        batch = draw_batch(jax.random.fold_in(key, k), scenes.examples, scenes.count, arguments.batch)
        rate = arguments.rate * rate_at(min(progress, 1), k)
        parameters, averaged, state, values = step(optimiser, rate, parameters, averaged, state, batch)
        losses.append(values)
        if k % 50 == 0 or progress >= 1:
            of_mix, of_kernels = np.mean(losses, 0)
            waited = time.monotonic() - started
            loss_line = f"loss of the mix {of_mix:.3f}, of the kernels {of_kernels:.3f}"
            print(f"{k} {waited:.0f} s, {scenes.count} renders, {loss_line}", flush=True)
            losses = []
            scenes.refresh()
        if k % arguments.every == 0 or progress >= 1:
            if not all(jnp.isfinite(x).all() for x in jax.tree.leaves(averaged)):
                sys.exit(f"weights that are not finite after {k} steps; {arguments.weights} has those before, if any")
            save(arguments.weights, averaged)
            if scenes.held_out:
                evaluate(averaged, scenes.held_out)


if __name__ == "__main__":
    main()
