"""The render loop: budgets, callbacks, files."""

import os
import signal
import threading
import time

import numpy as np
import pytest

import prpf


def test_a_render_has_image_maps_store_and_records(scene, tmp_path):
    reference = prpf.render(scene, spp=64, sampling="uniform", denoiser="none", seed=1).result.image
    passes = []
    output, state = tmp_path / "out.exr", tmp_path / "out.state"
    render = prpf.render(scene, spp=16, reference=reference, callback=passes.append, output=output, state=state)
    assert render.stopped_by == "spp" and render.result.made_by == "nlm standard"
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


@pytest.fixture
def interrupts():
    """Python's own handler: a process in the background may have been told to ignore interrupts."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_an_interrupt_is_heard_and_other_threads_run(scene, interrupts):
    ticks = []

    def interrupt():
        for _ in range(10):
            time.sleep(0.03)
            ticks.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    def everything():
        prpf.render(scene, time=20, denoiser="none")

    def samples():
        scene.render(scene.store(), 20000)

    for work in [everything, samples]:
        ticks.clear()
        thread = threading.Thread(target=interrupt)
        thread.start()
        with pytest.raises(KeyboardInterrupt):
            work()
        thread.join()
        assert len(ticks) == 10 and ticks[-1] - ticks[0] < 2


@pytest.mark.parametrize(
    "arguments, error, words",
    [
        ({"spp": 0}, ValueError, "spp: found 0; accepted is a number from 1 up"),
        ({"time": float("nan")}, ValueError, "seconds: found NaN"),
        ({"target_error": -1}, ValueError, "target_error: found -1"),
        ({"max_spp": 2}, ValueError, "max_spp: found 2"),
        ({"sampling": "random"}, ValueError, "sampling: found `random`; accepted are adaptive and uniform"),
        ({"denoiser": "median"}, ValueError, "denoiser: found `median`"),
        ({"denoiser": "rpf", "time": 1}, MemoryError, "keeps all sample vectors"),
        ({"reference": np.zeros((5, 5, 3))}, ValueError, "reference: found 5x5 pixels; .* 40x24 pixels"),
        ({"reference": np.zeros((24, 40))}, ValueError, r"reference: found the shape \(24, 40\)"),
        ({"output": "out.bmp"}, ValueError, "use .exr or .png"),
        ({"reservoir": 10**9}, MemoryError, "GB of memory"),
    ],
)
def test_wrong_arguments_are_exceptions(scene, arguments, error, words):
    with pytest.raises(error, match=words):
        prpf.render(scene, **arguments)


def test_files_that_cannot_be_read_or_written_are_exceptions(scene, tmp_path):
    with pytest.raises(OSError):
        prpf.render(scene, spp=1, output=tmp_path / "missing" / "out.exr")
    with pytest.raises(OSError):
        prpf.render(scene, spp=1, state=tmp_path / "missing" / "out.state")
    with pytest.raises(FileNotFoundError):
        prpf.Store.load(tmp_path / "missing.state")
    text = tmp_path / "text.state"
    text.write_text("This is no state.")
    with pytest.raises(prpf.Error, match="found no render state"):
        prpf.Store.load(text)
