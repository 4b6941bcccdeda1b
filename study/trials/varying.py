"""Trials of coefficients that vary: drifts, steps, schedules by a channel, a nonlinearity beside one, or nothing.

What varies is made by a force of its own in the time domain, not by the splines that a fit takes: even and saturating
drifts, steps at once, a schedule that follows a channel evenly or in a bend.
"""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from study.compare.varying_coefficients import VaryingCoefficient
from study.diagnose.confirmed_faults import diagnose_accounted
from study.equations import formulas, kernels
from study.equations.graph import Graph
from study.equations.model import Model, ModelTerm, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import custom, get
from study.records.excitation import Excitation, force
from study.records.record import Record
from study.support.arrays import Floats
from study.trials.draw import Trial
from study.trials.effects import evenly_in_log, linear_oscillator
from study.trials.kept import Row
from study.way_in.compare_records import compare_records

KINDS_OF_CHANGES = ("drift", "step", "schedule", "schedule_and_nonlinearity", "nonlinear", "nothing")
NONLINEAR = ("cubic_stiffness", "quadratic_damping", "coulomb_friction", "quadratic_stiffness")
NO_EFFECT = "none"
ACTS_ON = {"linear_stiffness": "u", "linear_damping": "v"}


def make_varying_trial(
    kind: str, seed: int, *, of: str | None = None, change: float | None = None, noise: float | None = None,
    samples: int = 4096,
) -> Trial:  # fmt: skip
    """A trial of one of the kinds ``KINDS_OF_CHANGES``; what is given is not drawn.

    The coefficient ``of`` stiffness or damping changes by a share of itself, 3 to 30 % of a stiffness and 10 to 60 % of
    a damping, which shows less. ``noise`` is the rms of the noise over that of the response. Every record has a channel
    ``load``, whether anything follows it or not.
    """
    rng = np.random.default_rng([2029, *kind.encode(), seed])
    mass, natural = evenly_in_log(rng, 0.2, 50.0), evenly_in_log(rng, 1.0, 20.0)
    base = linear_oscillator(mass, natural, float(rng.uniform(0.01, 0.08)))
    values = base.numbers()
    dt = 1.0 / (natural * float(rng.uniform(10.0, 20.0)))
    drawn, level = str(rng.choice(list(ACTS_ON))), float(rng.choice([0.0, 0.01, 0.03]))
    varied, level = of or drawn, level if noise is None else noise
    range_of = (0.03, 0.3) if varied == "linear_stiffness" else (0.1, 0.6)
    size = evenly_in_log(rng, *range_of) * float(rng.choice([-1.0, 1.0]))
    size = size if change is None else change
    acting = force(Excitation(), samples, 0.02, seed)  # its highest frequency is a quarter of the sampling rate
    time = np.asarray(dt * np.arange(samples), dtype=np.float64)
    load = _load(rng, time)
    amount = size * (values["k"] if varied == "linear_stiffness" else values["c"])
    formula, at = _formula(rng, kind, ACTS_ON[varied], time, load)
    truth, hidden = base, list[str]()
    if formula:
        own = custom("change", formula)
        truth = truth.with_term(replace(free(own), coefficients=(amount,)))
        word = "_step_over_time" if kind == "step" else "_over_time" if kind == "drift" else "_over_load"
        hidden.append(varied + word)
    channels = {"load": load}
    if kind in ("schedule_and_nonlinearity", "nonlinear"):
        name = str(rng.choice(NONLINEAR))
        truth = truth.with_term(_nonlinear(rng, name, base, simulate(base, acting, dt, Integrator("rk4", 8))))
        hidden.append(name)
    record = simulate(truth, acting, dt, Integrator("rk4", 8), extra=channels)
    shown = record["displacement"]
    shown = shown + level * float(np.std(shown)) * rng.standard_normal(samples)
    about = {"kind": kind, "of": varied if formula else "", "change": size if formula else 0.0, "at": at, "dt": dt}
    name = f"{kind}_{seed}"
    measured = Record(dt, {"force": acting, "displacement": shown, **channels}, name=name)
    believed = replace(base, name=name).with_values(dict.fromkeys(base.values))
    return Trial(measured, believed, truth, tuple(hidden), level**2, (), "varying", "displacement", about)


def _load(rng: np.random.Generator, time: Floats) -> Floats:
    """A channel that wanders slowly, some turns along the record."""
    turns, phase = 2.0 * np.pi * time / time[-1] * float(rng.uniform(1.2, 4.0)), rng.uniform(0.0, 2.0 * np.pi, 2)
    return np.asarray(5.0 + np.sin(turns + phase[0]) + 0.4 * np.sin(2.7 * turns + phase[1]), dtype=np.float64)


def _formula(rng: np.random.Generator, kind: str, motion: str, time: Floats, load: Floats) -> tuple[str, float]:
    """The force of a unit change as a formula, and where it steps."""
    end, low, span = float(time[-1]), float(np.min(load)), float(np.ptp(load))
    where, bent = float(rng.uniform(0.15, 0.85)) * end, rng.random() < 0.5
    match kind:
        case "drift":
            return (f"{motion}*tanh(2*t/{end!r})" if bent else f"{motion}*t/{end!r}"), 0.0
        case "step":
            return f"{motion}*(sgn(t - {where!r}) + 1)/2", where
        case "schedule" | "schedule_and_nonlinearity":
            share = f"(load - {low!r})/{span!r}"
            return f"{motion}*{f'tanh(2*{share})' if bent else share}", 0.0
        case _:
            return "", 0.0


def _nonlinear(rng: np.random.Generator, name: str, base: Model, record: Record) -> ModelTerm:
    """A nonlinear effect that carries some of the spring's force, or less where it damps."""
    u, v = record["displacement"], record["velocity"]
    shape = {"cubic_stiffness": u**3, "quadratic_damping": v * np.abs(v), "coulomb_friction": np.sign(v)}.get(
        name, u**2
    )
    share = float(rng.uniform(0.08, 0.25)) * (1.0 if name.endswith("stiffness") else 0.4)
    spring = float(np.std(base.numbers()["k"] * u))
    return replace(free(get(name)), coefficients=(share * spring / float(np.std(shape)),))


def judged_varying(trial: Trial) -> Row:
    """What a diagnosis makes of a trial: whether it is right, and how much of the true curve its 95 % band holds.

    A step and a curve along time are one class where the record cannot tell them apart: ``alike`` is then true. The
    band is asked at nine places of what varies, and at the moment of a step.
    """
    found = diagnose_accounted(compare_records([trial.record], trial.believed)).diagnosis
    answer, before = found.answer, found.comparison.prediction
    named = set[str]() if answer is None else set(answer.names)
    row: Row = {
        "hidden": "+".join(trial.hidden) or NO_EFFECT, "noise": trial.noise, "verdict": found.verdict,
        "named": "+".join(sorted(named)), "right": int(named == set(trial.hidden)),
        "alike": int(_plain(named) == _plain(trial.hidden)), "changes": int(found.changes), "held": 0, "asked": 0,
        "error_before": before.error, "error_after": "" if answer is None else answer.response_error,
        "noise_floor": before.floor,
    }  # fmt: skip
    if named == set(trial.hidden):
        inside = [x for one in found.varying for x in _held(one, trial)]
        row |= {"held": sum(inside), "asked": len(inside)}
    return row


def _plain(names: Iterable[str]) -> set[str]:
    return {name.replace("_step", "") for name in names}


def _held(one: VaryingCoefficient, trial: Trial) -> list[bool]:
    """Whether the band holds the truth, at nine places; of a step before it and behind it, and its moment."""
    if one.step is not None:
        moment, error = one.step
        near = [abs(moment - float(trial.about["at"])) <= 1.96 * error]
        places = [0, len(one.at) - 1]
    else:
        near, places = [], list(range(0, len(one.at), len(one.at) // 8))
    change = next(entry for entry in trial.truth.terms if entry.term.name == "change")
    graph = Graph()
    names = {name: graph.input(name) for name in formulas.names(change.term.components[0].shape)}
    program = graph.program([formulas.add_formula(graph, change.term.components[0].shape, names)])
    at = one.at[places]
    columns = {name: at if name in ("t", "load") else np.ones(len(at)) for name in names}
    share = kernels.evaluate(program, columns, len(at))[:, 0]
    true = (trial.truth.numbers()[one.symbol]) + (change.coefficients[0] or 0.0) * share
    return near + (np.abs(one.value[places] - true) <= 1.96 * one.error[places]).tolist()
