"""A comparison with the faults of the measurement accounted for: compare, find, correct, compare again."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from study.compare.by_estimator import FREE_RUN
from study.compare.comparison import Comparison, compare
from study.equations.model import Model
from study.faults.correction import corrected, fault_columns, unit_of
from study.faults.fault import ALL_SENSORS, DELAY, DRIFT, FAULTS, FORCE_NOISE, OFFSET, Fault, Held
from study.faults.force_noise import force_noise
from study.faults.leftover import amounts_on_both, gained, leaves_less, leftover, refitted, share
from study.faults.search import (
    FAR_APART,
    UNLIKE_PHYSICS,
    Asked,
    Refined,
    SearchEnd,
    asked_of,
    first_faults,
    held_in,
    refined,
    search_faults,
    searched_part,
)
from study.faults.seen_in_residual import mean_response, slow_response
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.motion_start import delay_along_the_motion, has_lost_the_motion, seen_everywhere
from study.identify.time_domain.promised_changes import promised_changes
from study.identify.time_domain.settling import settled
from study.identify.time_domain.stretch_states import is_poor
from study.records.interpolation import BAND_LIMITED, WORDS
from study.records.prepared import FORCE, Prepared
from study.records.sampling_rate import too_coarse, without_spare_samples
from study.support import work
from study.support.errors import DivergenceError, StudyError
from study.support.thresholds import TOLERANCE

OF_THE_MOTION = (DRIFT, OFFSET, FORCE_NOISE)  # of which a model that has lost the motion tells nothing
NOT_ASKED_OF_MODES = "faults of the measurement are not looked for beside 'linear: modal'"
PUT_OFF = (
    "a coefficient seems to change along the record, as many faults of the measurement make it seem: 'study diagnose' "
    "tries both"
)
NOT_ASKED = "faults of the measurement were not looked for: that takes a driven record in one piece, without --use"


@dataclass(frozen=True, eq=False)
class Accounted:
    """A comparison with the corrected record, and the faults that it is corrected for."""

    comparison: Comparison
    faults: tuple[Fault, ...]
    given: Prepared  # the record as it was before any correction
    known: Held  # values of faults that the user gave
    switched_off: tuple[str, ...]  # faults that are not looked for
    as_sampled: bool  # whether all samples are used
    put_off: bool = False  # whether faults that a change of a coefficient looks like are yet to be looked for
    operations: int = 0  # that the search for them took
    unread: Prepared | None = None  # the record as it was given, where the model told that its force is held

    @property
    def work_left(self) -> float:
        """Operations that a diagnosis of it may take."""
        return work.most_for(len(self.given.record)) - self.operations

    @classmethod
    def as_compared(cls, comparison: Comparison) -> "Accounted":
        """A comparison with a record that is taken as it is: no faults are looked for."""
        return cls(comparison, (), comparison.prepared, {}, tuple(FAULTS), as_sampled=True)

    def faults_beside(self, fit: FreeRunFit, model: Model) -> "tuple[Fault, ...]":
        """The faults that the record shows beside a fuller model, which begins at a fit of it."""
        return _corrected(model, self.given, self.known, self.switched_off, self.as_sampled, near=fit).faults

    def with_all_faults(self) -> "Accounted":
        """The same with the faults looked for that were put off."""
        model, known, off = self.comparison.model, self.known, self.switched_off
        return _accounted(model, self.given, known, off, FREE_RUN, None, self.as_sampled, changes=False)

    def beside(self, model: Model) -> "Accounted":
        """The same of another model, with the faults that the record shows beside it."""
        known, off = self.known, self.switched_off
        return _accounted(model, self.given, known, off, FREE_RUN, None, self.as_sampled, changes=True)

    def read_as_given(self) -> "Accounted":
        """The same of the record with its force read as it was before the model told how."""
        return self if self.unread is None else replace(self, given=self.unread, unread=None)

    def corrected_for(self, faults: Sequence[Fault]) -> "Accounted":
        """The comparison of the same model with the record corrected for other faults."""
        prepared = _needed(self.as_sampled)(corrected(self.given, faults))
        prepared = replace(prepared, notes=(*prepared.notes, *(fault.note for fault in faults)))
        return replace(self, comparison=compare(self.comparison.model, prepared), faults=tuple(faults))


@dataclass(frozen=True, eq=False)
class _Corrected:
    """A record corrected for the faults that a search has found."""

    prepared: Prepared  # without the samples that its motion does not ask for
    faults: tuple[Fault, ...]
    fit: FreeRunFit | None  # of the model to it, where there is one
    given: Prepared  # the record before that, with what is said of it
    put_off: bool = False  # whether only faults were looked for that no change of a coefficient looks like
    unread: Prepared | None = None  # as ``given``, before its force was read as held


def _needed(as_sampled: bool) -> Callable[[Prepared], Prepared]:
    """What leaves of a record the samples that are used: all of them, or those that its motion asks for."""
    return (lambda whole: whole) if as_sampled else without_spare_samples


def accounted(
    model: Model,
    prepared: Prepared,
    *,
    held: Held | None = None,
    switched_off: Sequence[str] = (),
    estimator: str = FREE_RUN,
    progress: Callable[[str], None] | None = None,
    as_sampled: bool = False,
) -> Accounted:
    """Compare a model with a record, the faults of the measurement accounted for.

    Faults are looked for in the record as it was sampled, and the corrected record is then compared without the samples
    that its motion does not ask for (:mod:`study.records.sampling_rate`).

    Parameters
    ----------
    model, prepared, estimator, progress
        As for :func:`study.compare.comparison.compare`.
    held : mapping of float, or of mappings of float by channel
        Values of faults (of ``HOLDABLE``) that are known; they are corrected and not searched for.
    switched_off : sequence of str
        Faults that are not looked for.
    as_sampled : bool
        Whether all samples are used, whether the motion asks for them or not.

    Returns
    -------
    Accounted
        A record without faults is compared as it is.

    Raises
    ------
    StudyError
        If the model cannot be fitted.
    """
    return _accounted(model, prepared, held or {}, switched_off, estimator, progress, as_sampled, changes=True)


def _accounted(
    model: Model, prepared: Prepared, known: Held, switched_off: Sequence[str], estimator: str,
    progress: Callable[[str], None] | None, as_sampled: bool, *, changes: bool,
) -> Accounted:  # fmt: skip
    with work.limited_to(work.most_for(len(prepared.record)) / 2.0):  # the other half is for what is missing
        found = _corrected(model, prepared, known, switched_off, as_sampled, changes=changes)
        ready = replace(found.prepared, notes=(*found.prepared.notes, PUT_OFF)) if found.put_off else found.prepared
        comparison = _compared(model, ready, found.faults, found.fit, estimator, progress)
        if work.is_done():
            said = f"the search for faults of the measurement was ended {work.ENDED}"
            comparison = replace(comparison, notes=(*comparison.notes, said))
        operations = work.done()
    off = tuple(switched_off)
    return Accounted(
        comparison, found.faults, found.given, known, off, as_sampled, found.put_off, operations, found.unread
    )  # fmt: skip


def _corrected(
    model: Model, prepared: Prepared, known: Held, switched_off: Sequence[str], as_sampled: bool,
    near: FreeRunFit | None = None, *, changes: bool = False,
) -> _Corrected:  # fmt: skip
    """The record corrected for what is known and found of its faults; ``near`` is a fit where the search begins.

    Where coefficients may change along the record (if ``changes`` are asked for), what looks like that is put off.
    """
    given, begin = held_in(prepared, known), None
    if near is not None:
        values = near.model.numbers()
        begin = {key: values[key] for key, value in model.values.items() if value is None}

    asked = asked_of(prepared, [name for name in FAULTS if name not in switched_off], given)
    # A record shows faults by what it leaves of a driven response; they pass through no joint of stretches.
    if asked and (prepared.record.stretches or prepared.free or prepared.response == FORCE or model.modal):
        said = NOT_ASKED_OF_MODES if model.modal else NOT_ASKED
        asked, prepared = (), replace(prepared, notes=(*prepared.notes, said))
    coarse = too_coarse(prepared)
    prepared = replace(prepared, notes=(*prepared.notes, coarse)) if coarse else prepared
    needed = _needed(as_sampled)
    faults = first_faults(prepared, given, asked) if given or asked else ()
    first = corrected(prepared, faults)
    fewer = needed(first)
    if not asked:
        return _Corrected(fewer, faults, None, prepared)
    late: Refined | None = None
    put_off = False
    try:
        fit = fit_model(model, fewer, begin)
    except StudyError:  # forces and motion too far apart in time let a structure escape
        late = _late_response(model, prepared, None, faults, asked, needed)
        if late is None:
            raise
        fit = late.left.fit
        begun = (*faults, late.fault)
        end = search_faults(prepared, _on_all(fit, corrected(prepared, begun)), begun, asked)
    else:
        lost = has_lost_the_motion(fit, fewer)
        told = tuple(one for one in asked if not (lost and one[0] in OF_THE_MOTION))
        promised = promised_changes(fit, fewer, fit.model.terms) if changes and not lost else None
        put_off = promised is not None and promised.alone
        if put_off:
            told = tuple(one for one in told if one[0] in UNLIKE_PHYSICS)
        end = search_faults(prepared, fit if fewer is first else _on_all(fit, first), faults, told)
        if not (put_off or work.is_done()):
            end = _beneath_too(model, prepared, fit, faults, asked, end)
        if not (put_off or work.is_done()) and DELAY not in [fault.fault for fault in end.faults]:
            late = _late_response(model, prepared, fit, faults, asked, needed)
        if late is not None:
            end = _begun_late(late.fault, late.left.fit, prepared, faults, asked, end)
    if end.faults == faults:
        return _Corrected(fewer, end.faults, fit, prepared, put_off)
    read, end = _read_as_held(prepared, end)
    final = corrected(read, end.faults)
    kept = needed(final)
    best = _fitted(model, kept, end.fit if kept is final else _on_all(end.fit, kept))
    return _Corrected(kept, end.faults, best, read, put_off, prepared if read is not prepared else None)


def _read_as_held(prepared: Prepared, end: SearchEnd) -> tuple[Prepared, SearchEnd]:
    """The record with its force held from each sample to the next, where that does what a delay was found to do.

    A hold makes a force late by half a sample, and so all responses to it, by less than a sample whatever noise adds.
    A delay stands where it leaves less by no chance, or one is seen beside the hold as well. Where the record cannot
    tell, nothing is said against the sensors.
    """
    sensors = [str(sensor) for sensor in prepared.outputs.sensors]
    everywhere = ALL_SENSORS if len(sensors) > 1 else sensors[0]
    late = next(
        (f for f in end.faults if f.fault == DELAY and f.channel == everywhere and f.corrected and not f.held), None
    )
    if late is None or not 0.0 < late.value < 1.0 or prepared.record.between != BAND_LIMITED:
        return prepared, end
    others = tuple(fault for fault in end.faults if fault is not late)
    said = f"the force {WORDS['held']}: read as band-limited, the response would be late by {late.value:.3g} samples"
    read = replace(
        prepared, record=replace(prepared.record, between="held"), notes=(*prepared.notes, said),
    )  # fmt: skip
    before, now = leftover(end.rich, corrected(prepared, end.faults)), corrected(read, others)
    fit, rich = (refitted(one, now) for one in (end.fit, end.rich))
    after = None if rich is None else leftover(rich, now)
    if before is None or fit is None or rich is None or after is None or leaves_less(after, before, 1):
        return prepared, end
    more = share(after, fault_columns(DELAY, everywhere, after), leading=True)
    if more is not None and more.significant(1):
        return prepared, end
    return read, SearchEnd(others, fit, rich)


def _beneath_too(
    model: Model, prepared: Prepared, fit: FreeRunFit, faults: Sequence[Fault], asked: Sequence[Asked],
    plain: SearchEnd,
) -> SearchEnd:  # fmt: skip
    """The better end of two searches for faults: the plain one, and one that a drift or an offset cannot lead astray.

    The second begins with the model fitted to the responses without what may lie beneath them: their slowest lines, or
    their means where a fit is lost. Where the plain one leaves noise alone there is nothing that it could find.
    """
    left = leftover(plain.fit, corrected(prepared, plain.faults))
    if left is not None and left.prediction.above_noise <= TOLERANCE:
        return plain
    first = corrected(prepared, faults)
    drifting, offset = ([channel for name, channel in asked if name == one] for one in (DRIFT, OFFSET))
    begin = [fault for channel in drifting if (fault := slow_response(first, channel, len(asked))) is not None]
    if not begin and offset and (not fit.converged or has_lost_the_motion(fit, first)):
        begin = [mean_response(first, channel) for channel in offset]
    if not begin:
        return plain
    beneath = corrected(prepared, (*faults, *begin))
    try:
        begun = fit_model(model, beneath)
    except StudyError:
        return plain
    if has_lost_the_motion(begun, beneath):
        return plain
    under = {fault.channel: fault.waveform for fault in begin if fault.waveform is not None}
    none = np.zeros(len(prepared.record))
    columns = np.stack([under.get(str(sensor), none) for sensor in begun.outputs.sensors], axis=1)
    whole = replace(begun, residual=begun.residual + begun.outputs.stacked(columns[slice(*begun.span)]))  # as it is
    other = search_faults(prepared, whole, faults, asked, before=plain)
    begun_with = other is not plain and any(fault.fault in (DRIFT, OFFSET) for fault in other.faults)
    return other if begun_with and _leaves_less(prepared, plain, other, "fit") else plain


def _late_response(
    model: Model, prepared: Prepared, fit: FreeRunFit | None, faults: Sequence[Fault], asked: Sequence[Asked],
    needed: Callable[[Prepared], Prepared],
) -> Refined | None:  # fmt: skip
    """A delay with which a model that had lost the motion follows it; None where it follows no better.

    ``fit`` is the model fitted without a delay to the record that is corrected for ``faults``, None where that has no
    finite motion; ``needed`` gives the samples that a fit asks for.
    """
    plain, channels = corrected(prepared, faults), [channel for name, channel in asked if name == DELAY]
    if not channels or (fit is not None and not is_poor(fit, needed(plain).fitted)):
        return None
    try:
        found = _best_late(model, prepared, fit, faults, channels, needed)
        if found is None:
            return None
        begin, begun = found
        follows = fit is None or fit.restarts or begun.rms < fit.rms  # segments follow anything, by their own states
        if begun.restarts or not follows:
            return None
        look = searched_part(prepared)
        late_too = corrected(look, (*faults, begin))
        left = leftover(_on_all(begun, late_too), late_too)
        if left is None:
            return None
        covariance = amounts_on_both(left, fault_columns(DELAY, begin.channel, left, begin.value))[1]
        error = math.hypot(math.sqrt(max(float(covariance[0, 0]), 0.0)), TOLERANCE * begin.value)
        right = Refined(replace(begin, error=error), left)  # where the search begins may be the very value
        return refined((DELAY, begin.channel), look, faults, left, begin.value) or right
    except StudyError:
        return None


def _best_late(
    model: Model, prepared: Prepared, fit: FreeRunFit | None, faults: Sequence[Fault], channels: Sequence[str],
    needed: Callable[[Prepared], Prepared],
) -> tuple[Fault, FreeRunFit] | None:  # fmt: skip
    """The delay with which a model follows best: of all motions, as their equations show it along what was measured.

    Of a structure that has lost the motion, or has no finite one, that of any channel. A model that lacks an effect is
    poor too, but follows the motion: then a delay shows in what it leaves.
    """
    plain = corrected(prepared, faults)
    several, lost = (
        len(model.coordinates) > 1,
        fit is None or not fit.converged or has_lost_the_motion(fit, needed(plain)),
    )
    seen, all_motions = fit is not None and seen_everywhere(model, prepared), ALL_SENSORS if several else channels[0]
    late = (
        delay_along_the_motion(fit.model, plain) if seen and fit is not None and all_motions in channels else math.nan
    )
    asked = [(all_motions, late)] if abs(late) > 0.0 else []
    asked += [(channel, late) for channel in channels for late in FAR_APART] if several and lost else []
    tried: list[tuple[Fault, FreeRunFit]] = []
    for channel, late in asked:
        begin = Fault(DELAY, channel, late, unit=unit_of(DELAY, ""))
        with suppress(StudyError):
            tried.append((begin, fit_model(model, needed(corrected(prepared, (*faults, begin))))))
    return min(tried, key=lambda one: one[1].rms, default=None)


def _begun_late(
    late: Fault, fit: FreeRunFit, prepared: Prepared, faults: Sequence[Fault], asked: Sequence[Asked], plain: SearchEnd
) -> SearchEnd:
    """The better end of two searches for faults, the other one of which begins with the response less late.

    A delay takes a part of what any missing effect leaves: it has to leave less beside the effects too.
    """
    without, less_late = leftover(plain.fit, corrected(prepared, plain.faults)), corrected(prepared, (*faults, late))
    try:
        following = _on_all(fit, less_late)
    except DivergenceError:  # what follows a part of the record may run away along all of it
        return plain
    left = leftover(following, less_late)
    if left is None:
        return plain
    explained = math.nan if without is None else gained(without, left).explained
    other = search_faults(prepared, following, (*faults, replace(late, explained=explained)), asked, before=plain)
    kept = any(fault.fault == DELAY for fault in other.faults)
    better = kept and all(_leaves_less(prepared, plain, other, which) for which in ("fit", "rich"))
    return other if better else plain


def _leaves_less(prepared: Prepared, plain: SearchEnd, other: SearchEnd, which: Literal["fit", "rich"]) -> bool:
    """Whether a model at the other end leaves less by no chance, or runs where that at the plain end does not."""
    before, after = (leftover(getattr(end, which), corrected(prepared, end.faults)) for end in (plain, other))
    return after is not None and (before is None or leaves_less(before, after, 1))


def _on_all(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """A fit to a record with other samples of the same motion, from the values where it stands."""
    values = fit.model.numbers()
    again = fit_model(fit.model.with_values(dict.fromkeys(fit.keys)), prepared, {key: values[key] for key in fit.keys})
    return replace(again, elsewhere=())


def _fitted(model: Model, prepared: Prepared, near: FreeRunFit) -> FreeRunFit:
    """The better of a fit from nothing and one from where the search for faults has ended."""
    close = settled(near, prepared)
    try:
        anew = fit_model(model, prepared)
    except StudyError:
        return close
    return anew if anew.rms <= close.rms * (1.0 + TOLERANCE) else close


def _compared(
    model: Model, prepared: Prepared, faults: tuple[Fault, ...], fit: FreeRunFit | None, estimator: str,
    progress: Callable[[str], None] | None,
) -> Comparison:  # fmt: skip
    """The comparison with a corrected record, which says so in its notes; ``fit`` is the fit to it, if there is one."""
    if faults:
        prepared = replace(prepared, notes=(*prepared.notes, *(fault.note for fault in faults)))
    again = fit if estimator == FREE_RUN else None
    return compare(model, prepared, search=again, estimator=estimator, progress=progress)


def still_seen(faults: Sequence[Fault], fit: FreeRunFit, prepared: Prepared) -> tuple[Fault, ...]:
    """The faults without noise on the force where a fuller model, fitted to the corrected record, shows none.

    What passes through the structure may be a force that the model lacked.
    """
    forces = [fault.channel for fault in faults if fault.fault == FORCE_NOISE]
    left = leftover(fit, prepared) if forces else None
    gone = left is not None and force_noise(left, forces, len(FAULTS)) is None
    return tuple(fault for fault in faults if not (gone and fault.fault == FORCE_NOISE))
