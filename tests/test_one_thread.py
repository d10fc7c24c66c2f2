"""The linear algebra of a fit runs in one thread, and the limit is lifted afterwards, whatever the order."""

import threading

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from jaxdamp import bench
from jaxdamp._one_thread import one_thread
from jaxdamp.bench import velocity


def threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two_threads():
    np.linalg.qr(np.eye(3))
    with threadpool_limits(2, "blas"):
        yield


def test_the_limit_holds_inside_and_is_lifted_after_the_last() -> None:
    first, second = one_thread(), one_thread()
    first.__enter__()
    second.__enter__()
    assert threads() == {1}
    first.__exit__(None, None, None)  # the one that began first ends first, as in two threads
    assert threads() == {1}
    second.__exit__(None, None, None)
    assert threads() == {2}


def test_it_is_lifted_after_an_error() -> None:
    with pytest.raises(RuntimeError), one_thread():
        raise RuntimeError
    assert threads() == {2}


def test_it_holds_whichever_thread_asks_for_it() -> None:
    """A fit in the main thread, then fits in threads of a pool."""
    with one_thread():
        assert threads() == {1}
    seen: list[set[int]] = []

    def in_thread() -> None:
        with one_thread():
            seen.append(threads())

    for _ in range(2):
        worker = threading.Thread(target=in_thread)
        worker.start()
        worker.join()
    with one_thread():
        seen.append(threads())
    assert seen == [{1}] * 3 and threads() == {2}


def test_velocities_of_records_are_found_in_one(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = list[set[int]]()
    plain = velocity._least_squares
    monkeypatch.setattr(velocity, "_least_squares", lambda *given: seen.append(threads()) or plain(*given))
    time = np.linspace(0.0, 4.0, 401)
    bench.estimate_velocity(time, np.sin(6.0 * time))
    assert seen and set.union(*seen) == {1} and threads() == {2}
