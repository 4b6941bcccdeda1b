"""The test that comes next in words, and as files: all numbers, its force for a shaker, and a picture."""

import math
import wave
from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any

import numpy as np
from tabulate import tabulate

from study.compare.comparison_report import as_json
from study.diagnose.designs import AS_WAS, BLOW, LET_GO, MULTISINE, SWEEP, Design, Limits, PresentTest
from study.diagnose.diagnosis_sentences import effect_in_words
from study.diagnose.next_test import DECIDES, WORTH, Choice, NextTest, driving
from study.diagnose.precision import PreciseTest
from study.diagnose.ranked import Ranked
from study.figures.labels import prefixed
from study.records.interpolation import between_samples
from study.records.record import MOTIONS, Sensor
from study.support.arrays import Floats
from study.support.extras import undrawn
from study.support.numbers import enumerated, percent


def rival_in_words(row: Ranked, rows: Sequence[Ranked]) -> str:
    """What a rival has that not all of them have, in words."""
    own = [effect_in_words(e) for e in row.entries if not all(e.name in r.names for r in rows)]
    return enumerated(own) if own else "nothing more"


def next_test_in_words(found: NextTest) -> str:
    """Which test decides, and how sure that is."""
    rows, choice = found.rivals.rows, found.choice
    names = enumerated([rival_in_words(row, rows) for row in rows])
    test = design_in_words(choice.design, found.rivals.present)
    needs = "" if choice.sensor is None else f", with {_sensor_in_words(choice.sensor)} measured"
    words = [f"{test[0].upper()}{test[1:]}{needs}, decides between {names} with {_sure(choice.promise)}"]
    again = None if found.again is None or _same(found.again, choice) else found.again
    words[0] += "." if again is None else f"; a repetition of this record's test, {_sure(again.promise)}."
    if choice.promise < DECIDES:
        words.append(f"Of {found.asked} tests within the limits none decides with {percent(DECIDES)}.")
        level = [
            f"{rival_in_words(rows[i], rows)} from {rival_in_words(rows[j], rows)}"
            for i in range(len(rows)) for j in range(len(rows))
            if i != j and choice.pairs[i, j] < 0.1
        ]  # fmt: skip
        if 0 < len(level) <= 3:
            words.append(f"If the first of a pair is true, it would not tell {enumerated(level)}.")
        elif level:
            words.append(f"It would not tell {len(level)} of the {len(rows) * (len(rows) - 1)} pairs apart.")
    if not choice.rehearsed and choice.promise >= WORTH:
        words.append("That rests on sensitivities alone: the test cannot be rehearsed together with this record.")
    if choice.sensor is not None:
        words.append(
            "That assumes noise in the same proportion to the motion as now; diagnose its record by itself "
            f"(--response {choice.sensor.motion}), as this one has no such sensor."
        )
    return " ".join(words)


def likely(found: NextTest) -> bool:
    """Whether a test that was not rehearsed is named beside a diagnosis: it decides more likely than not."""
    return found.choice.promise >= 0.5


def advice_in_words(found: NextTest | None) -> str:
    """The test that comes next in a line or two beside a diagnosis, which knows no limits of the user's."""
    if found is None:
        return ""
    within = "within twice the force and motion of this record"
    if not likely(found):
        return (
            f"Of {found.asked} tests {within} none is likely to decide between them; 'study plan' takes other limits."
        )
    test = design_in_words(found.choice.design, found.rivals.present)
    needs = "" if found.choice.sensor is None else f", with {_sensor_in_words(found.choice.sensor)} measured"
    return (
        f"The test that is most likely to decide between them {within}: {test}{needs}; 'study plan', given such "
        "limits, rehearses it, says how sure it is, and writes its force."
    )


def _same(one: Choice, other: Choice) -> bool:
    return one.design is other.design and other.sensor is None


def _sure(promise: float) -> str:
    """A probability as it may be said: nothing is certain."""
    return "less than 1 %" if promise < 0.01 else f"{min(math.floor(100.0 * promise + 0.5), 99)} %"


def _sensor_in_words(sensor: Sensor) -> str:
    return f"the {sensor.motion}{f' at {sensor.coordinate}' if sensor.coordinate else ''}"


def design_in_words(design: Design, present: PresentTest) -> str:
    """A test, how loud and how long."""
    low, high = (f"{f:.3g}" for f in design.band)
    record = design.record
    if design.kind == LET_GO:
        return f"{_let_go(design, present)}, {design.length:.3g} s"
    peak = _quantity(present.largest(record), present.unit)
    times = "the same" if design.level == 1.0 else f"{design.level:.2g} times the"
    level = f"at {times} level (largest {present.driven_by} {peak})"
    match design.kind:
        case _ if design.kind == AS_WAS:
            words = f"the same {'motion' if present.prescribed else 'force'}"
        case _ if design.kind == SWEEP:
            words = f"a sweep from {low} to {high} Hz"
        case _ if design.kind == MULTISINE:
            words = f"a multisine from {low} to {high} Hz"
        case _ if design.kind == BLOW:
            words = f"blows {10.37 / present.resonance:.3g} s apart"
        case _:
            own = "the same force" if design.place == AS_WAS else f"a multisine from {low} to {high} Hz"
            words = f"{own} on top of a steady one of half the largest"
    return f"{words} {level}, {design.length:.3g} s"


def _quantity(value: float, unit: str) -> str:
    factor, shown = prefixed(unit, abs(value))
    return f"{value / factor:.3g} {shown}".rstrip()


def _let_go(design: Design, present: PresentTest) -> str:
    if not present.drivers:
        return f"a release from {design.level:.2g} times the amplitude"
    place = int(np.argmax(np.abs(design.begin[: present.coordinates])))
    at = present.source.coordinates[place] if present.coordinates > 1 else ""
    unit = present.source.unit(Sensor(present.source.coordinates[0], MOTIONS[0]))
    how_far = _quantity(float(abs(design.begin[place])), unit)
    force = _quantity(design.level * present.reached, present.unit)
    return f"a release from rest under a steady force of {force} ({how_far}{f' at {at}' if at else ''})"


def precise_test_in_words(found: PreciseTest) -> str:
    """Which test tells a value as closely as is wanted."""
    test = design_in_words(found.design, found.present)
    said = f"{test[0].upper()}{test[1:]}, brings the 95 % interval of {found.key} to +- {percent(found.width)} of it"
    again = "" if math.isnan(found.again) else f"; a repetition of this record's test, +- {percent(found.again)}"
    said += f" (now +- {percent(found.now)}{again})."
    if found.now <= found.wanted:
        known, asked = percent(found.now), percent(found.wanted)
        said = f"This record tells {found.key} to +- {known} of it already, and {asked} is asked for. {said}"
    if found.width > found.wanted:
        said += f" Of {found.asked} tests within the limits none brings it to {percent(found.wanted)}."
    return said


def pair_table(found: NextTest) -> str:
    """How sure each rival is told from each other, if it is the true one."""
    rows = found.rivals.rows
    names = [rival_in_words(row, rows) for row in rows]
    cells = [
        [name, *("-" if i == j else _sure(float(found.choice.pairs[i, j])) for j in range(len(rows)))]
        for i, name in enumerate(names)
    ]
    head = ["if true", *(f"told from {name}" for name in names)]
    return tabulate(cells, head, tablefmt="simple", disable_numparse=True)


def next_test_fields(found: NextTest) -> dict[str, Any]:
    """Which test it is, for ``plan.json`` and ``diagnosis.json``."""
    rows = found.rivals.rows
    return {
        "rivals": [list(row.names) for row in rows],
        "test": design_fields(found.choice.design),
        "sensor": None if found.choice.sensor is None else str(found.choice.sensor), "asked": found.asked,
    }  # fmt: skip


def promise_fields(found: NextTest) -> dict[str, Any]:
    """How sure it is, in ``plan.json``."""
    again = None if found.again is None else found.again.promise
    pairs, rehearsed = found.choice.pairs.tolist(), found.choice.rehearsed
    return {"promise": found.choice.promise, "told_apart": pairs, "rehearsed": rehearsed, "as_was": again}


def design_fields(design: Design) -> dict[str, Any]:
    """A test for a file."""
    return {
        "kind": design.kind, "band": design.place, "from_hz": design.band[0], "to_hz": design.band[1],
        "level": design.level, "seconds": design.length, "begins_from": design.begin.tolist(),
    }  # fmt: skip


def precise_test_fields(found: PreciseTest) -> dict[str, Any]:
    """What ``plan.json`` holds of a test for the sake of precision."""
    return {
        "key": found.key, "value": found.value, "wanted": found.wanted, "now": found.now, "half_width": found.width,
        "as_was": None if math.isnan(found.again) else found.again, "test": design_fields(found.design),
        "asked": found.asked,
    }  # fmt: skip


def deciding_plan(found: NextTest) -> tuple[str, dict[str, bytes]]:
    """A test that decides: what to print, and the content of its files."""
    said, rivals = next_test_in_words(found), found.rivals
    fields = next_test_fields(found) | promise_fields(found)
    scale, files = _plan_files(fields, said, found.limits, rivals.present, found.choice.design)
    told = f"{pair_table(found)}\n\n{said}{scale}"
    if undrawn():
        return told, files
    from study.diagnose.next_test_pictures import next_test_pictures  # which would make the page begin later

    return told, files | next_test_pictures(found)


def precise_plan(found: PreciseTest) -> tuple[str, dict[str, bytes]]:
    """The same of a test for the sake of precision."""
    said = precise_test_in_words(found)
    scale, files = _plan_files(precise_test_fields(found), said, found.limits, found.present, found.design)
    return f"{said}{scale}", files


def _plan_files(
    fields: Mapping[str, Any], said: str, limits: Limits, present: PresentTest, design: Design
) -> tuple[str, dict[str, bytes]]:
    """What to say of the scale of the WAV file, and ``plan.json``, CSV and WAV of what drives the test, if any does."""
    kept = {"force": limits.force, "displacement": limits.displacement, "seconds": limits.length}
    content = {**fields, "limits": kept, "says": said}
    driven = driving(present, design, present.every)
    if not driven:
        return "", {"plan.json": as_json(content)}
    dt = present.source.dt / present.every
    units = {name: present.unit if present.based else present.source.unit(name) for name in driven}
    time = dt * np.arange(len(next(iter(driven.values()))))
    head = ",".join(["time [s]", *(f"{name} [{units[name]}]" for name in driven)])
    lines = (",".join(f"{x:.9g}" for x in row) for row in np.column_stack([time, *driven.values()]).tolist())
    sound, rate, scale = as_wav(list(driven.values()), dt)
    unit = units[next(iter(driven))]
    content |= {"wav": {"rate_hz": rate, "full_scale": scale, "unit": unit}}
    return f" In next_test.wav ({rate} Hz, 32 bits) full scale is {scale:.6g} {unit}.", {
        "plan.json": as_json(content), "next_test.csv": ("\n".join([head, *lines]) + "\n").encode(),
        "next_test.wav": sound,
    }  # fmt: skip


def as_wav(channels: Sequence[Floats], dt: float) -> tuple[bytes, int, float]:
    """Channels as a WAV file of 32 bits, its rate in hertz, and the value that full scale stands for.

    A rate of such a file is a whole number: others are brought to the next one above, band-limited.
    """
    rate = math.ceil(1.0 / dt - 1e-6)
    columns = list(channels)
    if abs(rate * dt - 1.0) > 1e-6:
        fine = [between_samples(values, 16) for values in columns]
        places = np.arange(0.0, (len(columns[0]) - 1) * dt, 1.0 / rate)
        columns = [np.interp(places, dt / 16 * np.arange(len(values)), values) for values in fine]
    scale = max(float(np.max(np.abs(values))) for values in columns)
    numbers = np.rint(np.column_stack(columns) / scale * (2**31 - 1)).astype("<i4")
    target = BytesIO()
    with wave.open(target, "wb") as file:
        file.setnchannels(len(columns))
        file.setsampwidth(4)
        file.setframerate(rate)
        file.writeframes(numbers.tobytes())
    return target.getvalue(), rate, scale
