"""The mono-tube damper: oil on both sides of a piston, gas at the end of the tube."""

from typing import final

import jax.numpy as jnp
import numpy as np

from jaxdamp._limits import at_least, at_most, within
from jaxdamp._root import increasing_root
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers._tube import AbstractTube, Oil, newton_step
from jaxdamp.dampers._tube_start import BULK_MODULUS, tube_start
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.coulomb_friction import CoulombFriction
from jaxdamp.dampers.gas_spring import LEAST_SHARE, GasSpring
from jaxdamp.dampers.piston_flow import PistonFlow
from jaxdamp.parameters import parameter, positive, setting


@final
class MonoTube(AbstractTube):
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

    @property
    def stroke_limits(self) -> tuple[Scalar, Scalar]:
        """Lowest and highest stroke [m]: 5 % of the gas is left, 5 % of the volume above the piston is left."""
        full = 1.0 - LEAST_SHARE
        return -full * self.gas.volume / self.gas.rod_area, full * self.rebound_volume / self.piston.area

    def pressures(self, x: ScalarLike, deflection: ScalarLike) -> tuple[Scalar, Scalar]:
        """p_r and p_c [Pa, absolute] at stroke x [m] and deflection e [m]."""
        return self._above(x, deflection), self._gas_pressure(self._gas_stroke(x, deflection))

    def _stiffnesses(self, x: ScalarLike) -> tuple[Scalar, ...]:
        return (self._stiffness_above(x),)

    def _gas_stroke(self, x: ScalarLike, *deflections: ScalarLike) -> Scalar:
        (deflection,) = deflections
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

    def _roots_at(self, x: ScalarLike, deflections: State) -> tuple[Scalar, ...]:
        (deflection,) = own_states(self, deflections, 1)
        return (self.piston.root(self._drop(x, deflection)),)

    def _stage(self, x: ScalarLike, v: ScalarLike, now: Oil, duration: ScalarLike, *, search: bool) -> Oil:
        free = now.deflections[0] + duration * v  # without flow
        above, below = self.pressures(x, free)
        passages = self.piston.passages(above >= below)

        def surplus(root: Scalar) -> Scalar:
            ahead = free - duration * self.piston.flow_velocity(root, passages)
            return self.piston.drop(root) - self._drop(x, ahead)

        # The flow reduces the pressure drop that causes it: S is between zero and the value without flow.
        most = self.piston.root(above - below)
        zero = jnp.zeros_like(most)
        lower, upper = at_most(most, zero), at_least(most, zero)
        (before,) = now.roots
        guess = jnp.where(before * most > 0, within(before, lower, upper), most)
        if search:
            root = increasing_root(surplus, guess, lower, upper, steps=20)
        else:
            root = newton_step(surplus, guess, lower, upper)
        return Oil((v - self.piston.flow_velocity(root, passages))[None], (root,))

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
        geometry = piston_diameter, rod_diameter, gas_pressure, gas_volume
        start = tube_start("MonoTube", (velocity, force, stroke), *geometry)
        area, rebound, compression = start.area, *(start.valve(side, start.area) for side in (1, -1))
        bleed = float(np.sqrt(rebound.bleed_area * compression.bleed_area))
        opening = min(rebound.opening_pressure, compression.opening_pressure)
        leak = rebound._replace(bleed_area=bleed, opening_pressure=opening).leak
        return cls(
            PistonFlow(area, bleed, *rebound[1:4], *compression[1:4], leak=leak),
            start.gas,
            start.seal(rebound, compression),
            rebound_volume or start.oil_volume(1, area),
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
