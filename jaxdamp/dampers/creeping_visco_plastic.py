"""Yielding elements whose force creeps at rest, fast at first and then ever more slowly."""

from typing import final

import jax

from jaxdamp._elementary import logarithm, power
from jaxdamp._limits import within
from jaxdamp._types import Number, Scalar, ScalarLike, State
from jaxdamp.dampers.visco_plastic import AbstractViscoPlastic, element_step
from jaxdamp.parameters import interval, parameter


UNLOADED = 1e-4  # share of the largest deflection below which creep is as slow as there


def creep_step(
    deflection: ScalarLike, travel: ScalarLike, periods: ScalarLike, limit: ScalarLike, exponent: ScalarLike
) -> Scalar:
    """Deflection [m] after a travel [m] in one direction over so many creep times, within ± the limit [m].

    At rest u̇ = −u |u|ᵐ/τ, u the share of the limit and m the exponent: over p creep times a deflection falls in a ratio
    whose logarithm is ln(1 + m |u|ᵐ p)/m.
    """
    load = within(deflection + 0.5 * travel, -limit, limit) / limit
    fallen = logarithm(1.0 + exponent * periods * power(load * load + UNLOADED**2, 0.5 * exponent)) / exponent
    return element_step(deflection, travel, fallen, limit)


@final
class CreepingViscoPlastic(AbstractViscoPlastic):
    """The law `ViscoPlastic` with elements that creep: ḋᵢ = v − (dᵢ/τᵢ) |uᵢ|ᵐ, uᵢ = dᵢ/(δᵢ + eᵢ).

    Creep by a power of the load is the law of Norton (1929), here of the deflection. At rest
    uᵢ(t) = uᵢ (1 + m |uᵢ|ᵐ t/τᵢ)^(−1/m): the force falls fast at first, and what is left hardly moves for minutes,
    whereas the elements of `ViscoPlastic` forget all in a few τᵢ. So the force at which a record begins is a trace of
    earlier motion: `fit(..., initial_state="estimated")`. In slow motion an element flows before it slides, at
    uᵢ = (v τᵢ/(δᵢ + eᵢ))^(1/(m + 1)).

    States: the deflections dᵢ [m]. The step is exact at rest and while all elements slide, second order in general, and
    stable for any stiffness Yᵢ/eᵢ.

    Arguments:
        yield_force: F_y [N].
        viscous_force: K [N] at 1 m/s.
        exponent: n.
        flow_velocity: v_f [m/s].
        sliding_forces: Yᵢ [N], shape (elements,).
        elastic_travels: eᵢ [m], shape (elements,).
        clearances: δᵢ [m], shape (elements,).
        relaxation_times: τᵢ [s], shape (elements,), relaxation time of an element that slides.
        asymmetry: a, force in compression relative to rebound.
        creep_exponent: m; the larger m, the slower an element creeps after a while.

    Raises:
        ValueError: elements whose four vectors are not of equal length.

    >>> import jax.numpy as jnp
    >>> law = CreepingViscoPlastic(200.0, 500.0, 0.5, 0.005, [300.0], [1e-4], [0.0], [1.0], creep_exponent=2.0)
    >>> later = law.advance(0.0, 0.0, 0.0, 0.0, jnp.array([1e-4]), 4.0)
    >>> round(float(law.force(0.0, 0.0, later)), 3)  # 300 N / (1 + 2·4)^½
    100.0
    """

    creep_exponent: Number = parameter(
        "",
        "m, power of the load with which the elements creep",
        interval(0.1, 20.0),
        default=3.0,
        adjustable=False,
    )

    def relaxation_rates(self, deflections: State) -> State:
        """(dᵢ/τᵢ) |uᵢ|ᵐ [m/s]."""

        def slowed(deflection: Scalar, limit: Scalar) -> Scalar:
            load = deflection / limit
            return deflection * power(load * load + UNLOADED**2, 0.5 * self.creep_exponent)

        return jax.vmap(slowed)(deflections, self.clearances + self.elastic_travels) / self.relaxation_times

    def steps(self, deflections: State, travel: ScalarLike, duration: ScalarLike) -> State:
        """Exact at rest and while all elements slide."""
        periods, limit = duration / self.relaxation_times, self.clearances + self.elastic_travels
        return jax.vmap(creep_step, (0, None, 0, 0, None))(deflections, travel, periods, limit, self.creep_exponent)
