"""Other weights of the learned filter: those of a process, so in a process of their own."""

import subprocess
import sys
from pathlib import Path

import pytest

import prpf

WEIGHTS = Path(__file__).parents[2] / "src" / "filter" / "learned" / "weights.safetensors"

CHANGED = """
import sys
import numpy as np
import prpf

store = prpf.Store(32, 32, ["R", "G", "B"])
store.push(np.random.default_rng(1).random((32, 32, 8, 3)))
prpf.use_weights(sys.argv[1])
print(prpf.denoise(store).image.mean(dtype="f8").hex())
try:
    prpf.use_weights(sys.argv[2])
except ValueError as error:
    print(error)
"""


def test_other_weights_make_another_image(tmp_path):
    # The last weights are 0
    content = bytearray(WEIGHTS.read_bytes())
    content[-200:] = bytes(200)
    other = tmp_path / "other.safetensors"
    other.write_bytes(content)

    def run(*weights):
        command = [sys.executable, "-c", CHANGED, *weights]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()

    same, changed = run(WEIGHTS, WEIGHTS), run(other, WEIGHTS)
    assert len(same) == 1 and changed[0] != same[0]
    assert "found other weights than those in use" in changed[1]


def test_files_that_are_no_weights_are_exceptions(tmp_path):
    with pytest.raises(FileNotFoundError, match="none: no such file or folder"):
        prpf.use_weights(tmp_path / "none")
    with pytest.raises(OSError, match="it is a folder"):
        prpf.use_weights(tmp_path)
    text = tmp_path / "text"
    text.write_text("These are no weights.")
    with pytest.raises(prpf.Error, match="not a file of weights"):
        prpf.use_weights(text)
