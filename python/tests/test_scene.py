"""Scenes: reading, sizes, and rendering into stores."""

import os
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import SCENE

import prpf


def test_a_scene_tells_what_is_in_it(scene_file):
    scene = prpf.Scene.load(scene_file)
    assert (scene.width, scene.height, scene.spp) == (40, 24, 4)
    assert "environment" in scene.effects
    assert scene.dimensions[:5] == ["film.x", "film.y", "R", "G", "B"]
    assert scene.warnings == []
    smaller = prpf.Scene.load(str(scene_file), resolution=(20, 12), pixel_bounds=(5, 15, 2, 12))
    assert (smaller.width, smaller.height, smaller.resolution) == (10, 10, (20, 12))
    assert smaller.pixel_bounds == (5, 15, 2, 12)


def test_counts_do_not_depend_on_how_they_are_divided(scene):
    at_once, in_parts = scene.store(seed=3), scene.store(seed=3)
    counts = np.arange(40 * 24).reshape(24, 40) % 7
    scene.render(at_once, counts)
    scene.render(in_parts, counts // 2)
    scene.render(in_parts, (counts - counts // 2).astype(np.uint8))
    assert np.array_equal(at_once.counts(), counts)
    assert np.array_equal(at_once.mean(), in_parts.mean())
    assert np.array_equal(at_once.variance(), in_parts.variance())
    other_seed = scene.store(seed=4)
    scene.render(other_seed, counts)
    assert not np.array_equal(at_once.mean("RGB"), other_seed.mean("RGB"))


def test_many_samples_of_few_pixels_take_few_steps():
    large = prpf.Scene.parse('Film "rgb" "integer xresolution" 512 "integer yresolution" 256 WorldBegin')
    counts = np.ones((256, 512), int)
    counts[100, 200] = counts[101, 7] = 100_000
    at_once, in_parts = large.store(), large.store()
    start = time.monotonic()
    large.render(at_once, counts)
    # Steps of one sample per pixel took 21 s, these 0.1 s
    assert time.monotonic() - start < 5
    large.render(in_parts, np.minimum(counts, 77_777))
    large.render(in_parts, counts - np.minimum(counts, 77_777))
    assert np.array_equal(at_once.counts(), counts)
    assert np.array_equal(at_once.mean(), in_parts.mean()) and np.array_equal(at_once.variance(), in_parts.variance())


def test_one_number_of_any_integer_type_is_for_all_pixels(scene):
    for number in [2, np.int64(2), np.uint8(2), np.array(2)]:
        store = scene.store()
        scene.render(store, number)
        assert (store.counts() == 2).all()


@pytest.mark.parametrize(
    "counts, error, words",
    [
        (-1, ValueError, "found -1"),
        (2**32, ValueError, "found 4294967296"),
        (2**70, TypeError, "object"),
        (1.5, TypeError, "float64"),
        ("4", TypeError, "counts: found an array of <U1"),
        (np.nan, TypeError, "float64"),
        (np.ones((40, 24), int), ValueError, r"shape \(40, 24\); accepted is .* \(24, 40\)"),
        (np.ones((0, 0), int), ValueError, r"shape \(0, 0\)"),
        (np.ones((24, 40, 1), int), ValueError, r"shape \(24, 40, 1\)"),
        (np.full((24, 40), -5), ValueError, "found -5"),
        (np.full((24, 40), 2**63, np.uint64), ValueError, "found 9223372036854775808"),
        (None, TypeError, "object"),
    ],
)
def test_wrong_counts_are_exceptions(scene, counts, error, words):
    store = scene.store()
    with pytest.raises(error, match=words):
        scene.render(store, counts)
    assert store.samples == 0


def test_a_store_of_another_scene_is_refused(scene):
    with pytest.raises(ValueError, match="found 3x2 pixels; accepted is the size of the scene, 40x24"):
        scene.render(prpf.Store(3, 2, ["R", "G", "B"]), 1)
    with pytest.raises(ValueError, match="found the dimensions film.x film.y R G B; accepted"):
        scene.render(prpf.Store(40, 24, ["R", "G", "B"]), 1)


def test_samples_of_another_scene_of_the_same_kind_are_refused(scene, tmp_path):
    other = prpf.Scene.parse(SCENE.replace("0.8 0.2 0.1", "0.1 0.2 0.8"))
    assert (other.resolution, other.dimensions) == (scene.resolution, scene.dimensions)
    rendered = prpf.render(scene, spp=4, state=tmp_path / "a.state")
    own = scene.store()
    scene.render(own, 4)
    for store in [own, rendered.store, prpf.Store.load(tmp_path / "a.state")]:
        with pytest.raises(ValueError, match=r"store: scene: found samples of \(.*; accepted are those of this scene, \("):
            other.render(store, 4)
        assert store.spp == 4
        scene.render(store, 4)
        assert store.spp == 8
    # Until it has samples a store is of no scene
    other.render(scene.store(), 4)


def test_scenes_that_cannot_be_read_are_exceptions(tmp_path):
    with pytest.raises(FileNotFoundError, match="missing.pbrt: cannot be read: no such file"):
        prpf.Scene.load(tmp_path / "missing.pbrt")
    with pytest.raises(OSError):
        prpf.Scene.load(tmp_path)
    wrong = tmp_path / "wrong.pbrt"
    wrong.write_text("WorldBegin\nShape 7")
    with pytest.raises(prpf.Error, match=r"wrong.pbrt:2:"):
        prpf.Scene.load(wrong)


LOAD_ALL = """
import sys
import prpf

for path in sys.argv[1:]:
    try:
        prpf.Scene.load(path)
    except OSError as error:
        print(error)
"""


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_pipes_and_devices_are_not_waited_for(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    # In a process of its own, which may be killed. The pipe comes first: the device would fill the memory
    command = [sys.executable, "-c", LOAD_ALL, pipe, "/dev/zero"]
    lines = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout.splitlines()
    assert len(lines) == 2 and all("cannot be read: it is no regular file" in line for line in lines), lines


@pytest.mark.parametrize("resolution", [(0, 5), (70000, 1), (60000, 60000)])
def test_resolutions_out_of_range_are_exceptions(scene_file, resolution):
    with pytest.raises(ValueError, match="resolution: found"):
        prpf.Scene.load(scene_file, resolution=resolution)


def test_the_depth_of_paths_is_an_override(scene, scene_file):
    for direct in [prpf.Scene.load(scene_file, max_depth=1), prpf.Scene.parse(SCENE, max_depth=1)]:
        assert direct.max_depth == 1 < scene.max_depth
        assert "indirect" in scene.effects and "indirect" not in direct.effects
        assert "N2.x" in scene.dimensions and "N2.x" not in direct.dimensions

    def brightness(scene):
        return prpf.render(scene, spp=64, sampling="uniform", denoiser="none").result.image.mean()

    # Without any scattering the background is left
    assert brightness(prpf.Scene.parse(SCENE, max_depth=0)) < 0.6 * brightness(scene)
    with pytest.raises(ValueError, match="max_depth: found 1048577; accepted is a number from 0 to 1048576"):
        prpf.Scene.parse(SCENE, max_depth=2**20 + 1)
    with pytest.raises(ValueError, match="found -1; accepted is a whole number"):
        prpf.Scene.load(scene_file, max_depth=-1)


@pytest.mark.parametrize("bounds", [(0, 0, 0, 5), (5, 2, 0, 5), (0, 41, 0, 5)])
def test_pixel_bounds_outside_the_film_are_exceptions(scene_file, bounds):
    with pytest.raises(ValueError, match="accepted are 0 <= x0 < x1 <= 40"):
        prpf.Scene.load(scene_file, pixel_bounds=bounds)
