"""A single mass is a structure with one coordinate: records told once without and once with names of everything."""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from study.compare.by_estimator import FREE_RUN
from study.compare.comparison import Comparison, across_records, compare
from study.compare.comparison_report import as_json, comparison_document, comparison_summary, tables
from study.compare.each_record import levels_by_record, rows, separated
from study.diagnose.adding import added
from study.diagnose.diagnosis_files import diagnosis_files, diagnosis_in_words
from study.diagnose.verdict import Diagnosis, diagnose
from study.equations.model import Model, free
from study.equations.place import Place
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.explore.saved import of_comparison
from study.faults.accounting import Accounted
from study.faults.fault import FaultSettings
from study.records.excitation import Excitation, force
from study.records.prepared import prepare_record
from study.records.record import Record, Sensor, record_of
from study.records.record_layout import Layout
from study.way_in.compare_records import compare_records

DT, N = 0.02, 4096
VALUES = {"m": 1.0, "c": 3.77, "k": 355.3, "k3": 4e5}
LINEAR = ("inertia", "linear_damping", "linear_stiffness")
HARD = Model("hard", tuple(free(get(n)).with_values(VALUES) for n in (*LINEAR, "cubic_stiffness")))
ALONE = Model("believed", tuple(free(get(n)) for n in LINEAR))
AT, FROM_GROUND = Place("at", ("x",)), Place("between", ("ground", "x"))
NAMED = Model(
    "believed", tuple(replace(t, place=AT if t.term.name == "inertia" else FROM_GROUND) for t in ALONE.terms), ("x",),
    (("shaker", "x"),),
)  # fmt: skip


def shaken(level: float = 1.0, seed: int = 1, noise: float = 0.01) -> Record:
    drive, rng = force(Excitation(level=level), N, DT, seed), np.random.default_rng(seed + 1)
    u = simulate(HARD, drive, DT, Integrator("rk4", 4))["displacement"]
    channels = {"force": drive, "displacement": u + noise * np.std(u) * rng.standard_normal(N)}
    return Record(DT, channels, name=f"level_{level:g}")


def early(samples: int) -> Record:
    """The response read so many samples early."""
    record = shaken()
    shifted = {"force": record["force"][:-samples], "displacement": record["displacement"][samples:]}
    return record.with_channels(shifted)


def let_go() -> Record:
    """A decay that begins where the spring is hard."""
    damped = HARD.with_values({"c": 0.4})
    still, rng = np.zeros(N), np.random.default_rng(5)
    u = simulate(damped, still, DT, Integrator("rk4", 8), initial=(0.02, 0.0))["displacement"]
    return Record(DT, {"force": still, "displacement": u + 0.002 * np.std(u) * rng.standard_normal(N)}, name="decay")


def on_a_table() -> Record:
    """The force of a base of which the acceleration was measured."""
    record = shaken()
    still = {"force": np.zeros(N), "base_acceleration": -record["force"]}
    return record.with_channels(still)


def named(record: Record) -> Record:
    """The same record with other names of its channels."""
    drive = {"shaker": record["force"]} if np.any(record["force"]) else {}
    base = {name: values for name, values in record.channels.items() if name.startswith("base_")}
    return record_of(DT, drive, {Sensor("x", "displacement"): record["displacement"]}, base, name=record.name)


@dataclass(frozen=True, eq=False)
class Told:
    """What is found of the same records without and with names."""

    accounted: tuple[Accounted, Accounted]
    diagnoses: tuple[Diagnosis, Diagnosis]

    @property
    def comparisons(self) -> tuple[Comparison, Comparison]:
        return self.accounted[0].comparison, self.accounted[1].comparison


def told(records: Sequence[Record], settings: FaultSettings | None = None) -> Told:
    structure = NAMED if any(np.any(r["force"]) for r in records) else replace(NAMED, forces=())
    one = compare_records(records, ALONE, Layout(), settings)
    other = compare_records([named(r) for r in records], structure, Layout(), settings)
    return Told((one, other), (diagnose(one.comparison), diagnose(other.comparison)))


PLAIN = FaultSettings(switched_off=("delay",))
CASES = {
    "driven": lambda: told([shaken()], PLAIN),
    "early": lambda: told([early(2)]),
    "base": lambda: told([on_a_table()], PLAIN),
    "decay": lambda: told([let_go()]),
    "several": lambda: told([shaken(), shaken(0.3, seed=7)]),
}


SLOW = ("early", "decay", "several")  # half a minute or more for two diagnoses


@pytest.fixture(scope="module", params=[pytest.param(n, marks=pytest.mark.long if n in SLOW else ()) for n in CASES])
def pair(request: pytest.FixtureRequest) -> Told:
    return CASES[request.param]()


def test_coefficients_errors_and_modes_are_the_same(pair: Told) -> None:
    one, other = pair.comparisons
    assert other.prediction.error == pytest.approx(one.prediction.error, rel=1e-6)
    assert other.prediction.floor == pytest.approx(one.prediction.floor, rel=1e-6)
    assert other.prepared.plan == one.prepared.plan
    for a, b in zip(one.coefficients, other.coefficients, strict=True):
        assert b.key.startswith(f"{a.key}[")
        assert (b.unit, b.term, b.held) == (a.unit, a.term, a.held)
        assert b.value == pytest.approx(a.value, rel=1e-6)
        assert (b.error or 0.0) == pytest.approx(a.error or 0.0, rel=1e-5)
    assert other.modes.frequency == pytest.approx(one.modes.frequency, rel=1e-6)
    assert other.modes.damping_error == pytest.approx(one.modes.damping_error, rel=1e-4)
    assert one.prediction.error < 0.9


def test_the_faults_are_the_same(pair: Told) -> None:
    one, other = pair.accounted
    assert [f.fault for f in other.faults] == [f.fault for f in one.faults]
    for a, b in zip(one.faults, other.faults, strict=True):
        assert b.channel == f"x {a.channel}"
        assert b.value == pytest.approx(a.value, rel=1e-5)


def test_the_missing_force_and_what_it_grows_with_are_the_same(pair: Told) -> None:
    one, other = pair.comparisons
    expected = one.missing_force.force
    assert other.missing_force.force == pytest.approx(expected, abs=1e-5 * np.std(expected))
    assert other.place == FROM_GROUND
    assert (one.growths is None) == (other.growths is None)
    if one.growths is not None and other.growths is not None:
        best, again = one.growths.ways[0], other.growths.ways[0]
        assert (best.of, best.parity) == (again.of, again.parity)
        assert again.power == pytest.approx(best.power, abs=1e-3)


def test_the_diagnosis_is_the_same(pair: Told) -> None:
    one, other = pair.diagnoses
    assert (other.verdict, other.asked) == (one.verdict, one.asked)
    assert other.left == pytest.approx(one.left, rel=1e-3, abs=1e-9)
    assert [c.term.name for c in other.candidates] == [c.term.name for c in one.candidates]
    for a, b in zip(one.candidates, other.candidates, strict=True):
        assert b.response_error == pytest.approx(a.response_error, rel=1e-4)
        assert b.effect.coefficient == pytest.approx(a.effect.coefficient, rel=1e-3)
        assert b.effect.unit == a.effect.unit
    assert one.candidates[0].term.name == "cubic_stiffness"


def colours() -> Record:
    """The linear structure with noise of a colour, with which a fit of the true model is weighted."""
    drive, rng = force(Excitation(), N, DT, 3), np.random.default_rng(4)
    u = simulate(HARD.with_values({"k3": 0.0}), drive, DT, Integrator("rk4", 4))["displacement"]
    noise = lfilter([1.0], [1.0, -0.95], rng.standard_normal(N))
    return Record(DT, {"force": drive, "displacement": u + 0.1 * np.std(u) / np.std(noise) * noise}, name="coloured")


def spiky() -> Record:
    """With spikes, an offset, and the hardening spring that the model lacks."""
    record, rng = shaken(), np.random.default_rng(6)
    u = record["displacement"].copy()
    u[rng.choice(N, 8, replace=False)] += 8.0 * np.std(u)
    return record.with_channels({"displacement": u + 0.3 * np.std(u)})


def blown() -> Record:
    """Blows of a hammer."""
    drive, rng = force(Excitation("blows", level=8.0, blows=24), N, DT, 7), np.random.default_rng(8)
    u = simulate(HARD, drive, DT, Integrator("rk4", 8))["displacement"]
    noisy = u + 0.005 * np.std(u) * rng.standard_normal(N)
    return Record(DT, {"force": drive, "displacement": noisy}, name="blows")


def component() -> Record:
    """Spring and damper alone, their motion prescribed and the force measured."""
    u, rng = shaken(noise=0.0)["displacement"], np.random.default_rng(9)
    v = np.gradient(u, DT)
    load = VALUES["c"] * v + VALUES["k"] * u + VALUES["k3"] * u**3
    noisy = load + 0.01 * np.std(load) * rng.standard_normal(N)
    return Record(DT, {"force": noisy, "displacement": u, "velocity": v}, name="part")


def without_inertia(model: Model) -> Model:
    return replace(model, terms=model.terms[1:])


def compared(records: Sequence[Record], model: Model, **more: Any) -> Accounted:
    return compare_records(records, model, Layout(), PLAIN, **more)


MORE: dict[str, Callable[[], tuple[Accounted, Accounted]]] = {
    "noise of a colour": lambda: (compared([colours()], ALONE), compared([named(colours())], NAMED)),
    "spikes": lambda: (compare_records([spiky()], ALONE), compare_records([named(spiky())], NAMED)),
    "blows": lambda: (compared([blown()], ALONE), compared([named(blown())], NAMED)),
    "component": lambda: (
        compared([component()], without_inertia(ALONE)),
        compared([with_its_velocity(component())], without_inertia(NAMED)),
    ),
    "local polynomials": lambda: (
        compared([shaken()], ALONE, estimator="local_polynomial"),
        compared([named(shaken())], NAMED, estimator="local_polynomial"),
    ),
}


def with_its_velocity(record: Record) -> Record:
    motions = {Sensor("x", motion): record[motion] for motion in ("displacement", "velocity")}
    return record_of(DT, {"shaker": record["force"]}, motions, name=record.name)


@pytest.fixture(scope="module", params=MORE)
def further(request: pytest.FixtureRequest) -> tuple[Accounted, Accounted]:
    return MORE[request.param]()


def leaves(content: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Every value of a document with where it stands, labels taken off its words."""
    if isinstance(content, dict):
        for key, value in content.items():
            yield from leaves(value, f"{path}.{key}" if path else key)
    elif isinstance(content, list):
        for k, value in enumerate(content):
            yield from leaves(value, f"{path}.{k}")
    else:
        yield unlabelled(path), unlabelled(content) if isinstance(content, str) else content


def unlabelled(words: str) -> str:
    """Words without the names of the coordinate, of its force and of the places."""
    words = re.sub(r", (at: x|between: \[ground, x\])(?=[,}])|\[(ground-)?x\]", "", words)
    words = re.sub(r"\bx:? (?=displacement|velocity|acceleration|force)", "", words)
    words = re.sub(r" (at x|between the ground and x)\b|(?<=; )between the ground and x ", "", words)
    words = re.sub(r"^{term: (\w+)}$", r"\1", words)
    return words.replace("at places", "").replace("effects and places", "candidates").replace("shaker", "force")


def told_once(content: Any) -> Any:
    """A document of the named coordinate with what names a place and an effect as the effect alone."""
    if isinstance(content, list):
        if content and all(isinstance(item, dict) and {"on", "explained"} <= {*item} for item in content):
            return {item["on"]: item["explained"] for item in content}
        return [told_once(item) for item in content]
    if not isinstance(content, dict):
        return content
    if {*content} in ({"term", "at"}, {"term", "between"}):
        return content["term"]
    return {key: told_once(value) for key, value in content.items()}


def same_but_for_labels(one: bytes, other: bytes) -> None:
    """Whether all that is told of a single mass is told of the named coordinate: a structure may tell more."""
    again, count = dict(leaves(told_once(json.loads(other)))), 0
    for path, value in leaves(json.loads(one)):
        if path.endswith("model.equation"):  # a structure has one for each coordinate
            continue
        count += 1
        if isinstance(value, float) and again[path] is not None:
            assert again[path] == pytest.approx(value, rel=1e-3, abs=1e-6), path
        else:
            assert again[path] == value, path
    assert count > 20


def test_the_json_is_the_same_but_for_labels(pair: Told) -> None:
    same_but_for_labels(*(as_json(comparison_document([c])) for c in pair.comparisons))
    same_but_for_labels(*(written(d, a) for d, a in zip(pair.diagnoses, pair.accounted, strict=True)))


def written(diagnosis: Diagnosis, accounted: Accounted) -> bytes:
    return diagnosis_files(diagnosis, diagnosis_in_words(diagnosis), (), accounted.faults)["diagnosis.json"]


def test_the_json_of_other_tests_and_estimators_is_the_same_but_for_labels(
    further: tuple[Accounted, Accounted],
) -> None:
    same_but_for_labels(*(as_json(comparison_document([a.comparison])) for a in further))
    assert [f.fault for f in further[0].faults] == [f.fault for f in further[1].faults]


@pytest.mark.long
def test_the_diagnosis_of_other_tests_is_the_same_but_for_labels(further: tuple[Accounted, Accounted]) -> None:
    if further[0].comparison.estimator == FREE_RUN:  # the only one that a diagnosis goes on from
        same_but_for_labels(*(written(diagnose(a.comparison), a) for a in further))


def test_several_records_are_told_the_same_each_by_itself_and_with_coefficients_of_their_own() -> None:
    records = [shaken(), shaken(0.3, seed=7)]
    told_of = list[bytes](), list[bytes]()
    for model, given, found in zip((ALONE, NAMED), (records, [named(r) for r in records]), told_of, strict=True):
        apart = [compared([record], model).comparison for record in given]
        found.append(as_json(comparison_document(apart, across_records(apart))))
        own, marked, separate = separated(model, given, ["linear_damping"])
        together = compared(marked, own).comparison
        levels = rows(levels_by_record(together, separate, given), given)
        found.append(as_json({**comparison_document([together]), "coefficients_by_record": levels}))
    for one, other in zip(*told_of, strict=True):
        same_but_for_labels(one, other)


def test_the_tables_and_the_page_tell_of_the_coordinate_what_they_tell_of_the_mass(pair: Told) -> None:
    one, other = ([[c.strip() for c in re.split(r"  +", unlabelled(line))]
                   for line in comparison_summary([c]).splitlines()] for c in pair.comparisons)  # fmt: skip
    at, again = (next(i for i, row in enumerate(rows) if "response error" in row) for rows in (one, other))
    (heads, values), (others, again_values) = (
        ([head for head in rows[i] if head], rows[i + 2]) for rows, i in ((one, at), (other, again))
    )
    assert "force error" in heads
    told_too = dict(zip(others, again_values, strict=True))
    assert values[-len(heads) :] == [told_too[head] for head in heads]
    files = [tables([c]) for c in pair.comparisons]
    assert files[1].keys() >= files[0].keys()
    panels = [{*re.findall(r'data-panel="(\w+)"', of_comparison(c).decode())} for c in pair.comparisons]
    assert panels[0] <= panels[1]
    assert "force" in panels[0]


def test_a_structure_of_one_coordinate_is_compared_and_added_to_like_a_mass() -> None:
    record = shaken()
    before = compare(ALONE, prepare_record(record)), compare(NAMED, prepare_record(named(record)))
    one, other = (
        added(b, free(get("cubic_stiffness"), place)).prediction
        for b, place in zip(before, (ALONE.terms[0].place, FROM_GROUND), strict=True)
    )
    assert other.error == pytest.approx(one.error, rel=1e-6)


def test_an_estimator_of_the_users_choice_finds_the_same() -> None:
    record = shaken()
    one = compare(ALONE, prepare_record(record), estimator="local_polynomial")
    other = compare(NAMED, prepare_record(named(record)), estimator="local_polynomial")
    assert other.prediction.error == pytest.approx(one.prediction.error, rel=1e-6)
    for a, b in zip(one.coefficients, other.coefficients, strict=True):
        assert (b.value, b.error) == pytest.approx((a.value, a.error), rel=1e-6)
