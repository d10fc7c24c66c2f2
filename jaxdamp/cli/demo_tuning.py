"""The tuning of `jaxdamp demo`: comfort against the grip of the tyre."""

from jaxdamp.tune import TuneResult


COMFORT = "weighted_rms_sprung_acceleration"
GRIP = "rms_dynamic_tyre_load"
WORDS = {
    COMFORT: "body acceleration as people feel it (ISO 2631-1, Wk)",
    GRIP: "tyre load variation",
}


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
