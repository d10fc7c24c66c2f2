"""The linear algebra of a fit runs in one thread, and the limit is lifted afterwards, whatever the order."""

import os
import subprocess
import sys
import threading

import numpy as np
import pytest
import scipy.linalg
from threadpoolctl import threadpool_info, threadpool_limits

from jaxdamp import bench, identify
from jaxdamp._one_thread import one_thread, usable_cores
from jaxdamp.bench import velocity
from jaxdamp.dampers import Linear
from jaxdamp.identify import predicting
from jaxdamp.solve import Evaluation, Region, Scaling, SequentialQuadratic


def threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


@pytest.fixture(autouse=True)
def two_threads():
    np.linalg.qr(np.eye(3))
    scipy.linalg.qr(np.eye(3))
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


def test_libraries_that_are_loaded_later_are_limited_too() -> None:
    """SciPy has a library of its own, which `import jax` does not load."""
    script = (
        "from jaxdamp._one_thread import one_thread\n"
        "import numpy as np\n"
        "with one_thread(): np.eye(2) @ np.eye(2)\n"
        "import scipy.linalg\n"
        "from threadpoolctl import threadpool_info\n"
        "with one_thread(): inside = [pool['num_threads'] for pool in threadpool_info()]\n"
        "assert set(inside) == {1}, inside\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, env=os.environ | {"OPENBLAS_NUM_THREADS": "2"})


def test_the_steps_of_a_tuning_take_one_thread() -> None:
    """With several, a step of fifteen numbers took a quarter of a second on a busy machine."""
    seen: list[set[int]] = []

    def evaluate(points: np.ndarray) -> list[Evaluation]:
        seen.append(threads())
        return [Evaluation(y, np.array([y @ y]), 2.0 * y[None]) for y in points]

    region = Region(np.full(2, -2.0), np.full(2, 2.0), np.zeros((0, 2)), np.zeros(0))
    solver = SequentialQuadratic(region, Scaling(np.zeros(1), np.ones(1), 1), max_steps=3, improvement=1e-12)
    start = np.ones(2)
    solver.solve(evaluate, [solver.init(np.zeros(1), start, evaluate(start[None])[0])])
    assert seen[0] == {2} and seen[1:] and all(each == {1} for each in seen[1:]) and threads() == {2}


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="cores are chosen on Linux only")
def test_cores_that_a_process_may_not_use_do_not_count():
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        assert usable_cores() == 1
    finally:
        os.sched_setaffinity(0, before)
    assert usable_cores() == len(before)


def test_shares_of_errors_do_not_depend_on_what_runs_beside_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """In a comparison they had one thread while another law was fitted, else several: their last bits differed."""
    seen: list[set[int]] = []
    sums = predicting._sums
    monkeypatch.setattr(predicting, "_sums", lambda *channels: seen.append(threads()) or sums(*channels))
    run = bench.VirtualDyno(Linear(1500.0), sampling_rate=200.0, force_noise=5.0).run(bench.SineTest(0.01, 1.0))
    assert identify.error_shares(Linear(500.0), run).shape > 0.9
    assert seen == [{1}] and threads() == {2}
