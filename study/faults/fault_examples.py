"""An example of every fault: a simulated record as it is, as a faulty instrument reads it, and what is found of it."""

from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from study.equations.model import Model
from study.equations.simulate import Integrator, simulate
from study.faults.accounting import accounted
from study.faults.fault import FORCE_NOISE, Fault
from study.faults.imposed import impose
from study.records.excitation import Excitation, displacement_noise, force
from study.records.prepared import prepare_record
from study.records.record import Record
from study.support.errors import StudyError

DT, SAMPLES, SEED = 0.005, 4096, 1
FORCE = Excitation(reading="filtered", level=0.4)  # the report's
NOISE = 1e-4  # mean square on the response, over that of the response
MILLIMETRES = MappingProxyType({"displacement": (1000.0, "mm")})  # easier to read than metres
# Noise on the force passes through the structure: of a displacement little of it is left above the resonance.
RESPONSES = MappingProxyType({FORCE_NOISE: "acceleration"})


@dataclass(frozen=True, eq=False)
class Example:
    """One fault on one channel of a record."""

    clean: Record
    faulty: Record
    size: float  # of the fault that was put on, in the unit of what was found
    found: Fault

    @property
    def channel(self) -> str:
        """The channel that has the fault."""
        return self.found.channel


def example(model: Model, fault: str, samples: int = SAMPLES) -> Example:
    """A record of a known system with a fault of a size that matters, and that fault as it is found.

    Parameters
    ----------
    model : Model
        The system, with its values; nothing is known of these where the fault is looked for. A linear one cannot show
        an offset that is no constant force.
    fault : str
        One of ``study.faults.imposed.FAULTS``.
    samples : int
        Length of the record.

    Raises
    ------
    StudyError
        If there is no such fault, or another is found.
    """
    clean = measured_example(model, RESPONSES.get(fault, "displacement"), samples)
    response = next(name for name in clean.channels if name != "force")
    faulty, known = impose(clean, response, fault, np.random.default_rng(SEED))
    unknown = model.with_values(dict.fromkeys(model.values, None))
    faults = accounted(unknown, prepare_record(faulty)).faults
    if [f.fault for f in faults] != [fault]:
        raise StudyError(f"found {', '.join(f.fault for f in faults) or 'nothing'}; expected {fault}")
    return Example(clean, faulty, float(known["value"]), faults[0])


def measured_example(model: Model, response: str, samples: int = SAMPLES) -> Record:
    """Force and one motion of a system, with noise on the motion."""
    whole = simulate(model, force(FORCE, samples, DT, seed=SEED), DT, Integrator("rk4", 8))
    factor, unit = MILLIMETRES.get(response, (1.0, whole.units[response]))
    motion = factor * (whole[response] + displacement_noise(whole[response], NOISE, SEED))
    return Record(DT, {"force": whole["force"], response: motion}, {**whole.units, response: unit}, model.name)
