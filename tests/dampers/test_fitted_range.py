"""The range of the fitted records: how it travels with a law, and what must not notice it."""

import dataclasses
import pickle
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp import dampers, parameters
from jaxdamp._guesses import shared_names
from jaxdamp.dampers import (
    AbstractMemoryless,
    Bilinear,
    FittedRange,
    Lag,
    Linear,
    Scheduled,
    Spring,
    StrokeDependent,
    Table,
    with_fitted_range,
    without_fitted_ranges,
)
from jaxdamp.parameters import parameter, positive
from jaxdamp.vehicles import presets
from jaxdamp.vehicles.port_form import Ports


SLOW = FittedRange(velocity=(-0.1, 0.2), stroke=(-0.02, 0.02), force=(-300.0, 500.0))
FAST = FittedRange(velocity=(-1.0, 2.0), temperature=(290.0, 310.0), command=(0.0, 2.0), frequency=(1.0, 12.0))


class Positional(AbstractMemoryless):
    """A law of one's own with fields by position."""

    rate: Any = parameter("N s/m", "slope", positive)
    offset: Any = parameter("N", "offset", default=0.0)

    def force_velocity(self, v):
        return self.rate * v + self.offset


class ByHand(AbstractMemoryless):
    """A law of one's own whose `__init__` is written by hand."""

    rate: Any = parameter("N s/m", "slope", positive)

    def __init__(self, stiffness: float, time: float) -> None:
        self.rate = jnp.asarray(stiffness * time)

    def force_velocity(self, v):
        return self.rate * v


LAWS = [
    Positional(1500.0, 3.0),
    ByHand(1e5, 0.01),
    Table([-1.0, 0.0, 1.0], [-800.0, 0.0, 900.0]),
    Lag(Linear(1.0), 1.0),
]


def name(law: Any) -> str:
    return type(law).__name__


def test_limits_are_what_was_stated_and_the_rest_is_not_known():
    assert SLOW.velocity == (-0.1, 0.2) and SLOW.stroke == (-0.02, 0.02) and SLOW.force == (-300.0, 500.0)
    assert SLOW.temperature is SLOW.command is SLOW.frequency is None
    assert [q.name for q in FAST.known()] == ["velocity", "frequency", "temperature", "command"]
    assert SLOW.without("force", "stroke").known() == [("velocity", (-0.1, 0.2), "m/s")]
    assert FAST.words() == "velocity −1 to 2 m/s, frequency 1 to 12 Hz, temperature 16.9 to 36.9 °C, command 0 to 2"


@pytest.mark.parametrize("limits", [(0.5, -0.5), (0.0, np.inf), (np.nan, 1.0)])
def test_limits_that_are_none_are_refused(limits):
    with pytest.raises(ValueError, match=r"`velocity` must be the lowest and the highest value \[m/s\]"):
        FittedRange(velocity=limits)


def test_a_range_must_be_given_in_one_way():
    for given in ((), (SLOW,)):
        limits = {"velocity": (-1.0, 1.0)} if given else {}
        with pytest.raises(ValueError, match=r"with_fitted_range\(law, velocity=\(-0.5, 0.5\)\)"):
            with_fitted_range(Linear(1.0), *given, **limits)
    with pytest.raises(ValueError, match="Did you mean 'velocity'"):
        with_fitted_range(Linear(1.0), velocty=(-1.0, 1.0))


@pytest.mark.parametrize("law", LAWS, ids=name)
def test_every_law_takes_a_range_and_is_otherwise_as_it_was(law):
    fitted = with_fitted_range(law, SLOW)
    assert law.fitted_to is None and fitted.fitted_to == SLOW and type(fitted) is type(law)
    assert repr(fitted) == repr(law)
    assert [p.path for p in parameters.parameters(fitted)] == [p.path for p in parameters.parameters(law)]
    assert eqx.tree_equal(without_fitted_ranges(fitted), law)
    assert jax.tree.structure(without_fitted_ranges(fitted)) == jax.tree.structure(law)


@pytest.mark.parametrize("law", LAWS, ids=name)
def test_a_range_survives_replacing_tuning_freezing_and_pickling(law):
    fitted = with_fitted_range(law, SLOW)
    path = parameters.parameters(law)[0].path
    changed = parameters.replace(fitted, {path: 2.0 * parameters.get(law, path)})
    free = parameters.free_parameters(fitted, over=[path])
    assert changed.fitted_to == free.build(2.0 * free.values).fitted_to == SLOW
    assert pickle.loads(pickle.dumps(fitted)).fitted_to == SLOW
    assert jax.tree.map(lambda leaf: leaf, fitted).fitted_to == SLOW


def test_dataclasses_replace_keeps_a_range():
    assert dataclasses.replace(with_fitted_range(Positional(1500.0), SLOW), offset=3.0).fitted_to == SLOW


def test_wrappers_and_sums_keep_what_is_inside():
    slow: Any
    fast: Any
    slow, fast = with_fitted_range(Linear(1500.0), SLOW), with_fitted_range(Spring(100.0, 0.0), FAST)
    doubled: Any = 2.0 * slow
    assert doubled.law.fitted_to == SLOW and Lag(slow, 0.01).law.fitted_to == SLOW
    assert [term.fitted_to for term in (slow + fast).terms] == [SLOW, FAST]


def test_what_a_sum_was_fitted_to_holds_for_its_terms_but_for_the_force():
    fitted: Any = with_fitted_range(Linear(1500.0) + Spring(100.0, 0.0), SLOW)
    longer: Any = fitted + Linear(1.0)
    assert [term.fitted_to and term.fitted_to.words() for term in longer.terms] == [
        "velocity −0.1 to 0.2 m/s, stroke −20 to 20 mm",
        "velocity −0.1 to 0.2 m/s, stroke −20 to 20 mm",
        None,
    ]


def test_only_laws_take_a_range():
    with pytest.raises(ValueError, match=r"`law` must be a damper law, but is a QuarterCar\. For a vehicle, set it"):
        with_fitted_range(presets.quarter_car_000(), SLOW)


def test_a_gradient_does_not_notice_a_range():
    law = Bilinear(2600.0, 1200.0)
    gradient = eqx.filter_grad(lambda law: law.force_velocity(0.3) ** 2)
    plain, ranged = gradient(law), gradient(with_fitted_range(law, SLOW))
    assert eqx.tree_equal(without_fitted_ranges(ranged), plain)
    assert jax.tree.structure(ranged) == jax.tree.structure(plain)


def test_laws_made_and_mapped_by_vmap_keep_a_range():
    rates = jnp.array([1000.0, 2000.0, 3000.0])
    many = jax.vmap(lambda rate: parameters.replace(with_fitted_range(Linear(1.0), SLOW), {"rate": rate}))(rates)
    forces = jax.vmap(lambda law: law.force_velocity(0.1))(many)
    np.testing.assert_allclose(forces, [100.0, 200.0, 300.0])
    assert jax.tree.map(lambda leaf: leaf[1], many).fitted_to.velocity == (-0.1, 0.2)


@pytest.mark.parametrize("law", LAWS, ids=name)
def test_a_law_with_a_range_and_one_without_have_one_structure(law):
    fitted = with_fitted_range(law, SLOW)
    assert jax.tree.structure(fitted) == jax.tree.structure(law)
    assert hash(jax.tree.structure(fitted)) == hash(jax.tree.structure(law))
    assert [leaf.shape for leaf in jax.tree.leaves(fitted)] == [leaf.shape for leaf in jax.tree.leaves(law)]
    assert eqx.tree_equal(jax.tree.map(lambda one, other: 0.5 * (one + other), law, fitted), law)
    # as every `jax.tree.map`, it returns the structure of the first
    assert jax.tree.map(lambda one, other: one, fitted, law).fitted_to == SLOW
    assert jax.tree.map(lambda one, other: one, law, fitted).fitted_to is None


def twice(law):
    return jax.tree.map(lambda leaf: 2.0 * leaf, law)


@pytest.mark.parametrize(
    "compiled",
    [
        jax.jit(twice),
        eqx.filter_jit(twice),
        jax.jit(jax.vmap(twice, axis_size=3, in_axes=None, out_axes=None)),
        lambda law: jax.lax.cond(True, twice, lambda law: law, law),
        lambda law: jax.lax.scan(lambda law, _: (twice(law), None), law, None, length=1)[0],
        jax.jit(lambda law: jax.tree.map(lambda leaf: leaf, with_fitted_range(law, SLOW))),
    ],
    ids=["jit", "filter_jit", "vmap", "cond", "scan", "set inside"],
)
def test_the_range_of_one_law_never_appears_on_another_that_runs_the_same_program(compiled):
    laws = [with_fitted_range(Linear(1.0), SLOW), with_fitted_range(Linear(2.0), FAST), Linear(3.0)]
    rates = []
    for law, covered in zip(laws, (SLOW, FAST, None), strict=True):
        result = compiled(law)
        rates.append(float(result.rate))
        assert result.fitted_to is None and law.fitted_to == covered
        assert jax.vmap(twice, axis_size=3, in_axes=None)(law).fitted_to == covered  # each call is a trace of its own
    assert rates in ([1.0, 2.0, 3.0], [2.0, 4.0, 6.0])


def test_another_range_and_none_compile_nothing_anew():
    traced = []

    @eqx.filter_jit
    def force(law):
        traced.append(law)
        return law.force_velocity(0.1)

    laws = [with_fitted_range(Linear(1500.0), covered) for covered in (SLOW, FAST)]
    forces = [force(law) for law in [*laws, Linear(1500.0)]]
    assert len(traced) == 1 and len(set(map(float, forces))) == 1


def test_alike_ports_are_one_batch_whatever_their_ranges():
    plain = [Bilinear(2600.0, 1200.0), Bilinear(2000.0, 1000.0)]
    ranged = [with_fitted_range(plain[0], SLOW), plain[1]]
    ports, expected = Ports(ranged), Ports(plain)
    assert ports.members == ((0, 1),)
    x, v = jnp.zeros(2), jnp.array([0.3, -0.4])
    np.testing.assert_array_equal(ports.force(x, v, ports.initial()), expected.force(x, v, expected.initial()))


def test_laws_that_are_mixed_from_others_do_not_notice_their_ranges():
    soft, firm = Bilinear(900.0, 500.0), Bilinear(4900.0, 2500.0)
    one = with_fitted_range(soft, SLOW)
    for other in (firm, with_fitted_range(firm, FAST)):
        law = Scheduled((one, other), levels=[0.0, 2.0], command=0.5)
        assert float(law.force(0.0, 1.0, law.initial_state())) == 1900.0
        law = StrokeDependent((one, other), [0.0, 0.1])
        assert float(law.force(0.05, 1.0, law.initial_state())) == pytest.approx(2900.0)


def test_the_names_are_public():
    assert {"FittedRange", "OutsideFittedRangeWarning", "with_fitted_range"} <= set(dampers.__all__)
    assert "range_use" in shared_names(dampers)
