import errno
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_recordings import fit_logs
from catenary.errors import InputError
from catenary.plant import JOINT_ARRAYS
from catenary.recording.logs import on_disk
from catenary.side_by_side import on_workers
from recordings import recording


def test_a_recording_on_disk_holds_the_same_bits_and_its_parts_stay_there() -> None:
    log = replace(recording(np.random.default_rng(0), rows=300), signals={"current": np.arange(300.0)})
    kept = on_disk(log)
    for one, other in ((kept, log), (kept.part(10, 200), log.part(10, 200)), (replace(kept, name="b"), log)):
        for name in (*JOINT_ARRAYS, "time", "ok"):
            assert_array_equal(getattr(one, name), getattr(other, name))
            assert getattr(one, name) is None or isinstance(getattr(one, name), np.memmap)
        assert_array_equal(one.signals["current"], other.signals["current"])
    with pytest.raises(ValueError, match="read-only"):
        kept.q_nominal[0, 0] = 1.0


@pytest.mark.parametrize("workers", [1, 2])
def test_a_fit_of_recordings_on_disk_is_that_of_the_same_in_memory(workers: int) -> None:
    logs = [replace(recording(np.random.default_rng(k), rows=400), name=f"run {k}") for k in range(3)]
    options, run = FitOptions(kind="hysteretic"), FitRun()
    alone = fit_logs(logs, options, run)
    with on_workers(workers):
        found = fit_logs([on_disk(log) for log in logs], options, run)
    assert found.card == alone.card


def test_a_full_disk_is_told_with_the_way_round_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(np, "save", full)
    with pytest.raises(InputError, match="cannot hold it: No space left on device; name another folder by TMPDIR"):
        on_disk(recording(np.random.default_rng(0), rows=30))


def test_nothing_is_left_on_disk_when_the_program_ends() -> None:
    program = """
import numpy as np
from catenary.plant import MotionLog
from catenary.recording.logs import on_disk
print(on_disk(MotionLog("a", ("J1",), ("rad",), np.zeros((9, 1)), np.ones(9, dtype=bool))).q_nominal.filename)
"""
    path = Path(
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.strip()
    )
    assert path.suffix == ".npy"
    assert not path.parent.exists()
