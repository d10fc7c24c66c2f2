"""Checks of the declarations of a law: shapes, refusals, parameters, text, file, traits."""

import equinox as eqx
import jax
import jax.numpy as jnp
import jaxtyping
import numpy as np

from jaxdamp._unit_registry import unit_registry
from jaxdamp.dampers import AbstractDamper
from jaxdamp.export import from_json, to_json
from jaxdamp.parameters import free_parameters, get, parameters, replace
from jaxdamp.testing._probes import motion, points, require, require_equal, require_refusal, responses


REFUSALS = (ValueError, TypeError, jaxtyping.TypeCheckError)


def check_shapes(law: AbstractDamper) -> None:
    """Shapes and types of all methods."""
    zero = jnp.zeros(())
    state = eqx.filter_eval_shape(law.initial_state)
    require(state.ndim == 1, f"`initial_state` must give one row of numbers, but gives shape {state.shape}.")
    force = eqx.filter_eval_shape(law.force, zero, zero, state)
    require(force.shape == (), f"`force` must give one number, but gives shape {force.shape}.")
    after = {
        "state_rate": eqx.filter_eval_shape(law.state_rate, zero, zero, state),
        "advance": eqx.filter_eval_shape(law.advance, zero, zero, zero, zero, state, zero),
        "predict": eqx.filter_eval_shape(law.predict, zero, zero, zero, zero, state, zero),
    }
    for name, array in after.items():
        require(array.shape == state.shape, f"`{name}` gives shape {array.shape} for states of shape {state.shape}.")
    for name, array in {"initial_state": state, "force": force, **after}.items():
        require(array.dtype == jnp.dtype("float64"), f"`{name}` gives {array.dtype} for numbers of double precision.")


def check_refusals(law: AbstractDamper) -> None:
    """States of the wrong length are refused by name."""
    state, zero, dt = law.initial_state(), jnp.zeros(()), jnp.asarray(1e-3)
    for size in (state.size - 1, state.size + 1):
        if size < 0:
            continue
        wrong = jnp.zeros(size)
        calls = {
            "state_rate": lambda wrong=wrong: law.state_rate(zero, zero, wrong),
            "advance": lambda wrong=wrong: law.advance(zero, zero, zero, zero, wrong, dt),
        }
        for name, call in calls.items():
            message = f"`{name}` must refuse a `state` of {size} numbers instead of {state.size}: use `own_states`."
            require_refusal(call, ("`state`", "'state'"), REFUSALS, message)


def check_parameters(law: eqx.Module) -> None:
    """Each parameter has a unit that can be read, a meaning and a domain that is enforced."""
    import pint

    units, table = unit_registry(), parameters(law)
    require(table, "It has no parameters: declare its numbers with `parameter(unit, meaning, domain)`.")
    for p in table:
        require(p.meaning.strip() and "\n" not in p.meaning, f"`{p.path}` must have a meaning, one line of text.")
        try:
            units.parse_units(p.unit)
        except (pint.UndefinedUnitError, pint.DefinitionSyntaxError, ValueError) as error:
            raise AssertionError(f"`{p.path}` must have a unit that can be read, but has {p.unit!r}.") from error
        require(np.all(np.isfinite(p.value)), f"`{p.path}` must be finite, but is {p.value}.")
        require(p.domain.contains(np.asarray(p.value)), f"`{p.path}` must be {p.domain.name}, but is {p.value}.")
        if p.value.size == 0:
            continue
        parent, _, name = p.path.rpartition(".")
        words = (f"`{type(get(law, parent)).__name__}.{name}` must be",)
        unfit = {"nan": p.value.at[...].set(jnp.nan)} | ({"negative": -1.0 - p.value} if p.domain.lower == 0.0 else {})
        for kind, value in unfit.items():
            message = f"The domain of `{p.path}` must be enforced for {kind} values."
            require_refusal(lambda p=p, value=value: replace(law, {p.path: value}), words, (ValueError,), message)


def check_text(law: AbstractDamper) -> None:
    """The law prints as one line with its class and its numbers."""
    text = repr(law)
    require(text.startswith(f"{type(law).__name__}(") and "\n" not in text, f"It must print as one line, not {text}")
    for p in parameters(law):
        shown = f"{p.path.rpartition('.')[2]}={np.asarray(p.value).tolist()!r}"
        require(shown in text, f"`{p.path}` must be printed as {shown}, but the law prints as {text}")


def check_file(law: eqx.Module) -> None:
    """Written as JSON and read again, the law is exactly the same."""
    text = to_json(law)
    again = from_json(text)
    same = jax.tree.structure(again) == jax.tree.structure(law)
    require(same, f"Written and read again it must be the same, but {law} becomes {again}.")
    for old, new in zip(jax.tree.leaves(law), jax.tree.leaves(again), strict=True):
        same = old.dtype == new.dtype and np.asarray(old).tobytes() == np.asarray(new).tobytes()
        require(same, f"Written and read again {old} becomes {new}.")
    require(to_json(again) == text, "Written twice, the text must be the same.")


def check_traits(law: AbstractDamper) -> None:
    """What the law declares in `traits()` agrees with its forces."""
    traits, free = law.traits(), free_parameters(law)
    x, v = (a.ravel() for a in np.meshgrid([-0.05, -0.005, 0.0, 0.005, 0.05], np.linspace(-0.5, 0.5, 21)))
    values, _, by_stroke, by_velocity = points(free, x, v)
    scale = float(np.max(np.abs(values[:, :2])))
    says = "`traits()` says {}, but {}. Override `traits` and change it by `_replace`."
    direct = float(np.max(np.abs(by_velocity[:, 0])))
    but = "with its states held the force does not depend on the velocity"
    require(not traits.has_feed_through or direct > 0.0, says.format("`has_feed_through`", but))
    if not traits.stroke_dependent:
        slope = np.max(np.abs(by_stroke[:, :2]))
        but = f"the force changes by {slope:g} N/m with the stroke"
        require(slope <= 1e-9 * scale, says.format("not `stroke_dependent`", but))
    if not traits.stroke_dependent_at_rest:
        slope = np.max(np.abs(by_stroke[v == 0.0, 0]))
        but = f"the force at rest changes by {slope:g} N/m with the stroke"
        require(slope <= 1e-9 * scale, says.format("not `stroke_dependent_at_rest`", but))
    linear = np.concatenate([np.full(p.value.size, p.linear and p.domain.steps is None) for p in free.chosen])
    if traits.linear_in_parameters and np.any(linear):
        begin, (dt, x, v) = np.asarray(free.values), motion()
        change = np.where(linear, 0.3 * begin * np.cos(np.arange(begin.size)), 0.0)
        force, jacobian = responses(free, np.stack([begin, begin + change]), dt, x, v)
        but = "its response is not linear in the parameters declared `linear=True`"
        atol = 1e-9 * float(np.max(np.abs(force)))
        require_equal(force[1] - force[0], jacobian[0] @ change, says.format("`linear_in_parameters`", but), atol=atol)
        one = np.ones(jacobian[0].shape[0])
        missed = one - jacobian[0] @ np.linalg.lstsq(jacobian[0], one, rcond=None)[0]
        but = "its parameters can add a constant to the force"
        declared = traits.contains_offset or np.max(np.abs(missed)) > 1e-6
        require(declared, says.format("not `contains_offset`", but))
