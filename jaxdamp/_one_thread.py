"""One thread for NumPy's linear algebra while a fit runs, or records are looked over.

The matrices are small or narrow. Several threads win nothing on them, and on a busy machine they wait for one another a
hundred times longer than the work takes.
"""

import functools
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


_lock = threading.Lock()
_open: list[Any] = []  # one entry for each fit that runs, the first with the limit to lift


@functools.cache
def _controller() -> Any:
    from threadpoolctl import ThreadpoolController  # looks up the loaded libraries, once

    return ThreadpoolController()


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit the linear algebra of the process to one thread; fits in several threads share one limit."""
    with _lock:
        _open.append(_controller().limit(limits=1, user_api="blas") if not _open else None)
    try:
        yield
    finally:
        with _lock:
            limit = _open.pop()
            if limit is not None:
                limit.restore_original_limits()
