"""The stubs say what the package has."""

import subprocess
import sys

import pytest


def test_the_stubs_are_those_of_the_package():
    pytest.importorskip("mypy")
    checked = subprocess.run([sys.executable, "-m", "mypy.stubtest", "prpf"], capture_output=True, text=True)
    assert checked.returncode == 0, checked.stdout
