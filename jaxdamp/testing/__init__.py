"""Checks that your own damper law works everywhere the laws of the library do.

    from jaxdamp.testing import check_law
    check_law(MyLaw(1500.0))

They need neither pytest nor a test runner: each check raises an `AssertionError` that says what is wrong.
"""

from jaxdamp.testing.law_checks import (
    CHECKS as CHECKS,
    check_alike_ports as check_alike_ports,
    check_inside_wrappers as check_inside_wrappers,
    check_law,
)


__all__ = [
    "check_law",
]
