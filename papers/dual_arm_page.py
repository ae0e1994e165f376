"""The 19-joint experiment's tables, its pictures in the manner of the paper's figures 4 and 5, and its page."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from catenary import __version__
from catenary.arrays import Floats
from catenary.files import json_text
from catenary.reports.page import Block, Heading, Picture, Table, Text, picture, write_page
from papers.dual_arm import LIMBS, PICK_UP, TIMELINE, WINDOWS, Case, Summary

DRAWN_EVERY = 20  # ticks
PAPER = (
    "The paper: with PD alone figure 4 shows the position errors of trunk, left arm and right arm; with estimation "
    '(figure 5), "as the gravity estimated, the position error reduces in 7-12s. In the following, when the robot '
    "approaches to the desired position, it makes some error however it can be reduced by estimating the gravity force "
    'for long time more than this trial." It states no numbers.'
)


def write_results(folder: Path, errors: dict[Case, Floats], summaries: Sequence[Summary]) -> None:
    """Print the tables, and write dual_arm.json and dual_arm.html."""
    folder.mkdir(parents=True, exist_ok=True)
    blocks: list[Block] = [Text(PAPER)]
    for payload, title in ((False, "The paper's task"), (True, "With 2 kg taken up at 21 s, unknown")):
        chosen = [s for s in summaries if s.case.payload is payload]
        if not chosen:
            continue
        shown = table(chosen)
        print(f"\n{title}\n\n| " + " | ".join(shown.header) + " |\n|" + "---|" * len(shown.header))
        for row in shown.rows:
            print("| " + " | ".join(row) + " |")
        blocks += [Heading(title), shown, Text(verdict(chosen))]
        print("\n" + verdict(chosen))
        blocks += [errors_picture(s.case, errors[s.case]) for s in chosen]
    (folder / "dual_arm.json").write_text(json_text(content(summaries)), encoding="utf-8")
    write_page(
        folder / "dual_arm.html",
        "Learning the gravity of 19 joints",
        "Trunk and two arms in MuJoCo on the timeline of the gravity-regressor paper, 1 kHz.",
        blocks,
        simulated=True,
    )


def table(summaries: Sequence[Summary]) -> Table:
    """RMS error per window and case: trunk, left arm, right arm in deg, and the worst limb's part of PD alone's."""
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
    """Who brought the error of every limb to a tenth of PD alone's."""
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
    """What dual_arm.json holds."""
    return {
        "simulated": True,
        "version": __version__,
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
    """Errors of each joint over time, one panel for trunk, left arm and right arm."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 3.0), layout="constrained")
    time = 1e-3 * np.arange(len(errors))
    for axes, (limb, joints) in zip(figure.subplots(1, 3), LIMBS.items(), strict=True):
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
