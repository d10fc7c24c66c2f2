"""The linear quadratic regulator of a car, as a policy."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp.control.controlled import refuse_scaled, rows_of
from jaxdamp.control.levels import takes_command
from jaxdamp.control.policies import StateFeedback
from jaxdamp.control.together import VehicleFeedback
from jaxdamp.vehicles import AbstractVehicle, static_equilibrium, tangent_stiffness


def lqr(car: AbstractVehicle, *, stroke: float = 2e3, tyre: float = 1e4) -> StateFeedback | VehicleFeedback:
    """The demanded forces that are optimal for forces without limits, on a road whose rate is white noise.

        F = −K s,   s = (ż_b, ż_w, x, d) of every damper,   min E[Σ z̈_b² + q_x x² + q_d d²]

    with the stroke x and the deflection d of the tyre, by the algebraic Riccati equation of the car with its masses,
    springs and tyres and no force in its dampers; laws that take no command count with their stiffness at rest. In a
    `Controlled` vehicle the damper gives what it can of it: a clipped LQR. All of the state is needed; a tyre
    deflection is seldom measured, so it shows what feedback can reach.

    It is computed by SciPy, outside of JAX: not differentiable. The gains are parameters, which a tuning moves.

    Arguments:
        car: a quarter, half or roll car without seats, whose dampers take a command. Their signals tell the state; the
            body of a full car has one coordinate less than dampers, so its roads are seen and cannot be steadied.
        stroke: weight q_x of each stroke [m] beside the acceleration of the body above it [m/s²], in 1/s⁴.
        tyre: weight q_d of the deflection of each tyre [m], in 1/s⁴.

    Raises:
        ValueError: another vehicle; a damper between scaled points; a weight that is not positive.

    Source: Hrovat, Survey of advanced suspension developments and related optimal control applications, Automatica 33
    (1997) 1781-1817.

    >>> from jaxdamp.dampers import Linear, Scheduled
    >>> from jaxdamp.vehicles import QuarterCar
    >>> damper = Scheduled((Linear(300.0), Linear(3900.0)), levels=[0.0, 1.0], command=0.2)
    >>> policy = lqr(QuarterCar(400.0, 50.0, 20e3, 250e3, damper))
    >>> round(float(policy.stroke + 20e3))  # with the spring: 400 kg (q_x)^½
    17889
    """
    from scipy.linalg import solve_continuous_are

    for name, weight in {"stroke": stroke, "tyre": tyre}.items():
        _checks.positive(name, weight)
    a, b, of_state, of_force = state_space(car)
    n = of_force.shape[0]
    cost = of_state.T @ of_state + np.diag(np.repeat([0.0, 0.0, stroke, tyre], n))
    cross, effort = of_state.T @ of_force, of_force.T @ of_force
    riccati = solve_continuous_are(a, b, cost, effort, s=cross)
    gains = -np.linalg.solve(effort, b.T @ riccati + cross.T)
    body, wheel, travel, deflection = np.split(gains, 4, axis=1)
    if n > 1:
        return VehicleFeedback(*map(jnp.asarray, (body, wheel, travel, deflection)))
    return StateFeedback(body[0, 0], wheel[0, 0], stroke=travel[0, 0], tyre_deflection=deflection[0, 0])


def state_space(car: AbstractVehicle) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """ṡ = A s + B F and z̈_b = C s + D F of s = (ż_b, ż_w, x, d), F the forces of the dampers that take a command.

    The road moves d alone: ḋ = ż_w − ż_r.

    Arguments:
        car: as in `lqr`.
    """
    _checks.instance("car", car, AbstractVehicle, "be a vehicle", "Put the damper into one.")
    system, frame = car.system(), car.frame()
    taking = [i for i, law in enumerate(system.laws) if takes_command(law)]
    refuse_scaled(frame, [system.layout.ports[i] for i in taking])
    form, n = system.form, len(taking)
    body, _, _, wheel, _ = (np.asarray(part) for part in rows_of(frame, form.ports[np.array(taking, dtype=int)]))
    moves, stretches = np.concatenate([body, wheel]), np.concatenate([body - wheel, wheel])
    if n == 0 or np.linalg.matrix_rank(moves) < len(frame.coordinates) or moves.shape[0] > moves.shape[1]:
        must = "be a quarter, half or roll car without seats, whose dampers take a command and tell all of its state"
        _checks.refuse(
            "car", must, f"a {type(car).__name__}", "Take `control.ModalSkyhook` or `control.StateFeedback`."
        )
    mass, damping, ports = (np.asarray(getattr(form, k)) for k in ("mass", "damping", "ports"))
    others = [i for i in range(len(system.laws)) if i not in taking]
    springs = dataclasses.replace(form, ports=form.ports[np.array(others, dtype=int)])
    at_rest = jnp.stack([*static_equilibrium(car.passive).values()])
    stiffness = np.asarray(tangent_stiffness(springs, [system.laws[i] for i in others], at_rest))
    inertia = moves @ np.linalg.inv(mass)
    of_rates, of_stretch = -inertia @ damping @ np.linalg.inv(moves), -inertia @ stiffness @ np.linalg.inv(stretches)
    of_force = -inertia @ ports[taking].T
    one, none = np.eye(n), np.zeros((n, n))
    kinematics = np.block([[one, -one, none, none], [none, one, none, none]])
    a = np.concatenate([np.concatenate([of_rates, of_stretch], axis=1), kinematics])
    return a, np.concatenate([of_force, np.zeros((2 * n, n))]), a[:n], of_force[:n]
