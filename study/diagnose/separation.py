"""How far apart a test would drive rivals: models that a record cannot tell from each other.

With y_i the response of rival i, J_j and C_j the sensitivities and the covariance of rival j's coefficients, and W what
makes the noise of this record white and of unit variance, ::

    T_ij = min over delta of |W (y_i - y_j - J_j delta)|^2 + delta' C_j^-1 delta

is by how much rival j fits worse than i if i is true, in expectation: between Hunter and Reiner (1965; C_j = 0) and the
T-optimality of Atkinson and Fedorov (1975; C_j^-1 = 0). What is compared is a sum of squares, whose difference has the
standard error ``2 sqrt(T)``: a test decides where it exceeds K of those, this record's own difference included.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import ndtr

from study.diagnose.designs import Design, Limits, PresentTest, possible_designs, present_test
from study.diagnose.ranked import Ranked
from study.equations.free_run import prepare
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import covariance_of, linearise
from study.identify.time_domain.weighted_fit import noise_left
from study.records.interpolation import largest_between
from study.records.outputs import Noise, Outputs
from study.records.prepared import FORCE, Prepared
from study.records.record import MOTIONS, Sensor
from study.support.arrays import Floats
from study.support.errors import DivergenceError, StudyError, expect
from study.support.least_squares import least_squares
from study.support.statistics import block_powers
from study.support.thresholds import K


@dataclass(frozen=True, eq=False)
class Rivals:
    """Models that a record cannot tell from each other, and what it says of them all the same; r of them."""

    rows: tuple[Ranked, ...]
    prepared: Prepared
    present: PresentTest

    @cached_property
    def noise(self) -> Noise:
        """Of the first, which leaves least."""
        return noise_left(self.rows[0].fit.residual, len(self.prepared.outputs))

    @cached_property
    def white(self) -> tuple[Floats, ...]:
        """What each leaves of samples that it was not fitted to, white, shape (n,)."""
        found = [np.concatenate(row.held_out.white(self.prepared.outputs, self.noise)) for row in self.rows]
        count = min(map(len, found))
        return tuple(left[:count] for left in found)

    @cached_property
    def size(self) -> float:
        """Standard deviation of the noise, white and stacked."""
        least = min(float(np.mean(left**2)) for left in self.white)
        floor = self.rows[0].numerical * float(np.abs(self.noise[0][0]) if self.noise else 1.0)
        return max(float(np.sqrt(least)), floor)

    @cached_property
    def ahead(self) -> Floats:
        """By how much the rival of a column leaves more than that of a row, over the noise's variance, shape (r, r)."""
        left = np.array([float(np.sum(own**2)) for own in self.white]) / self.size**2
        return left[None, :] - left[:, None]

    @cached_property
    def apart(self) -> Floats:
        """T of each pair on this record: a quarter of the variance of that difference, from blocks; shape (r, r)."""
        power = np.array([block_powers(own) for own in self.white]) / self.size**2
        difference = power[None, :] - power[:, None]
        return np.asarray(0.25 * power.shape[1] * np.var(difference, axis=2, ddof=1), dtype=np.float64)

    @cached_property
    def covariances(self) -> tuple[Floats, ...]:
        """Of the coefficients of each, as far as this record tells them."""
        return tuple(known_of(fit, self.prepared) for fit in self.fits)

    @property
    def fits(self) -> tuple[FreeRunFit, ...]:
        """Of each."""
        return tuple(row.fit for row in self.rows)

    def distances(self, design: Design, further: Sensor | None = None) -> Floats:
        """T of a test in blocks of time, of each true rival (rows) against each other, shape (r, r, blocks).

        With a ``further`` sensor that of the test alone: this record has none to be held against.
        """
        outputs, noise = self.seen(further)
        answers = [respond(fit, design, outputs.sensors, differentiate=True) for fit in self.fits]
        found = list[Floats]()
        for j, (other, jacobian) in enumerate(answers):
            columns = outputs.whitened(outputs.stacked(jacobian), noise) / self.size
            rows = np.vstack([columns, self._prior(j, columns.shape[1], further)])
            target = np.zeros((len(rows), len(answers)))
            for i, (true, _) in enumerate(answers):
                target[: len(columns), i] = outputs.whitened(outputs.stacked(true - other), noise) / self.size
            for left in (target - rows @ least_squares(rows, target, 1e-9)).T:
                power, known = block_powers(left[: len(columns)]), float(np.sum(left[len(columns) :] ** 2))
                found.append(power + known / len(power))
        return np.array(found).reshape(len(answers), len(answers), -1).transpose(1, 0, 2)

    def left(self, design: Design, true: int, other: int, further: Sensor | None = None) -> Floats:
        """What a rival leaves of the answer of the true one, its coefficients adjusted, shape (n, sensors)."""
        outputs, noise = self.seen(further)
        shown, (moved, jacobian) = (
            respond(self.fits[true], design, outputs.sensors)[0],
            respond(self.fits[other], design, outputs.sensors, differentiate=True),
        )
        columns = outputs.whitened(outputs.stacked(jacobian), noise) / self.size
        rows = np.vstack([columns, self._prior(other, columns.shape[1], further)])
        target = np.zeros(len(rows))
        target[: len(columns)] = outputs.whitened(outputs.stacked(shown - moved), noise) / self.size
        return shown - moved - jacobian @ least_squares(rows, target, 1e-9)

    def _prior(self, number: int, columns: int, further: Sensor | None) -> Floats:
        """Rows that hold a rival's coefficients to what this record tells of them, shape (any, columns)."""
        known = root_of_inverse(self.covariances[number])[: None if further is None else 0]
        prior = np.zeros((len(known), columns))
        prior[:, : known.shape[1]] = known
        return prior

    def seen(self, further: Sensor | None) -> tuple[Outputs, Noise]:
        """The sensors of a test and their noise: that of the record, or with a further sensor in place of its like.

        Its noise is taken as white, in the same proportion to its motion as that of the others.
        """
        outputs, motions = self.prepared.outputs, self.prepared.measured
        if further is None:
            return outputs, self.noise
        noise = self.noise or ((np.ones(1),) * len(outputs))
        share: Floats = np.std(outputs.apart(self.rows[0].residual), axis=0) / np.std(motions, axis=0)
        moved = float(np.std(self.rows[0].prediction.motions([further])))
        kept = [i for i, s in enumerate(outputs.sensors) if s.coordinate != further.coordinate]
        own = np.array([self.size / (float(np.mean(share)) * moved)])
        weights = (*(outputs.weights[i] for i in kept), 1.0)
        return Outputs((*(outputs.sensors[i] for i in kept), further), weights), (*(noise[i] for i in kept), own)

    def noise_of(self, further: Sensor | None) -> dict[Sensor, float]:
        """Standard deviation of the noise of each sensor of a test, in its unit."""
        outputs, noise = self.seen(further)
        left = np.std(self.prepared.outputs.apart(self.rows[0].residual), axis=0)
        known = dict(zip(self.prepared.outputs.sensors, left.tolist(), strict=True))
        return {s: known.get(s, self.size / float(noise[i][0])) if noise else known[s]
                for i, s in enumerate(outputs.sensors)}  # fmt: skip

    def decided(self, distances: Floats, alone: bool = False) -> Floats:
        """Probability that each pair is told apart, the rival of the row being true, shape (r, r); one on the diagonal.

        By this record and the test together, or by the test ``alone``, from T in blocks: that is how residuals are
        compared (:func:`study.support.statistics.worse`), by their mean or by their ranks, so that a few loud blocks
        decide less than their T says.
        """
        ahead, apart = (np.zeros(distances.shape[:2]),) * 2 if alone else (self.ahead, self.apart)
        total, count = np.sum(distances, axis=2), distances.shape[2]
        uneven = count * np.var(distances, axis=2, ddof=1)
        error = np.sqrt(np.maximum(4.0 * (apart + total) + uneven, np.finfo(float).tiny))
        rank = np.argsort(np.argsort(distances, axis=2), axis=2) + 1.0
        by_rank = np.sum(rank * (2.0 * ndtr(0.5 * np.sqrt(distances)) - 1.0), axis=2) / np.sqrt(np.sum(rank**2, axis=2))
        found = np.asarray(ndtr(np.maximum((ahead + total) / error, by_rank) - K), dtype=np.float64)
        diagonal = np.arange(len(found))
        found[diagonal, diagonal] = 1.0
        return found


def rivals_of(rows: Sequence[Ranked], prepared: Prepared) -> Rivals:
    """The rivals among rows that a record cannot tell apart; a ``StudyError`` where no test of them can be planned."""
    expect(
        not rows[0].fit.model.modal,
        f"{prepared.record.name}: the linear part of its model is a sum of modes, for which no test is planned; "
        "expected a model with masses and springs",
    )
    return Rivals(tuple(rows), prepared, present_test(prepared, rows[0].fit))


def known_of(fit: FreeRunFit, prepared: Prepared) -> Floats:
    """Covariance of a fit's coefficients, as far as this record tells them, shape (keys, keys)."""
    keys = len(fit.keys)
    return covariance_of(fit, linearise(fit, prepared))[:keys, :keys]


def respond(
    fit: FreeRunFit, design: Design, sensors: Sequence[Sensor], *, differentiate: bool = False
) -> tuple[Floats, Floats]:
    """What the sensors show of a fitted model, shape (n, sensors), and derivatives by coefficients and initial states.

    Raises
    ------
    StudyError
        If it does not stay finite, or the test lacks a channel that it names.
    """
    keys = fit.keys if differentiate else ()
    run = prepare(fit.model, design.record, keys, sensors=sensors, steps_per_sample=fit.steps_per_sample)
    values = dict(zip(fit.keys, fit.values.tolist(), strict=True))
    shown, derivatives = run.respond(values, design.begin[: run.moving], run.moving if differentiate else 0)
    far = 1e100  # what overflows when it is squared is as good as endless
    if not (np.all(np.abs(shown) < far) and np.all(np.abs(derivatives) < far)):
        raise DivergenceError("the free run leaves the range of numbers", run.start)
    return shown, derivatives


def limit_share(fits: Sequence[FreeRunFit], present: PresentTest, design: Design, limits: Limits) -> float:
    """Largest displacement, and force on a component, over the limits, whichever model is true; infinite if endless."""
    sensors = [Sensor(c, FORCE if present.prescribed else MOTIONS[0]) for c in fits[0].model.coordinates]
    try:
        largest = max(largest_between(respond(fit, design, sensors)[0], 4) for fit in fits)
    except StudyError:
        return np.inf
    if present.prescribed:
        return max(largest / limits.force, present.largest(design.record) / limits.displacement)
    return largest / limits.displacement


def own_limits(fits: Sequence[FreeRunFit], present: PresentTest, times: float = 1.0) -> Limits:
    """So many times what a record reached, as the models have it, and its length."""
    length = len(present.source) * present.source.dt
    kind, place = present.kinds[0]
    driven = present.reached or 1.0
    answered = limit_share(
        fits, present, present.design(kind, place, len(present.source), 1.0), Limits(1.0, np.inf, length)
    )
    moved = limit_share(
        fits, present, present.design(kind, place, len(present.source), 1.0), Limits(np.inf, 1.0, length)
    )
    return (
        Limits(times * answered, times * driven, length)
        if present.prescribed
        else Limits(times * driven, times * moved, length)
    )


def limits_asked(
    fits: Sequence[FreeRunFit], present: PresentTest, force: float | None, displacement: float | None,
    length: float | None,
) -> Limits:  # fmt: skip
    """Limits of which those that are not given are what the record reached."""
    own = own_limits(fits, present)
    return Limits(force or own.force, displacement or own.displacement, length or own.length)


def allowed(
    fits: Sequence[FreeRunFit], present: PresentTest, limits: Limits, length: float | None = None
) -> list[Design]:
    """Tests within the limits whichever model is true, at full length or one that is given.

    Raises
    ------
    StudyError
        If the limits allow none.
    """
    least, own = shortest(present), own_limits(fits, present)
    expect(
        limits.length >= least,
        f"the largest length of a test (--max-length) is {limits.length:g} s; expected {least:.3g} s or more, so that "
        "it can be fitted and judged",
    )
    most = replace(limits, length=min(length or limits.length, 8192 * present.source.dt))
    found = list(
        possible_designs(
            present, most, lambda d: limit_share(fits, present, d, limits), (1.0, 0.6, 0.35, 0.2, 0.1, 0.05)
        )
    )
    expect(
        found,
        f"the limits (force {limits.force:g}, displacement {limits.displacement:g}, length {limits.length:g} s) allow "
        f"no test; expected larger --max-force, --max-displacement or --max-length: this record reached a force of "
        f"{own.force:.3g} and a displacement of "
        f"{own.displacement:.3g} in {own.length:.3g} s",
    )
    return found


def shorter_designs(
    fits: Sequence[FreeRunFit], present: PresentTest, limits: Limits, design: Design
) -> Iterator[Design]:
    """The same kind of test in a half and in a quarter of the time, where the limits allow that."""
    for part in (2, 4):
        samples = len(design.record) // part
        if samples * design.record.dt < shortest(present):
            return
        try:
            shorter = present.design(design.kind, design.place, samples, design.level)
        except StudyError:  # a band without a line
            return
        if limit_share(fits, present, shorter, limits) <= 1.0:
            yield shorter


def shortest(present: PresentTest) -> float:
    """Length in seconds that a test has at least: some periods of the motion to fit and to judge, or the record's."""
    return min(max(256 * present.source.dt, 20.0 / present.resonance), len(present.source) * present.source.dt)


def root_of_inverse(covariance: Floats) -> Floats:
    """R with ``R' R`` the inverse of a covariance, shape (any, keys); of what is not known at all, no row."""
    size = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    size = np.where(size > 0.0, size, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    values = np.maximum(values, 1e-12 * values[-1])
    return np.asarray((vectors / np.sqrt(values)).T / size, dtype=np.float64)
