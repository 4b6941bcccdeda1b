"""Trials: a system and how it is tested, effects hidden in it (or none), a sensor and its fault, all from one seed."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from study.equations.model import Model, ModelTerm
from study.equations.terms import get
from study.faults.fault import FAULTS
from study.faults.imposed import impose
from study.records.record import MOTIONS, Record
from study.support.errors import DivergenceError, StudyError, expect
from study.trials.driven import LABORATORIES, REPORT_LIKE, driven_rig
from study.trials.effects import HIDDEN, Asked, Rig, grown
from study.trials.kinds import POSSIBLE, TESTS, rig_of_a_test
from study.trials.rigs import RIG_KINDS, RIG_NOISES
from study.trials.structures import structure_rig

# Kinds of test, beside those of ``kinds``: a force on mass and spring, and on masses between springs.
DRIVEN_MASS, LIKE_THE_REPORT, STRUCTURE = "driven", "like_the_report", "structure"
NOISES = (0.0, 0.01, 0.05, 0.10)
ATTEMPTS = 300  # systems drawn until one carries the effects at the wanted strength and stays finite
ANY, NO_FAULT = "any", "none"  # what may be said of the fault beside its name


@dataclass(frozen=True)
class Trial:
    """A record, what its owner believes, and the truth."""

    record: Record  # force and one measured motion, of every mass of a structure
    believed: Model  # the model without the hidden effects, nothing known of its coefficients
    truth: Model  # the model that made the record
    hidden: tuple[str, ...]  # names of the hidden effects, in a structure with their places
    noise: float  # mean square of the noise over that of the response
    shares: tuple[float, ...]  # of the restoring force in each hidden effect, beyond any linear model
    test: str  # one of ``FAMILIES``
    response: str  # the measured motion
    about: Mapping[str, Any]  # how the system is driven and sampled, as a table says it
    fault: Mapping[str, Any] = field(default_factory=dict[str, Any])  # of the measurement: its name, channel and value

    @property
    def effects(self) -> tuple[ModelTerm, ...]:
        """The hidden effects, at their places."""
        return tuple(entry for entry in self.truth.terms if entry.name in self.hidden)

    @property
    def channels(self) -> tuple[str, ...]:
        return tuple(self.record.channels)

    @property
    def completed(self) -> Model:
        """What its owner believes after adding all that was hidden, nothing known of the coefficients."""
        return _nothing_known(self.truth, self.believed.name)


@dataclass(frozen=True)
class Family:
    """Trials of one kind of test. What is drawn of them, and in which order, is that of the published records."""

    stem: str  # of the names of files
    stream: tuple[int, ...]  # what the generator of a seed is begun with, beside that
    possible: tuple[str, ...]  # effects that may be hidden
    effects: Callable[[np.random.Generator], Iterable[str]]  # hidden where none are asked for
    noises: tuple[float, ...]
    motions: tuple[str, ...]  # of which one is measured; where it may be another, any may be asked for
    rig: Callable[[np.random.Generator, Asked], Rig]
    anyway: bool = False  # whether effects are drawn that are not wanted

    def asked(
        self, rng: np.random.Generator, seed: int, hidden: Sequence[str] | None, noise: float | None,
        response: str | None, coordinates: int | None,
    ) -> Asked:  # fmt: skip
        """What a trial is to be: what is given is taken, the rest drawn."""
        drawn = self.effects(rng) if hidden is None or self.anyway else ()
        several = len(self.motions) > 1
        level = float(rng.choice(self.noises)) if several or noise is None else noise
        motion = str(rng.choice(self.motions)) if several else self.motions[0]
        names = tuple(str(name) for name in (drawn if hidden is None else hidden))
        return Asked(seed, names, level if noise is None else noise, response or motion, coordinates)


def make_trial(
    seed: int,
    hidden: Sequence[str] | None = None,
    noise: float | None = None,
    response: str | None = None,
    fault: str = NO_FAULT,
    test: str = LIKE_THE_REPORT,
    coordinates: int | None = None,
) -> Trial:
    """A trial of this seed; what is given is not drawn.

    No effect is hidden with an empty sequence; ``noise`` is a mean square over that of the response, ``response`` is
    ``displacement``, ``velocity`` or ``acceleration``. ``fault`` is one of ``study.faults.fault.FAULTS``, ``any`` for
    one that is drawn in half of the trials, or ``none``; it comes last and has a stream of its own: the trial without
    it is the same record before the fault. ``test`` is one of ``FAMILIES``; a ``structure`` has so many
    ``coordinates``. A ``DivergenceError`` says that no system was found that stays finite with these effects.
    """
    expect(test in FAMILIES, f"test is {test!r}; expected one of {', '.join(FAMILIES)}")
    family, names = FAMILIES[test], hidden or ()
    for name in names:
        known = get(name).name in family.possible
        expect(known, f"{name!r} cannot be hidden in {test}; expected one of {', '.join(family.possible)}")
    once = len(set(names)) == len(names)
    expect(once, f"the effects to hide are {', '.join(names)}; each may be named once")
    motions = MOTIONS if len(family.motions) > 1 else family.motions
    fits = response is None or response in motions
    expect(fits, f"response is {response!r}; in {test} expected one of {', '.join(motions)}")
    faults = (NO_FAULT, ANY, *FAULTS) if test in (DRIVEN_MASS, LIKE_THE_REPORT) else (NO_FAULT,)
    expect(fault in faults, f"fault is {fault!r}; in {test} expected one of {', '.join(faults)}")
    expect(coordinates is None or test == STRUCTURE, f"{test} has a single coordinate; expected {STRUCTURE}")
    rng = np.random.default_rng([family.stream[0], seed, *family.stream[1:]])
    asked = family.asked(rng, seed, hidden, noise, response, coordinates)
    refused = ""
    for _ in range(ATTEMPTS):
        try:
            trial = _attempt(rng, asked, test)
        except (StudyError, np.linalg.LinAlgError) as error:
            refused = str(error)
        else:
            return _with_fault(trial, seed, fault)
    what = ", ".join(asked.hidden) or "nothing hidden"
    raise DivergenceError(f"no system of {family.stem} {seed} stays finite with {what}; of the last, {refused}", 0.0)


def _attempt(rng: np.random.Generator, asked: Asked, test: str) -> Trial:
    """The trial of the next system that is drawn, or a ``StudyError`` that says why it makes none."""
    family = FAMILIES[test]
    rig = family.rig(rng, asked)
    effects = [rig.effect(get(name)) for name in asked.hidden]
    truth, shares = rig.base, dict[str, float]()
    # What comes later changes the motion, and so the share of what came before: that is sized again at the end.
    for unit, target in (*effects, *effects[: -1 if rig.sizing.rounds else 0]):
        truth, shares[unit.name] = grown(truth.without_term(unit.name), unit, target, rig)
    record, carried = rig.recorded(truth, tuple(shares[unit.name] for unit, _ in effects))
    name, hidden = f"{family.stem}_{asked.seed}", tuple(unit.name for unit, _ in effects)
    known = rig.base
    for beside in rig.unknown:
        known = known.without_term(beside)
    return Trial(
        replace(record, name=name), _nothing_known(known, name), truth, hidden, asked.noise, carried, test,
        asked.response, rig.about,
    )  # fmt: skip


def _nothing_known(model: Model, name: str) -> Model:
    return replace(model, name=name).with_values(dict.fromkeys(model.values, None))


def _with_fault(trial: Trial, seed: int, fault: str) -> Trial:
    if fault == NO_FAULT or trial.believed.named:
        return trial
    rng = np.random.default_rng([2026, seed, 1])
    if fault == ANY:
        return _with_fault(trial, seed, str(rng.choice([*FAULTS, *[NO_FAULT] * len(FAULTS)])))
    record, what = impose(trial.record, trial.response, fault, rng)
    return replace(trial, record=record, fault=what)


def _of_driven(rng: np.random.Generator) -> Iterable[str]:
    return rng.choice(HIDDEN, int(rng.choice([0, 1, 1, 1, 1, 2])), replace=False)


def _of_a_test(possible: Sequence[str], rng: np.random.Generator) -> Iterable[str]:
    return rng.choice(possible, int(rng.random() < 0.75), replace=False)


FAMILIES: Mapping[str, Family] = MappingProxyType(
    {
        **{
            name: Family(
                "trial", (2026,), HIDDEN, _of_driven, NOISES, ranges.responses, partial(driven_rig, ranges=ranges)
            )
            for name, ranges in ((LIKE_THE_REPORT, REPORT_LIKE), (DRIVEN_MASS, LABORATORIES))
        },
        **{
            name: Family(
                name, (2026, *name.encode()), possible, partial(_of_a_test, possible), NOISES[:3], ("displacement",),
                partial(rig_of_a_test, make=TESTS[name]),
            )
            for name, possible in POSSIBLE.items()
        },
        STRUCTURE: Family(
            STRUCTURE, (2027,), HIDDEN, lambda rng: (rng.choice(HIDDEN),), NOISES[:3], ("displacement", "acceleration"),
            structure_rig, anyway=True,
        ),
        **{
            name: Family(
                name, (2028, *name.encode()), kind.possible, kind.drawn, RIG_NOISES, kind.motions, kind.rig
            )
            for name, kind in RIG_KINDS.items()
        },
    }
)  # fmt: skip
