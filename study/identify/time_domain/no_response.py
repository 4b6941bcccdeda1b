"""Why no values of a model let it follow a record, as far as the record or the model says."""

import numpy as np
from scipy.fft import rfft, rfftfreq
from scipy.special import fdtrc

from study.equations.model import Model
from study.equations.terms import LINEAR
from study.identify.frequency_domain.starting_values import coherent_lines, solved
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.records.prepared import FORCE, Prepared
from study.records.sampling_rate import too_coarse
from study.support.errors import StudyError
from study.support.thresholds import ALPHA

SURE = 3.0  # standard errors by which a coefficient must differ from zero to have a sign


def why_no_response(model: Model, prepared: Prepared) -> str:
    """One sentence for a model that has no finite response to a record's force from any start."""
    sentence = unfit(model, prepared)
    if sentence:
        return sentence
    return (
        f"{model.name!r} has no finite response to the force of {prepared.record.name!r} from any start; expected "
        "terms that hold it (begin with inertia, linear_damping and linear_stiffness, and have 'study diagnose' say "
        "what is missing), or values in the model that come near those of the record"
    )


def unfit(model: Model, prepared: Prepared) -> str:
    """What speaks against a model or a record before any fit; empty if nothing does.

    What is wrong with the record is read from its best linear approximation: mass, damping and stiffness, each with its
    standard error.
    """
    name, response = prepared.record.name, prepared.response
    held = [f"{key} = {model.values[key]:g}" for key in ("c", "k") if (model.values.get(key) or 0.0) < 0.0]
    if held and all(term.name in LINEAR for term in model.terms):
        grows = "with which any motion grows without end; expected a value above zero, or none"
        return f"the model holds {' and '.join(held)}, {grows}"
    if prepared.free or prepared.response == FORCE or prepared.record.stretches or len(model.coordinates) > 1:
        return ""  # no force, a prescribed motion, stretches too short to ask, or more than one mass that moves
    coarse = too_coarse(prepared)
    if coarse:
        return coarse
    try:
        lines = coherent_lines(prepared)
    except StudyError as error:
        return str(error)
    if lines.single:
        return one_frequency(_strongest(prepared), prepared)
    values, errors = solved(lines, ("m", "c", "k"))
    mass, error = float(values[0]), float(errors[0])
    if mass < -SURE * error and float(values[1]) < SURE * float(errors[1]):
        return (
            f"force and {response} of {name!r} seem to have opposite signs (a linear fit gives a mass of {mass:.3g}); "
            "expected both positive in the same direction: turn the force round (--scale force=-1, or without "
            "that where it is given)"
        )
    if mass < SURE * error:
        return (
            f"{name!r} shows no mass: its best linear system has m = {mass:.3g} +- {1.96 * error:.2g}; expected a "
            "force that reaches the resonance, or a model that gives the mass"
        )
    return ""


def explains_nothing(fit: FreeRunFit, prepared: Prepared) -> bool:
    """Whether a fit leaves no less of the response than chance lets its own values and states take, by the F test.

    A free motion's frequency is chosen of as many as the samples tell apart (Bonferroni).
    """
    taken = len(fit.keys) + np.size(fit.initial)
    rest = len(fit.residual) - taken
    ratio = (prepared.spread**2 / fit.rms**2 - 1.0) * rest / taken if fit.rms > 0.0 else np.inf
    return float(fdtrc(taken, rest, max(ratio, 0.0))) * len(fit.residual) > ALPHA


def driven_at(model: Model, prepared: Prepared) -> float:
    """The one frequency, in rad/s, at which a model is driven whose mass and stiffness are open; 0 if more do."""
    of_force = not (prepared.free or prepared.response == FORCE or prepared.record.stretches)
    if not of_force or not {"m", "k"} <= {key for key, value in model.values.items() if value is None}:
        return 0.0
    try:
        lines = coherent_lines(prepared)
    except StudyError:
        return 0.0
    return _strongest(prepared) if lines.single else 0.0


def one_frequency(omega: float, prepared: Prepared) -> str:
    """The sentence for a force that drives one frequency, in rad/s."""
    return (
        f"the force of {prepared.record.name!r} drives one frequency, {omega / (2.0 * np.pi):.3g} Hz, which cannot "
        "tell mass from stiffness; expected a force of several frequencies, or a model that gives the value of one of "
        "them"
    )


def _strongest(prepared: Prepared) -> float:
    """The angular frequency at which the force has its highest peak, between the lines of its spectrum, in rad/s."""
    force = prepared.record["force"]
    power = np.abs(rfft(np.hanning(len(force)) * (force - np.mean(force)))) ** 2
    f = rfftfreq(len(force), prepared.dt)
    peak = slice(max(int(np.argmax(power)) - 1, 0), int(np.argmax(power)) + 2)
    return float(2.0 * np.pi * np.average(f[peak], weights=power[peak]))
