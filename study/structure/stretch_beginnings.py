"""States with which the fit of a structure begins."""

import numpy as np

from study.equations.free_run import FreeRun
from study.equations.model import Model
from study.records.prepared import Prepared
from study.support.arrays import Floats


def beginnings(initial: Floats | None, run: FreeRun, prepared: Prepared, model: Model) -> list[Floats]:
    """States from which a search may begin, the better first, each of shape (states,): those given, or rest.

    Where motions begin anew, as they were measured: rest tells nothing of a stiffness that hardens or of dry friction.
    Rest comes second there, as a motion as measured may escape from a spring that is far wrong.
    """
    state = np.zeros((1 + len(run.cuts), run.states))
    rest = np.zeros(state.size)
    if initial is not None:
        given = initial.reshape(len(state), -1)
        state[:, : given.shape[1]] = given
    elif prepared.record.stretches:
        begins = [prepared.plan.fit[0] + cut for cut in (0, *run.cuts)]
        for i, coordinate in enumerate(model.coordinates):
            if coordinate in prepared.coordinates:
                state[:, [i, i + len(model.coordinates)]] = prepared.record.motion(coordinate)[:2, begins].T
    return [state.ravel(), rest] if initial is None and prepared.record.stretches else [state.ravel()]
