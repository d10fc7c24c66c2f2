import dataclasses
import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import bench, dampers, parameters, rig, tune
from jaxdamp.tune.cavities import lacking
from jaxdamp.tune.valving_search import _wanted


TRUTH = dampers.MonoTube.reference()
CHOSEN = {
    "piston.bleed_area": 2.6e-6,
    "piston.rebound_opening_pressure": 0.7e6,
    "piston.rebound_valve_stiffness": 2e11,
    "piston.compression_opening_pressure": 8e5,
    "piston.compression_valve_stiffness": 2.5e10,
    "gas.pressure": 1.5e6,
}
START = parameters.replace(TRUTH, CHOSEN)
CURVE = np.linspace(-1.0, 1.0, 41)


@pytest.fixture(scope="module")
def out_of_reach():
    """Stiff rebound, and compression softer than the bounds allow."""
    return tune.valving(dampers.Bilinear(6000.0, 900.0), START, velocities=CURVE, over=list(CHOSEN))


def test_the_valving_of_a_known_damper_is_recovered_from_its_curve():
    slower = 0.9 * CURVE  # at which no cavity opens
    force = np.asarray(rig.quasi_static(TRUTH.incompressible(), slower).force)
    result = tune.valving((slower, force), START, over=list(CHOSEN), starts=1)
    assert result.feasible and result.status is tune.Status.CONVERGED and not result.out_of_reach
    for p in result.parameters:
        assert p.value == pytest.approx(float(parameters.get(TRUTH, p.name)), rel=1e-5)
        assert float(parameters.get(result.law, p.name)) == p.value
    assert result.rmse < 1e-3


@pytest.mark.slow
def test_both_valves_of_a_twin_tube_are_chosen():
    truth = dampers.TwinTube.reference()
    chosen = ["piston.rebound_opening_pressure", "base.leak"]
    start = parameters.replace(truth, {name: 1.3 * float(parameters.get(truth, name)) for name in chosen})
    force = np.asarray(rig.quasi_static(truth.incompressible(), 0.35 * CURVE).force)
    result = tune.valving((0.35 * CURVE, force), start, over=chosen, starts=1)
    assert result.feasible
    for p in result.parameters:
        assert p.value == pytest.approx(float(parameters.get(truth, p.name)), rel=1e-5)
    moved = tune.valving((0.35 * CURVE, 1.05 * force), truth, starts=1, freeze=["gas.pressure"])
    assert {p.name.split(".")[0] for p in moved.parameters} == {"piston", "base"} and moved.rmse < 0.02 * np.abs(
        force
    ).max()


def test_a_target_beyond_the_bounds_names_them(out_of_reach):
    result = out_of_reach
    assert not result.feasible and result.error_percent > 3.0
    assert {part.side for part in result.out_of_reach} >= {"compression"}
    soft = next(part for part in result.out_of_reach if part.side == "compression")
    assert "piston.compression_opening_pressure" in soft.binding and soft.largest_error < 0.0
    assert "would have to pass" in result.summary and "at its lower bound" in result.summary
    # the law is the nearest within the bounds: moving any number inwards from its bound makes the error larger
    wanted = _wanted(dampers.Bilinear(6000.0, 900.0), START, CURVE, ())

    def error(law):  # of the force without cavities, and of the pressure that the oil lacks to be without
        force = np.asarray(rig.quasi_static(law.incompressible(), CURVE).force)
        return np.linalg.norm([*(force - wanted.force), *lacking(law, CURVE)])

    for p in result.parameters:
        inwards = p.value * (1.02 if "lower" in p.note else 0.98)
        assert error(parameters.replace(result.law, {p.name: inwards})) > error(result.law) * (1 - 1e-9)


def test_a_binding_bound_that_is_widened_helps(out_of_reach):
    soft = next(part for part in out_of_reach.out_of_reach if part.side == "compression")
    # not that of the gas pressure: with less, cavities open at all velocities
    wider = {name: (0.05 * CHOSEN[name], 20.0 * CHOSEN[name]) for name in soft.binding if name != "gas.pressure"}
    again = tune.valving(
        dampers.Bilinear(6000.0, 900.0), START, velocities=CURVE, over=list(CHOSEN), bounds=wider, starts=1
    )
    assert again.rmse < 0.8 * out_of_reach.rmse


def without_gas_force(law, v):
    """A sheet as programs of benches print it, with zero at rest."""
    force = np.asarray(rig.quasi_static(law.incompressible(), v).force)
    return v, force - float(law.force(0.0, 0.0, law.initial_state()))


@pytest.mark.parametrize("law", [TRUTH, dampers.TwinTube.reference()], ids=lambda law: type(law).__name__)
def test_no_cavity_opens_where_gas_pressure_or_base_valve_can_prevent_it(law):
    """The sheet alone pulls the gas pressure down, to a cavity from 0.1 m/s on and an error of 24 %."""
    result = tune.valving(without_gas_force(law, np.linspace(-1.0, 1.0, 10)), law, starts=2)
    assert result.feasible and not result.cavities.any()


def test_a_cavity_is_in_the_error_and_its_remedy_works():
    sheet = v, wanted = without_gas_force(TRUTH, np.linspace(-1.0, 1.0, 10))
    low = parameters.replace(TRUTH, {"gas.pressure": 5e5})
    result = tune.valving(sheet, low, starts=2, bounds={"gas.pressure": (2e5, 1e6)})
    law, gas = result.law, result.law.gas
    # with a cavity its pressure is above the piston, and below it that of the gas, which it has not compressed yet
    opened = float(gas.force(0.0, 0.0, jnp.zeros(0)) - law.piston.area * (gas.pressure - law.cavitation_pressure))
    full = np.asarray(rig.quasi_static(law.incompressible(), v).force)
    own = np.maximum(full, opened + np.asarray(rig.quasi_static(law.friction, v).force))
    np.testing.assert_allclose(result.force, own, atol=float(0.1 * result.tolerance * np.std(wanted)))
    assert result.rmse == pytest.approx(np.sqrt(np.mean((own - wanted) ** 2)), rel=1e-3)
    (said,) = [text for text in result.warnings if "cavity" in text]
    first, largest = np.abs(v[result.cavities]).min(), np.abs(own - wanted)[result.cavities].max()
    assert said == (
        f"In compression a cavity opens from {first:.2g} m/s on, with an error of up to {largest:.0f} N: allow a higher"
        " `gas.pressure`."
    )
    allowed = dataclasses.replace(result, parameters=tuple(p._replace(note="") for p in result.parameters))
    assert "gas.pressure`, which was allowed, suits the rest of the wanted force less" in allowed.summary
    higher = tune.valving(sheet, low, starts=2, bounds={"gas.pressure": (2e5, 3e6)})
    assert not higher.cavities.any() and higher.rmse < 0.1 * result.rmse and "cavity" not in higher.summary


@pytest.mark.parametrize("law", [TRUTH, dampers.TwinTube.reference()], ids=lambda law: type(law).__name__)
def test_what_the_oil_lacks_is_that_of_its_settled_pressures(law):
    v, unused = jnp.array([-0.9, -0.3, 0.1, 0.8]), {"base.area": 1e-3} if isinstance(law, dampers.TwinTube) else {}
    law = parameters.with_values(law, {"gas.pressure": 1.1 * law.cavitation_pressure, "gas.volume": 1e10, **unused})
    endless = parameters.with_values(law, {"cavitation_pressure": -1e30})

    def settled(v):
        state = jax.lax.fori_loop(
            0, 300, lambda _, state: endless.implicit_stage(0.0, v, state, 1e-3), endless.initial_state()
        )
        return jnp.stack(endless.pressures(0.0, *state)[:2])

    above, below = jax.jit(jax.vmap(settled))(v).T
    areas = law.piston.area, law.piston.area + law.gas.rod_area
    rows = [area * np.maximum(law.cavitation_pressure - p, 0.0) for area, p in zip(areas, (above, below), strict=True)]
    np.testing.assert_allclose(lacking(law, v), np.concatenate(rows), rtol=1e-6, atol=1e-6)
    assert np.count_nonzero(np.concatenate(rows)) >= 2


def test_table_dictionary_and_picture(out_of_reach):
    assert json.loads(json.dumps(out_of_reach.to_dict()))["feasible"] is False
    assert len(out_of_reach.table().rows) == 6 and "bleed" in repr(out_of_reach)
    assert len(out_of_reach.plot().axes) == 2


def test_targets_become_points_and_loops():
    law = dampers.Linear(2000.0)
    wanted = _wanted(law, START, [-0.5, 0.5], [(2.0, 0.02)])
    assert wanted.force.tolist() == [-1000.0, 1000.0]
    (loop,) = wanted.loops
    assert len(loop.force) - loop.first == 501 and loop.force[loop.first] == pytest.approx(2000 * 0.08 * np.pi)
    assert np.count_nonzero(loop.velocity == 0.0) == 4  # where two cycles turn
    time = np.arange(1000) / 1e3
    stroke = 0.01 * np.sin(6 * np.pi * time)
    run = bench.BenchRun.from_arrays("3 Hz", time, stroke, 300 * np.cos(6 * np.pi * time))
    (measured,) = _wanted([run], START, None, ()).loops
    assert measured.first == 100 and measured.dt == pytest.approx(1e-3)
    assert len(_wanted([run], START, None, ()).all_forces) == 900


@pytest.mark.exhaustive
def test_the_noisy_hysteresis_of_a_known_damper_is_reached():
    time = np.arange(4000) / 4000.0
    angle = 2 * np.pi * 6.0 * time
    stroke, velocity = 0.02 * np.sin(angle), 0.02 * 12 * np.pi * np.cos(angle)
    force = np.array(rig.respond(TRUTH, time, stroke, velocity))
    noise = np.random.default_rng(0).normal(0.0, 10.0, force.size)
    settled = slice(2000, None)  # three of six cycles
    force += noise
    run = bench.BenchRun("6 Hz", time[:2000], stroke[settled], velocity[settled], force[settled])
    result = tune.valving(run, START, over=list(CHOSEN), starts=1, tolerance=0.02)
    assert result.feasible and result.rmse == pytest.approx(10.0, abs=0.5)
    for p in result.parameters:
        assert p.value == pytest.approx(float(parameters.get(TRUTH, p.name)), rel=0.02)


@pytest.mark.parametrize(
    ("target", "options", "message"),
    [
        ((CURVE, CURVE[:-1]), {}, "target.*velocities, one or more, and as many forces"),
        ((CURVE[:0], CURVE[:0]), {}, "target.*velocities, one or more"),
        (dampers.Linear(1.0), {"velocities": []}, "velocities.*one or more"),
        ((CURVE, 0.0 * CURVE), {}, "target.*have a force"),
        ((CURVE, CURVE), {"motions": [(1.0, 0.01)]}, "motions.*unless the target is a law"),
        (dampers.Linear(1.0), {"motions": [(1.0, 0.5)]}, "stroke.*MonoTube"),
        (dampers.Linear(1.0), {"tolerance": 0.0}, "tolerance"),
        (dampers.Linear(1.0), {"starts": 0}, "starts.*1 or more"),
        (dampers.Linear(1.0), {"over": ["knee"]}, "knee"),
    ],
)
def test_wrong_calls_are_refused(target, options, message):
    with pytest.raises(ValueError, match=message):
        tune.valving(target, START, **options)
