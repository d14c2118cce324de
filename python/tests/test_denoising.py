"""Denoisers and allocation."""

import numpy as np
import pytest
from conftest import FEATURES, made_up_samples

import prpf


def available(store):
    """The denoisers that this machine has."""
    for name in prpf.denoisers():
        try:
            yield name, prpf.denoise(store, name)
        except ValueError as error:
            assert name.startswith("oidn"), error


def test_every_denoiser_gives_an_image_and_its_maps(rendered):
    for name, result in available(rendered):
        assert result.made_by == name
        assert result.image.shape == result.variance.shape == result.risk.shape == (24, 40, 3)
        assert result.halves[0].shape == result.halves[1].shape == (24, 40, 3)
        assert result.error.shape == result.residual.shape == (24, 40)
        assert (result.image >= 0).all() and np.isfinite(result.image).all()
        assert (result.interpolation_failure is not None) == name.startswith("prpf"), name
        assert result.estimate.low <= result.estimate.relmse <= result.estimate.high
        assert result.estimate.tiles.shape == (2, 3)
    assert np.allclose(prpf.denoise(rendered, "none").image, rendered.mean("radiance"), atol=1e-6)


def test_samples_of_another_renderer_are_denoised():
    samples, truth = made_up_samples(32, 48, 8)
    store = prpf.Store(48, 32, FEATURES)
    store.push(samples)
    before = prpf.compare(store.mean("RGB"), truth)["relmse"]
    after = prpf.compare(prpf.denoise(store).image, truth)["relmse"]
    assert after < 0.2 * before, (before, after)


def test_what_a_denoiser_lacks_is_an_exception(scene):
    store = scene.store()
    with pytest.raises(ValueError, match="store: found no valid samples"):
        prpf.denoise(store)
    scene.render(store, 2)
    with pytest.raises(ValueError, match="found a reservoir of 0 .* prpf needs 8; accepted .* a reservoir of 8"):
        prpf.denoise(store, "prpf")
    with pytest.raises(ValueError, match="rpf needs 2"):
        prpf.denoise(store, "rpf")
    for name in ["nlm best", "median", ""]:
        with pytest.raises(ValueError, match=f"denoiser: found `{name}`; accepted are learned standard, learned draft"):
            prpf.denoise(store, name)


def test_tiny_and_sparse_stores_are_denoised():
    for width, height in [(1, 1), (1, 5), (5, 1)]:
        store = prpf.Store(width, height, ["R", "G", "B"], reservoir=8)
        store.push(np.ones((height, width, 4, 3)))
        for name, result in available(store):
            assert np.allclose(result.image, 1, atol=1e-3), name
    sparse = prpf.Store(5, 5, ["R", "G", "B"])
    sparse.push(np.ones((1, 2, 3)))
    result = prpf.denoise(sparse)
    assert result.made_by == "learned draft" and result.estimate is None


def test_allocation_follows_priorities_and_adds_up(rendered):
    result = prpf.denoise(rendered)
    counts = prpf.allocate(rendered, result, 5000)
    assert counts.shape == (24, 40) and counts.sum() == 5000
    assert np.array_equal(counts, prpf.allocate(rendered, prpf.priority(rendered, result), 5000))
    own = np.zeros((24, 40))
    own[:, :20] = 1
    counts = prpf.allocate(rendered, own, 5000)
    assert counts.sum() == 5000 and counts[:, :20].sum() > 0.8 * 5000
    assert (prpf.allocate(rendered, own, 10**6, max_spp=10) <= 2).all()
    assert (prpf.allocate(rendered, own, 40 * 24 * 4, min_spp=10) >= 2).all()


def test_weights_change_priorities(rendered):
    result = prpf.denoise(rendered)
    default = prpf.priority(rendered, result)
    assert default.shape == (24, 40) and np.isfinite(default).all()
    assert not np.allclose(default, prpf.priority(rendered, result, raw_variance=0))
    with pytest.raises(ValueError, match="residual: found -1; accepted is a finite weight"):
        prpf.priority(rendered, result, residual=-1)


@pytest.mark.parametrize(
    "priority, error, words",
    [
        (np.full((24, 40), np.nan), ValueError, "priority: found NaN"),
        (np.full((24, 40), np.inf), ValueError, "priority: found inf"),
        (np.full((24, 40), -1.0), ValueError, "priority: found -1"),
        (np.zeros((40, 24)), ValueError, r"shape \(40, 24\); accepted is a prpf.Denoised, or .* \(24, 40\)"),
        (np.zeros((0, 0)), ValueError, r"shape \(0, 0\)"),
        ("high", TypeError, "<U4"),
    ],
)
def test_wrong_priorities_are_exceptions(rendered, priority, error, words):
    with pytest.raises(error, match=words):
        prpf.allocate(rendered, priority, 100)


def test_results_of_other_sizes_and_limits_that_contradict_are_exceptions(rendered):
    other = prpf.Store(3, 3, ["R", "G", "B"])
    other.push(np.ones((3, 3, 4, 3)))
    with pytest.raises(ValueError):
        prpf.allocate(rendered, prpf.denoise(other), 100)
    with pytest.raises(ValueError, match="max_spp: found 2; accepted is a number from min_spp, 4"):
        prpf.allocate(rendered, np.ones((24, 40)), 100, min_spp=4, max_spp=2)
    with pytest.raises(ValueError, match="found -1; accepted is a whole number from 0 to 18446744073709551615"):
        prpf.allocate(rendered, np.ones((24, 40)), -1)
    with pytest.raises(TypeError, match="found 1.5; accepted is a whole number"):
        prpf.allocate(rendered, np.ones((24, 40)), 1.5)
    with pytest.raises(ValueError, match="found 4294967296; accepted is a whole number from 0 to 4294967295"):
        prpf.allocate(rendered, np.ones((24, 40)), 1, min_spp=2**32)
