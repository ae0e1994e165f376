"""Calibrate a cable-driven arm from recordings: fit, evaluate on another one, correct a position.

Two recordings of a simulated RAVEN-II stand for yours. The table shows the RMSE per joint on the one that no model saw:
of what the robot reports, after a fixed offset, after a linear model of the positions, with torques beside them, and
with the cables' memory instead of torques. Then one position is corrected, as a controller would, and the model is
asked about a position that it knows nothing of: it says so, and falls back to the offset.
"""

import tempfile
from pathlib import Path

import numpy as np

from catenary.calibration.files import save_model
from catenary.calibration.fit import PLAY_SHARES, FitOptions
from catenary.jobs.calibration import FitRun, evaluate_calibration, fit_calibration
from catenary.jobs.demo import draw_cables, simulate_recording
from catenary.recording.logs import write_parquet

folder = Path(tempfile.mkdtemp())
rng = np.random.default_rng(0)
cables = draw_cables(rng)
test_log = simulate_recording("tuesday", cables, 60.0, rng)
write_parquet(simulate_recording("monday", cables, 300.0, rng), folder / "monday.parquet")
write_parquet(test_log, folder / "tuesday.parquet")

models = {
    "linear": FitOptions(kind="linear", inputs=("q",)),
    "linear, with torques": FitOptions(kind="linear", inputs=("q", "tau")),
    "linear, with play states": FitOptions(kind="linear", inputs=("q",), play=PLAY_SHARES),
}
print(f"{'':26} shoulder [deg]  elbow [deg]  insertion [mm]")
for name, options in models.items():
    fitted = fit_calibration([folder / "monday.parquet"], options, FitRun(folds=0))
    save_model(fitted.model, fitted.card, folder / "model.npz")
    joints = evaluate_calibration(folder / "model.npz", [folder / "tuesday.parquet"]).evaluation.joints
    if name == "linear":
        print(f"{'reported':26}" + "".join(f"{joint.raw_rmse:14.3f}" for joint in joints))
        print(f"{'fixed offset':26}" + "".join(f"{joint.offset_rmse:14.3f}" for joint in joints))
    print(f"{name:26}" + "".join(f"{joint.rmse:14.3f}" for joint in joints))

q_calibrated = fitted.model.calibrate(test_log)
print(f"\nreported   {test_log.q_nominal[-1]}")
print(f"calibrated {q_calibrated[-1]}")
print(f"true       {test_log.q_encoder[-1]}")

far = np.full((1, len(fitted.model.features.names)), 10.0)
print(f"\nat 10 rad: inside the valid range {fitted.model.inside(far)[0]}")
print(f"           correction {fitted.model.correction(far, far[:, :3])[0]}, offset {fitted.model.offset}")
