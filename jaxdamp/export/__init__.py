"""Laws, vehicles and roads written to files and read back; laws as C, as FMU, as tables of simulators and as a page."""

from jaxdamp._guesses import answer_guesses
from jaxdamp.export._law_program import identifier as identifier
from jaxdamp.export.c_source import to_c
from jaxdamp.export.explorer_page import to_explorer
from jaxdamp.export.fmu import to_fmu
from jaxdamp.export.module_file import from_json, to_json
from jaxdamp.export.simulator_tables import (
    to_adams,
    to_assetto_corsa,
    to_carsim,
    to_csv,
    to_matlab,
)


__all__ = [
    "from_json",
    "to_adams",
    "to_assetto_corsa",
    "to_c",
    "to_carsim",
    "to_csv",
    "to_explorer",
    "to_fmu",
    "to_json",
    "to_matlab",
]

answer_guesses(__name__, __all__)
