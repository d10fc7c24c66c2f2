"""One thread for NumPy's linear algebra while a fit or a tuning runs, or records are looked over.

The matrices are small or narrow. Several threads win nothing on them, and on a busy machine they wait for one another a
hundred times longer than the work takes.
"""

import functools
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


_lock = threading.Lock()
_open: list[Any] = []  # one entry for each fit that runs, the first with the limit to lift


def usable_cores() -> int:
    """The cores on which this process may run: fewer than the machine has, inside a container or by `taskset`."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@functools.cache
def _controller(of_scipy: bool) -> Any:
    """Of the libraries that are loaded: NumPy's, and from its first use on SciPy's own."""
    del of_scipy
    from threadpoolctl import ThreadpoolController  # looks them up, once

    return ThreadpoolController()


def _any_thread_may_set() -> None:
    """From threadpoolctl 3.8 on only the first thread that set a limit can set others, as long as it lives."""
    from threadpoolctl import OpenBLASController

    if clear := getattr(OpenBLASController, "clear_controlling_thread", None):
        clear(force=True)


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit the linear algebra of the process to one thread; fits in several threads share one limit."""
    with _lock:
        if not _open:
            _any_thread_may_set()
        controller = _controller("scipy.linalg" in sys.modules)
        _open.append(controller.limit(limits=1, user_api="blas") if not _open else None)
    try:
        yield
    finally:
        with _lock:
            limit = _open.pop()
            if limit is not None:
                _any_thread_may_set()
                limit.restore_original_limits()
