"""Printed functions compute what JAX computes, in C, C++ and JavaScript."""

import ctypes
import functools
import json
import shutil
import subprocess

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxdamp._elementary import power
from jaxdamp._matrices import phi_functions, solve
from jaxdamp.codegen import C, JavaScript, PrintedFunction, lower, symbols


def root(x):
    """A loop of unknown length."""

    def better(c):
        return 0.5 * (c[0] + x[0] / c[0]), jnp.abs(c[0] ** 2 - x[0])

    return lax.while_loop(lambda c: c[1] > 1e-9, better, (x[0], x[0]))[:1]


def series(x):
    """Scans with carried and with saved values, one of them backwards."""
    total, saved = lax.scan(lambda c, row: (c + row[0] * row[1], c - row[1]), x[0], (x, 2.0 * x))
    return total, saved, lax.scan(lambda c, a: (0.5 * c + a, c), x[1], x, reverse=True)


def written_out(x):
    """Scans that ask to be written out."""
    step = lambda c, row: (c + row[0] * row[1], c - row[1])  # noqa: E731
    back = lax.scan(step, x[0], (x, jnp.outer(x, x)[0]), reverse=True, unroll=3)
    return jnp.polyval(x, x[1]), lax.scan(lambda c, a: (c * a, None), x, x, unroll=True)[0], back


def swapped(x):
    """Carried values that change places."""
    return lax.fori_loop(0, 5, lambda k, c: (c[1], c[0] + c[1]), (x[0], x[1]))


def branch(x):
    return lax.switch((x[0] * 2).astype(int), [jnp.sin, jnp.cos, lambda y: y * y], x)


def entry(x):
    return lax.dynamic_index_in_dim(x, (x[2] * 10).astype(int), keepdims=False), lax.dynamic_slice(x, [1], [2])


def replaced(x):
    return x.at[0].set(2.0 * x[1]), x.at[1:].set(x[:2]), x.at[-1].set(0.0)


def places(x):
    """Entries at places that are known only when the program runs."""
    k = (x[2] * 10).astype(int)
    table = jnp.stack([x, 2.0 * x, x - 1.0])
    rows = table[jnp.stack([k, k - 1])], table[np.array([2, 0]), np.array([1, 1])]
    extremes = [f(y) for f in (jnp.argmax, jnp.argmin, jnp.nanargmin) for y in (x, -x, x[::-1] * jnp.nan, x * 0.0)]
    return rows, table.at[k].set(x * x), x.at[k + 5].set(1.0), x.at[k].set(7.0), jnp.stack(extremes)


def solved(x):
    """A linear system by elimination with row exchange, and a matrix exponential."""
    matrix = jnp.stack([jnp.zeros_like(x).at[1].set(2.0), x, 1.0 + x[::-1]])
    return solve(matrix, x), *phi_functions(0.3 * matrix)


def matrix(x):
    rows = jnp.stack([x, 2.0 * x])
    return jnp.outer(x, x) @ x, rows.T.reshape(-1)[::-1], jnp.cumsum(x), lax.cumsum(x, reverse=True)


def products(x):
    """Batches of matrices; and so large ones that they are computed in loops."""
    several, large = jnp.stack([jnp.outer(x, x), jnp.ones((3, 3))]), jnp.outer(jnp.arange(9.0, dtype=x.dtype), x)
    return jnp.einsum("bij,bjk->bik", several, several), jnp.sin(large) @ large.T @ large


def padded(x):
    wide = lax.pad(x, jnp.asarray(0.5, x.dtype), [(1, 2, 0)])
    return wide, jnp.diff(x), jnp.tile(x, 2), jnp.arange(3, dtype=x.dtype) * x


def reduced(x):
    return jnp.max(x), jnp.min(x), jnp.prod(x), jnp.all(x > 0.0), jnp.any(x < 0.0), jnp.sum(x[:0])


def limits(x):
    nan = x * jnp.nan
    return jnp.clip(x, -0.5, 0.7), jnp.maximum(x, nan), jnp.minimum(nan, x), jnp.sign(x), -jnp.abs(x)


def rounded(x):
    return jnp.round(x * 5.0), jnp.floor(x), jnp.ceil(x), lax.rem(x, 0.3 + 0.0 * x), jnp.isfinite(x / 0.0)


def powers(x):
    low = jnp.abs(x) ** 1.7, lax.rsqrt(jnp.abs(x)), jnp.cbrt(x), jax.vmap(power, (0, None))(x * x, 0.3)
    return x**3, x**-2, x**0, jnp.square(x), low


def functions(x):
    names = jnp.exp, jnp.expm1, jnp.log1p, jnp.tanh, jnp.arcsin, jnp.arctan, jnp.sinh, jax.nn.sigmoid, jnp.exp2
    return [*[f(0.4 * x) for f in names], jnp.log2(x * x)]


def whole(x):
    k = (x * 7.0).astype(jnp.int32)
    return k // 2, lax.rem(k, jnp.full_like(k, 3)), k & 6, k | 1, k ^ 5, ~k, jnp.abs(k), k > 2, (k > 0) & ~(k > 3)


def chosen(x):
    which = (jnp.abs(x) * 2.0).astype(jnp.int32)
    return jnp.where(x > 0.0, x, 2.0 * x), lax.select_n(which, x, -x, 3.0 * x), jnp.where(True, x, 0.0)


def slopes(x):
    return jax.jvp(lambda x: (root(x), series(x), swapped(x), jax.vmap(power, (0, None))(x * x, 0.3)), (x,), (x * x,))


def known(x):
    return x * (jnp.asarray(-0.0) + jnp.exp(jnp.asarray(0.25)) * jnp.asarray(1e300) * 1e-300)


IN_DOUBLE = [root, slopes, known, solved]
FUNCTIONS = {
    f.__name__: f
    for f in [
        *(series, written_out, swapped, branch, entry, replaced, places, matrix, products, padded, reduced, limits),
        *(rounded, powers, functions, whole, chosen, *IN_DOUBLE),
    ]
}
INCLUDED = [f"#include <{name}.h>" for name in ("math", "stdbool", "stdint")]
X = np.array([0.6, -1.3, 0.21])


@functools.cache
def all_expected():
    """What JAX computes in one program."""
    return jax.jit(lambda x: {name: f(x) for name, f in FUNCTIONS.items()})(X)


def expected(name):
    return np.concatenate([np.ravel(np.asarray(leaf, float)) for leaf in jax.tree.leaves(all_expected()[name])])


def printed(name, language, head, dtype="float64"):
    program = lower(FUNCTIONS[name], symbols("x", (3,), dtype))
    values = [atom for leaf in jax.tree.leaves(program.results) for atom in leaf.ravel()]
    outputs = [(f"y[{k}]", value) for k, value in enumerate(values)]
    return language.function(PrintedFunction(head, ["x", "y"], program.statements, outputs))


CASES = [("gcc -std=c99", "float64"), ("g++ -xc++", "float64"), ("gcc -std=c99", "float32")]


@pytest.mark.parametrize(("command", "dtype"), CASES)
def test_c(tmp_path, command, dtype):
    if shutil.which(command.split()[0]) is None:
        pytest.skip(f"no compiler {command}")
    real, close = C().types[dtype], 1e-14 if dtype == "float64" else 2e-5
    names = [name for name, f in FUNCTIONS.items() if dtype == "float64" or f not in IN_DOUBLE]
    linked = 'extern "C" ' if "++" in command else ""
    heads = {name: f"{linked}void f_{name}(const {real} *x, {real} *y)" for name in names}
    texts = [printed(name, C(), heads[name], dtype) for name in names]
    source, library = tmp_path / "f.c", tmp_path / "f.so"
    source.write_text("\n".join([*INCLUDED, *texts]), encoding="utf-8")
    options = "-Wall -Wextra -Wpedantic -Werror -O1 -ffp-contract=off -fPIC -shared".split()
    subprocess.run([*command.split(), *options, str(source), "-o", str(library), "-lm"], check=True)
    loaded = ctypes.CDLL(str(library))
    for name in names:
        want = expected(name)
        x, y = X.astype(dtype), np.zeros(want.size, dtype)
        getattr(loaded, f"f_{name}")(ctypes.c_void_p(x.ctypes.data), ctypes.c_void_p(y.ctypes.data))
        np.testing.assert_allclose(y, want, close, close, err_msg=name)


def test_javascript(tmp_path):
    if shutil.which("node") is None:
        pytest.skip("no node")
    lines = ["const all = {};"]
    for name in FUNCTIONS:
        lines += [printed(name, JavaScript(), f"function f_{name}(x, y)"), f"all.{name} = [];"]
        lines.append(f"f_{name}({X.tolist()}, all.{name}); all.{name} = all.{name}.map(Number).map(String);")
    script = tmp_path / "f.js"
    script.write_text("\n".join([*lines, "console.log(JSON.stringify(all));"]), encoding="utf-8")
    done = subprocess.run(["node", str(script)], capture_output=True, text=True, check=True)
    for name, values in json.loads(done.stdout).items():
        numbers = np.array([float(value.replace("Infinity", "inf")) for value in values])
        np.testing.assert_allclose(numbers, expected(name), 1e-14, 1e-14, err_msg=name)


def test_text_is_the_same_whatever_was_compiled_before():
    before = printed("slopes", C(), "void f(void)")
    for name in ("slopes", "powers"):
        jax.jit(FUNCTIONS[name])(jnp.asarray(X))
    assert printed("slopes", C(), "void f(void)") == before
    assert "int64_t" not in printed("powers", C(), "void f(void)")  # pow by bits is for vectors only


def test_a_function_inside_that_was_compiled_before_is_printed_for_its_own_target():
    inner = jax.jit(lambda x: power(x, 1.5))
    assert "bitcast" in str(jax.make_jaxpr(inner)(2.0))  # vectorised, for XLA
    text = "\n".join(C().lines(lower(inner, symbols("x")).statements, 0))
    assert "pow(" in text
    assert "bitcast" in str(jax.make_jaxpr(inner)(2.0))


def test_each_operation_is_computed_once_and_nothing_in_vain():
    program = lower(lambda x, y: (jnp.sin(x) * 2.0, jnp.sin(x) + 1.0, jnp.cos(y))[:2], symbols("x"), symbols("y"))
    assert len(program.statements) == 3
    loop = lower(lambda x: lax.fori_loop(0, 3, lambda k, c: (c[0] + 1.0, jnp.exp(c[1])), (x, x))[0], symbols("x"))
    assert "exp" not in "\n".join(C().lines(loop.statements, 0))


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda x: jnp.sort(x), "'sort'"),
        (lambda x: jnp.linalg.solve(jnp.eye(3), x), "'lu'"),
        (lambda x: lax.pad(x, 0.0, [(-1, 0, 0)]), "'pad'"),
        (lambda x: lax.dynamic_update_slice(jnp.outer(x, x), x[None], (0, 0)), "'dynamic_update_slice'"),
        (lambda x: x.at[jnp.array([0, 2])].set(1.0), "'scatter' can be printed for one row"),
        (lambda x: jnp.argmax(jnp.outer(x, x), axis=0), "'argmax' can be printed for vectors"),
        (lambda x: jnp.outer(x, x)[:, jnp.array([2, 0])], "'gather' can be printed for whole rows"),
    ],
)
def test_what_cannot_be_printed_is_refused_by_name(function, said):
    with pytest.raises(NotImplementedError, match=said):
        lower(function, symbols("x", (3,)))


def test_what_javascript_lacks_is_refused_by_name():
    program = lower(jax.scipy.special.erf, symbols("x"))
    with pytest.raises(NotImplementedError, match="JavaScript has no 'erf'"):
        list(JavaScript().lines(program.statements, 0))
    single = lower(lambda x: x + 1.0, symbols("x", (), "float32"))
    with pytest.raises(NotImplementedError, match="float32"):
        list(JavaScript().lines(single.statements, 0))


def test_complex_numbers_are_refused_by_name():
    with pytest.raises(NotImplementedError, match="Complex numbers cannot be printed"):
        lower(lambda v: jnp.abs(jnp.exp(lax.complex(v, v))), symbols("v"))
