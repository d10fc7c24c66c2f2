"""Checks that your own damper law, or policy of a controller, works everywhere those of the library do.

    from jaxdamp.testing import check_law, check_policy
    check_law(MyLaw(1500.0))
    check_policy(MyPolicy(3000.0))

They need neither pytest nor a test runner: each check raises an `AssertionError` that says what is wrong.
"""

from jaxdamp.testing.law_checks import (
    CHECKS as CHECKS,
    check_alike_ports as check_alike_ports,
    check_inside_wrappers as check_inside_wrappers,
    check_law,
)
from jaxdamp.testing.policy_checks import POLICY_CHECKS as POLICY_CHECKS, check_policy


__all__ = [
    "check_law",
    "check_policy",
]
