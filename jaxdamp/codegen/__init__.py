"""JAX functions of numbers and small arrays as text in other languages: C99 (also C++) and JavaScript.

`lower` traces a function and translates it into scalar statements, which a language prints:

    program = lower(function, symbols("x"), symbols("state", (2,)))
    C().function(PrintedFunction("void f(...)", ["x", "state"], program.statements, outputs))

Arrays become names of scalars while printing, so that slicing and reshaping cost nothing. Loops (`lax.while_loop`,
`lax.scan`) stay loops, branches stay branches, calls and functions with custom derivatives are written out. Elementary
functions are those of the language's own library. A primitive that cannot be printed is refused by its name.

`printed_scan` prints a loop over time for many points side by side, compiles it and calls it from JAX.
"""

from jaxdamp.codegen._jaxprs import (
    is_printing as is_printing,
    is_printing_vectors as is_printing_vectors,
    printing as printing,
)
from jaxdamp.codegen._languages import AbstractLanguage as AbstractLanguage, C, JavaScript, PrintedFunction
from jaxdamp.codegen._lowering import Program as Program, Symbols as Symbols, lower, symbols
from jaxdamp.codegen._native import compiler, library as library
from jaxdamp.codegen._program import Atom as Atom, Constant as Constant, Variable as Variable
from jaxdamp.codegen._scan import printed_scan as printed_scan
from jaxdamp.codegen._slopes import Signature as Signature, with_slopes as with_slopes


__all__ = [
    "C",
    "JavaScript",
    "PrintedFunction",
    "compiler",
    "lower",
    "symbols",
]
