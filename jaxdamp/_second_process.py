"""Processes beside this one, for work that holds Python's lock; forked before JAX computes, so that they are whole.

A command opens them (`opened`) once all is imported and nothing is computed. `anywhere` then computes in one that is
free while this process is busy. Without them everything is computed here.
"""

import atexit
import ctypes
import functools
import io
import os
import pickle
import select
import signal
import socket
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import IO, Generic, NoReturn, TypeAlias, TypeVar, cast

from jaxdamp._forked import started
from jaxdamp._one_thread import usable_cores


T = TypeVar("T")
MOST = 4  # processes, this one too
PATIENCE = 1.0  # s to put things in order at the end
_Call: TypeAlias = tuple[Callable[..., object], tuple[object, ...]]
UNPICKLED = (pickle.PicklingError, AttributeError, TypeError)
HEARD = {signal.SIGINT, signal.SIGTERM}
DIE_WITH_PARENT = 1  # of Linux: `PR_SET_PDEATHSIG`


class Lost(Exception):
    """A process has ended by itself."""


class Unsent(Exception):
    """A call that cannot be pickled."""


class Process:
    """Another process, which computes what it is told, one call at a time."""

    def __init__(self, pid: int, ends: socket.socket) -> None:
        self.pid, self._ends, self._stream = pid, ends, ends.makefile("rwb")
        self._sent: list[object] = []

    def begin(self, function: Callable[..., object], arguments: Sequence[object], shared: Sequence[object]) -> None:
        """Tell it to compute.

        Arguments:
            function: one that a module holds by name, or a method of an object that can be pickled.
            arguments: of the function.
            shared: objects inside the arguments that are sent once, and come back as the same objects.

        Raises:
            Unsent: the function or its arguments cannot be pickled.
        """
        new = [thing for thing in shared if not any(thing is sent for sent in self._sent)]
        try:
            content = _pickled(new, ()), _pickled((function, tuple(arguments)), [*self._sent, *new])
        except UNPICKLED as error:
            raise Unsent(str(error)) from error
        self._sent += new
        try:
            for part in content:
                _send(self._stream, part)
        except OSError:
            pass  # it has ended, which `result` says

    def result(self) -> tuple[bool, object]:
        """Whether the function raised nothing, and its result or what it raised.

        Raises:
            Lost: the process has ended.
        """
        try:
            return cast(tuple[bool, object], _read(self._stream, self._sent))
        except (EOFError, OSError) as error:
            raise Lost(str(error)) from error

    def has_result(self) -> bool:
        """Whether it has something to say."""
        return bool(select.select([self._ends], [], [], 0.0)[0])

    def end(self) -> None:
        """End it, and wait for that; what it still computes is not wanted."""
        try:
            self._ends.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass  # it has ended
        os.kill(self.pid, signal.SIGTERM)  # until it is waited for, the number is its own
        patience = time.monotonic() + PATIENCE
        while not os.waitpid(self.pid, os.WNOHANG)[0]:
            if time.monotonic() > patience:  # such as in a compiler, which hears nothing
                os.kill(self.pid, signal.SIGKILL)
                os.waitpid(self.pid, 0)
                break
            time.sleep(0.002)
        self._stream.close()
        self._ends.close()


class _Shared(pickle.Pickler):
    """Objects that both sides have are written as their numbers."""

    def __init__(self, stream: IO[bytes], shared: Sequence[object]) -> None:
        super().__init__(stream, protocol=pickle.HIGHEST_PROTOCOL)
        self._numbers = {id(thing): number for number, thing in enumerate(shared)}

    def persistent_id(self, obj: object) -> int | None:
        """The number of an object that both sides have."""
        return self._numbers.get(id(obj))


class _Known(pickle.Unpickler):
    def __init__(self, stream: IO[bytes], shared: Sequence[object]) -> None:
        super().__init__(stream)
        self._things = shared

    def persistent_load(self, pid: int) -> object:
        """The object of that number."""
        return self._things[pid]


def _pickled(thing: object, shared: Sequence[object]) -> bytes:
    stream = io.BytesIO()
    _Shared(stream, shared).dump(thing)
    return stream.getvalue()


def _send(stream: io.BufferedRWPair, content: bytes) -> None:
    stream.write(len(content).to_bytes(8, "little") + content)
    stream.flush()


def _read(stream: io.BufferedRWPair, shared: Sequence[object]) -> object:
    length = stream.read(8)
    content = stream.read(int.from_bytes(length, "little"))
    if len(length) < 8:
        raise EOFError("the other process has ended")
    return _Known(io.BytesIO(content), shared).load()


_lock = threading.Lock()
_all: list[Process] = []
_free: list[Process] = []
_here = [0]  # calls of `anywhere` that are computed in this process


def count() -> int:
    """How many processes there are beside this one."""
    return len(_all)


class Waiting(Generic[T]):
    """What another process computes."""

    def __init__(self, process: Process, compute: Callable[[], T]) -> None:
        self._process, self._compute = process, compute
        self._answer: tuple[bool, object] | None = None

    def __call__(self) -> T:
        """The result, once it is there; what the function raised is raised."""
        self.settle()
        assert self._answer is not None
        sound, result = self._answer
        if sound:
            return cast(T, result)
        raise cast(Exception, result)

    def settle(self, *, if_ready: bool = False) -> None:
        """Read the result, so that the process is free; it is computed here where the process has ended."""
        if self._answer is not None or (if_ready and not self._process.has_result()):
            return
        try:
            self._answer = self._process.result()
            _release(self._process)
        except Lost:
            self._answer = True, self._compute()


_begun_elsewhere: list[Waiting] = []


def _begun(
    process: Process, function: Callable[..., T], arguments: Sequence[object], shared: Sequence[object]
) -> Waiting[T] | None:
    """None where it cannot be sent."""
    try:
        process.begin(function, arguments, shared)
    except Unsent:
        _release(process)
        return None
    return Waiting(process, functools.partial(function, *arguments))


def _release(process: Process) -> None:
    with _lock:
        _free.append(process)


def _taken() -> Process | None:
    """A process that has nothing to do."""
    with _lock:
        return _free.pop() if _free else None


def anywhere(function: Callable[..., T], *arguments: object, shared: Sequence[object] = ()) -> T:
    """The result of a function: computed here, or in a process that is free while another call is computed here.

    Arguments:
        function: as `Process.begin`; what cannot be pickled is computed here.
        arguments: of the function.
        shared: as `Process.begin`.
    """
    process = _taken() if _here[0] else None
    waiting = _begun(process, function, arguments, shared) if process is not None else None
    if waiting is not None:
        return waiting()
    with _lock:
        _here[0] += 1
    try:
        return function(*arguments)
    finally:
        with _lock:
            _here[0] -= 1


def elsewhere(function: Callable[..., T], *arguments: object, shared: Sequence[object] = ()) -> Callable[[], T] | None:
    """Begin to compute in another process; what is returned waits for the result. None where none is free.

    Arguments:
        function: as `Process.begin`; what cannot be pickled is not computed.
        arguments: of the function.
        shared: as `Process.begin`.
    """
    for each in _begun_elsewhere:
        each.settle(if_ready=True)
    process = _taken()
    waiting = _begun(process, function, arguments, shared) if process is not None else None
    if waiting is not None:
        _begun_elsewhere.append(waiting)
    return waiting


@contextmanager
def opened(prepare: Callable[[], object]) -> Iterator[None]:
    """While this lasts, there is a process for each further core; none where it could not be whole.

    That is where JAX has started, and on systems other than Linux, whose libraries do not survive a fork.

    Arguments:
        prepare: called in each of them at its start, in the time in which this one has nothing to tell it.
    """
    cores = min(usable_cores(), MOST) if sys.platform == "linux" else 1
    _all[:] = [] if started() else [_forked(prepare) for _ in range(cores - 1)]
    _free[:] = _all
    try:
        yield
    finally:
        ending = [*_all]
        for each in (_free, _all, _begun_elsewhere):
            each.clear()
        for process in ending:
            process.end()


def _forked(prepare: Callable[[], object]) -> Process:
    here, there = socket.socketpair()
    sys.stdout.flush()
    sys.stderr.flush()
    with warnings.catch_warnings():
        # Of threads, which are those of linear algebra, ended and begun anew by it, and the one that waits for Ctrl-C.
        warnings.simplefilter("ignore", DeprecationWarning)
        # What the new process hears before it listens for itself would be told to the thread of this one.
        mask, pid = signal.pthread_sigmask(signal.SIG_BLOCK, HEARD), -1
        try:
            pid = os.fork()
        finally:
            if pid:
                signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    if pid:
        there.close()
        return Process(pid, here)
    code = 1
    try:
        signal.set_wakeup_fd(-1)
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C of a terminal goes to both: the other side decides
        sys.unraisablehook = _ended_in_callback
        signal.signal(signal.SIGTERM, lambda number, frame: sys.exit())
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        here.close()
        _serve(there.makefile("rwb"), prepare)
        code = 0
    finally:  # never back into the command
        _end(code)


def _end(code: int) -> NoReturn:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _ended_in_callback(unraisable: "sys.UnraisableHookArgs") -> None:
    """Python drops what is raised in a `__del__` or in the callback of a weak reference, the end of a process too."""
    if issubclass(unraisable.exc_type, SystemExit):
        _end(1)
    sys.__unraisablehook__(unraisable)


def _serve(stream: io.BufferedRWPair, prepare: Callable[[], object]) -> None:
    """Compute what comes, until the other side ends."""
    import jax

    ctypes.CDLL(None).prctl(DIE_WITH_PARENT, signal.SIGKILL)
    jax.config.update("jax_platforms", "cpu")  # a GPU is the other side's
    prepare()
    shared: list[object] = []
    while True:
        try:
            shared += cast(list[object], _read(stream, ()))
            function, arguments = cast(_Call, _read(stream, shared))
        except (EOFError, OSError):
            return
        try:
            answer = _pickled((True, function(*arguments)), shared)
        except Exception as error:
            answer = _raised(error)
        try:
            _send(stream, answer)
        except OSError:
            return


def _raised(error: Exception) -> bytes:
    """An error for the other side, with its class where that can be sent."""
    try:
        content = _pickled((False, error), ())
        pickle.loads(content)
    except Exception:
        return _pickled((False, RuntimeError(f"{type(error).__name__}: {error}")), ())
    return content
