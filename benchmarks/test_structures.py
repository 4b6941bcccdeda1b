"""What coordinates cost; run with `pytest benchmarks/test_structures.py`.

A simulation of a chain of n masses beside one of a single mass, and the whole library at all places of three masses.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from study.compare.comparison import compare
from study.diagnose.verdict import diagnose
from study.equations.model import Model
from study.equations.model_file import parse_model
from study.equations.simulate import Integrator, simulate
from study.records.excitation import Excitation, force
from study.records.prepared import prepare_record

DT, SAMPLES, STEPS = 0.02, 8192, 4


def chain(masses: int) -> Model:
    """Masses on springs and dampers in a row, a cubic spring at the ground."""
    names = [f"x{i}" for i in range(masses)]
    below = ["ground", *names[:-1]]
    terms: list[dict[str, object]] = [{"term": "inertia", "at": name, "value": 1.0} for name in names]
    for term, value in (("linear_stiffness", 400.0), ("linear_damping", 2.0)):
        terms += [{"term": term, "between": [a, b], "value": value} for a, b in zip(below, names, strict=True)]
    terms.append({"term": "cubic_stiffness", "between": ["ground", names[0]], "value": 1e5})
    document = {"name": "chain", "coordinates": names, "forces": {"shaker": names[-1]}, "terms": terms}
    return parse_model(json.dumps(document), Path("chain.yaml"))


@pytest.mark.parametrize("masses", [1, 2, 3, 5])
@pytest.mark.benchmark(group="a simulation of 8,192 samples in four steps each")
def test_chain(benchmark, masses):
    model, drive = chain(masses), force(Excitation(), SAMPLES, DT, 1)
    simulate(model, {"shaker": drive}, DT, Integrator("rk4", STEPS))  # compiles
    benchmark(lambda: simulate(model, {"shaker": drive}, DT, Integrator("rk4", STEPS)))


@pytest.mark.benchmark(group="a simulation of 8,192 samples in four steps each")
def test_single_mass(benchmark):
    values = {"inertia": 1.0, "linear_stiffness": 400.0, "linear_damping": 2.0, "cubic_stiffness": 1e5}
    entries = [{"term": name, "value": value} for name, value in values.items()]
    model = parse_model(json.dumps({"name": "one", "terms": entries}), Path("one.yaml"))
    drive = force(Excitation(), SAMPLES, DT, 1)
    benchmark(lambda: simulate(model, drive, DT, Integrator("rk4", STEPS)))


@pytest.mark.benchmark(group="comparison and the whole library at all places of three masses, 8,192 samples")
def test_diagnosis(benchmark):
    truth, drive = chain(3), force(Excitation(), SAMPLES, DT, 1)
    known = truth.with_values(dict.fromkeys(truth.values))
    believed = replace(known, terms=tuple(t for t in known.terms if not t.name.startswith("cubic_stiffness")))
    clean = simulate(truth, {"shaker": drive}, DT, Integrator("rk4", STEPS))
    rng = np.random.default_rng(1)
    noisy = {n: x + 0.01 * np.std(x) * rng.standard_normal(SAMPLES) for n, x in clean.motions.items()}
    record = clean.with_motions({n: x for n, x in noisy.items() if n.motion == "displacement"})

    def diagnosis():
        return diagnose(compare(believed, prepare_record(record)))

    found = benchmark.pedantic(diagnosis, rounds=1, warmup_rounds=1)
    assert found.candidates[0].name == "cubic_stiffness[ground-x0]"
