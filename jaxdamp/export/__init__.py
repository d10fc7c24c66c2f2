"""Laws, vehicles and roads written to files and read back."""

from jaxdamp.export.c_source import to_c
from jaxdamp.export.fmu import to_fmu
from jaxdamp.export.force_velocity import to_csv
from jaxdamp.export.module_file import from_json, to_json


__all__ = ["from_json", "to_c", "to_csv", "to_fmu", "to_json"]
