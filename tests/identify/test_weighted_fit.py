import numpy as np
import pytest

from study.equations.model import Model, ModelTerm, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.part_fit import covariance_of, linearise
from study.identify.time_domain.weighted_fit import finished, weighted
from study.records.prepared import prepare_record

TRUE = {"m": 1.0, "c": 3.0, "k": 400.0, "k3": 3e5}
NAMES = ("inertia", "linear_damping", "linear_stiffness", "cubic_stiffness")


def brown(rng, n):
    spectrum = np.fft.rfft(rng.standard_normal(n))
    spectrum[1:] /= np.arange(1, len(spectrum))
    spectrum[0] = 0.0
    noise = np.fft.irfft(spectrum, n)
    return noise / np.std(noise)


def record(seed, colour, share=0.15):
    rng = np.random.default_rng([31, seed])
    model = Model("duffing", tuple(ModelTerm(get(n), (v,), ()) for n, v in zip(NAMES, TRUE.values(), strict=True)))
    made = simulate(model, 8.0 * rng.standard_normal(4096), 0.02, Integrator("rk4", 4))
    size = np.std(made["displacement"])
    noise = brown(rng, 4096) if colour else rng.standard_normal(4096)
    return prepare_record(made.with_channels({"displacement": made["displacement"] + share * size * noise}))


def opened(*names):
    return Model("opened", tuple(free(get(n)) for n in names))


@pytest.fixture(scope="module")
def coloured():
    pairs = []
    for seed in range(24):
        prepared = record(seed, colour=True)
        plain = fit_model(opened(*NAMES), prepared)
        pairs.append((prepared, plain, weighted(plain, prepared)))
    return pairs


def errors(fit, prepared):
    deviations = np.sqrt(np.diag(covariance_of(fit, linearise(fit, prepared))))[: len(fit.keys)]
    return (fit.values - list(TRUE.values())) / deviations, deviations


def test_noise_at_some_frequencies_costs_less_when_the_fit_is_weighted_with_it(coloured):
    assert sum(bool(fit.noise) for _, _, fit in coloured) > len(coloured) / 2
    scatter = [np.std([fit.values for fit in fits], axis=0) for fits in list(zip(*coloured, strict=True))[1:]]
    assert np.all(scatter[1][[0, 2]] < 0.8 * scatter[0][[0, 2]])


def test_the_weighted_intervals_hold(coloured):
    off = np.concatenate([errors(fit, prepared)[0] for prepared, _, fit in coloured])
    assert 0.85 < np.mean(np.abs(off) < 1.96) <= 1.0
    assert 0.7 < np.std(off) < 1.35


def test_white_noise_weighs_nothing():
    prepared = record(1, colour=False)
    plain = fit_model(opened(*NAMES), prepared)
    assert weighted(plain, prepared) is plain


def test_a_wrong_model_is_not_weighted_with_what_it_lacks():
    prepared = record(2, colour=True, share=0.02)
    plain = fit_model(opened(*NAMES[:3]), prepared)
    assert weighted(plain, prepared) is plain


def test_finishing_twice_changes_nothing(coloured):
    prepared, _, fit = next(one for one in coloured if one[2].noise)
    assert np.array_equal(finished(fit, prepared).values, fit.values)
