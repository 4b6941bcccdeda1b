"""The tables of several records as fragments of HTML: how good the one model is on each, and their own coefficients."""

import math
from collections.abc import Sequence
from html import escape

from study.compare.comparison import Comparison
from study.compare.fitted_coefficients import Level
from study.explore.page_units import in_percent, in_text, number, with_error
from study.explore.session import Stage
from study.support.numbers import RARE, by_chance

RECORDS_WAITING = "each record is being fitted by itself …"
FITS_NOT_ASKED = "Not asked for here: <code>study compare</code> fits each record by itself."
DIFFERS = (
    "p: the share of records in which chance alone would make a coefficient that is one and the same differ as much; "
    "p &lt; 0.001 is fewer than 1 of 1000."
)
OWN = "Error with coefficients of the record's own: far below the first, where the one model on all lacks something."


def several_records(stage: Stage, shown: str, live: bool) -> dict[str, str]:
    """The fragments by their place; ``shown`` is the name of the record that the panels show. None of one record."""
    if not stage.on_each:
        return {}
    return {"records": _records(stage, shown), "levels": _levels(stage, live), "of-record": f"of {escape(shown)}"}


def _records(stage: Stage, shown: str) -> str:
    """A row a record, whose name is a button that turns the panels to it, and one for all."""
    unit = in_text(stage.comparison.record.force_and_length[0])
    heads = ("record", f"rms force / {escape(unit)}", "error", "noise floor", "of force", "own fit")
    head = "".join(f"<th{f' title={chr(34)}{OWN}{chr(34)}' if h == 'own fit' else ''}>{h}</th>" for h in heads)
    own = stage.by_record.errors if stage.by_record is not None else ()
    names = [c.record.name for c in stage.on_each]
    rows = [
        _row(_button(i, c.record.name, c.record.name == shown), c, in_percent(own[i]) if own else "–")
        for i, c in enumerate(stage.on_each)
    ]
    everything = _row(f"all {len(names)}", stage.comparison, "")
    return f"<table><tr>{head}</tr>{''.join(rows)}{everything.replace('<tr>', '<tr class=all>', 1)}</table>"


def _button(place: int, name: str, pressed: bool) -> str:
    return (
        f"<button data-act='record' data-name='{place}' aria-pressed='{str(pressed).lower()}' "
        f"title='{escape(name)}: show it in all panels'>{escape(name)}</button>"
    )


def _row(name: str, comparison: Comparison, own: str) -> str:
    judged = comparison.prediction
    level = number(judged_level(comparison), 3)
    cells = (
        level,
        in_percent(judged.error),
        in_percent(judged.floor),
        in_percent(comparison.force_error),
        own,
    )
    return f"<tr><th>{name}</th>{''.join(f'<td>{cell}</td>' for cell in cells)}</tr>"


def judged_level(comparison: Comparison) -> float:
    """Rms force of the part that is judged."""
    record, judged = comparison.record, slice(*comparison.plan.judge)
    return math.hypot(*(float(record[force][judged].std()) for force in record.forces))


def _levels(stage: Stage, live: bool) -> str:
    """A row a coefficient, a column a record, as ``study compare`` shows it."""
    found = stage.by_record
    if found is not None and found.why_not:
        return f"<p>{escape(found.why_not)}</p>"
    fitted = [c for c in stage.comparison.coefficients if not c.held]
    if found is None:  # as many rows, so that nothing moves when they come
        if not live:
            return f"<p>{FITS_NOT_ASKED}</p>"
        rows = "".join(
            f"<tr><th><i>{escape(_symbol(c.key))}</i><small>{escape(in_text(c.unit))}</small></th><td>&nbsp;</td></tr>"
            for c in fitted
        )
        return f"<table><tr><th></th><th>{RECORDS_WAITING}<small>&nbsp;</small></th></tr>{rows}</table><p>{DIFFERS}</p>"
    if not found.levels:
        return "<p>every coefficient is held</p>"
    forces = [number(force, 3) for force in found.levels[0].force]
    columns = zip(found.names, forces, strict=True)
    unit = in_text(stage.comparison.record.force_and_length[0])
    head = "".join(f"<th>{escape(name)}<small>{force} {escape(unit)}</small></th>" for name, force in columns)
    rows = "".join(_level(level) for level in found.levels)
    return f"<table><tr><th></th>{head}<th>differs?</th></tr>{rows}</table><p>{DIFFERS}</p>"


def _level(level: Level) -> str:
    values = _cells(level.value, level.error)
    answer = f"{'yes' if level.moves else 'no'}<small title='{by_chance(level.p_value)}'>{_p(level.p_value)}</small>"
    moves = " class='moves'" if level.moves else ""
    unit = f"<small>{escape(in_text(level.unit))}</small>"
    return f"<tr{moves}><th><i>{escape(_symbol(level.key))}</i>{unit}</th>{values}<td>{answer}</td></tr>"


def _p(value: float) -> str:
    """Nobody needs the digits of what is next to impossible."""
    return f"p = {number(value, 1)}" if value >= RARE else "p &lt; 0.001"


def _symbol(key: str) -> str:
    return key.rpartition(".")[2]


def _cells(values: Sequence[float], errors: Sequence[float]) -> str:
    pairs = zip(values, errors, strict=True)
    shown = (with_error(v, 1.96 * e) for v, e in pairs)
    return "".join(f"<td>{value}<small>± {half}</small></td>" for value, half in shown)
