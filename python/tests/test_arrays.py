"""Arrays that other extensions use at the same time, and other threads while arrays are copied."""

import contextlib
import ctypes
import importlib
import threading
import time

import numpy as np
import pytest

import prpf

Acquire = ctypes.PYFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.py_object)
Release = ctypes.PYFUNCTYPE(None, ctypes.c_void_p, ctypes.py_object)


class BorrowChecking(ctypes.Structure):
    """The functions by which extensions written in Rust tell each other which arrays they read and write."""

    _fields_ = [
        ("version", ctypes.c_uint64),
        ("flags", ctypes.c_void_p),
        ("acquire", Acquire),
        ("acquire_mut", Acquire),
        ("release", Release),
        ("release_mut", Release),
    ]


@contextlib.contextmanager
def written_by_another_extension(array):
    # The first extension that borrows an array offers the functions to the others
    prpf.compare(np.ones((1, 1, 3)), np.ones((1, 1, 3)))
    is_new = int(np.__version__.split(".")[0]) >= 2
    multiarray = importlib.import_module("numpy._core.multiarray" if is_new else "numpy.core.multiarray")
    pointer = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
        ("PyCapsule_GetPointer", ctypes.pythonapi)
    )
    name = "_RUST_NUMPY_BORROW_CHECKING_API"
    functions = BorrowChecking.from_address(pointer(getattr(multiarray, name), name.encode()))
    assert functions.acquire_mut(functions.flags, array) == 0
    try:
        yield
    finally:
        functions.release_mut(functions.flags, array)


def test_arrays_that_another_extension_writes_to_are_exceptions(scene, rendered):
    image, map, counts = np.ones((24, 40, 3), np.float32), np.ones((24, 40), np.float32), np.ones((24, 40), np.uint32)
    store = prpf.Store(40, 24, ["R", "G", "B"])
    uses = [
        ("image", image, lambda: prpf.compare(image, image.copy())),
        ("samples", image, lambda: store.push(image)),
        ("sample_map", map, lambda: prpf.render(scene, spp=4, sample_map=map)),
        ("priority", map, lambda: prpf.allocate(rendered, map, 100)),
        ("counts", counts, lambda: scene.render(scene.store(), counts)),
    ]
    for name, array, use in uses:
        with written_by_another_extension(array):
            with pytest.raises(ValueError, match=f"^{name}: found an array that another extension writes to"):
                use()
        use()


def longest_gap(work):
    """The longest time for which another thread did not run during work, as a fraction of the work's time."""
    times, is_done = [], threading.Event()

    def tick():
        while not is_done.is_set():
            times.append(time.monotonic())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.monotonic()
    work()
    end = time.monotonic()
    is_done.set()
    thread.join()
    times = [start, *(one for one in times if start < one < end), end]
    return np.diff(times).max() / (end - start)


def test_other_threads_run_while_arrays_are_copied():
    image = np.ones((2000, 2000, 3), np.float32)

    def copy_image():
        # The image is taken before the reference is refused
        with pytest.raises(ValueError, match="reference: found the shape"):
            prpf.compare(image, np.ones((1, 1)))

    # The machine may be busy now and then
    assert min(longest_gap(copy_image) for _ in range(5)) < 0.5
