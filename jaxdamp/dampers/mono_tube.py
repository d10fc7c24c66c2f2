"""The mono-tube damper: oil on both sides of a piston, gas at the end of the tube."""

from typing import NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._limits import at_least, at_most, within
from jaxdamp._root import increasing_root
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._mono_tube_start import charge_start, static_force, valve_start
from jaxdamp.dampers._steps import GAMMA, sdirk2
from jaxdamp.dampers.base import AbstractDamper, own_states
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.coulomb_friction import CoulombFriction
from jaxdamp.dampers.gas_spring import LEAST_SHARE, GasSpring, gas_pressure
from jaxdamp.dampers.piston_flow import PistonFlow, flow_per_area
from jaxdamp.parameters import parameter, positive, setting


def oil_stiffness(x: ScalarLike, bulk_modulus: ScalarLike, area: ScalarLike, volume: ScalarLike) -> Scalar:
    """B A/(V_r − A x) [Pa/m], increase of the oil pressure with its deflection; V_r − A x is 5 % of V_r or more."""
    return bulk_modulus * area / at_least(volume - area * x, LEAST_SHARE * volume)


EXPONENT, ATMOSPHERE, BULK_MODULUS = 1.3, 101_325.0, 1e9  # n, Pa and Pa where nothing is known
STEP_ANGLE = 0.0055  # rad, of a fit: at 0.015 the gas volume is wrong by a standard error, at 0.06 others by two
LEAK_SHARE = 0.01  # of the flow through the bleed when a valve opens


class _Oil(NamedTuple):
    """Within a step: the deflection [m] or its rate [m/s], and S of the flow [√Pa]."""

    deflection: Scalar
    root: Scalar


@final
class MonoTube(AbstractDamper):
    """F = A (p_r − p_c) − (p_c − p_atm) A_r + F_c tanh(v/v_f), p_r and p_c the pressures above and below the piston.

    It combines three laws: the `piston` of annular area A with bleed, leak and valves, the `gas`, which acts on the rod
    area A_r, and the `friction` of the seal; with oil of bulk modulus B between them:

        ė = v − Q(p_r − p_c)/A                                       deflection e [m], the only state
        p_r = max(p₀ + B A e/(V_r − A x), p_v)                       oil above the piston, or a cavity
        p_c = p₀ (V_g/(V_g + A_r x + A e))ⁿ                          gas, and the oil below the piston

    e is the part of the stroke due to compression of the oil above the piston, x − e the part due to flow. Both
    pressures follow from balances of volume, so no oil is lost. (The usual equations for p_r and p_c, with one volume
    flow out of one chamber and into the other, lose oil at the rate of the dissipated power over B: with `reference()`
    at 12 Hz and 10 mm 1.3 cm³/s of the 60 cm³ of gas.) A cavity opens where p_r would fall below p_v, as in fast
    compression, and closes when the oil has returned. The oil below the piston is assumed to be stiff: its compliance
    is below 1 % of that of the gas.

    At rest the gas pushes the rod out, as in `GasSpring` (`relative` of the gas subtracts this force). In slow motion
    the law has the stiffness n p₀ A_r²/V_g and only the hysteresis of the friction; hysteresis increases with
    frequency, as with a `SeriesSpring` of stiffness B A²/(V_r − A x).

    The step is the two-stage SDIRK method (second order, L-stable) with one monotone scalar equation per stage: stable
    at any step. With steps of 1 ms the error is 0.3 % of the peak force (RMS, `reference()`, 12.5 Hz, 10 mm): the front
    of the force after a reversal takes about 1 ms. If a cavity closes within a step the error is 3 % (20 mm), with
    steps of 0.25 ms 0.03 %: use `substeps=4` in `respond`, or `dt=2.5e-4` in a vehicle. Simulations of vehicles divide
    longer steps, and warn if the error is significant.

    Valid within `stroke_limits`, which `respond` enforces; outside, the chamber above the piston has 5 % of its volume
    and the gas pressure follows its tangent, so that forces are finite. For stops, add a `BumpStop`.

    A fit cannot distinguish B from V_r, nor n from p₀ and V_g without slow tests over the whole stroke: geometry is not
    fitted, and `freeze=["gas.*"]` holds the gas charge. B affects the hysteresis at the highest frequencies only. Fit
    `incompressible()` to slow records first: it is the same `piston`, `gas` and `friction`.

    Equations after Talbott and Starkey (SAE 2002-01-3337), from a secondary source.

    >>> law = MonoTube.reference()
    >>> round(float(law.force(0.0, 0.0, law.initial_state())), 2)
    -189.87
    >>> [round(float(limit), 3) for limit in law.stroke_limits]
    [-0.57, 0.074]
    """

    piston: PistonFlow
    gas: GasSpring
    friction: CoulombFriction
    rebound_volume: Number = setting("m³", "V_r, oil above the piston at stroke zero", positive)
    bulk_modulus: Number = parameter("Pa", "B, of the oil and its chamber", positive, adjustable=False)
    cavitation_pressure: Number = setting("Pa", "p_v, absolute pressure of a cavity", positive, default=1e5)

    def traits(self) -> Traits:
        """The pressures are states; the friction of the seal alone cannot balance a spring; gas is an offset."""
        own = super().traits()._replace(has_feed_through=False, contains_offset=True)
        return own._replace(solves_equation=True, step_angle=STEP_ANGLE)

    def __check_init__(self) -> None:
        charge, cavity = _checks.concrete(self.gas.pressure), _checks.concrete(self.cavitation_pressure)
        if charge is not None and cavity is not None and not np.all(charge > cavity):
            must = "be above the cavitation pressure [Pa]"
            _checks.refuse("MonoTube.gas.pressure", must, f"{charge} beside {cavity}", "It is an absolute pressure.")

    @property
    def stroke_limits(self) -> tuple[Scalar, Scalar]:
        """Lowest and highest stroke [m]: 5 % of the gas is left, 5 % of the volume above the piston is left."""
        full = 1.0 - LEAST_SHARE
        return -full * self.gas.volume / self.gas.rod_area, full * self.rebound_volume / self.piston.area

    def pressures(self, x: ScalarLike, deflection: ScalarLike) -> tuple[Scalar, Scalar]:
        """p_r and p_c [Pa, absolute] at stroke x [m] and deflection e [m]."""
        gas = self.gas
        rise = oil_stiffness(x, self.bulk_modulus, self.piston.area, self.rebound_volume) * deflection
        below = gas_pressure(self._gas_stroke(x, deflection), gas.pressure, gas.volume, gas.rod_area, gas.exponent)
        return at_least(gas.pressure + rise, self.cavitation_pressure), below

    def _gas_stroke(self, x: ScalarLike, deflection: ScalarLike) -> Scalar:
        """Stroke [m] at which the rod alone would give the present gas volume."""
        return x + self.piston.area * deflection / self.gas.rod_area

    def _drop(self, x: ScalarLike, deflection: ScalarLike) -> Scalar:
        """p_r − p_c [Pa]."""
        above, below = self.pressures(x, deflection)
        return above - below

    def initial_state(self) -> State:
        """All oil at the pressure of the gas charge."""
        return jnp.zeros(1)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        (deflection,) = own_states(self, state, 1)
        gas = self.gas.force_stroke_velocity(self._gas_stroke(x, deflection), v)
        return self.piston.area * self._drop(x, deflection) + gas + self.friction.force_velocity(v)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rate of the deflection [m/s], v − Q/A."""
        (deflection,) = own_states(self, state, 1)
        drop = self._drop(x, deflection)
        return (v - self.piston.flow_velocity(self.piston.root(drop), self.piston.passages(drop >= 0)))[None]

    def _flow(
        self, x: ScalarLike, free: Scalar, duration: ScalarLike, before: Scalar, *, search: bool = True
    ) -> tuple[Scalar, Scalar]:
        """Q/A [m/s] and S [√Pa] of an implicit step: the flow that the pressures at its end cause.

        Arguments:
            x: stroke at the end [m].
            free: deflection at the end without flow [m].
            duration: duration of the step [s].
            before: S before the step [√Pa], from which the search starts.
            search: until the equation is solved; otherwise one step of Newton's method, for predictions.
        """
        above, below = self.pressures(x, free)
        passages = self.piston.passages(above >= below)

        def surplus(root: Scalar) -> Scalar:
            ahead = free - duration * self.piston.flow_velocity(root, passages)
            return self.piston.drop(root) - self._drop(x, ahead)

        # The flow reduces the pressure drop that causes it: S is between zero and the value without flow.
        most = self.piston.root(above - below)
        zero = jnp.zeros_like(most)
        lower, upper = at_most(most, zero), at_least(most, zero)
        guess = jnp.where(before * most > 0, within(before, lower, upper), most)
        if search:
            root = increasing_root(surplus, guess, lower, upper, steps=20)
        else:
            value, slope = jax.jvp(surplus, (guess,), (jnp.ones_like(guess),))
            root = within(guess - value / slope, lower, upper)
        return self.piston.flow_velocity(root, passages), root

    def _root_at(self, x: ScalarLike, deflection: Scalar) -> Scalar:
        """S [√Pa] at an instant."""
        return self.piston.root(self._drop(x, deflection))

    def implicit_stage(self, x: ScalarLike, v: ScalarLike, state: State, duration: ScalarLike) -> State:
        """One stage of backward Euler."""
        (deflection,) = own_states(self, state, 1)
        free = deflection + duration * v
        flow, _ = self._flow(x, free, duration, self._root_at(x - duration * v, deflection))
        return (free - duration * flow)[None]

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Two-stage SDIRK step; the velocity is taken as linear over the step."""
        return self._moved(x0, v0, x1, v1, state, dt, search=True)

    def predict(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """The step with one step of Newton's method in each stage: a third of the cost."""
        return self._moved(x0, v0, x1, v1, state, dt, search=False)

    def _moved(
        self,
        x0: ScalarLike,
        v0: ScalarLike,
        x1: ScalarLike,
        v1: ScalarLike,
        state: State,
        dt: ScalarLike,
        *,
        search: bool,
    ) -> State:
        (deflection,) = own_states(self, state, 1)

        def stage(share: float, now: _Oil) -> _Oil:
            v, duration = v0 + share * (v1 - v0), GAMMA * dt
            # the velocity is linear over the step
            x = x1 if share == 1.0 else x0 + share * (x1 - x0) - 0.5 * share * dt * (1.0 - share) * (v1 - v0)
            flow, root = self._flow(x, now.deflection + duration * v, duration, now.root, search=search)
            return _Oil(v - flow, root)

        def moved(rate: _Oil, now: _Oil, part: float) -> _Oil:
            return _Oil(now.deflection + part * dt * rate.deflection, rate.root)

        return sdirk2(stage, moved, _Oil(deflection, self._root_at(x0, deflection))).deflection[None]

    def incompressible(self) -> AbstractDamper:
        """`piston + gas + friction`, the limit B → ∞ without cavities: no states, for sweeps and for slow motion."""
        return self.piston + self.gas + self.friction

    @classmethod
    def guess(
        cls,
        velocity: np.ndarray,
        force: np.ndarray,
        stroke: np.ndarray,
        *,
        piston_diameter: float | None = None,
        rod_diameter: float | None = None,
        gas_pressure: float | None = None,
        gas_volume: float | None = None,
        rebound_volume: float | None = None,
    ) -> "MonoTube":
        """Starting values of a fit from measured samples and the geometry.

        Gas pressure and volume come from the mean force near rest and its slope over the stroke; bleed, opening
        pressure and stiffness of the valves from the knee of the mean force in each direction. Records without a slow
        test show little of the gas: state it. For `fit`, give the geometry in advance: `fit(functools.partial(
        MonoTube.guess, piston_diameter=0.046, rod_diameter=0.011), runs)`.

        Arguments:
            velocity: all samples [m/s].
            force: [N], with the gas force.
            stroke: [m].
            piston_diameter: of the tube [m].
            rod_diameter: [m].
            gas_pressure: p₀, absolute, at stroke zero [Pa], if it is known.
            gas_volume: V_g at stroke zero [m³], if it is known.
            rebound_volume: V_r, oil above the piston at stroke zero [m³]; if left out, that of the largest extension
                and one travel more. Only B/V_r shows in records.

        Raises:
            ValueError: no geometry; a rod as thick as the piston.
        """
        for name, given in (("piston_diameter", piston_diameter), ("rod_diameter", rod_diameter)):
            if given is None:
                example = "functools.partial(MonoTube.guess, piston_diameter=0.046, rod_diameter=0.011)"
                remedy = f"Write `fit({example}, runs)`."
                _checks.refuse(name, "be stated [m]", None, remedy)
            _checks.positive(name, given)
        assert piston_diameter is not None and rod_diameter is not None
        if not rod_diameter < piston_diameter:
            _checks.refuse("rod_diameter", f"be below the piston's {piston_diameter} m", rod_diameter)
        velocity, force, stroke = (np.asarray(a, dtype=float) for a in (velocity, force, stroke))
        rod_area = 0.25 * np.pi * rod_diameter**2
        area = 0.25 * np.pi * piston_diameter**2 - rod_area
        travel = max(float(np.ptp(stroke)), 1e-3)
        level, stiffness, friction = static_force(velocity, force, stroke)
        charge = charge_start(level, stiffness, travel, rod_area, EXPONENT, ATMOSPHERE)
        oil = force - level - stiffness * stroke
        rebound, compression = (valve_start(velocity, oil, side, area, float(flow_per_area())) for side in (1, -1))
        bleed = float(np.sqrt(rebound.bleed_area * compression.bleed_area))
        friction = min(friction, rebound.friction, compression.friction)  # hysteresis adds to each
        opening = min(rebound.opening_pressure, compression.opening_pressure)
        leak = LEAK_SHARE * float(flow_per_area()) * bleed / np.sqrt(opening)
        return cls(
            PistonFlow(area, bleed, *rebound[1:4], *compression[1:4], leak=leak),
            GasSpring(gas_pressure or charge.pressure, gas_volume or charge.volume, rod_area, EXPONENT),
            CoulombFriction(max(friction, 1.0), 0.01 * float(np.max(np.abs(velocity)))),
            rebound_volume or area * (max(float(np.max(stroke)), 0.0) + travel),
            BULK_MODULUS,
        )

    @classmethod
    def reference(cls) -> "MonoTube":
        """A passenger car damper of 46/11 mm: typical numbers from literature, not measured.

        C_d A_b with C_d = 0.7 and A_b = 1.6 mm², valves from 1.2 MPa (rebound) and 0.5 MPa (compression), 2 MPa of gas.
        """
        return cls(
            PistonFlow(
                area=1.52e-3 - 1e-4,
                bleed_area=1.6e-6,
                rebound_opening_pressure=1.2e6,
                rebound_valve_stiffness=1.2e11,
                rebound_valve_area=2.5e-5,
                compression_opening_pressure=5e5,
                compression_valve_stiffness=4e10,
                compression_valve_area=4e-5,
                leak=2e-13,
            ),
            GasSpring(pressure=2e6, volume=6e-5, rod_area=1e-4, exponent=1.3),
            CoulombFriction(friction_force=30.0, friction_velocity=2e-3),
            rebound_volume=1.1e-4,
            bulk_modulus=1.1e9,
        )
