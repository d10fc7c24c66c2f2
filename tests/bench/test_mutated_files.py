"""Two thousand damaged files over all formats: none ends in a traceback, hangs or takes a gigabyte."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from jaxdamp import roads
from tests.bench.mutated_files import FORMATS


ROOT = Path(__file__).parents[2]


@pytest.mark.slow
@pytest.mark.parametrize("kind", FORMATS)
def test_two_hundred_damaged_files(tmp_path, kind):
    words = [sys.executable, "-W", "ignore", "-m", "tests.bench.mutated_files", kind, "200", str(tmp_path)]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]


@pytest.mark.parametrize("path", ["pipe.csv", "/dev/zero"])
def test_a_pipe_or_a_device_is_no_road(tmp_path, path):
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(ValueError, match="a pipe or a device"):
        roads.read_profile(tmp_path / path, speed=10.0)
