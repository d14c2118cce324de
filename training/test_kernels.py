"""Compares the filter in C++ with its definition: `python training/test_kernels.py`."""

import jax
import jax.numpy as jnp
import numpy as np

from kernels import native_filter, plain_filter

jax.config.update("jax_platforms", "cpu")

FEATURES = 6
DILATIONS = (1, 4, 32, 2)


def main():
    draw = np.random.default_rng(1)

    def normal(planes):
        return jnp.asarray(draw.normal(size=(3, planes, 48, 40)).astype(np.float32))

    predicted, values, of_filtered = normal((FEATURES + 2) * len(DILATIONS)), normal(5), normal(5)
    hit = jnp.asarray((draw.random((3, 1, 48, 40)) > 0.3).astype(np.float32))
    results = []
    for filtered_by in (plain_filter, native_filter):
        filtered, differentiate = jax.vjp(lambda p: filtered_by(FEATURES, DILATIONS, p, hit, values), predicted)
        results.append([filtered, *differentiate(of_filtered)])
    for name, plain, fast in zip(["image", "gradient"], *results):
        difference = float(jnp.abs(plain - fast).max())
        print(f"{name}: differs by {difference:.1e} of up to {float(jnp.abs(plain).max()):.1e}")
        assert difference < 1e-5 * float(jnp.abs(plain).max())


if __name__ == "__main__":
    main()
