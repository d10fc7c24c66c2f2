"""Costly sides of `jnp.where` in printed C: computed where they are taken, with the same values and derivatives."""

import ctypes

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from numpy.testing import assert_allclose

from jaxdamp._limits import ramp
from jaxdamp._root import increasing_root
from jaxdamp.codegen import C, Signature, library, with_slopes
from jaxdamp.codegen._branches import in_branches
from jaxdamp.codegen._program import Assign, Branch, Declare, Define, Loop, Variable, constant


LANES = 4
HEAD = f"""#include <math.h>
#include <stdint.h>
#include <stdbool.h>
enum {{ LANES = {LANES} }};
static const double dp[1][LANES] = {{{{1, 0, 0, 0}}}};
"""
ARGUMENTS = "const double *s, const double (*ds)[LANES], double *y, double (*dy)[LANES]"
CALL = f"void call(const double *p, {ARGUMENTS}) {{ f_prepare(p); f(p, s, ds, y, dy, 1); }}\n"


def nested(p):
    inner = jnp.where(p[2] > 0.5, jnp.exp(p[1]), jnp.sin(p[1]))
    return jnp.where(p[0] > 0, inner * jnp.log1p(p[3] ** 2), jnp.cos(inner))


def taken_twice(p):
    shared = jnp.exp(p[1]) * p[2]
    return jnp.where(p[0] > 0, shared, 2.0 * p[3]) + jnp.where(p[3] > 0, jnp.tanh(p[2]), shared)


def in_a_loop(p):
    def function(w):
        return w + jnp.where(p[0] > 0, jnp.tanh(w), 0.0) + jnp.where(w > p[1], jnp.expm1(w - p[1]), 0.0) - p[2]

    limit = jnp.full_like(p[2], 50.0)
    return increasing_root(function, p[3], -limit, limit, steps=60, close=1e-9)


FUNCTIONS = {
    "rounded or sharp": lambda p: jnp.sum(ramp(p[1:3] - p[3], p[0])),
    "both sides": lambda p: jnp.where(p[0] > 0, jnp.exp(p[1] * p[2]), jnp.sqrt(1.0 + p[3] ** 2)),
    "nested": nested,
    "taken twice": taken_twice,
    "the condition itself": lambda p: jnp.where(p[0] > 0, jnp.exp(p[1]), p[2]) + jnp.where(p[0] > 0, p[3], 0.0),
    "no number on the other side": lambda p: jnp.where(p[0] > 0, jnp.log(jnp.where(p[0] > 0, p[0], 1.0)), p[1] * p[2]),
    "in a loop": in_a_loop,
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_values_and_derivatives_are_those_of_jax(name) -> None:
    function = FUNCTIONS[name]
    signature = Signature("f", f"{ARGUMENTS}, int slopes", ["y[0]"], ["dy[0][k]"])

    def of_states(arrays, states):
        """The first number is one that stays, as parameters are, the others change from call to call."""
        return function(jnp.concatenate([arrays[0], states]))[None]

    text = with_slopes(signature, of_states, [(1,)], [0], 3)
    assert ") {" in text.replace("for (;;) {", "")
    call = library(HEAD + text + CALL).call
    points = np.random.default_rng(3).normal(size=(64, 4))
    points[::4, 0] = 0.0
    right, slopes = jax.vmap(function)(points), jax.vmap(jax.jacfwd(function))(points)
    unit = np.eye(LANES)[1:].copy()
    for p, value, slope in zip(points, right, slopes, strict=True):
        y, dy = np.full(1, np.nan), np.full((1, LANES), np.nan)
        call(*(ctypes.c_void_p(a.ctypes.data) for a in (p, p[1:], unit, y, dy)))
        assert_allclose(y[0], value, rtol=1e-12, atol=1e-14)
        assert_allclose(dy[0], slope, rtol=1e-11, atol=1e-13)


@pytest.mark.parametrize("body", [[], [Define(Variable("t", "float64"), "exp", (Variable("x", "float64"),))]])
def test_a_side_without_statements_is_not_written(body) -> None:
    case = Variable("case", "bool")
    lines = ["const double t = exp(x);"] if body else []
    for bodies, test in (([[], body], "if (case) {"), ([body, []], "if (!case) {")):
        text = [line.strip() for line in C().lines([Branch(case, bodies)], 0)]
        assert text == ([test, *lines, "}"] if body else [])


def number(name, dtype="float64"):
    return Variable(name, dtype)


def test_only_what_one_side_takes_alone_is_in_a_branch() -> None:
    p, q, case, costly, cheap, chosen = map(number, ("p", "q", "case", "costly", "cheap", "chosen"))
    choice = Define(chosen, "select", (case, costly, cheap))
    before = [Define(case, "gt", (p, q)), Define(costly, "exp", (p,)), Define(cheap, "neg", (q,)), choice]
    declared, condition, branch, neg, last = in_branches(before, (), {"chosen"})
    assert isinstance(declared, Declare) and isinstance(branch, Branch)
    assert (declared.target, condition, neg, last) == (costly, before[0], before[2], choice)
    first = branch.bodies[1][0]
    assert branch.case == case and not branch.bodies[0]
    assert isinstance(first, Define) and first.operation == "exp"
    for outside in ({"chosen", "costly"}, {"chosen", "cheap", "costly"}):
        assert in_branches(before, (), outside) == before
    assert in_branches(before, [Define(number("more"), "neg", (costly,))], {"chosen", "more"}) == before
    assert in_branches(before, (), {"chosen"}, changing=["case"]) == before  # a loop may have changed it meanwhile
    looped = [Declare(case, constant(0, "bool")), before[1], Loop([Assign(case, before[0].target)]), *before[2:]]
    assert in_branches(looped, (), {"chosen"}) == looped  # a loop assigns it after what one side takes
    late = [before[1], before[0], *before[2:]]
    assert in_branches(late, (), {"chosen"}) == late  # the condition is not known where it is computed
