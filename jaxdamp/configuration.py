"""`configure`: set up JAX for this work in one explicit call, before it starts."""

import functools
import os
from contextlib import AbstractContextManager
from pathlib import Path
from typing import NamedTuple

import jax

from jaxdamp import _checks
from jaxdamp._files import cache_home
from jaxdamp._forked import started
from jaxdamp._one_thread import usable_cores
from jaxdamp.codegen import is_printing, is_printing_vectors


# A loop whose body touches fewer bytes than the threshold is compiled as one function; XLA's own threshold is 1 kB.
_FUSED = "xla_cpu_small_while_loop_byte_threshold=16777216"
_WIDE = "--xla_cpu_prefer_vector_width=512"
_WORTH_KEEPING = 0.2  # s: what compiles in less is not written to the cache


class Configuration(NamedTuple):
    """What `configure` has set, in force for this process."""

    x64: bool
    cpu_devices: int
    fused_loops: bool
    cache: Path | None

    def __repr__(self) -> str:
        bits = "64-bit" if self.x64 else "32-bit"
        plural = "" if self.cpu_devices == 1 else "s"
        loops = "compiled as one function" if self.fused_loops else "as JAX compiles them"
        storage = f"kept in {self.cache}" if self.cache else "not kept"
        return f"jaxdamp: {bits} floats, {self.cpu_devices} CPU device{plural}, loops {loops}, compiled code {storage}."


def configure(
    *,
    x64: bool = True,
    cpu_devices: int | None = None,
    fused_loops: bool = True,
    cache: bool | str | Path = True,
) -> Configuration:
    """Set up JAX for suspension work; call it first, before anything is computed.

    Everything works without it, more slowly and in single precision: rides and optima are right to about 0.1 %, on a
    GPU to about 1 %, but standard errors of fits with many parameters are rough. Importing jaxdamp changes nothing;
    this call changes settings of the whole process:

    - `x64`: numbers of 64 bits. Laws and vehicles made before keep their 32 bits.
    - `cpu_devices`: the processor is shown to JAX as so many devices, which `sweep` uses side by side.
    - `fused_loops`: XLA compiles every small loop over time as one function (XLA option
      `xla_cpu_small_while_loop_byte_threshold`, 16 MiB) with vectors of 512 bits where the processor has them. One car
      runs ten times as fast, a sweep three times.
    - In single precision a GPU multiplies matrices with all 24 bits, not with the 11 that JAX gives it (TF32), unless
      `jax_default_matmul_precision` says something else.
    - `cache`: compiled programs that took more than 0.2 s are kept in a folder, for the next process.

    A second call with the same settings does nothing, so that a notebook cell can be run again.

    Arguments:
        x64: compute in double precision.
        cpu_devices: number of CPU devices; one for each core if left out.
        fused_loops: compile small loops as one function.
        cache: whether to keep compiled programs, or the folder to keep them in; `~/.cache/jaxdamp` (under
            `XDG_CACHE_HOME`) if True.

    Returns:
        What is in force; it prints as a sentence.

    Raises:
        ValueError: a number of devices below one.
        RuntimeError: devices or loops would change, but JAX has started.
    """
    devices = usable_cores() if cpu_devices is None else cpu_devices
    if devices < 1:
        _checks.refuse("cpu_devices", "be one or more", devices)
    if started():
        _refuse_change(devices, fused_loops)
    else:
        jax.config.update("jax_num_cpu_devices", devices)
        os.environ["XLA_FLAGS"] = _with_option(os.environ.get("XLA_FLAGS", ""), fused_loops)
    jax.config.update("jax_enable_x64", x64)
    if not x64 and jax.config.jax_default_matmul_precision is None:  # pyright: ignore[reportAttributeAccessIssue]
        jax.config.update("jax_default_matmul_precision", "highest")
    folder = _folder(cache)
    jax.config.update("jax_compilation_cache_dir", str(folder) if folder else None)
    if folder:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", _WORTH_KEEPING)
    return Configuration(x64, devices, fused_loops, folder)


class Target(NamedTuple):
    """What functions are compiled for.

    Attributes:
        fused_loops: XLA compiles loops over time as one function.
        reciprocal_roots: the device has an instruction for many 1/√x at a time (AVX-512); XLA then starts from it.
        library_functions: exponentials and logarithms are those of the compiler's own library, one number at a time:
            fastest for one car, and in printed C (`jaxdamp.codegen`).
        library_powers: powers too; of many cars side by side they are exponentials of logarithms.
    """

    fused_loops: bool
    reciprocal_roots: bool
    library_functions: bool = False
    library_powers: bool = False


# One car on a processor of any kind, with the elementary functions of the C library.
_PRINTED = Target(fused_loops=False, reciprocal_roots=False, library_functions=True, library_powers=True)
# Part of the key of compiled functions: what was traced for one target is not taken for another.
_OTHER_TARGET = jax.make_user_context(None)


def one_at_a_time() -> AbstractContextManager[None]:
    """Functions traced inside are for one car: they take the library's elementary functions."""
    return _OTHER_TARGET(target()._replace(library_functions=True, library_powers=True))


def target() -> Target:
    """What the function that is being traced is compiled for; by default this process, see `_this_process`."""
    if is_printing():
        vectors = is_printing_vectors()  # in which likely steps of searches are written out
        return _PRINTED._replace(library_powers=not vectors, fused_loops=vectors)
    return _OTHER_TARGET.value or _this_process()


@functools.cache
def _this_process() -> Target:
    """Looked up once, which starts JAX.

    From then on nothing of it can change, so that all functions compiled in this process agree on it.
    """
    on_cpu, info = jax.default_backend() == "cpu", Path("/proc/cpuinfo")
    wide = info.exists() and "avx512f" in info.read_text()
    return Target(_fuses_loops(), wide or not on_cpu)


def _fuses_loops() -> bool:
    """Whether XLA has been told to compile loops over time as one function."""
    return _FUSED in os.environ.get("XLA_FLAGS", "")


def _devices() -> int:
    """The number of CPU devices that JAX has or will have; −1 if nobody has said one."""
    return jax.config.jax_num_cpu_devices  # pyright: ignore[reportAttributeAccessIssue]


def _refuse_change(devices: int, fused_loops: bool) -> None:
    """Devices and loops are fixed once JAX has started: refuse others than those in force."""
    now = max(_devices(), 1)
    wrong = [f"cpu_devices={devices} (now {now})"] * (devices != now)
    wrong += [f"fused_loops={fused_loops} (now {_fuses_loops()})"] * (fused_loops != _fuses_loops())
    if wrong:
        raise RuntimeError(
            f"`jaxdamp.configure` comes too late: JAX has started, and {' and '.join(wrong)} cannot be changed any "
            "more. Restart Python (in a notebook: restart the kernel) and call it right after `import jaxdamp`, "
            "before anything is computed."
        )


def _with_option(flags: str, fused_loops: bool) -> str:
    """The flags of XLA with or without the options for loops; those of others stay."""
    extra = "--xla_backend_extra_options="
    others = [flag for flag in flags.split() if flag != _WIDE]
    backend = [part for flag in others if flag.startswith(extra) for part in flag.removeprefix(extra).split(",")]
    backend = [part for part in backend if part != _FUSED] + [_FUSED] * fused_loops
    others = [flag for flag in others if not flag.startswith(extra)]
    return " ".join(others + [extra + ",".join(backend)] * bool(backend) + [_WIDE] * fused_loops)


def _folder(cache: bool | str | Path) -> Path | None:
    if cache is False:
        return None
    if cache is not True:
        return Path(cache).expanduser()
    return cache_home()
