"""Other minima that a record does not exclude: two tones of which the model has one, equally loud or not."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from study.compare.comparison import compare
from study.equations.model import Model, free
from study.equations.simulate import Integrator, simulate
from study.equations.terms import get
from study.identify.time_domain.fit_model import fit_model
from study.identify.time_domain.rivals import best_first, larger, rivals
from study.identify.time_domain.settling import continued, settled
from study.records.excitation import Excitation, displacement_noise, force
from study.records.prepared import Prepared, prepare_record, whole
from study.records.record import Record

Floats = NDArray[np.float64]
DT = 0.02
TONES = (1.5, 2.2)  # hertz
LINEAR = {"m": 1.0, "c": 3.77, "k": 355.3}
ONE_TONE = Model("one tone", tuple(free(get(t)) for t in ("inertia", "linear_damping", "linear_stiffness")))
ONE_TONE = ONE_TONE.with_term(get("harmonic_force"))
SEEDS = range(4)


def tones(samples: int, sizes: tuple[float, float] = (1.0, 1.0)) -> Floats:
    """Two harmonic forces that move the linear oscillator by a millimetre times their size."""
    omega = 2.0 * np.pi * np.array(TONES)
    stiffness = np.abs(LINEAR["k"] - LINEAR["m"] * omega**2 + 1j * LINEAR["c"] * omega)
    return 1e-3 * np.cos(np.outer(np.arange(samples) * DT, omega)) @ (stiffness * sizes)


def hummed(seed: int, hum: Floats) -> Record:
    """A linear oscillator under a measured force and a hum that nobody measured."""
    measured = force(Excitation(), len(hum), DT, seed)
    linear = Model("linear", ONE_TONE.terms[:3]).with_values(LINEAR)
    u = simulate(linear, measured + hum, DT, Integrator("rk4", 8))["displacement"]
    return Record(DT, {"force": measured, "displacement": u + displacement_noise(u, 0.01, seed)}, name="hum")


def frequencies(prepared: Prepared) -> list[float]:
    """Those of the best minimum and its rivals."""
    fits = best_first(fit_model(ONE_TONE, prepared), prepared)
    return [round(fit.estimate["harmonic_force.f"], 2) for fit in fits]


@pytest.mark.parametrize("seed", SEEDS)
def test_of_two_equal_tones_either_may_be_the_one_that_the_model_has(seed: int) -> None:
    assert sorted(frequencies(prepare_record(hummed(seed, tones(8192))))) == list(TONES)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("louder", [0, 1])
def test_the_louder_tone_has_no_rival(seed: int, louder: int) -> None:
    sizes = (1.0, 0.5) if louder == 0 else (0.5, 1.0)
    assert frequencies(prepare_record(hummed(seed, tones(8192, sizes)))) == [TONES[louder]]


@pytest.mark.parametrize("seed", SEEDS)
def test_a_rival_that_the_whole_record_excludes_is_forgotten(seed: int) -> None:
    """The second tone begins late: on the stretch that a search looks at it is as loud, on the whole it is not."""
    samples, late = 8192, 6144
    hum = tones(samples, (1.0, 0.0)) + np.where(np.arange(samples) < late, 0.0, tones(samples, (0.0, 1.0)))
    prepared = whole(hummed(seed, hum))
    look = prepared.with_fit(late, samples)
    fit = fit_model(ONE_TONE, look)
    assert len(best_first(fit, look)) == 2
    longer = settled(continued(fit, prepared), prepared)
    assert len(longer.elsewhere) == len(fit.elsewhere)
    assert [round(f.estimate["harmonic_force.f"], 2) for f in best_first(longer, prepared)] == [TONES[0]]


def test_a_search_that_ends_in_one_minimum_from_every_start_has_no_rival(systems, records) -> None:
    for name in ("duffing", "mathieu"):
        model = systems[name].with_values(dict.fromkeys(systems[name].values))
        prepared = prepare_record(records[name])
        fit = fit_model(model, prepared)
        assert fit.elsewhere
        assert rivals(fit, prepared) == ()


def test_what_is_at_no_minimum_or_has_nothing_fitted_has_no_rival() -> None:
    prepared = prepare_record(hummed(0, tones(8192)))
    fit = fit_model(ONE_TONE, prepared)
    assert rivals(fit, prepared)
    assert rivals(replace(fit, converged=False), prepared) == ()
    assert rivals(fit_model(fit.model, prepared), prepared) == ()


def test_a_residual_is_larger_only_beyond_chance() -> None:
    """Of residuals of equal size one in twenty is called larger."""
    rng = np.random.default_rng(5)
    noise = rng.standard_normal((400, 2, 1024))
    share = np.mean([larger(a, b) for a, b in noise])
    assert 0.02 < share < 0.09
    assert all(larger(1.2 * a, b) for a, b in noise[:50])
    assert not any(larger(a, a) for a in noise[0])


def test_the_comparison_says_that_two_minima_fit_alike() -> None:
    comparison = compare(ONE_TONE, prepare_record(hummed(0, tones(8192))))
    (said,) = [note for note in comparison.notes if "minima" in note]
    assert said.startswith("two minima fit this record alike: ")
    for tone in TONES:
        assert f"harmonic_force.f = {tone:g} Hz (error " in said
    alone = compare(ONE_TONE, prepare_record(hummed(0, tones(8192, (1.0, 0.5)))))
    assert not any("minima" in note for note in alone.notes)
