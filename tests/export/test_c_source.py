import subprocess

import equinox as eqx
import jax
import numpy as np
import pytest

from jaxdamp._types import Number
from jaxdamp.dampers import (
    AbstractMemoryless,
    Besinger,
    BoucWen,
    CoulombFriction,
    FittedRange,
    GasSpring,
    Lag,
    Linear,
    PiecewiseLinear,
    with_fitted_range,
)
from jaxdamp.export import to_c
from jaxdamp.export._c_text import numbered
from jaxdamp.export._controller_program import Line
from jaxdamp.export._law_program import identifier, law_numbers
from jaxdamp.parameters import parameter
from jaxdamp.simulation import substeps_needed
from jaxdamp.vehicles.presets import quarter_car_000
from tests.dampers.test_contract import LAWS
from tests.export.compiled import STRICT, compiled, compiler, in_c, in_jax, worst


PLAIN = ["Besinger, car", "lag, power", "polynomial"]  # elementary functions, states, a loop
CLOSE = 1e-12
# The slope of its root is a quotient of differences of nearly equal numbers: rounding counts a million times.
CLOSE_SLOPES = {"modified Bouc and Wen, published": 1e-6}


def check(names, folder):
    laws = {name: LAWS[name]() for name in names}
    in_file = {name: f"law{k}_{identifier(name)}" for k, name in enumerate(names)}
    library = compiled({in_file[name]: law for name, law in laws.items()}, folder)
    for name, law in laws.items():
        states, force, dstates, dforce = in_c(library, in_file[name], law.initial_state().size)
        after, force_, dafter, dforce_ = in_jax(law, states)
        assert max(worst(states[1:], after), worst(force, force_)) < CLOSE, name
        assert max(worst(dstates, dafter), worst(dforce, dforce_)) < CLOSE_SLOPES.get(name, CLOSE), name
        assert np.ptp(force) > 1.0


def test_printed_laws_give_the_numbers_of_jax(tmp_path):
    check(PLAIN, tmp_path)


@pytest.mark.slow
def test_all_printed_laws_give_the_numbers_of_jax(tmp_path):
    check([name for name in LAWS if name not in PLAIN], tmp_path)


@pytest.mark.parametrize(
    ("command", "precision"), [("gcc", "float64"), pytest.param("g++", "float32", marks=pytest.mark.slow)]
)
def test_the_test_program_passes_and_fails(tmp_path, command, precision):
    files = to_c(
        Lag(Besinger(900.0, 2800.0, 700.0, 0.25, 0.05), 0.004), tmp_path, precision=precision, derivatives=True
    )
    assert [file.name for file in files] == ["lag.h", "lag.c", "lag_test.c"]
    strict = STRICT if command == "gcc" else STRICT[1:]

    def run():
        build = [compiler(command), *strict, "lag.c", "lag_test.c", "-o", "lag", "-lm"]
        subprocess.run(build, cwd=tmp_path, check=True)
        return subprocess.run([tmp_path / "lag"], capture_output=True, text=True, check=False)

    passed = run()
    assert passed.returncode == 0 and "greatest difference" in passed.stdout
    source = files[1].read_text(encoding="utf-8")
    files[1].write_text(source.replace("p->lag_time = 0.004", "p->lag_time = 0.005"), encoding="utf-8")
    assert run().returncode == 1


def test_the_header_explains_every_number(tmp_path):
    text = to_c(2.0 * PiecewiseLinear([-0.1, 0.1], [700.0, 2000.0, 900.0]), tmp_path / "shim.c")[0].read_text()
    assert "/* law.slopes [N s/m] positive: " in text and "double law_slopes[3];" in text
    assert "/* law.knee_width [m/s] not negative, setting: " in text
    assert "#define SHIM_STATES 0" in text and "shim_force_derivative" not in text


@pytest.mark.filterwarnings("error")  # its own test motion is faster than the records
def test_the_fitted_range_is_in_the_header_and_no_warning_of_the_test_motion(tmp_path):
    law = with_fitted_range(Linear(2000.0), FittedRange(velocity=(-0.01, 0.02)))
    header = to_c(law, tmp_path / "law.c")[0].read_text(encoding="utf-8")
    assert " * The law was fitted to: velocity −0.01 to 0.02 m/s.\n" in header
    header = to_c(quarter_car_000(law), tmp_path / "car.c")[0].read_text(encoding="utf-8")
    assert " * damper was fitted to: velocity −0.01 to 0.02 m/s.\n" in header


def test_the_text_is_the_same_every_time(tmp_path):
    law = BoucWen(800.0, 2000.0, 300.0, 1e-3, 0.75, 1.5)
    first = [file.read_text(encoding="utf-8") for file in to_c(law, tmp_path / "law.c")]
    eqx.filter_jit(law.advance)(0.0, 0.1, 1e-4, 0.1, law.initial_state(), 1e-3)
    assert [file.read_text(encoding="utf-8") for file in to_c(law, tmp_path / "law.c")] == first


def test_single_precision_of_a_law_with_strokes_that_are_limited(tmp_path):
    source = to_c(GasSpring(2e6, 6e-5, 1e-4, 1.3), tmp_path, precision="float32")[1].read_text(encoding="utf-8")
    assert "double" not in source and "powf(" in source


class Sorted(AbstractMemoryless):
    """A law that cannot be printed."""

    rate: Number = parameter("N s/m", "damping coefficient")

    def force_velocity(self, v):
        return jax.numpy.sort(jax.numpy.stack([self.rate * v, 2.0 * self.rate * v]))[0]


class Accented(Sorted):
    dämpfung: Number = parameter("N s/m", "with an accent")
    dampfung: Number = parameter("N s/m", "without")


class Greek(Sorted):
    μ: Number = parameter("N s/m", "of the velocity")
    η: Number = parameter("N s²/m²", "of its square")


def test_the_header_of_a_vehicle_states_the_longest_step(tmp_path):
    """Steps as long as those of the instants are too long for steep friction, which `simulate` divides by itself."""
    steep = quarter_car_000(Linear(2000.0) + CoulombFriction(400.0, 4e-4))
    header = to_c(steep, tmp_path / "car.c")[0].read_text(encoding="utf-8")
    stated = float(header.partition("#define CAR_LONGEST_STEP ")[2].split()[0])
    assert stated == pytest.approx(1e-3 / substeps_needed(steep, 1e-3)) and stated < 0.5e-3
    assert "longer than CAR_LONGEST_STEP" in header


def test_a_test_program_replaces_its_like_and_no_other_export(tmp_path):
    other = to_c(Linear(1111.0), tmp_path / "rear_test.c")[1]
    with pytest.raises(ValueError, match=r"leave room for its test program, rear_test\.c, but is rear\.c"):
        to_c(Linear(2222.0), tmp_path / "rear.c")
    assert "1111" in other.read_text(encoding="utf-8") and not (tmp_path / "rear.c").exists()
    for rate in (1111.0, 2222.0):
        source = to_c(Linear(rate), tmp_path / "front.c")[1].read_text(encoding="utf-8")
    assert "2222" in source


def test_names_that_are_one_in_c_are_refused_and_comments_are_closed():
    lines = [Line("f_stroke", "m", "of */ x"), Line("front axle_stroke", "m", "")]
    assert numbered("CAR_Y", lines)[0] == ("CAR_Y_F_STROKE", 0, "[m] of * / x")
    for name in ("F_stroke", "front-axle_stroke"):
        with pytest.raises(ValueError, match=f"names that differ in C, .* but is one with '.*' and '{name}'. Rename"):
            numbered("CAR_Y", [*lines, Line(name, "m", "")])
    with pytest.raises(ValueError, match=r"differ in their ASCII letters, .* one with dämpfung and dampfung"):
        law_numbers(Accented(1.0, 2.0, 3.0))
    assert [number.name for number in law_numbers(Greek(1.0, 2.0, 3.0))] == ["rate", "mu", "eta"]


def test_refusals(tmp_path):
    with pytest.raises(NotImplementedError, match="'sort'"):
        to_c(Sorted(1.0), tmp_path)
    with pytest.raises(ValueError, match=r"identifier of C, but is .*Try 'front_left\.c'"):
        to_c(Linear(1.0), tmp_path / "front-left.c")
    with pytest.raises(ValueError, match="precision"):
        to_c(Linear(1.0), tmp_path, precision="float16")
    with pytest.raises(ValueError, match="jit"):
        jax.jit(lambda rate: to_c(Linear(rate), tmp_path) and 0)(1.0)
    assert not list(tmp_path.iterdir())
