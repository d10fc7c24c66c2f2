"""Ctrl-C: a command stops between two computations and keeps what is finished, or at once if it is pressed again.

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
from contextlib import contextmanager
from typing import Any


EXIT_CODE = 130  # 128 + SIGINT, as shells have it
SHOW_CURSOR = "\x1b[?25h"


class Interrupted(BaseException):
    """A command was stopped between two computations; the message says what was written and what was not.

    No `Exception`, so that what goes on after an error does not go on after Ctrl-C.
    """


class _Watch:
    """What one process knows of Ctrl-C."""

    def __init__(self) -> None:
        self.asked = False  # to stop at the next place
        self.worth_keeping = False
        self.saving = False  # what is finished is being written
        self.closing: list[Callable[[], str]] = []  # tidy up, and say what is there
        self.busy = threading.RLock()  # held while files are moved into place

    def pressed(self) -> None:
        """Ctrl-C was pressed. Called by the watching thread."""
        if self.worth_keeping and not self.asked:
            self.asked = True
            _say("\nStopping as soon as this computation is done, to keep what is finished. Ctrl-C again: at once.")
            return
        with self.busy:
            remaining = " ".join(text for text in (tidy() for tidy in reversed(self.closing)) if text)
            _say(f"\nStopped. {remaining or 'Nothing was written.'}")
            os._exit(EXIT_CODE)


_watch = _Watch()


def check() -> None:
    """End the work here if Ctrl-C was pressed. To be called between computations, never inside one.

    Raises:
        Interrupted: Ctrl-C was pressed.
    """
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


@contextmanager
def undisturbed() -> Iterator[None]:
    """Files are moved into place here: a sudden end of the process waits."""
    with _watch.busy:
        yield


@contextmanager
def watched(then: Any = signal.default_int_handler) -> Iterator[None]:
    """Take over Ctrl-C while this lasts.

    Nothing changes where a command is called from a program that handles Ctrl-C itself or ignores it, from another
    thread than the first, or from a command.

    Arguments:
        then: what answers Ctrl-C afterwards.
    """
    first = threading.current_thread() is threading.main_thread()
    if not first or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    _watch.asked = _watch.worth_keeping = _watch.saving = False
    ears, mouth = socket.socketpair()
    mouth.setblocking(False)
    signal.signal(signal.SIGINT, lambda number, frame: None)  # the thread answers, at once and not between bytecodes
    before = signal.set_wakeup_fd(mouth.fileno(), warn_on_full_buffer=False)
    thread = threading.Thread(target=_listen, args=(ears,), name="Ctrl-C", daemon=True)
    thread.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)
        signal.signal(signal.SIGINT, then)
        mouth.close()
        thread.join()
        ears.close()


def _listen(ears: socket.socket) -> None:
    """Wait for signals until the other end is closed."""
    while numbers := ears.recv(64):
        for number in numbers:
            if number == signal.SIGINT:
                _watch.pressed()


def _say(text: str) -> None:
    """Write to the terminal although another thread may be writing too; give back the cursor that a bar had hidden."""
    if sys.stderr.isatty():
        text = SHOW_CURSOR + text
    os.write(2, f"{text}\n".encode(errors="replace"))
