"""A simulated inertial unit on the base of a simulated arm."""

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from catenary.arrays import as_array
from catenary.errors import InputError
from catenary.sensing.mounting import Mounting
from catenary.sensing.vector import Mailbox
from catenary.simulation.base_motion import MovingBase
from catenary.simulation.sensors import InjectedFault, SensorModel, SimulatedSensor


def base_sensor(
    base: MovingBase,
    *,
    start: float = 0.0,
    bias: ArrayLike = (0.0, 0.0, 0.0),
    noise: float | None = None,
    fault: InjectedFault | None = None,
    seed: int = 0,
) -> tuple[SimulatedSensor, Mounting]:
    """Put a cheap inertial unit, 200 Hz, at the origin of a base; return it and the mounting that is told of it.

    Args:
        base: What the arm stands on.
        start: Time of its first sample [s]; the plant's.
        bias: (3,) of its accelerometer, of which the mounting knows nothing [m/s2]: what a calibration left.
        noise: Standard deviation of an axis of a reading [m/s2]; an MPU-6050's when None.
        fault: What goes wrong with it.
        seed: Of its noise.

    Raises:
        InputError: A bias that is no vector, or negative noise.
    """
    model = SensorModel()
    if noise is not None:
        if not 0.0 <= noise < np.inf:
            raise InputError(f"sensor noise: expected 0 or more m/s2, got {noise}")
        # white up to half the sampling rate
        model = replace(model, noise=noise / float(np.sqrt(0.5 * model.rate_hz)))
    told = model.mounting
    true = replace(told, bias=as_array("sensor bias", bias, (3,)))
    faults = () if fault is None else (fault,)
    sensor = SimulatedSensor(
        base, Mailbox(), replace(model, mounting=true), faults=faults, seed=seed, start=start
    )
    return sensor, told
