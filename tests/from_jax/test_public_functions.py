"""Every public function with traced numbers computes, or refuses them in a sentence; none ends in an error of JAX."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def outcomes() -> dict[str, list[str]]:
    script = Path(__file__).with_name("traced_calls.py")
    done = subprocess.run([sys.executable, script], env=os.environ, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    return json.loads(done.stdout)


@pytest.mark.slow
def test_every_public_function_of_numbers_is_called_with_a_traced_one(outcomes):
    missing = [name for name, calls in outcomes.items() if calls == ["no sample"]]
    assert not missing, f"tests/from_jax/traced_samples.py needs a sample for {missing}"
    gone = [name for name, calls in outcomes.items() if calls == ["no such function"]]
    assert not gone, f"tests/from_jax/traced_samples.py has samples for {gone}, which are no public functions"
    assert len(outcomes) > 100 and sum(calls.count("traced") for calls in outcomes.values()) > 100


@pytest.mark.slow
def test_none_ends_in_an_error_of_jax(outcomes):
    raw = [f"{name}, call {i}: {call}" for name, calls in outcomes.items() for i, call in enumerate(calls)]
    assert not [line for line in raw if ": raw " in line]


@pytest.mark.slow
def test_a_refusal_names_the_argument_and_says_what_to_do(outcomes):
    refused = [call for calls in outcomes.values() for call in calls if call.startswith("refused")]
    assert len(refused) > 20
    for sentence in refused:
        assert sentence.startswith("refused: Argument `")
        assert any(word in sentence for word in ("traced", "Tracer")), sentence
