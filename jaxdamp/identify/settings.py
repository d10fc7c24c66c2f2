"""The keywords of fits: what may change, how bench records are taken, how is searched; and their defaults.

They are written in the call, or kept for several calls: each class makes a dictionary of checked types.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TypedDict, cast

import numpy as np

from jaxdamp import _checks
from jaxdamp.identify.search import Solver
from jaxdamp.parameters import BY_NAME, check_by_name, name_patterns


class Free(TypedDict, total=False):
    """What a fit may change, and what is known of it beforehand: keywords of all fits.

    Arguments:
        over: parameters to fit, by path, last part of a path, or pattern; all of the law or the vehicle if left out.
        freeze: parameters to hold at their start, named in the same way; those of the test machine and sensors too.
        bounds: extra limits `{name: (lower, upper)}` in the parameter's unit; if two names match a parameter, the later
            one counts. Fits to bench records move a start that is outside to the inside.
        tie: parameters that take the values of others, such as `{"terms.1.**": "terms.0.**"}`: one free value for each
            group (see `jaxdamp.parameters.free_parameters`).
        priors: what is known of parameters beforehand, `{name: (mean, standard deviation)}` in the parameter's unit. It
            counts against the noise that the standard errors assume; that of a mass shows the scale of a vehicle.
    """

    over: Sequence[str] | None
    freeze: Sequence[str]
    bounds: Mapping[str, tuple[float, float]] | None
    tie: Mapping[str, str] | None
    priors: Mapping[str, tuple[float, float]] | None


class Records(TypedDict, total=False):
    """How a law with states begins in bench records, and how fine these are taken.

    Arguments:
        initial_state: of a law with states at the first sample of a record: `"warm_up"`, after a copy of the first
            cycle if the record begins in motion; `"rest"`, the law's own, for records that begin with the first motion;
            or `"periodic"`, for records cut out of a motion that had lasted long: in those whose stroke repeats from
            cycle to cycle the law has settled, however slow it is, and all samples are compared. Other records start as
            with `"warm_up"`. Or `"estimated"`: free numbers of each record, fitted with the law (`initial_states` of
            the result; paths then begin with `law.`, `rig.` or `records.`). A record that was not fitted is predicted
            from its mean force in the first second of rest, which is not scored, or after a warm-up cycle. How each
            starts stands in `criterion`.
        samples_per_cycle: slow records are averaged in blocks down to this number; `None` uses every sample.
    """

    initial_state: str
    samples_per_cycle: int | None


class Search(TypedDict, total=False):
    """What is minimised, and in how many steps.

    Arguments:
        loss: `"squares"`; or `"huber"`, `"soft_l1"` or `"student_t"`, which spikes and dropouts hardly move: samples
            far from the model get less weight. Their share stands in `criterion`.
        max_steps: largest number of steps of each search.
    """

    loss: str
    max_steps: int


class ProblemSettings(Free, Records, total=False):
    """All keywords of `prepare`: those of `Free` and `Records`, and these.

    Arguments:
        per_record: parameters with one value for each record, such as a friction that depends on the temperature; names
            as in `freeze`. All other parameters are common to the records. A record that was not fitted is predicted
            with their means, and begins as warm (`initial_rise`) as its first three cycles show, which are not scored.
        weighting: `"samples"`, equal weight of every sample; `"runs"`, equal weight of every record relative to its RMS
            force; or one standard deviation [N] for each record, of which only the ratios matter. `inf` leaves a record
            out of the fit; it is still scored.
    """

    per_record: Sequence[str]
    weighting: str | Sequence[float] | np.ndarray


class FitSettings(ProblemSettings, Search, total=False):
    """All keywords of `fit`: those of `Free`, `Records`, `ProblemSettings` and `Search`, and these.

    Arguments:
        force_noise: standard deviation [N] of the measured force if it is known, as independent noise. Otherwise it is
            estimated from the residual, including its correlation.
        input_noise: standard deviations of stroke [m] and velocity [m/s] as they stand in the records. Least squares of
            the force takes both as exact; the bias that this causes is estimated and stands beside each parameter.
        starts: largest number of starts: `law` first, then those that its laws propose (`other_starts`); all of them if
            left out. With 1, the search starts from `law` only.
        bad_records: what is done with records in which the preflight finds an error, such as a clipped or lost force:
            "refuse" the fit, "leave_out" these records, or "keep" them. Spikes are no error for a robust `loss`.
            Records of the same motion with different forces, such as those of two settings, are refused too unless
            "keep" pools them, or each record has numbers of its own.
        solver: any least-squares solver or minimiser of optimistix, such as `optimistix.Dogleg(rtol=1e-8, atol=1e-8)`,
            in place of `jaxdamp.solve.BoundedLevenbergMarquardt()`. It searches in coordinates without bounds, in which
            an edge of a domain is approached only slowly; a violated condition between parameters is an infinite
            residual. The standard errors and the checks are the same.

    >>> from jaxdamp import bench, dampers, identify
    >>> runs = bench.VirtualDyno(dampers.Linear(1500.0)).run([bench.SineTest(amplitude=0.02, frequency=2.0)])
    >>> how = identify.FitSettings(bounds={"rate": (1000.0, 2000.0)}, samples_per_cycle=100)
    >>> round(identify.fit(dampers.Linear, runs, **how)["rate"].value, 3)
    1500.0
    """

    force_noise: float | None
    input_noise: tuple[float, float] | None
    starts: int | None
    bad_records: str
    solver: Solver | None


class ComparisonSettings(FitSettings, total=False):
    """The keywords that `compare` has from fits: those of `FitSettings`, and with `scheduled=True` these.

    Arguments:
        common: parameters that do not depend on the setting, by path, last part of a path or pattern.
        blend: `"parameters"` or `"force"`; chosen by the records if it is left out, and `choice` says why.
    """

    common: Sequence[str]
    blend: str | None


class ScheduledSettings(ComparisonSettings, total=False):
    """All keywords of `fit_scheduled`: those of `ComparisonSettings`, and this.

    `weighting` is `"samples"` or `"runs"`, and `initial_state` not `"estimated"`.

    Arguments:
        progress: called with what is fitted next; a line in the terminal if it is left out.
    """

    progress: Callable[[str], None] | None


class VehicleSettings(Free, Search, total=False):
    """The keywords that `fit_vehicle` has from `fit`: those of `Free` and `Search`, and these.

    Arguments:
        per_record: parameters with a value for each record, such as "sprung_mass" (payload) or "offset".
        dt: longest step of the simulation [s], 1 ms if left out. Records with a longer sampling interval are simulated
            in fractions of it. Between the samples the road is a smooth curve through the measured heights.
        samples_per_cycle: of bench records, as in `Records`.
        starts: number of searches, the first from `vehicle`, the others from parameters up to twice and half of those
            that it ends at, or at random where one is zero, with the noise that it finds. The first one counts unless
            another one fits better; `minima` describes the others.
        seed: of the other starts.
        solver: as in `FitSettings`.
    """

    per_record: Sequence[str]
    dt: float | None
    samples_per_cycle: int | None
    starts: int
    seed: int
    solver: Solver | None


class TargetSettings(Free, Search, total=False):
    """The keywords that `fit_targets` has from `fit`: those of `Free` and `Search`, and these.

    Arguments:
        starts: number of searches, the first from `start`, the others from parameters up to twice and half of it, or at
            random where it is zero. The first one counts unless another one meets the targets better.
        seed: of the other starts.
        solver: as in `FitSettings`.
    """

    starts: int
    seed: int
    solver: Solver | None


FREE: Free = {"over": None, "freeze": (), "bounds": None, "tie": None, "priors": None}
RECORDS: Records = {"initial_state": "warm_up", "samples_per_cycle": 400}
PROBLEM: ProblemSettings = {**FREE, **RECORDS, "per_record": (), "weighting": "samples"}
FIT: FitSettings = {
    **PROBLEM, "loss": "squares", "max_steps": 200, "force_noise": None, "input_noise": None, "starts": None,
    "bad_records": "refuse", "solver": None,
}  # fmt: skip
COMPARISON: ComparisonSettings = {**FIT, "common": (), "blend": None}
SCHEDULED: ScheduledSettings = {**COMPARISON, "progress": None}
VEHICLE: VehicleSettings = {
    **FREE, "loss": "squares", "max_steps": 100, "per_record": (), "dt": None, "samples_per_cycle": 400, "starts": 1,
    "seed": 0, "solver": None,
}  # fmt: skip
TARGETS: TargetSettings = {**FREE, "loss": "squares", "max_steps": 100, "starts": 4, "seed": 0, "solver": None}


def check_keywords(settings: Mapping[str, object]) -> None:
    """Refuse what is no name of parameters, no mapping from them or no count, before any part of a fit reads it."""
    for argument, value in settings.items():
        if argument in BY_NAME:
            check_by_name(argument, value)
        elif argument in ("freeze", "per_record", "common") or (argument == "over" and value is not None):
            name_patterns(argument, value)
        elif argument == "samples_per_cycle":
            _checks.counts(samples_per_cycle=cast(int | None, value))
