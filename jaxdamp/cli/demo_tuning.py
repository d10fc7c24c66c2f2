"""The tuning of `jaxdamp demo`: comfort against the grip of the tyre, and what it is worth on fresh roads."""

import numpy as np

from jaxdamp.tune import Rescore, TuneResult


COMFORT = "weighted_rms_sprung_acceleration"
GRIP = "rms_dynamic_tyre_load"
WORDS = {
    COMFORT: "body acceleration as people feel it (ISO 2631-1, Wk)",
    GRIP: "tyre load variation",
}


def limits(before: dict[str, float], tyre_load: float) -> dict[str, float]:
    """The limit of the tuning: the tyre load may vary by so much more than before."""
    return {GRIP: tyre_load * before[GRIP]}


def purpose(tyre_load: float) -> str:
    """What is tuned, and why, in words."""
    return (
        f"For this light car the damper is stiff: it holds the tyre to the road and shakes the body. Its three damping "
        f"coefficients, each within a third and three times its value, are tuned for the least {WORDS[COMFORT]}, while "
        f"the RMS variation of the tyre load may grow by {100 * (tyre_load - 1):.0f} % at most."
    )


def outcome(tuned: TuneResult) -> str:
    """What the tuning gained, what stopped it, and what it cost."""
    gain = 100 * (1 - tuned.after[COMFORT] / tuned.before[COMFORT])
    bounds = [f"{c.name} is {c.note}" for c in tuned.parameters if c.note]
    stops = [f"the {WORDS.get(n, n)} is at its limit" for n in tuned.active_limits]
    stops += bounds or ["all coefficients lie inside their bounds"]
    others = [n for n in tuned.before if n not in (COMFORT, *tuned.limits) and tuned.before[n]]
    shares = {n: 100 * (tuned.after[n] / tuned.before[n] - 1) for n in others}
    worse = ", ".join(f"{n.replace('_', ' ')} {s:+.0f} %" for n, s in shares.items() if s >= 1)
    cost = f"The price: {worse}." if worse else "Nothing else gets worse."
    stop = "; ".join(stops)
    return f"The body shakes {gain:.0f} % less. What ends the search: {stop}. {cost}"


def fresh_verdict(fresh: Rescore) -> str:
    """Whether the gain holds on roads that the tuning has not seen."""
    gain, cost = 100 * fresh.change(COMFORT), 100 * fresh.change(GRIP)
    held = int(np.sum(gain < 0))
    return (
        f"On {held} of {fresh.roads} fresh roads the body shakes less, by {-gain.mean():.0f} % on average "
        f"({-gain.max():.0f} to {-gain.min():.0f} %); the {WORDS[GRIP]} changes by "
        f"{cost.mean():+.0f} % ({cost.min():+.0f} to {cost.max():+.0f} %)."
    )
