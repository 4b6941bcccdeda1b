"""``study trial``: a record with a hidden effect, to try one's hand at."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from study.commands.command import Command, finite_number, whole_number
from study.support.errors import expect

if TYPE_CHECKING:
    from study.trials import Trial


def _arguments(parser: argparse.ArgumentParser) -> None:
    task = parser.add_mutually_exclusive_group(required=True)
    task.add_argument("--seed", type=whole_number(0, 2**63 - 1), help="the same seed gives the same trial")
    task.add_argument("--open", type=Path, metavar="FILE", help="show the sealed answer of a trial")
    parser.add_argument(
        "--hidden", metavar="NAMES", help="'none', or one or more effects (a,b) to hide; drawn if left out"
    )
    parser.add_argument(
        "--noise",
        type=finite_number(least=0.0, most=1.0),
        help="mean square of the noise over that of the response (0.05 is 5 %%); drawn if left out",
    )
    parser.add_argument(
        "--response", choices=("displacement", "velocity", "acceleration"), help="what is measured; drawn if left out"
    )
    parser.add_argument(
        "--fault", default="none", metavar="NAME",
        help="a fault of the measurement, such as delay; 'any' for one in half of the seeds (default: none)",
    )  # fmt: skip
    parser.add_argument(
        "--test", metavar="KIND",
        help="another kind of test than a force on mass and spring: free_decay, blows, base, component or axis",
    )  # fmt: skip
    parser.add_argument(
        "--coordinates",
        type=whole_number(2, 5),
        help="a structure of so many masses, its effect hidden at one of its places",
    )
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder (default: this one)")


def _run(arguments: argparse.Namespace) -> None:
    from study.trials import WIDE, make_trial, sealed

    if arguments.open is not None:
        print(sealed.answer_in_words(sealed.unseal(arguments.open)))
        return
    hidden, noise, response = _names(arguments.hidden), arguments.noise, arguments.response
    if arguments.coordinates is not None:
        print(_structure(arguments, hidden))
        return
    if arguments.test is not None:
        from study.trials.kinds import make_test

        other = response is not None or arguments.fault != "none"
        expect(not other, "--test draws no --response and no --fault; expected neither of them beside it")
        trial = make_test(arguments.test, arguments.seed, hidden, noise)
        print(_written(trial, *sealed.write_trial(trial, arguments.out)))
        return
    trial = make_trial(arguments.seed, hidden, noise, response, arguments.fault, WIDE)
    print(_written(trial, *sealed.write_trial(trial, arguments.out)))


def _structure(arguments: argparse.Namespace, hidden: tuple[str, ...] | None) -> str:
    """A trial of a structure on disk, and what to try with it."""
    from study.support.errors import expect
    from study.trials.structure_draw import make_structure_trial
    from study.trials.structure_sealed import write_structure_trial

    one = hidden is None or len(hidden) < 2
    expect(one, f"--hidden names {', '.join(hidden or ())}; expected one effect, or none, in a structure")
    expect(arguments.fault == "none", "--fault is not drawn for structures; expected --coordinates without it")
    name = None if hidden is None else "none" if not hidden else hidden[0]
    trial = make_structure_trial(arguments.seed, name, arguments.noise, arguments.response, arguments.coordinates)
    record, model, answer = write_structure_trial(trial, arguments.out)
    return (
        f"{record}: force and {trial.response} of {len(trial.record.sensors)} masses, {len(trial.record)} samples at "
        f"{trial.record.dt:.4g} s\n{model}: the structure its owner believes in\n{answer}: the answer, sealed; "
        f"'study trial --open {answer}' shows it\n\nTry: study diagnose {record} --model {model}"
    )


def _names(text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    return () if text.strip() == "none" else tuple(name.strip() for name in text.split(","))


def _written(trial: "Trial", record: Path, model: Path, answer: Path) -> str:
    return (
        f"{record}: {' and '.join(trial.record.channels)}, {len(trial.record)} samples at {trial.record.dt:.4g} s\n"
        f"{model}: the model its owner believes in ({', '.join(t.name for t in trial.believed.terms)})\n"
        f"{answer}: the answer, sealed; 'study trial --open {answer}' shows it\n\n"
        f"Try: study diagnose {record} --model {model}"
    )


COMMAND = Command(
    "trial", "write a record with a hidden effect, and its answer sealed apart",
    "study trial --seed 7\n  study trial --seed 7 --hidden quadratic_damping --noise 0.05 --out trials\n"
    "  study trial --seed 8 --fault any\n"
    "  study trial --seed 9 --test free_decay\n"
    "  study trial --seed 9 --coordinates 3\n"
    "  study trial --open trial_7.answer.json",
    _arguments, _run,
)  # fmt: skip
