"""Printed C, compiled by the C compiler of this machine and called by XLA."""

import atexit
import ctypes
import functools
import hashlib
import os
import shutil
import subprocess
import tempfile
from importlib import resources
from pathlib import Path

import jax


# Multiplications and additions are fused as XLA fuses them; sums stay in their order, what is not finite stays so.
_FLAGS = (
    "-std=gnu11 -O3 -march=native -fPIC -shared -w -fopenmp-simd -fno-math-errno -fno-trapping-math -fno-signed-zeros "
    "-freciprocal-math -ffp-contract=fast"
).split()
_WIDE = ("-mprefer-vector-width=512", "-mrecip")  # of gcc for x86


def compiler() -> str | None:
    """The C compiler: the environment variable `CC`, or gcc, clang, cc on the path; None without one."""
    chosen = os.environ.get("CC", "").split()
    return next(filter(None, map(shutil.which, [*chosen[:1], "gcc", "clang", "cc"])), None)


def compiled_by() -> str:
    """The path of the C compiler.

    Raises:
        NotImplementedError: there is none.
    """
    tool = compiler()
    if tool is None:
        raise NotImplementedError("No C compiler is at hand. Install gcc or clang, or name one in the variable CC.")
    return tool


@functools.cache
def _folder() -> Path:
    """Of this process, removed at its end."""
    folder = Path(tempfile.mkdtemp(prefix="jaxdamp-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@functools.cache
def registered(text: str, platform: str = "cpu", name: str = "") -> str:
    """The name under which XLA calls the function `loop` of a C text, compiled once in a process.

    Arguments:
        text: C.
        platform: of XLA, "cpu" or "CUDA".
        name: another one than that made from the text, under which another platform has the same function.

    Raises:
        NotImplementedError: no C compiler, or one that refuses the text; no room for temporary files, or none from
            which programs may run. The message holds what was said.
    """
    tool = compiled_by()
    try:
        return _compiled(tool, text, platform, name)
    except OSError as error:
        remedy = "Name another folder for temporary files, from which programs may run, in the variable TMPDIR."
        raise NotImplementedError(f"The printed loop cannot be compiled or loaded here ({error}). {remedy}") from error


def _compiled(tool: str, text: str, platform: str, name: str) -> str:
    """Compile a text, load it and tell XLA its name."""
    own = f"jaxdamp_loop_{hashlib.sha256(text.encode()).hexdigest()[:20]}"
    source, target = _folder() / f"{own}.c", _folder() / f"{own}.so"
    source.write_text(text, encoding="utf-8")
    headers = ["-I", jax.ffi.include_dir(), "-I", str(resources.files("jaxdamp.codegen"))]
    where = [*headers, str(source), "-o", str(target)]
    for flags, libraries in (([*_FLAGS, *_WIDE], ["-lmvec", "-lm", "-ldl"]), (_FLAGS, ["-lm"])):
        done = subprocess.run([tool, *flags, *where, *libraries], capture_output=True, text=True)
        if done.returncode == 0:
            function = ctypes.CDLL(str(target)).loop
            jax.ffi.register_ffi_target(name or own, jax.ffi.pycapsule(function), platform=platform)
            return name or own
    raise NotImplementedError(f"{tool} does not compile the printed loop: {done.stderr.strip()[-2000:]}")
