"""A term added to a fitted model: the fit begins where the candidate ended, and never ends worse.

Of a decay whose motion the model had lost without it, so that it began anew every few periods, it then runs on for as
long as the model with it follows: the error is that of the longer motion.
"""

from study.compare.comparison import Comparison, compare
from study.diagnose.ranked import Ranked
from study.diagnose.verdict import search_base
from study.equations.laid_variations import laid_entry
from study.equations.model import ModelTerm, free
from study.equations.terms import Term
from study.identify.time_domain.fit_model import with_term
from study.identify.time_domain.shape_search import baseline
from study.identify.time_domain.weighted_fit import finished
from study.way_in.compare_records import running_on


def added(comparison: Comparison, term: Term | ModelTerm) -> Comparison:
    """The comparison of the model with a term more, fitted as a diagnosis fits that candidate.

    Raises
    ------
    StudyError
        If the model with it has no finite response.
    """
    prepared = comparison.prepared
    entry = laid_entry(term if isinstance(term, ModelTerm) else free(term), prepared)
    # what changes along the record is seen in no part of it
    base = baseline(comparison.fit, prepared) if entry.term.variation else search_base(comparison)
    fit = finished(with_term(base, entry), prepared)
    return running_on(compare(comparison.model.with_term(entry), prepared, fit=fit))


def added_candidate(comparison: Comparison, candidate: Ranked) -> Comparison:
    """The comparison of the model with an effect or a set of its diagnosis, begun where the fit of that ended."""
    prepared, model = comparison.prepared, comparison.model
    if any(entry.term.variation for entry in candidate.entries):  # asked for where both parts see all of the record
        prepared = candidate.prediction.prepared
    for entry in candidate.entries:
        model = model.with_term(entry)
    return running_on(compare(model, prepared, fit=finished(candidate.fit, prepared)))
