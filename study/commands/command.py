"""What a command is, and the kinds of numbers its options take."""

import argparse
import math
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from study.support.terminal import harmless


@dataclass(frozen=True)
class Command:
    """An entry in the table of commands."""

    name: str
    summary: str  # what it does in a few words
    example: str  # shown by its ``--help``
    arguments: Callable[[argparse.ArgumentParser], None]  # adds its arguments to a parser
    run: Callable[[argparse.Namespace], None]  # does it; a user's mistakes are raised as ``StudyError``


class Step(Protocol):
    """Counts a step of some work, of so many where that is known."""

    def __call__(self, doing: str, to_come: int | None = None) -> None:
        """A step more, in which this is done; so many are still to come, as far as that is known."""


@contextmanager
def progress(unit: str, total: int | None = None, name: str = "") -> Generator[Step, None, None]:
    """A line of progress; what is given back counts a step, and says what is done in it unless that is empty.

    ``total`` is a least: a record with a fault of the measurement is compared more than once.
    """
    from tqdm import tqdm

    # progress is shown after two seconds of work
    with tqdm(total=total, delay=2.0, leave=False, unit=unit, desc=harmless(name) or None) as bar:

        def step(doing: str, to_come: int | None = None) -> None:
            if doing:
                bar.set_description_str(harmless(doing), refresh=False)  # tqdm adds the colon
            if to_come is not None:
                bar.total = bar.n + 1 + to_come
            elif bar.total is not None:
                bar.total = max(bar.total, bar.n + 2)  # this step and one that is still to come
            bar.update()

        yield step


def say_left_out(*why: str) -> None:
    """Say in one line what was left out, and why: sentences of ``extras.lacking``, empty where nothing lacks."""
    if any(why):
        print(f"Left out: {'; '.join(sentence for sentence in why if sentence)}.")


def finite_number(above: float = -math.inf, least: float = -math.inf, most: float = math.inf) -> Callable[[str], float]:
    """A reader of finite numbers above one limit, not below the other and not beyond the last."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and value > above and least <= value <= most):
            limit = f" above {above:g}" if above > -math.inf else f" of at least {least:g}" if least > -math.inf else ""
            limit += f" and at most {most:g}" if most < math.inf else ""
            raise argparse.ArgumentTypeError(f"{text!r} is not a finite number{limit}")
        return value

    return read


def whole_number(least: int, most: int) -> Callable[[str], int]:
    """A reader of whole numbers within limits."""

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from {least} to {most}")
        return value

    return read
