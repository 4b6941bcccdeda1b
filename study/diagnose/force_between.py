"""What a force does between its samples, before an effect is called missing.

A force is known at its samples. Read as band-limited, which a measured one is behind its filter, one that a program has
made straight or held between them leaves an error that grows with the square of frequency over sampling rate: a few
samples a period make it look like relaxation, and a resonance above the Nyquist frequency is driven by nothing else.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from study.compare.comparison import Comparison, compare
from study.compare.prediction import predict
from study.diagnose.candidates import Progress
from study.diagnose.held_values import diagnose_with_values_let_go
from study.diagnose.verdict import NOTHING, Diagnosis, Otherwise, search_part
from study.equations.terms import Term
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.rivals import larger
from study.records.interpolation import BAND_LIMITED, BETWEEN_SAMPLES, WORDS
from study.records.prepared import Prepared
from study.records.sampling_rate import without_spare_samples
from study.support.errors import StudyError
from study.support.numbers import percent


def diagnose_as_read(
    comparison: Comparison,
    *,
    extra: Sequence[Term] = (),
    without: Sequence[str] = (),
    progress: Progress | None = None,
    otherwise: Otherwise | None = None,
) -> Diagnosis:
    """The diagnosis of :func:`diagnose_with_values_let_go`, unless another reading of the force explains it all.

    That reading must leave significantly less than the band-limited one and less than the best candidate does, and
    nothing may be missing with it: then the diagnosis is that of the record as it is read then, and its notes say so.
    """
    diagnosed = partial(
        diagnose_with_values_let_go, extra=extra, without=without, progress=progress, otherwise=otherwise
    )
    found = diagnosed(comparison)
    known = _sampled(comparison).record.between != BAND_LIMITED  # by what it does to the response
    if known or found.verdict == NOTHING or comparison.fit.restarts or not comparison.fit.keys:
        return found
    best = min((row.response_error for row in found.candidates), default=comparison.prediction.error)
    for prepared in _better_read(comparison, min(best, comparison.prediction.error)):
        other = diagnosed(compare(comparison.model, prepared))
        if other.verdict == NOTHING:
            return other
    return found


def _better_read(comparison: Comparison, best: float) -> Iterator[Prepared]:
    """The record under the other readings that leave less than ``best`` and significantly less than the present one.

    A reading that moves the response by less than what is unexplained cannot explain it, and is not fitted. The fit
    begins from nothing: what was fitted under a wrong reading may be far from the truth.
    """
    now, sampled = comparison.prediction, _sampled(comparison)
    for reading in (name for name in BETWEEN_SAMPLES if name != sampled.record.between):
        record = replace(sampled.record, between=reading)
        other = replace(sampled, record=record, notes=(*sampled.notes, _note(reading, comparison)))
        other = without_spare_samples(other) if comparison.prepared.as_sampled else other
        try:
            moved = predict(comparison.fit, other).residual - now.residual
            if np.std(moved) < np.std(now.residual):
                continue
            again = predict(fit_model(comparison.model, search_part(other)), other)
        except StudyError:
            continue
        if again.error < best and larger(now.residual, again.residual):
            yield other


def _sampled(comparison: Comparison) -> Prepared:
    """The record with all of its samples: what the force does between those that are kept, a filter has seen to."""
    return comparison.prepared.as_sampled or comparison.prepared


def _note(reading: str, comparison: Comparison) -> str:
    error = percent(comparison.prediction.error)
    return f"the force {WORDS[reading]}: read as band-limited, as a measured one is, it leaves {error} of the response"


def reading_in_words(comparison: Comparison) -> str:
    """A sentence on how the force is read, empty where it is band-limited."""
    said = WORDS.get(_sampled(comparison).record.between, "")
    note = next((note for note in comparison.notes if said and said in note), "")
    return f"{note[0].upper()}{note[1:]}." if note else ""
