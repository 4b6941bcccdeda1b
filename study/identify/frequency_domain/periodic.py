"""Coefficients from several periods of the same excitation, with noise on the force and on the response.

Periods of one steady motion differ by noise alone, and that noise is independent from one period to another.
Three things follow for the reverse system ``Y = sum_j A_j X_j``, none of which asks for the noise to be known:

- A period closes on itself: its lines have no leakage, and derivatives are products with ``j 2 pi f``.
- Products of two different periods have the mean of the products without noise (least squares of noisy inputs is
  biased by the products of a period's noise with itself). So one half of the periods, averaged, gives the equations
  and the other half their instruments; then they change places.
- A shape of an average of n periods, ``g(u + noise)``, has a bias of ``b / n``: for a cube ``3 sigma^2 u / n``.
  The same shape of averages that leave out one period each has the bias ``b / (n - 1)``, and that of
  ``n g_n - (n - 1) g_(n-1)`` is of the next order; for powers up to the third it is zero (Quenouille,
  Biometrika 43, 1956).

Lines are weighted by the scatter between periods of the equation's residual, which contains the noise of force and
response with their correlation; standard errors come from the same scatter.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.fft import rfft

from study.equations import formulas
from study.identify.frequency_domain.coefficients import Estimate, lines_in
from study.identify.frequency_domain.inputs import Input, histories, symbols_of
from study.records.record import Record
from study.support.arrays import Complexes, Floats, Ints
from study.support.errors import StudyError
from study.support.least_squares import floored, normal_inverse

Chosen = tuple[int, ...]
MOST_PERIODS = 12  # that are treated one by one; of more, neighbours are averaged first
NEIGHBOURS = 10  # lines on either side that a variance is averaged over: its own line would correlate with the weight
PASSES = 4  # weights from the coefficients before


def steady(record: Record, settle: int) -> Record:
    """The whole periods of a record, counted back from its end, less the first ``settle``."""
    period = record.period
    if period is None:
        raise StudyError(f"{record.name} has no period; errors_in_variables needs the samples of one period")
    whole = len(record) // period
    count = whole - settle
    if count < 2:
        raise StudyError(
            f"{record.name} holds {whole} periods of {period} samples; errors_in_variables needs {settle} to settle "
            "and 2 or more beside"
        )
    kept = record.part(len(record) - count * period, len(record))
    force = kept["force"].reshape(count, period)
    mean: Floats = np.mean(force, axis=0)
    size = float(np.mean((force - np.mean(force)) ** 2))
    between = float(np.mean((force - mean) ** 2)) * count / (count - 1.0)
    share = between / size if size > 0.0 else 0.0
    if share > 0.5:  # share of a force's power that may differ between periods
        raise StudyError(
            f"{100.0 * min(share, 1.0):.0f} % of the force of {record.name} differs between periods of {period} "
            "samples; errors_in_variables needs the same excitation in each"
        )
    return kept


def fit_periodic(record: Record, inputs: Sequence[Input], band: tuple[float, float]) -> Estimate:
    """Coefficients of all inputs that have power in the band (Hz), from the periods that :func:`steady` gives.

    The covariance has as many degrees of freedom as there are periods, less one.
    """
    periods = Periods.of(record, inputs, band)
    force, count = periods.force, len(periods.force)
    _check(inputs, count, record.name)
    own = np.stack([periods.columns((p,)) for p in range(count)])
    size = np.linalg.norm(own, axis=(0, 1))
    driven = size > 0.0
    own, size = own[:, :, driven], size[driven]
    halves = [  # columns and output of one half of the periods, columns of the other half as instruments
        (periods.unbiased(a)[:, driven], np.mean(force[list(a)], axis=0), periods.unbiased(b)[:, driven])
        for a, b in _halves(count)
    ]
    instruments, weight = np.mean([z for _, _, z in halves], axis=0), np.ones(force.shape[1])
    values, shifts = np.zeros(len(size)), np.zeros((len(size), count))
    for _ in range(PASSES + 1):  # alike at first, then by what the coefficients before leave
        tested = [((z * weight[:, None]).conj().T, x, y) for x, y, z in halves]
        inverse = normal_inverse(np.mean([(z @ x).real for z, x, _ in tested], axis=0), size)
        values = np.asarray(inverse @ np.mean([(z @ y).real for z, _, y in tested], axis=0), dtype=np.float64)
        left = force - own @ values
        left = left - np.mean(left, axis=0)  # what a period leaves otherwise than the others do, for the scatter
        shifts = inverse @ ((instruments * weight[:, None]).conj().T @ left.T).real
        weight = _weights(np.sum(np.abs(left) ** 2, axis=0))
    known = tuple(s for s, d in zip(symbols_of(inputs), driven, strict=True) if d)
    return Estimate(known, values, shifts @ shifts.T / (count * (count - 1.0)), count - 1.0)


@dataclass(frozen=True)
class Periods:
    """Channels by period (periods, samples), lines of the force in the band (periods, lines), powers of j 2 pi f."""

    record: Record
    channels: dict[str, Floats]
    inputs: Sequence[Input]
    keep: Ints
    force: Complexes
    powers: tuple[Complexes, ...]
    known: dict[Chosen, Complexes] = field(
        default_factory=dict[Chosen, Complexes]
    )  # columns: halves share most of their averages

    @staticmethod
    def of(record: Record, inputs: Sequence[Input], band: tuple[float, float]) -> "Periods":
        """Cut and transform the whole periods of a record."""
        channels = _grouped(record)
        samples = channels["force"].shape[1]
        frequency: Floats = np.arange(samples // 2 + 1, dtype=np.float64) / (samples * record.dt)
        keep = np.flatnonzero(lines_in(frequency, band))
        if len(keep) <= 2 * NEIGHBOURS:
            raise StudyError(
                f"a period of {record.name} has {len(keep)} lines from {band[0]:g} to {band[1]:g} Hz; "
                f"errors_in_variables needs {2 * NEIGHBOURS + 1} or more"
            )
        force = np.asarray(rfft(channels["force"]), dtype=np.complex128)[:, keep]
        powers = tuple(item.powers(frequency[keep]) for item in inputs)
        return Periods(record, channels, inputs, keep, force, powers)

    def columns(self, chosen: Chosen) -> Complexes:
        """Lines of each shape of the average of some periods, times its parts' powers, (lines, parts)."""
        if chosen not in self.known:
            self.known[chosen] = self._computed(chosen)
        return self.known[chosen]

    def _computed(self, chosen: Chosen) -> Complexes:
        mean = {name: np.mean(values[list(chosen)], axis=0) for name, values in self.channels.items()}
        shapes = histories(self.inputs, replace(self.record, channels=mean))
        lines = [np.asarray(rfft(h), dtype=np.complex128)[self.keep] for h in shapes]
        return np.concatenate([x[:, None] * p for x, p in zip(lines, self.powers, strict=True)], axis=1)

    def unbiased(self, chosen: Chosen) -> Complexes:
        """The same without what noise adds to the shapes on average, to first order."""
        n = len(chosen)
        if n == 1:
            return self.columns(chosen)
        left = np.mean([self.columns(tuple(c for c in chosen if c != out)) for out in chosen], axis=0)
        return np.asarray(n * self.columns(chosen) - (n - 1) * left, dtype=np.complex128)


def _grouped(record: Record) -> dict[str, Floats]:
    """Channels by period, (periods, samples); of many periods, averages of neighbours."""
    assert record.period is not None, "checked by steady()"
    periods = len(record) // record.period
    each = -(-periods // MOST_PERIODS)
    count = periods // each
    return {
        name: values[len(values) - count * each * record.period :].reshape(count, each, record.period).mean(axis=1)
        for name, values in record.channels.items()
    }


def _check(inputs: Sequence[Input], count: int, name: str) -> None:
    for item in inputs:
        if item.state is not None or "t" in formulas.names(item.shape):
            raise StudyError(
                f"the input {item.shape!r} of {', '.join(item.terms)} is not the same in every period; "
                "errors_in_variables needs shapes of the motion alone"
            )
    if count < 4 and any(i.shape != "u" for i in inputs):
        raise StudyError(
            f"{name} holds {count} steady periods; errors_in_variables needs 4 or more for nonlinear shapes: "
            "how noise distorts them is seen from averages of two and more"
        )


def _halves(count: int) -> list[tuple[Chosen, Chosen]]:
    """Ways to cut the periods, as if they stood in a circle, in two runs; every run comes first once."""
    half = count // 2
    turned = [tuple((shift + i) % count for i in range(count)) for shift in range(count)]
    cuts = [(order[:half], order[half:]) for order in turned]
    return cuts if count % 2 == 0 else cuts + [(b, a) for a, b in cuts]


def _weights(scatter: Floats) -> Floats:
    """Inverse of the mean over each line's neighbours, to a common factor."""
    kernel = np.ones(2 * NEIGHBOURS + 1)
    kernel[NEIGHBOURS] = 0.0
    variance = np.convolve(scatter, kernel, "same") / np.convolve(np.ones_like(scatter), kernel, "same")
    divisor = floored(variance)
    return np.max(divisor) / divisor
