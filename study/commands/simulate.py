"""``study simulate``: the response of a model to a seeded random force, as a record."""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import Command, finite_number, whole_number

if TYPE_CHECKING:
    from study.equations.model import Model

MOST_SAMPLES = 10_000_000
USUAL, MOST_STEPS = 8, 1000
TURN = 0.05  # rad


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
    parser.add_argument("--seed", type=whole_number(0, 2**63 - 1), default=1, help="the same seed gives the same bytes")
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
    from study.equations.model_file import read_model
    from study.equations.simulate import Integrator, simulate
    from study.records.excitation import Excitation, force
    from study.records.record import write_csv
    from study.support.errors import at, expect
    from study.support.files import keep, replacing

    keep([arguments.model, path_of(arguments.model)], [arguments.out])
    model = read_model(arguments.model)
    if model.named:
        _structure(model, arguments)
        return
    expect("inertia" in model, f"{arguments.model}: the model has no inertia; expected a term 'inertia'")
    with at(arguments.model):
        model.numbers()
    excitation = Excitation(level=arguments.level, cutoff=arguments.cutoff)
    history = force(excitation, arguments.samples, arguments.dt, arguments.seed)
    values = model.numbers()
    steps = arguments.steps or _enough(math.sqrt(abs(values.get("k", 0.0)) / values["m"]), arguments.dt)
    record = simulate(model, history, arguments.dt, Integrator(steps_per_sample=steps))
    with replacing(arguments.out) as beside:
        write_csv(record, beside)
    seconds = arguments.samples * arguments.dt
    print(f"{arguments.out}: {len(record)} samples, {seconds:g} s of {model.name}, force of rms {history.std():.4g} N")


def _structure(model: "Model", arguments: argparse.Namespace) -> None:
    """The same of a structure: each of its forces is random on its own."""
    from study.records.excitation import Excitation, force
    from study.records.record import write_csv
    from study.structure.modes import modes_of, modes_table
    from study.structure.structure_simulation import simulate_structure
    from study.support.errors import expect
    from study.support.files import replacing

    lacking = f"model {model.name!r} has no 'forces'; expected where the force acts, such as"
    expect(model.forces, f"{lacking} {{shaker: {model.coordinates[0]}}}")
    excitation = Excitation(level=arguments.level, cutoff=arguments.cutoff)
    forces = {
        name: force(excitation, arguments.samples, arguments.dt, arguments.seed + i)
        for i, (name, _) in enumerate(model.forces)
    }
    modes = modes_of(model)
    steps = arguments.steps or _enough(2.0 * math.pi * modes.frequency.max(), arguments.dt)
    record = simulate_structure(model, forces, arguments.dt, steps_per_sample=steps)
    with replacing(arguments.out) as beside:
        write_csv(record, beside)
    driven = ", ".join(f"{name} at {where} of rms {forces[name].std():.4g} N" for name, where in model.forces)
    print(f"{arguments.out}: {len(record)} samples, {arguments.samples * arguments.dt:g} s of {model.name}, {driven}")
    print(modes_table(modes, model.coordinates))


def _enough(rate: float, dt: float) -> int:
    """Steps per sample in which the linear system, of ``rate`` rad/s at most, turns by no more than :data:`TURN`.

    An integrator of order four errs by about the fourth power of that: what it leaves would be taken for an effect.
    """
    return min(max(USUAL, math.ceil(rate * dt / TURN)), MOST_STEPS)


COMMAND = Command(
    "simulate", "write the record of a model under a random force",
    "study simulate models/duffing.yaml --level 1.0 --seed 1 --samples 8192 --dt 0.02 --out record.csv",
    _arguments, _run,
)  # fmt: skip
