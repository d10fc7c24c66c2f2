"""The twin-tube damper: oil on both sides of a piston, a base valve, oil and gas in the reserve around the tube."""

from typing import final

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxdamp._limits import at_least, at_most, within
from jaxdamp._root import Pair, newton_of_two, root_of_two
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._states import own_states
from jaxdamp.dampers._tube import AbstractTube, Oil, oil_stiffness
from jaxdamp.dampers._tube_start import BULK_MODULUS, tube_start
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.coulomb_friction import CoulombFriction
from jaxdamp.dampers.gas_spring import LEAST_SHARE, GasSpring
from jaxdamp.dampers.piston_flow import PistonFlow
from jaxdamp.parameters import parameter, positive, setting


@final
class TwinTube(AbstractTube):
    """F = A (p_r − p_c) − (p_c − p_atm) A_r + F_c tanh(v/v_f), p_r and p_c the pressures above and below the piston.

    It combines four laws: the `piston` of annular area A, the `base` valve between the oil below the piston and the
    reserve, the `gas` in the reserve, and the `friction` of the seal. The base valve passes what the rod of area A_r
    displaces: for `rebound` when oil returns from the reserve, for `compression` when the rod enters. `base.area` has
    no effect, since the rod area of the `gas` counts. With the bulk modulus B of the oil and A_c = A + A_r:

        ė = v − Q(p_r − p_c)/A                                    deflection e of the oil above the piston [m]
        ċ = −v + (Q(p_r − p_c) + Q_b(p_g − p_c))/A_c              deflection c of the oil below it [m]
        p_r = max(p₀ + B A e/(V_r − A x), p_v)                    oil above the piston, or a cavity
        p_c = max(p₀ + B A_c c/(V_c + A_c x), p_v)                oil below the piston, or a cavity
        p_g = p₀ (V_g/(V_g + A_r x + A e + A_c c))ⁿ               gas in the reserve

    All pressures follow from balances of volume, so no oil is lost (see `MonoTube`). In rebound the piston makes the
    force. In compression both valves do, A Δp + A_r Δp_b, and Δp_b must be about Δp or more: with less, a cavity opens
    above the piston, and the next rebound begins without force. So does compression after a rebound in which the
    intake (`base.rebound_*`) resists too much, by a cavity below the piston. The gas is at low pressure (0.1 to
    0.8 MPa): state a `cavitation_pressure` below it. That the reserve draws gas instead of oil, and aeration, are not
    modelled.

    The step is the two-stage SDIRK method (second order, L-stable) with two equations per stage: stable at any step. A
    record takes 1.6 to 2 times as long as with a `MonoTube`.

    Valid within `stroke_limits`, which `respond` enforces; outside, each chamber has 5 % of its volume and the gas
    pressure follows its tangent, so that forces are finite. For stops, add a `BumpStop`.

    A fit cannot distinguish intake and piston in rebound: hold the intake, which resists little, and the geometry,
    `freeze=["base.rebound_*", "gas.rod_area", "gas.exponent"]`. Only hysteresis tells piston and base valve apart in
    compression, so that `incompressible()`, for a first fit to slow records, leaves their shares open.

    Equations as of `MonoTube`, with a second chamber of oil and a second valve.

    >>> law = TwinTube.reference()
    >>> round(float(law.force(0.0, 0.0, law.initial_state())), 2)
    -125.25
    >>> [round(float(limit), 3) for limit in law.stroke_limits]
    [-0.189, 0.19]
    """

    piston: PistonFlow
    base: PistonFlow
    gas: GasSpring
    friction: CoulombFriction
    rebound_volume: Number = setting("m³", "V_r, oil above the piston at stroke zero", positive)
    compression_volume: Number = setting("m³", "V_c, oil below the piston at stroke zero", positive)
    bulk_modulus: Number = parameter("Pa", "B, of the oil and its chambers", positive, adjustable=False)
    cavitation_pressure: Number = setting("Pa", "p_v, absolute pressure of a cavity", positive, default=1e4)

    @property
    def stroke_limits(self) -> tuple[Scalar, Scalar]:
        """Lowest and highest stroke [m]: 5 % of the gas and of the oil below, and of the oil above is left."""
        gas = self.gas.volume / self.gas.rod_area
        full = 1.0 - LEAST_SHARE
        lowest = at_most(gas, self.compression_volume / self._full_area)
        return -full * lowest, full * self.rebound_volume / self.piston.area

    @property
    def _full_area(self) -> Scalar:
        """A_c [m²], of the tube."""
        return self.piston.area + self.gas.rod_area

    @property
    def base_on_rod(self) -> PistonFlow:
        """The base valve as a law of the rod: the force A_r Δp_b at the flow A_r v."""
        return eqx.tree_at(lambda base: base.area, self.base, self.gas.rod_area)

    def pressures(self, x: ScalarLike, above: ScalarLike, below: ScalarLike) -> tuple[Scalar, Scalar, Scalar]:
        """p_r, p_c and p_g [Pa, absolute] at stroke x [m] and deflections e and c [m]."""
        _, stiffness = self._stiffnesses(x)
        return (
            self._above(x, above),
            at_least(self.gas.pressure + stiffness * below, self.cavitation_pressure),
            self._gas_pressure(self._gas_stroke(x, above, below)),
        )

    def _stiffnesses(self, x: ScalarLike) -> tuple[Scalar, ...]:
        below = oil_stiffness(-x, self.bulk_modulus, self._full_area, self.compression_volume)
        return self._stiffness_above(x), below

    def _gas_stroke(self, x: ScalarLike, *deflections: ScalarLike) -> Scalar:
        above, below = deflections
        return x + (self.piston.area * above + self._full_area * below) / self.gas.rod_area

    def _rates(self, v: ScalarLike, roots: Pair) -> Pair:
        """ė and ċ [m/s] at S [√Pa] of piston and base valve."""
        through, inflow = self.piston.flow_either(roots[0]), self.base.flow_either(roots[1])  # Q/A, Q_b over its area
        return v - through, (self.piston.area * through + self.base.area * inflow) / self._full_area - v

    def initial_state(self) -> State:
        """All oil at the pressure of the gas charge."""
        return jnp.zeros(2)

    def force(self, x: ScalarLike, v: ScalarLike, state: State) -> Scalar:
        """Force [N]."""
        deflections = own_states(self, state, 2)
        above, below, reserve = self.pressures(x, *deflections)
        oil = self.piston.area * (above - below) + self.gas.rod_area * (reserve - below)
        gas = self.gas.force_stroke_velocity(self._gas_stroke(x, *deflections), v)
        return oil + gas + self.friction.force_velocity(v)

    def state_rate(self, x: ScalarLike, v: ScalarLike, state: State) -> State:
        """Rates of the deflections [m/s]."""
        return jnp.stack(self._rates(v, self._roots_at(x, state)))

    def _roots_at(self, x: ScalarLike, deflections: State) -> Pair:
        above, below, reserve = self.pressures(x, *own_states(self, deflections, 2))
        return self.piston.root(above - below), self.base.root(reserve - below)

    def _stage(self, x: ScalarLike, v: ScalarLike, now: Oil, duration: ScalarLike, *, search: bool) -> Oil:
        e, c = now.deflections

        def surplus(roots: Pair) -> Pair:
            e_rate, c_rate = self._rates(v, roots)
            above, below, reserve = self.pressures(x, e + duration * e_rate, c + duration * c_rate)
            return self.piston.drop(roots[0]) - (above - below), self.base.drop(roots[1]) - (reserve - below)

        # Flow reduces differences of pressure: none is above the largest one without flow.
        free = self.pressures(x, e + duration * v, c - duration * v)
        largest = at_least(at_least(free[0], free[1]), free[2]) - at_most(at_most(free[0], free[1]), free[2])
        most = self.piston.root(largest), self.base.root(largest)

        first, second = now.roots
        roots = first, second
        if search:
            roots = root_of_two(surplus, roots, most)
        else:
            for _ in range(2):
                first, second = newton_of_two(surplus, roots)
                roots = within(first, -most[0], most[0]), within(second, -most[1], most[1])
        return Oil(jnp.stack(self._rates(v, roots)), roots)

    def incompressible(self) -> AbstractDamper:
        """`piston + base + gas + friction`, the limit B → ∞ without cavities: no states, for sweeps and slow motion."""
        return self.piston + self.base_on_rod + self.gas + self.friction

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
        compression_volume: float | None = None,
    ) -> "TwinTube":
        """Starting values of a fit from measured samples and the geometry.

        As `MonoTube.guess`. In rebound the piston makes the force, and oil returns through an intake that opens at
        0.01 MPa. In compression piston and base valve have the same pressure drop: with less in the base valve the oil
        above the piston would cavitate, with more the oil would be compressed more than it need be.

        Arguments:
            velocity: all samples [m/s].
            force: [N], with the gas force.
            stroke: [m].
            piston_diameter: of the inner tube [m].
            rod_diameter: [m].
            gas_pressure: p₀, absolute, at stroke zero [Pa], if it is known.
            gas_volume: V_g at stroke zero [m³], if it is known.
            rebound_volume: V_r, oil above the piston at stroke zero [m³]; if left out, that of the largest extension
                and one travel more.
            compression_volume: V_c, oil below the piston at stroke zero [m³]; if left out, that of the largest
                compression and one travel more.

        Raises:
            ValueError: no geometry; a rod as thick as the piston.
        """
        geometry = piston_diameter, rod_diameter, gas_pressure, gas_volume
        start = tube_start("TwinTube", (velocity, force, stroke), *geometry)
        area, rod_area = start.area, float(start.gas.rod_area)
        full = area + rod_area
        rebound, compression = start.valve(1, area), start.valve(-1, full)
        piston, base = compression.share(area / full), compression.share(rod_area / full)
        bleed = min(rebound.bleed_area, piston.bleed_area)
        return cls(
            piston=PistonFlow(area, bleed, *rebound[1:4], *piston[1:4], leak=rebound.leak),
            base=PistonFlow(rod_area, base.bleed_area, *start.check_valve(rod_area), *base[1:4], leak=base.leak),
            gas=start.gas,
            friction=start.seal(rebound, compression),
            rebound_volume=rebound_volume or start.oil_volume(1, area),
            compression_volume=compression_volume or start.oil_volume(-1, full),
            bulk_modulus=BULK_MODULUS,
        )

    @classmethod
    def reference(cls) -> "TwinTube":
        """A heavy-vehicle damper of 50/20 mm with the curve that paper 001 published as a `Besinger` law.

        Up to the 0.31 m/s of its tests the force at constant velocity without gas differs by less than 0.5 % of its
        peak (RMS). The paper gives the curve only; geometry and gas are typical numbers, and in compression the base
        valve makes as much pressure as the piston (it alone would need 14 MPa).
        """
        return cls(
            piston=PistonFlow(
                area=1.6493e-3,
                bleed_area=5.7e-7,
                rebound_opening_pressure=1.08e6,
                rebound_valve_stiffness=6.7e10,
                rebound_valve_area=1.26e-5,
                compression_opening_pressure=1e3,
                compression_valve_stiffness=9.25e11,
                compression_valve_area=2.54e-6,
                leak=1.7e-10,
            ),
            base=PistonFlow(
                area=3.1416e-4,
                bleed_area=2e-7,
                rebound_opening_pressure=5e3,
                rebound_valve_stiffness=5e8,
                rebound_valve_area=1.5e-4,
                compression_opening_pressure=4e6,
                compression_valve_stiffness=8e11,
                compression_valve_area=1e-5,
                leak=3.8e-11,
            ),
            gas=GasSpring(pressure=5e5, volume=3e-4, rod_area=3.1416e-4, exponent=1.3),
            friction=CoulombFriction(friction_force=30.0, friction_velocity=5e-3),
            rebound_volume=3.3e-4,
            compression_volume=3.9e-4,
            bulk_modulus=1.2e9,
        )
