import contextlib
import functools
import gc
import os
import shutil
import tempfile
import zlib
from collections import Counter
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import jax
import numpy as np
import pytest
from jax._src import compilation_cache


jax.config.update("jax_enable_x64", True)
jax.config.update("jax_numpy_rank_promotion", "raise")
jax.config.update("jax_numpy_dtype_promotion", "strict")
os.environ.setdefault("MPLBACKEND", "Agg")
os.environ.pop("COLUMNS", None)  # of pytest-xdist: commands are as wide as where they write into a file


MAPS = Path("/proc/self/maps")
MOST_MAPS = 55_000  # Linux allows a process 65 530; a program takes 5 to 20, a file of slow tests up to 10 000
MOST_KEPT = 2_000_000_000  # bytes of compiled programs in .pytest_cache

# Programs that a plain test may have compiled: one that needs more computes number by number with `jnp`, each operation
# a program of 15 ms, instead of with NumPy or in one `jax.jit`. Those that need more for what they show are named, and
# the command of the whole chain, whose number is never raised.
MOST_PROGRAMS = 200
MORE_PROGRAMS = {
    "test_contract": 375,
    "test_steps_are_divided_alike_however_a_number_is_traced": 270,
    "test_what_is_no_argument_of_a_compiled_function_is_known_inside": 240,
    "test_hysteresis_is_told_from_a_delay_by_several_records": 210,
    "test_a_vehicle_of_parts_and_one_with_everything_come_back": 210,
    "test_the_use_of_a_damper_is_shaded": 210,
    "test_a_test_of_many_small_programs_fails": 3,
    "test_the_chain_is_on_one_page_with_its_files": 60,
}
COMPILED = "/jax/core/compile/backend_compile_duration"
compiled: Counter[str] = Counter()
jax.monitoring.register_event_duration_secs_listener(lambda event, *_, **__: compiled.update([event]))


# Traced programs are millions of objects: looking for cycles among the last hundred thousand takes a tenth of a second,
# among all of them seconds.
gc.set_threshold(1_000_000, 20, 100)


def pytest_configure(config: pytest.Config) -> None:
    """Keep compiled programs between runs: the second run of a test takes half the time of the first."""
    if "JAX_COMPILATION_CACHE_DIR" in os.environ or not hasattr(config, "cache"):
        return
    kept = config.cache.mkdir("programs")
    main = not hasattr(config, "workerinput")  # it begins before its workers do
    if main and sum(file.stat().st_size for file in kept.rglob("*")) > MOST_KEPT:
        shutil.rmtree(kept)
        kept.mkdir()
    # JAX does not write these files in one step: each process has a folder of links and hands in what it adds.
    ours = Path(tempfile.mkdtemp(dir=kept.parent))
    _link(kept, ours)
    jax.config.update("jax_compilation_cache_dir", str(ours))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)
    jax.config.update("jax_persistent_cache_enable_xla_caches", "none")  # their path would be part of every key
    compilation_cache.compress_executable = functools.partial(zlib.compress, level=1)  # in a third of the time
    compilation_cache.decompress_executable = zlib.decompress
    config.stash[FOLDERS] = ours, kept
    config.add_cleanup(lambda: _hand_in(ours, kept))


@pytest.hookimpl(tryfirst=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Look for files left open in cycles once, not at each of four places until the process ends, seconds each."""
    if not hasattr(config, "workerinput"):  # what workers find here, pytest-xdist does not report
        gc.collect()
    gc.freeze()


FOLDERS = pytest.StashKey[tuple[Path, Path]]()
PRINTED = "printed"  # inside: where `jaxdamp.codegen` keeps functions printed as C


def _link(source: Path, target: Path) -> None:
    """Have the files of a folder of programs in another one too."""
    for part in (".", PRINTED):
        here, there = source / part, target / part
        if here.is_dir():
            there.mkdir(mode=0o700, exist_ok=True)
            for name in {*os.listdir(here)}.difference(os.listdir(there), [PRINTED]):
                with contextlib.suppress(FileExistsError):
                    os.link(here / name, there / name)


def _hand_in(ours: Path, kept: Path) -> None:
    _link(ours, kept)
    shutil.rmtree(ours)


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


@pytest.hookimpl(wrapper=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Generator[None, Any, Any]:
    """A plain test that compiles more than its share fails; what its fixtures compile is shared and not counted."""
    before = compiled[COMPILED]
    result = yield
    count = compiled[COMPILED] - before
    test = pyfuncitem.originalname
    plain = not any(pyfuncitem.get_closest_marker(kind) for kind in ("slow", "exhaustive", "notebook"))
    if (plain or test in MORE_PROGRAMS) and count > (most := MORE_PROGRAMS.get(test, MOST_PROGRAMS)):
        pytest.fail(
            f"{test} compiled {count} programs, at most {most}: use NumPy for expected values, one `jax.jit` round "
            "what is computed, a fixture of the module for what several tests need."
        )
    return result


@pytest.fixture(scope="module", autouse=True)
def few_programs(pytestconfig: pytest.Config) -> Iterator[None]:
    """Take what other workers have compiled, and give them what the module has.

    Programs are forgotten before there are so many that the next one crashes the process.
    """
    ours, kept = pytestconfig.stash.get(FOLDERS, (None, None))
    if ours and kept:
        _link(kept, ours)
    yield
    if ours and kept:
        _link(ours, kept)
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
