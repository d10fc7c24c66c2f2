"""Laws, vehicles and roads written to files and read back."""

from jaxdamp.export.force_velocity import to_csv
from jaxdamp.export.module_file import from_json, to_json


__all__ = ["from_json", "to_csv", "to_json"]
