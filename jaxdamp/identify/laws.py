"""The laws that can be fitted by name."""

from typing import NamedTuple

from jaxdamp._tables import Column, Table


class NamedLaw(NamedTuple):
    """A law that can be fitted by name.

    Attributes:
        hysteresis: whether the law has states.
        meaning: of the law, in words.
        optional: fitted only where it is asked for by name.
    """

    hysteresis: bool
    meaning: str
    optional: bool = False


NAMED_LAWS = {
    "linear": NamedLaw(False, "one damping coefficient"),
    "bilinear": NamedLaw(False, "one coefficient in rebound, one in compression"),
    "power_law": NamedLaw(False, "power of the velocity with an offset, on each side"),
    "polynomial": NamedLaw(False, "odd and even powers of the velocity, up to the fifth"),
    "segmented_polynomial": NamedLaw(False, "five polynomials that join, monotone"),
    "piecewise_linear": NamedLaw(False, "straight lines between knees"),
    "table": NamedLaw(False, "forces at fixed velocities, straight lines between them"),
    "besinger": NamedLaw(False, "smooth change from compression to rebound, with a blow-off valve"),
    "linear_friction": NamedLaw(False, "one coefficient and smooth Coulomb friction"),
    "besinger_lag": NamedLaw(True, "besinger behind a first-order lag"),
    "besinger_series_spring": NamedLaw(True, "besinger in series with a spring: mount, bushing or oil column"),
    "linear_friction_lag": NamedLaw(True, "linear_friction behind a first-order lag"),
    "bouc_wen": NamedLaw(True, "one coefficient, friction that gives before it slides, a spring"),
    "lugre_spring": NamedLaw(True, "friction that sticks, breaks away and slides, one coefficient, a spring"),
    "besinger_play": NamedLaw(True, "besinger behind a clearance: worn joint, loose mount, void in the oil"),
    "series_spring_dahl": NamedLaw(True, "piecewise_linear in series with a spring, elastic friction, a spring"),
    "visco_plastic_spring": NamedLaw(True, "concave viscous force, two yielding elements, a spring"),
    "neural_hysteresis_spring": NamedLaw(
        True, "one coefficient, hysteresis learnt by a network, a spring; takes minutes, only by name", optional=True
    ),
}


def laws_table() -> Table:
    """The laws of `default_ladder`, from simple to complex: name, hysteresis, description."""
    columns = (Column("law"), Column("hysteresis"), Column("what it is"))
    rows = ((name, "yes" if law.hysteresis else "no", law.meaning) for name, law in NAMED_LAWS.items())
    return Table("Laws", columns, tuple(rows))
