"""Statistics: samples of other renderers against numpy's own moments."""

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from conftest import FEATURES, made_up_samples

import prpf


def test_statistics_are_those_of_numpy():
    samples, _ = made_up_samples(9, 37, 6)
    store = prpf.Store(37, 9, FEATURES)
    store.push(samples)
    assert (store.counts() == 6).all() and (store.counts(0) == 3).all()
    assert (store.samples, store.rejected, store.spp) == (9 * 37 * 6, 0, 6)
    rgb = samples[..., :3].astype(np.float64)
    assert np.allclose(store.mean("RGB"), rgb.mean(2), rtol=1e-6)
    assert np.allclose(store.variance("RGB"), rgb.var(2, ddof=1), rtol=1e-5)
    assert np.allclose(store.deviation("RGB"), rgb.std(2, ddof=1), rtol=1e-5)
    assert np.allclose(store.mean("RGB", half=1), rgb[:, :, 1::2].mean(2), rtol=1e-6)
    assert np.array_equal(store.mean(["albedo", "N1.z"])[0, 0], np.float32([0.2, 0.2, 0.2, 1]))
    assert np.allclose(store.mean("film")[3, 5], [5.5, 3.5])
    assert store.mean().shape == (9, 37, len(store.dimensions))
    assert store.mean().dtype == np.float32 and store.counts().dtype == np.uint32


def test_blocks_of_any_size_and_order_add_up():
    samples, _ = made_up_samples(10, 20, 4)
    whole, in_parts = prpf.Store(20, 10, FEATURES), prpf.Store(20, 10, FEATURES[::-1])
    whole.push(samples)
    backwards = samples[..., ::-1]
    for y, x in [(0, 0), (0, 13), (7, 0), (7, 13)]:
        height, width = (7 if y == 0 else 3), (13 if x == 0 else 7)
        block = backwards[y : y + height, x : x + width]
        in_parts.push(block[:, :, 0], x=x, y=y)
        in_parts.push(block[:, :, 1:].astype(np.float64), x=x, y=y)
    assert np.array_equal(whole.mean(), in_parts.mean())
    y, x = np.mgrid[:10, :20]
    singly = prpf.Store(20, 10, FEATURES)
    for index in range(4):
        singly.push_pixels(np.stack([x, y], -1).reshape(-1, 2), samples[:, :, index].reshape(200, -1))
    assert np.array_equal(whole.variance(), singly.variance())


def test_samples_that_are_no_numbers_are_rejected_and_counted():
    store = prpf.Store(4, 1, ["R", "G", "B"])
    samples = np.ones((1, 4, 3), np.float32)
    samples[0, :3, 0] = [np.nan, np.inf, -1]
    store.push(samples)
    assert (store.samples, store.rejected) == (1, 3)
    assert np.array_equal(store.counts(), [[0, 0, 0, 1]])
    assert np.isfinite(store.mean()).all()


def test_empty_arrays_change_nothing():
    store = prpf.Store(4, 2, ["R", "G", "B"])
    store.push(np.zeros((0, 4, 3)))
    store.push(np.zeros((2, 4, 0, 3)))
    store.push_pixels(np.zeros((0, 2), int), np.zeros((0, 3)))
    assert store.samples == 0


@pytest.mark.parametrize(
    "samples, error, words",
    [
        (np.zeros((2, 4, 4)), ValueError, r"shape \(2, 4, 4\); accepted is .* \(height, width, samples, 3\)"),
        (np.zeros((3, 4, 3)), ValueError, r"found 4x3 pixels at \(0, 0\); accepted are pixels within 4x2"),
        (np.zeros(3), ValueError, r"shape \(3,\)"),
        (np.zeros((2, 4, 3), complex), TypeError, "complex128"),
        (np.zeros((2, 4, 3), object), TypeError, "object"),
        (np.zeros((2, 4, 3), "datetime64[s]"), TypeError, "datetime64"),
        ([[1], [1, 2]], ValueError, "samples: setting an array element with a sequence.*; accepted is an array of real"),
        ("no samples", TypeError, "<U10"),
        (None, TypeError, "object"),
    ],
)
def test_wrong_samples_are_exceptions(samples, error, words):
    store = prpf.Store(4, 2, ["R", "G", "B"])
    with pytest.raises(error, match=words):
        store.push(samples)
    assert store.samples == 0


def test_pixels_outside_are_exceptions():
    store = prpf.Store(4, 2, ["R", "G", "B"])
    for corner in [{"x": 1}, {"y": 2**62}, {"x": 2**64 - 1}]:
        with pytest.raises(ValueError, match="accepted are pixels within 4x2"):
            store.push(np.zeros((2, 4, 3)), **corner)
    with pytest.raises(ValueError, match=r"pixels: found \(4, 0\); accepted are pixels within 4x2"):
        store.push_pixels([[4, 0]], [[1, 1, 1]])
    with pytest.raises(ValueError, match="found -1; accepted is an array of integers from 0 up"):
        store.push_pixels([[-1, 0]], [[1, 1, 1]])
    with pytest.raises(ValueError, match=r"samples: found the shape \(2, 3\); accepted is .* \(1, 3\)"):
        store.push_pixels([[0, 0]], np.ones((2, 3)))
    with pytest.raises(ValueError, match=r"pixels: found the shape \(1, 3\)"):
        store.push_pixels([[0, 0, 0]], [[1, 1, 1]])


def test_strides_and_byte_orders_do_not_matter():
    samples, _ = made_up_samples(6, 8, 2)
    plain, odd = prpf.Store(8, 6, FEATURES), prpf.Store(8, 6, FEATURES)
    plain.push(samples)
    odd.push(np.asfortranarray(samples[::-1].astype(">f8"))[::-1])
    assert np.array_equal(plain.mean(), odd.mean())


@pytest.mark.parametrize(
    "names, words",
    [
        (["N1.x", "N1.y", "N1.z"], "found no colour; accepted are names that include R, G and B"),
        ([], "found no colour"),
        (["R", "G"], "found no `B`"),
        (["R", "G", "B", "depth"], "found `depth`; accepted are film.x"),
        (["R", "G", "B", "R"], "found `R` twice"),
    ],
)
def test_layouts_without_sense_are_exceptions(names, words):
    with pytest.raises(ValueError, match=words):
        prpf.Store(4, 4, names)


@pytest.mark.parametrize("names", ["RGB", ["R", "G", 3], None, 7])
def test_layouts_that_are_no_lists_of_names_are_exceptions(names):
    with pytest.raises(TypeError, match="found .*; accepted is a list of names"):
        prpf.Store(4, 4, names)


def test_stores_without_pixels_or_beyond_memory_are_exceptions():
    for size in [(0, 4), (4, 0), (10**6, 1), (2**63, 2)]:
        with pytest.raises(ValueError, match="size: found"):
            prpf.Store(*size, ["R", "G", "B"])
    with pytest.raises(MemoryError, match="GB of memory"):
        prpf.Store(10000, 10000, FEATURES, reservoir=10**6)
    with pytest.raises(ValueError, match="found -1; accepted is a whole number"):
        prpf.Store(-1, 4, ["R", "G", "B"])


def test_a_state_beyond_memory_is_an_exception(scene, tmp_path):
    state = tmp_path / "large.state"
    prpf.render(scene, spp=1, state=state)
    # Takes no space on the disk
    os.truncate(state, 2**42)
    with pytest.raises(MemoryError, match="large.state: the render state does not fit: it takes .* GB of memory"):
        prpf.Store.load(state)


def test_threads_share_a_store():
    samples, image = made_up_samples(32, 32, 4)
    store = prpf.Store(32, 32, FEATURES)
    store.push(samples)
    with ThreadPoolExecutor(4) as pool:
        pushes = [pool.submit(store.push, samples) for _ in range(16)]
        passes = [pool.submit(prpf.denoise, store, "nlm draft") for _ in range(4)]
        for done in pushes + passes:
            done.result()
    assert store.spp == 17 * 4


def test_unknown_names_and_halves_are_exceptions():
    store = prpf.Store(2, 2, ["R", "G", "B"])
    with pytest.raises(ValueError, match="names: found `depth`; accepted are RGB, film.x, film.y, R, G, B"):
        store.mean("depth")
    with pytest.raises(TypeError):
        store.mean(7)
    with pytest.raises(ValueError, match="half: found 2; accepted are 0, 1 and None"):
        store.mean(half=2)


def test_moments_of_another_program_give_the_same_image():
    samples, _ = made_up_samples(20, 30, 8)
    pushed = prpf.Store(30, 20, FEATURES)
    pushed.push(samples)
    halves = [samples[:, :, half::2].astype(np.float64) for half in (0, 1)]
    means = np.stack([half.mean(2) for half in halves])
    variances = np.stack([half.var(2, ddof=1) for half in halves])
    counts = np.full((2, 20, 30), 4)
    store = prpf.Store.from_moments(FEATURES, counts, means, variances)
    assert np.allclose(store.variance("RGB"), pushed.variance("RGB"), rtol=1e-4)
    assert np.allclose(prpf.denoise(store).image, prpf.denoise(pushed).image, rtol=1e-3)


@pytest.mark.parametrize(
    "counts, means, variances, words",
    [
        (np.ones((2, 4, 5), int), np.zeros((2, 4, 5, 2)), np.zeros((2, 4, 5, 3)), r"means: found the shape \(2, 4, 5, 2\)"),
        (np.ones((2, 4, 5), int), np.zeros((1, 4, 5, 3)), np.zeros((2, 4, 5, 3)), "means: found the shape"),
        (np.ones((2, 4, 5), int), np.zeros((2, 4, 5, 3)), np.zeros((2, 4, 4, 3)), "variances: found the shape"),
        (np.ones((2, 4), int), np.zeros((2, 4, 5, 3)), np.zeros((2, 4, 5, 3)), "counts: found the shape"),
        (np.ones((2, 0, 0), int), np.zeros((2, 0, 0, 3)), np.zeros((2, 0, 0, 3)), "size: found 0x0"),
        (np.ones((2, 4, 5), int), np.full((2, 4, 5, 3), np.nan), np.zeros((2, 4, 5, 3)), "means: found NaN"),
        (np.ones((2, 4, 5), int), np.zeros((2, 4, 5, 3)), np.full((2, 4, 5, 3), -1), "variances: found -1"),
    ],
)
def test_moments_that_make_no_store_are_exceptions(counts, means, variances, words):
    with pytest.raises(ValueError, match=words):
        prpf.Store.from_moments(["R", "G", "B"], counts, means, variances)
