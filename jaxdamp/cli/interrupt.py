"""Ctrl-C or SIGTERM: a command stops between two computations and keeps what is finished, a second time at once.

Python's own `KeyboardInterrupt` may be raised inside a callback of XLA or while a module is loading, and has crashed
the process from there. So while a command runs, Ctrl-C only wakes a thread. That thread ends the process at once as
long as nothing is finished that would be worth keeping. Afterwards it sets a flag, which the stages of the work look at
between two computations (`check`), and only a second Ctrl-C ends the process at once.
"""

import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager


SIGNALS = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}  # and what Python does with them
SHOW_CURSOR = "\x1b[?25h"


class Interrupted(BaseException):
    """A command was stopped between two computations; the message says what was written and what was not.

    No `Exception`, so that what goes on after an error does not go on after Ctrl-C.
    """


class _Watch:
    """What one process knows of Ctrl-C."""

    def __init__(self) -> None:
        self.asked = False  # to stop at the next place
        self.number = int(signal.SIGINT)  # of the signal that asked
        self.worth_keeping = False
        self.saving = False  # what is finished is being written
        self.closing: list[Callable[[], str]] = []  # tidy up, and say what is there
        self.busy = threading.RLock()  # held while files are moved into place

    def pressed(self, number: int) -> None:
        """Ctrl-C was pressed, or the process is to end. Called by the watching thread."""
        self.number = number
        if self.worth_keeping and not self.asked:
            self.asked = True
            again = " Ctrl-C again: at once." if number == signal.SIGINT else ""
            _say(f"\nStopping as soon as this computation is done, to keep what is finished.{again}")
            return
        with self.busy:
            remaining = " ".join(text for text in (tidy() for tidy in reversed(self.closing)) if text)
            _say(f"\nStopped. {remaining or 'Nothing was written.'}")
            os._exit(exit_code())


_watch = _Watch()


def exit_code() -> int:
    """Of a command that was stopped, as shells have it: 130 after Ctrl-C, 143 after SIGTERM."""
    return 128 + _watch.number


def check() -> None:
    """End the work here if Ctrl-C was pressed. To be called between computations, never inside one."""
    if _watch.asked and not _watch.saving:
        raise Interrupted


@contextmanager
def saving() -> Iterator[None]:
    """What is finished is written here: no `check` stops it."""
    _watch.saving = True
    try:
        yield
    finally:
        _watch.saving = False


def keep() -> None:
    """From here on something is finished: Ctrl-C waits for the next `check`."""
    _watch.worth_keeping = True


@contextmanager
def closing(tidy: Callable[[], str]) -> Iterator[None]:
    """While this lasts, a sudden end of the process calls a function, which tidies up and says what is left."""
    _watch.closing.append(tidy)
    try:
        yield
    finally:
        _watch.closing.remove(tidy)


def undisturbed() -> AbstractContextManager[object]:
    """Files are moved into place here: a sudden end of the process waits."""
    return _watch.busy


@contextmanager
def watched(then: Callable[..., object] | signal.Handlers = signal.default_int_handler) -> Iterator[None]:
    """Take over Ctrl-C and SIGTERM while this lasts.

    Nothing changes where a command is called from a program that handles Ctrl-C itself, from another thread than the
    first, or from a command; a signal that is ignored, as Ctrl-C is by what a shell script starts with `&`, stays so.

    Arguments:
        then: what answers Ctrl-C afterwards.
    """
    first = threading.current_thread() is threading.main_thread()
    ours = [number for number, default in SIGNALS.items() if signal.getsignal(number) is default]
    ours *= signal.getsignal(signal.SIGINT) in (signal.default_int_handler, signal.SIG_IGN)
    if not first or not ours:
        yield
        return
    _watch.asked = _watch.worth_keeping = _watch.saving = False
    ears, mouth = socket.socketpair()
    mouth.setblocking(False)
    for number in ours:
        signal.signal(number, lambda number, frame: None)  # the thread answers, at once and not between bytecodes
    before = signal.set_wakeup_fd(mouth.fileno(), warn_on_full_buffer=False)
    thread = threading.Thread(target=_listen, args=(ears,), name="Ctrl-C", daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        for number in ours:
            signal.signal(number, then if number == signal.SIGINT else SIGNALS[number])
        mouth.close()
        thread.join()
        ears.close()


def _listen(ears: socket.socket) -> None:
    """Wait for signals until the other end is closed."""
    while numbers := ears.recv(64):
        for number in numbers:
            if number in SIGNALS:
                _watch.pressed(number)


def _say(text: str) -> None:
    """Write to the terminal although another thread may be writing too; give back the cursor that a bar had hidden."""
    if sys.stderr.isatty():
        text = SHOW_CURSOR + text
    os.write(2, f"{text}\n".encode(errors="replace"))
