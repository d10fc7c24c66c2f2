"""A plain test that compiles more than its share of programs fails (`pytest_pyfunc_call` in `tests/conftest.py`)."""

import jax.numpy as jnp
import numpy as np
import pytest


@pytest.mark.xfail(raises=pytest.fail.Exception, strict=True)
def test_a_test_of_many_small_programs_fails():
    for size in range(2000, 2004):
        jnp.sin(np.zeros(size))


def test_a_test_of_few_programs_does_not():
    for size in range(2010, 2014):
        jnp.sin(np.zeros(size))


def test_folders_of_programs_are_linked_with_the_folder_of_printed_functions(tmp_path, pytestconfig):
    """Each process hands in what it compiled, also what `jaxdamp.codegen` keeps beside the programs of JAX."""
    (helpers,) = (p for p in pytestconfig.pluginmanager.get_plugins() if hasattr(p, "_hand_in"))
    ours, kept = tmp_path / "ours", tmp_path / "kept"
    for folder, name in ((ours, "new"), (kept, "old"), (ours, "both"), (kept, "both")):
        (folder / "printed").mkdir(parents=True, exist_ok=True)
        for file in (folder / f"{name}-cache", folder / "printed" / f"{name}.so"):
            file.write_text(folder.name)
    helpers._hand_in(ours, kept)
    found = {path.relative_to(kept).as_posix(): path.read_text() for path in kept.rglob("*") if path.is_file()}
    names = ("{}-cache", "printed/{}.so")
    expected = {"new": "ours", "old": "kept", "both": "kept"}
    assert found == {name.format(key): text for key, text in expected.items() for name in names}
    assert not ours.exists()
