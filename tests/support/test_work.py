"""How much is done, counted: by all threads together, in parts and within limits, as many on any machine."""

from dataclasses import replace

import numpy as np
import pytest

from study.equations.free_run import FreeRun, prepare
from study.equations.model import Model, free
from study.equations.terms import get
from study.records.record import Record
from study.support import work
from study.support.cores import side_by_side


def test_all_threads_count_together_up_to_the_limit() -> None:
    with work.limited_to(100):
        list(side_by_side(work.add, [1, 2, 3, 4], workers=2))
        assert work.done() == 10
        work.add(89)
        work.go_on()
        assert not work.is_done()
        work.add(1)
        assert work.is_done()
        with pytest.raises(work.WorkDoneError):
            work.go_on()
    work.go_on()


def test_the_limit_around_all_else_counts() -> None:
    with work.limited_to(10), work.limited_to(1):
        work.add(5)
        assert not work.is_done()


def test_nothing_is_counted_where_nobody_has_set_a_limit() -> None:
    work.add(10**15)
    assert work.done() == 0
    assert not work.is_done()


def counted(run: FreeRun, model: Model | None = None) -> int:
    values = {} if model is None else {key: model.numbers()[key] for key in run.keys}
    with work.limited_to(np.inf):
        run.respond(values, np.zeros((1 + len(run.cuts), 2)))
        return work.done()


def test_a_free_run_counts_its_steps(systems: dict[str, Model], records: dict[str, Record]) -> None:
    """Instructions and numbers of states, in four stages a step; derivatives by a key are numbers as well."""
    linear, record = systems["linear"], records["linear"]
    run, keys = prepare(linear, record), prepare(linear, record, ("k",))
    steps = 2 * (len(record) - 1)
    assert counted(run) == 4 * steps * (len(run.motion.program.code) + 2)
    assert counted(keys, linear) == 4 * steps * (len(keys.motion.program.code) + 2 * 2)


def test_segments_on_two_threads_count_as_much_as_on_one(
    systems: dict[str, Model], records: dict[str, Record], monkeypatch: pytest.MonkeyPatch
) -> None:
    cuts = tuple(range(100, len(records["linear"]) - 100, 100))
    run = prepare(systems["linear"], records["linear"], restarts=cuts)
    together = counted(run)
    monkeypatch.setattr("study.equations.free_run.SHARED", np.inf)
    assert counted(run) == together > 0


def test_a_step_that_dry_friction_cuts_counts_its_parts(systems: dict[str, Model], records: dict[str, Record]) -> None:
    model = systems["linear"].with_term(replace(free(get("coulomb_friction")), coefficients=(0.1,)))
    run = prepare(model, records["linear"])
    uncut = 4 * 2 * (len(records["linear"]) - 1) * (len(run.motion.program.code) + 2)
    assert counted(run) > 1.1 * uncut
