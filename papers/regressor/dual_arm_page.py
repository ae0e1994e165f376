"""The 19-joint experiment's tables, its pictures in the manner of the paper's figures 4 and 5, and its page."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catenary.arrays import Floats
from catenary.reports.page import Block, Picture, Table, Text, picture
from papers.figures import panels
from papers.regressor.dual_arm import LIMBS, PICK_UP, TIMELINE, WINDOWS, Case, Summary
from papers.results import shown, write_files

DRAWN_EVERY = 20  # ticks
PAPER = (
    "The paper: with PD alone figure 4 shows the position errors of trunk, left arm and right arm; with estimation "
    '(figure 5), "as the gravity estimated, the position error reduces in 7-12s. In the following, when the robot '
    "approaches to the desired position, it makes some error however it can be reduced by estimating the gravity force "
    'for long time more than this trial." It states no numbers.'
)


def write_results(folder: Path, errors: dict[Case, Floats], summaries: Sequence[Summary]) -> None:
    """Print the tables, and write dual_arm.json and dual_arm.html."""
    blocks: list[Block] = [Text(PAPER)]
    for payload, title in ((False, "The paper's task"), (True, "With 2 kg taken up at 21 s, unknown")):
        chosen = [s for s in summaries if s.case.payload is payload]
        if not chosen:
            continue
        blocks += [*shown(title, table(chosen)), Text(verdict(chosen))]
        print("\n" + verdict(chosen))
        blocks += [errors_picture(s.case, errors[s.case]) for s in chosen]
    write_files(
        folder,
        "dual_arm",
        "Learning the gravity of 19 joints",
        "Trunk and two arms in MuJoCo on the timeline of the gravity-regressor paper, 1 kHz.",
        blocks,
        content(summaries),
    )


def table(summaries: Sequence[Summary]) -> Table:
    """Return RMS errors per window and case: of each limb in deg, and the worst limb's share of PD alone's."""
    rows = []
    for window in WINDOWS:
        for summary in summaries:
            values = " ".join(f"{v:.3f}" for v in summary.rms[window].values())
            worst = max(summary.ratio[window].values())
            rows.append([window, summary.case.label, values, f"{100.0 * worst:.1f} %"])
    return Table(
        ["window", "controller", "RMS error: trunk, left, right [deg]", "of PD alone, worst limb"], rows
    )


def verdict(summaries: Sequence[Summary]) -> str:
    """Say which controllers brought the error of every limb to a tenth of PD alone's."""
    words = [
        f"{s.case.label}: {'reached' if s.reached else 'not reached'}"
        for s in summaries
        if s.reached is not None
    ]
    what = (
        "in the second that begins 5 s after the load was taken up"
        if summaries[0].case.payload
        else "from 12 s on"
    )
    return f"A tenth of PD alone in trunk and both arms, {what}: " + "; ".join(words) + "."


def content(summaries: Sequence[Summary]) -> dict[str, object]:
    """Return the content of dual_arm.json beside the version."""
    return {
        "windows_s": WINDOWS,
        "cases": [
            {
                "controller": s.case.controller,
                "start": s.case.start,
                "payload_kg": 2.0 if s.case.payload else 0.0,
                "rms_deg": s.rms,
                "of_pd_alone": s.ratio,
                "a_tenth_reached": s.reached,
            }
            for s in summaries
        ],
    }


def errors_picture(case: Case, errors: Floats) -> Picture:
    """Draw the error of each joint over time, one panel each for trunk, left arm and right arm."""
    figure, three = panels(3, 3.0)
    time = 1e-3 * np.arange(len(errors))
    for axes, (limb, joints) in zip(three, LIMBS.items(), strict=True):
        for joint in range(joints.start, joints.stop):
            values = np.rad2deg(errors[::DRAWN_EVERY, joint])
            axes.plot(time[::DRAWN_EVERY], values, linewidth=0.9, label=f"{joint - joints.start + 1}")
        axes.axvspan(TIMELINE[0].end, TIMELINE[1].begin, color="#e8edf3")
        if case.payload:
            axes.axvline(PICK_UP, color="#1c2430", linewidth=0.8, linestyle=":")
        axes.set_title(limb, fontsize=10)
        axes.set_xlabel("time [s]")
        axes.legend(frameon=False, fontsize=7, ncols=2)
    figure.axes[0].set_ylabel("error [deg]")
    caption = f"{case.label}: error of each joint; shaded: estimation, 7 to 12 s."
    return picture(figure, caption)
