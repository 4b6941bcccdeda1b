"""A positioning axis under position control: a mass without a spring, with dry friction, as a test bench records it."""

import numpy as np

from study.records.record import Record

DT, SECONDS, SUBSTEPS = 1e-3, 25.0, 4
MASS, DAMPING, FRICTION, OFFSET = 95.0, 200.0, 20.0, -3.0
STIFF, DAMPED = 12_000.0, 900.0  # of the position control, N/m and N s/m
ENCODER = 1e-6  # metres
ACCELERATION = 2.0  # of a move, m/s^2


def trapezoid(time: np.ndarray, begin: float, distance: float, speed: float) -> np.ndarray:
    """Position along one move that speeds up, runs evenly and slows down."""
    ramp = speed / ACCELERATION
    even = distance / speed - ramp
    t = np.clip(time - begin, 0.0, even + 2.0 * ramp)
    up, run, down = np.minimum(t, ramp), np.clip(t - ramp, 0.0, even), np.clip(t - ramp - even, 0.0, ramp)
    return 0.5 * ACCELERATION * up**2 + speed * (run + down) - 0.5 * ACCELERATION * down**2


def axis(seed: int = 1) -> Record:
    """Force of the drive and position by the encoder, 1 kHz, ten moves of 0.05 to 0.24 m with pauses between."""
    rng = np.random.default_rng(seed)
    fine = DT / SUBSTEPS
    time = fine * np.arange(round(SECONDS / fine))
    wanted = np.zeros_like(time)
    for move in range(10):
        distance, speed = rng.uniform(0.05, 0.24), rng.uniform(0.1, 0.5)
        speed = min(speed, np.sqrt(0.9 * distance * ACCELERATION))
        wanted += (-1) ** move * trapezoid(time, 0.5 + 2.4 * move, distance, speed)
    rate = np.gradient(wanted, fine)
    position, velocity = np.zeros(len(time) + 1), 0.0
    force = np.zeros(len(time))
    for k in range(len(time)):
        force[k] = STIFF * (wanted[k] - position[k]) + DAMPED * (rate[k] - velocity)
        free = force[k] - DAMPING * velocity - OFFSET
        if velocity == 0.0 and abs(free) <= FRICTION:  # it sticks
            position[k + 1] = position[k]
            continue
        side = np.sign(velocity) or np.sign(free)
        after = velocity + fine * (free - side * FRICTION) / MASS
        if velocity != 0.0 and after * velocity < 0.0:  # it stops within the step
            after = 0.0
        position[k + 1] = position[k] + fine * 0.5 * (velocity + after)
        velocity = after
    encoder = ENCODER * np.round(position[:-1:SUBSTEPS] / ENCODER)
    return Record(DT, {"force": force[::SUBSTEPS], "displacement": encoder}, name="axis")
