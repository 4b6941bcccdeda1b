"""A model as a unit for co-simulation by FMI 2.0: force in, motions out, coefficients as parameters with units.

The unit is an archive of ``modelDescription.xml``, the compiled loops of this package (``c/fmu.c`` among them), their
sources for other platforms, and the model's own program, which those loops run as they do in a free run: what friction
holds, they hold. No compiler is needed.
"""

import hashlib
import io
import platform
import struct
import sys
import uuid
import zipfile
from xml.etree import ElementTree

import numpy as np

from study import __version__
from study.equations import kernels
from study.equations.free_run import rates_at
from study.equations.motion_program import MotionProgram, motion_program
from study.equations.simulate import TURN
from study.export.exported import Exported, Quantity, identifiers
from study.support.arrays import Floats
from study.support.errors import StudyError, expect
from study.support.units import parse_unit

INPUT = {"causality": "input", "variability": "continuous"}
STATE = {"causality": "local", "variability": "continuous", "initial": "exact"}  # its value is that at the start
PARAMETER = {"causality": "parameter", "variability": "fixed", "initial": "exact"}
MOVING = {"causality": "output", "variability": "continuous", "initial": "exact"}
COMPUTED = {"causality": "output", "variability": "continuous", "initial": "calculated"}


def fmu(made: Exported, step: float | None = None) -> bytes:
    """The unit.

    Parameters
    ----------
    made : Exported
        The model.
    step : float, optional
        Largest internal Runge-Kutta step in seconds, a parameter of the unit; if left out, the fastest oscillation of
        the model about its rest turns by :data:`~study.equations.simulate.TURN` rad in it.
    """
    motion = motion_program(made.model, (), made.sensors)
    step = step if step is not None else usual_step(made.model.name, motion)
    program = _program(motion, step)
    guid = str(uuid.UUID(hashlib.sha256(program + repr(made.outputs).encode()).hexdigest()[:32]))
    (name,) = identifiers([made.model.name]).values()
    files = {
        "modelDescription.xml": _description(made, motion, name, guid, step),
        "resources/motion.bin": guid.encode().ljust(40, b"\0") + program,
        f"binaries/{_platform()}/{name}{kernels.COMPILED.suffix}": kernels.compiled_library().read_bytes(),
    }
    files |= {f"sources/{path.name}": path.read_bytes() for path in sorted(kernels.SOURCES.iterdir())}
    written = io.BytesIO()
    with zipfile.ZipFile(written, "w", zipfile.ZIP_DEFLATED) as archive:
        for path, content in files.items():  # of one date: the same model gives the same bytes
            archive.writestr(zipfile.ZipInfo(path, (2000, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
    return written.getvalue()


def usual_step(name: str, motion: MotionProgram) -> float:
    """Largest internal step in seconds, from the rates of a motion at rest."""
    rest = {key: np.zeros(1) for key in list(motion.program.inputs)[: 1 + len(motion.drive) + motion.states]}
    rate = float(rates_at(motion, rest, 1)[0])
    expect(np.isfinite(rate), f"model {name!r} has no finite rates at rest; expected '--step' in seconds")
    return TURN / rate if rate > 0.0 else 1.0  # what nothing ties down has no rate


def _program(motion: MotionProgram, step: float) -> bytes:
    """What ``c/fmu.c`` reads behind the GUID: the version of its form, sizes, arrays."""
    p = motion.program
    head = (
        1, len(p.code), motion.split, len(p.inputs), p.first, len(p.registers), *motion.slots.shape,
        len(motion.sides), len(motion.drive), motion.dofs, motion.states, len(motion.observed),
    )  # fmt: skip
    whole = (p.code, motion.slots, motion.sides, motion.by_side, motion.shifts, motion.observed)
    numbers: tuple[Floats, ...] = (p.registers, motion.directions)
    return b"".join(
        [struct.pack(f"<{len(head)}q", *head), *(np.ascontiguousarray(a, "<i8").tobytes() for a in whole),
         *(np.ascontiguousarray(a, "<f8").tobytes() for a in numbers), struct.pack("<d", step)]
    )  # fmt: skip


def _platform() -> str:
    """Name of the folder of this platform's binary."""
    bits = 64 if sys.maxsize > 2**32 else 32
    system = {"Linux": "linux", "Darwin": "darwin", "Windows": "win"}.get(platform.system())
    if system is None:
        raise StudyError(f"FMI names no folder for {platform.system()!r}; expected Linux, macOS or Windows")
    return f"{system}{bits}"


def _description(made: Exported, motion: MotionProgram, name: str, guid: str, step: float) -> bytes:
    """``modelDescription.xml``."""
    root = ElementTree.Element("fmiModelDescription", {
        "fmiVersion": "2.0", "modelName": made.model.name, "guid": guid, "generationTool": f"study {__version__}",
        "description": f"Equation of motion of {made.model.name}", "variableNamingConvention": "flat",
        "numberOfEventIndicators": "0",
    })  # fmt: skip
    running = ElementTree.SubElement(root, "CoSimulation", {
        "modelIdentifier": name, "canHandleVariableCommunicationStepSize": "true", "canInterpolateInputs": "true",
        "maxOutputDerivativeOrder": "0",
    })  # fmt: skip
    listed = ElementTree.SubElement(running, "SourceFiles")
    for path in sorted(kernels.SOURCES.glob("*.c")):
        ElementTree.SubElement(listed, "File", {"name": path.name})
    largest = Quantity("step", "s", "largest internal Runge-Kutta step", step)
    quantities = (*made.inputs, *made.states, *made.parameters, largest, *made.outputs)
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(q.unit for q in quantities if _is_unit(q.unit)):
        ElementTree.SubElement(ElementTree.SubElement(units, "Unit", {"name": unit}), "BaseUnit", _base(unit))
    variables = ElementTree.SubElement(root, "ModelVariables")
    own = {q.name for q in made.states}
    observed = {q.name for q in made.outputs}
    first, count = 1 + len(motion.drive), len(motion.program.inputs)
    listed_in_order = [
        *((q, 1 + i, INPUT) for i, q in enumerate(made.inputs)),
        *((q, first + i, STATE) for i, q in enumerate(made.states) if q.name not in observed),
        *((q, first + motion.states + i, PARAMETER) for i, q in enumerate(made.parameters)),
        (largest, count, PARAMETER),
        *((q, count + 1 + i, MOVING if q.name in own else COMPUTED) for i, q in enumerate(made.outputs)),
    ]
    for q, reference, kind in listed_in_order:
        fields = {"name": q.name, "valueReference": str(reference), "description": q.meaning, **kind}
        real = {"unit": q.unit} if _is_unit(q.unit) else {}
        real |= {} if kind is COMPUTED else {"start": repr(q.value)}
        ElementTree.SubElement(ElementTree.SubElement(variables, "ScalarVariable", fields), "Real", real)
    structure = ElementTree.SubElement(root, "ModelStructure")
    for part, key, value in (("Outputs", "causality", "output"), ("InitialUnknowns", "initial", "calculated")):
        indices = [i for i, variable in enumerate(variables, 1) if variable.get(key) == value]
        parent = ElementTree.SubElement(structure, part) if indices else structure
        for index in indices:
            ElementTree.SubElement(parent, "Unknown", {"index": str(index)})
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def _is_unit(unit: str) -> bool:
    """Whether it can be defined by base units: the coefficient of a formula whose parts differ has none."""
    try:
        parse_unit(unit)
    except StudyError:
        return False
    return bool(unit) and "V" not in unit


def _base(unit: str) -> dict[str, str]:
    """The same in kilograms, metres, seconds and amperes."""
    found = parse_unit(unit)
    force, length, time, _, current = found.powers
    powers = {"kg": force, "m": force + length, "s": time - 2 * force, "A": current}
    fields = {name: str(power) for name, power in powers.items() if power}
    return fields if found.factor == 1.0 else {**fields, "factor": repr(found.factor)}
