"""How searches end."""

import enum


class Status(enum.Enum):
    """How a fit, a training or a tuning ended: compare with `is` in code; `sentence` explains it."""

    CONVERGED = "The search converged."
    STEP_LIMIT = "The search stopped after as many steps as `max_steps` allows."
    NO_STEP = "A step of the search could not be computed."
    NO_BETTER_STEP = "The search found no better step from where it ended, but that is not a smooth optimum."
    LIMIT_NOT_MET = "A limit is not met."
    STOPPED_EARLY = "The error on the held-out records fell no more."
    ALL_STEPS = "All steps were taken."
    NOT_STEADY = "No motion that repeats with every period of the excitation was found."
    UNSTABLE = "The motion that was found is unstable: after the smallest disturbance it goes over into another one."
    LEFT_OUT = "It was left out: there is no result."
    COMPUTED = "It was computed directly, without a search."

    @property
    def sentence(self) -> str:
        """Explanation in a sentence."""
        return self.value

    @property
    def good(self) -> bool:
        """Whether the end is one that was wanted: converged, or computed without a search."""
        return self in (Status.CONVERGED, Status.COMPUTED)
