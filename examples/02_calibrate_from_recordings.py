"""Calibrate a cable-driven arm from recordings: fit, evaluate on another one, correct a position.

Two recordings of a simulated RAVEN-II stand for yours: a zig-zag to learn from, a random motion to test on. The table
shows the RMSE per joint on the second, which no model saw, in deg and mm: of what the robot reports, after a fixed
offset, after a linear model of the positions, with torques beside them, and with the cables' memory instead of torques.
Then one position is corrected, as a controller would, and the model is asked about a position that it knows nothing of:
it says so, and falls back to the offset.
"""

import tempfile
from pathlib import Path

import numpy as np

import catenary

folder = Path(tempfile.mkdtemp())
rng = np.random.default_rng(0)
arm = catenary.CablePlant(seed=0)
arm.home()
train = catenary.record_simulated(arm, catenary.zigzag("J2-J3", [1 / 2]), "monday", rng)
test = catenary.record_simulated(arm, catenary.random_sinusoids(rng, 60.0), "tuesday", rng)
catenary.write_parquet(train, folder / "monday.parquet")
catenary.write_parquet(test, folder / "tuesday.parquet")

positions = ["q:shoulder", "q:elbow", "q:insertion"]
models = {
    "linear": {"inputs": positions},
    "linear, with torques": {"inputs": ["q", "tau"]},
    "linear, with play states": {"inputs": positions, "play": [0.01, 0.02, 0.05, 0.1, 0.2, 0.4]},
}
print(f"{'':26} shoulder [deg]  elbow [deg]  insertion [mm]")
for name, options in models.items():
    model = catenary.fit(folder / "monday.parquet", model="linear", **options)
    joints = model.evaluate(folder / "tuesday.parquet").joints
    if name == "linear":
        print(f"{'reported':26}" + "".join(f"{joint.raw_rmse:14.3f}" for joint in joints))
        print(f"{'fixed offset':26}" + "".join(f"{joint.offset_rmse:14.3f}" for joint in joints))
    print(f"{name:26}" + "".join(f"{joint.rmse:14.3f}" for joint in joints))
model.save(folder / "model.npz")

loaded = catenary.load_model(folder / "model.npz")
print(f"\nreported   {test.q_nominal[-1]}")
print(f"calibrated {loaded.predict(test)[-1]}")
print(f"true       {test.q_encoder[-1]}")

far, corrected, inside = np.full(3, 10.0), np.empty(3), np.empty(3, dtype=bool)
loaded.corrector(rate_hz=1000.0).correct(far, far, corrected, inside)
print(f"\nat 10 rad: inside the valid range {inside}")
print(f"           correction {corrected - far}, offset {loaded.offset}")
