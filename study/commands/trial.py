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
        "--hidden", metavar="NAMES", help="'none', or one or more effects (a,b) to hide; random if left out"
    )
    parser.add_argument(
        "--noise",
        type=finite_number(least=0.0, most=1.0),
        help="mean square of the noise over that of the response (0.05 is 5 %%); random if left out",
    )
    parser.add_argument(
        "--response", choices=("displacement", "velocity", "acceleration"), help="what is measured; random if left out"
    )
    parser.add_argument(
        "--fault", default="none", metavar="NAME",
        help="a fault of the measurement, such as delay; 'any' for one in half of the seeds (default: none)",
    )  # fmt: skip
    parser.add_argument(
        "--test", metavar="KIND",
        help="a kind of test other than a force on mass and spring: free_decay, blows, base, component or axis; or a "
        "rig with several effects and a remainder: rig_noise, rig_multisine, rig_sweep, rig_stepped, rig_blows, "
        "rig_decay, rig_axis, rig_component or rig_structure",
    )  # fmt: skip
    parser.add_argument(
        "--coordinates",
        type=whole_number(2, 5),
        help="a structure with this many masses; the effect is hidden at one of its places",
    )
    parser.add_argument("--out", type=Path, default=Path(), metavar="DIR", help="folder (default: this one)")


def _run(arguments: argparse.Namespace) -> None:
    from study.trials import draw, sealed

    if arguments.open is not None:
        print(sealed.answer_in_words(sealed.unseal(arguments.open)))
        return
    masses = arguments.coordinates
    both = masses is not None and arguments.test is not None
    expect(not both, "--coordinates asks for a structure, --test for another test; expected one of them")
    test = draw.STRUCTURE if masses is not None else arguments.test or draw.DRIVEN_MASS
    hidden = _names(arguments.hidden)
    trial = draw.make_trial(arguments.seed, hidden, arguments.noise, arguments.response, arguments.fault, test, masses)
    print(_written(trial, *sealed.write_trial(trial, arguments.out)))


def _names(text: str | None) -> tuple[str, ...] | None:
    if text is None:
        return None
    return () if text.strip() == "none" else tuple(name.strip() for name in text.split(","))


def _written(trial: "Trial", record: Path, model: Path, answer: Path) -> str:
    terms = dict.fromkeys(entry.term.name for entry in trial.believed.terms)
    return (
        f"{record}: {' and '.join(trial.channels)}, {len(trial.record)} samples at {trial.record.dt:.4g} s\n"
        f"{model}: the model its owner believes in ({', '.join(terms)})\n"
        f"{answer}: the answer, sealed; 'study trial --open {answer}' shows it\n\n"
        f"Try: study diagnose {record} --model {model}"
    )


COMMAND = Command(
    "trial", "write a practice record with a hidden effect, and the answer to a separate file",
    "study trial --seed 7\n  study trial --seed 7 --hidden quadratic_damping --noise 0.05 --out trials\n"
    "  study trial --seed 8 --fault any\n"
    "  study trial --seed 9 --test free_decay\n"
    "  study trial --seed 9 --coordinates 3\n"
    "  study trial --open trial_7.answer.json",
    _arguments, _run,
)  # fmt: skip
