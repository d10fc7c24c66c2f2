"""Numbers on the command line that are possible but unusual, as where another unit was meant."""

FASTEST = 70.0  # m/s, 252 km/h
HIGHEST_BUMP = 0.3  # m
LONGEST_BUMP = 50.0  # m


def unusual(road: str, speed: float) -> list[str]:
    """Sentences on a speed [m/s] or a bump that no road vehicle meets every day.

    >>> unusual("iso:C", 72.0)
    ['unusual: --speed 72 is 259 km/h. It is in m/s: if km/h was meant, write --speed 20.']
    """
    notes = []
    if speed > FASTEST:
        remedy = f"It is in m/s: if km/h was meant, write --speed {speed / 3.6:.3g}."
        notes.append(f"unusual: --speed {speed:g} is {3.6 * speed:.0f} km/h. {remedy}")
    size = _bump(road)
    if size is not None and (size[0] > HIGHEST_BUMP or size[1] > LONGEST_BUMP):
        height, length = size
        remedy = f"Both are in m: if mm were meant, write bump:{1e-3 * height:g}:{1e-3 * length:g}."
        notes.append(f"unusual: --road {road} is {height:g} m high and {length:g} m long. {remedy}")
    return notes


def _bump(road: str) -> tuple[float, float] | None:
    """Height and length of bump:HEIGHT:LENGTH."""
    kind, *numbers = road.split(":")
    try:
        height, length = map(float, numbers)
    except ValueError:
        return None
    return (height, length) if kind == "bump" else None
