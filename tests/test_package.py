"""The front door: what the package lists, its version, and how fast it opens."""

import subprocess
import sys
from importlib.metadata import version

import pytest

import jaxdamp


def test_everything_public_is_listed_and_there() -> None:
    listed = dir(jaxdamp)
    assert {"bench", "identify", "tune", "sweep", "plots", "export", "__version__"} <= set(listed)
    assert not {"Any", "TYPE_CHECKING", "import_module"} & set(listed)
    assert all(getattr(jaxdamp, name) is not None for name in jaxdamp.__all__)


def test_the_version_is_that_of_the_installed_package() -> None:
    assert jaxdamp.__version__ == version("jaxdamp")


def test_other_names_are_missing_as_usual() -> None:
    with pytest.raises(AttributeError, match="module 'jaxdamp' has no attribute 'tun'"):
        jaxdamp.tun  # noqa: B018


def test_the_command_line_answers_without_loading_jax() -> None:
    """Completion calls the program at every key; `python -m jaxdamp` is the same program."""
    code = (
        "import runpy, sys\n"
        "sys.argv = ['jaxdamp', '--version']\n"
        "try:\n    runpy.run_module('jaxdamp', run_name='__main__')\n"
        "except SystemExit as end:\n    assert not end.code\n"
        "assert 'jax' not in sys.modules and 'numpy' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, timeout=120, capture_output=True, text=True)
    assert done.stdout == f"jaxdamp {version('jaxdamp')}\n"
