"""Arrays that other extensions use at the same time."""

import contextlib
import ctypes
import importlib

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
