"""What the tubes share: chambers of oil beside a piston, and the step of their states."""

from abc import abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._field_types import check_field_types
from jaxdamp._limits import at_least, at_most, within
from jaxdamp._root import increasing_root
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers._steps import GAMMA, sdirk2
from jaxdamp.dampers.base import AbstractDamper
from jaxdamp.dampers.contract import Traits
from jaxdamp.dampers.coulomb_friction import CoulombFriction
from jaxdamp.dampers.gas_spring import LEAST_SHARE, GasSpring, gas_pressure
from jaxdamp.dampers.piston_flow import PistonFlow


STEP_ANGLE = 0.0055  # rad, of a fit: at 0.015 the gas volume is wrong by a standard error, at 0.06 others by two


def oil_stiffness(x: ScalarLike, bulk_modulus: ScalarLike, area: ScalarLike, volume: ScalarLike) -> Scalar:
    """B A/(V − A x) [Pa/m], increase of the oil pressure with its deflection; V − A x is 5 % of V or more."""
    return bulk_modulus * area / at_least(volume - area * x, LEAST_SHARE * volume)


class Oil(NamedTuple):
    """Within a step: the deflections of the chambers [m] or their rates [m/s], and S of the flows [√Pa]."""

    deflections: State
    roots: tuple[Scalar, ...]


class AbstractTube(AbstractDamper):
    """A piston in oil of bulk modulus B beside a gas charge; the states are deflections of the chambers [m].

    The step is the two-stage SDIRK method (second order, L-stable) with one equation per stage and chamber.
    """

    piston: eqx.AbstractVar[PistonFlow]
    gas: eqx.AbstractVar[GasSpring]
    friction: eqx.AbstractVar[CoulombFriction]
    rebound_volume: eqx.AbstractVar[Number]
    bulk_modulus: eqx.AbstractVar[Number]
    cavitation_pressure: eqx.AbstractVar[Number]

    def traits(self) -> Traits:
        """The pressures are states; the friction of the seal alone cannot balance a spring; gas is an offset."""
        inherited = super().traits()._replace(has_feed_through=False, contains_offset=True)
        return inherited._replace(solves_equation=True, step_angle=STEP_ANGLE)

    def __check_init__(self) -> None:
        check_field_types(self)
        charge, cavity = _checks.concrete(self.gas.pressure), _checks.concrete(self.cavitation_pressure)
        if charge is not None and cavity is not None and not np.all(charge > cavity):
            must = "be above the cavitation pressure [Pa]"
            name = f"{type(self).__name__}.gas.pressure"
            _checks.refuse(name, must, f"{charge} beside {cavity}", "It is an absolute pressure.")

    def _above(self, x: ScalarLike, deflection: ScalarLike) -> Scalar:
        """p_r [Pa, absolute] of the oil above the piston."""
        return at_least(self.gas.pressure + self._stiffness_above(x) * deflection, self.cavitation_pressure)

    def _stiffness_above(self, x: ScalarLike) -> Scalar:
        """Increase of the pressure above the piston with the deflection there [Pa/m]."""
        return oil_stiffness(x, self.bulk_modulus, self.piston.area, self.rebound_volume)

    def _gas_pressure(self, x: ScalarLike) -> Scalar:
        """Pressure of the gas [Pa, absolute] at the stroke x at which the rod alone would give its volume."""
        gas = self.gas
        return gas_pressure(x, gas.pressure, gas.volume, gas.rod_area, gas.exponent)

    @abstractmethod
    def incompressible(self) -> AbstractDamper:
        """The limit B → ∞ without cavities, a sum of laws without states."""

    @abstractmethod
    def _stiffnesses(self, x: ScalarLike) -> tuple[Scalar, ...]:
        """Increase of the pressure in each chamber with its deflection [Pa/m]."""

    @abstractmethod
    def _gas_stroke(self, x: ScalarLike, *deflections: ScalarLike) -> Scalar:
        """Stroke [m] at which the rod alone would give the present gas volume."""

    def state_at_rest(self, x: ScalarLike) -> State:
        """All oil at the pressure of the gas at this stroke, so that none flows."""
        stiffnesses = self._stiffnesses(x)

        def deflections(rise: Scalar) -> list[Scalar]:
            return [rise / stiffness for stiffness in stiffnesses]

        def surplus(rise: Scalar) -> Scalar:
            return self.gas.pressure + rise - self._gas_pressure(self._gas_stroke(x, *deflections(rise)))

        most = self._gas_pressure(x) - self.gas.pressure  # by the rod alone; the oil yields to it
        rise = increasing_root(surplus, most, at_most(most, 0.0), at_least(most, 0.0), steps=20, close=None)
        return jnp.stack(deflections(rise))

    @abstractmethod
    def _roots_at(self, x: ScalarLike, deflections: State) -> tuple[Scalar, ...]:
        """S [√Pa] of the flows at an instant, from which a search starts."""

    @abstractmethod
    def _stage(self, x: ScalarLike, v: ScalarLike, now: Oil, duration: ScalarLike, *, search: bool) -> Oil:
        """Rates of the deflections [m/s] in an implicit stage, by the flow that the pressures at its end cause.

        Arguments:
            x: stroke at the end [m].
            v: velocity [m/s].
            now: at the beginning of the stage.
            duration: of the stage [s].
            search: until the equation is solved; otherwise a step or two of Newton's method, for predictions.
        """

    def implicit_stage(self, x: ScalarLike, v: ScalarLike, state: State, duration: ScalarLike) -> State:
        """One stage of backward Euler."""
        now = Oil(state, self._roots_at(x - duration * v, state))
        return state + duration * self._stage(x, v, now, duration, search=True).deflections

    def advance(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """Two-stage SDIRK step; the velocity is taken as linear over the step."""
        return self._moved(x0, v0, x1, v1, state, dt, search=True)

    def predict(
        self, x0: ScalarLike, v0: ScalarLike, x1: ScalarLike, v1: ScalarLike, state: State, dt: ScalarLike
    ) -> State:
        """The step with one or two steps of Newton's method in each stage, at less cost."""
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
        def stage(share: float, now: Oil) -> Oil:
            v = v0 + share * (v1 - v0)
            # the velocity is linear over the step
            x = x1 if share == 1.0 else x0 + share * (x1 - x0) - 0.5 * share * dt * (1.0 - share) * (v1 - v0)
            return self._stage(x, v, now, GAMMA * dt, search=search)

        def moved(rate: Oil, now: Oil, part: float) -> Oil:
            return Oil(now.deflections + part * dt * rate.deflections, rate.roots)

        return sdirk2(stage, moved, Oil(state, self._roots_at(x0, state))).deflections


def newton_step(function: Callable[[Scalar], Scalar], guess: Scalar, lower: Scalar, upper: Scalar) -> Scalar:
    """One step of Newton's method for an increasing function, within bounds."""
    value, slope = jax.jvp(function, (guess,), (jnp.ones_like(guess),))
    return within(guess - value / slope, lower, upper)
