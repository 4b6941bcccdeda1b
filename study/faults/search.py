"""The search for faults of the measurement, beside the model and beside whatever physics the record asks for.

A fault with a look-alike in the library is believed if it is needed beside the effects that the record asks for; where
these do all that it does, and it does all that they do, the record cannot tell, and that is said.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from study.faults import adjustable, physics
from study.faults.correction import corrected
from study.faults.drift import drift
from study.faults.fault import DRIFT, FORCE_NOISE, HUM, SPIKES, Fault
from study.faults.force_noise import force_noise
from study.faults.hum import hum, is_of_the_mains
from study.faults.leftover import Leftover, better, leftover, share
from study.faults.refinement import Refined, refined
from study.faults.spikes import spikes
from study.faults.spotted import spotted
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.prepared import Prepared

ROUNDS = 8  # faults looked for one after the other
EFFECTS = 3  # of the library that are added before a fault is believed


@dataclass(frozen=True, eq=False)
class Stage:
    """Where a search stands: the record as given, the faults found, and the model fitted to the corrected record."""

    given: Prepared
    faults: tuple[Fault, ...]
    left: Leftover  # of the model
    rich: Leftover  # of the model and the effects that the record asks for

    @property
    def effects(self) -> list[str]:
        """The effects that the record asks for."""
        return [e.name for e in self.rich.fit.model.terms if e.name not in self.left.fit.model]

    def named(self, fault: Fault) -> "Stage":
        """The stage with a fault that nothing is corrected for."""
        return replace(self, faults=(*self.faults, fault))

    def without(self, *faults: Fault) -> "Stage | None":
        """The stage with these faults corrected; None where a model does not run any more."""
        known = (*(f for f in self.faults if f.fault not in [g.fault for g in faults if f.fault == SPIKES]), *faults)
        prepared = corrected(self.given, known)
        left, rich = (_again(one, prepared) for one in (self.left, self.rich))
        return None if left is None or rich is None else Stage(self.given, known, left, _pruned(rich, left))


def first_faults(prepared: Prepared, held: Mapping[str, float], asked: Sequence[str]) -> tuple[Fault, ...]:
    """Faults that the user gave values of, and those that the response shows by itself."""
    name = prepared.response
    unit = prepared.record.units.get(name, "")
    given = [Fault(f, name, v, unit=adjustable.unit(f, unit), held=True) for f, v in held.items()]
    return (*given, *spotted(prepared, asked))


def search(given: Prepared, fit: FreeRunFit, faults: Sequence[Fault], asked: Sequence[str]) -> tuple[Fault, ...]:
    """All faults of a record, those that are known first; ``asked`` are the names that are looked for.

    ``fit`` is the model fitted to the record with the known faults corrected.
    """
    left = leftover(fit, corrected(given, faults))
    if left is None:
        return tuple(faults)
    stage = Stage(given, tuple(faults), left, left)
    for _ in range(ROUNDS):
        following = _next(stage, asked)
        if following is None:
            break
        stage = following
    noise = force_noise(stage.rich, len(asked)) if FORCE_NOISE in asked else None
    return stage.faults if noise is None else (*stage.faults, noise)


def _next(stage: Stage, asked: Sequence[str]) -> Stage | None:
    """The stage with one fault more; None if there is none."""
    found = [f.fault for f in stage.faults]
    names = [name for name in asked if name not in found or name in (HUM, SPIKES)]
    plain = _plain(stage, names, len(asked))
    if plain is not None:
        return plain
    rivals = [f.fault for f in stage.faults if f.rivals]
    return _contested(stage, [n for n in names if n in (*adjustable.ADJUSTABLE, HUM) and n not in rivals], len(asked))


def _plain(stage: Stage, names: Sequence[str], asked: int) -> Stage | None:
    """One fault more of those that no physics imitates: spikes, drift, and hum of the mains."""
    if SPIKES in names:
        fault = spikes(stage.rich, asked)
        if fault is not None:
            return stage.without(_merged(stage.faults, fault))
    if DRIFT in names:
        fault = drift(stage.rich, asked)
        if fault is not None:
            return stage.without(fault)
    fault = hum(stage.rich, asked) if HUM in names else None
    if fault is not None and is_of_the_mains(fault.frequency, stage.left):
        return stage.without(fault)
    return None


def _merged(faults: Sequence[Fault], spike: Fault) -> Fault:
    """All spikes as one fault."""
    before = next((f for f in faults if f.fault == SPIKES), None)
    if before is None or before.lost is None or spike.lost is None:
        return spike
    lost = before.lost | spike.lost
    return replace(before, value=before.value + spike.value, lost=lost)


def _contested(stage: Stage, names: Sequence[str], asked: int) -> Stage | None:
    """One fault more of those that have a look-alike among the effects of the library."""
    alone = _best(stage.left, names, asked)
    if alone is None and not stage.effects and not physics.asks_for_more(stage.left):
        return None
    stage = _with_physics(stage)
    if not stage.effects:
        return None if alone is None else _accepted(stage, alone, stage.left)
    beside = _best(stage.rich, names, asked)
    if beside is not None:
        return _accepted(stage, beside, stage.rich)
    return None if alone is None else _tied(stage, alone)


def _best(left: Leftover, names: Sequence[str], asked: int) -> str | None:
    """The fault that explains most of what is left, and that not by chance; None without any."""
    power: dict[str, float] = {}
    for name in names:
        if name == HUM:
            line = hum(left, asked)
            if line is not None:
                power[name] = line.explained * float(np.mean(left.residual[1] ** 2)) / left.size**2
            continue
        found = share(left, adjustable.columns(name, left))
        if found is not None and found.significant(asked) and adjustable.sensible(name, float(found.amounts[0]), left):
            power[name] = found.power
    return max(power, key=lambda name: power[name], default=None)


def _accepted(stage: Stage, name: str, left: Leftover) -> Stage | None:
    """The stage with a fault corrected whose value is found beside what ``left`` is left by.

    An effect that imitated the fault is no longer needed then; the value is found again without it.
    """
    one = refined(name, stage.given, stage.faults, left)
    if one is None:
        return None
    following = stage.without(one.fault)
    if following is None or len(following.rich.fit.keys) == len(left.fit.keys):
        return following
    again = refined(name, stage.given, stage.faults, following.rich, one.fault.value)
    return following if again is None else stage.without(again.fault)


def _tied(stage: Stage, name: str) -> Stage | None:
    """What becomes of a fault that is not needed beside the effects: if these are not needed beside it, it is named.

    Of one number against several effects with theirs the one number is the simpler explanation.
    """
    one = refined(name, stage.given, stage.faults, stage.left)
    if one is None or _needs(one, stage):
        return None
    if len(stage.effects) > 1 or (name == HUM and _beyond_reason(stage)):
        return stage.without(one.fault)
    return stage.named(one.fault.with_rivals(*stage.effects))


def _needs(one: Refined, stage: Stage) -> bool:
    """Whether the effects explain anything beside the corrected fault."""
    both = _again(stage.rich, one.left.prepared)
    return both is not None and better(one.left, both, 1)


def _beyond_reason(stage: Stage) -> bool:
    """Whether a harmonic force would have to be larger than the whole measured one."""
    values = stage.rich.fit.model.numbers()
    entry = next((e for e in stage.rich.fit.model.terms if e.name == "harmonic_force"), None)
    if entry is None:
        return False
    force = stage.given.record["force"][slice(*stage.given.plan.fit)]
    return float(np.hypot(*(values[s] for s in entry.term.symbols))) > float(np.max(np.abs(force)))


def _with_physics(stage: Stage) -> Stage:
    """The stage with as many effects as the record asks for."""
    rich = stage.rich
    while len(rich.fit.model.terms) - len(stage.left.fit.model.terms) < EFFECTS:
        if rich is not stage.left and not physics.asks_for_more(rich):
            break
        fit = physics.missing(rich)
        more = None if fit is None else leftover(fit, rich.prepared)
        if more is None:
            break
        rich = more
    return replace(stage, rich=rich)


def _pruned(rich: Leftover, left: Leftover) -> Leftover:
    """Without the effects that the corrected record no longer asks for, the last one first."""
    for name in reversed([e.name for e in rich.fit.model.terms if e.name not in left.fit.model]):
        fit = physics.without_effect(rich.fit, name, rich.prepared)
        fewer = None if fit is None else leftover(fit, rich.prepared)
        if fewer is not None and not better(fewer, rich, 1):
            rich = fewer
    return left if len(rich.fit.model.terms) == len(left.fit.model.terms) else rich


def _again(left: Leftover, prepared: Prepared) -> Leftover | None:
    """A model fitted again to a record that was corrected."""
    fit = physics.refitted(left.fit, prepared)
    return None if fit is None else leftover(fit, prepared)
