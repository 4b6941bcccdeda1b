"""Section 5.4 with another estimator: what its statements would be with instruments from a free run."""

from study.identify.estimators import instrumental
from study.identify.estimators.base import Settings
from study.records.record import Record
from study.records.spectra import Segments
from study.reproduction.claims.damping import COMBINED
from study.reproduction.claims.evidence import Drive, Evidence
from study.reproduction.claims.judgement import Claim, Condition, conclude, together
from study.reproduction.claims.levels import PARTS, SIGNIFICANT_BIAS, noises
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample
from study.reproduction.ensemble import threaded

NAMES = (*PARTS, "f_n")


def unbiased(evidence: Evidence, reported: Reported) -> Claim:
    """The condition of ``noise_linear`` on A_1, put to A_2 as well: the plain bias against the exact values.

    That errors are random only is not claimed: over 200 seeds (docs/estimators.md) a few tenths of a per cent are left.
    """
    found = {noise: biases(evidence, reported, noise) for noise in noises(reported)}
    conditions = (
        together(f"{100 * noise:g} % noise", [small(name, off) for name, off in own.items()])
        for noise, own in found.items()
    )
    return conclude(reported, "noise_instruments", *conditions)


def small(name: str, off: Sample) -> Condition:
    """A bias that is not significant, in the sense of ``noise_linear``."""
    text = f"{name} {100 * off.mean:+.3g} +- {100 * off.error:.2g} %"
    return Condition(
        f"mean bias of {name} within {100 * SIGNIFICANT_BIAS:g} %", text, abs(off.mean) <= SIGNIFICANT_BIAS, text
    )


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
