"""What the chapters of Part II share: their settings, and from a chapter's tables to claims with a verdict each."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Annotated, cast

import pandas as pd
from matplotlib.figure import Figure
from pydantic import Field
from scipy.special import stdtrit

from study.reproduction.chapters.contents import CHAPTERS
from study.reproduction.claims.judgement import Condition, conclude
from study.reproduction.claims.reported import Reported, check_complete
from study.reproduction.settings import (
    Count,
    Ensembles,
    ExcitationSettings,
    Names,
    Positive,
    Rate,
    Sampling,
    Seed,
    Seeds,
)
from study.support.config_files import Section
from study.support.document import Block
from study.support.thresholds import ALPHA

Tables = Mapping[str, pd.DataFrame]  # by their names in ``Contents.tables``
Judge = Callable[[Tables, Reported], Iterable[Condition]]
HELD = ("holds", "partly", "does not hold")
NOT_TESTED, LEFT_OUT = "not tested", "left out, as the data are not there"


class NoiseSettings(Ensembles):
    """Noise on force and response, every level of one with every level of the other."""

    system: str
    levels: Annotated[tuple[Rate, ...], Field(min_length=2, strict=False)]  # mean square over that of the channel
    estimators: Names
    periodic: ExcitationSettings  # a force that repeats, for an estimator that lives on it
    level: float  # its mean square, N^2
    periodic_estimators: Names
    free_runs: Seeds  # of that force with a fit in free run
    tie: Positive  # standard errors of the difference within which two estimators are level
    negligible: Positive  # relative errors that nobody tells apart


class DrivenSettings(Ensembles):
    """Forces with other spectra, among them bands of noise that grow narrower."""

    level: Positive  # mean square of a force, N^2, where ``levels`` names no other
    levels: dict[str, Positive]
    forces: dict[str, ExcitationSettings]
    centre: Positive  # hertz, of the bands
    widths: Annotated[tuple[Positive, ...], Field(min_length=2, strict=False)]  # octaves, from the widest
    sensor_noise: Rate  # mean square on the displacement over that of the displacement
    good: Rate  # relative error that many a user would take
    driven: Rate  # of the largest line of the force: a line above is driven


class ForceCase(Section):
    """A system with another force, and what may be assumed in its place."""

    title: str
    wrong: Names  # terms beside mass, damper and spring


class ForcesSettings(Section):
    """Systems of models/forces, each identified with its own terms and with others."""

    seed: Seed
    sensor_noise: Rate  # mean square on the displacement over that of the displacement
    levels: Annotated[
        tuple[Positive, ...], Field(min_length=2, strict=False)
    ]  # of the report's force; the first is shown
    cases: Annotated[dict[str, ForceCase], Field(min_length=1)]


class SensedStructure(Section):
    """A structure of models/structures: what may be missing from it, and sets of coordinates that are measured."""

    level: Positive  # mean square of the force, N^2
    hidden: str  # the effect that is missing
    effects: Names  # that may be
    sensors: Names  # each a set, with spaces between


class SensorSettings(Section):
    """Structures seen by few sensors."""

    sampling: Sampling
    steps_per_sample: Count
    cutoff: Positive  # hertz, of the force
    seed: Seed
    sensor_noise: Rate  # mean square on a displacement over that of the displacement
    structures: Annotated[dict[str, SensedStructure], Field(min_length=1)]


class VaryingSettings(Section):
    """Systems of models/varying, and what of their variation is not told."""

    seed: Seed
    sensor_noise: Rate  # mean square on the displacement over that of the displacement
    mathieu_seeds: Count  # records of the Mathieu system
    step_at: Positive  # seconds
    moments: Count  # at which the step is tried
    cases: Annotated[dict[str, str], Field(min_length=1)]  # titles


class PartTwoSettings(Section):
    """``config/part_two.yaml``; the comments there say what each section is for."""

    noise: NoiseSettings
    excitations: DrivenSettings
    forces: ForcesSettings
    structures: SensorSettings
    varying: VaryingSettings


def _nothing(_: Tables) -> list[str]:
    return []


@dataclass(frozen=True)
class Chapter:
    """How a chapter is made."""

    claims: Mapping[str, Judge]  # by their ids in config/expected.tsv
    figures: Mapping[str, Callable[[Tables], Figure]]
    told: Callable[[Tables], list[Block]]  # what its section of the page says, beside claims and figures
    numbers: tuple[str, ...] = ()  # rows of config/expected.tsv whose value its claims read
    make: Callable[..., Tables] | None = None  # of the study's settings, the chapter's and the folder of models
    left_out: Callable[[Tables], list[str]] = _nothing  # what could not be made, in sentences for the verdict


def get_chapter(name: str) -> Chapter:
    """The chapter of this name, its module imported only now."""
    return cast(Chapter, import_module(f"study.reproduction.chapters.{CHAPTERS[name].module}").CHAPTER)


def judged_claims(chapter: str, tables: Tables, expected: Reported) -> pd.DataFrame:
    """Every claim of a chapter with its conditions, what was measured and the verdict, a row each.

    One without any condition is not tested: the data that it is about are not there.
    """
    claims = [
        conclude(expected, name, *judge(tables, expected), words=HELD)
        for name, judge in get_chapter(chapter).claims.items()
    ]
    claims = [c if c.criterion else replace(c, verdict=NOT_TESTED, measured=LEFT_OUT) for c in claims]
    return pd.DataFrame([{"chapter": chapter, **asdict(claim)} for claim in claims])


def tables_of(folder: Path, chapter: str) -> dict[str, pd.DataFrame]:
    """The tables of a chapter as they were written into a folder."""
    return {name: pd.read_csv(folder / f"{name}.csv", keep_default_na=True) for name in CHAPTERS[chapter].tables}


def judges(*functions: Judge) -> dict[str, Judge]:
    """Functions that judge claims by the claims' ids, which are their names."""
    return {function.__name__: function for function in functions}


def chance_bound(count: int, freedom: float) -> float:
    """Standard errors that the largest of so many deviations of nothing reaches with the probability ``ALPHA``."""
    return float(stdtrit(freedom, 1.0 - ALPHA / (2.0 * count)))


def check_expected(expected: Reported, path: Path) -> None:
    """Whether the rows are what the chapters' claims ask for, before any job starts."""
    chapters = [get_chapter(name) for name in CHAPTERS]
    check_complete(
        expected, path, [name for chapter in chapters for name in chapter.claims],
        [name for chapter in chapters for name in chapter.numbers],
    )  # fmt: skip


def chapter_settings(name: str, plain: object) -> Section:
    """A chapter's own section of ``config/part_two.yaml``, from the plain data that its job is given."""
    kind = PartTwoSettings.model_fields[name].annotation
    assert isinstance(kind, type)
    assert issubclass(kind, Section)
    return kind.model_validate(plain)
