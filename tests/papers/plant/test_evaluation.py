import numpy as np
import pytest
from numpy.testing import assert_array_equal

from papers.calibration import recordings
from papers.plant import evaluation


def test_every_direction_is_tested_on_the_same_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, seen = {}, []

    def record(plant: object, motion: object, name: str, rng: np.random.Generator, **_: object) -> None:
        if name == "zigzag":
            rng.random(round(motion.duration))  # type: ignore[attr-defined]  # jitter of the stamps: longer paths draw more
        seen.append(motion)

    monkeypatch.setattr(recordings, "record_simulated", record)
    for direction in ("J1", "J2-J3", "J1-J2-J3"):
        evaluation.recordings(None, direction)  # type: ignore[arg-type]
        drawn[direction] = seen[-1].sample(np.linspace(0.0, 1200.0, 50))[0]
    assert_array_equal(drawn["J1"], drawn["J2-J3"])
    assert_array_equal(drawn["J1"], drawn["J1-J2-J3"])
