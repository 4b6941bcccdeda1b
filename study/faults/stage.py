"""Where a search for faults stands: what was found, and the model fitted to the record without it."""

from dataclasses import dataclass, replace

import numpy as np

from study.faults import physics
from study.faults.correction import corrected
from study.faults.fault import SPIKES, Fault
from study.faults.leftover import FittedResidual, leaves_less, leftover
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.prepared import Prepared, limited

SHORT, LONG = 8192, 16384  # samples of either part in which faults compete with physics


def searched_part(given: Prepared) -> Prepared:
    """As much of either part of a record as a search for faults that compete with physics takes."""
    return limited(given, int(np.clip(given.samples_in(physics.PERIODS), SHORT, LONG)))


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
        return [e.name for e in self.rich.fit.model.terms if e.name not in self.left.fit.model]

    def named(self, fault: Fault) -> "SearchStage":
        """The stage with a fault that nothing is corrected for."""
        return replace(self, faults=(*self.faults, fault))

    def without(self, *faults: Fault) -> "SearchStage | None":
        """The stage with these faults corrected; None where a model does not run any more."""
        known = (*(f for f in self.faults if f.fault not in [g.fault for g in faults if f.fault == SPIKES]), *faults)
        prepared = corrected(self.given, known)
        left, rich = (fitted_again(one, prepared) for one in (self.left, self.rich))
        return None if left is None or rich is None else SearchStage(self.given, known, left, _pruned(rich, left))


@dataclass(frozen=True, eq=False)
class SearchEnd:
    """Where a search for faults has ended.

    Attributes
    ----------
    faults : tuple of Fault
        Those that were known and those that were found.
    fit : FreeRunFit
        The model fitted to the corrected record; it searches no further than from where it began.
    rich : FreeRunFit
        The model with the effects that the record asks for beside the faults.
    """

    faults: tuple[Fault, ...]
    fit: FreeRunFit
    rich: FreeRunFit


def _pruned(rich: FittedResidual, left: FittedResidual) -> FittedResidual:
    """Without the effects that the corrected record no longer asks for, the last one first."""
    for name in reversed([e.name for e in rich.fit.model.terms if e.name not in left.fit.model]):
        fit = physics.without_effect(rich.fit, name, rich.prepared)
        fewer = None if fit is None else leftover(fit, rich.prepared)
        if fewer is not None and not leaves_less(fewer, rich, 1):
            rich = fewer
    return left if len(rich.fit.model.terms) == len(left.fit.model.terms) else rich


def fitted_again(left: FittedResidual, prepared: Prepared) -> FittedResidual | None:
    """A model fitted again to a record that was corrected."""
    fit = physics.refitted(left.fit, prepared)
    return None if fit is None else leftover(fit, prepared)
