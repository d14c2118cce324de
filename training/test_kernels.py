"""Compares `kernels.py` with the filter's definition in array operations: `python training/test_kernels.py`."""

import jax
import jax.numpy as jnp
import numpy as np

from kernels import filter_images

FEATURES = 6
DILATIONS = (1, 4, 32, 2)


def shifted(x, dy, dx):
    """x at the neighbour (y + dy, x + dx); the nearest pixel's beyond the border."""
    h, w = x.shape[2:]
    padded = jnp.pad(x, ((0, 0), (0, 0), (abs(dy),) * 2, (abs(dx),) * 2), mode="edge")
    return padded[:, :, abs(dy) + dy : abs(dy) + dy + h, abs(dx) + dx : abs(dx) + dx + w]


def plain_filter(predicted, hit, values):
    for level, dilation in enumerate(DILATIONS):
        start = level * (FEATURES + 2)
        features = predicted[:, start : start + FEATURES]
        neighbour, own = (jnp.clip(predicted[:, start + FEATURES + k][:, None], -20, 20) for k in (0, 1))
        total, norm = jnp.exp(own) * values, jnp.exp(own)
        for dy, dx in ((dy, dx) for dy in (-1, 0, 1) for dx in (-1, 0, 1) if (dy, dx) != (0, 0)):
            moved = (shifted(x, dy * dilation, dx * dilation) for x in (features, neighbour, hit, values))
            of, on, oh, ov = moved
            apart = jnp.where(jnp.abs(oh - hit) > 0.99, 100.0, 0.0)
            weight = jnp.exp(on - apart - jnp.sum((of - features) ** 2, 1, keepdims=True))
            total, norm = total + weight * ov, norm + weight
        values = total / norm
    return values


def main():
    draw = np.random.default_rng(1)

    def normal(planes):
        return jnp.asarray(draw.normal(size=(3, planes, 48, 40)).astype(np.float32))

    predicted, values, of_filtered = normal((FEATURES + 2) * len(DILATIONS)), normal(5), normal(5)
    hit = jnp.asarray((draw.random((3, 1, 48, 40)) > 0.3).astype(np.float32))
    results = []
    for filtered_by in (plain_filter, lambda *of: filter_images(FEATURES, DILATIONS, *of)):
        filtered, differentiate = jax.vjp(lambda p: filtered_by(p, hit, values), predicted)
        results.append([filtered, *differentiate(of_filtered)])
    for name, plain, fast in zip(["image", "gradient"], *results):
        difference = float(jnp.abs(plain - fast).max())
        print(f"{name}: differs by {difference:.1e} of up to {float(jnp.abs(plain).max()):.1e}")
        assert difference < 1e-5 * float(jnp.abs(plain).max())


if __name__ == "__main__":
    main()
