"""How fast, beside what: run with `pytest benchmarks`; each row stands beside its peer in one table.

Ratios in one run say something; absolute times say as much about the machine. Not part of `make test`.
"""

from itertools import count
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import csd

from study.equations import kernels
from study.equations.free_run import prepare
from study.equations.model import Model
from study.equations.model_file import read_model
from study.equations.motion_program import motion_program
from study.equations.simulate import METHODS, Integrator, simulate
from study.identify.frequency_domain import coefficients, conditioned
from study.identify.frequency_domain.inputs import histories, reverse_inputs
from study.identify.frequency_domain.local_polynomial import (
    LocalPolynomial,
    fit_local_polynomial,
    local_polynomial_responses,
    transform,
)
from study.records.excitation import Excitation, force
from study.records.interpolation import between_samples
from study.records.record import ALONE, MOTIONS, Record, Sensor
from study.records.spectra import Segments, cross_spectra

MODELS = sorted((Path(__file__).parent.parent / "models").glob("*.yaml"))
DT, SAMPLES, STEPS = 0.02, 8192, 8


def the_force():
    return force(Excitation(), SAMPLES, DT, 1)


def integration(model: Model, method: str):
    """The compiled loop alone: SAMPLES x STEPS steps of one system."""
    motion = motion_program(model, (), [Sensor(ALONE, m) for m in MOTIONS], switching=method == "rk4")
    drive = between_samples(the_force(), 2 * STEPS)[:, None]
    start, bounds = np.zeros(1), np.array([0, SAMPLES])

    def run():
        out, state = np.empty((SAMPLES, 3, 1)), np.zeros((1, motion.states, 1))
        assert kernels.integrate(motion, start, DT, STEPS, drive, bounds, state, out, METHODS[method])[0] == -1

    return run


@pytest.mark.parametrize("path", MODELS, ids=lambda p: p.stem)
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.benchmark(group="integration: 65,536 steps (13.1 ms is 5 million a second)")
def test_integration(benchmark, path, method):
    benchmark(integration(read_model(path), method))


@pytest.mark.parametrize("restarts", [(), range(20, 8180, 20)], ids=["whole", "in segments"])
@pytest.mark.parametrize("keyed", [True, False], ids=["derivatives", "alone"])
@pytest.mark.benchmark(group="free runs of a Duffing system, 8,192 samples in two steps each")
def test_respond(benchmark, keyed, restarts):
    """In segments, as multiple shooting does: two at a time, and two threads."""
    model = read_model(MODELS[0].parent / "duffing.yaml")
    record = Record(DT, {"force": the_force()})
    run = prepare(model, record, tuple(model.values) if keyed else (), restarts=restarts)
    begin = count()  # elsewhere each time: a run that was made last is not made again
    initial = np.zeros((1 + len(restarts), 2))
    benchmark(lambda: run.respond_by_segment(model.numbers(), initial + 1e-9 * next(begin), 2 * keyed))


@pytest.mark.benchmark(group="free runs of a Duffing system, 8,192 samples in two steps each")
def test_prepare(benchmark):
    """Again, as a search does: the program is known, and the force between its samples."""
    model, record = read_model(MODELS[0].parent / "duffing.yaml"), Record(DT, {"force": the_force()})
    benchmark(lambda: prepare(model, record, tuple(model.values)))


def channels(count: int = 4, samples: int = 1_000_000):
    rng = np.random.default_rng(1)
    return [rng.standard_normal(samples) for _ in range(count)]


@pytest.mark.benchmark(group="cross-spectral matrix, 4 channels of 1,000,000 samples")
def test_matrix(benchmark):
    data = channels()
    benchmark.pedantic(lambda: cross_spectra(data, DT), rounds=15, warmup_rounds=1)


@pytest.mark.benchmark(group="cross-spectral matrix, 4 channels of 1,000,000 samples")
def test_matrix_by_scipy_csd(benchmark):
    data = channels()
    benchmark.pedantic(lambda: [[csd(x, y, 1 / DT, nperseg=512, detrend=False) for x in data] for y in data], rounds=2)


@pytest.mark.parametrize("windowed", [False, True], ids=["bare", "windowed"])
@pytest.mark.benchmark(group="cross-spectral matrix, 4 channels of 1,000,000 samples")
def test_ffts(benchmark, windowed):
    """What no estimate can do without: one FFT a segment and channel, and its window."""
    data, cut = channels(), Segments()
    taper = cut.taper()

    def run():
        for x in data:
            view = np.lib.stride_tricks.sliding_window_view(x, cut.length)[:: cut.hop]
            for first in range(0, len(view), 256):
                part = view[first : first + 256]
                np.fft.rfft(part * taper if windowed else part)

    benchmark.pedantic(run, rounds=15, warmup_rounds=1)


def reverse_channels(samples: int):
    """Inputs of the reverse Duffing system, and the force."""
    model = read_model(MODELS[0].parent / "duffing.yaml")
    record = simulate(model, force(Excitation(), samples, DT, 1), DT, Integrator("abm4", STEPS))
    inputs = reverse_inputs(model)
    return inputs, [*histories(inputs, record), record["force"]]


@pytest.mark.benchmark(group="a Duffing record of 100,000 samples in reverse")
def test_local_polynomial(benchmark):
    """Transforms, A_j(f) in every band, coefficients with their errors."""
    inputs, data = reverse_channels(100_000)

    def run():
        lines = transform(data, DT)
        return local_polynomial_responses(lines, LocalPolynomial()), fit_local_polynomial(
            lines, inputs, (0.3, 10.0), LocalPolynomial()
        )

    benchmark.pedantic(run, rounds=3, warmup_rounds=1)


@pytest.mark.benchmark(group="a Duffing record of 100,000 samples in reverse")
def test_miso(benchmark):
    """The report's estimator on the same record."""
    benchmark.pedantic(in_reverse(100_000), rounds=3, warmup_rounds=1)


@pytest.mark.benchmark(group="a Duffing record of 1,000,000 samples in reverse")
def test_miso_of_a_million(benchmark):
    """Spectra, conditioned spectra and coherences, coefficients with their errors."""
    benchmark.pedantic(in_reverse(1_000_000), rounds=3, warmup_rounds=1)


def in_reverse(samples: int):
    """MI/SO with everything that follows from the inputs' time histories."""
    inputs, data = reverse_channels(samples)
    inflation = Segments().line_inflation()
    return lambda: coefficients.fit_coefficients(
        conditioned.analyse(cross_spectra(data, DT)), inputs, (0.3, 10.0), inflation
    )
