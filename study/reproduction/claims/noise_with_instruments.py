"""Section 5.4 with another estimator: what its statements would be with instruments from a free run."""

from study.identify.estimators.in_free_run import instrumental
from study.reproduction.claims.common import COMBINED, noises
from study.reproduction.claims.evidence import Drive, Evidence
from study.reproduction.claims.judgement import Condition, claims, together
from study.reproduction.claims.levels import PARTS, SIGNIFICANT_BIAS
from study.reproduction.claims.reported import Reported
from study.reproduction.claims.sample import Sample
from study.reproduction.ensemble import threaded
from study.support.numbers import percent


def noise_instruments(evidence: Evidence, reported: Reported) -> list[Condition]:
    """The condition of ``noise_linear`` on A_1, put to A_2 as well: the plain bias against the exact values.

    That errors are random only is not claimed: over 200 seeds (docs/estimators.md) a few tenths of a per cent are left.
    """
    return [
        together(
            f"{percent(noise)} noise",
            [small(n, bias) for n, bias in relative_errors(evidence, reported, noise).items()],
        )
        for noise in noises(reported)
    ]


def small(name: str, bias: Sample) -> Condition:
    """A bias that is not significant, in the sense of ``noise_linear``."""
    measured, met = f"{name} {percent(bias.mean, '+.3g', bias.error, '.2g')}", abs(bias.mean) <= SIGNIFICANT_BIAS
    return Condition(f"mean bias of {name} within {percent(SIGNIFICANT_BIAS)}", measured, met, measured)


def relative_errors(evidence: Evidence, reported: Reported, noise: float) -> dict[str, Sample]:
    """Relative error of each parameter against its exact value."""
    drive, settings = Drive(COMBINED, noise=noise), evidence.estimator_settings()
    model, truth = evidence.model(drive), {n: reported.table_1(COMBINED, n) for n in (*PARTS, "f_n")}
    identified = threaded(lambda r: instrumental(model, r, settings), evidence.records(drive))
    estimates = [{p.name: p.value for p in i.parameters} for i in identified]
    return {n: Sample.own_first(e[n] / true - 1.0 for e in estimates) for n, true in truth.items()}


CLAIMS = claims(noise_instruments)
