"""Several laws fitted to records of dampers that are hard on them: every command ends with its results."""

from pathlib import Path

import pytest

from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import (
    AbstractDamper,
    Besinger,
    CoulombFriction,
    Dahl,
    Lag,
    LuGre,
    SeriesSpring,
    Spring,
)
from jaxdamp.identify import ladder

from .invoking import jaxdamp


CAR = Besinger(1600.0, 4200.0, 900.0, 0.13, 0.05)
DAMPERS: dict[str, AbstractDamper] = {
    "bristles with a spring": LuGre(21141.905, 1535.68, 1347.49, 107.225, 224.03, 0.036445) + Spring(1542.2, -99.2),
    "stiff bristles": Dahl(5e7, 150.0) + CAR,
    "friction alone": CoulombFriction(120.0, 0.002),
    "very stiff mount": SeriesSpring(CAR, 1e9),
    "lag of a lag": Lag(Lag(CAR, 0.1), 0.01),  # longer ones drive the motion at 4 Hz, which a preflight refuses
    "hardly any force": 0.001 * CAR,
}


def _fit(law: AbstractDamper, folder: Path, laws: str) -> Path:
    tests = [SineTest(0.01, frequency, cycles=2) for frequency in (1.0, 4.0)]
    VirtualDyno(law, sampling_rate=400.0, force_noise=2.0).run(tests).write(folder / "records")
    jaxdamp("fit", folder / "records", "--law", laws, "--out", folder / "fit")
    return folder / "fit"


@pytest.mark.slow_one_in(3)
@pytest.mark.parametrize("name", DAMPERS)
@pytest.mark.exhaustive_cases("bristles with a spring")
def test_odd_dampers_give_laws_tables_and_pictures(tmp_path: Path, name: str) -> None:
    laws = ["besinger_series_spring", "bouc_wen", "linear", "lugre_spring"]
    out = _fit(DAMPERS[name], tmp_path, ",".join(laws))
    written = [path.stem for path in (out / "laws").iterdir()]
    assert sorted(name for name in written if not name.endswith("_reduced")) == laws  # and what is left of one in doubt
    rows = (out / "best_law_force_velocity.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) > 100 and not any("nan" in row for row in rows if not row.startswith("#"))
    assert (
        (out / "report.html").read_text(encoding="utf-8").count("data:image/png") == len(list(out.glob("*.png"))) >= 3
    )
    assert not (out / "UNFINISHED.txt").exists()


@pytest.mark.slow
def test_a_best_law_that_does_not_settle_leaves_rows_out_and_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bristles = Dahl(stiffness=3e3, friction_force=150.0)
    monkeypatch.setitem(ladder._MEMORYLESS, "linear", lambda velocity, force: bristles)
    out = _fit(bristles, tmp_path, "linear")
    comments = [row for row in (out / "best_law_force_velocity.csv").read_text().splitlines() if row.startswith("#")]
    assert any(row.startswith("# rows left out: No force at") for row in comments)
    assert "rows left out" in (out / "report.html").read_text(encoding="utf-8")
