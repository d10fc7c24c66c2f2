import jaxtyping
import pytest


@pytest.fixture
def unchecked():
    """Turns the run-time checks of shapes off, to see what a user without them sees."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)
