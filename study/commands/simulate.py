"""``study simulate``: the response of a model to a seeded random force, as a record."""

import argparse
import math
from pathlib import Path

from study.commands.command import Command, finite_number, whole_number

MOST_SAMPLES = 10_000_000
USUAL, MOST_STEPS = 8, 1000


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
    parser.add_argument("--samples", type=whole_number(16, MOST_SAMPLES), default=8192, help="default %(default)s")
    parser.add_argument(
        "--dt",
        type=finite_number(least=1e-15, most=1e15),
        default=0.02,
        help="sampling interval in s (default %(default)s)",
    )
    parser.add_argument(
        "--steps", type=whole_number(1, 10_000),
        help="steps per sample (default: 8, or more where the system's own frequency asks for them)",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, default=Path("record.csv"), help="where to (default %(default)s)")


def _run(arguments: argparse.Namespace) -> None:
    from study.compare.history import path_of
    from study.equations.linear_part import modes_of, modes_table
    from study.equations.model_file import read_model
    from study.equations.simulate import Integrator, simulate
    from study.records.excitation import Excitation, force
    from study.records.record import write_csv
    from study.support.errors import at, expect
    from study.support.files import keep, replacing

    keep([arguments.model, path_of(arguments.model)], [arguments.out])
    model, dt = read_model(arguments.model), arguments.dt
    expect(model.named or "inertia" in model, f"{arguments.model}: the model has no inertia; expected a term 'inertia'")
    lacking = f"model {model.name!r} has no 'forces'; expected where the force acts, such as"
    expect(model.forces, f"{lacking} {{shaker: {model.coordinates[0]}}}")
    with at(arguments.model):
        values = model.numbers()
    excitation = Excitation(level=arguments.level, cutoff=arguments.cutoff)
    seeds = enumerate(dict(model.forces), arguments.seed)  # each force is random on its own
    forces = {name: force(excitation, arguments.samples, dt, seed) for seed, name in seeds}
    modes = modes_of(model) if model.named else None
    rate = 2.0 * math.pi * modes.frequency.max() if modes else math.sqrt(abs(values.get("k", 0.0)) / values["m"])
    steps = arguments.steps or _enough(rate, dt)
    record = simulate(model, forces, dt, Integrator("rk4" if modes else "abm4", steps))
    with replacing(arguments.out) as beside:
        write_csv(record, beside)
    sizes = [(f"{name} at {where}" if where else name, forces[name].std()) for name, where in model.forces]
    driven = ", ".join(f"{name} of rms {size:.4g} N" for name, size in sizes)
    print(f"{arguments.out}: {len(record)} samples, {arguments.samples * dt:g} s of {model.name}, {driven}")
    if modes:
        print(modes_table(modes, model.coordinates))


def _enough(rate: float, dt: float) -> int:
    """Steps per sample in which the linear system, of ``rate`` rad/s at most, turns by no more than ``TURN``."""
    from study.equations.simulate import TURN

    return min(max(USUAL, math.ceil(rate * dt / TURN)), MOST_STEPS)


COMMAND = Command(
    "simulate", "write the record of a model under a random force",
    "study simulate models/duffing.yaml --level 1.0 --seed 1 --samples 8192 --dt 0.02 --out record.csv",
    _arguments, _run,
)  # fmt: skip
