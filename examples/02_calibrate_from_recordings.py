"""Calibrate a cable-driven arm from recordings: fit, evaluate on another one, correct a position.

Two recordings of a simulated RAVEN-II stand for yours: two zig-zags to learn from, a random motion to test on. The
table shows the RMSE per joint on the second, which no model saw: of what the robot reports, after a fixed offset, after
a linear model of the positions, with torques beside them, and with the cables' memory instead of torques. Then one
position is corrected, as a controller would, and the model is asked about a position that it knows nothing of: it says
so, and falls back to the offset.
"""

import tempfile
from pathlib import Path

import numpy as np

from catenary.calibration.files import save_model
from catenary.calibration.fit import PLAY_SHARES, FitOptions
from catenary.recording.logs import write_parquet
from catenary.simulation.cable_plant import CablePlant
from catenary.trajectories.sinusoids import random_sinusoids
from catenary.trajectories.zigzag import zigzag
from catenary.workflows.fit import FitRun, evaluate_calibration, fit_calibration
from catenary.workflows.simulated_recording import record_simulated

folder = Path(tempfile.mkdtemp())
rng = np.random.default_rng(0)
arm = CablePlant(seed=0)
arm.home()
train_log = record_simulated(arm, zigzag("J2-J3", [1 / 2, 1 / 3]), "monday", rng)
test_log = record_simulated(arm, random_sinusoids(rng, 120.0), "tuesday", rng)
write_parquet(train_log, folder / "monday.parquet")
write_parquet(test_log, folder / "tuesday.parquet")

models = {
    "linear": FitOptions(kind="linear", inputs=("q:shoulder", "q:elbow", "q:insertion")),
    "linear, with torques": FitOptions(kind="linear", inputs=("q", "tau")),
    "linear, with play states": FitOptions(
        kind="linear", inputs=("q:shoulder", "q:elbow", "q:insertion"), play=PLAY_SHARES
    ),
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

print(f"\nreported   {test_log.q_nominal[-1]}")
print(f"calibrated {fitted.model.calibrate(test_log)[-1]}")
print(f"true       {test_log.q_encoder[-1]}")
far = np.full((1, len(fitted.model.features.names)), 10.0)
print(f"\nat 10 rad: inside the valid range {fitted.model.inside(far)[0]}")
print(f"           correction {fitted.model.correction(far, far[:, :3])[0]}, offset {fitted.model.offset}")
