"""Processes that were forked while JAX was at work."""

import os

import jax


_state = {"started": False, "lost": False}  # JAX at the last fork; whether its threads are missing in this process


def started() -> bool:
    """Whether JAX has started its backend, after which it refuses another number of devices."""
    now = jax.config.jax_num_cpu_devices  # pyright: ignore[reportAttributeAccessIssue]
    try:
        jax.config.update("jax_num_cpu_devices", now + 1)
    except RuntimeError:
        return True
    jax.config.update("jax_num_cpu_devices", now)
    return False


def refuse_fork() -> None:
    """Refuse to compute in a process that was forked after the first computation, where JAX would wait for ever.

    Raises:
        RuntimeError: such a process.
    """
    if _state["lost"]:
        raise RuntimeError(
            "This process was forked from one that had computed with JAX: the threads of JAX are missing here, and it "
            'would wait for them for ever. Start processes by `multiprocessing.get_context("spawn")`, or fork before '
            "anything is computed."
        )


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(
        before=lambda: _state.update(started=started()),
        after_in_child=lambda: _state.update(lost=_state["lost"] or _state["started"]),
    )
