"""What a call says of the parameters of a law, said of each law of a `Scheduled`, whose paths are longer."""

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import NamedTuple

from jaxdamp.identify.blending import AtSetting
from jaxdamp.identify.model import own_names
from jaxdamp.identify.settings import Free
from jaxdamp.parameters import free_parameters, match_paths, name_patterns, parameters
from jaxdamp.rig import Rig


OF_RIG = "rig."
LAG = "command_lag", f"{OF_RIG}command_lag"  # its name and its path
Limits = dict[str, tuple[float, float]]


class AtLevel(NamedTuple):
    """The choices of a call for the law at one setting: by their paths, names mean the same beside other settings.

    Or those on the lag of the actuator, by name.
    """

    freeze: list[str]
    bounds: Limits
    priors: Limits


def placed(at: AtSetting, level: str) -> Callable[[str], str]:
    """From a path in the model of one setting to that beside the other settings, whose law there is at `level`."""
    inside = "" if at.rig is None else "law."
    return lambda path: path if path.startswith(OF_RIG) else level + path.removeprefix(inside)


def ties_at(at: AtSetting, level: str, tie: Mapping[str, str] | None) -> dict[str, str]:
    """The ties of the call at one setting."""
    place, names = placed(at, level), own_names(at.model).find_keys("tie", tie)
    return {place(path): place(leader) for path, leader in free_parameters(at.model, tie=names, move=True).ties}


def choices_at(at: AtSetting, level: str, asked: Free, others: Collection[str]) -> AtLevel:
    """The choices at one setting; `beside` are numbers of the machine that are free beside other settings only.

    What the fit of this setting alone held, it holds here too.
    """
    place, paths = placed(at, level), [p.path for p in parameters(at.model)]
    free = {p.path: p.path for p in at.free.chosen} | dict(at.free.ties) | {path: path for path in others}
    held = [path for path in paths if path not in free and not path.startswith(OF_RIG)]
    frozen = match_paths(paths, own_names(at.model).find("freeze", name_patterns("freeze", asked["freeze"])))
    held += [path for path in frozen if path.startswith(OF_RIG)]

    def of_free(argument: str, given: Mapping[str, tuple[float, float]] | None) -> Limits:
        pairs = own_names(at.model).find_keys(argument, given).items()
        return {place(free[path]): pair for name, pair in pairs for path in match_paths(paths, [name]) if path in free}

    return AtLevel([*map(place, held)], of_free("bounds", asked["bounds"]), of_free("priors", asked["priors"]))


def of_lag(asked: Free, *, lag: bool) -> AtLevel:
    """The choices on the lag of the actuator, or all others: the lag is no number where commands are held."""

    def limits(given: Mapping[str, tuple[float, float]] | None) -> Limits:
        if not isinstance(given, Mapping):
            return {} if lag or given is None else given  # what is none is refused where it is used
        return {name: pair for name, pair in given.items() if (name in LAG) == lag}

    frozen = [name for name in name_patterns("freeze", asked["freeze"]) if (name in LAG) == lag]
    return AtLevel(frozen, limits(asked["bounds"]), limits(asked["priors"]))


def choices_of(
    alone: Iterable[AtSetting], place: str, asked: Free, tie: Mapping[str, str], rig: Rig | None, on_lag: AtLevel
) -> Free:
    """The choices at all settings, with all ties; a prior of tied numbers is one of the number that they follow.

    `on_lag` are those on the lag of the actuator, if the machine has one.
    """
    lag, freeze, bounds, priors = list[str](), list[str](), Limits(), Limits()
    if rig is not None and rig.command_lag:
        lag, freeze, bounds, priors = [LAG[1]], [*on_lag.freeze], {**on_lag.bounds}, {**on_lag.priors}
    for k, at in enumerate(alone):
        level = choices_at(at, f"{place}.{k}.", asked, lag)
        freeze += level.freeze
        bounds |= level.bounds
        priors |= {tie.get(path, path): pair for path, pair in level.priors.items()}
    return {"over": None, "freeze": [*dict.fromkeys(freeze)], "bounds": bounds, "tie": tie, "priors": priors}
