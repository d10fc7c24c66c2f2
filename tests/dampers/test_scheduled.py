"""Laws between laws, and the command that a record states."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import export, identify, respond
from jaxdamp.bench import BenchRun, BenchSet, SineTest, VirtualDyno, read
from jaxdamp.dampers import (
    Bilinear,
    BoucWen,
    Lag,
    Linear,
    ModifiedBoucWen,
    Scheduled,
    Table,
    takes_command,
    with_command,
)
from jaxdamp.parameters import get


def bouc_wen(u):
    return BoucWen(400.0 + 300.0 * u, 0.0, 50.0 + 600.0 * u, 1e-3)


def motion():
    t = 1e-3 * np.arange(400)
    return t, 0.01 * (1 - np.cos(20 * t)), 0.2 * np.sin(20 * t)


def test_at_its_levels_it_is_the_law_given():
    law = Scheduled((bouc_wen(0.0), bouc_wen(0.4), bouc_wen(2.0)), [0.0, 0.4, 2.0], 0.0)
    for u in (0.0, 0.4, 2.0):
        np.testing.assert_allclose(
            respond(with_command(law, u), *motion()), respond(bouc_wen(u), *motion()), rtol=1e-10, atol=1e-9
        )


def test_between_levels_every_number_is_interpolated():
    # the numbers of this family are straight lines over u, so that any u between the levels is exact
    law = Scheduled((bouc_wen(0.0), bouc_wen(2.0)), [0.0, 2.0], 0.7)
    np.testing.assert_allclose(respond(law, *motion()), respond(bouc_wen(0.7), *motion()), rtol=1e-10, atol=1e-9)


def test_a_table_over_velocity_and_command_interpolates_the_force():
    v, low, high = [-1.0, 0.0, 0.2, 1.0], [-900.0, 0.0, 300.0, 800.0], [-2000.0, 0.0, 1500.0, 1900.0]
    law = Scheduled((Table(v, low), Table(v, high)), [0.0, 1.0], 0.25)
    np.testing.assert_allclose(law.force(0.0, 0.2, law.initial_state()), 0.75 * 300.0 + 0.25 * 1500.0)


def test_blended_forces_are_the_weighted_sum_of_laws_with_their_own_states():
    # other numbers of equal meaning in other places, and laws of other structure
    laws = (bouc_wen(0.0), Lag(Linear(900.0), 0.01), bouc_wen(2.0))
    law = Scheduled(laws, [0.0, 1.0, 2.0], 0.25, blend="force")
    own = [np.asarray(respond(inner, *motion())) for inner in laws]
    for command, weights in ((0.25, (0.75, 0.25, 0.0)), (1.0, (0.0, 1.0, 0.0)), (1.5, (0.0, 0.5, 0.5))):
        expected = sum(w * force for w, force in zip(weights, own, strict=True))
        found = respond(with_command(law, command), *motion())
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-8)
    again = export.from_json(export.to_json(law))
    assert jax.tree.structure(again) == jax.tree.structure(law) and repr(law).endswith("blend='force')")


def test_the_command_reaches_laws_inside_others():
    law = Lag(2.0 * Scheduled((Linear(1000.0), Linear(3000.0)), [0.0, 1.0], 0.0), 0.002)
    assert takes_command(law) and takes_command(ModifiedBoucWen.prototype()) and not takes_command(Linear(1.0))
    x, v = motion()[1:]
    low, high = (respond(with_command(law, u), motion()[0], x, v) for u in (0.0, 1.0))
    np.testing.assert_allclose(high, 3.0 * low, rtol=1e-9, atol=1e-9)
    assert float(get(law, "law.law.command")) == 0.0


def test_batched_over_the_command():
    law = Scheduled((bouc_wen(0.0), bouc_wen(2.0)), [0.0, 2.0], 0.0)
    u = jnp.array([0.0, 0.5, 2.0])
    found = jax.jit(jax.vmap(lambda u: with_command(law, u).force(0.0, 0.3, jnp.zeros(1))))(u)
    np.testing.assert_allclose(found, (400.0 + 300.0 * u) * 0.3)


def test_refusals():
    with pytest.raises(ValueError, match=r"`Scheduled.command` must be between 0 and 1, but is 1.5"):
        Scheduled((Linear(1.0), Linear(2.0)), [0.0, 1.0], 1.5)
    with pytest.raises(ValueError, match="between 0 and 1"):
        with_command(Lag(Scheduled((Linear(1.0), Linear(2.0)), [0.0, 1.0], 0.0), 0.01), -0.1)
    with pytest.raises(ValueError, match="`laws` must be of equal structure"):
        Scheduled((Linear(1.0), Bilinear(2.0, 1.0)), [0.0, 1.0], 0.0)
    with pytest.raises(ValueError, match="`blend` must be one of"):
        Scheduled((Linear(1.0), Linear(2.0)), [0.0, 1.0], 0.0, blend="forces")
    with pytest.raises(ValueError, match="`laws` must contain two or more laws"):
        Scheduled((Linear(1.0), Linear(2.0)), [0.0, 0.5, 1.0], 0.0)
    with pytest.raises(ValueError, match="`law` must take a command"):
        with_command(Linear(1.0), 0.5)


# ---- records with a command


def true_law(u):
    return Lag(Bilinear(800.0 + 2000.0 * u, 500.0 + 900.0 * u), 0.004)


@pytest.fixture(scope="module")
def runs():
    found = []
    for seed, u in enumerate((0.0, 0.5, 1.0)):
        dyno = VirtualDyno(true_law(u), sampling_rate=500.0, force_noise=4.0, seed=seed)
        for run in dyno.run([SineTest(0.02, 2.0), SineTest(0.005, 8.0)]):
            found.append(BenchRun(f"{run.name} {u} A", run.time, run.stroke, run.velocity, run.force, command=u))
    return BenchSet(found)


@pytest.mark.slow
def test_records_at_several_commands_are_one_law(runs):
    start = Lag(Scheduled((Bilinear(1000.0, 1000.0), Bilinear(2000.0, 2000.0)), [0.0, 1.0], 0.0), 0.002)
    result = identify.fit(start, runs)
    expected = {"law.laws.0.rebound_rate": 800.0, "law.laws.1.rebound_rate": 2800.0, "lag_time": 0.004}
    expected |= {"law.laws.0.compression_rate": 500.0, "law.laws.1.compression_rate": 1400.0}
    for name, value in expected.items():
        np.testing.assert_allclose(result[name].value, value, rtol=0.02)
    assert result.fit_percent > 98.0
    # a law without states goes another way through the fit
    memoryless = identify.fit(start.law, runs)
    assert memoryless.steps == 0 and 80.0 < memoryless.fit_percent < result.fit_percent
    np.testing.assert_allclose(memoryless["laws.1.rebound_rate"].value, 2800.0, rtol=0.05)


def test_records_must_all_state_the_command(runs):
    start = Scheduled((Linear(1000.0), Linear(2000.0)), [0.0, 1.0], 0.0)
    run = runs[0]
    bare = BenchRun("bare", run.time, run.stroke, run.velocity, run.force)
    with pytest.raises(ValueError, match="`runs` must all state their command, but is without one: bare"):
        identify.fit(start, [*runs, bare])
    outside = BenchRun("hot", run.time, run.stroke, run.velocity, run.force, command=1.2)
    with pytest.raises(ValueError, match="between 0 and 1"):
        identify.fit(start, [*runs, outside])


def test_commands_are_read_by_pattern_and_written_to_files(runs, tmp_path):
    runs.write(tmp_path)
    stated = {run.name: run.command for run in runs}
    assert {run.name: run.command for run in read(tmp_path)} == stated
    assert all("command      0.5" in run.describe() for run in runs if run.command == 0.5)
    given = read(tmp_path, command={"* 0.0 A": 0.0, "* 0.5 A": 3.0, "* 1.0 A": 6.0})
    assert {run.name: run.command for run in given} == {name: 6.0 * u for name, u in stated.items()}
    assert {run.command for run in read(tmp_path, command=2.0)} == {2.0}
    with pytest.raises(ValueError, match=r"`command` must name records that are read, but is '\*2 A'"):
        read(tmp_path, command={"*": 0.0, "*2 A": 1.0})
    with pytest.raises(ValueError, match="exactly one pattern"):
        read(tmp_path, command={"* 0.0 A": 0.0, "* 0.5 A": 1.0})
