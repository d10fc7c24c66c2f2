"""One vehicle with several forms of friction at its guides and dampers, to be compared on its drives."""

import functools
from collections.abc import Sequence
from operator import add
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp

from jaxdamp import _checks
from jaxdamp._traced import of_known_numbers
from jaxdamp.dampers import AbstractDamper, CoulombFriction, Dahl, LuGre, StribeckFriction, Sum, laws_inside
from jaxdamp.parameters import get
from jaxdamp.vehicles import AbstractVehicle, Guided


FRICTION = (CoulombFriction, Dahl, LuGre, StribeckFriction)
FORMS = ("none", "coulomb", "dahl")
SHARE = 0.1  # of a damper's force at `SPEED`, as start of the friction where the vehicle has none
SPEED = 0.1  # m/s
VELOCITY = 0.01  # m/s, over which Coulomb friction changes its sign, where the vehicle has none
GIVE = 3e-4  # m, that friction gives before it slides, as start


class Place(NamedTuple):
    """Where a vehicle may have friction."""

    path: str  # of the law there
    beside: AbstractDamper | None  # the law without its friction, if it has something else
    friction: AbstractDamper | None  # what it has of friction
    force: float  # sliding friction [N] to start from

    def with_form(self, form: str, give: float | None = None) -> AbstractDamper | None:
        """The law with this form of friction.

        The friction gives so much before it slides [m]; what it has, or 0.3 mm, if left out.
        """
        if form == "none":
            return self.beside
        force = self.force
        if force <= 0.0:
            _checks.refuse(self.path, "have a friction or a damping force to start from", force)
        velocity = float(getattr(self.friction, "friction_velocity", VELOCITY))
        stiffness = force / give if give else float(getattr(self.friction, "stiffness", force / GIVE))
        law = CoulombFriction(force, velocity) if form == "coulomb" else Dahl(stiffness, force)
        return law if self.beside is None else self.beside + law


def friction_places(vehicle: AbstractVehicle) -> list[Place]:
    """Where a vehicle has friction: its guides, suspensions, the sum of a damper with friction.

    Without any it may have friction in guides that have no law, or, without such guides, beside each of its dampers.

    >>> from jaxdamp.dampers import Linear
    >>> from jaxdamp.vehicles import Guide, Guided, QuarterCar
    >>> car = QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(1500.0))
    >>> [place.path for place in friction_places(car)]
    ['damper']
    >>> [place.path for place in friction_places(Guided(car, (Guide(CoulombFriction(30.0, 0.01)),)))]
    ['guides.0.law']
    """
    outer = list[str]()
    for prefix, _ in laws_inside(vehicle):
        if not any(prefix.startswith(path) for path in outer):
            outer.append(prefix)
    places = [_place(path.removesuffix("."), get(vehicle, path.removesuffix("."))) for path in outer]
    if with_friction := [place for place in places if place.friction is not None]:
        return with_friction
    dampers = [place for place in places if place.path.split(".")[-1].endswith("damper")]
    force = max((place.force for place in dampers), default=0.0)
    guides = vehicle.guides if isinstance(vehicle, Guided) else ()
    bare = [Place(f"guides.{i}.law", None, None, force) for i, guide in enumerate(guides) if guide.law is None]
    return bare or dampers


def _place(path: str, law: AbstractDamper) -> Place:
    terms = law.terms if isinstance(law, Sum) else (law,)
    friction = next((term for term in terms if isinstance(term, FRICTION)), None)
    others = [term for term in terms if term is not friction]
    if friction is None:
        force = SHARE * abs(float(jnp.asarray(law.force(0.0, SPEED, law.initial_state()))))
    else:
        force = float(get(friction, "friction_force"))
    return Place(path, functools.reduce(add, others) if others else None, friction, force)


@of_known_numbers
def friction_ladder(vehicle: AbstractVehicle, forms: Sequence[str] = FORMS) -> dict[str, AbstractVehicle]:
    """The vehicle with forms of friction from simple to complex by name, for `compare`.

    - `none`: no friction.
    - `coulomb`: `CoulombFriction`, a force against the velocity; hold its `friction_velocity` in a fit.
    - `dahl`: `Dahl`, friction that gives like a spring before it slides, as seals and guides of rubber do.

    The form stands wherever the vehicle has friction: at its guides, suspensions, or in the sum of a damper with it,
    and starts from the force there. A vehicle without friction gets it in guides without a law, or else beside each
    damper, starting from a tenth of the damper's force at 0.1 m/s. All else is as in the vehicle.

    Arguments:
        vehicle: any vehicle.
        forms: names of forms.

    Raises:
        ValueError: an unknown name; a vehicle without friction and dampers.

    >>> from jaxdamp.dampers import Linear
    >>> from jaxdamp.vehicles import QuarterCar
    >>> ladder = friction_ladder(QuarterCar(300.0, 40.0, 20e3, 180e3, Linear(1500.0)))
    >>> {name: type(car.damper).__name__ for name, car in ladder.items()}
    {'none': 'Linear', 'coulomb': 'Sum', 'dahl': 'Sum'}
    """
    names = [forms] if isinstance(forms, str) else list(forms)
    for name in names:
        _checks.one_of("forms", name, FORMS)
    places = friction_places(vehicle)
    if not places:
        _checks.refuse("vehicle", "have friction or dampers", repr(vehicle), "Put a law into a guide or suspension.")
    return {name: with_laws(vehicle, places, [place.with_form(name) for place in places]) for name in names}


def with_laws(
    vehicle: AbstractVehicle, places: Sequence[Place], laws: Sequence[AbstractDamper | None]
) -> AbstractVehicle:
    """The vehicle with a law at each place; None for no law."""
    return eqx.tree_at(
        lambda car: [get(car, place.path) for place in places], vehicle, list(laws), is_leaf=lambda part: part is None
    )
