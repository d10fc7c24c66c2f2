import gc
import os
from collections import Counter
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest


jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")
os.environ.setdefault("MPLBACKEND", "Agg")
# Most of the time goes into compiling, once for each test: compile quickly instead of for speed. With the variable set,
# even to nothing, tests run what users run.
OLD_EMITTERS = ["--xla_cpu_use_fusion_emitters=false"] * (jax.__version_info__ < (0, 11))
os.environ.setdefault("XLA_FLAGS", " ".join(["--xla_backend_optimization_level=0", *OLD_EMITTERS]))


MAPS = Path("/proc/self/maps")
MOST_MAPS = 30_000  # Linux allows a process 65 530, and every compiled program takes a few


# Traced programs are millions of objects, and looking through all of them for cycles takes seconds each time.
gc.set_threshold(100_000, 20, 100)


@pytest.hookimpl(tryfirst=True)  # before the choice by `-m`
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Of the cases of a test, one in n is slow (`slow_one_in`) or some run before a release (`exhaustive_cases`)."""
    cases: Counter[str] = Counter()
    for item in items:
        if mark := item.get_closest_marker("slow_one_in"):
            test = item.nodeid.partition("[")[0]
            item.add_marker("exhaustive" if cases[test] % mark.args[0] else "slow")
            cases[test] += 1
        if (mark := item.get_closest_marker("exhaustive_cases")) and _case(item) in mark.args:
            item.own_markers[:] = [m for m in item.own_markers if m.name != "slow"]
            item.add_marker("exhaustive")


def _case(item: pytest.Item) -> str:
    return item.nodeid.partition("[")[2].removesuffix("]")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Generator[None, Any, Any]:
    """With JAXDAMP_NO_SKIPS set, as in .ci/run, a test that lacks something fails instead of being skipped."""
    report = yield
    if report.skipped and os.environ.get("JAXDAMP_NO_SKIPS") and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = f"{item.nodeid}: {report.longrepr}. Install what is missing: .ci/run leaves out no test."
    return report


@pytest.fixture(scope="module", autouse=True)
def few_programs() -> Iterator[None]:
    """Forget compiled programs before there are so many that the next one crashes the process."""
    yield
    if MAPS.exists() and MAPS.read_bytes().count(b"\n") > MOST_MAPS:
        jax.clear_caches()
        gc.collect()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20240601)


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of measured records; tests that need it skip without it."""
    folder = Path(os.environ.get("JAXDAMP_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no measured data in {folder}: set the environment variable JAXDAMP_DATA")
    return folder
