"""The search for faults of the measurement, beside the model and beside whatever physics the record asks for.

A fault with a look-alike in the library is believed if it is needed beside the effects that the record asks for; where
these do all that it does, and it does all that they do, the record cannot tell, and that is said. The value of one that
a single number describes is found together with the model's own coefficients.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtr

from study.compare.dependence import left_by, significant_share
from study.faults.correction import corrected, fault_columns, sensible, unit_of
from study.faults.fault import (
    ALL_SENSORS,
    CLIPPING,
    DELAY,
    DRIFT,
    DROP_OUTS,
    FORCE_NOISE,
    HIGH_PASS,
    HOLDABLE,
    HUM,
    OFFSET,
    SPIKES,
    Fault,
    Held,
    same,
)  # fmt: skip
from study.faults.force_noise import force_noise
from study.faults.leftover import (
    Columns,
    FittedResidual,
    amounts_on_both,
    asks_for_more,
    effects_beside,
    gained,
    leaves_less,
    left_again,
    leftover,
    refitted,
    share,
    unphysical,
)
from study.faults.seen_in_residual import drift, hum, is_of_the_mains, line, slow_part, spikes
from study.faults.spotted import drop_outs, spotted, widened
from study.identify.time_domain import shape_search
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.settling import settled
from study.identify.time_domain.stretch_states import is_poor
from study.records.prepared import Prepared, limited
from study.support import work
from study.support.cores import side_by_side, two_at_once
from study.support.errors import DivergenceError, expect
from study.support.thresholds import ALPHA, TOLERANCE

LEAST_COMPETING, MOST_COMPETING = 8192, 16384  # samples of either part in which faults compete with physics
Asked = tuple[str, str]  # a fault and the channel in which it is looked for
ROUNDS = 12  # faults and effects looked for one after the other
UNLIKE_PHYSICS = (DRIFT, SPIKES, DROP_OUTS)  # no physics imitates them
EFFECTS = 3  # of the library that are added before a fault is believed
GAUSS_NEWTON_STEPS = 8
OF_MOTION = 0.5  # of what is left: where so much depends on the motion, a force is missing rather than noisy
FAR_APART = (-3.0, -2.0, -1.0, 1.0, 2.0, 3.0)  # samples
REACHED = 0.05  # standard errors: as near the value as the search has to come


@dataclass(frozen=True, eq=False)
class SearchStage:
    """Where a search stands: the record as given, the faults found, and the model fitted to the corrected record."""

    given: Prepared
    faults: tuple[Fault, ...]
    left: FittedResidual  # of the model
    rich: FittedResidual  # of the model and the effects that the record asks for

    @property
    def effects(self) -> list[str]:
        """The effects that the record asks for."""
        return effects_beside(self.rich, self.left)

    def stands_at(self, other: "SearchStage") -> bool:
        """Whether another search has come to the same faults and effects, beside which as much is left."""
        pairs = (self.left, other.left), (self.rich, other.rich)
        alike = all(abs(a.relative_power - b.relative_power) <= TOLERANCE * b.relative_power for a, b in pairs)
        mine, theirs = ({(f.fault, f.channel) for f in one.faults} for one in (self, other))
        return alike and mine == theirs and same(self.faults, other.faults) and set(self.effects) == set(other.effects)

    def again(self, prepared: Prepared) -> tuple[FittedResidual | None, FittedResidual | None]:
        """Both models fitted to a record that is corrected otherwise; they may be one."""
        models = [self.left, self.rich] if self.rich is not self.left else [self.left]
        again = list(side_by_side(lambda one: left_again(one, prepared), models))
        return again[0], again[-1]

    def without(self, fault: Fault) -> "SearchStage | None":
        """The stage with one fault more corrected, or all spikes; None where a model does not run any more."""
        again = [f for f in self.faults if f.fault == fault.fault == SPIKES and f.channel == fault.channel]
        known = (*(f for f in self.faults if f not in again), fault)
        prepared = corrected(self.given, known)
        left, rich = self.again(prepared)
        if left is None or rich is None:
            return None
        for name in reversed(effects_beside(rich, left)):  # those that the corrected record no longer asks for go
            fewer = left_again(rich, prepared, without=name)
            if fewer is not None and not leaves_less(fewer, rich, 1):
                rich = fewer
        return SearchStage(self.given, known, left, rich if effects_beside(rich, left) else left)


@dataclass(frozen=True, eq=False)
class SearchEnd:
    """Where a search for faults has ended."""

    faults: tuple[Fault, ...]  # those that were known and those that were found
    fit: FreeRunFit  # the model fitted to the corrected record; it searches no further than from where it began
    rich: FreeRunFit  # the model with the effects that the record asks for beside the faults
    passed: tuple[SearchStage, ...] = ()  # stages in which faults were looked for that compete with physics


@dataclass(frozen=True, eq=False)
class Refined:
    """A fault with its value, and what the model leaves of the record that is corrected for it."""

    fault: Fault
    left: FittedResidual


def asked_of(prepared: Prepared, names: Sequence[str], held: Mapping[Asked, float]) -> tuple[Asked, ...]:
    """Where faults of these names are looked for, but for those whose value is known.

    In each sensor, and noise on each force. Several sensors may all be late together, against all forces, and of
    several forces each by itself.
    """
    sensors, forces = [str(sensor) for sensor in prepared.outputs.sensors], prepared.record.forces
    several = len(sensors) > 1
    late = (ALL_SENSORS, *sensors, *(forces if len(forces) > 1 else ())) if several else sensors
    where = {DELAY: late, FORCE_NOISE: forces}
    everywhere = [(name, channel) for name in names for channel in where.get(name, sensors)]
    return tuple(one for one in everywhere if one not in held)


def held_in(prepared: Prepared, held: Held) -> dict[Asked, float]:
    """The values that the user gave of faults, by fault and channel: where none is named, of the only sensor.

    A delay is that of all sensors then.

    Raises
    ------
    StudyError
        If a record has no such channel, or of several sensors none is named.
    """
    sensors = [str(sensor) for sensor in prepared.outputs.sensors]
    found: dict[Asked, float] = {}
    for name, given in held.items():
        channels = (*sensors, *(prepared.record.forces if name == DELAY else ()))
        if isinstance(given, float | int):
            expect(
                len(sensors) == 1 or name == DELAY,
                f"measurement holds {name} at {given:g} and there are several sensors; expected a value by channel, as "
                f"'{name}: {{{sensors[0]}: {given:g}}}'",
            )
            found[name, sensors[0] if len(sensors) == 1 else ALL_SENSORS] = given
            continue
        for channel, value in given.items():
            known = ", ".join(channels)
            expect(channel in channels, f"measurement holds {name} of {channel!r}; expected one of {known}")
            found[name, channel] = value
    return found


def first_faults(prepared: Prepared, held: Mapping[Asked, float], asked: Sequence[Asked]) -> tuple[Fault, ...]:
    """Faults that the user gave values of, and those that the responses show by themselves."""
    units = prepared.record.units
    given = [Fault(f, c, v, unit=unit_of(f, units.get(c, "")), held=True) for (f, c), v in held.items()]
    names = {str(s): [name for name, channel in asked if channel == str(s)] for s in prepared.outputs.sensors}
    return (*given, *(fault for channel, own in names.items() for fault in spotted(prepared, channel, own)))


def searched_part(given: Prepared) -> Prepared:
    """As much of either part of a record as a search for faults that compete with physics takes."""
    return limited(given, int(np.clip(given.samples_in(shape_search.SEARCH_PERIODS), LEAST_COMPETING, MOST_COMPETING)))


def search_faults(
    given: Prepared, fit: FreeRunFit, faults: Sequence[Fault], asked: Sequence[Asked], before: SearchEnd | None = None
) -> SearchEnd:
    """All faults of a record, those that are known first, and the model fitted to the corrected record.

    ``asked`` is what is looked for and where, ``fit`` is the model fitted to the record with the known faults
    corrected. Of a long record, faults that compete with physics are looked for in a stretch of either part; the
    others everywhere. A search ends as the one ``before`` where it arrives at what that has passed, or where effects
    have made needless what it alone began with.
    """
    look, passed = searched_part(given), list[SearchStage]()
    own, theirs = ({(f.fault, f.channel) for f in some} for some in (faults, before.faults if before else faults))
    near = fit if look is given else refitted(fit, corrected(look, faults))
    for stage in _stages(look, near, near, faults, asked):
        if before is not None:
            begun = [f for f in stage.faults if stage.effects and (f.fault, f.channel) in own - theirs]
            needless = begun and all(_without_needless(f, stage, len(asked), faults) for f in begun)
            arrived = passed and any(map(stage.stands_at, before.passed))  # as it begins it differs by its fit alone
            if needless or arrived:
                return before
        passed.append(stage)
    stage = _needed(passed[-1], len(asked), faults) if passed else None
    if stage is not None and look is not given:
        known = tuple(f for f in stage.faults if f.fault not in UNLIKE_PHYSICS)
        left, rich = (refitted(one.fit, corrected(given, known)) for one in (stage.left, stage.rich))
        plain = tuple(one for one in asked if one[0] in UNLIKE_PHYSICS)
        whole = list(_stages(given, left, rich, known, plain))
        stage = _values_again(_needed(whole[-1], len(plain), known)) if whole else None
    if stage is None:
        return SearchEnd(tuple(faults), fit, fit)
    return SearchEnd(stage.faults, stage.left.fit, stage.rich.fit, tuple(passed))


def _values_again(stage: SearchStage) -> SearchStage:
    """The stage with the values of its faults found again, beside the effects and the other faults known by now."""
    for fault in stage.faults:
        if fault.fault in HOLDABLE and fault.corrected and not fault.held:
            others = tuple(f for f in stage.faults if f is not fault)
            again = refined((fault.fault, fault.channel), stage.given, others, stage.rich, fault.value)
            if again is not None:
                known = replace(again.fault, explained=fault.explained)
                stage = replace(stage, faults=others).without(known) or stage
    return stage


def _stages(
    given: Prepared, fit: FreeRunFit | None, rich: FreeRunFit | None, faults: Sequence[Fault], asked: Sequence[Asked]
) -> Iterator[SearchStage]:
    """The stages of a search; none where the model does not run. ``rich`` is that with the effects known by now."""
    prepared = corrected(given, faults)
    if fit is None or rich is None:
        return
    left = leftover(fit, prepared)
    more = left if rich is fit else leftover(rich, prepared)
    if left is None or more is None:
        return
    stage = SearchStage(given, tuple(faults), left, more)
    if any(f.fault == CLIPPING for f in faults):  # noise may have kept samples within a limit that clips
        wider = tuple(widened(f, given, left.of(f.channel)) if f.fault == CLIPPING else f for f in faults)
        again = left_again(left, corrected(given, wider))
        stage = stage if again is None else SearchStage(given, wider, again, again)
    yield stage
    for _ in range(ROUNDS):
        before, following = stage.faults, None if work.is_done() else _next(stage, asked)
        if following is None:
            break
        stage = following
        yield stage
        if any(fault.fault == FORCE_NOISE for fault in stage.faults[len(before) :]):
            break  # which is said where nothing else is found


def _next(stage: SearchStage, asked: Sequence[Asked]) -> SearchStage | None:
    """The stage with one fault more; None if there is none."""
    found = [(f.fault, f.channel) for f in stage.faults]
    open_ones = [one for one in asked if one not in found or one[0] in (HUM, SPIKES)]
    plain = _plain(stage, open_ones, len(asked))
    if plain is not None or all(name in UNLIKE_PHYSICS for name, _ in asked):
        return plain
    tied = [(f.fault, f.channel) for f in stage.faults if f.rivals]
    return _contested(stage, [one for one in open_ones if one not in tied], len(asked))


def _plain(stage: SearchStage, open_ones: Sequence[Asked], asked: int) -> SearchStage | None:
    """One fault more of those that no physics imitates: drop-outs, spikes, drift, and hum of the mains."""
    for name, looked_for in ((DROP_OUTS, drop_outs), (SPIKES, spikes), (DRIFT, drift), (HUM, hum)):
        for sensor in stage.rich.sensors:
            fault = looked_for(sensor, asked) if (name, sensor.channel) in open_ones else None
            if fault is not None and (name != HUM or is_of_the_mains(fault.frequency, sensor)):
                return stage.without(_merged(stage.faults, fault))
    return None


def _merged(faults: Sequence[Fault], more: Fault) -> Fault:
    """A fault with what was found of it before: spikes hide smaller ones."""
    spiky = (f for f in faults if f.fault == more.fault == SPIKES and f.channel == more.channel)
    before = next(spiky, None)
    if before is None or before.lost is None or more.lost is None:
        return more
    error = float(np.hypot(before.error, more.error))
    return replace(before, value=before.value + more.value, error=error, lost=before.lost | more.lost)


def _contested(stage: SearchStage, open_ones: Sequence[Asked], asked: int) -> SearchStage | None:
    """One fault more of those that have a look-alike in the library, or one effect more that the record asks for.

    A structure has many effects at many places: without a fault in sight, which sensors tell from effects where a
    single one may not, none of them is searched for.
    """
    best = _best(stage.rich, [(n, channel) for n, channel in open_ones if n in (*HOLDABLE, HUM)], asked)
    alone, more = len(stage.rich.fit.model.coordinates) == 1, len(stage.effects) < EFFECTS

    def of_physics() -> tuple[bool, FittedResidual | None]:
        """Whether an effect is asked for whatever becomes of the fault, and that effect."""
        sure = more and alone and asks_for_more(stage.rich)
        return sure, stage.rich.missing if sure else None

    one, (sure, effect) = two_at_once(
        lambda: None if best is None else refined(best, stage.given, stage.faults, stage.rich), of_physics
    )
    if one is not None and one.fault.error > 0.0:  # chance alone may give such a value, so many having been asked for
        t = abs(one.fault.value) / one.fault.error
        one = None if 2.0 * float(ndtr(-t)) * asked >= ALPHA else one
    if one is not None and more and not sure:
        effect = stage.rich.missing
    if one is None:
        return _noisy_force(stage, open_ones, asked) if effect is None else _beside(effect, stage)
    if effect is None:
        return _accepted(stage, one)
    hums = one.fault.fault == HUM
    columns = _line(one.fault, effect) if hums else fault_columns(one.fault.fault, one.fault.channel, effect)
    fault_needed, both = share(effect, columns, leading=not hums), left_again(effect, one.left.prepared)
    needed = (
        fault_needed is not None and fault_needed.significant(asked),
        both is not None and leaves_less(one.left, both, 1),
    )
    if needed == (False, False):
        return _tied(stage, one, effect)
    if needed == (False, True) or (all(needed) and effect.relative_power < one.left.relative_power):
        return _beside(effect, stage)
    return _accepted(stage, one)


def _line(fault: Fault, left: FittedResidual) -> Columns:
    sensor = left.of(fault.channel)
    return sensor.stacked(line(fault.frequency, sensor))


def _noisy_force(stage: SearchStage, open_ones: Sequence[Asked], asked: int) -> SearchStage | None:
    """The stage with noise on a force, which is said of what no effect explains; None if it is not seen or known.

    Of several forces on the one where it is most likely: noise on one of them looks much like noise on another.
    """
    known = any(fault.fault == FORCE_NOISE for fault in stage.faults)
    forces = [] if known else [channel for name, channel in open_ones if name == FORCE_NOISE]
    if not forces or force_noise(stage.rich, forces, asked, repeats=1) is None:
        return None
    fit = stage.rich.fit
    if len(fit.model.coordinates) > 1:  # whose many effects at many places take long to be searched for
        lost = not fit.converged or fit.undecided
        if lost or significant_share(left_by(fit, stage.rich.prepared), ALPHA) > OF_MOTION:
            return None
    # What an integration in few steps leaves is shaped by the structure too.
    left = leftover(settled(stage.rich.fit, stage.rich.prepared), stage.rich.prepared)
    noise = None if left is None else force_noise(left, forces, asked)
    if noise is None:
        return None
    effect = stage.rich.missing if len(stage.effects) < EFFECTS else None
    return replace(stage, faults=(*stage.faults, noise)) if effect is None else _beside(effect, stage)


def _best(left: FittedResidual, open_ones: Sequence[Asked], asked: int) -> Asked | None:
    """The fault that explains most of what is left, and that not by chance; None without any."""
    power: dict[Asked, float] = {}
    for name, channel in open_ones:
        if name == HUM:
            fault = hum(left.of(channel), asked)
            if fault is not None:
                power[name, channel] = fault.explained * float(np.mean(left.residual[1] ** 2)) / left.size**2
            continue
        found = share(left, fault_columns(name, channel, left), leading=True)
        if found is not None and found.significant(asked) and sensible(name, float(found.amounts[0]), left):
            power[name, channel] = found.power
    return max(power, key=lambda one: power[one], default=None)


def _accepted(stage: SearchStage, one: Refined) -> SearchStage | None:
    """The stage with a fault corrected.

    An effect that imitated the fault is no longer needed then; the value is found again without it.
    """
    following = stage.without(_explaining(one.fault, stage.rich, one.left))
    if following is None or len(following.effects) == len(stage.effects) or one.fault.fault == HUM:
        return following
    asked = one.fault.fault, one.fault.channel
    again = refined(asked, stage.given, stage.faults, following.rich, one.fault.value)
    return following if again is None else stage.without(_explaining(again.fault, stage.rich, again.left))


def _beside(effect: FittedResidual, stage: SearchStage) -> SearchStage:
    """The stage with an effect more, and the values of its faults found again beside it: its lack has moved them."""
    return _values_again(replace(stage, rich=effect))


def _explaining(fault: Fault, before: FittedResidual, after: FittedResidual) -> Fault:
    return replace(fault, explained=gained(before, after).explained)


def _tied(stage: SearchStage, one: Refined, effect: FittedResidual) -> SearchStage | None:
    """What becomes of a fault and an effect neither of which is needed beside the other: the fault is mentioned.

    Not so beside an effect that is none, as a Maxwell element of negative stiffness, which hastens what is late.
    """
    if unphysical(effect, stage.rich) or (one.fault.fault == HUM and _beyond_reason(stage, effect)):
        return _accepted(stage, one)
    if one.fault.fault == OFFSET and any(f.fault == DRIFT and f.channel == one.fault.channel for f in stage.faults):
        return _accepted(stage, one)  # a channel that drifts has no zero of its own
    fault = replace(_explaining(one.fault, stage.rich, one.left), rivals=tuple(effects_beside(effect, stage.rich)))
    return replace(stage, faults=(*stage.faults, fault), rich=effect)


def _beyond_reason(stage: SearchStage, effect: FittedResidual) -> bool:
    """Whether a harmonic force would have to be larger than the whole measured one."""
    values = effect.fit.model.numbers()
    harmonic = [e.symbols for e in effect.fit.model.terms if len(e.symbols) == 2]  # a force of any phase
    record = stage.given.record
    largest = float(np.max(np.abs(record.columns(record.forces, stage.given.plan.fit))))
    return any(math.hypot(*(values[s] for s in symbols)) > largest for symbols in harmonic)


def _needed(stage: SearchStage, asked: int, begun: Sequence[Fault]) -> SearchStage:
    """Without the faults that the effects found after them have made needless; ``begun`` were known from the start."""
    for fault in stage.faults:
        if fault.fault in (*HOLDABLE, DRIFT) and fault.corrected and not fault.held:
            stage = _without_needless(fault, stage, asked, begun) or stage
    return stage


def _without_needless(fault: Fault, stage: SearchStage, asked: int, begun: Sequence[Fault]) -> SearchStage | None:
    """The stage without a fault that shows no more beside its effects; None if it is needed."""
    others = tuple(f for f in stage.faults if f is not fault)
    prepared = corrected(stage.given, others)
    left, rich = stage.again(prepared)
    if left is None or rich is None:
        return None
    # Where a model loses the motion without a correction, what a little of the fault would do tells nothing.
    known = (fault.fault, fault.channel) in [(f.fault, f.channel) for f in begun]
    if known and is_poor(rich.fit, prepared.fitted) and leaves_less(rich, stage.rich, asked):
        return None
    if fault.fault == DRIFT:
        seen = drift(rich.of(fault.channel), asked) is not None
    else:
        needed = share(rich, fault_columns(fault.fault, fault.channel, rich), leading=True)
        seen = needed is not None and needed.significant(asked)
    return None if seen else SearchStage(stage.given, others, left, rich)


def refined(
    asked: Asked, given: Prepared, faults: Sequence[Fault], left: FittedResidual, value: float = 0.0
) -> Refined | None:  # fmt: skip
    """Search a fault's value by correcting the record, fitting the model again and correcting what is left of it.

    ``faults`` are those that ``left`` is corrected for already, besides this one with ``value``. None where the search
    leaves what is sensible, or the model does not run.
    """
    with suppress(DivergenceError):  # derivatives leave the range of numbers long before a chaotic motion does
        return _refined(asked, given, faults, left, value)
    return None


def _refined(
    asked: Asked, given: Prepared, faults: Sequence[Fault], left: FittedResidual, value: float
) -> Refined | None:  # fmt: skip
    name, channel = asked
    if name == HUM:
        line = hum(left.of(channel), 1)
        return None if line is None else _corrected(line, given, faults, left)
    before, unit = left, unit_of(name, given.record.units.get(channel, ""))
    if name == DELAY and value == 0.0:
        value, left = _coarse(channel, given, faults, left)
    for _ in range(GAUSS_NEWTON_STEPS):
        amounts, covariance = amounts_on_both(left, fault_columns(name, channel, left, value))
        step, error = float(amounts[0]), math.sqrt(max(float(covariance[0, 0]), 0.0))
        value += step
        if not sensible(name, value, left):
            return None
        one = _corrected(Fault(name, channel, value, error, unit), given, faults, left)
        if one is None:
            return None
        left = one.left
        if abs(step) <= REACHED * error:
            break
    if left.relative_power >= before.relative_power:
        return None
    explained = gained(before, left).explained
    found = one.fault  # pyright: ignore[reportPossiblyUnboundVariable]
    error = math.hypot(found.error, TOLERANCE * found.value)  # the model and its integration are no nearer than that
    return Refined(replace(found, explained=explained, error=error), left)


def _coarse(
    channel: str, given: Prepared, faults: Sequence[Fault], left: FittedResidual
) -> tuple[float, FittedResidual]:  # fmt: skip
    """Where the search for a delay begins: at zero, or at the best of some whole samples if it is more than a part.

    A model that is fitted to a record late by a good part of a period finds a minimum of its own.
    """
    step = float(amounts_on_both(left, fault_columns(DELAY, channel, left))[0][0])
    best = 0.0, left
    far = FAR_APART if abs(step) > 0.5 else ()
    late_by = side_by_side(lambda x: left_again(left, corrected(given, (*faults, Fault(DELAY, channel, x)))), far)
    for late, tried in zip(far, late_by, strict=True):
        if tried is not None and tried.relative_power < best[1].relative_power:
            best = late, tried
    return best


def _corrected(fault: Fault, given: Prepared, faults: Sequence[Fault], left: FittedResidual) -> Refined | None:
    """A fault of this value, and what the model leaves when it is corrected."""
    again = left_again(left, corrected(given, (*faults, fault)))
    if again is None or fault.fault != HIGH_PASS:
        return None if again is None else Refined(fault, again)
    # What a coupling has taken away below its cut-off cannot come back: only noise would.
    length = len(given.record) * given.dt
    sensor = again.of(fault.channel)
    slow = slow_part(sensor, int(np.ceil(2.0 * fault.value * length)))
    whole = replace(fault, waveform=slow + float(np.mean(sensor.both)))
    final = left_again(again, corrected(given, (*faults, whole)))
    return None if final is None else Refined(whole, final)
