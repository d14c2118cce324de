"""Writes trained weights as the program embeds them, and what its test compares with.

    python training/export.py WEIGHTS.npz src/filter/learned

Writes `weights.safetensors` (half precision) and `parity.safetensors`: statistics of a small image of random values, and the
image that `model.py` makes of them with these weights.
"""

import argparse
from pathlib import Path

import jax
import numpy as np
from safetensors.numpy import save_file

import model
from train import load

# As precise as the program, on a GPU too
jax.config.update("jax_default_matmul_precision", "highest")

SIZE = (16, 32)
# Increased when the network changes; the program has the same.
FORMAT = "prpf learned 2"


def random_statistics(seed):
    """Statistics of every kind of value, with smooth parts so that the kernels are wide somewhere."""
    draw = np.random.default_rng(seed)
    planes = {}
    for name, channels in model.STATISTICS.items():
        low = -1 if name in ("difference", "normal", "second_normal") else 0
        values = draw.uniform(low, 1, (1, channels, *SIZE))
        values[..., : SIZE[1] // 2] = values[..., :1, :1]
        planes[name] = values.astype(np.float32)
    planes["count"] = np.round(1 + 8 * planes["count"])
    planes["has_nlm"] = np.ones_like(planes["has_nlm"])
    return model.Statistics(**planes)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("weights", type=Path)
    parser.add_argument("folder", type=Path)
    arguments = parser.parse_args()
    rounded = jax.tree.map(lambda x: np.asarray(x).astype(np.float16), load(arguments.weights))
    tensors = {f"{name}.{part}": x for name, pair in rounded.items() for part, x in zip(["weight", "bias"], pair)}
    save_file(tensors, arguments.folder / "weights.safetensors", {"format": FORMAT})

    parameters = jax.tree.map(lambda x: x.astype(np.float32), rounded)
    statistics = random_statistics(1)
    compared = {name: plane[0] for name, plane in statistics._asdict().items() if name != "has_nlm"}
    compared["mixed"] = np.asarray(model.denoise(parameters, statistics)[0])[0]
    save_file(compared, arguments.folder / "parity.safetensors")


if __name__ == "__main__":
    main()
