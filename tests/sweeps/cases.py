"""Functions to sweep, in a file of their own because other processes run them too."""

import equinox as eqx
import jax
import jax.numpy as jnp


AXES = {"a": [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0], "b": [-0.1, 0.2, 0.5, 0.8, 1.1]}


class Decay(eqx.Module):
    """Something with arrays, units and a loop: Σ b exp(−a r) over rates r, whose derivatives are known."""

    rates: jax.Array
    lanes: int = eqx.field(static=True, default=32)

    @property
    def units(self):
        return {"a": "s", "b": "m", "sum": "m"}

    def __call__(self, point):
        def step(total, rate):
            return total + point["b"] * jnp.exp(-point["a"] * rate), None

        total, _ = jax.lax.scan(step, jnp.zeros_like(point["a"]), self.rates)
        return {"sum": total, "square": point["b"] ** 2, "profile": point["b"] * self.rates}


def decay():
    return Decay(jnp.linspace(0.1, 1.0, 40))


def failing(point):
    """Raises in one corner, is not a number in another."""
    raised = eqx.error_if(point["b"] * jnp.exp(-point["a"]), point["a"] * point["b"] > 3.0, "too much of both")
    return {"y": jnp.where(point["b"] < 0.0, jnp.inf, raised), "pair": jnp.stack([point["a"], raised])}
