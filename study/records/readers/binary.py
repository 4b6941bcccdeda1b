"""Binary files: HDF5 and MATLAB 7.3 which is HDF5, MATLAB up to version 7, Parquet, and the Universal File Format."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np
from scipy.io import loadmat

from study.records.readers.checks import shortest_decimal
from study.records.readers.table import NO_VALUES, Column, Table, from_arrays, in_group, split_unit
from study.support.errors import expect
from study.support.extras import needed

UNIT_KEYS = ("units", "unit", "Units", "Unit")
MARK = re.compile(rb"^ {4}-1 *\r?$", re.MULTILINE)  # before and behind each dataset
TIME_RESPONSE = 1  # the standard's code of the function type
ORDINATES = {8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "force"}  # of the ordinate
DIRECTIONS = {-3: "-Z", -2: "-Y", -1: "-X", 0: "", 1: "+X", 2: "+Y", 3: "+Z"}


def read_hdf5(path: Path, group: str | None) -> Table:
    """Every dataset of numbers of a file, or of one group of it, by its path.

    ``#refs#`` holds what MATLAB refers to from cells, each of which is a group of its own: ``runs/1``, ``runs/2``.
    """
    h5py: Any = needed("h5py", f"{path}: reading HDF5", "formats")
    found: dict[str, Any] = {}

    with h5py.File(path, "r") as file:

        def put(name: str, item: Any, deeper: int = 0) -> None:
            if isinstance(item, h5py.Group):
                for key, inner in item.items():
                    put(f"{name}/{key}", inner, deeper)
            elif h5py.check_ref_dtype(item.dtype) and deeper < 4:
                for number, cell in enumerate(file[ref] for ref in item[()].ravel() if ref):
                    one = f"{name}/{number + 1}"
                    put(one if isinstance(cell, h5py.Group) else f"{one}/{name.rpartition('/')[2]}", cell, deeper + 1)
            else:
                found[name] = item

        for key, item in file.items():
            if not key.startswith("#"):
                put(key, item)
        datasets: dict[str, Any] = {name: found[name] for name in in_group(path, found, group, "group")}
        numbers = {name: data for name, data in datasets.items() if data.dtype.kind in "biufc"}
        units = {name: _unit(data.attrs) for name, data in numbers.items()}
        return from_arrays(path, {name: np.asarray(data[()]) for name, data in numbers.items()}, units)


def _unit(attributes: Any) -> str:
    value = next((attributes[key] for key in UNIT_KEYS if key in attributes), "")
    return value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)


def read_matlab(path: Path, group: str | None) -> Table:
    """Every array of numbers of a file in format 4 or 5, or of one structure in it; its fields by ``name/field``.

    Of cells and of several structures each has a number: ``runs/1/force``.
    """
    loaded: dict[str, Any] = loadmat(str(path), simplify_cells=True, appendmat=False)
    arrays = dict(_flat({k: v for k, v in loaded.items() if not k.startswith("__")}, ""))
    return from_arrays(path, {name: arrays[name] for name in in_group(path, arrays, group, "structure")}, {})


def _flat(fields: dict[str, Any], prefix: str) -> Iterator[tuple[str, object]]:
    for name, value in fields.items():
        cells = _cells(value)
        if isinstance(value, dict):
            yield from _flat(cast("dict[str, Any]", value), f"{prefix}{name}/")
        elif cells and not all(isinstance(one, str) for one in cells):  # texts are no records
            for number, one in enumerate(cells, start=1):
                inner = cast("dict[str, Any]", one) if isinstance(one, dict) else {name: one}
                yield from _flat(inner, f"{prefix}{name}/{number}/")
        elif isinstance(value, np.ndarray) or np.isscalar(value):
            yield f"{prefix}{name}", value


def _cells(value: object) -> list[object]:
    """The cells of a cell array, or the structures of an array of these; none of anything else."""
    if isinstance(value, list):
        return cast("list[object]", value)
    if not isinstance(value, np.ndarray):
        return []
    array = cast("np.ndarray[Any, np.dtype[Any]]", value)
    return list(array.ravel()) if array.dtype == object else []


def read_parquet(path: Path, _group: str | None = None) -> Table:
    """Columns by name; moments in time become seconds from the first."""
    parquet: Any = needed("pyarrow.parquet", f"{path}: reading Parquet", "formats")
    table: Any = parquet.ParquetFile(path).read()  # one file, with nothing inferred from the folder's name
    columns: list[Column] = []
    for heading, data in zip(table.column_names, table.columns, strict=True):
        name, unit = split_unit(str(heading))
        values: Any = np.asarray(data.to_numpy())
        if values.dtype.kind == "M":
            values = (values - values[:1]) / np.timedelta64(1, "s")
        if values.dtype.kind in "biuf":
            columns.append(Column(name, values.astype(np.float64), unit))
        else:
            fault = f"column {name!r} holds {data.type}; expected real numbers"
            columns.append(Column(name, NO_VALUES, unit, fault=fault))
    return Table(tuple(columns))


def read_uff(path: Path, _group: str | None = None) -> Table:
    """The time histories of a file (dataset 58: functions at nodal degrees of freedom), sampled together."""
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
    names = [_name(item) for item in histories]
    if len(set(names)) < len(names):  # one title for all: node and direction tell them apart
        names = [f"{name} {_node(item)}" for name, item in zip(names, histories, strict=True)]
    columns: list[Column] = []
    for name, item in zip(names, histories, strict=True):
        unit = str(item["ordinate_axis_units_lab"]).strip()
        role = ORDINATES.get(int(item["ordinate_spec_data_type"]), "")
        values = np.asarray(item["data"], dtype=np.float64)
        columns.append(Column(name, values, "" if unit.upper() == "NONE" else unit, role))
    first = histories[0]
    if any(int(h["abscissa_spacing"]) == 0 for h in histories):
        together = all(np.array_equal(h["x"], first["x"]) for h in histories)
        expect(together, f"{path}: its channels have time axes of their own; expected channels sampled together")
        time = Column("time", np.asarray(first["x"], dtype=np.float64), "s", "time")
        return Table((time, *columns))
    steps = sorted({float(h["abscissa_inc"]) for h in histories})
    even = len(steps) == 1 and steps[0] > 0.0
    expect(even, f"{path}: its channels have the sampling intervals {steps}; expected one above zero")
    dt = shortest_decimal(steps[0], 5e-6 * steps[0])  # it stands in the file with six digits
    return Table(tuple(columns), dt, float(first["abscissa_min"]))


def _name(item: Mapping[str, Any]) -> str:
    """Its own line of identification if that says anything, else node and direction."""
    title = str(item["id1"]).strip()
    return title if title and title.upper() != "NONE" else f"{str(item['rsp_ent_name']).strip()} {_node(item)}".strip()


def _node(item: Mapping[str, Any]) -> str:
    return f"{item['rsp_node']}{DIRECTIONS.get(int(item['rsp_dir']), '')}"
