"""``study simulate``: the response of a model to a seeded random force, as a record."""

import argparse
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import Command, finite_number, whole_number

if TYPE_CHECKING:
    from study.equations.model import Model
    from study.equations.simulate import Integrator
    from study.support.arrays import Floats

USUAL_STEPS, MOST_STEPS = 8, 1000


def _arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("model", type=Path, help="model file (YAML) with every value given")
    parser.add_argument(
        "--level", type=finite_number(least=0.0, most=1e50), default=1.0,
        help="mean square of the white force in N^2, before its low-pass (default %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--cutoff",
        type=finite_number(least=1e-15, most=1e15),
        default=12.5,
        help="low-pass in Hz (default %(default)s)",
    )
    parser.add_argument(
        "--seed", type=whole_number(0, 2**63 - 1), default=1, help="the same seed gives the same record"
    )
    parser.add_argument("--samples", type=whole_number(16, 10_000_000), default=8192, help="default %(default)s")
    parser.add_argument(
        "--dt",
        type=finite_number(least=1e-15, most=1e15),
        default=0.02,
        help="sampling interval in s (default %(default)s)",
    )
    parser.add_argument(
        "--steps", type=whole_number(1, 10_000),
        help="steps per sample (default: 8, or as many as it takes until twice the steps change no motion by 0.2 %%)",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, default=Path("record.csv"), help="where to (default %(default)s)")


def _run(arguments: argparse.Namespace) -> None:
    from study.compare.history import path_of
    from study.equations.linear_part import modes_of, modes_table
    from study.equations.model_file import read_model
    from study.equations.motion_program import motion_program
    from study.equations.simulate import Integrator, simulate
    from study.records.excitation import Excitation, force
    from study.records.record import write_csv
    from study.support.errors import at, expect
    from study.support.files import keep, replacing
    from study.support.numbers import percent
    from study.support.thresholds import TOLERANCE

    keep([arguments.model, path_of(arguments.model)], [arguments.out])
    model, dt = read_model(arguments.model), arguments.dt
    expect(model.named or "inertia" in model, f"{arguments.model}: the model has no inertia; expected a term 'inertia'")
    lacking = f"{arguments.model}: the model has no 'forces'; expected where the force acts, such as"
    expect(model.forces, f"{lacking} {{shaker: {model.coordinates[0]}}}")
    with at(arguments.model):
        values = model.numbers()
    excitation = Excitation(level=arguments.level, cutoff=arguments.cutoff)
    seeds = enumerate(dict(model.forces), arguments.seed)  # each force is random on its own
    forces = {name: force(excitation, arguments.samples, dt, seed) for seed, name in seeds}
    modes = modes_of(model) if model.named else None
    rate = 2.0 * math.pi * modes.frequency.max() if modes else math.sqrt(abs(values.get("k", 0.0)) / values["m"])
    # Runge-Kutta alone cuts a step where dry friction switches
    method = "rk4" if modes or len(motion_program(model, (), ()).sides) else "abm4"
    steps, changed = arguments.steps or _enough(rate, dt), 0.0
    if not arguments.steps:
        steps, changed = _settled(model, forces, dt, Integrator(method, steps))
    record = simulate(model, forces, dt, Integrator(method, steps))
    with replacing(arguments.out) as beside:
        write_csv(record, beside)
    sizes = [(f"{name} at {where}" if where else name, forces[name].std()) for name, where in model.forces]
    driven = ", ".join(f"{name} of rms {size:.4g} N" for name, size in sizes)
    print(f"{arguments.out}: {len(record)} samples, {arguments.samples * dt:g} s of {model.name}, {driven}")
    if changed > TOLERANCE:
        print(f"with twice the {steps} steps per sample, a motion changes by {percent(changed)} of its rms")
    if modes:
        print(modes_table(modes, model.coordinates))


def _enough(rate: float, dt: float) -> int:
    """Steps per sample in which the linear system, of ``rate`` rad/s at most, turns by no more than ``TURN``."""
    from study.equations.simulate import TURN

    return min(max(USUAL_STEPS, math.ceil(rate * dt / TURN)), MOST_STEPS)


def _settled(
    model: "Model", forces: "Mapping[str, Floats]", dt: float, integrator: "Integrator"
) -> tuple[int, float]:  # fmt: skip
    """Steps per sample that follow the terms that are there, and by what share of a motion twice as many change it."""
    import numpy as np

    from study.equations.simulate import simulate
    from study.records.record import Sensor
    from study.support.thresholds import TOLERANCE

    # the steps are tried on no more samples
    look = {name: samples[:32_768] for name, samples in forces.items()}
    sensors = [Sensor(c, "displacement") for c in model.coordinates]

    def motions(steps: int) -> "Floats":
        return simulate(model, look, dt, replace(integrator, steps_per_sample=steps)).columns(sensors)

    steps, changes = integrator.steps_per_sample, list[float]()
    coarse = motions(steps)
    while True:
        fine = motions(2 * steps)
        changes.append(float(np.max(np.std(fine - coarse, axis=0) / np.maximum(np.std(fine, axis=0), 1e-300))))
        if changes[-1] <= TOLERANCE:
            return steps, changes[-1]
        if 4 * steps > MOST_STEPS:  # of a chaotic system no number of steps gives the motion
            falls = changes[-1] < 0.1 * changes[0]
            return (steps, changes[-1]) if falls else (integrator.steps_per_sample, changes[0])
        steps, coarse = 2 * steps, fine


COMMAND = Command(
    "simulate", "write the record of a model under a random force",
    "study simulate models/duffing.yaml --level 1.0 --seed 1 --samples 8192 --dt 0.02 --out record.csv",
    _arguments, _run,
)  # fmt: skip
