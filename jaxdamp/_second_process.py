"""Processes beside this one, for work that holds Python's lock; forked before JAX computes, so that they are whole.

A command opens them (`opened`) once all is imported and nothing is computed. `anywhere` then computes in one that is
free while this process is busy. Without them everything is computed here.
"""

import atexit
import ctypes
import io
import os
import pickle
import signal
import socket
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, BinaryIO, TypeVar

from jaxdamp._forked import started


T = TypeVar("T")
MOST = 4  # processes, this one too
UNPICKLED = (pickle.PicklingError, AttributeError, TypeError)
DIE_WITH_PARENT = 1  # of Linux: `PR_SET_PDEATHSIG`


class Lost(Exception):
    """A process has ended by itself."""


class Unsent(Exception):
    """A call that cannot be pickled."""


class Process:
    """Another process, which computes what it is told, one call at a time."""

    def __init__(self, pid: int, ends: socket.socket) -> None:
        self.pid, self._ends, self._stream = pid, ends, ends.makefile("rwb")
        self._known: list[object] = []

    def call(self, function: Callable[..., T], arguments: Sequence[object], shared: Sequence[object]) -> T:
        """The result of a function; what it raises is raised.

        Arguments:
            function: one that a module holds by name, or a method of an object that can be pickled.
            arguments: of the function.
            shared: objects inside the arguments that are sent once, and come back as the same objects.

        Raises:
            Lost: the process has ended.
            Unsent: the function or its arguments cannot be pickled.
        """
        new = [thing for thing in shared if not any(thing is known for known in self._known)]
        try:
            content = _pickled(new, ()), _pickled((function, tuple(arguments)), [*self._known, *new])
        except UNPICKLED as error:
            raise Unsent(str(error)) from error
        try:
            for part in content:
                _send(self._stream, part)
            self._known += new
            sound, result = _read(self._stream, self._known)
        except (EOFError, OSError) as error:
            raise Lost(str(error)) from error
        if sound:
            return result
        raise result

    def end(self) -> None:
        """Ask it to end when it is done, and wait for that."""
        try:
            self._ends.shutdown(socket.SHUT_WR)
        except OSError:
            pass  # it has ended
        os.waitpid(self.pid, 0)
        self._ends.close()


class _Shared(pickle.Pickler):
    """Objects that both sides have are written as their numbers."""

    def __init__(self, stream: BinaryIO, known: Sequence[object]) -> None:
        super().__init__(stream, protocol=pickle.HIGHEST_PROTOCOL)
        self._numbers = {id(thing): number for number, thing in enumerate(known)}

    def persistent_id(self, obj: object) -> int | None:
        """The number of an object that both sides have."""
        return self._numbers.get(id(obj))


class _Known(pickle.Unpickler):
    def __init__(self, stream: BinaryIO, known: Sequence[object]) -> None:
        super().__init__(stream)
        self._things = known

    def persistent_load(self, pid: int) -> object:
        """The object of that number."""
        return self._things[pid]


def _pickled(thing: object, known: Sequence[object]) -> bytes:
    stream = io.BytesIO()
    _Shared(stream, known).dump(thing)
    return stream.getvalue()


def _send(stream: BinaryIO, content: bytes) -> None:
    stream.write(len(content).to_bytes(8, "little") + content)
    stream.flush()


def _read(stream: BinaryIO, known: Sequence[object]) -> Any:
    length = stream.read(8)
    content = stream.read(int.from_bytes(length, "little"))
    if len(length) < 8:
        raise EOFError("the other process has ended")
    return _Known(io.BytesIO(content), known).load()


_lock = threading.Lock()
_free: list[Process] = []
_state = {"here": 0, "all": 0}  # calls that are computed in this process; how many processes there are beside it


def count() -> int:
    """How many processes there are beside this one."""
    return _state["all"]


def is_free() -> bool:
    """Whether a process beside this one waits for work."""
    return bool(_free)


def anywhere(function: Callable[..., T], *arguments: object, shared: Sequence[object] = ()) -> T:
    """The result of a function: computed here, or in a process that is free while this one computes.

    Arguments:
        function: as `Process.call`; what cannot be pickled is computed here.
        arguments: of the function.
        shared: as `Process.call`.
    """
    with _lock:
        process = _free.pop() if _state["here"] and _free else None
        _state["here"] += process is None
    if process is not None:
        lost = False
        try:
            return process.call(function, arguments, shared)
        except Unsent:
            pass
        except Lost:
            lost = True
        finally:
            if not lost:
                _free.append(process)
        with _lock:
            _state["here"] += 1
    try:
        return function(*arguments)
    finally:
        with _lock:
            _state["here"] -= 1


@contextmanager
def opened(prepare: Callable[[], object]) -> Iterator[None]:
    """While this lasts, there is a process for each further core; none where it could not be whole.

    That is where JAX has started, and on systems other than Linux, whose libraries do not survive a fork.

    Arguments:
        prepare: called in each of them at its start, in the time in which this one has nothing to tell it.
    """
    cores = min(len(os.sched_getaffinity(0)), MOST) if sys.platform == "linux" else 1
    processes = [] if started() else [_forked(prepare) for _ in range(cores - 1)]
    _free[:], _state["all"] = processes, len(processes)
    try:
        yield
    finally:
        _free.clear()
        _state["all"] = 0
        for process in processes:
            process.end()


def _forked(prepare: Callable[[], object]) -> Process:
    here, there = socket.socketpair()
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        # Of threads, which are those of linear algebra, ended and begun anew by it, and the one that waits for Ctrl-C.
        warnings.simplefilter("ignore", DeprecationWarning)
        pid = os.fork()
    if pid:
        there.close()
        return Process(pid, here)
    here.close()
    code = 1
    try:
        _serve(there.makefile("rwb"), prepare)
        code = 0
    finally:  # never back into the command
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _serve(stream: BinaryIO, prepare: Callable[[], object]) -> None:
    """Compute what comes, until the other side ends."""
    import jax

    signal.set_wakeup_fd(-1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C of a terminal goes to both: the other side decides
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    ctypes.CDLL(None).prctl(DIE_WITH_PARENT, signal.SIGKILL)
    jax.config.update("jax_platforms", "cpu")  # a GPU is the other side's
    prepare()
    known: list[object] = []
    while True:
        try:
            known += _read(stream, ())
            function, arguments = _read(stream, known)
        except EOFError:
            return
        try:
            answer = _pickled((True, function(*arguments)), known)
        except Exception as error:
            answer = _raised(error)
        _send(stream, answer)


def _raised(error: Exception) -> bytes:
    """An error for the other side, with its class where that can be sent."""
    try:
        content = _pickled((False, error), ())
        pickle.loads(content)
    except Exception:
        return _pickled((False, RuntimeError(f"{type(error).__name__}: {error}")), ())
    return content
