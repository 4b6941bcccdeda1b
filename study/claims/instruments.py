"""Section 5.4 with another estimator: what its statements would be with instruments from a free run."""

from study.claims.damping import COMBINED
from study.claims.evidence import Drive, Evidence
from study.claims.levels import PARTS, bias, noises, shift
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
    """The conditions of ``noise_random_only`` and ``noise_linear``, and those of A_1 on A_2 too."""
    conditions: list[Condition] = []
    clean = evidence.unit(COMBINED)
    for noise in noises(reported)[-1:]:  # the highest: a fit in free run for every record
        found = _errors(evidence, reported, noise)
        before = {n: clean.miso(n).scaled(1.0 / reported.table_1(COMBINED, n)) for n in NAMES}
        label = f"{100 * noise:g} % noise"
        conditions += [
            together(label, [shift(n, sample.minus(before[n])) for n, sample in found.items()]),
            together(label, [bias(n, sample.mean - 1.0) for n, sample in found.items()]),
        ]
    return conclude(reported, "noise_instruments", *conditions)


def _errors(evidence: Evidence, reported: Reported, noise: float) -> dict[str, Sample]:
    """Each parameter over its exact value."""
    drive = Drive(COMBINED, noise=noise)
    model, (low, high) = evidence.model(drive), evidence.settings["fit_band"]
    told = Settings(Segments(**evidence.settings["segments"]), (low, high))

    def one(record: Record) -> dict[str, float]:
        return {p.name: p.value for p in instrumental.identify(model, record, told).parameters}

    own, *others = threaded(one, evidence.records(drive))
    truth = {n: reported.table_1(COMBINED, n) for n in NAMES}
    return {n: Sample(tuple(o[n] / truth[n] for o in others), own[n] / truth[n]) for n in NAMES}


CLAIMS = (unbiased,)
