"""The frequency response function of drive and response, measured and as the fitted model predicts it.

Both by H1 = G_fx / G_ff from the same force on the same samples, so that what a nonlinear system does to H1 shows in
both alike (Bendat and Piersol, Random Data, 2010, Section 9.1). Where the motion is prescribed, displacement drives and
the force responds: H1 is then the dynamic stiffness, whose phase is the loss angle.
"""

from dataclasses import dataclass

import numpy as np

from study.compare.noise import segments_of
from study.compare.prediction import Prediction, SensorPrediction
from study.identify.frequency_domain.linear_start import FAINT
from study.records.record import FORCE, MOTIONS, Sensor
from study.records.spectra import SpectralMatrix, cross_spectra
from study.support.arrays import Complexes, Floats
from study.support.errors import expect


@dataclass(frozen=True)
class ResponseFunctions:
    """Response over drive at each line; arrays of shape (lines,)."""

    frequency: Floats  # in hertz
    measured: Complexes  # unit of the response over that of the drive
    predicted: Complexes  # the same of the model's free run
    error: Floats  # standard error of the measured magnitude: |H| sqrt((1 - g) / (2 n g)), with g the coherence
    coherence: Floats  # ordinary coherence of drive and measured response
    coherence_predicted: Floats  # the same of the model's: below one where it is nonlinear

    @property
    def magnitude(self) -> tuple[Floats, Floats]:
        """|H|, measured and predicted."""
        return np.abs(self.measured), np.abs(self.predicted)

    @property
    def phase(self) -> tuple[Floats, Floats]:
        """Phase in degrees from -180 to 180, measured and predicted."""
        return np.degrees(np.angle(self.measured)), np.degrees(np.angle(self.predicted))


def response_functions(prediction: Prediction, sensor: int = 0) -> ResponseFunctions:
    """H1 of one of the sensors on the judging part, where the drive has power.

    Raises
    ------
    StudyError
        If the record is of free decays, which nothing drives.
    """
    prepared, seen = prediction.prepared, prediction.of(sensor)
    name = prepared.record.name
    expect(not prepared.free, f"{name}: no force acts; expected a driven record for a frequency response function")
    drive = prepared.record[drive_of(seen)][slice(*prepared.plan.judge)]
    cut = segments_of(len(drive))
    measured = cross_spectra([drive, seen.measured], prediction.dt, cut)
    predicted = cross_spectra([drive, seen.predicted], prediction.dt, cut)
    power = measured.density[:, 0, 0].real
    kept = (measured.frequency > 0.0) & (power > FAINT * np.max(power))
    (h, coherence), (model, of_model) = _h1(measured), _h1(predicted)
    spread = np.sqrt((1.0 - coherence) / (2.0 * measured.averages * np.maximum(coherence, np.finfo(float).eps)))
    return ResponseFunctions(
        measured.frequency[kept], h[kept], model[kept], (np.abs(h) * spread)[kept], coherence[kept], of_model[kept]
    )


def drive_of(seen: SensorPrediction) -> str:
    """The channel that a response answers to: the force, the first of several, or the displacement prescribed there."""
    if seen.sensor.motion == FORCE:
        return str(Sensor(seen.sensor.coordinate, MOTIONS[0]))
    return seen.prepared.record.forces[0]


def _h1(matrix: SpectralMatrix) -> tuple[Complexes, Floats]:
    """H1 of channel 1 over channel 0, and their coherence."""
    tiny = np.finfo(float).tiny
    force, response = matrix.density[:, 0, 0].real, matrix.density[:, 1, 1].real
    cross = matrix.density[:, 0, 1]
    coherence = np.clip(np.abs(cross) ** 2 / np.maximum(force * response, tiny), 0.0, 1.0)
    return (cross / np.maximum(force, tiny)).astype(np.complex128), coherence
