import csv

import numpy as np
import pytest

from jaxdamp.dampers import Bilinear, Dahl, Lag, Linear, LuGre, Spring, Table, with_fitted_range
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


def test_a_bristle_with_a_spring_gives_a_table(tmp_path):
    law = LuGre(21141.905, 1535.68, 1347.49, 107.225, 24.03, 0.036445) + Spring(1542.2, -99.2)
    comments, _, (v, force) = read(to_csv(law, tmp_path / "m.csv", np.linspace(-0.166, 0.166, 601)))
    friction, sliding = 107.225, np.abs(v) > 0.15  # far above the velocity of breaking away
    np.testing.assert_allclose(force[sliding] + 99.2, 1347.49 * v[sliding] + friction * np.sign(v[sliding]), rtol=1e-4)
    assert len(v) == 601 and len(comments) == 4
    assert comments[3] == "# static force of 99.2 N, which pushes the rod out at stroke zero, is in the table"


def test_rows_without_a_force_are_left_out_and_said(tmp_path):
    law = Dahl(stiffness=2e5, friction_force=200.0) + Linear(1000.0)
    with pytest.warns(UserWarning, match=r"fv\.csv: rows left out\. No force at 2 of 5 velocities"):
        path = to_csv(law, tmp_path / "fv.csv", [-0.1, -1e-6, 0.0, 1e-6, 0.1])
    comments, _, (v, force) = read(path)
    assert v.tolist() == [-0.1, 0.0, 0.1] and np.isfinite(force).all()
    assert comments[3].startswith("# rows left out: No force at 2 of 5 velocities, at -1e-06 and at 1e-06 m/s")


def test_a_law_without_any_settled_force_is_refused_in_few_words(tmp_path):
    with pytest.raises(ValueError, match=r"constant velocity, but is Lag.*velocity\. A table.*use `respond`") as error:
        to_csv(Lag(Linear(1000.0), 1e4), tmp_path / "fv.csv", np.linspace(-1.0, 1.0, 500))
    assert len(str(error.value)) < 400 and not list(tmp_path.iterdir())
