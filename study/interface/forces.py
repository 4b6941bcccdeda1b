"""Forces to simulate a model with: seeded, and the same bytes each time."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.equations.simulate import Integrator
from study.equations.simulate import simulate as integrated
from study.interface.data import Record
from study.interface.equation import Model
from study.records.excitation import Excitation, displacement_noise
from study.records.excitation import force as history
from study.support.arrays import Floats
from study.support.errors import StudyError, expect

SAMPLES, DT = 8192, 0.02


@dataclass(frozen=True, eq=False, repr=False)
class Force:
    """A force history.

    Attributes
    ----------
    values : array, shape (n,)
        In newtons.
    dt : float
        Sampling interval in seconds.
    about : str
        What it is, in a few words.
    seed : int
        That it was made with.
    """

    values: Floats
    dt: float
    about: str = "force"
    seed: int = 0

    def __repr__(self) -> str:
        """One line: kind, length and rms."""
        rms = float(np.sqrt(np.mean(self.values**2)))
        return f"<Force {self.about}: {len(self.values):,} samples at {1.0 / self.dt:.6g} Hz, rms {rms:.4g} N>"


def gaussian(
    level: float = 1.0, *, cutoff: float = 12.5, samples: int = SAMPLES, dt: float = DT, seed: int = 1
) -> Force:
    """Low-passed Gaussian noise (the report's Section 2.1).

    ``level`` is the mean square in N^2 of the white sequence before its low-pass at ``cutoff`` Hz, ``dt`` the sampling
    interval in seconds. A ``StudyError`` says what no force can have.
    """
    return _made(Excitation(level=level, cutoff=cutoff), samples, dt, seed)


def multisine(
    level: float = 1.0, *, band: tuple[float, float] = (0.1, 12.5), odd_only: bool = False, periods: int = 1,
    samples: int = SAMPLES, dt: float = DT, seed: int = 1,
) -> Force:  # fmt: skip
    """Sines of equal amplitude and random phase at the harmonics of the period within ``band``, in hertz.

    ``level`` is the mean square in N^2. ``samples`` hold so many ``periods``; ``odd_only`` leaves out the even
    harmonics. A ``StudyError`` says what no force can have.
    """
    excitation = Excitation(
        "random_phase_multisine", level, start_frequency=band[0], stop_frequency=band[1], odd_only=odd_only,
        periods=periods,
    )  # fmt: skip
    return _made(excitation, samples, dt, seed)


def sweep(
    level: float = 1.0, *, band: tuple[float, float] = (0.1, 12.5), logarithmic: bool = False,
    samples: int = SAMPLES, dt: float = DT,
) -> Force:  # fmt: skip
    """A sine that runs from the first to the last frequency of ``band``, in hertz; ``level`` is its mean square in N^2.

    A ``StudyError`` says what no force can have.
    """
    kind = "logarithmic" if logarithmic else "linear"
    excitation = Excitation("swept_sine", level, start_frequency=band[0], stop_frequency=band[1], sweep=kind)
    return _made(excitation, samples, dt, 0)


def waves(
    level: float = 1.0, *, peak: float = 3.0, cutoff: float = 12.5, samples: int = SAMPLES, dt: float = DT,
    seed: int = 1,
) -> Force:  # fmt: skip
    """A force with the autospectrum of Pierson and Moskowitz (1964), its peak at ``peak`` Hz, of mean square ``level``.

    A ``StudyError`` says what no force can have.
    """
    excitation = Excitation("pierson_moskowitz", level, peak_frequency=peak, cutoff=cutoff)
    return _made(excitation, samples, dt, seed)


def simulate(
    model: Model, force: "Force | Record", *, noise: float = 0.0, steps: int = 8, initial: Sequence[float] = (0.0, 0.0),
    name: str | None = None,
) -> Record:  # fmt: skip
    """The response of a model to a force, as a record.

    Parameters
    ----------
    model : Model
        Every value given.
    force : Force or Record
        On the model's one force, or of a record all of its forces and the further channels that its formulas name.
    noise : float
        Mean square of white noise on each displacement over that of the displacement (Section 5.4); its streams are
        independent of the force's. Velocity and acceleration are then left out, as they were not measured.
    steps : int
        Steps a sample of the Adams-Bashforth-Moulton predictor-corrector (Section 2.2).
    initial : sequence of float
        Displacement of every coordinate at the first sample, then the velocities.
    name : str, optional
        Of the record; that of the model if left out.

    Raises
    ------
    StudyError
        If a value or a force is missing, or the response does not stay finite.
    """
    names, seed, extra = [driving for driving, _ in model.equation.forces], 0, dict[str, Floats]()
    start, units = 0.0, None
    if isinstance(force, Record):
        for driving in names:
            expect(driving in force, f"{force.name} has no {driving!r}; expected every force of {model.name}")
        forces, start, units = {driving: force[driving] for driving in names}, force.start, force.units
        extra = {channel: force[channel] for channel in force.extra}
    else:
        several = "; expected a record with each of them"
        expect(len(names) == 1, f"{model.name} has {len(names)} forces and one is given{several}")
        forces, seed = {names[0]: force.values}, force.seed
    made = integrated(
        model.equation, forces, force.dt, Integrator(steps_per_sample=steps), initial=initial, start=start, extra=extra,
        units=units,
    )  # fmt: skip
    if noise != 0.0:
        measured = [sensor for sensor in made.sensors if sensor.motion == "displacement"]
        added = {s: displacement_noise(made[s], noise, seed + number) for number, s in enumerate(measured)}
        made = made.with_motions({s: made[s] + added[s] for s in measured})
    return Record.of(replace(made, name=name or made.name))


def _made(excitation: Excitation, samples: int, dt: float, seed: int) -> Force:
    if samples < 2:
        raise StudyError(f"samples is {samples}; expected 2 or more")
    about = f"{excitation.kind.replace('_', ' ')} of level {excitation.level:g}"
    return Force(history(excitation, samples, dt, seed), dt, about, seed)
