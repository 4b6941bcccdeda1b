"""Universal File Format, dataset 58: functions at nodal degrees of freedom, of which time histories are used."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from study.records.readers.sampling import shortest_decimal
from study.records.readers.table import Column, Table
from study.support.errors import StudyError
from study.support.extras import needed

ROUNDING = 5e-6  # the interval stands in the file with six digits
MARK = re.compile(rb"^ {4}-1 *\r?$", re.MULTILINE)  # before and behind each dataset
TIME_RESPONSE = 1  # the standard's code of the function type
ROLES = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}  # of the ordinate
DIRECTIONS = {-3: "-Z", -2: "-Y", -1: "-X", 0: "", 1: "+X", 2: "+Y", 3: "+Z"}


def read(path: Path) -> Table:
    """Read the time histories of a file.

    Raises
    ------
    StudyError
        If it is cut short, has none, or they were not sampled together.
    """
    if len(MARK.findall(path.read_bytes())) % 2:
        raise StudyError(f"{path}: its last dataset is cut short; a line '-1' at the end is right")
    pyuff: Any = needed("pyuff", f"{path}: reading UFF", "formats")
    file: Any = pyuff.UFF(str(path))
    types: list[int] = [int(t) for t in file.get_set_types()]
    found: list[Mapping[str, Any]] = [file.read_sets(k) for k, t in enumerate(types) if t == 58]
    if not found:
        raise StudyError(f"{path}: it has no dataset of type 58 (it has {types}); time histories of type 58 are right")
    histories = [s for s in found if int(s["func_type"]) in (0, TIME_RESPONSE) and not np.iscomplexobj(s["data"])]
    if not histories:
        kinds = sorted({int(s["func_type"]) for s in found})
        raise StudyError(f"{path}: its functions are of type {kinds}; time histories (type {TIME_RESPONSE}) are right")
    for item in histories:
        if len(item["data"]) != int(item["num_pts"]):
            given, there = int(item["num_pts"]), len(item["data"])
            raise StudyError(f"{path}: {_name(item)!r} states {given} samples and holds {there}; the file is cut short")
    return _table(path, histories)


def _name(item: Mapping[str, Any]) -> str:
    """Its own line of identification if that says anything, else node and direction."""
    title = str(item["id1"]).strip()
    node = f"{str(item['rsp_ent_name']).strip()} {item['rsp_node']}{DIRECTIONS.get(int(item['rsp_dir']), '')}".strip()
    return title if title and title.upper() != "NONE" else node


def _table(path: Path, histories: list[Mapping[str, Any]]) -> Table:
    names = [_name(item) for item in histories]
    if len(set(names)) < len(names):  # one title for all: node and direction tell them apart
        names = [f"{name} {item['rsp_node']}{DIRECTIONS.get(int(item['rsp_dir']), '')}" for name, item in
                 zip(names, histories, strict=True)]  # fmt: skip
    columns = [_column(name, item) for name, item in zip(names, histories, strict=True)]
    first = histories[0]
    if any(int(s["abscissa_spacing"]) == 0 for s in histories):
        if any(not np.array_equal(s["x"], first["x"]) for s in histories):
            raise StudyError(f"{path}: its channels have time axes of their own; channels sampled together are right")
        time = Column("time", np.asarray(first["x"], dtype=np.float64), "s", "time")
        return Table((time, *columns))
    steps = sorted({float(s["abscissa_inc"]) for s in histories})
    if len(steps) > 1 or steps[0] <= 0.0:
        raise StudyError(f"{path}: its channels have the sampling intervals {steps}; one above zero is right")
    return Table(tuple(columns), shortest_decimal(steps[0], ROUNDING * steps[0]), float(first["abscissa_min"]))


def _column(name: str, item: Mapping[str, Any]) -> Column:
    unit = str(item["ordinate_axis_units_lab"]).strip()
    role = ROLES.get(int(item["ordinate_spec_data_type"]), "")
    values = np.asarray(item["data"], dtype=np.float64)
    return Column(name, values, "" if unit.upper() == "NONE" else unit, role)
