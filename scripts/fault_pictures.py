"""Draw one picture of every fault of the measurement for docs/tool.md; ``make fault_pictures`` does it.

A simulated record as it is in grey, as a faulty instrument reads it in black, the difference, and what is found of it.
"""

# Matplotlib leaves the **kwargs of its methods untyped.
# pyright: reportUnknownMemberType=false

import io
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from study.equations import dimensions
from study.equations.model import Model
from study.equations.model_file import read_model
from study.equations.simulate import Integrator, simulate
from study.faults.accounting import accounted
from study.faults.fault import (
    CLIPPING,
    CONVERTER_STEPS,
    DELAY,
    DRIFT,
    DROP_OUTS,
    FAULTS,
    FORCE_NOISE,
    GAIN_CHANGE,
    HIGH_PASS,
    HUM,
    OFFSET,
    SPIKES,
    Fault,
)
from study.faults.imposed import impose
from study.figures import page
from study.figures.styles import in_style
from study.records.excitation import Excitation, displacement_noise, force
from study.records.prepared import prepare_record
from study.records.record import Record
from study.support.errors import StudyError
from study.support.files import replace_file
from study.support.workflow_step import one_sentence

SYSTEM, LINEAR = "duffing", "linear"  # of a linear system noise on the force is estimated best
GREYS = 16  # of a picture: it has no colours
DT, SAMPLES, SEED = 0.005, 4096, 1
FORCE = Excitation(reading="filtered", level=0.4)  # the report's
NOISE = 1e-4  # mean square on the response, over that of the response
MILLIMETRES = MappingProxyType({"displacement": (1000.0, "mm")})  # easier to read than metres
# Noise on the force passes through the structure: of a displacement little of it is left above the resonance.
RESPONSES = MappingProxyType({FORCE_NOISE: "acceleration"})
WIDTH, PANEL = 8.4, 1.45  # inches
TRUE: dict[str, Any] = {"color": "0.68", "linewidth": 3.0, "zorder": 2.0}
READ: dict[str, Any] = {"color": "black", "linewidth": 1.0, "zorder": 3.0}
FEW = 120  # samples, up to which each is drawn as a dot
TITLES = MappingProxyType(
    {
        OFFSET: "Offset", DRIFT: "Drift", HUM: "Hum", DELAY: "Delay", HIGH_PASS: "High-pass", SPIKES: "Spikes",
        DROP_OUTS: "Drop-outs", CLIPPING: "Clipping", CONVERTER_STEPS: "Steps of the converter",
        GAIN_CHANGE: "Changing gain", FORCE_NOISE: "Noise on the force",
    }
)  # fmt: skip
USUAL = 300  # samples that are shown of a fault that is not listed
SHOWN = MappingProxyType(
    {HUM: 120, DELAY: 80, CONVERTER_STEPS: 60, CLIPPING: 200, DROP_OUTS: 110, FORCE_NOISE: 110, HIGH_PASS: 800}
)
WHOLE = (DRIFT, GAIN_CHANGE)  # shown along all of the record: they are as slow as it is long
AT_TIMES = (SPIKES, DROP_OUTS, CLIPPING)  # only some of the samples have these
SMALL = (CONVERTER_STEPS, FORCE_NOISE)  # seen where the channel moves little


@dataclass(frozen=True, eq=False)
class Example:
    """One fault on one channel of a record."""

    clean: Record
    faulty: Record
    size: float  # of the fault that was put on, in the unit of what was found
    found: Fault

    @property
    def channel(self) -> str:
        """The channel that has the fault."""
        return self.found.channel


def example(model: Model, fault: str, samples: int = SAMPLES) -> Example:
    """A record of a known system with a fault of a size that matters, and that fault as it is found.

    Parameters
    ----------
    model : Model
        The system, with its values; nothing is known of these where the fault is looked for. A linear one cannot show
        an offset that is no constant force.
    fault : str
        One of ``study.faults.imposed.FAULTS``.
    samples : int
        Length of the record.

    Raises
    ------
    StudyError
        If there is no such fault, or another is found.
    """
    clean = measured_example(model, RESPONSES.get(fault, "displacement"), samples)
    response = next(name for name in clean.channels if name != "force")
    faulty, known = impose(clean, response, fault, np.random.default_rng(SEED))
    unknown = model.with_values(dict.fromkeys(model.values, None))
    faults = accounted(unknown, prepare_record(faulty)).faults
    if [f.fault for f in faults] != [fault]:
        raise StudyError(f"found {', '.join(f.fault for f in faults) or 'nothing'}; expected {fault}")
    return Example(clean, faulty, float(known["value"]), faults[0])


def measured_example(model: Model, response: str, samples: int = SAMPLES) -> Record:
    """Force and one motion of a system, with noise on the motion."""
    whole = simulate(model, force(FORCE, samples, DT, seed=SEED), DT, Integrator("rk4", 8))
    factor, unit = MILLIMETRES.get(response, (1.0, whole.units[response]))
    motion = factor * (whole[response] + displacement_noise(whole[response], NOISE, SEED))
    return Record(DT, {"force": whole["force"], response: motion}, {**whole.units, response: unit}, model.name)


def picture(example: Example) -> Figure:
    """A page with a stretch of the channel on top and what the fault has done to it below.

    The caller applies the style sheet.
    """
    found = example.found
    figure, (signal, difference) = page.empty_page(
        f"{TITLES[found.fault]} (in truth {_truth(example)})", f"found: {found.note.split(';')[0]}",
        rows=2, width=WIDTH, panel=PANEL, headed=False,
    )  # fmt: skip
    first, last = shown_samples(example)
    example_panel(signal, example, first, last)
    change(difference, example, first, last)
    signal.set_xlabel("")
    figure.align_ylabels([signal, difference])
    page.shared_legend(figure, [signal])
    return figure


def _truth(example: Example) -> str:
    """Size of the fault that was put on the record."""
    unit = example.found.unit
    return f"{100.0 * example.size:.3g} %" if unit == "1" else f"{example.size:.3g} {dimensions.pretty(unit)}"


def shown_samples(example: Example) -> tuple[int, int]:
    """First sample that is shown and the one after the last: where the fault is seen."""
    n, fault = len(example.clean), example.found.fault
    if fault in WHOLE:
        return 0, n
    length, first = min(SHOWN.get(fault, USUAL), n), n // 4
    if fault in AT_TIMES:
        changed = np.flatnonzero(example.faulty[example.channel] != example.clean[example.channel])
        after = changed[changed >= first]
        first = int(after[0] if len(after) else changed[-1]) - length // 3
    elif fault in SMALL:
        windows = np.lib.stride_tricks.sliding_window_view(example.clean[example.channel], length)
        first = int(np.argmin(np.ptp(windows, axis=1)))
    first = max(0, min(first, n - length))
    return first, first + length


def example_panel(axes: Axes, example: Example, first: int, last: int) -> Axes:
    """The channel as it is, and as it is read."""
    time = example.clean.time[first:last]
    dots: dict[str, Any] = {"marker": "o", "markersize": 3.0} if last - first <= FEW else {}
    axes.plot(time, example.clean[example.channel][first:last], **TRUE, label="as it is")
    axes.plot(time, example.faulty[example.channel][first:last], **READ, **dots, label="as the instrument reads it")
    return _named(axes, example, example.channel)


def change(axes: Axes, example: Example, first: int, last: int) -> Axes:
    """What the fault has added to the channel."""
    time = example.clean.time[first:last]
    added = example.faulty[example.channel][first:last] - example.clean[example.channel][first:last]
    axes.plot(time, added, **READ, snap=False)
    axes.axhline(0.0, color="0.5", linewidth=0.8, zorder=1.5)
    return _named(axes, example, "difference")


def _named(axes: Axes, example: Example, what: str) -> Axes:
    axes.set_xlabel("time (s)")
    axes.set_ylabel(f"{what} ({dimensions.pretty(example.clean.units[example.channel])})")
    axes.margins(x=0.01, y=0.08)
    return axes


def small(data: bytes) -> bytes:
    """A picture in few shades of grey."""
    target = io.BytesIO()
    Image.open(io.BytesIO(data)).convert("L").quantize(GREYS).save(target, "PNG", optimize=True)
    return target.getvalue()


def main(models: Path, folder: Path, faults: Sequence[str] = FAULTS) -> None:
    systems = {name: read_model(models / f"{name}.yaml") for name in (SYSTEM, LINEAR)}
    folder.mkdir(parents=True, exist_ok=True)
    with in_style():
        for name in faults:
            one = example(systems[LINEAR if name == FORCE_NOISE else SYSTEM], name)
            replace_file(folder / f"{name}.png", small(page.rendered(picture(one), "png")))
            print(f"{name}: {one.found.says}")


if __name__ == "__main__":
    with one_sentence():
        main(Path(sys.argv[1]), Path(sys.argv[2]))
