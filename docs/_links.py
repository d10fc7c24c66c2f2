"""Links of types and names: to the reference, and to the documentation of other libraries, with no network at build."""

from functools import cache
from typing import Any


PYTHON, NUMPY = "https://docs.python.org/3/library/", "https://numpy.org/doc/stable/reference/generated/"
JAX, KIDGER = "https://docs.jax.dev/en/latest/_autosummary/", "https://docs.kidger.site/"
# The pages that describe the names of other libraries in our signatures; `{}` is the full name.
PAGES = {
    "collections.abc.": PYTHON + "collections.abc.html#{}",
    "concurrent.futures.": PYTHON + "concurrent.futures.html#{}",
    "contextlib.": PYTHON + "contextlib.html#{}",
    "ctypes.": PYTHON + "ctypes.html#{}",
    "os.": PYTHON + "os.html#{}",
    "pathlib.": PYTHON + "pathlib.html#{}",
    "types.": PYTHON + "types.html#{}",
    "typing.": PYTHON + "typing.html#{}",
    "numpy.": NUMPY + "{}.html",
    "jax.": JAX + "{}.html",
    "xarray.": "https://docs.xarray.dev/en/stable/generated/{}.html",
    "matplotlib.axes.": "https://matplotlib.org/stable/api/_as_gen/{}.html",
    "matplotlib.figure.": "https://matplotlib.org/stable/api/figure_api.html#{}",
    "equinox.Module": KIDGER + "equinox/api/module/module/#{}",
    "equinox._module._better_abstract.AbstractVar": KIDGER  # its name at run time
    + "equinox/api/module/advanced_fields/#equinox.AbstractVar",
    "equinox.AbstractVar": KIDGER + "equinox/api/module/advanced_fields/#{}",
    "diffrax.AbstractSolver": KIDGER + "diffrax/api/solvers/abstract_solvers/#{}",
    "optimistix.RESULTS": KIDGER + "optimistix/api/solution/#{}",
    "optimistix.AbstractMinimiser": KIDGER + "optimistix/api/minimise/#{}",
    "optimistix.AbstractLeastSquaresSolver": KIDGER + "optimistix/api/least_squares/#{}",
    "lineax.AbstractLinearSolver": KIDGER + "lineax/api/solvers/#{}",
    "jaxlib._jax.Array": JAX + "jax.Array.html",  # its name at run time
    "jaxtyping.Array": JAX + "jax.Array.html",
    "jaxtyping.PyTree": KIDGER + "jaxtyping/api/pytree/#{}",
    "jaxtyping.": KIDGER + "jaxtyping/api/array/",
    "optax.": "https://optax.readthedocs.io/en/latest/api/transformations.html#{}",
}


def page(name: str) -> str | None:
    """The address of a name of another library; None for what the table does not have."""
    return next((address.format(name) for start, address in PAGES.items() if name.startswith(start)), None)


def resolve(app: Any, env: Any, node: Any, contnode: Any) -> Any:
    """A link for what Sphinx does not find: another library's type, or `name` in a sentence, if it is of one thing."""
    from docutils import nodes  # with Sphinx only, while `page` needs neither
    from sphinx.util.logging import getLogger
    from sphinx.util.nodes import make_refnode

    target = node.get("reftarget", "")
    if address := page(target):
        return nodes.reference("", "", contnode, refuri=address, internal=False, reftitle=target)
    if node.get("reftype") == "class" and "." in target and not target.startswith("jaxdamp"):
        getLogger(__name__).warning("`PAGES` of docs/_links.py has no page for %s", target)
    if node.get("refdomain") == "py" and node.get("reftype") == "obj":
        objects = env.domains.python_domain.objects
        full = _by_word(frozenset(objects)).get(target.removesuffix("()"))
        if full is not None and objects[full].objtype in ("class", "function", "exception"):
            entry = objects[full]
            return make_refnode(app.builder, node["refdoc"], entry.docname, entry.node_id, contnode, full)
    return None


@cache
def _by_word(names: frozenset[str]) -> dict[str, str | None]:
    """Full names by their ends, `Ride` and `bench.read`; None where several things end alike."""
    found: dict[str, str | None] = {}
    for name in sorted(names):
        words = name.split(".")
        for begin in range(1, len(words)):
            end = ".".join(words[begin:])
            found[end] = None if end in found else name
    return found
