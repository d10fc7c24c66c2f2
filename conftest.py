"""Runs the examples of the README, of docs/ and of every docstring as tests, and has all tests compile quickly.

Examples that begin with `jaxdamp.configure()` run beside others in one process, which has started: there the call only
switches on double precision. `tests/test_configuration.py` makes it in processes of its own.
"""

import contextlib
import io
import json
import os
import threading
from collections.abc import Callable
from pathlib import Path

import jax
import numpy as np
import pytest
from jax._src.interpreters import mlir
from jaxlib.mlir import ir
from sybil import Example, Sybil
from sybil.evaluators.python import PythonEvaluator
from sybil.parsers.doctest import DocTestParser
from sybil.parsers.markdown import CodeBlockParser, PythonCodeBlockParser, SkipParser


EXAMPLES = Path(__file__).parent / "build" / "examples"

# Most of the time goes into compiling, once for each test: compile quickly instead of for speed. With the variable set,
# even to nothing, tests run what users run.
QUICKLY = [
    "--xla_backend_optimization_level=0",
    "--xla_cpu_parallel_codegen_split_count=1",  # parts of a program repeat what they share: a quarter of large ones
    "--xla_disable_hlo_passes=hlo-verifier",  # looks for errors of the compiler itself after each step: a twelfth
    *["--xla_cpu_use_fusion_emitters=false"] * (jax.__version_info__ < (0, 11)),
]
os.environ.setdefault("XLA_FLAGS", " ".join(QUICKLY))
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of workers, as many as cores: more threads wait for one another
# Without the lines of Python that each operation comes from, which no test reads and which take time.
jax.config.update("jax_traceback_in_locations_limit", 0)
jax.config.update("jax_include_full_tracebacks_in_locations", False)

CONTEXT = threading.local()
PROGRAMS_OF_A_CONTEXT = 50  # each keeps the constants of its programs


def _shared(make: Callable[[], ir.Context]) -> Callable[[], ir.Context]:
    """JAX before 0.12 makes a context of MLIR for each program, which takes milliseconds: make one for several."""

    def context() -> ir.Context:
        if _is_in_use():
            return make()
        if not getattr(CONTEXT, "left", 0):
            CONTEXT.current, CONTEXT.left = make(), PROGRAMS_OF_A_CONTEXT
        CONTEXT.left -= 1
        return CONTEXT.current

    return context


def _is_in_use() -> bool:
    """Whether one program is made within another one, which needs a context of its own."""
    try:
        return ir.Context.current is not None
    except ValueError:
        return False


if jax.__version_info__ < (0, 12):
    mlir.make_ir_context = _shared(mlir.make_ir_context)


def _prepare(namespace: dict) -> None:
    import jaxdamp

    namespace["configure, as it is"] = jaxdamp.configure
    jaxdamp.configure = lambda **_: None
    namespace["promotion, as it is"] = jax.config.jax_numpy_dtype_promotion
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_numpy_dtype_promotion", "standard")  # as readers have it; optax needs it
    np.set_printoptions(precision=6, suppress=True)


def _tidy(namespace: dict) -> None:
    import jaxdamp

    jaxdamp.configure = namespace["configure, as it is"]
    jax.config.update("jax_numpy_dtype_promotion", namespace["promotion, as it is"])


class _Printing(PythonEvaluator):
    """Runs a block of a page, and keeps what it prints for the site (`docs/_examples.py`)."""

    def __call__(self, example: Example) -> None:
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            super().__call__(example)
        if printed.getvalue():
            file = EXAMPLES / f"{Path(example.path).stem}.json"
            kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
            EXAMPLES.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(kept | {example.parsed.strip(): printed.getvalue()}), encoding="utf-8")


class _Blocks(PythonCodeBlockParser):
    def __init__(self) -> None:
        super().__init__()
        self.codeblock_parser = CodeBlockParser("python", _Printing())


_collect = (
    Sybil(parsers=[_Blocks(), SkipParser()], patterns=["*.md"], setup=_prepare, teardown=_tidy)
    + Sybil(parsers=[DocTestParser()], patterns=["jaxdamp/**/*.py", "jaxdamp/*.py"], setup=_prepare, teardown=_tidy)
).pytest()


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Examples of pages and docstrings; a module without one is not parsed, which takes seconds for all."""
    if file_path.suffix == ".py" and ">>>" not in file_path.read_text(encoding="utf-8"):
        return None
    return _collect(file_path, parent)
