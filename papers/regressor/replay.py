"""The on-line law on recorded motions of real arms: a replay, beyond the gravity-regressor paper's simulation.

Recordings of a dVRK's master (MTM) and slave (PSM): 4,096 poses of the master that it holds at rest, each approached
from one side (Lin et al.), and Fourier motions of both (Wang et al.). The estimators hear positions, velocities and
torques as observers beside a controller; the law from zero, Omega 4 / s, on the compact regressor; recursive least
squares beside it. They learn from the first 60 % and are then asked for the rest, in the order of the recording; a
batch identification of the same rows stands beside them (gravity with constants, friction's offsets and springs; full
dynamics on motions). "None" is the torque itself.

The paper's law is for arms at rest. The Fourier motions never rest: there the law runs without its gate of speed, and
takes friction and inertia for gravity. Poses are replayed to the law for 2 s each, to the least squares once; these
take 30 % of the torque for noise.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from papers.claims import Claims, Missing, by_count
from papers.experiment import Case, Experiment, Judgement, Outcomes, Report, Result, Scope, TitledPicture
from papers.figures import legend_below, panels
from papers.kit import grid, table
from papers.regressor.recorded_arms import RECORDINGS, replay

METHODS = ("none", "law", "least squares", "batch, gravity", "batch, full dynamics")
STATIC = tuple(name for name, (_, static) in RECORDINGS.items() if static)
MOVING = tuple(name for name, (_, static) in RECORDINGS.items() if not static)
LOADED_AXES = (1, 2)  # J2, J3 of the master: those that gravity loads most
SHOWN = {STATIC[0]: (1, 2), MOVING[1]: (0, 1)}  # axes of pictures
COLORS = {"measured": "#b8bfc9", "law, as it learns": "#d9622b", "least squares": "#4b6b94"}
LABELS = {"least squares": "least squares, as learnt in the end"}
HALF = 0.5


def cases(scope: Scope) -> Sequence[Case]:
    """Return a case for every recording that is there."""
    names = [] if scope.data is None else [name for name in RECORDINGS if (scope.data / name).is_file()]
    return grid(replay, {"recording": names[:1] if scope.quick else names}, rows=200 if scope.quick else None)


def of(o: Outcomes, recording: str) -> Result:
    """Return what a recording showed.

    Raises:
        Missing: It is not here.
    """
    for result in o.of(replay, recording=recording):
        return result
    raise Missing(recording)


def report(o: Outcomes) -> Report:
    """Return errors of the later part by recording and method, and torques over time."""
    tables, pictures, remarks = [], [], []
    for recording in RECORDINGS:
        try:
            result = of(o, recording)
        except Missing:
            remarks.append(f"{recording}: no such recording here.")
            continue
        name, rms, (whole, until) = recording.removesuffix(".npz"), result["rms_Nm_or_N"], result["rows"]
        header = ["predicted by", *(_axis(result, k) for k in range(len(result["axes"])))]
        content = [[method, *(f"{value:.3f}" for value in rms[method])] for method in METHODS if method in rms]
        tables.append(table(f"{name}: RMS error on rows {until} to {whole}, none of them learnt from", header, content))
        if recording in SHOWN:
            caption = f"{name}: measured and predicted torque; shaded: learnt from"
            pictures.append(TitledPicture(caption, _picture(result, SHOWN[recording])))
    return Report(tables, pictures, remarks)


def _axis(result: Result, k: int) -> str:
    return f"{result['axes'][k]} [{'Nm' if result['units'][k] == 'rad' else 'N'}]"


def _picture(result: Result, axes_shown: Sequence[int]) -> Any:
    figure, axes = panels(1, 2.3 * len(axes_shown), rows=len(axes_shown), sharex=True)
    for panel, k in zip(axes, axes_shown, strict=True):
        panel.axvspan(result["row"][0], result["rows"][1], color="#eef1f5", zorder=0)
        for name, color in COLORS.items():
            torque = result["torque_Nm_or_N"][name][k]
            width = 3.0 if name == "measured" else 1.1
            label = LABELS.get(name, name)
            panel.plot(result["row"], torque, color=color, linewidth=width, label=label)
        panel.set_ylabel(_axis(result, k))
        measured = np.array(result["torque_Nm_or_N"]["measured"][k])
        low, high = float(measured.min()), float(measured.max())
        panel.set_ylim(low - 0.4 * (high - low), high + 0.4 * (high - low))
    axes[-1].set_xlabel("row")
    legend_below(figure, axes[0], columns=3)
    return figure


def _left(o: Outcomes, recordings: Sequence[str], axes: Sequence[int]) -> tuple[list[float], str]:
    """Return which share of the torque the law leaves on axes of the later part, and the same in words."""
    shares: dict[str, float] = {}
    for recording in recordings:
        result, short = of(o, recording), recording.partition("/")[2].removesuffix(".npz")
        rms = result["rms_Nm_or_N"]
        shares |= {f"{short} {result['axes'][k]}": rms["law"][k] / rms["none"][k] for k in axes}
    return list(shares.values()), f"left: {', '.join(f'{name} {100.0 * each:.0f} %' for name, each in shares.items())}"


CLAIMS = Claims()


@CLAIMS(
    "On a real arm, too, the parameters give the gravitational force once they are estimated",
    "IV, future work",
    "to be implemented in the real robot, no numbers",
    "on poses at rest of a master arm that come later, the law leaves less than half of the torque on the axes that "
    "gravity loads, J2 and J3, in both recordings",
    "The law fits the pose at hand, by the smallest change of parameters, and lets go of what other poses told; how "
    "well it does in others is left to where it stood last. Least squares on the same rows, which add the poses up, "
    "leave far less in both recordings (tables); so the parameters are there to be found.",
)
def _at_rest(o: Outcomes) -> Judgement:
    shares, told = _left(o, STATIC, LOADED_AXES)
    return by_count([share < HALF for share in shares], told)


EXPERIMENT = Experiment(
    "regressor-replay", "beyond the paper", "The on-line law on recorded motions", __doc__,
    cases, report, minutes=2.0, claims=CLAIMS, drawn=0, simulated=False, needs_data=True,
)  # fmt: skip
