"""Declaring parameters and settings beside the fields of a class, and listing them."""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias, dataclass_transform

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, PyTree

from jaxdamp import _checks
from jaxdamp._forked import refuse_fork
from jaxdamp._traced import is_traced
from jaxdamp.parameters._domains import Domain, real


def as_float(value: object, name: str = "value") -> Array:
    """A JAX array of the default float type; arrays that are floating already keep their type.

    Arguments:
        value: a number or an array.
        name: of the argument in messages.

    Raises:
        ValueError: something that is not a number; the message names the argument.
    """
    refuse_fork()
    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jnp.floating):
        return value
    if value is None or isinstance(value, bool | str | bytes | type | eqx.Module):
        _checks.refuse(name, "be a number", _checks.described(value))
    plain = all(isinstance(each, int | float) for each in (value if isinstance(value, list | tuple) else (value,)))
    try:
        if not plain and jnp.iscomplexobj(value):
            _checks.refuse(name, "be a real number", _checks.described(value))
        if plain or isinstance(value, np.ndarray):
            value = np.asarray(value)  # arrays of NumPy are copied; numbers would be converted by a compiled program
        made = jnp.asarray(value, dtype=float)
        if isinstance(made, Tracer) and not is_traced(value):
            with jax.ensure_compile_time_eval():  # a plain number is known inside `jax.jit`, too
                made = jnp.asarray(value, dtype=float)
        return made
    except (_checks.ArgumentError, jax.errors.JAXTypeError):
        raise
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"Argument `{name}` must be numbers, but is {value!r}: {error}") from error


Declared: TypeAlias = Mapping[str, Any]  # of a field: unit, meaning, domain and the others
DomainOf: TypeAlias = Domain | Callable[[PyTree], Domain]


def parameter(
    unit: str,
    meaning: str,
    domain: DomainOf = real,
    *,
    linear: bool = False,
    adjustable: bool = True,
    **field: object,
) -> Any:
    """Declare a field of an equinox module as a parameter.

    Arguments:
        unit: SI unit in the notation of pint, `""` for a dimensionless number.
        meaning: one line for tables and labels.
        domain: the allowed values; a function of the instance if they depend on a setting.
        linear: whether the force of the law is linear in all parameters marked so; a fit then has a closed form.
        adjustable: whether a workshop can change it, as it can a rate, a blow-off, a preload, an orifice or a spring. A
            tuning leaves others alone unless it is told to move them: lag, friction, oil, masses, geometry.
        field: passed on to `equinox.field`, such as `default=0.0`.
    """
    declared = {"unit": unit, "meaning": meaning, "domain": domain, "linear": linear, "adjustable": adjustable}
    return _number("parameter", declared, field)


def setting(unit: str, meaning: str, domain: DomainOf = real, *, command: bool = False, **field: object) -> Any:
    """Declare a field as a number with a unit that fits and tunings never change, such as a knee width.

    A `command` is set from outside, run by run, such as a coil current (`dampers.with_command`). Sweeps and tunings
    change one that is named.

    Arguments:
        unit: in SI.
        meaning: in words.
        domain: the values that it may take; a function of the instance if they depend on another setting.
        command: whether it is set from outside.
        field: further arguments of `equinox.field`, such as a default.
    """
    return _number("setting", {"unit": unit, "meaning": meaning, "domain": domain, "command": command}, field)


def _number(kind: str, declared: Declared, options: Declared) -> Any:
    """A field that converts numbers to arrays, with an error that names the field."""

    def convert(value: object) -> Array:
        return as_float(value, field.name)

    field = eqx.field(converter=convert, metadata={kind: declared}, **options)
    return field


if TYPE_CHECKING:

    @dataclass_transform(field_specifiers=(parameter, setting, eqx.field))
    class _DeclaringMeta(type(eqx.Module)):
        """Tells type checkers that `parameter` and `setting` declare fields."""

    class Module(eqx.Module, metaclass=_DeclaringMeta):
        """An equinox module whose fields may be parameters and settings."""

else:
    Module = eqx.Module


class Parameter(eqx.Module):
    """One parameter of a tree, as `parameters` lists it.

    Attributes:
        path: such as "damper.rate".
        value: a number or an array, in the unit.
        unit: in SI.
        meaning: in words.
        domain: the values that it may take.
        linear: whether the force is linear in it.
        adjustable: whether a workshop can change it.
        command: whether it is a command, such as a coil current or a click.
    """

    path: str = eqx.field(static=True)
    value: PyTree
    unit: str = eqx.field(static=True)
    meaning: str = eqx.field(static=True)
    domain: Domain = eqx.field(static=True)
    linear: bool = eqx.field(static=True)
    adjustable: bool = eqx.field(static=True, default=True)
    command: bool = eqx.field(static=True, default=False)


def _children(tree: object) -> Iterable[tuple[object, object]]:
    """What a container or a module holds, with index, key or name of the field."""
    if isinstance(tree, tuple | list):
        return enumerate(tree)
    if isinstance(tree, dict):
        return tree.items()
    return [(f.name, getattr(tree, f.name)) for f in dataclasses.fields(tree)] if isinstance(tree, eqx.Module) else ()


def modules_inside(tree: object, prefix: str = "") -> Iterator[tuple[str, eqx.Module]]:
    """All modules in a tree, each with the prefix of the paths of its fields, before those inside it.

    Arguments:
        tree: the tree.
        prefix: put before each path.
    """
    if isinstance(tree, eqx.Module):
        yield prefix, tree
    for name, child in _children(tree):
        yield from modules_inside(child, f"{prefix}{name}.")


def declared_inside(tree: object, prefix: str = "") -> Iterator[tuple[str, eqx.Module, Declared]]:
    """The declared fields of all modules in a tree, depth first: path, module and metadata of the field.

    Arguments:
        tree: the tree.
        prefix: put before each path.
    """
    fields = {f.name: f.metadata for f in dataclasses.fields(tree)} if isinstance(tree, eqx.Module) else {}
    for name, child in _children(tree):
        metadata = fields.get(str(name), {})
        if isinstance(tree, eqx.Module) and ("parameter" in metadata or "setting" in metadata):
            yield f"{prefix}{name}", tree, metadata
        else:
            yield from declared_inside(child, f"{prefix}{name}.")


def domain_of(declared: Declared, module: eqx.Module) -> Domain:
    """The domain of a declared field; one that depends on a setting is a function of the module.

    Arguments:
        declared: the metadata of the field.
        module: the module that has the field.
    """
    domain = declared["domain"]
    return domain if isinstance(domain, Domain) else domain(module)


def parameters(tree: object, prefix: str = "", *, commands: bool = False) -> list[Parameter]:
    """All parameters of a law, vehicle or any other module, depth first in the order of their fields.

    Arguments:
        tree: the module.
        prefix: put before each path.
        commands: whether commands are listed too, such as coil currents.

    >>> from jaxdamp.dampers import Lag, Linear
    >>> [(p.path, p.unit, float(p.value)) for p in parameters(Lag(Linear(1500.0), lag_time=0.004))]
    [('law.rate', 'N s/m', 1500.0), ('lag_time', 's', 0.004)]
    """
    listed = []
    for path, module, metadata in declared_inside(tree, prefix):
        declared = metadata.get("parameter") or metadata.get("setting", {})
        is_command = commands and declared.get("command", False)
        if "parameter" in metadata or is_command:
            words = declared["unit"], declared["meaning"]
            traits = domain_of(declared, module), declared.get("linear", False), declared.get("adjustable", True)
            listed.append(Parameter(path, getattr(module, path.rsplit(".", 1)[-1]), *words, *traits, is_command))
    return listed


def readable(module: eqx.Module) -> str:
    """The module as a line with its numbers: `Lag(law=Linear(rate=1500.0), lag_time=0.004)`.

    Arguments:
        module: the module.
    """

    def text(value: object) -> str:
        if isinstance(value, tuple | list):
            return f"({', '.join(map(text, value))}{',' if len(value) == 1 else ''})"
        if isinstance(value, jax.Array | np.ndarray):
            numbers = _checks.concrete(value)
            return eqx.tree_pformat(value) if numbers is None or numbers.size > 50 else repr(numbers.tolist())
        return repr(value)

    fields = [f"{field.name}={text(getattr(module, field.name))}" for field in dataclasses.fields(module) if field.repr]
    return f"{type(module).__name__}({', '.join(fields)})"
