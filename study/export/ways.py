"""The ways in which a model goes on, by name."""

from pathlib import Path

from study.equations.model import Model
from study.export.exported import exported
from study.export.fmu import fmu
from study.export.modelica_class import modelica_class
from study.export.python_function import python_function
from study.records.record import Record
from study.support.errors import StudyError, expect

SUFFIX_OF = {"python": ".py", "fmu": ".fmu", "modelica": ".mo"}  # with the suffix of the file


def exported_file(model: Model, way: str, record: Record | None = None, step: float | None = None) -> bytes:
    """The file that a model becomes.

    Parameters
    ----------
    model : Model
        All of its values known.
    way : str
        One of :data:`SUFFIX_OF`.
    record : Record, optional
        The one that it was fitted to, completed: its values are in the units of that. N, m and s if left out.
    step : float, optional
        Largest internal step of an FMU in seconds; of another way a ``StudyError``, as where something cannot be said
        in it.
    """
    expect(step is None or way == "fmu", f"a step of {step} s is given to {way}; expected one of an FMU alone")
    made = exported(model, record)
    if way == "fmu":
        return fmu(made, step)
    return (python_function(made) if way == "python" else modelica_class(made)).encode()


def way_of(path: Path) -> str:
    """The way that the suffix of a file says."""
    for way, suffix in SUFFIX_OF.items():
        if path.suffix == suffix:
            return way
    raise StudyError(f"{path}: its suffix says no way to export; expected {', '.join(SUFFIX_OF.values())}")
