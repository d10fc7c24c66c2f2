"""What fits of many dampers say of numbers that the records do not determine."""

from jaxdamp.dampers import Bilinear, CoulombFriction, Linear
from jaxdamp.identify import fit_many


START = Bilinear(1500.0, 1500.0) + CoulombFriction(30.0, 0.03)
RUBBING = Bilinear(2600.0, 1200.0) + CoulombFriction(60.0, 0.02)


def test_numbers_that_the_records_do_not_determine_are_named(sines):
    """A damper without friction had some newtons with a standard error of thousands, and no remark."""
    dampers = {"A": sines(RUBBING, noise=8.0), "B": sines(Linear(800.0), noise=8.0), "C": sines(RUBBING, noise=9.0)}
    one = fit_many(START, dampers)
    assert one.unusual == ("B",) and len(one.warnings) == 1
    assert one.remarks[1] == "its records do not determine terms.1.friction_force, terms.1.friction_velocity"
    most = fit_many(START, {"A": dampers["A"], "B": dampers["B"], "C": sines(Linear(900.0), noise=8.0)})
    assert not any("do not determine" in remark for remark in most.remarks)
    assert "terms.1.friction_force (in 2 of 3 dampers)" in most.warnings[0]
