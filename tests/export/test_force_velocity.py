import csv

import numpy as np
import pytest

from jaxdamp.dampers import Bilinear, Lag, Table, with_fitted_range
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


@pytest.mark.parametrize(
    ("velocities", "said"),
    [
        (np.linspace(-0.1, 0.2, 31), None),
        (
            np.linspace(-1.0, 1.0, 21),
            "# extrapolated: rows below -0.1 m/s and above 0.2 m/s, 17 of 21, beyond all records",
        ),
        ([0.5, 1.0], "# extrapolated: all rows lie beyond the velocities that the law was fitted to"),
    ],
)
def test_rows_beyond_the_fitted_range_are_named_in_the_header(tmp_path, velocities, said):
    law = with_fitted_range(Bilinear(2600.0, 1200.0), velocity=(-0.1, 0.2), stroke=(-0.01, 0.01))
    comments, header, (v, force) = read(to_csv(law, tmp_path / "fv.csv", np.array(velocities)))
    assert comments[2] == "# fitted to: velocity −0.1 to 0.2 m/s, stroke −10 to 10 mm"
    assert comments[3:] == ([] if said is None else [said])
    assert header == ["velocity [m/s]", "force [N]"] and len(v) == len(force) == len(velocities)


@pytest.mark.parametrize("velocities", [[], [0.0, 0.0], [1.0, 0.0], [[0.0, 1.0]]])
def test_velocities_must_increase(tmp_path, velocities):
    with pytest.raises((ValueError, TypeError), match="velocities"):
        to_csv(Bilinear(2600.0, 1200.0), tmp_path / "fv.csv", np.array(velocities))
    assert not list(tmp_path.iterdir())
