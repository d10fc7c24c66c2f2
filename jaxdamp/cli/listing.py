"""`jaxdamp laws` and `jaxdamp vehicles`: what there is by name."""

from jaxdamp.cli.console import Screen
from jaxdamp.cli.vehicle_words import vehicles_table
from jaxdamp.identify import laws_table


def list_vehicles(screen: Screen) -> None:
    """List the vehicles that a law can be put into."""
    screen.table(vehicles_table())


def laws(screen: Screen) -> None:
    """List the laws that can be fitted by name."""
    screen.table(laws_table())
