"""A law as a force-velocity table, and as the table of a vehicle simulator, in its units and with its sign."""

import os
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxdamp import _checks
from jaxdamp._display import COMPRESSION, display
from jaxdamp._field_types import check_module
from jaxdamp._traced import of_known_numbers
from jaxdamp._types import VectorLike
from jaxdamp._warned import warn
from jaxdamp._writing import write_whole
from jaxdamp.dampers import AbstractDamper, Heated, command_words, extrapolated, laws_inside, without_fitted_ranges
from jaxdamp.rig import as_warm_as_it_begins, dynamic_stiffness, quasi_static


@of_known_numbers
def to_csv(law: AbstractDamper, path: str | os.PathLike[str], velocities: VectorLike) -> Path:
    """Write the force of a law over velocity as a table, one point per line; in SI unless a command shows other units.

    A table holds one force for each velocity. For a law with states that is the force at constant velocity once the
    states have settled (`jaxdamp.rig.quasi_static`); its hysteresis is not in the table, which the header states.
    Velocities at which the law has no settled or no finite force have no row: a comment in the file and a Python
    warning state how many, where and why. The header also states the fitted range of the law and the rows outside it,
    since simulators could not read marks in the rows themselves.

    Arguments:
        law: the law.
        path: the file to write; an existing one is replaced, and never left half-written.
        velocities: strictly increasing velocities [m/s], positive in rebound, shape (points,).

    Returns:
        The path of the file.

    Raises:
        ValueError: velocities that do not increase, a folder that does not exist, a law without a settled force at any
            of the velocities.
    """
    shown = display()
    table = settled_table(law, velocities, "to_csv(law, path, velocities)", turned=shown.sign == COMPRESSION)
    units = shown.of("m/s", signed=True), shown.of("N", signed=True)
    points = sorted(zip(units[0](table.velocity), units[1](table.force), strict=True))
    rows = [f"{float(v) + 0.0!r},{float(f) + 0.0!r}" for v, f in points]  # no -0.0
    about, *others = table.comments  # the numbers of a law are in SI whatever is shown
    others += _static_line(table, "in the table")
    comments = [f"# {about}", *(f"# {shown.words(line)}" for line in others)]
    heading = ",".join(f"{name} [{unit.unit}]" for name, unit in zip(("velocity", "force"), units, strict=True))
    return _written(path, "\n".join([*comments, heading, *rows]) + "\n", table)


class SettledTable(NamedTuple):
    """The force of a law over velocity, and what a reader of the table must know."""

    velocity: np.ndarray  # [m/s], positive in rebound, shape (points,)
    force: np.ndarray  # [N], positive when it resists extension, shape (points,)
    static: float  # [N], the force at rest at stroke zero, in the same sense; 0 unless a gas or a spring gives one
    comments: list[str]  # lines of text
    left_out: str  # the rows that were left out and why; empty if there are none


def settled_table(law: AbstractDamper, velocities: VectorLike, call: str, *, turned: bool = False) -> SettledTable:
    """The force at constant velocity once the states have settled, as `to_csv` writes it.

    Its comments are on numbers that are positive in rebound, or in compression if they are turned.
    """
    check_module("law", law, (AbstractDamper,), call)
    velocity = np.asarray(velocities, dtype=float)
    _checks.finite("velocities", velocity)
    if velocity.ndim != 1 or velocity.size == 0 or np.any(np.diff(velocity) <= 0):
        _checks.refuse("velocities", "be one or more, strictly increasing", velocity, "Try `numpy.unique`.")
    curve, still = quasi_static(law, velocity), jnp.zeros(())
    if not set(np.sign(velocity)) - {0.0} <= set(np.sign(velocity[curve.settled])):  # a whole side is missing
        remedy = "A table cannot represent such a law: use `respond` with the intended motion."
        what = f"{type(law).__name__}. {curve.note.removesuffix('.')}"
        _checks.refuse("law", "have a force at constant velocity", what, remedy)
    comments = [
        f"law, its numbers in SI and positive in rebound: {law!r}",
        "velocity is positive in extension (rebound), force is positive when it resists extension",
    ]
    comments += [said] if (said := command_words(law)) else []
    states = law.initial_state().size
    if states:
        comments.append(
            f"quasi-static: force at constant velocity; the hysteresis of the law's {states} state(s) is not in here"
        )
    comments += [
        f"as warm as it begins: {float(part.initial_rise):g} K above its reference temperature"
        for _, part in laws_inside(law)
        if isinstance(part, Heated)
    ]
    if curve.note:
        comments.append(f"rows left out{', with rebound counted positive' * turned}: {curve.note}")
    settled, force = velocity[curve.settled], np.asarray(curve.force)[curve.settled]
    comments += _range_lines(law, settled, turned=turned)
    if 0.0 in settled:  # nothing is compiled for it
        static = float(force[settled == 0.0][0])
    else:
        static = float(law.force(still, still, law.initial_state()))
    static *= abs(static) > 1e-9 * np.abs(force).max(initial=0.0)  # less is a rounding error
    return SettledTable(settled, force, static, comments, curve.note)


def _static_line(table: SettledTable, where: str) -> list[str]:
    """A comment on the static force, in words that hold for either sign convention."""
    way = "pushes the rod out" if table.static < 0 else "pulls the rod in"
    return [f"static force of {abs(table.static):.4g} N, which {way} at stroke zero, is {where}"] * bool(table.static)


def _written(path: str | os.PathLike[str], content: str | bytes, table: SettledTable) -> Path:
    """Write a file, with a Python warning of rows that are not in it."""
    written = write_whole(path, content)
    if table.left_out:
        warn(f"{written.name}: rows left out. {table.left_out}")
    return written


def _in_ascii(lines: list[str]) -> bytes:
    """Lines in ASCII, which all these programs read."""
    return "\n".join([*lines, ""]).replace("−", "-").replace("\N{DEGREE SIGN}", "").encode("ascii", "replace")


def _range_lines(law: AbstractDamper, velocity: np.ndarray, *, turned: bool) -> list[str]:
    """Comments on the fitted range of the law and on the rows outside it."""
    lines, fitted = [], law.fitted_to
    if fitted is not None:
        ends = {q.name: (-q.limits[1], -q.limits[0]) for q in fitted.known() if display().signed(q.name)}
        lines.append(f"fitted to: {(replace(fitted, **ends) if turned else fitted).words()}")
    outside = extrapolated(law, velocity)
    if not outside.any():
        return lines
    if outside.all():
        return [*lines, "extrapolated: all rows lie beyond the velocities that the law was fitted to"]
    low, high = sorted((-1.0 if turned else 1.0) * velocity[~outside][[0, -1]])
    where = f"rows below {low:.6g} m/s and above {high:.6g} m/s"
    return [*lines, f"extrapolated: {where}, {np.count_nonzero(outside)} of {velocity.size}, beyond all records"]


_FREQUENCIES = (1.5, 12.0)  # Hz, near the natural frequencies of body and wheel
_SAMPLES = 200  # of a sine


@of_known_numbers
def to_adams(law: AbstractDamper, path: str | os.PathLike[str], velocities: VectorLike) -> Path:
    """Write a law as damper property file (TeimOrbit format, `.dpr`) for Adams/Car, MotionView or SIMPACK.

    Columns are the velocity [mm/s], positive in extension, and the force [N], positive when it resists extension. The
    importing program interpolates and extrapolates by its own rules (MotionView and Adams/Car by Akima splines), so let
    the velocities cover those of the simulation.

    A table holds one force for each velocity: the comments of the file state its range and what it leaves out of a law
    with states or a force over stroke, computed for sines of 1.5 Hz and 12 Hz.

    Arguments:
        law: the law.
        path: the file to write; an existing one is replaced, and never left half-written.
        velocities: strictly increasing velocities [m/s], positive in rebound, shape (points,).

    Returns:
        The path of the file.

    Raises:
        ValueError: as `to_csv`.
    """
    table = _table(law, velocities, "to_adams(law, path, velocities)")
    lines = [
        *_section("MDI_HEADER"),
        " FILE_TYPE     =  'dpr'",
        " FILE_VERSION  =  4.0",
        " FILE_FORMAT   =  'ASCII'",
        *(f"$ {line}" for line in table.comments),
        *_section("UNITS"),
        " LENGTH  =  'mm'",
        " ANGLE   =  'degrees'",
        " FORCE   =  'newton'",
        " MASS    =  'kg'",
        " TIME    =  'second'",
        *_section("CURVE"),
        "{  vel          force}",
        *(f"{1e3 * v:14.6f}  {f:14.6f}" for v, f in zip(table.velocity, table.force, strict=True)),
    ]
    return _written(path, _in_ascii(lines), table)


@of_known_numbers
def to_carsim(law: AbstractDamper, path: str | os.PathLike[str], velocities: VectorLike) -> Path:
    """Write a law as table of force [N] over compression rate [mm/s] for CarSim and TruckSim, both positive in jounce.

    The file is a Parsfile with the table of the shock absorber, `FD_TABLE`, interpolated and extrapolated linearly. Its
    rows can also be pasted into the table on the shock absorber screen. The comments are those of `to_adams`.

    Arguments:
        law: the law.
        path: the file to write; an existing one is replaced, and never left half-written.
        velocities: strictly increasing velocities [m/s], positive in rebound, shape (points,).

    Returns:
        The path of the file.

    Raises:
        ValueError: as `to_csv`.
    """
    table = _table(law, velocities, "to_carsim(law, path, velocities)")
    pairs = zip(-1e3 * table.velocity[::-1], -table.force[::-1], strict=True)
    lines = [
        "PARSFILE",
        *(f"! {line}" for line in table.comments),
        "! in this file compression rate [mm/s] and force [N] are positive in compression (jounce)",
        "FD_TABLE LINEAR",
        *(f"{rate:.6f}, {force:.6f}" for rate, force in pairs),
        "ENDTABLE",
        "END",
    ]
    return _written(path, _in_ascii(lines), table)


@of_known_numbers
def to_matlab(law: AbstractDamper, path: str | os.PathLike[str], velocities: VectorLike) -> Path:
    """Write a law as MATLAB file (`.mat`) for a 1-D Lookup Table of Simulink or a table of Simscape.

    The variables are `velocity` [m/s], positive in extension, `force` [N], positive when it resists extension, both as
    columns, and `about`, the comments of `to_adams` as a text. Simulink extrapolates by the setting of the block.

    Arguments:
        law: the law.
        path: the file to write; an existing one is replaced, and never left half-written.
        velocities: strictly increasing velocities [m/s], positive in rebound, shape (points,).

    Returns:
        The path of the file.

    Raises:
        ValueError: as `to_csv`; a path that does not end in `.mat`.
    """
    import io

    from scipy.io import savemat

    if Path(path).suffix.lower() != ".mat":
        remedy = "It holds binary data, not a script: write `front.mat`, and read it by `load front.mat`."
        _checks.refuse("path", "be a file NAME.mat", str(path), remedy)
    table, content = _table(law, velocities, "to_matlab(law, path, velocities)"), io.BytesIO()
    about = "\n".join(table.comments)
    savemat(content, {"velocity": table.velocity[:, None], "force": table.force[:, None], "about": about})
    return _written(path, content.getvalue(), table)


@of_known_numbers
def to_assetto_corsa(
    law: AbstractDamper, path: str | os.PathLike[str], velocities: VectorLike, *, motion_ratio: float = 1.0
) -> Path:
    """Write a law as the six damper values of `suspensions.ini` of Assetto Corsa, to paste into an axle's section.

    The game has two straight lines through zero in each direction: a slow rate up to a threshold and a fast rate beyond
    it. They are fitted by least squares to the table without the static force, such as that of a gas, which belongs to
    the spring; the comments state it and the misfit, besides those of `to_adams`. Rates are at the wheel: a damper rate
    counts with the square of the motion ratio, a threshold with its inverse.

    Arguments:
        law: the law.
        path: the file to write; an existing one is replaced, and never left half-written.
        velocities: strictly increasing velocities [m/s] of the damper, positive in rebound, at least three of each
            sign, shape (points,).
        motion_ratio: travel of the damper for one of travel of the wheel.

    Returns:
        The path of the file.

    Raises:
        ValueError: as `to_csv`; fewer than three velocities in a direction; a motion ratio that is not positive; a law
            whose force does not change with the velocity, such as a spring.
    """
    _checks.positive("motion_ratio", motion_ratio)
    table = _table(law, velocities, "to_assetto_corsa(law, path, velocities)", "left out: it belongs to the spring")
    damping = np.where(np.isclose(table.force, table.static, rtol=1e-9, atol=0.0), 0.0, table.force - table.static)
    if not damping.any():
        remedy = "The file would hold no damping: give the damper, and the rate of the spring to `SPRING_RATE`."
        _checks.refuse("law", "have a force that changes with the velocity", law, remedy)
    lines = [f"; {line}" for line in table.comments]
    lines.append(f"; rates at the wheel, for {motion_ratio:g} m of the damper for 1 m of the wheel")
    for name, sign in (("BUMP", -1.0), ("REBOUND", 1.0)):
        inside = sign * table.velocity > 0
        speed, force = sign * table.velocity[inside], sign * damping[inside]
        if speed.size < 3:
            must = f"hold three velocities or more in {'compression' if sign < 0 else 'rebound'}"
            _checks.refuse("velocities", must, table.velocity, table.left_out)
        slow, fast, threshold, misfit = _two_lines(speed, force)
        lines += [
            f"; two straight lines differ from the table by {100 * misfit:.1f} % of its RMS force",
            f"DAMP_{name}={slow * motion_ratio**2:.1f}",
            f"DAMP_FAST_{name}={max(fast * motion_ratio**2, 0.1):.1f}",  # zero stands for the slow rate
            f"DAMP_FAST_{name}THRESHOLD={threshold / motion_ratio:.4f}",
        ]
    return _written(path, _in_ascii(lines), table)


def _two_lines(speed: np.ndarray, force: np.ndarray) -> tuple[float, float, float, float]:
    """Slow and fast rate of the best two lines that are not falling, the threshold at one of the speeds, the misfit."""
    from scipy.optimize import nnls

    lines = []
    for threshold in np.unique(speed)[:-1]:
        parts = np.stack([np.minimum(speed, threshold), np.maximum(speed - threshold, 0.0)], axis=1)
        (slow, fast), error = nnls(parts, force)
        lines.append((float(slow), float(fast), float(threshold), float(error / (np.linalg.norm(force) or 1.0))))
    return min(lines, key=lambda line: line[-1])


def _table(law: AbstractDamper, velocities: VectorLike, call: str, static: str = "in the table") -> SettledTable:
    """The settled table, with comments on its static force, on its range and on what it leaves out."""
    table = settled_table(law, velocities, call)
    low, high = table.velocity[[0, -1]]
    limits = f"range: {low:g} to {high:g} m/s; beyond it the program that reads the table extrapolates"
    comments = [*table.comments, *_static_line(table, static), limits, *_left_out(law, table)]
    return table._replace(comments=comments)


def _left_out(law: AbstractDamper, table: SettledTable) -> list[str]:
    """How far the force of a law with states or over stroke differs from its table in settled sines."""
    if not law.initial_state().size and not law.traits().stroke_dependent:
        return []
    peak = 0.5 * float(min(-table.velocity[0], table.velocity[-1]))
    if peak <= 0:
        return ["what the table leaves out is not computed, since it holds one direction only"]
    law = as_warm_as_it_begins(without_fitted_ranges(law))
    reach = min([np.inf, *(abs(float(limit)) for term in law.side_by_side() for limit in term.stroke_limits)])
    shares = []
    for frequency in _FREQUENCIES:
        rate = 2.0 * np.pi * frequency
        speed = min(peak, 0.9 * reach * rate)
        force = np.asarray(dynamic_stiffness(law, [frequency], speed / rate, samples=_SAMPLES).force)[0]
        where = f"at {frequency:g} Hz and {speed:.3g} m/s"
        if not np.all(np.isfinite(force)):
            return [f"what the table leaves out is not known {where}, where the law has no steady force"]
        velocity = speed * np.cos(2.0 * np.pi * np.arange(_SAMPLES) / _SAMPLES)
        lost = force - np.interp(velocity, table.velocity, table.force)
        shares.append(f"{100.0 * np.sqrt(np.mean(lost**2) / np.mean(force**2)):.1f} % {where}")
    return [f"left out by the table, as a share of the RMS force in a settled sine: {', '.join(shares)}"]


def _section(name: str) -> list[str]:
    return [f"${name:->71}", f"[{name}]"]
