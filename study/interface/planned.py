"""Which test next: what is planned of a diagnosis, as a notebook has it."""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from study.diagnose.next_test import NextTest, driving, next_test, tied_rows
from study.diagnose.next_test_report import (
    deciding_plan,
    next_test_in_words,
    pair_table,
    precise_plan,
    precise_test_in_words,
)
from study.diagnose.precision import PreciseTest, precise_test
from study.diagnose.separation import limits_asked, rivals_of
from study.diagnose.verdict import Diagnosis
from study.interface.showing import TABLES, Words, drawing_axes
from study.support.errors import expect
from study.support.extras import needed
from study.support.files import write_files

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False, repr=False)
class PlannedTest:
    """What :meth:`Diagnosis.plan` gives: a test that decides between what is tied, or tells a value closely.

    Attributes
    ----------
    result : study.diagnose.next_test.NextTest or study.diagnose.precision.PreciseTest
        Everything that was found, as the packages below hold it.
    says : str
        Which test, and how sure it is.
    """

    result: NextTest | PreciseTest
    says: Words

    @property
    def promise(self) -> float:
        """Probability that it decides; of a test for a value's sake the half width of its interval over the value."""
        return self.result.width if isinstance(self.result, PreciseTest) else self.result.choice.promise

    @property
    def sensor(self) -> str:
        """A sensor that it needs beside those of the record; empty where it needs none."""
        found = None if isinstance(self.result, PreciseTest) else self.result.choice.sensor
        return "" if found is None else str(found)

    def table(self) -> Words:
        """How sure each rival is told from each other, if it is the true one; what is said of a value's test."""
        return self.says if isinstance(self.result, PreciseTest) else Words(pair_table(self.result))

    def to_frame(self) -> "pd.DataFrame":
        """What drives it, one column a channel, by time in seconds; empty where it is let go."""
        needed(*TABLES)
        import numpy as np
        import pandas as pd

        found = self.result
        if isinstance(found, PreciseTest):
            present, design = found.present, found.design
        else:
            present, design = found.rivals.present, found.choice.design
        columns = driving(present, design, present.every)
        count = len(next(iter(columns.values()), np.zeros(0)))
        time = present.source.dt / present.every * np.arange(count)
        return pd.DataFrame(columns, index=pd.Index(time, name="time"))

    def save(self, folder: str | Path) -> None:
        """Write ``plan.json``, what drives the test as CSV and WAV, and the picture, as ``study plan`` does."""
        found = self.result
        files = precise_plan(found)[1] if isinstance(found, PreciseTest) else deciding_plan(found)[1]
        write_files(Path(folder), files)

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """What each rival would answer, where they differ most; of a test for a value's sake what drives it."""
        with drawing_axes(ax) as (axes,):
            from study.diagnose.next_test_pictures import answers_panel

            if isinstance(self.result, PreciseTest):
                frame = self.to_frame()
                for name in frame.columns:
                    axes.plot(frame.index.to_numpy(), frame[name].to_numpy(), label=str(name))
                axes.set_xlabel("time (s)")
            else:
                answers_panel(axes, self.result)
            axes.legend()
        return axes

    def __repr__(self) -> str:
        """What it says."""
        return f"<PlannedTest: {self.says}>"


def planned(
    diagnosis: Diagnosis,
    limits: tuple[float | None, float | None, float | None],
    precision: Mapping[str, float] | None,
    sensors: Sequence[str] = (),
) -> PlannedTest:
    """What :meth:`Diagnosis.plan` does; its arguments."""
    prepared = diagnosis.comparison.prepared
    if precision:
        expect(len(precision) == 1, f"precision names {', '.join(precision)}; expected one value and a share of it")
        ((key, wanted),) = precision.items()
        found = precise_test((diagnosis.answer or diagnosis.comparison).fit, prepared, key, wanted, limits)
        return PlannedTest(found, Words(precise_test_in_words(found)))
    rivals = rivals_of(tied_rows(diagnosis), prepared)
    decides = next_test(rivals, limits_asked(rivals.fits, rivals.present, *limits), sensors=sensors)
    return PlannedTest(decides, Words(next_test_in_words(decides)))
