import numpy as np
import pytest

from jaxdamp.bench.clock import check_order, check_time


T = np.arange(200) / 300


def test_uniform_time_is_left_alone():
    assert check_time(T, "run")[0] is T
    assert check_time(T + 1000.0, "run")[1] == ""


def test_rounded_time_is_put_back_on_its_grid():
    time, note = check_time(np.round(T, 3), "run")
    np.testing.assert_allclose(time, T, atol=1e-5)
    assert "rounded to 0.001 s" in note


def test_time_that_goes_back_or_stands():
    back = T.copy()
    back[50] = back[48]
    with pytest.raises(ValueError, match=r"run, line 152: time goes from 0\.163.* must increase"):
        check_order(back, "run", lambda sample: f"line {102 + sample}")
    stands = T.copy()
    stands[50] = stands[49]
    with pytest.raises(ValueError, match=r"sample 50: time goes from"):
        check_time(stands, "run")


@pytest.mark.parametrize("time", [T, np.arange(200) / 1000], ids=["odd step", "step equal to the last digit"])
def test_gap(time):
    with pytest.raises(ValueError, match=r"sample 100: 3 samples are missing between .* \(1 such gaps"):
        check_time(np.delete(time, [100, 101, 102]), "run")


def test_jitter(rng):
    with pytest.raises(ValueError, match="not uniform in time"):
        check_time(T + rng.uniform(-1, 1, 200) * 0.1 / 300, "run")
    assert check_time(T + rng.uniform(-1, 1, 200) * 0.005 / 300, "run")[1] == ""
