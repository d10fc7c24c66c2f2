"""Tables of fitted ranges and of their use during rides."""

from collections.abc import Mapping

from jaxdamp._tables import Cell, Column, Table
from jaxdamp.dampers import FittedRange
from jaxdamp.simulation import Response


def fitted_range_table(covered: FittedRange) -> Table:
    """The range of the records that laws were fitted to.

    Arguments:
        covered: `law.fitted_to`.
    """
    columns = (Column("quantity"), Column("unit"), Column("lowest", spec=".4g"), Column("highest", spec=".4g"))
    rows = tuple((q.name, q.unit or "–", *q.limits) for q in covered.known())
    return Table("Range of the fitted records; beyond it the laws are extrapolated", columns, rows)


def range_use_table(responses: Mapping[str, Response]) -> Table | None:
    """The motion of each damper compared with the fitted range of its law; no table if no law has a range.

    Arguments:
        responses: by name.
    """
    columns = [Column("law"), Column("damper"), Column("quantity"), Column("unit")]
    columns += [Column(name, spec=".3g") for name in ("lowest", "highest", "fitted from", "fitted to", "times")]
    columns += [Column("time outside", "%", ".0f")]
    rows: list[tuple[Cell, ...]] = []
    for law, response in responses.items():
        for damper, uses in response.range_use().items():
            for use in uses:
                share = None if use.share is None else 100 * use.share
                ends = (*use.used, *use.fitted, use.times, share)
                rows.append((law, damper.replace("_", " "), use.quantity, use.unit or "–", *ends))
    if not rows:
        return None
    return Table("Use of the dampers beside the records of their laws", tuple(columns), tuple(rows))
