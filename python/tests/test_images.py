"""Comparison, image files."""

import os
import struct
import subprocess
import sys
import zlib

import numpy as np
import pytest

import prpf


def test_metrics_have_the_values_of_their_formulas():
    image, reference = np.full((20, 30, 3), 0.5), np.full((20, 30, 3), 0.25)
    found = prpf.compare(image, reference)
    assert set(found) == {
        "mse", "relmse", "block_relmse", "psnr", "ssim", "flip", "mean_ratio", "excluded_pixels",
    }  # fmt: skip
    assert found["mse"] == 0.0625 and found["mean_ratio"] == 2
    assert np.isclose(found["relmse"], 0.0625 / 0.0725)
    same = prpf.compare(image, image)
    assert (same["mse"], same["ssim"], same["flip"], same["psnr"]) == (0, 1, 0, np.inf)


def test_pixels_that_are_not_finite_are_excluded():
    image, reference = np.ones((4, 5, 3)), np.ones((4, 5, 3))
    image[1, 2, 0] = np.nan
    assert prpf.compare(image, reference)["excluded_pixels"] == 1


@pytest.mark.parametrize(
    "image, error, words",
    [
        (np.ones((5, 4, 3)), ValueError, "the image is 4x5, the reference is 5x4"),
        (np.ones((4, 5)), ValueError, r"image: found the shape \(4, 5\); accepted is .* \(height, width, 3\)"),
        (np.ones((4, 5, 1)), ValueError, r"shape \(4, 5, 1\)"),
        (np.ones((0, 5, 3)), ValueError, r"shape \(0, 5, 3\)"),
        (np.full((4, 5, 3), np.nan), ValueError, "no pixel is finite"),
        (np.ones((4, 5, 3), complex), TypeError, "complex128"),
        ([[1, 2], [3]], ValueError, "inhomogeneous"),
    ],
)
def test_images_that_cannot_be_compared_are_exceptions(image, error, words):
    with pytest.raises(error, match=words):
        prpf.compare(image, np.ones((4, 5, 3)))


def test_images_survive_files(tmp_path):
    image = np.random.default_rng(0).random((4, 7, 3)).astype(np.float32)
    for name, tolerance in [("a.exr", 0), ("a.png", 0.01)]:
        prpf.write_image(tmp_path / name, image)
        assert np.allclose(prpf.read_image(tmp_path / name), image, atol=tolerance)
    with pytest.raises(ValueError, match="use .exr or .png"):
        prpf.write_image(tmp_path / "a.bmp", image)
    with pytest.raises(OSError):
        prpf.write_image(tmp_path / "missing" / "a.png", image)
    with pytest.raises(FileNotFoundError, match="no such file"):
        prpf.read_image(tmp_path / "missing.exr")
    (tmp_path / "text.png").write_text("This is no image.")
    with pytest.raises(prpf.Error):
        prpf.read_image(tmp_path / "text.png")


READ_WITH_LITTLE_MEMORY = """
import resource
import sys
import prpf

resource.setrlimit(resource.RLIMIT_AS, (4 << 30, resource.getrlimit(resource.RLIMIT_AS)[1]))
try:
    prpf.read_image(sys.argv[1])
except MemoryError as error:
    print(error)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="no limit of memory that is known")
def test_an_image_beyond_memory_is_an_exception(tmp_path):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    # A header of 20000x20000 pixels of 8 bits of grey: 10 GB as floating-point numbers
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", 20000, 20000, 8, 0, 0, 0, 0))
    path = tmp_path / "large.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", zlib.compress(b"")) + chunk(b"IEND", b""))
    command = [sys.executable, "-c", READ_WITH_LITTLE_MEMORY, path]
    # Threads of numpy's libraries map memory at the import
    few = {name: "1" for name in ["OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"]}
    environment = {**os.environ, **few}
    printed = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60, env=environment).stdout
    assert "large.png: the image does not fit: it takes 10.0 GB of memory" in printed
