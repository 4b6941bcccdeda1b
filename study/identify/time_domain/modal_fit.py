"""The fit of a model whose linear part is a sum of modes: as many as its record shows.

The state-space model of modes with the nonlinear forces fed back (Noel and Kerschen, Mechanical Systems and Signal
Processing 40, 2013) runs under the measured forces alone, so that noise on the sensors biases nothing. With each number
of modes it is a model as any other, fitted in free run (``part_fit``) from where the lines of the record have it.
"""

from collections.abc import Collection
from contextlib import suppress
from dataclasses import replace

import numpy as np

from study.equations.free_run import needed_steps
from study.equations.model import Model, ModelTerm
from study.identify.frequency_domain.modal_lines import line_fits
from study.identify.frequency_domain.modal_screening import screened_by_lines
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import fit_part
from study.identify.time_domain.settling import settled
from study.records.prepared import Prepared
from study.support.errors import DivergenceError, StudyError, expect
from study.support.thresholds import TOLERANCE

TRIALS, TRIED = 30, 6  # free runs of a search; of one with more modes, before it has to be the better
PATIENCE = 2  # numbers of modes in turn that are no better: more are not tried
ASIDE = (0.9, 0.95, 1.05, 1.1)  # of a shape parameter: where fits begin beside what the screening found


def modal_fit(model: Model, prepared: Prepared) -> FreeRunFit:
    """Modes and what the terms leave open from the fitting part; values that the model gives are held.

    Terms with an open shape parameter are searched for along the lines of the record, one beside those before.

    Raises
    ------
    StudyError
        If no sensor is where a force acts, a term's place has none, or the record shows no mode.
    """
    unknown = [t for t in model.terms if None in t.parameters]
    known = replace(model, terms=tuple(t for t in model.terms if t not in unknown))
    fit = _of_as_many_modes(known, prepared)
    for entry in unknown:
        found = screened_by_lines(known, prepared, [entry], fit)
        expect(found, f"{entry.name} explains nothing of {prepared.record.name!r}; expected an effect that does")
        fit, known = _beside_minima(known, found[0].entry, entry, prepared), known.with_term(entry)
        known = known.with_values({k: fit.model.values[k] for k in entry.keys[len(entry.symbols) :]})
    return fit


def _beside_minima(known: Model, entry: ModelTerm, given: ModelTerm, prepared: Prepared) -> FreeRunFit:
    """The best of fits from the shape that the screening found and from shapes a little aside; what is given is held.

    Along a gap or a dead band the misfit has kinks, and a local minimum between any two.
    """
    fits: list[FreeRunFit] = []
    for factor in (1.0, *ASIDE):
        shape = {key: factor * (entry.values[key] or 0.0) for key in entry.keys[len(entry.symbols) :]}
        held = {key: value for key, value in given.values.items() if value is not None}
        with suppress(DivergenceError):
            fits.append(with_modal_term(known, entry.with_values(shape | held), prepared, tuple(held)))
    expect(fits, f"no values of {entry.name} let it follow {prepared.record.name!r}; expected them in the model file")
    return min(fits, key=lambda fit: fit.rms)


def with_modal_term(
    model: Model, entry: ModelTerm, prepared: Prepared, given: Collection[str] = ()
) -> FreeRunFit:  # fmt: skip
    """A model with a term more, whose shape parameters have values: fitted with these, then with them free.

    Those that are ``given`` stay held.

    Raises
    ------
    StudyError
        As :func:`modal_fit`.
    DivergenceError
        If the structure diverges from there.
    """
    fit = _of_as_many_modes(model.with_term(entry), prepared)
    shapes = [key for key in entry.keys[len(entry.symbols) :] if key not in given]
    if not shapes:
        return fit
    held = [key for key in fit.held if key not in shapes]
    return _at_minimum(settled(_gone_on(fit, prepared, held), prepared), prepared)


def _of_as_many_modes(model: Model, prepared: Prepared) -> FreeRunFit:
    """The fit with as many modes as the Bayesian information criterion of the free run asks for, from one on.

    Damping couples them where it asks for that. Each is fitted with steps enough: what too coarse an integration leaves
    would else be taken for a mode.
    """
    best: FreeRunFit | None = None
    worse = 0
    for lines in line_fits(model, prepared):
        worse += 1
        if worse > PATIENCE:
            break
        begun = lines.model.with_values({key: model.values[key] for key in model.held_keys})
        held = (*model.held_keys, *lines.modal.coupling)
        try:
            steps = needed_steps(begun, prepared.record, prepared.outputs)
            fit = fit_part(begun, prepared, held, steps=steps, max_iterations=TRIED)
        except DivergenceError:
            continue
        if best is None or _criterion(fit) < _criterion(best):
            fit = fit if fit.converged else _gone_on(fit, prepared, held, TRIED)
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


def _gone_on(fit: FreeRunFit, prepared: Prepared, held: Collection[str], trials: int = TRIALS) -> FreeRunFit:
    """A fit gone on with from where it ended, with other keys held."""
    initial = np.atleast_2d(fit.initial)
    return fit_part(fit.model, prepared, held, steps=fit.steps_per_sample, initial=initial, max_iterations=trials)


def _criterion(fit: FreeRunFit) -> float:
    """The Bayesian information criterion for white noise in proportion to each sensor (Schwarz, 1978)."""
    count = len(fit.residual)
    return count * float(np.log(np.mean(fit.residual**2))) + (len(fit.keys) + fit.initial.size) * float(np.log(count))
