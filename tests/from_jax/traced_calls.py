"""Every public function with a traced number: run as a script, it prints what each call came to, as JSON.

It runs as a script because the run-time checks of types, which the tests switch on, would answer before the library.
Nothing is compiled: `jax.make_jaxpr` traces as `jax.jit` does.
"""

import inspect
import json
import warnings
from importlib import import_module
from typing import Any

import jax
from traced_samples import SAMPLES, Call

from jaxdamp._checks import ArgumentError


PACKAGES = ["", "bench", "codegen", "dampers", "export", "identify", "metrics", "parameters", "plots", "rig", "roads"]
PACKAGES += ["simulation", "sweeps", "tune", "vehicles"]
# They take names, texts, files, functions or results, which JAX cannot trace.
NO_NUMBERS = {
    "": {"configure"},
    "bench": {"read", "read_dampers", "read_kinematics", "read_limits", "read_rides", "read_table"},
    "codegen": {"compiler", "lower", "symbols"},
    "dampers": {"own_states"},
    "export": {"from_json"},
    "identify": {"fit_percent", "judge", "ladder_starts"},
    "parameters": {"parameter", "setting"},
    "roads": {"read_crg", "read_profile"},
    "tune": {"rescore", "smooth_peak", "smooth_settling"},
}


def functions(package: str) -> dict[str, Any]:
    """The public functions of a package by name."""
    module = import_module(f"jaxdamp.{package}".rstrip("."))
    public = {name: getattr(module, name) for name in module.__all__}
    return {name: f for name, f in public.items() if callable(f) and not inspect.isclass(f)}


def outcome(call: Call, function: Any) -> str:
    """ "traced", "refused" or the raw error."""

    def traced(x: Any) -> Any:
        return [leaf for leaf in jax.tree.leaves(call(function, x)) if isinstance(leaf, jax.Array)]

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            jax.make_jaxpr(traced)(1.0)
    except ArgumentError as error:
        return f"refused: {error}"
    except Exception as error:
        return f"raw {type(error).__name__}: {str(error)[:300]}"
    return "traced"


def main() -> None:
    found = {}
    for package in PACKAGES:
        for name, function in functions(package).items():
            if name in NO_NUMBERS.get(package, set()) or (package in ("plots",) and name not in SAMPLES[package]):
                continue
            calls = SAMPLES.get(package, {}).get(name)
            full = f"{package}.{name}".lstrip(".")
            found[full] = ["no sample"] if calls is None else [outcome(call, function) for call in calls]
        unknown = SAMPLES.get(package, {}).keys() - functions(package)
        found |= {f"{package}.{name}".lstrip("."): ["no such function"] for name in unknown}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
