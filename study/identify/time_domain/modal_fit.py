"""The fit of a model whose linear part is a sum of modes: as many as its record shows.

The state-space model of modes with the nonlinear forces fed back (Noel and Kerschen, Mechanical Systems and Signal
Processing 40, 2013) runs under the measured forces alone, so that noise on the sensors biases nothing. With each number
of modes it is a model as any other, fitted in free run (``part_fit``) from where the lines of the record have it.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from study.equations.free_run import needed_steps
from study.equations.modal_part import ModalPart
from study.equations.model import Model, ModelTerm
from study.identify.frequency_domain.modal_lines import line_fits
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part
from study.identify.time_domain.settling import settled
from study.records.prepared import Prepared
from study.support.errors import DivergenceError, StudyError
from study.support.thresholds import TOLERANCE

MODAL_RUNS, TRIAL_RUNS = 30, 6  # free runs of a search; of one with more modes, before it has to be the better
WORSE_IN_TURN = 2  # numbers of modes: more are not tried


def with_modal_term(
    fit: FreeRunFit, entry: ModelTerm, shapes: Sequence[Sequence[float]], prepared: Prepared, given: Collection[str]
) -> FreeRunFit:  # fmt: skip
    """A fitted model with a term more and as many modes as the record asks for then: the best from several ``shapes``.

    Fitted first with shape parameters that stand, those of the terms before as they were, then with all of them free
    but for what is ``given``. Along a gap or a dead band the misfit has kinks, and a local minimum between any two.

    Raises
    ------
    DivergenceError
        If the structure diverges from each of the shapes.
    """
    shaped = {key for key in (*fit.keys, *entry.keys) if "." in key and key not in given}
    opened = fit.model.with_values(dict.fromkeys(key for key in fit.keys if key not in shaped))
    before = replace(opened, modal=ModalPart(opened.coordinates))
    fits: list[FreeRunFit] = []
    for i, shape in enumerate(shapes):
        try:
            grown = modal_fit(before.with_term(replace(entry, parameters=tuple(shape))), prepared)
            if shaped:
                freed = _gone_on(grown, prepared, [key for key in grown.held if key not in shaped])
                grown = _at_minimum(settled(freed, prepared), prepared)
            fits.append(grown)
        except DivergenceError:
            if not fits and i == len(shapes) - 1:
                raise
    return min(fits, key=lambda found: found.rms)


def modal_fit(model: Model, prepared: Prepared) -> FreeRunFit:
    """The fit with as many modes as the Bayesian information criterion of the free run asks for, from one on.

    Damping couples them where it asks for that. Each is fitted with steps enough: what too coarse an integration leaves
    would else be taken for a mode. Values that the model gives are held, shape parameters among them.

    Raises
    ------
    StudyError
        If no sensor is where a force acts, a term's place has none, or the record shows no mode.
    """
    best: FreeRunFit | None = None
    worse = 0
    for lines in line_fits(model, prepared):
        worse += 1
        if worse > WORSE_IN_TURN:
            break
        begun = lines.model.with_values({key: model.values[key] for key in model.held_keys})
        held = (*model.held_keys, *lines.modal.coupling)
        try:
            steps = needed_steps(begun, prepared.record, prepared.outputs)
            fit = fit_part(begun, prepared, held, steps=steps, max_iterations=TRIAL_RUNS)
        except DivergenceError:
            continue
        if best is None or _criterion(fit) < _criterion(best):
            fit = fit if fit.converged else _gone_on(fit, prepared, held, TRIAL_RUNS)
            best, worse = settled(fit, prepared), 0
    if best is None:
        raise StudyError(f"forces and motions of {prepared.record.name!r} show no mode in the band that is driven")
    best = _at_minimum(best, prepared)
    if set(best.held) == set(model.held_keys):  # of a single mode
        return best
    coupled = _gone_on(best, prepared, model.held_keys)
    return coupled if _criterion(coupled) < _criterion(best) else best


def _at_minimum(fit: FreeRunFit, prepared: Prepared) -> FreeRunFit:
    """A fit with steps enough that has converged, or gone on with leaves as much as before."""
    while not fit.converged:
        before, fit = fit, settled(_gone_on(fit, prepared, fit.held), prepared)
        if fit.rms > (1.0 - TOLERANCE) * before.rms:
            break
    return fit


def _gone_on(fit: FreeRunFit, prepared: Prepared, held: Collection[str], trials: int = MODAL_RUNS) -> FreeRunFit:
    """A fit gone on with from where it ended, with other keys held."""
    initial = np.atleast_2d(fit.initial)
    return fit_part(fit.model, prepared, held, steps=fit.steps_per_sample, initial=initial, max_iterations=trials)


def _criterion(fit: FreeRunFit) -> float:
    """The Bayesian information criterion for white noise in proportion to each sensor (Schwarz, 1978)."""
    count = len(fit.residual)
    return count * float(np.log(np.mean(fit.residual**2))) + (len(fit.keys) + fit.initial.size) * float(np.log(count))
