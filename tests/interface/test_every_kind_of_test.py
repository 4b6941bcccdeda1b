"""Each kind of test in a notebook, as on the command line, and what a user may do wrong with it there."""

import inspect
import json
import pydoc
from pathlib import Path

import numpy as np
import pytest

import study as st
from study import cli
from study.trials import make_trial

LINEAR = st.Model("inertia", "linear_damping", "linear_stiffness", name="rig")
TRUE = st.Model(
    st.term("inertia", value=1.0), st.term("linear_damping", value=0.6), st.term("linear_stiffness", value=355.3),
    st.term("cubic_stiffness", value=2e6), name="truth",
)  # fmt: skip
MODAL = """name: pair
coordinates: [a, b]
forces: {shaker: a}
linear: modal
terms: []
"""


def drawn(test: str, hidden: tuple[str, ...] = (), seed: int = 4) -> tuple[st.Record, st.Model]:
    trial = make_trial(seed, hidden, 0.01, test=test)
    return st.Record.of(trial.record), st.Model.of(trial.believed)


def decays(*heights: float, samples: int = 1200) -> st.Record:
    """One behind the other, as between blows."""
    force = st.Force(np.zeros(samples), 0.02)
    parts = [st.simulate(TRUE, force, initial=(h, 0.0), steps=8)["displacement"] for h in heights]
    u = np.concatenate(parts)
    u = u + 0.003 * np.std(u) * np.random.default_rng(5).standard_normal(len(u))
    return st.record({"displacement": u}, dt=0.02, name="decay")


@pytest.fixture(scope="module")
def levels() -> list[st.Record]:
    """Two records of one rig whose damping differs between them, both of one name."""
    rigs = [TRUE.drop("cubic_stiffness").hold(c=c) for c in (2.0, 4.0)]
    return [st.simulate(rig, st.gaussian(1.0, samples=2048, seed=k), name="rig") for k, rig in enumerate(rigs)]


@pytest.mark.usefixtures("numbers_only")
@pytest.mark.parametrize("test", ["free_decay", "blows", "component", "base", "axis"])
def test_a_fit_is_that_of_the_command(test: str, tmp_path: Path) -> None:
    record, model = drawn(test)
    record.save(tmp_path / "record.csv")
    model.save(tmp_path / "rig.yaml", values=False)
    words = ["compare", tmp_path / "record.csv", "--model", tmp_path / "rig.yaml", "--out", tmp_path / "out"]
    assert cli.main([str(word) for word in words]) == 0
    told = json.loads((tmp_path / "out" / "comparison.json").read_text())
    fit = model.free().fit(st.read(tmp_path / "record.csv"))
    assert {c["key"]: c["value"] for c in told["coefficients"]} == pytest.approx(
        {key: c.value for key, c in fit.coefficients.items()}, rel=1e-9
    )
    assert told["error"]["response"] == pytest.approx(fit.error, rel=1e-9)
    assert told["notes"] == list(fit.comparison.notes)
    assert fit.plot().lines


def test_the_effect_missing_from_a_decay_is_found_and_added() -> None:
    fit = LINEAR.fit(decays(0.02, samples=2400))
    assert fit.coefficients["m"].held
    assert fit.coefficients["k"].unit == "1/s^2"
    found = fit.diagnose(without=[n for n in st.library().index if "cubic" not in n and n not in fit.given.terms])
    assert found.best is not None
    assert found.best.name == "cubic_stiffness"
    better = fit.add(found.best)
    assert better.error < 0.1 * fit.error
    assert better.coefficients["k3"].value == pytest.approx(2e6, rel=0.05)


def test_stretches_between_blows_are_used_alone() -> None:
    model, record = TRUE.free(), decays(0.02, 0.01)
    fit = model.fit(record, use=[(0.0, 23.9), (24.0, None)])
    assert fit.coefficients["k"].value == pytest.approx(355.3, rel=1e-3)
    assert any("every other block of 2 stretches" in note for note in fit.comparison.notes)
    assert fit.error < 0.05
    across = [s.first * 0.02 for s in fit.record.stretches]
    assert not [t for t in across if 23.9 < t < 24.0]


def test_a_column_of_a_force_that_is_none_is_left_out() -> None:
    u = decays(0.02)["displacement"]
    noise = np.random.default_rng(1).standard_normal(len(u))
    table = {"force": noise, "displacement": u}
    assert not st.record(table, dt=0.02).unforced
    free = st.record(table, dt=0.02, free=True)
    assert free.unforced
    assert LINEAR.fit(free).coefficients["m"].held


def test_a_column_of_a_force_that_is_none_is_left_out_of_a_file(tmp_path: Path) -> None:
    u = decays(0.02)["displacement"]
    table = np.column_stack([np.arange(len(u)) * 0.02, np.random.default_rng(1).standard_normal(len(u)), u])
    np.savetxt(tmp_path / "rig.csv", table, delimiter=",", header="time,force,displacement", comments="")
    assert st.read(tmp_path / "rig.csv", free=True).unforced


def test_an_absolute_response_on_a_moving_base_is_taken_relative_to_it() -> None:
    record, model = drawn("base")
    base = record["base_acceleration"]
    lines = 2j * np.pi * np.fft.rfftfreq(len(base), record.dt)
    motion = np.zeros(len(lines), dtype=complex)
    motion[1:] = np.fft.rfft(base)[1:] / lines[1:] ** 2
    moved = np.fft.irfft(motion, len(base))
    channels = {"base_displacement": moved, "displacement": record["displacement"] + moved}
    absolute = st.record(channels, dt=record.dt, name="table")
    fit, alone = model.fit(absolute, absolute=True), model.fit(record)
    assert fit.coefficients["k"].value == pytest.approx(alone.coefficients["k"].value, rel=0.02)
    assert any("relative to the base" in note for note in fit.comparison.notes)
    with pytest.raises(st.StudyError, match="base_displacement"):
        model.fit(st.record({"displacement": channels["displacement"], "base_acceleration": base}, dt=record.dt),
                  absolute=True)  # fmt: skip


def test_the_reverse_analysis_takes_a_moving_base_as_its_force() -> None:
    record, model = drawn("base")
    found, fit = st.identify(record, model, "local_polynomial"), model.fit(record)
    assert found.parameters["k"] == pytest.approx(fit.coefficients["k"].value, rel=0.05)


def test_blocks_are_judged_in_turn_where_that_is_asked(levels: list[st.Record]) -> None:
    fit = LINEAR.fit(levels[0], judge="every-other-block", measurement=False)
    assert len(fit.record.stretches) > 4
    assert LINEAR.fit(levels[0], measurement=False).record.stretches == ()
    assert LINEAR.fit(levels[0], fit=(0, 1000), measurement=False).comparison.plan.judge == (1000, 2048)
    assert LINEAR.fit(levels[0], judge=(1000, None), measurement=False).comparison.plan.fit == (0, 1000)


def test_one_model_is_fitted_to_several_records_and_what_may_differ_to_each(levels: list[st.Record]) -> None:
    together = LINEAR.fit(levels)
    assert together.record.name == "rig_1, rig_2"
    assert together.by_record().empty
    each = LINEAR.fit(levels, each_record=["linear_damping"])
    table = each.by_record()
    assert list(table.index) == [("c", "rig_1"), ("c", "rig_2")]
    assert table["value"].tolist() == pytest.approx([2.0, 4.0], rel=1e-3)
    assert table["differs"].all()
    assert each.error < 0.1 * together.error


def test_what_stands_beside_a_file_holds_whatever_is_said_of_faults(tmp_path: Path, levels: list[st.Record]) -> None:
    levels[0].save(tmp_path / "rig.csv")
    beside = tmp_path / "rig.record.yaml"
    beside.write_text("as_sampled: true\n")
    record = st.read(tmp_path / "rig.csv")
    assert LINEAR.fit(record, measurement=False).comparison.prepared.every == 1
    assert LINEAR.fit(record, measurement=False).error == LINEAR.fit(record, measurement=False, as_sampled=True).error
    beside.write_text("measurement: {hysterics: off}\n")
    with pytest.raises(st.StudyError, match="hysterics"):
        LINEAR.fit(record, measurement=False)


def test_two_fits_are_compared_in_a_list_or_side_by_side(levels: list[st.Record]) -> None:
    one, other = (m.fit(levels[0], measurement=False) for m in (LINEAR, LINEAR.drop("linear_damping")))
    assert repr(st.compare(one, other)) == repr(st.compare([one, other]))


def test_wrong_use_is_one_sentence(levels: list[st.Record], tmp_path: Path) -> None:
    (tmp_path / "pair.yaml").write_text(MODAL)
    record, decay = levels[0], decays(0.02)
    part = st.Model("linear_stiffness", name="part")
    fit = LINEAR.fit(record, measurement=False)
    cases = [
        (lambda: LINEAR.fit("rig.csv"), "'rig.csv' is no record; expected what st.read"),
        (lambda: LINEAR.fit([record, 3.0]), "3.0 is no record"),
        (lambda: LINEAR.fit([]), "no record is given"),
        (lambda: LINEAR.fit(record, fit=5), "fit is 5; expected a pair of samples"),
        (lambda: LINEAR.fit(record, fit=(0.5, 9)), "expected a pair of samples"),
        (lambda: LINEAR.fit(record, judge="half"), "or 'every-other-block'"),
        (lambda: LINEAR.fit(record, cutoff=-1.0), "cutoff is -1.0; expected a frequency above 0 Hz"),
        (lambda: LINEAR.fit(record, estimator="magic"), "there is no estimator 'magic'"),
        (lambda: LINEAR.fit(levels, fit=(0, 1000)), "rig_1, rig_2: --fit and --judge A:B name samples of one record"),
        (lambda: LINEAR.fit(record, each_record=["c"]), "there is one record; expected two or more"),
        (lambda: LINEAR.fit(levels, each_record="mass"), "no such term or coefficient"),
        (lambda: LINEAR.fit(decay, use=(2.0, 9.5)), "use names 2.0; expected pairs of times"),
        (lambda: LINEAR.fit(decay, use=[(9.5, 2.0)]), "expected pairs of times"),
        (lambda: LINEAR.fit(decay, use=[(0.0, 1e9)]), "leaves the record"),
        (lambda: LINEAR.fit(decay, use=[(0.0, 9.0), (5.0, 20.0)]), "overlap"),
        (lambda: LINEAR.fit(decay, use=[(0.0, 9.0)], fit=(0, 500)), "exclude each other"),
        (lambda: LINEAR.fit(decay, response="velocity"), "no velocity was measured"),
        (lambda: part.fit(decay), "no force was measured, which a model without inertia predicts"),
        (lambda: part.fit(record, response="displacement"), "so the force is predicted, not the displacement"),
        (lambda: st.identify(decay, LINEAR), "decay: no force acts; expected a driven record"),
        (lambda: st.identify([record, record], LINEAR), "2 records are given; expected one"),
        (lambda: st.identify("rig.csv", LINEAR), "'rig.csv' is no record"),
        (lambda: st.compare(fit, LINEAR), "is no fit; expected what a model's fit(record) gives"),
        (lambda: st.compare(1), "1 is no fit"),
        (lambda: fit.across([record, "low.csv"]), "'low.csv' is no record"),
        (lambda: st.Model(modal=True), "modal=True is of a structure; expected coordinates"),
        (
            lambda: st.Model.load(tmp_path / "pair.yaml").fit(record, judge="every-other-block"),
            "is a sum of modes, which are found in long stretches",
        ),
    ]  # fmt: skip
    for use, sentence in cases:
        with pytest.raises(st.StudyError) as caught:
            use()
        assert sentence in str(caught.value), str(caught.value)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["compare", "identify"])
def test_help_on_a_function_that_a_package_is_called_after_shows_the_function(name: str) -> None:
    function = getattr(st, name)
    shown = pydoc.render_doc(function, renderer=pydoc.plaintext)
    assert function.__doc__.splitlines()[0] in shown
    assert "PACKAGE CONTENTS" not in shown
    assert next(iter(inspect.signature(function).parameters)) in ("fits", "record")
