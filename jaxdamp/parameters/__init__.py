"""Parameters: a value with its unit, its physical domain and one line of meaning, declared beside the field.

    class Linear(AbstractMemoryless):
        rate: Scalar = parameter("N s/m", "damping coefficient", positive)

Fits, tables, plot labels and reports all read that one declaration. A *path* such as `"damper.terms.0.rate"` names a
parameter inside a composition. Freezing, ties and extra bounds are arguments of a fit or of a tuning, never of the law.
"""

from jaxdamp.parameters._checking import check_parameters, checked
from jaxdamp.parameters._coordinates import Bounds, Coordinates
from jaxdamp.parameters._declaration import (
    Module,
    Parameter,
    as_float,
    domain_of,
    modules_inside,
    parameter,
    parameters,
    readable,
    setting,
)
from jaxdamp.parameters._domains import (
    Domain,
    around_zero,
    ends,
    increasing,
    increasing_negative,
    interval,
    nonnegative,
    ordered_interval,
    positive,
    real,
    weight,
)
from jaxdamp.parameters._free import FreeParameters, free_parameters
from jaxdamp.parameters._paths import get, match_paths, matched_in_words, matching, name_patterns, replace, with_values


__all__ = [
    "Bounds",
    "Coordinates",
    "Domain",
    "FreeParameters",
    "Module",
    "Parameter",
    "around_zero",
    "as_float",
    "check_parameters",
    "checked",
    "domain_of",
    "ends",
    "free_parameters",
    "get",
    "increasing",
    "increasing_negative",
    "interval",
    "match_paths",
    "matched_in_words",
    "matching",
    "modules_inside",
    "name_patterns",
    "nonnegative",
    "ordered_interval",
    "parameter",
    "parameters",
    "positive",
    "readable",
    "real",
    "replace",
    "setting",
    "weight",
    "with_values",
]
