"""A recommended law whose numbers would be in doubt: made simpler from one of the laws."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxdamp.bench import SineTest, VirtualDyno
from jaxdamp.dampers import (
    Besinger,
    Bilinear,
    BoucWen,
    CoulombFriction,
    Dahl,
    Lag,
    Linear,
    LuGre,
    PiecewiseLinear,
    SeriesSpring,
    Spring,
    Sum,
    ViscoPlastic,
    not_identified,
)
from jaxdamp.export import from_json, to_json
from jaxdamp.identify import Status, compare
from jaxdamp.identify.reducing import held_of, reduced, simpler_laws, without_zero_terms
from jaxdamp.identify.rungs import recommendation, why
from jaxdamp.parameters import parameters
from jaxdamp.rig import quasi_static
from tests.dampers.test_contract import LAWS


FRICTION = Linear(1500.0) + CoulombFriction(20.0, 0.02)
TESTS = [SineTest(0.01, f, cycles=2) for f in (1.0, 3.0, 6.0)]


def nothing_ahead(source, law, held):
    """One fit after the other."""


@pytest.fixture(scope="module")
def comparison():
    """A linear law with a lag, whose records cannot tell of friction."""
    runs = VirtualDyno(Lag(Linear(1500.0), 0.006), sampling_rate=400.0, force_noise=20.0).run(TESTS)
    return compare({"linear": Linear, "friction_lag": Lag(FRICTION, 0.003)}, runs)


def test_the_part_that_the_records_do_not_determine_is_left_out(comparison):
    best = comparison.best
    assert comparison["friction_lag"].parameters and best.name == "friction_lag_reduced" and not best.doubt
    assert isinstance(best.result.law, Lag) and isinstance(best.result.law.law, Linear)
    assert float(best.result.law.law.rate) == pytest.approx(1500.0, rel=0.01)
    assert float(best.result.law.lag_time) == pytest.approx(0.006, rel=0.05)
    whole = next(rung for rung in comparison.rungs if rung.name == "friction_lag")
    assert whole.doubt and best.error < 1.02 * whole.error and best.numbers == whole.numbers - 2


def test_a_blow_off_that_records_do_not_reach_is_left_out():
    """The records are slower than the limit velocity; what they show of the law comes back."""
    true, tests = Besinger(1500.0, 4000.0, 900.0, 0.5, 0.05), [SineTest(0.01, f, cycles=2) for f in (0.3, 0.5)]
    runs = VirtualDyno(true, sampling_rate=400.0, force_noise=3.0).run(tests)
    best = compare({"bilinear": Bilinear, "besinger": Besinger}, runs).best
    law, fastest = best.result.law, max(run.peak_velocity for run in runs)
    assert best.name == "besinger_reduced" and not best.doubt and best.held == ("blow_off_rate", "limit_velocity")
    assert isinstance(law, Besinger) and float(law.limit_velocity) == pytest.approx(2.0 * fastest)
    assert "reduced to Besinger with blow_off_rate = " in best.reduced
    assert not_identified(from_json(to_json(law))) == ["blow_off_rate", "limit_velocity"]  # so no tuning moves them
    for name in ("compression_rate", "rebound_rate", "transition_velocity"):
        assert float(getattr(law, name)) == pytest.approx(float(getattr(true, name)), rel=0.1), name


def test_the_verdict_says_what_the_simpler_law_lacks(comparison):
    assert comparison.verdict[0].startswith("Recommended: friction_lag_reduced, held-out fit ")
    assert "it is friction_lag reduced to Lag(Linear), what these records determine of it" in comparison.verdict[1]


def test_nothing_is_made_simpler_where_a_law_without_doubt_is_recommended(comparison):
    def never(*about):
        raise AssertionError(about)

    sound = [rung for rung in comparison.rungs if not rung.doubt]
    assert list(reduced(sound, never, never, never)) == []
    assert list(reduced(comparison.rungs, never, never, never)) == []


def test_a_part_that_the_prediction_needs_stays(comparison):
    """Without a simpler law within 10 % nothing is added."""
    rungs = [rung for rung in comparison.rungs if not rung.reduced]
    tried = []

    def far(source, law, held):
        tried.append(source.name)
        return rungs[0]._replace(held_out_rmse=1e3)

    assert list(reduced(rungs, far, lambda name: None, nothing_ahead)) == []
    assert tried and set(tried) == {"friction_lag"}


@pytest.mark.parametrize(
    ("law", "weak", "expected"),
    [
        (FRICTION, ["terms.0.rate"], ["without Linear"]),
        (Lag(Linear(1500.0), 0.01), ["lag_time"], ["with Linear for Lag(Linear)"]),
        (
            SeriesSpring(Bilinear(2000.0, 1000.0), 1e6, 1e9) + Spring(0.0),
            ["terms.0.cubic_stiffness", "terms.0.law.rebound_rate", "terms.1.stiffness"],
            [
                "without SeriesSpring(Bilinear)",
                "with Bilinear for SeriesSpring(Bilinear)",
                "with Linear for Bilinear",
                "with cubic_stiffness = 0",
                "without Spring",
            ],
        ),
        (Besinger(1500.0, 3000.0, 1000.0, 0.1, 0.05), ["transition_velocity"], ["with Degressive for Besinger"]),
        (
            Besinger(1500.0, 3000.0, 1000.0, 0.1, 0.05),
            ["limit_velocity", "blow_off_rate"],
            ["with Besinger for Besinger, blow_off_rate, limit_velocity held"],
        ),
        (Besinger(1500.0, 3000.0, 1000.0, 1.0, 0.05), ["transition_velocity"], ["with Bilinear for Besinger"]),
        (BoucWen(800.0, 0.0, 300.0, 1e-3), ["exponent"], ["with Linear + Dahl for BoucWen"]),
        (
            LuGre(4e5, 300.0, 0.0, 40.0, 60.0, 0.01),
            ["breakaway_force", "contact_damping"],
            ["with Linear + CoulombFriction + Dahl for LuGre", "with contact_damping = 0"],
        ),
        (
            LuGre(4e5, 300.0, 900.0, 1e-5, 60.0, 0.2),
            ["friction_force"],
            ["with LuGre for LuGre, friction_force held"],
        ),
    ],
    ids=["sum", "lag", "series spring", "besinger", "blow-off", "no blow-off", "bouc_wen", "lugre", "no friction"],
)
def test_what_a_law_becomes(law, weak, expected):
    parts = list(simpler_laws(law, weak, 0.5))
    assert [part.words for part in parts] == expected and all(part.weak > 0 for part in parts)
    assert not list(simpler_laws(law, [], 0.5))


def test_simpler_laws_start_near_the_law():
    """The curve of a simpler law is near that of the law that it replaces; elastic friction has the same slope."""
    velocity = np.linspace(-0.5, 0.5, 21)
    curve = PiecewiseLinear([-0.3, -0.1, -0.05, 0.05, 0.1, 0.3], [900.0, 1000.0, 2000.0, 5e3, 2100.0, 1000.0, 950.0])
    (plain,) = simpler_laws(Lag(curve, 0.01), ["law.knots"] * 3 + ["law.slopes"], 0.5)
    assert isinstance(plain.law, Lag) and isinstance(plain.law.law, PiecewiseLinear)
    assert plain.words == "with PiecewiseLinear with 4 knees for PiecewiseLinear with 6 knees"
    forces = [[float(law.force_velocity(v)) for v in velocity] for law in (plain.law.law, curve)]
    np.testing.assert_allclose(forces[0], forces[1], atol=0.05 * max(forces[1]))
    yielding = ViscoPlastic(60.0, 500.0, 0.5, 0.05, [60.0, 100.0], [1e-4, 2e-4], [0.0, 1e-4], [1.0, 1.0])
    (friction,) = simpler_laws(yielding, ["exponent"], 0.5)
    assert isinstance(friction.law, Sum)
    rate, at_once, elastic = friction.law.terms
    assert isinstance(rate, Linear) and isinstance(at_once, CoulombFriction) and isinstance(elastic, Dahl)
    assert float(elastic.stiffness) == pytest.approx(60.0 / 1e-4 + 100.0 / 2e-4)
    assert float(at_once.friction_force) == 60.0 and float(elastic.friction_force) == 160.0
    assert float(rate.rate) == pytest.approx(500.0 * 0.5**-0.5)


def test_a_law_without_doubt_is_preferred_within_ten_percent(comparison):
    """As `recommendation` prefers it: at once if its error is 2 % larger at most, else if nothing better is found."""
    rungs = [rung for rung in comparison.rungs if not rung.reduced]
    (simpler,) = (rung for rung in comparison.rungs if rung.reduced)
    whole = next(rung for rung in rungs if rung.name == "friction_lag")

    def worse(factor):
        error = factor * whole.error
        return lambda source, law, held: simpler._replace(held_out_rmse=error, reduced="", held=held)

    for factor in (1.01, 1.08):
        (taken,) = reduced(rungs, worse(factor), lambda name: None, nothing_ahead)
        assert taken.name == "friction_lag_reduced" and taken.reduced == "friction_lag reduced to Lag(Linear)"
        assert recommendation([*rungs, taken]).rung is taken
    assert list(reduced(rungs, worse(1.12), lambda name: None, nothing_ahead)) == []


def test_a_law_left_aside_for_its_doubt_is_made_simpler_where_it_predicts_better(comparison):
    linear, whole, simpler = comparison.rungs

    def recommended(factor):
        near = linear._replace(held_out_rmse=factor * whole.error)
        assert recommendation([near, whole]).rung is near
        return list(reduced([near, whole], lambda source, law, held: simpler, lambda name: None, nothing_ahead))

    assert [rung.name for rung in recommended(1.05)] == ["friction_lag_reduced"] and recommended(1.01) == []


def test_without_a_law_free_of_doubt_the_one_with_the_least_is_listed(comparison):
    """If it predicts as well as the whole law, in whose place it is recommended, and the verdict says so."""
    _, whole, simpler = comparison.rungs
    note = next(e.note for e in whole.result.parameters if e.note)
    lag = [e._replace(note=note * e.name.endswith("lag_time")) for e in simpler.result.parameters]
    doubtful = simpler._replace(result=dataclasses.replace(simpler.result, parameters=tuple(lag)), reduced="")
    others = [rung._replace(held_out_rmse=1.5 * whole.error) for rung in comparison.rungs if not rung.doubt][:1]

    def fitted(source, law, held):
        return doubtful if isinstance(law, Lag) and isinstance(law.law, Linear) else whole._replace(held_out_rmse=1e3)

    (taken,) = reduced([*others, whole], fitted, lambda name: None, nothing_ahead)
    assert taken.doubt == "1 not identifiable" and taken.reduced == "friction_lag reduced to Lag(Linear)"
    choice = recommendation([*others, whole, taken])
    assert choice.rung is taken
    assert (
        "it is friction_lag reduced to Lag(Linear), with fewer numbers in doubt"
        in why(choice, [whole, taken], made=taken.reduced)[0]
    )
    stopped = dataclasses.replace(doubtful.result, status=Status.STEP_LIMIT)

    def not_to_its_end(source, law, held):
        return fitted(source, law, held)._replace(result=stopped)

    assert list(reduced([*others, whole], not_to_its_end, lambda name: None, nothing_ahead)) == []
    near = [rung._replace(held_out_rmse=1.05 * whole.error) for rung in others]  # recommended, as it is without doubt
    assert list(reduced([*near, whole], fitted, lambda name: None, nothing_ahead)) == []


@pytest.mark.slow
def test_every_plainer_law_has_fewer_numbers_and_about_the_force():
    """Of all laws of the contract; in steady sliding at the largest velocity, where friction has given."""
    found = set()
    for law in (make() for make in LAWS.values()):
        names = [p.path for p in parameters(law) for _ in range(np.size(p.value))]
        for undetermined in (names[:count] for count in range(1, len(names) + 1)):
            plain = law.plainer(undetermined, 0.5)
            if plain is None:
                break
            found.add(type(law).__name__)
            assert sum(np.size(p.value) for p in parameters(plain)) - len(held_of(plain, 0.5)) < len(names), law
            velocity = np.array([0.1 if isinstance(plain, Besinger) else 0.5])  # where its valve is closed
            pair = [float(quasi_static(one, velocity).force[0]) for one in (law, plain)]
            assert 0.3 < pair[1] / pair[0] < 2.0, (law, plain, pair)
    assert found == {"Bilinear", "Besinger", "Degressive", "PiecewiseLinear", "BoucWen", "LuGre", "ViscoPlastic"}


@pytest.mark.parametrize("fastest", [0.5, 0.2])
def test_a_curve_loses_the_knots_at_which_it_bends_least(fastest):
    """Also knots beyond the largest velocity of the records; what it bends by most stays where it is."""
    curve = PiecewiseLinear([-0.35, -0.1, 0.05, 0.3], [1000.0, 1000.0, 1005.0, 4000.0, 4000.0])
    plain = curve.plainer(["knots"] * 4 + ["slopes"], fastest)
    assert isinstance(plain, PiecewiseLinear)
    assert plain.knots.size == 2 and float(plain.knots[1]) == pytest.approx(0.05)
    np.testing.assert_allclose(plain.slopes, [1000.0, 1000.0, 4000.0], rtol=0.01)
    far = PiecewiseLinear([0.05, 1e9, 1e10, 2e10], [1000.0, 4000.0, 4000.0, 4000.0, 3000.0])
    far = eqx.tree_at(lambda law: law.knots, far, jnp.array([0.05, 1e9, 1e10, 1e10]))  # where a fit may end
    near = far.plainer(["knots"], fastest)
    assert isinstance(near, PiecewiseLinear)
    np.testing.assert_allclose(near.knots, [0.05])
    np.testing.assert_allclose(near.slopes, [1000.0, 4000.0], rtol=0.01)
    assert isinstance(PiecewiseLinear([1e9, 2e9], [900.0, 900.0, 900.0]).plainer(["knots"], fastest), Linear)
    assert isinstance(PiecewiseLinear([0.1], [900.0, 2000.0]).plainer(["knots"], fastest), Bilinear)
    assert PiecewiseLinear([], [1000.0]).plainer(["slopes"], fastest) is None


def test_terms_without_force_are_no_part_of_a_simpler_law():
    curve, lag = Bilinear(2000.0, 1000.0), Lag(Linear(1000.0), 0.01)
    assert without_zero_terms(curve + Spring(0.0)) is curve and without_zero_terms(lag) is lag
    both, nothing = without_zero_terms(curve + Spring(0.0) + lag), Spring(0.0) + Spring(0.0)
    assert isinstance(both, Sum) and both.terms == (curve, lag) and without_zero_terms(nothing) is nothing
