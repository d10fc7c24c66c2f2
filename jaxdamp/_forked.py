"""Processes that were forked while JAX was at work."""

import os


_began: list[int] = []  # the process in which the first computation of the library began


def refuse_fork() -> None:
    """Refuse to compute in a process that was forked after the first computation, where JAX would wait for ever.

    Raises:
        RuntimeError: such a process.
    """
    if not _began:
        _began.append(os.getpid())
    if _began[0] != os.getpid():
        raise RuntimeError(
            "This process was forked from one that had computed with JAX: the threads of JAX are missing here, and it "
            'would wait for them for ever. Start processes by `multiprocessing.get_context("spawn")`, or fork before '
            "anything is computed."
        )
