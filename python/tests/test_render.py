"""The render loop: budgets, callbacks, files."""

import ctypes
import functools
import os
import shutil
import signal
import threading
import time

import numpy as np
import pytest
from conftest import SCENE

import prpf


def test_a_render_has_image_maps_store_and_records(scene, tmp_path):
    reference = prpf.render(scene, spp=64, sampling="uniform", denoiser="none", seed=1).result.image
    passes = []
    output, state = tmp_path / "out.exr", tmp_path / "out.state"
    render = prpf.render(scene, spp=16, reference=reference, callback=passes.append, output=output, state=state)
    assert render.stopped_by == "spp" and render.result.made_by == "learned standard"
    assert render.store.samples == 16 * 40 * 24
    assert [one.index for one in passes] == list(range(len(render.passes))) and len(passes) > 1
    assert np.array_equal(passes[-1].result.image, render.result.image)
    assert passes[0].store.samples < render.store.samples
    assert render.passes[-1]["relmse"] < 0.05 and render.seconds["render"] > 0
    # The loop is made of the parts that Python has
    assert np.array_equal(prpf.denoise(render.store).image, render.result.image)
    assert np.allclose(prpf.read_image(output), render.result.image)
    loaded = prpf.Store.load(state)
    assert np.array_equal(loaded.mean(), render.store.mean())


def test_the_scenes_samples_are_the_default_budget(scene):
    assert prpf.render(scene).store.spp == 4


def test_a_callback_stops_a_render_or_fails(scene):
    render = prpf.render(scene, spp=4096, callback=lambda one: one.index == 0)
    assert render.stopped_by == "interrupt" and render.store.spp < 4096

    def fail(one):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        prpf.render(scene, spp=16, callback=fail)
    with pytest.raises(TypeError):
        prpf.render(scene, spp=16, callback=7)


def test_time_and_error_are_budgets(scene):
    start = time.monotonic()
    assert prpf.render(scene, time=0.5).stopped_by == "time"
    assert time.monotonic() - start < 2
    assert prpf.render(scene, target_error=0.5).stopped_by == "target-error"


def test_time_is_left_for_the_writing_of_the_image(tmp_path):
    large, passes = prpf.Scene.parse(SCENE, resolution=(1280, 768)), []

    def callback(one):
        passes.append(time.monotonic())

    budget = 4
    few = {"denoiser": "none", "statistics": "needed", "output": tmp_path / "out.exr"}

    def leaves_time():
        passes.clear()
        start = time.monotonic()
        render = prpf.render(large, time=budget, **few, callback=callback)
        writing = time.monotonic() - passes[-1]
        assert render.stopped_by == "time"
        # Where it was not foreseen, the last pass ended at 98 % of the time
        return passes[-1] - start < budget - 0.5 * writing

    # The machine may be busy now and then
    assert any(leaves_time() for _ in range(3))


def test_the_acceleration_structure_is_built_once(tmp_path):
    # A grid of half a million triangles, and hardly anything to render
    side = 500
    y, x = np.mgrid[: side + 1, : side + 1]
    vertices = np.stack([x / side - 0.5, y / side - 0.5, np.sin(x * y)], -1).reshape(-1, 3).astype("<f4")
    first = (y * (side + 1) + x)[:-1, :-1].ravel()
    corners = np.concatenate([first[:, None] + [0, 1, side + 1], first[:, None] + [1, side + 2, side + 1]])
    faces = np.zeros(len(corners), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, corners
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    (tmp_path / "grid.ply").write_bytes(header.encode() + vertices.tobytes() + faces.tobytes())
    film = 'Film "rgb" "integer xresolution" 4 "integer yresolution" 4 WorldBegin '
    world = 'LightSource "infinite" Translate 0 0 4 Shape "plymesh" "string filename" "grid.ply"'
    scene = prpf.Scene.parse(film + world, tmp_path)

    def seconds():
        start = time.monotonic()
        prpf.render(scene, spp=1, denoiser="none")
        return time.monotonic() - start

    # Each render built one more: the second took at least half of the time of the first
    first, later = seconds(), min(seconds() for _ in range(3))
    assert later < 0.35 * first, (first, later)


@pytest.fixture
def interrupts():
    """Python's own handler: a process in the background may have been told to ignore interrupts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interrupt_is_heard_and_other_threads_run(scene, interrupts, tmp_path):
    ticks = []

    def interrupt():
        for _ in range(10):
            time.sleep(0.03)
            ticks.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    def everything():
        prpf.render(scene, time=20, denoiser="none", output=tmp_path / "out.exr")

    def samples():
        scene.render(scene.store(), 20000)

    for work in [everything, samples]:
        ticks.clear()
        thread = threading.Thread(target=interrupt)
        thread.start()
        with pytest.raises(KeyboardInterrupt) as raised:
            work()
        thread.join()
        assert len(ticks) == 10 and ticks[-1] - ticks[0] < 2
        if work is everything:
            render = raised.value.render
            assert render.stopped_by == "interrupt"
            assert np.allclose(prpf.read_image(tmp_path / "out.exr"), render.result.image)


def test_an_interrupt_after_the_last_step_loses_no_render(scene, interrupts):
    # C's own function: one of Python would handle the signal itself. The pass is an argument that it does not look at
    interrupt = getattr(ctypes.CDLL(None), "raise")
    interrupt.argtypes = [ctypes.c_int, ctypes.py_object]
    with pytest.raises(KeyboardInterrupt) as raised:
        prpf.render(scene, spp=1, callback=functools.partial(interrupt, signal.SIGINT))
    render = raised.value.render
    assert render.stopped_by == "spp" and render.store.spp == 1 and len(render.passes) == 1


@pytest.mark.parametrize(
    "arguments, error, words",
    [
        ({"spp": 0}, ValueError, "spp: found 0; accepted is a number from 1 up"),
        ({"time": float("nan")}, ValueError, "seconds: found NaN"),
        ({"target_error": -1}, ValueError, "target_error: found -1"),
        ({"min_spp": 4, "max_spp": 2}, ValueError, "max_spp: found 2; accepted is a number from 4 up"),
        ({"spp": 16, "max_spp": 8}, ValueError, "spp: found 16; accepted is a number up to max_spp, 8"),
        ({"spp": 16, "min_spp": 17}, ValueError, "min_spp: found 17; accepted is a number up to spp, 16"),
        ({"min_spp": 5}, ValueError, "min_spp: found 5; accepted is a number up to the scene's spp, 4"),
        ({"spp": 16, "max_spp": 0}, ValueError, "max_spp: found 0; accepted is a number from 1 up"),
        ({"sampling": "random"}, ValueError, "sampling: found `random`; accepted are adaptive and uniform"),
        ({"denoiser": "median"}, ValueError, "denoiser: found `median`"),
        ({"denoiser": "rpf", "time": 1}, MemoryError, "keeps all sample vectors"),
        ({"reference": np.zeros((5, 5, 3))}, ValueError, "reference: found 5x5 pixels; .* 40x24 pixels"),
        ({"reference": np.zeros((24, 40))}, ValueError, r"reference: found the shape \(24, 40\)"),
        ({"output": "out.bmp"}, ValueError, "use .exr or .png"),
        ({"output": "out.png", "state": "out.png"}, ValueError, "out.png: found the same file twice"),
        ({"callback": 3}, TypeError, "found 3; accepted is a function"),
        ({"counts": "all"}, TypeError, "found 'all'; accepted is a function"),
        ({"spp": -1}, ValueError, "found -1; accepted is a whole number from 0 to 4294967295"),
        ({"reservoir": 10**9}, MemoryError, "GB of memory"),
    ],
)
def test_wrong_arguments_are_exceptions(scene, arguments, error, words):
    with pytest.raises(error, match=words):
        prpf.render(scene, **arguments)


def test_files_that_cannot_be_read_or_written_are_exceptions(scene, tmp_path):
    for name, file in [("output", "out.exr"), ("state", "a.state"), ("samples", "all.npz")]:
        # An hour of rendering that would be lost
        with pytest.raises(FileNotFoundError, match=f"missing/{file}: no such file or folder"):
            prpf.render(scene, time=3600, **{name: tmp_path / "missing" / file})
    with pytest.raises(FileNotFoundError):
        prpf.Store.load(tmp_path / "missing.state")
    text = tmp_path / "text.state"
    text.write_text("This is no state.")
    with pytest.raises(prpf.Error, match="found no render state"):
        prpf.Store.load(text)


def test_a_map_places_samples_by_ratios_or_counts(scene):
    ratios = np.ones((24, 40))
    ratios[:, :20] = 3
    counts = prpf.render(scene, spp=16, sample_map=ratios).store.counts()
    assert counts.sum() == 16 * 40 * 24 and counts[:, :20].mean() == pytest.approx(3 * counts[:, 20:].mean(), rel=0.1)
    wanted = np.arange(24 * 40).reshape(24, 40) % 7
    assert np.array_equal(prpf.render(scene, sample_map=wanted, sample_map_values="absolute").store.counts(), wanted)


def test_bounds_per_pixel_are_kept(scene):
    assert (prpf.render(scene, spp=2, max_spp=2).store.counts() == 2).all()
    counts = prpf.render(scene, spp=16, min_spp=12, max_spp=20).store.counts()
    assert counts.min() >= 12 and counts.max() <= 20


def test_a_map_of_counts_is_the_budget(scene):
    # `rpf` keeps every sample vector, more than those of the scene's 4 samples per pixel
    wanted = np.full((24, 40), 10)
    rendered = prpf.render(scene, sample_map=wanted, sample_map_values="absolute", denoiser="rpf")
    assert np.array_equal(rendered.store.counts(), wanted) and rendered.store.reservoir >= 10


def test_a_map_has_the_size_of_the_part_that_is_rendered(scene_file):
    part = prpf.Scene.load(scene_file, pixel_bounds=(4, 20, 2, 12))
    wanted = np.arange(10 * 16).reshape(10, 16) % 5
    rendered = prpf.render(part, sample_map=wanted, sample_map_values="absolute", denoiser="none")
    assert np.array_equal(rendered.store.counts(), wanted)
    with pytest.raises(ValueError, match=r"found the shape \(24, 40\); accepted is .* \(10, 16\)"):
        prpf.render(part, sample_map=np.ones((24, 40)))


@pytest.mark.parametrize("statistics", ["all", "needed"])
def test_every_sample_is_written(scene, tmp_path, statistics):
    rendered = prpf.render(scene, spp=6, samples=tmp_path / "all.npz", statistics=statistics)
    pieces = np.load(tmp_path / "all.npz")
    samples = np.concatenate([pieces[name] for name in pieces.files])
    assert samples.dtype.names == ("x", "y", "index", *scene.dimensions)
    counts = np.zeros((24, 40), int)
    np.add.at(counts, (samples["y"], samples["x"]), 1)
    assert np.array_equal(counts, rendered.store.counts())
    assert rendered.store.dimensions == scene.dimensions
    assert samples["R"].mean() == pytest.approx(np.average(rendered.store.mean("R")[..., 0], weights=counts), rel=1e-4)


@pytest.mark.parametrize(
    "arguments, error, words",
    [
        ({"sample_map": np.ones((5, 5))}, ValueError, r"sample_map: found the shape \(5, 5\)"),
        ({"sample_map": -np.ones((24, 40))}, ValueError, "sample_map: "),
        ({"sample_map": np.full((24, 40), "a")}, TypeError, "sample_map: "),
        ({"sample_map": np.ones((24, 40)), "sampling": "adaptive"}, ValueError, "found adaptive with sample_map"),
        ({"sample_map": np.ones((24, 40)), "sample_map_values": "odd"}, ValueError, "accepted are relative and absolute"),
        ({"sample_map": np.ones((24, 40)), "sample_map_values": "absolute", "spp": 4}, ValueError, "spp: found 4"),
    ],
)
def test_maps_that_cannot_be_followed_are_exceptions(scene, arguments, error, words):
    with pytest.raises(error, match=words):
        prpf.render(scene, **arguments)


def test_own_counts_are_taken_as_they_are(scene):
    calls = []

    def left_half(one, planned):
        assert planned.shape == (24, 40) and planned.dtype == np.uint32
        counts = np.zeros_like(planned)
        counts[:, :20] = planned.sum() // (24 * 20)
        counts[0, 0] += planned.sum() - counts.sum()
        calls.append((one.index, one.store.counts() + counts))
        return counts

    render = prpf.render(scene, spp=16, counts=left_half)
    assert len(calls) > 1 and [index for index, _ in calls] == list(range(len(calls)))
    assert np.array_equal(calls[-1][1], render.store.counts())
    assert render.store.counts()[:, 20:].max() < render.store.counts()[:, :20].min()
    assert render.store.samples == 16 * 40 * 24

    ours = prpf.render(scene, spp=16)
    same = prpf.render(scene, spp=16, counts=lambda one, planned: planned)
    assert same.store.samples == ours.store.samples


@pytest.mark.parametrize(
    "answer, error, words",
    [
        (np.zeros((24, 40), int), ValueError, "counts: found 0 samples in all; accepted are 1 to"),
        (1000, ValueError, "counts: found 960000 samples in all"),
        (np.ones((5, 5), int), ValueError, r"counts: found the shape \(5, 5\)"),
        (np.ones((24, 40)), TypeError, "counts: found an array of float64"),
        (-1, ValueError, "counts: found -1"),
        (None, TypeError, "counts: found an array of object"),
    ],
)
def test_counts_that_cannot_be_taken_are_exceptions(scene, answer, error, words):
    with pytest.raises(error, match=words):
        prpf.render(scene, spp=64, counts=lambda one, planned: answer)
    with pytest.raises(ValueError, match="accepted is one with adaptive sampling"):
        prpf.render(scene, counts=lambda one, planned: planned, sampling="uniform")


def test_a_render_goes_on_from_its_state(scene, tmp_path):
    state = tmp_path / "a.state"
    prpf.render(scene, spp=64, state=state, callback=lambda one: one.store.spp >= 8)
    render = prpf.render(scene, spp=64, state=state, resume=state)
    assert np.array_equal(render.result.image, prpf.render(scene, spp=64).result.image)
    with pytest.raises(prpf.Error, match="a.state: seed and shard: found a state of seed 0"):
        prpf.render(scene, spp=64, resume=state, seed=1)
    other = prpf.Scene.parse('Film "rgb" "integer xresolution" 5 "integer yresolution" 5 WorldBegin')
    with pytest.raises(prpf.Error, match="a.state: scene: found a state of"):
        prpf.render(other, resume=state)
    with pytest.raises(FileNotFoundError):
        prpf.render(scene, resume=tmp_path / "missing.state")


def test_states_are_written_while_the_render_goes_on(scene, tmp_path):
    state, found = tmp_path / "a.state", []

    def callback(one):
        if state.exists():
            found.append((one.index, prpf.Store.load(state).spp))
        return bool(found)

    # With a function that chooses counts every batch follows a pass
    endless = {"spp": 10**5, "denoiser": "none", "counts": lambda one, planned: planned, "callback": callback}
    render = prpf.render(scene, **endless, state=state, state_every=0.1)
    index, spp = found[0]
    assert render.stopped_by == "interrupt" and index < render.passes[-1]["index"] and 0 < spp <= render.store.spp
    assert prpf.Store.load(state).spp == render.store.spp
    for number in [-1, float("nan")]:
        with pytest.raises(ValueError, match="state_every: found .*; accepted is a number of seconds from 0 up"):
            prpf.render(scene, state=state, state_every=number)


def test_a_state_belongs_to_one_render_at_a_time(scene, tmp_path):
    state, refused = tmp_path / "a.state", []

    def callback(one):
        # After the last step the state is being written
        if one.index == 0:
            with pytest.raises(OSError, match="a.state: cannot write the state: another program is writing this file"):
                prpf.render(scene, spp=1, state=state)
            refused.append(one.index)

    for _ in range(2):
        prpf.render(scene, spp=16, state=state, callback=callback)
        # It is free again, also after a render that could not begin
        with pytest.raises(ValueError, match="reference: found 5x5 pixels"):
            prpf.render(scene, spp=1, state=state, reference=np.zeros((5, 5, 3)))
    assert refused == [0, 0]


def test_states_that_cannot_be_written_are_warned_of_and_the_render_goes_on(scene, tmp_path):
    folder = tmp_path / "removed"
    folder.mkdir()

    def callback(one):
        shutil.rmtree(folder, ignore_errors=True)

    problem = "removed/a.state: cannot write the state: no such file"
    with pytest.warns(RuntimeWarning, match=f"{problem}.*; the render goes on"):
        with pytest.raises(FileNotFoundError, match=problem) as raised:
            prpf.render(
                scene, time=1, denoiser="none", state=folder / "a.state", state_every=0.05, callback=callback
            )
    assert raised.value.render.stopped_by == "time"


def test_a_resumed_render_keeps_the_statistics_of_its_state(scene, tmp_path):
    state = tmp_path / "a.state"

    def interrupted(**arguments):
        prpf.render(scene, spp=64, state=state, callback=lambda one: one.store.spp >= 8, **arguments)

    interrupted(statistics="needed")
    render = prpf.render(scene, spp=64, resume=state)
    assert len(render.store.dimensions) < len(scene.dimensions)
    assert np.array_equal(render.result.image, prpf.render(scene, spp=64, statistics="needed").result.image)
    for arguments in [{"statistics": "all"}, {"samples": tmp_path / "all.npz"}]:
        with pytest.raises(prpf.Error, match="a.state: statistics: found a state of .* which were asked for"):
            prpf.render(scene, spp=64, resume=state, **arguments)
    interrupted()
    assert prpf.render(scene, spp=64, resume=state).store.dimensions == scene.dimensions


def test_the_default_denoiser_can_filter_any_state(scene, tmp_path):
    state = tmp_path / "a.state"
    few = {"spp": 4, "denoiser": "nlm", "statistics": "needed"}
    assert "N2.x" not in prpf.render(scene, **few).store.dimensions
    prpf.render(scene, **few, state=state)
    assert prpf.denoise(prpf.Store.load(state)).made_by == "learned standard"


def test_outputs_replace_nothing_but_earlier_outputs(scene, tmp_path):
    samples = tmp_path / "good.npz"
    prpf.render(scene, spp=1, samples=samples)
    before = samples.read_bytes()
    with pytest.raises(ValueError, match="spp: found 0"):
        prpf.render(scene, spp=0, samples=samples)
    assert samples.read_bytes() == before
    text = tmp_path / "scene.pbrt"
    text.write_text("a scene")
    with pytest.raises(ValueError, match="found no render state"):
        prpf.render(scene, spp=1, state=text)
    states = [tmp_path / f"{seed}.state" for seed in range(2)]
    for seed, state in enumerate(states):
        prpf.render(scene, spp=1, seed=seed, state=state)
    for output, words in [(text, "found no render state"), (states[0], "found the same file twice")]:
        with pytest.raises(ValueError, match=words):
            prpf.merge(states, output)
    archive = states[1].rename(tmp_path / "state.npz")
    with pytest.raises(ValueError, match="found a render state"):
        prpf.render(scene, spp=1, samples=archive)
    image = tmp_path / "image.png"
    image.write_text("an image")
    with pytest.raises(ValueError, match="samples: found .*image.png; accepted is a name that ends in .npz"):
        prpf.render(scene, spp=1, samples=image)
    assert image.read_text() == "an image"
    assert text.read_text() == "a scene"


def test_an_exception_loses_no_samples(scene, tmp_path):
    state, output, samples = tmp_path / "a.state", tmp_path / "out.exr", tmp_path / "all.npz"

    def callback(one):
        if one.store.spp >= 8:
            raise KeyError("mine")

    with pytest.raises(KeyError, match="mine") as raised:
        prpf.render(scene, spp=64, state=state, output=output, samples=samples, callback=callback)
    so_far = raised.value.render
    assert so_far.stopped_by == "interrupt" and raised.value.__cause__ is None
    assert np.allclose(prpf.read_image(output), so_far.result.image)
    pieces = np.load(samples)
    assert sum(len(pieces[name]) for name in pieces.files) == so_far.store.samples
    render = prpf.render(scene, spp=64, resume=state)
    assert np.array_equal(render.result.image, prpf.render(scene, spp=64).result.image)


def test_a_file_that_cannot_be_written_costs_no_other(scene, tmp_path):
    folder, output, calls = tmp_path / "removed", tmp_path / "out.exr", []

    def callback(one):
        calls.append(one.index)
        shutil.rmtree(folder, ignore_errors=True)

    folder.mkdir()
    with pytest.raises(FileNotFoundError, match="removed/a.state: cannot write the state: no such file") as raised:
        prpf.render(
            scene, spp=16, state=folder / "a.state", samples=folder / "all.npz", output=output, callback=callback
        )
    render = raised.value.render
    # It is no interruption: every pass is made, and the callback hears of the last one
    assert render.stopped_by == "spp" and calls == list(range(len(render.passes)))
    assert np.allclose(prpf.read_image(output), render.result.image)
    cause = raised.value.__cause__
    assert isinstance(cause, OSError) and "removed/all.npz: cannot write the samples" in str(cause)
    assert cause.__cause__ is None


def test_an_exception_does_not_hide_that_a_file_was_not_written(scene, tmp_path):
    folder = tmp_path / "removed"
    folder.mkdir()

    def callback(one):
        shutil.rmtree(folder)
        raise KeyError("mine") from ValueError("its cause")

    with pytest.raises(KeyError, match="mine") as raised:
        prpf.render(scene, spp=16, state=folder / "a.state", output=folder / "out.exr", callback=callback)
    causes = [raised.value.__cause__]
    while causes[-1].__cause__ is not None:
        causes.append(causes[-1].__cause__)
    assert [type(cause) for cause in causes] == [FileNotFoundError, FileNotFoundError, ValueError]
    assert "a.state" in str(causes[0]) and "out.exr" in str(causes[1])


def test_states_of_other_seeds_are_merged(scene, tmp_path):
    paths = [tmp_path / f"{seed}.state" for seed in range(3)]
    stores = [prpf.render(scene, spp=4, seed=seed, state=path).store for seed, path in enumerate(paths)]
    merged = prpf.merge(paths, tmp_path / "all.state")
    assert merged.samples == sum(store.samples for store in stores) and merged.seed == stores[0].seed
    assert np.array_equal(prpf.Store.load(tmp_path / "all.state").mean(), merged.mean())
    with pytest.raises(prpf.Error, match="1.state: both hold the same samples"):
        prpf.merge([paths[1], paths[1]], tmp_path / "twice.state")
    with pytest.raises(ValueError, match="states: found 1; accepted are two or more"):
        prpf.merge(paths[:1], tmp_path / "one.state")


def test_a_merge_checks_its_output_before_it_reads_states(tmp_path):
    states = [tmp_path / "a.state", tmp_path / "b.state"]
    with pytest.raises(FileNotFoundError, match="missing/all.state: no such file or folder"):
        prpf.merge(states, tmp_path / "missing" / "all.state")
    with pytest.raises(OSError, match="found a folder; accepted is the name of a file"):
        prpf.merge(states, f"{tmp_path}/all.state/")
