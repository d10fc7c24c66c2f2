"""What a new process needs until its first result: counted, not timed."""

import subprocess
import sys

import pytest

from benchmarks.first_result import COMMAND, COUNTED, FIT, cost, dyno_file


SLOW_IMPORTS = ("scipy.signal", "scipy.stats", "scipy.interpolate", "xarray", "pandas", "matplotlib")


@pytest.mark.slow
def test_all_laws_need_few_programs(tmp_path) -> None:
    """At most 15 of XLA in all processes of a command; the forces are printed as C."""
    words = ["fit", dyno_file(str(tmp_path)), "--sign", "rebound-positive", "--law", "all"]
    words += ["--out", str(tmp_path / "out")]
    _, _, programs = cost(COUNTED + COMMAND.format(words=words), str(tmp_path / "cache"))
    assert 0 < int(programs) <= 15


@pytest.mark.slow
@pytest.mark.parametrize(
    "script",
    [
        FIT.format(cache=False, file="{file}"),
        "import jaxdamp.cli.fitting, jaxdamp.cli.chaining, jaxdamp.cli.tuning, jaxdamp.cli.riding",
    ],
    ids=["a first fit", "the commands"],
)
def test_what_takes_long_to_import_is_not_needed(tmp_path, script) -> None:
    """Each of these takes as long as a fit."""
    text = (
        script.replace("{file}", dyno_file(str(tmp_path))) + f"\nprint([n for n in {SLOW_IMPORTS} if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", f"import sys\n{text}"], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
