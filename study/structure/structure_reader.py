"""Records of structures from files of every kind that a record of a single mass may have.

A column is a force by the name that the model gives it (``force`` will do where there is one), a sensor by coordinate
and motion: ``floor1 acceleration``, ``floor1_acc``, ``floor1.a``, or ``floor1 [m/s^2]`` whose unit says what it is. The
option ``--column floor1.acceleration=A3`` comes before any name. Everything is converted to N, m (or N m, rad) and s.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from study.equations.model import Model
from study.records.readers import ReadOptions, checks, read_table
from study.records.readers.roles import NAMES
from study.records.readers.sampling import even_interval
from study.records.readers.table import Column, Table
from study.records.record import MOTIONS, SI_UNITS
from study.structure.structure_record import Sensor, StructureRecord
from study.support.arrays import Floats
from study.support.errors import StudyError, at, expect
from study.support.units import VOLTAGE, parse_unit, role_unit

ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0, "°": np.pi / 180.0}
ANGLED = re.compile(r"(.*?)\s*[(\[]\s*((?:rad|mrad|deg|°)[^)\]]*)[)\]]")
SEPARATOR = re.compile(r"[ ._:/-]+")


def read_structure(path: Path, model: Model, options: ReadOptions | None = None) -> StructureRecord:
    """Read what was measured on a structure.

    Parameters
    ----------
    path : Path
        CSV and other text tables, MATLAB, HDF5, UFF or Parquet.
    model : Model
        Its coordinates and forces say what to look for.
    options : ReadOptions, optional
        What the user says about the file.

    Raises
    ------
    StudyError
        If it cannot be read, lacks a force of the model or any sensor, or is no evenly sampled record.
    """
    table, given = read_table(path, options)
    table = replace(table, columns=tuple(_angled(c) for c in table.columns))
    with at(path):
        forces, sensors = _assigned(table, model, given)
        columns = {**forces, **sensors}
        lengths = {len(c.values) for c in columns.values()}
        expect(len(lengths) == 1, f"channels have {sorted(lengths)} samples; expected the same number for all")
        first, last = given.samples or (0, None)
        cut = slice(first, last)
        usable = {key: replace(c, values=c.values[cut]) for key, c in columns.items()}
        for column in usable.values():
            _check(column, table.from_sample(first), given)
        volts: set[bool] = set()
        scaled = {key: _converted(key, column, given, volts) for key, column in usable.items()}
        _same_kind(usable, volts, given)
    dt, start = _sampling(path, table, given, cut)
    named = path.resolve().parent.name if path.stem == "record" else path.stem
    turning = (s.coordinate for s, c in sensors.items() if _is_angle(_unit_text(s, c, given)))
    return StructureRecord(
        dt, {str(k): scaled[k] for k in forces}, {k: scaled[k] for k in sensors}, _extra(table, columns, cut),
        dict(SI_UNITS), named, start, frozenset(turning),
    )  # fmt: skip


def _assigned(table: Table, model: Model, options: ReadOptions) -> tuple[dict[str, Column], dict[Sensor, Column]]:
    """Column of each force and of each sensor."""
    by_name = {c.name.lower(): c for c in table.columns}
    wanted = {_key(role): _named(table, role, column) for role, column in options.columns.items()}
    forces: dict[str, Column] = {}
    for name, _ in model.forces:
        keys = [name.lower(), *(["force", "f"] if len(model.forces) == 1 else [])]
        found = next((wanted[k] for k in keys if k in wanted), None) or next(
            (by_name[k] for k in keys if k in by_name), None
        )
        if found is None:
            like = f"--column {name}=NAME"
            raise StudyError(f"there is no column of the force {name!r}; expected {like}, of {table.listing()}")
        forces[name] = found
    sensors = _sensors(table, model, wanted)
    if not sensors:
        like = f"--column {model.coordinates[0]}.displacement=NAME"
        raise StudyError(
            f"no column is a motion of {', '.join(model.coordinates)}; expected {like}, of {table.listing()}"
        )
    return forces, sensors


def _sensors(table: Table, model: Model, wanted: Mapping[str, Column]) -> dict[Sensor, Column]:
    """Column of each sensor, in the order of the coordinates."""
    found: dict[Sensor, Column] = {}
    for name in model.coordinates:
        for motion in MOTIONS:
            key = f"{name.lower()} {motion}"
            column = wanted.get(key) or next((c for c in table.columns if _sensor_of(c, name) == motion), None)
            if column is not None:
                found[Sensor(name, motion)] = column
    return found


def _key(role: str) -> str:
    """What the user calls a channel, as this module compares it: ``floor1 acceleration``."""
    name, _, motion = role.replace(" ", ".").rpartition(".")
    known = next((m for m in MOTIONS if motion.lower() in NAMES[m]), None)
    return f"{name.lower()} {known}" if name and known else role.lower()


def _named(table: Table, role: str, wanted: str | int) -> Column:
    matches = [c for k, c in enumerate(table.columns, 1) if wanted in (c.name, k) or str(wanted) == str(k)]
    expect(matches, f"there is no column {wanted!r} for {role}; expected one of {table.listing()}")
    return matches[0]


def _angled(column: Column) -> Column:
    """A column called ``pitch (rad)`` with its unit apart, which is no unit of a single mass."""
    heading = ANGLED.fullmatch(column.name)
    return replace(column, name=heading[1], unit=heading[2].strip()) if heading else column


def _sensor_of(column: Column, coordinate: str) -> str:
    """Which motion of a coordinate a column is by its name and unit; empty if it is none."""
    name = column.name.lower()
    if name == coordinate.lower():
        return _motion_of_unit(column.unit) or "displacement"
    rest = name.removeprefix(coordinate.lower())
    if rest == name or not SEPARATOR.match(rest):
        return ""
    word = SEPARATOR.sub("", rest)
    return next((m for m in MOTIONS if word in NAMES[m]), "")


def _motion_of_unit(unit: str) -> str:
    for motion in MOTIONS:
        try:
            role_unit(motion, _straight(unit)[0])
        except StudyError:
            continue
        return motion
    return ""


def _straight(unit: str) -> tuple[str, float]:
    """A unit with its angle replaced by metres, and the factor that this leaves out: ``deg/s`` is 0.01745 m/s."""
    first, slash, rest = unit.strip().partition("/")
    factor = ANGLES.get(first.strip())
    return (f"m{slash}{rest}", factor) if factor is not None else (unit, 1.0)


def _is_angle(unit: str) -> bool:
    return unit.strip().partition("/")[0].strip() in ANGLES


def _check(column: Column, table: Table, options: ReadOptions) -> None:
    fault = column.fault or checks.not_finite(column.values, table.place) or checks.constant(column.values)
    if fault is None and not options.accept_saturated:
        fault = checks.saturated(column.values)
    expect(not fault, f"column {column.name!r} {fault}")
    few = f"{len(column.values)} samples are too few; expected {checks.FEWEST_SAMPLES} or more"
    expect(len(column.values) >= checks.FEWEST_SAMPLES, few)


def _converted(key: str | Sensor, column: Column, options: ReadOptions, volts: set[bool]) -> Floats:
    """A column in N, m (or N m, rad) and s."""
    role, text = _role(key), _unit_text(key, column, options)
    if not text:
        return column.values
    plain, factor = _straight(text)
    moment = role == "force" and plain.split()[-1:] == ["m"] and len(plain.split()) == 2  # N m, on a rotation
    with at(f"column {column.name!r}"):
        unit = role_unit(role, plain.split()[0] if moment else plain)
    if isinstance(key, Sensor):
        volts.add(unit.powers[3] == VOLTAGE[3])
    return column.values * (unit.factor * factor)


def _role(key: str | Sensor) -> str:
    return key.motion if isinstance(key, Sensor) else "force"


def _unit_text(key: str | Sensor, column: Column, options: ReadOptions) -> str:
    """Unit of a column as the user or the file gives it; empty if nobody does."""
    said = {_key(name): unit for name, unit in options.units.items()}
    return said.get(str(key).lower()) or said.get(_role(key)) or column.unit


def _same_kind(columns: Mapping[str | Sensor, Column], volts: set[bool], options: ReadOptions) -> None:
    """Refuse sensors whose motions cannot be compared, or of which some have a unit and others none."""
    texts = {key: _unit_text(key, c, options) for key, c in columns.items() if isinstance(key, Sensor)}
    names = ", ".join(f"{key} in {text or 'no unit'}" for key, text in texts.items())
    expect(len(volts) < 2, f"{names}: sensors in volts and in metres cannot be compared; expected all of one kind")
    bare = next((key for key, text in texts.items() if not text), None)
    if bare is not None and any(texts.values()):
        like = f"--unit {bare.coordinate}.{bare.motion}=UNIT"
        raise StudyError(f"{names}; expected a unit of every sensor, such as {like}, or of none, for SI units")


def _sampling(path: Path, table: Table, options: ReadOptions, cut: slice) -> tuple[float, float]:
    """Interval and first time."""
    named = options.columns.get("time")
    column = _named(table, "time", named) if named is not None else next(
        (c for c in table.columns if c.name.lower() in NAMES["time"]), None
    )  # fmt: skip
    stated = options.interval if options.interval is not None else table.dt
    if column is not None and options.interval is None:
        factor = parse_unit(options.units.get("time") or column.unit or "s").factor
        return even_interval(path, column.values[cut] * factor, table.place)
    if stated is None:
        raise StudyError(f"{path}: it has no column of times and states no sampling rate; expected --fs HERTZ")
    return stated, table.start + stated * (cut.start or 0)


def _extra(table: Table, taken: Mapping[str | Sensor, Column], cut: slice) -> dict[str, Floats]:
    """Further channels that a formula may name."""
    used = {id(c) for c in taken.values()}
    length = len(next(iter(taken.values())).values)
    free = [c for c in table.columns if id(c) not in used and not c.fault and len(c.values) == length]
    usable = [c for c in free if c.name.isidentifier() and c.name.lower() not in NAMES["time"]]
    return {c.name: c.values[cut] for c in usable if np.all(np.isfinite(c.values[cut]))}
