"""What several test modules share: the report's Table 1, written out a second time, and its records."""

from collections.abc import Callable, Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from study.equations import formulas, kernels
from study.equations.graph import Graph
from study.equations.model import Model, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.records.excitation import Excitation, force
from study.records.record import Record

Floats = NDArray[np.float64]
DT = 0.02
TABLE_1: dict[str, dict[str, dict[str, float]]] = {
    "linear": {},
    "duffing": {"cubic_stiffness": {"k3": 2.0e7}},
    "van_der_pol": {"van_der_pol_damping": {"c3": 2.0e6}},
    "duffing_van_der_pol": {"cubic_stiffness": {"k3": 2.0e7}, "van_der_pol_damping": {"c3": 2.0e6}},
    "mathieu": {"periodic_stiffness": {"km_cos": 177.7, "km_sin": 0.0, "periodic_stiffness.f_m": 1.0}},
    "dead_band": {"linear_damping": {"c": 1.89}, "dead_band": {"kg": -355.3, "dead_band.u_g": 0.0025}},
    "extreme": {
        "linear_damping": {"c": 0.0},
        "linear_stiffness": {"k": 0.0},
        "cubic_stiffness": {"k3": 2.0e7},
        "van_der_pol_damping": {"c3": 2.0e6},
    },
}
LINEAR = {"inertia": {"m": 1.0}, "linear_damping": {"c": 3.77}, "linear_stiffness": {"k": 355.3}}


FIRST = (
    "test_hidden_effects.py",
    "test_spectra.py",
    "test_damaged_files.py",
    "test_broken_records.py",
    "test_readers.py",
    "test_any_model_file.py",
    "test_model_file.py",
    "test_config.py",
    "test_figure_pages.py",
    "test_cli.py",
    "test_workflow.py",
    "test_kinds_of_tests.py",
    "test_agreement.py",
    "test_invariance.py",
    "test_loop_commands.py",
    "test_guard.py",
    "test_explore_page.py",
    "test_compare_command.py",
    "test_trials.py",
    "test_found.py",
    "test_pages.py",
    "test_explore.py",
    "test_needless.py",
    "test_open_shapes.py",
    "test_settings.py",
    "test_reach.py",
    "test_diagnose.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files begin first, else one core waits for another at the end."""
    items.sort(key=lambda item: FIRST.index(item.path.name) if item.path.name in FIRST else len(FIRST))


def build_model(name: str, terms: Mapping[str, Mapping[str, float]]) -> Model:
    """A model from the library's names and their values."""
    return Model(name, tuple(free(get(term)).with_values(values) for term, values in terms.items()))


@pytest.fixture(scope="session")
def systems() -> dict[str, Model]:
    """The systems of Table 1."""
    return {name: build_model(name, {**LINEAR, **terms}) for name, terms in TABLE_1.items()}


@pytest.fixture
def numbers_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands draw nothing, which is half of their time: for tests of numbers that several commands tell."""
    monkeypatch.setattr("study.figures.page.rendered", lambda *_: b"")
    monkeypatch.setattr("study.explore.saved.saved", lambda _: b"")


@pytest.fixture(scope="session")
def make_model() -> Callable[[str, Mapping[str, Mapping[str, float]]], Model]:
    """``make_model(name, {term: values})``."""
    return build_model


@pytest.fixture(scope="session")
def report_force() -> Floats:
    """The report's force at full length: 8 192 samples, raw variance 1."""
    return force(Excitation(), 8192, DT, seed=1)


@pytest.fixture(scope="session")
def records(systems: dict[str, Model], report_force: Floats) -> dict[str, Record]:
    """One record of each system, free of visible integration error."""
    return {name: simulate(model, report_force, DT, Integrator("rk4", 8)) for name, model in systems.items()}


@pytest.fixture(scope="session")
def value_of() -> Callable[..., Floats]:
    """``value_of(text, u=..., v=...)``: a formula's values as the compiled kernel computes them."""

    def value(text: str, **columns: Floats | float) -> Floats:
        graph = Graph()
        known = {name: graph.input(name) for name in columns}
        program = graph.program([formulas.add_formula(graph, text, known)])
        data = np.broadcast_arrays(*(np.atleast_1d(np.asarray(c, dtype=float)) for c in columns.values()))
        return kernels.evaluate(program, dict(zip(columns, data, strict=True)), len(data[0]))[:, 0]

    return value
