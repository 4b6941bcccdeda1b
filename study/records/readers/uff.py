"""Universal File Format, dataset 58: functions at nodal degrees of freedom, of which time histories are used."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from study.records.readers.sampling import shortest_decimal
from study.records.readers.table import Column, Table
from study.support.errors import expect
from study.support.extras import needed

ROUNDING = 5e-6  # the interval stands in the file with six digits
MARK = re.compile(rb"^ {4}-1 *\r?$", re.MULTILINE)  # before and behind each dataset
TIME_RESPONSE = 1  # the standard's code of the function type
ROLES = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}  # of the ordinate
DIRECTIONS = {-3: "-Z", -2: "-Y", -1: "-X", 0: "", 1: "+X", 2: "+Y", 3: "+Z"}


def read(path: Path, _group: str | None = None) -> Table:
    """Read the time histories of a file; they must have been sampled together."""
    whole = len(MARK.findall(path.read_bytes())) % 2 == 0
    expect(whole, f"{path}: its last dataset is cut short; expected a line '-1' at the end")
    pyuff: Any = needed("pyuff", f"{path}: reading UFF", "formats")
    file: Any = pyuff.UFF(str(path))
    types: list[int] = [int(t) for t in file.get_set_types()]
    functions: list[Mapping[str, Any]] = [file.read_sets(k) for k, t in enumerate(types) if t == 58]
    none = f"{path}: it has no dataset of type 58 (it has {types}); expected time histories of type 58"
    expect(functions, none)
    histories = [f for f in functions if int(f["func_type"]) in (0, TIME_RESPONSE) and not np.iscomplexobj(f["data"])]
    kinds = sorted({int(f["func_type"]) for f in functions})
    expect(histories, f"{path}: its functions are of type {kinds}; expected time histories (type {TIME_RESPONSE})")
    for item in histories:
        stated, held = int(item["num_pts"]), len(item["data"])
        cut = f"{path}: {_name(item)!r} states {stated} samples and holds {held}; the file is cut short"
        expect(stated == held, cut)
    return _table(path, histories)


def _name(item: Mapping[str, Any]) -> str:
    """Its own line of identification if that says anything, else node and direction."""
    title = str(item["id1"]).strip()
    return title if title and title.upper() != "NONE" else f"{str(item['rsp_ent_name']).strip()} {_node(item)}".strip()


def _node(item: Mapping[str, Any]) -> str:
    return f"{item['rsp_node']}{DIRECTIONS.get(int(item['rsp_dir']), '')}"


def _table(path: Path, histories: list[Mapping[str, Any]]) -> Table:
    names = [_name(item) for item in histories]
    if len(set(names)) < len(names):  # one title for all: node and direction tell them apart
        names = [f"{name} {_node(item)}" for name, item in zip(names, histories, strict=True)]
    columns = [_column(name, item) for name, item in zip(names, histories, strict=True)]
    first = histories[0]
    if any(int(h["abscissa_spacing"]) == 0 for h in histories):
        together = all(np.array_equal(h["x"], first["x"]) for h in histories)
        expect(together, f"{path}: its channels have time axes of their own; expected channels sampled together")
        time = Column("time", np.asarray(first["x"], dtype=np.float64), "s", "time")
        return Table((time, *columns))
    steps = sorted({float(h["abscissa_inc"]) for h in histories})
    even = len(steps) == 1 and steps[0] > 0.0
    expect(even, f"{path}: its channels have the sampling intervals {steps}; expected one above zero")
    return Table(tuple(columns), shortest_decimal(steps[0], ROUNDING * steps[0]), float(first["abscissa_min"]))


def _column(name: str, item: Mapping[str, Any]) -> Column:
    unit = str(item["ordinate_axis_units_lab"]).strip()
    role = ROLES.get(int(item["ordinate_spec_data_type"]), "")
    values = np.asarray(item["data"], dtype=np.float64)
    return Column(name, values, "" if unit.upper() == "NONE" else unit, role)
