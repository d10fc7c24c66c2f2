"""Fits as tables and sentences, for `fit` and for `demo`."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from jaxdamp import identify
from jaxdamp.bench import BenchRun
from jaxdamp.cli.residual import Shares
from jaxdamp.dampers import AbstractDamper
from jaxdamp.identify import Comparison, FitResult, Rung
from jaxdamp.identify.traces import is_memoryless
from jaxdamp.parameters import free_parameters
from jaxdamp.report import Cell, Column, Shown, Table


class Law(NamedTuple):
    """What a name on the command line stands for."""

    hysteresis: bool
    meaning: str


LAWS = {
    "linear": Law(False, "one damping coefficient"),
    "bilinear": Law(False, "one coefficient in rebound, one in compression"),
    "power_law": Law(False, "power of the velocity with an offset, on each side"),
    "polynomial": Law(False, "odd and even powers of the velocity, up to the fifth"),
    "segmented_polynomial": Law(False, "five polynomials that join, monotone"),
    "piecewise_linear": Law(False, "straight lines between knees"),
    "table": Law(False, "forces at fixed velocities, straight lines between them"),
    "besinger": Law(False, "smooth change from compression to rebound, with a blow-off valve"),
    "linear_friction": Law(False, "one coefficient and smooth Coulomb friction"),
    "besinger_lag": Law(True, "besinger behind a first-order lag"),
    "besinger_series_spring": Law(True, "besinger in series with a spring: mount, bushing or oil column"),
    "linear_friction_lag": Law(True, "linear_friction behind a first-order lag"),
    "bouc_wen": Law(True, "one coefficient, friction that gives before it slides, a spring"),
    "lugre_spring": Law(True, "friction that sticks, breaks away and slides, one coefficient, a spring"),
}


def laws_table() -> Table:
    """The laws that can be fitted by name."""
    columns = (Column("law"), Column("hysteresis"), Column("what it is"))
    known = ((name, LAWS.get(name, Law(False, ""))) for name in identify.LAWS)
    return Table("Laws", columns, tuple((name, "yes" if law.hysteresis else "no", law.meaning) for name, law in known))


def records_table(runs: Sequence[BenchRun], held_out: Sequence[BenchRun] = ()) -> Table:
    """The records with their figures."""
    columns = [Column("record"), Column("rate", "Hz"), Column("motion", "Hz", ".3g"), Column("0-peak", "mm", ".3g")]
    columns += [Column("peak velocity", "m/s", ".3g"), Column("least force", "N", ".0f")]
    columns += [Column("largest force", "N", ".0f"), Column("work per cycle", "J", ".3g"), Column("cycles")]
    columns += [Column("use")] if held_out else []
    names = {run.name for run in held_out}
    rows: list[tuple[Cell, ...]] = []
    for run in runs:
        row: tuple[Cell, ...] = (run.name, run.sampling_rate, run.frequency, 1e3 * run.amplitude, run.peak_velocity)
        row += (float(run.force.min()), float(run.force.max()), run.work_per_cycle, run.cycles)
        rows.append(row + ("held out" if run.name in names else "fitted",) * bool(held_out))
    return Table("Records (stroke and velocity positive in rebound)", tuple(columns), tuple(rows))


def ladder_table(comparison: Comparison, shares: Mapping[str, Shares]) -> Table:
    """Each law with its errors, and what these are made of."""
    held = bool(comparison.held_out)
    columns = [Column("law"), Column("free", spec="d"), Column("fit", "%", ".1f"), Column("RMSE", "N", ".1f")]
    columns += [Column("held-out fit", "%", ".1f"), Column("held-out RMSE", "N", ".1f")] * held
    columns += [Column(name, "%", ".0f") for name in Shares._fields]
    columns += [Column("note")]
    rows: list[tuple[Cell, ...]] = []
    for rung in comparison.rungs:
        scores = (rung.name, rung.parameters, rung.fit_percent, rung.rmse)
        scores += (rung.held_out_fit_percent, rung.held_out_rmse) if held else ()
        rows.append((*scores, *(100 * share for share in shares[rung.name]), _short_note(rung.result)))
    rows += [(failure.name, *[None] * (len(columns) - 2), "failed") for failure in comparison.failed]
    return Table("Laws (shape, hysteresis and rest are shares of the squared error)", tuple(columns), tuple(rows))


def _short_note(result: FitResult) -> str:
    weak = sum(e.note == "not identifiable" for e in result.parameters)
    bound = sum(e.note == "at a bound" for e in result.parameters)
    parts = ["not converged"] * (not result.converged)
    parts += [f"{weak} not identifiable"] * bool(weak) + [f"{bound} at a bound"] * bool(bound)
    return ", ".join(parts)


def parameter_table(name: str, result: FitResult, truth: AbstractDamper | None = None) -> Table:
    """Fitted values with standard errors, beside the true ones where these are known."""
    columns = [Column("parameter"), Column("unit"), Column("value", spec=".5g"), Column("standard error", spec=".2g")]
    columns += [Column("true", spec=".5g"), Column("(value − true)/se", spec="+.1f")] * (truth is not None)
    columns += [Column("note"), Column("meaning")]
    known = {} if truth is None else _numbers(truth)
    rows: list[tuple[Cell, ...]] = []
    for e in result.parameters:
        value, error = identify.rounded(e.value, e.standard_error)
        row: tuple[Cell, ...] = (e.name, e.unit or "–", Shown(e.value, value), Shown(e.standard_error, error))
        if truth is not None:
            true = known.get(e.name)
            row += (true, None if true is None else (e.value - true) / e.standard_error)
        rows.append((*row, e.note, e.meaning))
    return Table(f"Parameters of {name}", tuple(columns), tuple(rows))


def _numbers(law: AbstractDamper) -> dict[str, float]:
    """Every number of a law by name."""
    free = free_parameters(law)
    return {name: float(value) for name, value in zip(free.names, free.values, strict=True)}


def failures(comparison: Comparison, unfitted: Sequence[str] = ()) -> list[str]:
    """The laws without a fit, and why."""
    left = [f"{name} was not fitted: interrupted." for name in unfitted]
    return [f"{failure.name} could not be fitted. {failure.reason}" for failure in comparison.failed] + left


def verdict(comparison: Comparison, shares: Mapping[str, Shares]) -> list[str]:
    """How good the laws are, in words."""
    best = comparison.best
    static = [r for r in comparison.rungs if is_memoryless(r.result.law)]
    sentences = [_praise(best, comparison)]
    if static:
        rung = min(static, key=lambda rung: rung.error)
        part = shares[rung.name].hysteresis
        lead = "It is a law of velocity alone" if rung is best else f"The best law of velocity alone is {rung.name}"
        if part >= 0.05:
            sentences.append(
                f"{lead}: {100 * part:.0f} % of its squared error is hysteresis (at one velocity the force differs"
                " between the two halves of the stroke), which no such law can follow."
            )
        else:
            sentences.append(f"{lead}, and hysteresis is not what it lacks: {100 * part:.0f} % of its squared error.")
        if rung is best and part >= 0.05 and len(static) == len(comparison.rungs):
            sentences.append("Try a law with hysteresis, such as besinger_lag or besinger_series_spring.")
        elif rung is not best:
            factor = rung.error / best.error
            sentences.append(f"{best.name} has a {factor:.1f} times smaller error.")
    if not is_memoryless(best.result.law) and shares[best.name].hysteresis >= 0.05:
        part = 100 * shares[best.name].hysteresis
        sentences.append(f"Of what {best.name} leaves, {part:.0f} % is still hysteresis.")
    if shares[best.name].shape >= 0.3:
        part = 100 * shares[best.name].shape
        sentences.append(f"{part:.0f} % of the squared error of {best.name} is shape: another curve would fit better.")
    return sentences


def _praise(best: Rung, comparison: Comparison) -> str:
    where, runs = ("held-out", comparison.held_out) if comparison.held_out else ("fitted", best.result.runs)
    percent = best.fit_percent if best.held_out_fit_percent is None else best.held_out_fit_percent
    largest = max(float(abs(run.force).max()) for run in runs)
    share = 100 * best.error / largest
    lead = "Smallest error" if len(comparison.rungs) > 1 else "Error"
    return (
        f"{lead} on the {where} records: {best.name}, RMSE {best.error:.1f} N, {share:.1f} % of their largest force"
        f" of {largest:.0f} N (fit {percent:.1f} %)."
    )
