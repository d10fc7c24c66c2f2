import csv

import numpy as np
import pytest

from jaxdamp.dampers import Bilinear, Lag, Table
from jaxdamp.export import to_csv


def read(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    header, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    return comments, header, np.array(rows, dtype=float).T


def test_table(tmp_path):
    law = Bilinear(2600.0, 1200.0)
    comments, header, (v, force) = read(to_csv(law, tmp_path / "fv.csv", np.linspace(-1.0, 1.0, 21)))
    assert header == ["velocity [m/s]", "force [N]"]
    assert len(comments) == 2 and repr(law) in comments[0] and "rebound" in comments[1]
    np.testing.assert_array_equal(v, np.linspace(-1.0, 1.0, 21))
    np.testing.assert_allclose(force, np.where(v > 0, 2600.0, 1200.0) * v, rtol=1e-14)
    again = Table(v, force)
    np.testing.assert_allclose(again.force_velocity(0.33), 858.0, rtol=1e-12)


def test_hysteresis_is_said_to_be_missing(tmp_path):
    comments, _, (_, force) = read(to_csv(Lag(Bilinear(2600.0, 1200.0), 0.1), tmp_path / "fv.csv", [-0.5, 0.0, 0.5]))
    assert "hysteresis of the law's 1 state(s) is not in here" in comments[2]
    np.testing.assert_allclose(force, [-600.0, 0.0, 1300.0], rtol=1e-6)


@pytest.mark.parametrize("velocities", [[], [0.0, 0.0], [1.0, 0.0], [[0.0, 1.0]]])
def test_velocities_must_increase(tmp_path, velocities):
    with pytest.raises((ValueError, TypeError), match="velocities"):
        to_csv(Bilinear(2600.0, 1200.0), tmp_path / "fv.csv", np.array(velocities))
    assert not list(tmp_path.iterdir())
