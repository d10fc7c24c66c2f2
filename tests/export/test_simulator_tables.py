import re

import numpy as np
import pytest
from scipy.io import loadmat

from jaxdamp.dampers import (
    Bilinear,
    BoucWen,
    FittedRange,
    GasSpring,
    Heated,
    Lag,
    Linear,
    ModifiedBoucWen,
    SeriesSpring,
    Spring,
    Table,
    Thinned,
    with_fitted_range,
)
from jaxdamp.export import to_adams, to_assetto_corsa, to_carsim, to_csv, to_matlab
from jaxdamp.rig import quasi_static, respond


VELOCITIES = np.linspace(-1.0, 0.8, 37)
LAW = Bilinear(2600.0, 1200.0)
FORCE = np.where(VELOCITIES > 0, 2600.0, 1200.0) * VELOCITIES
TABLES = [to_adams, to_carsim, to_matlab, to_assetto_corsa]


def read_teimorbit(path):
    """Blocks with their parameters and rows, without comments, as the manuals of Adams and MotionView describe them."""
    blocks, block = {}, {}
    for line in path.read_text(encoding="ascii").splitlines():
        if line.startswith(("$", "!")) or not line.strip():
            continue
        if line.startswith("["):
            block = blocks.setdefault(line.strip("[]"), {"rows": []})
        elif line.startswith("{"):
            block["columns"] = line.strip("{}").split()
        elif "=" in line:
            name, value = line.split("=")
            block[name.strip()] = value.strip().strip("'")
        else:
            block["rows"].append([float(number) for number in line.split()])
    return blocks


def values(path):
    """The values of suspensions.ini."""
    return {k: float(v) for k, v in re.findall(r"(?m)^(\w+)=([\d.]+)", path.read_text(encoding="ascii"))}


def game(known, v):
    """Force of Assetto Corsa at a velocity, here positive in rebound."""
    name = np.where(v > 0, "REBOUND", "BUMP")
    slow, fast = (np.array([known[f"DAMP_{kind}{n}"] for n in name]) for kind in ("", "FAST_"))
    knee, speed = np.array([known[f"DAMP_FAST_{n}THRESHOLD"] for n in name]), np.abs(v)
    return np.sign(v) * (slow * np.minimum(speed, knee) + fast * np.maximum(speed - knee, 0.0))


def text(path):
    return "".join(loadmat(path)["about"]) if path.suffix == ".mat" else path.read_text(encoding="ascii")


def test_adams(tmp_path):
    blocks = read_teimorbit(to_adams(LAW, tmp_path / "front.dpr", VELOCITIES))
    assert blocks["MDI_HEADER"]["FILE_TYPE"] == "dpr" and blocks["MDI_HEADER"]["FILE_FORMAT"] == "ASCII"
    assert (blocks["UNITS"]["LENGTH"], blocks["UNITS"]["FORCE"], blocks["UNITS"]["TIME"]) == ("mm", "newton", "second")
    assert blocks["CURVE"]["columns"] == ["vel", "force"]
    v, force = np.array(blocks["CURVE"]["rows"]).T
    np.testing.assert_allclose(v, 1e3 * VELOCITIES, atol=1e-6)
    np.testing.assert_allclose(force, FORCE, atol=1e-6)


def test_carsim_counts_compression_positive(tmp_path):
    lines = to_carsim(LAW, tmp_path / "front.par", VELOCITIES).read_text(encoding="ascii").splitlines()
    start, end = lines.index("FD_TABLE LINEAR"), lines.index("ENDTABLE")
    assert lines[0] == "PARSFILE" and lines[-1] == "END"
    assert all(line.startswith("!") for line in lines[1:start])
    rate, force = np.array([line.split(",") for line in lines[start + 1 : end]], float).T
    assert np.all(np.diff(rate) > 0)
    np.testing.assert_allclose(-1e-3 * rate[::-1], VELOCITIES, atol=1e-9)
    np.testing.assert_allclose(-force[::-1], FORCE, atol=1e-6)


def test_matlab(tmp_path):
    known = loadmat(to_matlab(LAW, tmp_path / "front.mat", VELOCITIES))
    assert known["velocity"].shape == (37, 1)
    np.testing.assert_array_equal(known["velocity"][:, 0], VELOCITIES)
    np.testing.assert_allclose(known["force"][:, 0], FORCE, rtol=1e-14)
    with pytest.raises(
        ValueError, match=r"`path` must be a file NAME.mat, but is .*front.m. It holds binary data, not a script"
    ):
        to_matlab(LAW, tmp_path / "front.m", VELOCITIES)
    assert not (tmp_path / "front.m").exists()


@pytest.mark.parametrize("ratio", [1.0, 0.7])
def test_assetto_corsa_has_the_slopes_of_the_wheel(tmp_path, ratio):
    file = to_assetto_corsa(LAW, tmp_path / "front.ini", VELOCITIES, motion_ratio=ratio)
    wheel = np.linspace(-1.0, 0.8, 50) / ratio
    expected = ratio * np.where(wheel > 0, 2600.0, 1200.0) * (ratio * wheel)
    np.testing.assert_allclose(game(values(file), wheel), expected, rtol=1e-3)
    assert "differ from the table by 0.0 %" in text(file)


def test_assetto_corsa_finds_the_knee_and_states_the_misfit(tmp_path):
    knee = np.where(VELOCITIES < 0, 1500.0 * VELOCITIES, 4000.0 * np.minimum(VELOCITIES, 0.2))
    file = to_assetto_corsa(Table(VELOCITIES, knee), tmp_path / "front.ini", VELOCITIES)
    known = values(file)
    np.testing.assert_allclose(game(known, VELOCITIES), knee, atol=1.0)
    assert known["DAMP_FAST_REBOUND"] == 0.1  # the game takes zero for the slow rate
    assert abs(known["DAMP_FAST_REBOUNDTHRESHOLD"] - 0.2) < 1e-3
    with pytest.raises(ValueError, match="three velocities or more in compression"):
        to_assetto_corsa(LAW, tmp_path / "front.ini", [-0.1, 0.1, 0.2, 0.3])
    with pytest.raises(ValueError, match="motion_ratio"):
        to_assetto_corsa(LAW, tmp_path / "front.ini", VELOCITIES, motion_ratio=0.0)


GAS = GasSpring(20e5, 1e-4, 1.5e-4)
STATIC = "static force of 284.8 N, which pushes the rod out at stroke zero, is "  # (20e5 - 101325) Pa on 1.5 cm^2


def test_the_rates_of_assetto_corsa_are_those_without_the_gas(tmp_path):
    """Lines through zero once took the gas for damping: 6680 N s/m in place of 984."""
    laws = {"plain.ini": LAW, "charged.ini": LAW + GAS}
    plain, charged = (to_assetto_corsa(law, tmp_path / name, VELOCITIES) for name, law in laws.items())
    assert values(charged) == values(plain)
    assert STATIC + "left out: it belongs to the spring" in text(charged) and "static force" not in text(plain)


@pytest.mark.parametrize("to_table", [to_adams, to_carsim, to_matlab])
def test_other_tables_keep_the_static_force_and_say_so(tmp_path, to_table):
    assert STATIC + "in the table" in text(
        to_table(LAW + GAS, tmp_path / ("front" + ".mat" * (to_table is to_matlab)), VELOCITIES)
    )


def test_assetto_corsa_takes_a_damper_of_one_direction_and_no_spring(tmp_path):
    one_way = Table(VELOCITIES, np.maximum(2000.0 * VELOCITIES, 0.0))
    file = to_assetto_corsa(one_way, tmp_path / "front.ini", VELOCITIES)
    assert values(file)["DAMP_BUMP"] == 0.0 and text(file).count("differ from the table by 0.0 %") == 2
    for law in (Spring(20_000.0), GAS):
        with pytest.raises(
            ValueError, match=r"`law` must have a force that changes with the velocity, but is (Gas)?Sp"
        ):
            to_assetto_corsa(law, tmp_path / "none.ini", VELOCITIES)
    assert not (tmp_path / "none.ini").exists()


@pytest.mark.slow
def test_assetto_corsa_says_of_a_law_that_never_settles_why_velocities_are_missing(tmp_path):
    with pytest.raises(ValueError, match=r"a force at constant velocity, but is .* No force at 36 of 37 velocities"):
        to_assetto_corsa(ModifiedBoucWen.prototype(1.5), tmp_path / "front.ini", VELOCITIES)


@pytest.mark.parametrize("to_table", TABLES)
def test_comments_state_range_and_extrapolation(tmp_path, to_table):
    law = with_fitted_range(LAW, FittedRange(velocity=(-0.5, 0.5)))
    said = text(to_table(law, tmp_path / ("front" + ".mat" * (to_table is to_matlab)), VELOCITIES))
    assert (
        "Bilinear(" in said and "range: -1 to 0.8 m/s" in said and "fitted to:" in said and "beyond all records" in said
    )
    assert "left out by the table" not in said


def test_comments_state_what_is_lost(tmp_path):
    """A first-order lag: over a sine the table misses |1 - 1/(1 + i w T)| / |1/(1 + i w T)| = w T of the RMS force."""
    lag = 0.002
    said = text(to_adams(Lag(Linear(2000.0), lag), tmp_path / "front.dpr", VELOCITIES))
    shares = [float(share) for share in re.findall(r"([\d.]+) % at", said)]
    np.testing.assert_allclose(shares, 100.0 * 2.0 * np.pi * np.array([1.5, 12.0]) * lag, rtol=0.02)


@pytest.mark.parametrize(
    ("law", "velocities", "said"),
    [
        (Linear(1500.0) + Spring(2000.0), VELOCITIES, "left out by the table"),
        (SeriesSpring(LAW, 5e5), [0.1, 0.2, 0.4], "it holds one direction only"),
    ],
)
def test_what_is_lost_of_other_laws(tmp_path, law, velocities, said):
    assert said in text(to_adams(law, tmp_path / "front.dpr", velocities))


def test_refusals(tmp_path):
    with pytest.raises(ValueError, match="strictly increasing"):
        to_adams(LAW, tmp_path / "front.dpr", [0.1, 0.1])
    assert not list(tmp_path.iterdir())
    assert "quasi-static" in text(to_adams(BoucWen(800.0, 0.0, 300.0, 1e-3), tmp_path / "front.dpr", VELOCITIES))


def test_what_a_table_leaves_out_is_that_of_a_steady_sine(tmp_path):
    """Of a law with a long memory, three cycles were not steady: 47 to 60 % for 20."""
    law, points = Thinned(Bilinear(2600.0, 1200.0), 0.2, 5.0), np.linspace(-0.8, 0.8, 33)
    said = re.findall(
        r"([\d.]+) % at ([\d.]+) Hz and 0.4 m/s", to_adams(law, tmp_path / "thinned.dpr", points).read_text()
    )
    table = np.asarray(quasi_static(law, points).force)
    for share, frequency in said:
        rate, count = 2 * np.pi * float(frequency), round(60.0 * float(frequency))  # twelve times its time constant
        turn = 2 * np.pi * np.arange(200 * count + 1) / 200
        force = respond(law, turn / rate, 0.4 / rate * np.sin(turn), 0.4 * np.cos(turn), state=law.initial_state())
        last, velocity = np.asarray(force)[-200:], 0.4 * np.cos(turn[-200:])
        lost = np.sqrt(np.mean((last - np.interp(velocity, points, table)) ** 2) / np.mean(last**2))
        assert float(share) == pytest.approx(100.0 * lost, abs=0.1) and 15.0 < float(share) < 25.0
    assert [frequency for _, frequency in said] == ["1.5", "12"]


def test_a_heated_law_has_the_table_of_its_own_temperature(tmp_path):
    law = Heated(Bilinear(2600.0, 1200.0), initial_rise=20.0)
    table = to_csv(law, tmp_path / "warm.csv", np.array([-0.5, 0.0, 0.5])).read_text()
    assert "as warm as it begins: 20 K above its reference temperature" in table
    forces = [float(line.split(",")[1]) for line in table.splitlines() if line[:1] in "-0123456789"]
    np.testing.assert_allclose(forces, [-600.0 * np.exp(-0.04), 0.0, 1300.0 * np.exp(-0.04)], atol=1e-3)


def test_a_table_without_one_direction_is_refused(tmp_path):
    slow = Lag(Linear(1000.0), 1e6)
    with pytest.raises(ValueError, match="`law` must have a force at constant velocity"):
        to_csv(slow, tmp_path / "none.csv", np.array([-0.5, 0.0, 0.5]))
    assert not list(tmp_path.iterdir())
