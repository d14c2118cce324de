"""Trains the learned filter.

    python training/train.py FOLDER WEIGHTS.npz --steps 20000

FOLDER is that of `make_data.py`. Every eighth scene is held out; on them the error relative to that of `nlm` is printed
(geometric mean over renders, by samples per pixel). Goes on from WEIGHTS.npz if it exists.
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

import model
from data import Views

EPSILON = 0.01
CROP = 96


def relative_error(image, reference):
    """Squared error over squared brightness, which is smoothed so that noise of the reference weighs little."""
    smooth = reference
    for axis in (1, 2):
        smooth = (jnp.roll(smooth, 1, axis) + smooth + jnp.roll(smooth, -1, axis)) / 3
    return (image - reference) ** 2 / (smooth**2 + EPSILON)


def loss(parameters, batch):
    inputs, colour, albedo, emission, nlm, reference, _ = batch
    image = model.denoise(parameters, inputs, colour, albedo, emission)

    def robust(candidate):
        error = relative_error(candidate, reference)
        return jnp.mean(error / (1 + error), (1, 2, 3))

    # So that every render counts alike
    ratio = jnp.log(robust(image) + 1e-5) - jnp.log(robust(nlm) + 1e-5)
    brightness = jnp.log(jnp.mean(image, (1, 2, 3)) + 0.01) - jnp.log(jnp.mean(reference, (1, 2, 3)) + 0.01)
    return jnp.mean(ratio) + 2 * jnp.mean(brightness**2)


def augment(draw, planes):
    """A crop, mirrored and turned, with permuted colours and axes, and another exposure."""
    h, w = planes[0].shape[:2]
    y, x = draw.integers(h - CROP + 1), draw.integers(w - CROP + 1)
    planes = [p[y : y + CROP, x : x + CROP].astype(np.float32) for p in planes]
    if draw.random() < 0.5:
        planes = [p[:, ::-1] for p in planes]
    turns = draw.integers(4)
    planes = [np.rot90(p, turns) for p in planes]
    colours, axes = draw.permutation(3), draw.permutation(3)
    signs = draw.choice([-1.0, 1.0], 3).astype(np.float32)
    inputs = planes[0].copy()
    inputs[..., 0:3] = inputs[..., 0:3][..., colours]
    inputs[..., 6:9] = inputs[..., 6:9][..., colours]
    for start in (10, 14):
        inputs[..., start : start + 3] = inputs[..., start : start + 3][..., axes] * signs
    return [inputs, *(p[..., colours] for p in planes[1:])]


@partial(jax.jit, static_argnums=0)
def step(optimiser, parameters, averaged, state, batch):
    value, gradient = jax.value_and_grad(loss)(parameters, batch)
    updates, state = optimiser.update(gradient, state, parameters)
    parameters = optax.apply_updates(parameters, updates)
    averaged = jax.tree.map(lambda a, p: a + 0.002 * (p - a), averaged, parameters)
    return parameters, averaged, state, value


def evaluate(parameters, views):
    """Prints the ratio of errors to `nlm`, the references' own noise taken off, by samples per pixel."""
    ratios = defaultdict(list)
    denoise = jax.jit(model.denoise)
    for _, spp, _, planes in views.entries:
        inputs, colour, albedo, emission, nlm, reference, noise = (p.astype(np.float32)[None] for p in planes)
        image = np.asarray(denoise(parameters, inputs, colour, albedo, emission))
        weight = 1 / (reference**2 + EPSILON)

        def error(candidate):
            errors = np.mean((candidate - reference) ** 2 * weight, -1).ravel()
            worst = np.argsort(errors)[-errors.size // 1000 :]
            kept = np.ones(errors.size, bool)
            kept[worst] = False
            return max(errors[kept].mean() - np.mean(noise * weight, -1).ravel()[kept].mean(), 1e-7)

        ratios[spp].append((np.log(error(image) / error(nlm)), np.log(image.mean() / reference.mean())))
    line = []
    for spp in sorted(ratios):
        ratio, brightness = np.mean(ratios[spp], 0)
        line.append(f"{spp}: {np.exp(ratio):.2f} ({np.exp(brightness):.3f})")
    every = np.concatenate([np.array(r) for r in ratios.values()])
    print(f"over nlm (brightness) {np.exp(every[:, 0].mean()):.3f} | " + ", ".join(line), flush=True)


def save(path, parameters):
    arrays = {f"{name}/{part}": np.asarray(x) for name, pair in parameters.items() for part, x in zip("wb", pair)}
    np.savez(path.with_suffix(".part.npz"), **arrays)
    path.with_suffix(".part.npz").rename(path)


def load(path):
    with np.load(path) as loaded:
        return {name: (loaded[f"{name}/w"], loaded[f"{name}/b"]) for name, *_ in model.LAYERS}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--steps", type=int, default=20000)
    parser.add_argument("--batch", type=int, default=8)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--scenes", type=int, help="train on this many scenes only")
    arguments = parser.parse_args()

    limit = arguments.scenes or 10**9
    training = Views(arguments.folder, lambda n: n % 8 and n - n // 8 <= limit)
    held_out = Views(arguments.folder, lambda n: n % 8 == 0)
    print(len(training.entries), "renders to train on,", len(held_out.entries), "held out", flush=True)
    parameters = load(arguments.weights) if arguments.weights.exists() else model.initial(arguments.seed)
    parameters = jax.tree.map(jnp.asarray, parameters)
    averaged = parameters
    schedule = optax.warmup_cosine_decay_schedule(0, arguments.rate, 100, arguments.steps, 0.01 * arguments.rate)
    optimiser = optax.chain(optax.clip_by_global_norm(1.0), optax.adamw(schedule, weight_decay=1e-4))
    state = optimiser.init(parameters)
    draw = np.random.default_rng(arguments.seed)
    started, losses = time.monotonic(), []
    for k in range(1, arguments.steps + 1):
        chosen = draw.integers(len(training.entries), size=arguments.batch)
        crops = [augment(draw, training.entries[i][3]) for i in chosen]
        batch = [np.stack(planes) for planes in zip(*crops)]
        parameters, averaged, state, value = step(optimiser, parameters, averaged, state, batch)
        losses.append(float(value))
        if k % 250 == 0 or k == arguments.steps:
            print(f"{k} {time.monotonic() - started:.0f} s, loss {np.mean(losses[-250:]):.3f}", flush=True)
        if k % 1000 == 0 or k == arguments.steps:
            save(arguments.weights, averaged)
            evaluate(averaged, held_out)


if __name__ == "__main__":
    main()
