"""The search for faults of the measurement, beside the model and beside whatever physics the record asks for.

A fault with a look-alike in the library is believed if it is needed beside the effects that the record asks for; where
these do all that it does, and it does all that they do, the record cannot tell, and that is said.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import ndtr

from study.faults import adjustable, physics
from study.faults.correction import corrected
from study.faults.drift import drift
from study.faults.fault import CLIPPING, DRIFT, DROP_OUTS, FORCE_NOISE, HUM, OFFSET, SPIKES, Fault
from study.faults.force_noise import force_noise
from study.faults.hum import hum, is_of_the_mains, line
from study.faults.leftover import FittedResidual, leaves_less, leftover, share
from study.faults.refinement import Refined, refined, relative_power
from study.faults.spikes import spikes
from study.faults.spotted import drop_outs, spotted, widened
from study.faults.stage import SearchEnd, SearchStage, fitted_again, searched_part
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.settling import settled
from study.identify.time_domain.stretch_states import is_poor
from study.records.prepared import Prepared
from study.support.arrays import Floats
from study.support.statistics import gain
from study.support.thresholds import ALPHA

ROUNDS = 12  # faults and effects looked for one after the other
PLAIN = (DRIFT, SPIKES, DROP_OUTS)  # which no physics imitates
EFFECTS = 3  # of the library that are added before a fault is believed


def first_faults(prepared: Prepared, held: Mapping[str, float], asked: Sequence[str]) -> tuple[Fault, ...]:
    """Faults that the user gave values of, and those that the response shows by itself."""
    name = prepared.response
    unit = prepared.record.units.get(name, "")
    given = [Fault(f, name, v, unit=adjustable.unit(f, unit), held=True) for f, v in held.items()]
    return (*given, *spotted(prepared, asked))


def search_faults(
    given: Prepared, fit: FreeRunFit, faults: Sequence[Fault], asked: Sequence[str]
) -> SearchEnd:  # fmt: skip
    """All faults of a record, those that are known first, and the model fitted to the corrected record.

    ``asked`` are the names that are looked for, ``fit`` is the model fitted to the record with the known faults
    corrected. Of a long record, faults that compete with physics are looked for in a stretch of either part; the
    others everywhere.
    """
    nothing = SearchEnd(tuple(faults), fit, fit)
    look = searched_part(given)
    if look is given:
        stage = _searched(given, fit, fit, faults, asked)
        return nothing if stage is None else SearchEnd(stage.faults, stage.left.fit, stage.rich.fit)
    near = physics.refitted(fit, corrected(look, faults))
    part = None if near is None else _searched(look, near, near, faults, asked)
    if part is None:
        return nothing
    known = tuple(f for f in part.faults if f.fault not in PLAIN)
    left, rich = (physics.refitted(one.fit, corrected(given, known)) for one in (part.left, part.rich))
    plain = tuple(name for name in asked if name in PLAIN)
    stage = None if left is None or rich is None else _searched(given, left, rich, known, plain)
    if stage is None:
        return nothing
    stage = _values_again(stage)
    return SearchEnd(stage.faults, stage.left.fit, stage.rich.fit)


def _values_again(stage: SearchStage) -> SearchStage:
    """The stage with the values of its faults found again, beside the effects and the other faults known by now."""
    for fault in stage.faults:
        if fault.fault in adjustable.ADJUSTABLE and fault.corrected and not fault.held:
            others = tuple(f for f in stage.faults if f is not fault)
            again = refined(fault.fault, stage.given, others, stage.rich, fault.value)
            following = None if again is None else replace(stage, faults=others).without(
                replace(again.fault, explained=fault.explained)
            )  # fmt: skip
            stage = following or stage
    return stage


def _searched(
    given: Prepared, fit: FreeRunFit, rich: FreeRunFit, faults: Sequence[Fault], asked: Sequence[str]
) -> SearchStage | None:  # fmt: skip
    """Where a search ends; None where the model does not run. ``rich`` is the model with the effects known by now."""
    prepared = corrected(given, faults)
    left = leftover(fit, prepared)
    more = left if rich is fit else leftover(rich, prepared)
    if left is None or more is None:
        return None
    stage = _beyond_the_limits(SearchStage(given, tuple(faults), left, more))
    for _ in range(ROUNDS):
        following = _next(stage, asked)
        if following is None:
            break
        stage = following
    return _needed(stage, len(asked), [fault.fault for fault in faults])


def _beyond_the_limits(stage: SearchStage) -> SearchStage:
    """Without the samples near a limit that clips, which noise may have kept within it."""
    faults = [widened(f, stage.given, stage.left) if f.fault == CLIPPING else f for f in stage.faults]
    if not any(f.fault == CLIPPING for f in faults):
        return stage
    left = fitted_again(stage.left, corrected(stage.given, faults))
    return stage if left is None else SearchStage(stage.given, tuple(faults), left, left)


def _next(stage: SearchStage, asked: Sequence[str]) -> SearchStage | None:
    """The stage with one fault more; None if there is none."""
    found = [f.fault for f in stage.faults]
    names = [name for name in asked if name not in found or name in (HUM, SPIKES)]
    plain = _plain(stage, names, len(asked))
    if plain is not None or set(asked) <= set(PLAIN):
        return plain
    return _contested(stage, [n for n in names if n not in [f.fault for f in stage.faults if f.rivals]], len(asked))


def _plain(stage: SearchStage, names: Sequence[str], asked: int) -> SearchStage | None:
    """One fault more of those that no physics imitates: drop-outs, spikes, drift, and hum of the mains."""
    if DROP_OUTS in names:
        fault = drop_outs(stage.rich, asked)
        if fault is not None:
            return stage.without(fault)
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
    error = float(np.hypot(before.error, spike.error))
    return replace(before, value=before.value + spike.value, error=error, lost=lost)


def _contested(stage: SearchStage, names: Sequence[str], asked: int) -> SearchStage | None:
    """One fault more of those that have a look-alike in the library, or one effect more that the record asks for."""
    name = _best(stage.rich, [n for n in names if n in (*adjustable.ADJUSTABLE, HUM)], asked)
    one = None if name is None else refined(name, stage.given, stage.faults, stage.rich)
    one = None if one is None or _may_be_none(one.fault, asked) else one
    effect = _effect(stage, one)
    if one is None:
        return _noisy_force(stage, names, asked) if effect is None else _beside(effect, stage)
    if effect is None:
        return _accepted(stage, one)
    fault_needed = share(effect, _columns(one.fault, effect), leading=one.fault.fault != HUM)
    needed = fault_needed is not None and fault_needed.significant(asked), _needs(one, effect)
    if needed == (False, False):
        return _tied(stage, one, effect)
    if needed == (False, True) or (all(needed) and relative_power(effect) < relative_power(one.left)):
        return _beside(effect, stage)
    return _accepted(stage, one)


def _no_effect(effect: FittedResidual, stage: SearchStage) -> bool:
    """Whether what the record asks for most lies outside of what makes it physical."""
    return physics.unphysical(effect.fit, _added(effect, stage))


def _added(effect: FittedResidual, stage: SearchStage) -> list[str]:
    return [e.name for e in effect.fit.model.terms if e.name not in stage.rich.fit.model]


def _noisy_force(stage: SearchStage, names: Sequence[str], asked: int) -> SearchStage | None:
    """The stage with noise on the force, which is said of what no effect explains; None if it is not seen or known."""
    if FORCE_NOISE not in names or force_noise(stage.rich, asked, repeats=1) is None:
        return None
    # What an integration in few steps leaves is shaped by the structure too.
    left = leftover(settled(stage.rich.fit, stage.rich.prepared), stage.rich.prepared)
    noise = None if left is None else force_noise(left, asked)
    if noise is None:
        return None
    effect = physics.missing(stage.rich) if len(stage.effects) < EFFECTS else None
    return replace(stage, faults=(*stage.faults, noise)) if effect is None else _beside(effect, stage)


def _may_be_none(fault: Fault, asked: int) -> bool:
    """Whether chance alone gives such a value, so many faults having been asked for; from the whole record."""
    return fault.error > 0.0 and 2.0 * float(ndtr(-abs(fault.value) / fault.error)) * asked >= ALPHA


def _effect(stage: SearchStage, one: Refined | None) -> FittedResidual | None:
    """The effect that the record asks for most beside those that it has asked for already."""
    if len(stage.effects) >= EFFECTS or (one is None and not physics.asks_for_more(stage.rich)):
        return None
    return physics.missing(stage.rich)


def _columns(fault: Fault, left: FittedResidual) -> tuple[Floats, Floats]:
    return line(fault.frequency, left) if fault.fault == HUM else adjustable.fault_columns(fault.fault, left)


def _best(left: FittedResidual, names: Sequence[str], asked: int) -> str | None:
    """The fault that explains most of what is left, and that not by chance; None without any."""
    power: dict[str, float] = {}
    for name in names:
        if name == HUM:
            fault = hum(left, asked)
            if fault is not None:
                power[name] = fault.explained * float(np.mean(left.residual[1] ** 2)) / left.size**2
            continue
        found = share(left, adjustable.fault_columns(name, left), leading=True)
        if found is not None and found.significant(asked) and adjustable.sensible(name, float(found.amounts[0]), left):
            power[name] = found.power
    return max(power, key=lambda name: power[name], default=None)


def _accepted(stage: SearchStage, one: Refined) -> SearchStage | None:
    """The stage with a fault corrected.

    An effect that imitated the fault is no longer needed then; the value is found again without it.
    """
    following = stage.without(_explaining(one.fault, stage.rich, one.left))
    if following is None or len(following.effects) == len(stage.effects) or one.fault.fault == HUM:
        return following
    again = refined(one.fault.fault, stage.given, stage.faults, following.rich, one.fault.value)
    return following if again is None else stage.without(_explaining(again.fault, stage.rich, again.left))


def _beside(effect: FittedResidual, stage: SearchStage) -> SearchStage:
    """The stage with an effect more, and the values of its faults found again beside it: its lack has moved them."""
    return _values_again(replace(stage, rich=effect))


def _explaining(fault: Fault, before: FittedResidual, after: FittedResidual) -> Fault:
    return replace(fault, explained=gain(before.residual[1], after.residual[1]).explained)


def _tied(stage: SearchStage, one: Refined, effect: FittedResidual) -> SearchStage | None:
    """What becomes of a fault and an effect neither of which is needed beside the other: the fault is mentioned.

    Not so beside an effect that is none, as a Maxwell element of negative stiffness, which hastens what is late.
    """
    names = _added(effect, stage)
    if _no_effect(effect, stage) or (one.fault.fault == HUM and _beyond_reason(stage, effect)):
        return _accepted(stage, one)
    if one.fault.fault == OFFSET and any(f.fault == DRIFT for f in stage.faults):
        return _accepted(stage, one)  # a channel that drifts has no zero of its own
    fault = _explaining(one.fault, stage.rich, one.left).with_rivals(*names)
    return replace(stage, faults=(*stage.faults, fault), rich=effect)


def _needs(one: Refined, effect: FittedResidual) -> bool:
    """Whether the effect explains anything beside the corrected fault."""
    both = fitted_again(effect, one.left.prepared)
    return both is not None and leaves_less(one.left, both, 1)


def _beyond_reason(stage: SearchStage, effect: FittedResidual) -> bool:
    """Whether a harmonic force would have to be larger than the whole measured one."""
    values = effect.fit.model.numbers()
    harmonic = [e.term.symbols for e in effect.fit.model.terms if len(e.term.symbols) == 2]  # a force of any phase
    largest = float(np.max(np.abs(stage.given.record["force"][slice(*stage.given.plan.fit)])))
    return any(math.hypot(*(values[s] for s in symbols)) > largest for symbols in harmonic)


def _needed(stage: SearchStage, asked: int, begun: Sequence[str]) -> SearchStage:
    """Without the faults that the effects found after them have made needless; ``begun`` were known from the start."""
    for fault in stage.faults:
        if fault.fault in (*adjustable.ADJUSTABLE, DRIFT) and fault.corrected and not fault.held:
            others = tuple(f for f in stage.faults if f is not fault)
            prepared = corrected(stage.given, others)
            left, rich = (fitted_again(one, prepared) for one in (stage.left, stage.rich))
            if left is None or rich is None:
                continue
            lost = fault.fault in begun and _loses_its_way(rich, stage.rich, asked)
            if not (lost or _still_there(fault, rich, asked)):
                stage = SearchStage(stage.given, others, left, rich)
    return stage


def _loses_its_way(without: FittedResidual, with_it: FittedResidual, asked: int) -> bool:
    """Whether a model loses the motion without a correction: what a little of the fault would do tells nothing then."""
    return is_poor(without.fit, without.prepared.fitted) and leaves_less(without, with_it, asked)


def _still_there(fault: Fault, rich: FittedResidual, asked: int) -> bool:
    """Whether the record shows a fault beside all effects that it asks for."""
    if fault.fault == DRIFT:
        return drift(rich, asked) is not None
    needed = share(rich, adjustable.fault_columns(fault.fault, rich), leading=True)
    return needed is not None and needed.significant(asked)
