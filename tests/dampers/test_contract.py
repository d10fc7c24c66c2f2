"""Every law satisfies the contract."""

import dataclasses
import inspect

import jax
import numpy as np
import pytest

from jaxdamp import dampers
from jaxdamp._guesses import shared_names
from jaxdamp.dampers import (
    AbstractDamper,
    AccelerationSurface,
    Besinger,
    Bilinear,
    BoucWen,
    BumpStop,
    Bushing,
    CoulombFriction,
    CreepingViscoPlastic,
    Dahl,
    Degressive,
    DigressiveProgressive,
    ForceSurface,
    FrequencySelective,
    GasSpring,
    Heated,
    Hybrid,
    HyperbolicTangent,
    KaradayiMasada,
    Lag,
    Linear,
    Linkage,
    LuGre,
    ModifiedBoucWen,
    MonoTube,
    MotionRatio,
    NeuralHysteresis,
    PiecewiseLinear,
    PistonFlow,
    Play,
    Polynomial,
    PowerLaw,
    Saturating,
    Scheduled,
    SegmentedPolynomial,
    SeriesSpring,
    SplineTable,
    Spring,
    StribeckFriction,
    StrokeDependent,
    StrokeScaled,
    Table,
    TemperatureScaled,
    Thinned,
    TwinTube,
    ViscoPlastic,
)
from jaxdamp.testing import CHECKS, check_alike_ports, check_inside_wrappers, check_law
from jaxdamp.testing.law_checks import SLOTS


def degressive(knee_width=1e-3, offset=0.0):
    return PowerLaw(1800.0, 0.4, 900.0, 0.5, offset, 0.7 * offset, knee_width=knee_width)


def slopes(knee_width=0.0):
    return PiecewiseLinear([-0.35, -0.08, 0.06, 0.3], [700.0, 1100.0, 2300.0, 3600.0, 1500.0], knee_width)


def segmented():
    v = np.linspace(-1.2, 1.1, 400)
    return SegmentedPolynomial.guess(v, 1500.0 * np.tanh(3.0 * v) + np.where(v > 0, 1400.0, 500.0) * v)


def blow_off(knee_width=0.0):
    return DigressiveProgressive(8000.0, 0.1, 900.0, 5000.0, 0.06, 500.0, 300.0, 200.0, knee_width)


def stroke_table():
    force = [[-900.0, -150.0, 0.0, 300.0, 1500.0], [-800.0, -250.0, 0.0, 500.0, 2000.0]]
    return StrokeDependent.from_grid([-0.012, 0.007], [-1.0, -0.1, 0.0, 0.2, 1.0], force)


def network(elements=2):
    return NeuralHysteresis.random(
        jax.random.key(2), elements=elements, width=3, velocity_scale=0.3, force_scale=500.0, stiffness=2e5
    )


def stopped():
    return Bilinear(2600.0, 1200.0) + BoucWen(800.0, 0.0, 300.0, 1e-3) + BumpStop(0.006, 60e3, end="both")


LEVER = [-0.02, -0.004, 0.003, 0.03], [0.9, 0.8, 0.65, 0.6]
LAWS = {
    "linear": lambda: Linear(2500.0),
    "bilinear, sharp": lambda: Bilinear(2600.0, 1200.0),
    "bilinear, rounded": lambda: Bilinear(2600.0, 1200.0, knee_width=0.02),
    "slopes, sharp": slopes,
    "slopes, rounded": lambda: slopes(0.02),
    "slopes, no knot": lambda: PiecewiseLinear([], [1500.0]),
    "slopes, falling": lambda: PiecewiseLinear([-0.2, 0.2], [900.0, 2500.0, -300.0], monotone=False),
    "power 0.4, offsets": lambda: degressive(offset=30.0),
    "power 0.65": lambda: PowerLaw(2600.0, 0.65, 1550.0, 0.65),
    "power 1": lambda: PowerLaw(2500.0, 1.0, 1300.0, 1.0),
    "power 1.8": lambda: PowerLaw(3000.0, 1.8, 2500.0, 1.8, 50.0, 20.0),
    "polynomial": lambda: Polynomial([2500.0, 300.0, -400.0, 50.0, 80.0], (-1.5, 1.2)),
    "segmented polynomial": segmented,
    "table": lambda: Table(
        [-1.1, -0.4, -0.1, 0.0, 0.05, 0.3, 1.0], [-1400.0, -800.0, -450.0, 0.0, 300.0, 1500.0, 2900.0]
    ),
    "table of two": lambda: Table([-1.0, 1.0], [-1500.0, 1500.0]),
    "Besinger, published": lambda: Besinger(14_400.0, 15_600.0, 3_600.0, 0.125, 0.7),
    "Besinger, narrow": lambda: Besinger(14_400.0, 15_600.0, 3_600.0, 0.125, 0.07),
    "Besinger, car": lambda: Besinger(900.0, 2800.0, 700.0, 0.25, 0.05),
    "friction": lambda: CoulombFriction(40.0, 0.004),
    "series spring, stiff": lambda: SeriesSpring(Linear(15_000.0), 1.5e7),
    "series spring, soft cubic": lambda: SeriesSpring(Besinger(14_400.0, 15_600.0, 3_600.0, 0.125, 0.7), 1.5e5, 1.2e8),
    "series spring, power": lambda: SeriesSpring(degressive(knee_width=0.01), 8e5),
    "series spring, sum": lambda: SeriesSpring(slopes(0.02) + CoulombFriction(40.0, 0.02), 5e5),
    "lag": lambda: Lag(Linear(2500.0), 0.004),
    "lag, slopes": lambda: Lag(slopes(), 0.003),
    "lag, power": lambda: Lag(degressive(knee_width=0.01), 0.002),
    "lag of friction": lambda: Lag(Linear(2000.0) + CoulombFriction(60.0, 0.01), 0.004),
    "lag of lag": lambda: Lag(Lag(Linear(2000.0), 0.002), 0.004),
    "motion ratio": lambda: MotionRatio(slopes(), 0.7),
    "motion ratio of series spring": lambda: MotionRatio(SeriesSpring(Bilinear(2600.0, 1200.0), 4e5), 0.8),
    "linkage": lambda: Linkage(slopes(), *LEVER),
    "linkage of friction and a stop": lambda: Linkage(stopped(), *LEVER),
    "linkage of a lag": lambda: Linkage(Lag(slopes(0.02), 0.003), *LEVER),
    "scaled": lambda: 1.3 * Besinger(900.0, 2800.0, 700.0, 0.25, 0.05),
    "sum": lambda: Linear(900.0) + 0.5 * slopes(0.01) + CoulombFriction(30.0, 0.01),
    "sum of lags": lambda: Lag(Linear(900.0), 0.01) + Linear(300.0) + MotionRatio(Lag(slopes(0.02), 0.003), 0.9),
    "series spring of lag": lambda: SeriesSpring(Linear(2000.0) + 0.5 * Lag(Linear(900.0), 0.01), 5e5),
    "saturating, tanh": lambda: Saturating(900.0, 9000.0, 400.0, 6000.0, 700.0, 300.0),
    "saturating, arctan": lambda: Saturating(900.0, 9000.0, 400.0, 6000.0, 700.0, 300.0, shape="arctan"),
    "saturating, algebraic": lambda: Saturating(900.0, 9000.0, 400.0, 6000.0, shape="algebraic"),
    "degressive": lambda: Degressive(98_727.9, 4.77954, 52_526.6, 3.0),
    "degressive, straight in compression": lambda: Degressive(8000.0, 2.5, 3000.0, 0.0),
    "digressive-progressive, sharp": blow_off,
    "digressive-progressive, rounded": lambda: blow_off(0.01),
    "Stribeck friction": lambda: StribeckFriction(40.0, 70.0, 0.02, 0.002),
    "Stribeck friction, no breakaway": lambda: StribeckFriction(40.0, 25.0, 0.05, 0.01),
    "gas spring": lambda: GasSpring(2e6, 6e-5, 1e-4, 1.3),
    "bump stop": lambda: BumpStop(0.006, 60e3, 2e8, 1500.0, end="both"),
    "lag at another temperature": lambda: TemperatureScaled(Lag(Linear(2500.0), 0.004), 263.15),
    "heated": lambda: Heated(Bilinear(2600.0, 1200.0, knee_width=0.02), 0.02, 0.5, heat_capacity=5.0),
    "thinned": lambda: Thinned(Bilinear(2600.0, 1200.0, knee_width=0.02), 0.2, 0.1),
    "scaled along the stroke": lambda: StrokeScaled(Bilinear(2600.0, 1200.0, knee_width=0.02), -3.0, 200.0),
    "hydraulic stop": lambda: StrokeDependent((2.5 * Linear(1500.0), Bilinear(1500.0, 900.0)), [-0.03, 0.004]),
    "stroke table": stroke_table,
    "Bouc and Wen": lambda: BoucWen(800.0, 2000.0, 300.0, 1e-3, 0.75, 1.5),
    "Bouc and Wen, tight": lambda: BoucWen(800.0, 0.0, 300.0, 5e-5, 0.5, 1.0),
    "Dahl": lambda: Dahl(4e4, 40.0),
    "Dahl, stiff": lambda: Dahl(4e6, 40.0),
    "LuGre": lambda: LuGre(1e5, 300.0, 200.0, 40.0, 60.0, 0.05),
    "LuGre, stiff": lambda: LuGre(1e6, 300.0, 0.0, 40.0, 60.0, 0.01),
    "hyperbolic tangent": lambda: HyperbolicTangent(900.0, 500.0, 400.0, 30.0, 0.6),
    "Karadayi and Masada": lambda: KaradayiMasada(2600.0, 1200.0, 40.0, 0.01, 1e6, 3e-4),
    "play": lambda: Play(Linear(2000.0) + CoulombFriction(40.0, 0.02), 1e6, 3e-4),
    "piston flow": lambda: PistonFlow(1.42e-3, 1.6e-6, 1.2e6, 1.2e11, 2.5e-5, 5e5, 4e10, 4e-5, 2e-13),
    "mono-tube": MonoTube.reference,
    "twin-tube": TwinTube.reference,
    "visco-plastic": lambda: ViscoPlastic(
        100.0, 900.0, 0.6, 0.02, [200.0, 300.0], [2e-3, 1e-3], [2e-4, 1e-3], [0.5, 0.1], 0.8
    ),
    "creeping visco-plastic": lambda: CreepingViscoPlastic(
        100.0, 900.0, 0.6, 0.02, [200.0, 300.0], [2e-3, 1e-3], [2e-4, 1e-3], [0.5, 0.1], 0.8
    ),
    "modified Bouc and Wen, published": lambda: ModifiedBoucWen.prototype(1.5),
    "neural hysteresis": network,
    "hybrid": lambda: Hybrid(PiecewiseLinear([-0.1, 0.1], [700.0, 2000.0, 900.0], 0.02), network(1)),
    "spring": lambda: Linear(900.0) + Spring(2000.0),
    "scheduled": lambda: Scheduled((Dahl(5e4, 50.0), Dahl(3e5, 600.0)), [0, 2], 0.7),
    "schedule of forces": lambda: Scheduled((Linear(900.0), Dahl(3e5, 600.0)), [0, 2], 0.7, blend="force"),
    "lag of a schedule": lambda: Lag(Scheduled((slopes(0.02), slopes(0.02)), [0, 1], 0.3), 0.003),
    "spline table": lambda: SplineTable(
        [-1.1, -0.4, -0.1, 0.0, 0.05, 0.3, 1.0], [-1400.0, -1350.0, -450.0, 0.0, 300.0, 1500.0, 2900.0]
    ),
    "spline table of two": lambda: SplineTable([-1.0, 1.0], [-1500.0, 1500.0]),
    "frequency selective": lambda: FrequencySelective(slopes(0.02), Linear(800.0), 0.03, 0.003),
    "bushing": lambda: Bushing(Bilinear(2600.0, 1200.0, knee_width=0.02), 2e6, 6e5, 800.0),
    "surface over stroke and velocity": lambda: ForceSurface(
        [[0.0, 900.0, 0.0, 40.0], [0.0, 100.0, 0.0, 0.0], [0.0, 150.0, 0.0, 0.0]],
        (-0.03, 0.04),
        (-0.6, 0.6),
        500.0,
        outside="hold",
    ),
    "surface over velocity and acceleration": lambda: AccelerationSurface(
        [[0.0, -60.0], [900.0, 0.0], [0.0, 0.0], [40.0, 10.0]], (-0.6, 0.6), (-60.0, 60.0), 500.0, outside="hold"
    ),
    "network and spring": lambda: network() + Spring(2000.0),
    "lag of a network": lambda: Lag(network(1), 0.004),
    "schedule of lags": lambda: Scheduled((Lag(Linear(900.0), 0.01), Lag(Linear(1500.0), 0.02)), [0, 2], 0.7),
    "scaled sum with hysteresis": lambda: 0.5 * (BoucWen(800.0, 0.0, 300.0, 1e-3) + Spring(2000.0)),
}

# Further examples of a kind that is held to the contract anyway run before a release; what compiles for long is slow.
FURTHER = {
    "bilinear, sharp",
    "slopes, no knot",
    "slopes, falling",
    "power 0.65",
    "power 1.8",
    "table of two",
    "saturating, arctan",
    "saturating, algebraic",
    "degressive, straight in compression",
    "digressive-progressive, sharp",
    "Stribeck friction, no breakaway",
    "spline table of two",
    "Besinger, narrow",
    "series spring, stiff",
    "series spring, power",
    "series spring, sum",
    "series spring of lag",
    "lag, slopes",
    "lag, power",
    "lag of friction",
    "lag of lag",
    "lag of a schedule",
    "motion ratio of series spring",
    "linkage of friction and a stop",
    "linkage of a lag",
    "sum of lags",
    "Bouc and Wen, tight",
    "Dahl, stiff",
    "LuGre, stiff",
    "network and spring",
    "lag of a network",
    "schedule of lags",
    "scaled sum with hysteresis",
}
LONG = {
    "visco-plastic",
    "creeping visco-plastic",
    "segmented polynomial",
    "series spring, soft cubic",
    "Karadayi and Masada",
    "play",
    "mono-tube",
    "twin-tube",
    "modified Bouc and Wen, published",
    "neural hysteresis",
    "hybrid",
    "bushing",
    "scheduled",
    "Bouc and Wen",
    "piston flow",
    "frequency selective",
    "LuGre",
    "spline table",
    "stroke table",
    "surface over velocity and acceleration",
    "schedule of forces",
}

# What a law breaks by its nature, and why. It must indeed break it; all other checks hold for it too.
EXCEPTIONS = {
    "gas spring": {"rest": "its charge pushes the rod out at rest"},
    "mono-tube": {"rest": "its charge pushes the rod out at rest"},
    "twin-tube": {"rest": "its charge pushes the rod out at rest"},
    "lag of a network": {"passive": "a lag behind a force that springs back gives energy out"},
}


def _parts(law):
    yield law
    for value in vars(law).values():
        for part in value if isinstance(value, tuple) else [value]:
            if isinstance(part, AbstractDamper):
                yield from _parts(part)


def test_every_law_is_held_to_the_contract():
    exported = {c for c in vars(dampers).values() if inspect.isclass(c) and issubclass(c, AbstractDamper)}
    assert {c.__name__ for c in exported} <= {*dampers.__all__, *shared_names(dampers)}
    assert set(LAWS) >= FURTHER | LONG
    held = {type(part) for name, make in LAWS.items() if name not in FURTHER for part in _parts(make())}
    assert {c for c in exported if not c.__name__.startswith("Abstract")} <= held


IN_PLACES = {"inside wrappers", "alike ports"}  # these run below, the second with several laws in a car


@pytest.mark.users_flags
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.exhaustive] * (name in FURTHER) + [pytest.mark.slow] * (name in LONG))
        for name in LAWS
    ],
)
def test_contract(name):
    law, broken = LAWS[name](), EXCEPTIONS.get(name, {})
    check_law(law, leave_out=IN_PLACES | set(broken))
    for check in broken:
        with pytest.raises(AssertionError, match=f"breaks '{check}'"):
            check_law(law, leave_out=set(CHECKS) - {check})


@pytest.mark.slow_one_in(5)
@pytest.mark.parametrize("name", [name for name in LAWS if name not in FURTHER])
@pytest.mark.exhaustive_cases("mono-tube", "hybrid")
def test_inside_every_wrapper(name):
    check_inside_wrappers(LAWS[name]())


GROUPS = [list(LAWS)[i : i + len(SLOTS)] for i in range(0, len(LAWS), len(SLOTS))]


@pytest.mark.slow_one_in(8)
@pytest.mark.parametrize("group", GROUPS, ids=lambda group: f"{group[0]} to {group[-1]}")
def test_at_alike_ports(group):
    check_alike_ports(*(LAWS[name]() for name in group))


@pytest.mark.exhaustive
@pytest.mark.parametrize("group", GROUPS[::4], ids=lambda group: f"{group[0]} to {group[-1]}")
def test_at_alike_ports_in_single_precision(group):
    with jax.enable_x64(False):
        check_alike_ports(*(LAWS[name]() for name in group), rtol=1e-5)


@pytest.mark.slow
@pytest.mark.users_flags
def test_the_whole_contract_of_one_law_in_single_and_double_precision():
    check_law(Linear(1500.0))
    with jax.enable_x64(False):
        check_law(Linear(1500.0), leave_out=set(CHECKS) - {"shapes", "derivatives"})


def test_an_unknown_check_is_refused():
    with pytest.raises(ValueError, match=r"`leave_out` must be one of .*'pasive'.*'passive'"):
        check_law(Linear(1.0), leave_out=["pasive"])


def test_a_number_in_place_of_a_law_inside_is_refused_in_words():
    """The first look at a field is at its type, before what else a law asks of it."""
    looked = set()
    for law in (part for make in LAWS.values() for part in _parts(make())):
        inside = [f.name for f in dataclasses.fields(law) if isinstance(getattr(law, f.name), AbstractDamper)]
        for name in inside:
            looked.add(type(law))
            with pytest.raises(ValueError, match=rf"`{type(law).__name__}\.{name}` must be a .*, but is the number 3"):
                dataclasses.replace(law, **{name: 3.0})
    assert len(looked) > 10
