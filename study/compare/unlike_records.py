"""Several records fitted together: which coefficients, and which zeros of decays, they want each for itself.

One coefficient forced on two assemblies, or one zero on two runs, leaves an error that some effect then imitates. What
each record wants for itself is one step of Gauss and Newton from the fit that they share.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from study.compare.fitted_coefficients import RESOLUTION
from study.equations.coefficient_units import coefficient_unit
from study.equations.model import Model
from study.identify.time_domain.free_run_fit import FreeRunFit
from study.identify.time_domain.part_fit import with_states
from study.records.prepared import FORCE, Prepared
from study.records.record import Record
from study.support.least_squares import least_squares
from study.support.numbers import enumerated
from study.support.statistics import clustered_covariance
from study.support.thresholds import ALPHA

ZERO = "zero"  # of a sensor, in place of a key
CHANNEL = "along_record_{}"  # one along this record and zero along the others: what may differ there acts with it


@dataclass(frozen=True)
class Unlike:
    """What each of several records wants of a coefficient, or of the zero of a sensor."""

    key: str  # of the coefficient, or ``ZERO``
    values: dict[str, float]  # by record
    p_value: float  # of such differences if there were none, all that was asked accounted for


def unlike_records(fit: FreeRunFit, prepared: Prepared) -> tuple[Unlike, ...]:
    """Coefficients of one fit to several records that these want unlike by more than chance, the surest first.

    Free decays are asked for the zero of a single mass's displacement too, which a spring's constant force is.
    """
    names = list(dict.fromkeys(stretch.source.name for stretch in prepared.record.stretches))
    apart_already = any(channel.startswith(CHANNEL.format("")) for channel in prepared.record.extra)
    if len(names) < 2 or apart_already or fit.restarts or fit.model.modal or prepared.response == FORCE or not fit.keys:
        return ()
    jacobian, sensors = with_states(fit, prepared), len(prepared.outputs)
    first, last = prepared.plan.fit
    owners = np.concatenate([np.full(len(s), names.index(s.source.name)) for s in prepared.record.stretches])
    owner = np.repeat(owners[first:last], sensors)  # of each residual the number of its record
    asked = {key: jacobian[:, i] for i, key in enumerate(fit.keys)}
    if prepared.free and sensors == 1 and prepared.response == "displacement":
        asked[ZERO] = np.ones(len(owner))
    found: list[Unlike] = []
    for key, column in asked.items():
        each = np.stack([np.where(owner == r, column, 0.0) for r in range(len(names))], axis=1)
        design = np.hstack([each, np.delete(jacobian, [fit.keys.index(key)] if key in fit.keys else [], axis=1)])
        steps = least_squares(design, fit.residual)
        covariance = clustered_covariance(design, fit.residual - design @ steps)[: len(names), : len(names)]
        each_own = np.eye(len(names))
        apart = each_own if key == ZERO else each_own[1:] - each_own[:1]  # a coefficient's differences to the first
        wanted = apart @ steps[: len(names)]
        size = float(wanted @ np.linalg.pinv(apart @ covariance @ apart.T) @ wanted)
        p_value = float(chdtrc(len(apart), size)) * len(asked)
        own = 0.0 if key == ZERO else float(fit.values[fit.keys.index(key)])
        if p_value < ALPHA and float(np.max(np.abs(wanted))) > RESOLUTION * abs(own):
            values = dict(zip(names, (own + steps[: len(names)]).tolist(), strict=True))
            found.append(Unlike(key, values, p_value))
    return tuple(sorted(found, key=lambda unlike: unlike.p_value))


def unlike_in_words(found: Sequence[Unlike], model: Model, record: Record) -> str:
    """That records want unlike values of something, the surest first; empty if they do not."""
    said: list[str] = []
    for one in found:
        entry = next((entry for entry in model.terms if one.key in entry.keys), None)
        unit = record.units.get("displacement", "m") if entry is None else coefficient_unit(entry, one.key, record)
        values = enumerated([f"{value:.3g} {unit} in {name}" for name, value in one.values.items()])
        if entry is None:
            said.append(f"each record has a zero of its own: {values} (--each-record constant_force beside that term)")
        else:
            said.append(
                f"the records ask for different values of {one.key}: {values} (--each-record {entry.term.name}), or an "
                "effect is missing that shows differently at their levels"
            )
    return "; ".join(said)
