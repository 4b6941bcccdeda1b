"""Terms that a structure does as well without."""

from dataclasses import replace

import pytest

from study.compare.comparison import compare
from study.diagnose.needless import needless
from study.equations.model import free
from study.equations.place import Place
from study.equations.terms import get
from study.records.plan import make_plan
from study.records.prepared import prepare_record

CUBIC = free(get("cubic_stiffness"), Place("between", ("floor2", "floor3")))
DRAG = free(get("quadratic_damping"), Place("between", ("ground", "floor1")))


@pytest.fixture(scope="module")
def found(believed, record_of):
    model = replace(believed, terms=(*believed.terms, CUBIC, DRAG))
    return needless(compare(model, prepare_record(record_of(), make_plan(record_of(), (0, 1500), (1500, 3000)))))


def test_the_term_that_the_record_lacks_is_named_with_its_place_and_no_other(found):
    assert [n.name for n in found] == ["quadratic_damping[ground-floor1]"]
    (only,) = found
    assert only.sentence().startswith("Quadratic damping between the ground and floor1 is not needed: without it")
    assert only.error_without < 1.01 * only.error_with
    assert only.p_value > 0.05
    assert "quadratic_damping" not in {t.term.name for t in only.fit.model.terms}


def test_a_given_value_is_not_asked_for(believed, record_of):
    drag = replace(DRAG, coefficients=(0.0,))
    model = replace(believed, terms=(*believed.terms, CUBIC, drag))
    prepared = prepare_record(record_of(), make_plan(record_of(), (0, 1500), (1500, 3000)))
    assert needless(compare(model, prepared)) == ()
