"""Compare the learner with an afternoon's models on drawn arms: `python -m tests.drawn_arms SEED...`.

Thresholds are set on even seeds; the table to report is that of odd ones.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1]))

from drawn_arms import bench
from drawn_arms.arm import Arm


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", nargs="+", type=int, metavar="SEED")
    parser.add_argument("--torque", choices=("yes", "no"), help="arms all with torque, or all without")
    parser.add_argument("--recordings", choices=("1", "3"), help="recordings that each arm is learnt from")
    parser.add_argument("--minutes", type=float, help="length of the recordings together")
    asked = parser.parse_args()
    found: dict[str, list[np.ndarray]] = {}
    for seed in asked.seeds:
        torque = None if asked.torque is None else asked.torque == "yes"
        arm = Arm(seed, torque=torque, single=None if asked.recordings is None else asked.recordings == "1")
        model = bench.learned(arm, asked.minutes)
        best, own = bench.of_baselines(arm, asked.minutes), bench.of_model(model, arm)
        for test, errors in own.items():
            found.setdefault(test, []).append(errors / best[test])
        print(arm, "random", np.round(found["random"][-1], 2), flush=True)
    print(bench.summary({test: np.concatenate(ratios) for test, ratios in found.items()}))


if __name__ == "__main__":
    main()
