"""Section 5.4 with another estimator: what its statements would be with instruments from a free run."""

from study.claims.damping import COMBINED
from study.claims.evidence import Drive, Evidence
from study.claims.levels import PARTS, SIGNIFICANT_BIAS, noises
from study.claims.reported import Reported
from study.claims.sample import Sample
from study.claims.verdict import Claim, Condition, conclude, together
from study.ensemble import threaded
from study.estimators import instrumental
from study.estimators.base import Settings
from study.record import Record
from study.spectra import Segments

NAMES = (*PARTS, "f_n")


def unbiased(evidence: Evidence, reported: Reported) -> Claim:
    """The conditions of ``noise_random_only`` and ``noise_linear``, and those of A_1 on A_2 too.

    Both are put to the plain bias against the exact values. Scatter alone explains any bias where it is large enough,
    so that the limit of ``noise_linear`` to a significant bias holds as well.
    """
    conditions: list[Condition] = []
    for noise in noises(reported):
        found = biases(evidence, reported, noise)
        label = f"{100 * noise:g} % noise"
        conditions += [
            together(label, [random(n, off) for n, off in found.items()]),
            together(label, [small(n, off) for n, off in found.items()]),
        ]
    return conclude(reported, "noise_instruments", *conditions)


def random(name: str, off: Sample) -> Condition:
    """A bias that scatter alone explains."""
    return _below(3.0 * off.error, "3 standard errors of zero", name, off)


def small(name: str, off: Sample) -> Condition:
    """A bias that is not significant, in the sense of ``noise_linear``."""
    return _below(SIGNIFICANT_BIAS, f"{100 * SIGNIFICANT_BIAS:g} %", name, off)


def _below(limit: float, said: str, name: str, off: Sample) -> Condition:
    text = f"{name} {100 * off.mean:+.3g} +- {100 * off.error:.2g} %"
    return Condition(f"mean bias of {name} within {said}", text, abs(off.mean) <= limit, text)


def biases(evidence: Evidence, reported: Reported, noise: float) -> dict[str, Sample]:
    """Relative error of each parameter against its exact value."""
    drive = Drive(COMBINED, noise=noise)
    model, (low, high) = evidence.model(drive), evidence.settings["fit_band"]
    told = Settings(Segments(**evidence.settings["segments"]), (low, high))

    def one(record: Record) -> dict[str, float]:
        return {p.name: p.value for p in instrumental.identify(model, record, told).parameters}

    own, *others = threaded(one, evidence.records(drive))
    truth = {n: reported.table_1(COMBINED, n) for n in NAMES}
    return {n: Sample(tuple(o[n] / truth[n] - 1.0 for o in others), own[n] / truth[n] - 1.0) for n in NAMES}


CLAIMS = (unbiased,)
