"""Time of elementary functions of float64 in a loop over many cars: which are vectorised on this processor?

python -m benchmarks.functions
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from jaxdamp import configure


DONE = configure(cpu_devices=1, cache=False)

from benchmarks._timing import best, report  # noqa: E402
from jaxdamp._elementary import logarithm, power, reciprocal_root  # noqa: E402


LANES, STEPS = 128, 20_000
FUNCTIONS: dict[str, Callable[[jax.Array], jax.Array]] = {
    "x y": lambda x: x * (1.0 - x),
    "1/x": lambda x: 1.0 / (1.0 + x),
    "sqrt": jnp.sqrt,
    "rsqrt": jax.lax.rsqrt,
    "rsqrt, jaxdamp": reciprocal_root,
    "exp": lambda x: jnp.exp(-x),
    "expm1": lambda x: jnp.expm1(-x),
    "tanh": jnp.tanh,
    "log": jnp.log,
    "log, jaxdamp": logarithm,
    "x^0.7": lambda x: x**0.7,
    "x^0.7, jaxdamp": lambda x: power(x, 0.7),
}


def nanoseconds(function: Callable[[jax.Array], jax.Array]) -> float:
    """Per number, in a loop that takes each result back between 0.1 and 1.2."""

    def again(x: jax.Array, _: None) -> tuple[jax.Array, None]:
        return jnp.clip(jnp.abs(0.5 * function(x) + 0.1), 0.1, 1.2), None

    run = jax.jit(lambda x: jax.lax.scan(again, x, None, length=STEPS)[0])
    x = jnp.asarray(np.random.default_rng(0).uniform(0.2, 1.2, LANES))
    return best(lambda: run(x), 7) / (LANES * STEPS) * 1e9


def main() -> None:
    print(DONE)
    rows = [[name, nanoseconds(function)] for name, function in FUNCTIONS.items()]
    report("functions", f"Elementary functions of float64, {LANES} side by side", ["function", "ns"], rows)


if __name__ == "__main__":
    main()
