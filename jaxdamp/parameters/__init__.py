"""Parameters: a value with its unit, its physical domain and one line of meaning, declared beside the field.

    class Linear(AbstractMemoryless):
        rate: Scalar = parameter("N s/m", "damping coefficient", positive)

Fits, tables, plot labels and reports all read that one declaration. A *path* such as `"damper.terms.0.rate"` names a
parameter inside a composition. Freezing, ties and extra bounds are arguments of a fit or of a tuning, never of the law.
"""

from jaxdamp.parameters._coordinates import Bounds as Bounds, Coordinates as Coordinates
from jaxdamp.parameters._declaration import (
    DomainOf as DomainOf,
    Module as Module,
    Parameter as Parameter,
    as_float as as_float,
    declared_inside as declared_inside,
    domain_of as domain_of,
    modules_inside as modules_inside,
    parameter,
    parameters,
    readable as readable,
    setting,
)
from jaxdamp.parameters._domains import (
    Domain as Domain,
    around_zero as around_zero,
    ends as ends,
    increasing,
    increasing_negative as increasing_negative,
    interval,
    nonnegative,
    ordered_interval as ordered_interval,
    positive,
    real,
    weight as weight,
)
from jaxdamp.parameters._free import FreeParameters as FreeParameters, free_parameters, limits_by_path as limits_by_path
from jaxdamp.parameters._paths import (
    BY_NAME as BY_NAME,
    AbstractDeclared as AbstractDeclared,
    check_by_name as check_by_name,
    check_parameters as check_parameters,
    checked as checked,
    get,
    listed as listed,
    match_parameters as match_parameters,
    match_paths as match_paths,
    matched_in_words as matched_in_words,
    matching as matching,
    name_patterns as name_patterns,
    named_parameters as named_parameters,
    replace,
    with_values as with_values,
)


__all__ = [
    "free_parameters",
    "get",
    "increasing",
    "interval",
    "nonnegative",
    "parameter",
    "parameters",
    "positive",
    "real",
    "replace",
    "setting",
]
