import numpy as np
import pytest
from numpy.testing import assert_array_equal

import catenary
from catenary.calibration.model_maintenance import refresh_with
from catenary.calibration.recordings import Recordings
from catenary.errors import InputError
from catenary.plant import MotionLog
from recordings import recording


def a_day(seed: int, *, sha256: str, zero: float = 0.0) -> MotionLog:
    rng = np.random.default_rng(seed)
    return recording(
        rng, rows=900, error=lambda q: 0.03 * q + zero + 1e-3 * rng.standard_normal(q.shape), sha256=sha256
    )


def test_python_and_command_refresh_alike_and_learn_from_no_recording_twice() -> None:
    first, second = a_day(0, sha256="a" * 64), a_day(1, sha256="b" * 64, zero=0.02)
    model = catenary.fit(first, model="linear")
    refreshed = model.refresh(second)
    day = refresh_with(model, model.card, Recordings.of([second]), sha256="c" * 64)
    assert_array_equal(refreshed.predict(second), day.model.calibrate(second))
    assert day.card["refreshed"][-1]["model_sha256"] == "c" * 64
    assert [joint["largest_correction"] for joint in day.card["joints"]] == day.model.largest.tolist()
    assert day.moved == refreshed.card["refreshed"][-1]["moved"]
    for learnt, log in ((model, first), (refreshed, second)):
        with pytest.raises(InputError, match="fitted to it or refreshed with it"):
            learnt.refresh(log)
