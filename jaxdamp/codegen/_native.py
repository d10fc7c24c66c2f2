"""Printed C, compiled by the C compiler of this machine and called by XLA."""

import atexit
import ctypes
import functools
import hashlib
import os
import platform
import shutil
import subprocess
import tempfile
import uuid
from collections.abc import Sequence
from importlib import resources
from pathlib import Path

import jax


# Multiplications and additions are fused as XLA fuses them; sums stay in their order, what is not finite stays so.
_FLAGS = (
    "-std=gnu11 -O3 -march=native -fPIC -shared -w -fopenmp-simd -fno-math-errno -fno-trapping-math -fno-signed-zeros "
    "-freciprocal-math -ffp-contract=fast"
).split()
# Of a fit: little time to compile, derivatives in vectors of the processor.
_PLAIN = (
    "-std=gnu11 -O2 -march=native -fPIC -shared -w -fopenmp-simd -ftree-vectorize -fno-math-errno -fno-trapping-math "
    "-fno-signed-zeros -ffp-contract=fast"
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
def library(text: str) -> ctypes.CDLL:
    """A C text compiled and loaded; kept for other processes beside the compiled programs of JAX, where these are kept.

    The file is named by its text, compiler and processor, and by what it holds, so that another one is never loaded
    for it; the folder must be this user's and closed to others, or else the file is only that of this process.

    Raises:
        NotImplementedError: as `registered`.
    """
    tool = compiled_by()
    own = hashlib.sha256("\n".join([text, tool, *_PLAIN, _processor()]).encode()).hexdigest()[:24]
    try:
        folder = _lasting_folder() or _folder()
        for path in folder.glob(f"fit_{own}_*.so"):
            if path.stem.endswith(hashlib.sha256(path.read_bytes()).hexdigest()[:24]):
                return ctypes.CDLL(str(path))
        draft = folder / f"{own}-{uuid.uuid4().hex}"
        source, target = draft.with_suffix(".c"), draft.with_suffix(".tmp")
        source.write_text(text, encoding="utf-8")
        done = subprocess.run([tool, *_PLAIN, str(source), "-o", str(target), "-lm"], capture_output=True, text=True)
        source.unlink()
        if done.returncode:
            raise NotImplementedError(f"{tool} does not compile the printed functions: {done.stderr.strip()[-2000:]}")
        path = folder / f"fit_{own}_{hashlib.sha256(target.read_bytes()).hexdigest()[:24]}.so"
        target.replace(path)
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise NotImplementedError(f"The printed functions cannot be compiled or loaded here ({error}).") from error


def _lasting_folder() -> Path | None:
    """Beside the compiled programs of JAX, if these are kept, in a folder that only this user can write."""
    kept = getattr(jax.config, "jax_compilation_cache_dir", None)
    if not kept or "://" in kept or not hasattr(os, "getuid"):
        return None
    folder = Path(kept) / "printed"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        state = folder.stat()
    except OSError:
        return None
    return folder if state.st_uid == os.getuid() and not state.st_mode & 0o022 and os.access(folder, os.W_OK) else None


@functools.cache
def _processor() -> str:
    """What the compiler's `-march=native` means: another processor needs another file."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return " ".join(platform.uname())
    kinds = {line for line in lines if line.startswith(("flags", "model name", "Features"))}
    return platform.machine() + " ".join(sorted(kinds))


@functools.cache
def _folder() -> Path:
    """Of this process, removed at its end."""
    folder = Path(tempfile.mkdtemp(prefix="jaxdamp-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@functools.cache
def registered(text: str, *functions: tuple[str, str]) -> str:
    """The name under which XLA calls functions of a C text, compiled once in a process.

    Arguments:
        text: C.
        functions: a platform of XLA, "cpu" or "CUDA", and the function for it; `loop` on "cpu" if there are none.

    Raises:
        NotImplementedError: no C compiler, or one that refuses the text; no room for temporary files, or none from
            which programs may run. The message holds what was said.
    """
    tool = compiled_by()
    try:
        return _compiled(tool, text, functions or (("cpu", "loop"),))
    except OSError as error:
        remedy = "Name another folder for temporary files, from which programs may run, in the variable TMPDIR."
        raise NotImplementedError(f"The printed loop cannot be compiled or loaded here ({error}). {remedy}") from error


def _compiled(tool: str, text: str, functions: Sequence[tuple[str, str]]) -> str:
    """Compile a text, load it and tell XLA the name of its functions."""
    own = f"jaxdamp_loop_{hashlib.sha256(text.encode()).hexdigest()[:20]}"
    source, target = _folder() / f"{own}.c", _folder() / f"{own}.so"
    source.write_text(text, encoding="utf-8")
    headers = ["-I", jax.ffi.include_dir(), "-I", str(resources.files("jaxdamp.codegen"))]
    where = [*headers, str(source), "-o", str(target)]
    for flags, libraries in (([*_FLAGS, *_WIDE], ["-lmvec", "-lm", "-ldl"]), (_FLAGS, ["-lm"])):
        done = subprocess.run([tool, *flags, *where, *libraries], capture_output=True, text=True)
        if done.returncode == 0:
            library = ctypes.CDLL(str(target))
            for platform, function in functions:
                jax.ffi.register_ffi_target(own, jax.ffi.pycapsule(getattr(library, function)), platform=platform)
            return own
    raise NotImplementedError(f"{tool} does not compile the printed loop: {done.stderr.strip()[-2000:]}")
