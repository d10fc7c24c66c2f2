"""A fit of a vehicle as a picture: measured and fitted channels over time, and the residual."""

from jaxdamp import _checks
from jaxdamp._tables import typeset_unit
from jaxdamp._types import Figure
from jaxdamp.identify import VehicleFit
from jaxdamp.plots import _style


def vehicle_fit(result: VehicleFit, record: str | None = None) -> Figure:
    """Each channel of a record, measured and fitted, with the residual beside it.

    Arguments:
        result: a fit of a vehicle.
        record: name of the record; the first if left out.

    Raises:
        ValueError: an unknown record.
    """
    remedy = "The call is `vehicle_fit(result)` with the result of `identify.fit_vehicle`."
    _checks.instance("result", result, VehicleFit, "be the result of a fit of a vehicle", remedy)
    names = [one.name for one in result.records]
    name = names[0] if record is None else record
    _checks.one_of("record", name, names)
    shown = result.records[names.index(name)]
    fitted = result.respond(shown)
    units = {score.channel: score.unit for score in result.scores if score.record == name}
    figure = _style.new_figure(12.0, 1.0 + 2.2 * len(units))
    rows = figure.subplots(len(units), 2, sharex=True, squeeze=False, width_ratios=(2.0, 1.0))
    for (over, spectrum), (channel, unit) in zip(rows, units.items(), strict=True):
        over.plot(shown.time, shown[channel], color=_style.GREY, linewidth=2.5, alpha=0.5, label="measured")
        over.plot(shown.time, fitted[channel], color=_style.COLOURS[0], linewidth=0.9, label="fitted")
        spectrum.plot(shown.time, fitted[channel] - shown[channel], color=_style.COLOURS[1], linewidth=0.6)
        _style.dress(over, "", f"[{typeset_unit(unit)}]", _style.metric_words(channel))
        _style.dress(spectrum, "", f"[{typeset_unit(unit)}]", "fitted − measured")
    for axes in rows[-1]:
        axes.set_xlabel("time [s]")
    _style.legend_above(figure, rows[0, 0].get_lines())
    return figure
