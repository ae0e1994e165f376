"""Calibration report (HTML): verdict in one sentence, errors of joints and tip, intervals, the model's card."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from catenary.arrays import Floats
from catenary.calibration.card import clock_delay
from catenary.calibration.conformal import coverage_verdicts
from catenary.calibration.evaluate import HARM_RATIO, OUTSIDE_SHARE, Evaluation, Spread, rms, spread_table
from catenary.calibration.model import CalibrationModel, Card
from catenary.dynamics.kinematics import forward_kinematics
from catenary.errors import InputError
from catenary.files import json_text
from catenary.kernels.bind import blocks
from catenary.reports import joint_errors
from catenary.reports.page import Block, Facts, Heading, Listing, Remarks, Text, write_page
from catenary.robots.catalog import load_robot, robot_names
from catenary.robots.model import RobotModel
from catenary.tables import Column, Table

_CLOSE_RATIO = 1.03  # least ratio of the fixed offset's error to the model's for an improvement
_ROUNDING_M = 1e-9  # motion of a tip by rounding


class TipErrors(NamedTuple):
    """Tip positions from measured, reported and corrected joints; (N, 3) in the base frame [m]."""

    robot: RobotModel
    true: Floats  # by measured joints
    reported: Floats
    offset: Floats  # by reported joints after the fixed offset
    corrected: Floats
    moves: tuple[bool, ...]  # per joint of the model: it moves the tip

    def distances(self, tip: Floats) -> Floats:
        """Return distances (N,) [m] of tip positions (N, 3) from the true ones."""
        return np.linalg.norm(tip - self.true, axis=1)


def kinematics_of(name: str | None, model: CalibrationModel) -> RobotModel | None:
    """Return the catalogue's robot of a name if the model's joints determine its tip, None otherwise."""
    if name is None or name not in robot_names():
        return None
    robot = load_robot(name)
    return robot if _places(robot, model.joint_names, model.joint_units) is not None else None


def tip_errors(robot: RobotModel, model: CalibrationModel, evaluation: Evaluation) -> TipErrors:
    """Compute tip positions from measured, reported and corrected joints; others are zero, and must not move it."""
    places = _places(robot, model.joint_names, model.joint_units)
    if places is None:
        raise InputError(
            f'robot "{robot.name}": joints {", ".join(robot.joint_names)}; its tip does not follow from the model\'s '
            f"joints {', '.join(model.joint_names)}"
        )
    measured = evaluation.data.q_nominal + evaluation.raw

    def tip(error: Floats) -> Floats:
        q = np.zeros((len(measured), robot.n))
        q[:, places] = measured - error
        return np.concatenate([forward_kinematics(robot, q[part])[1] for part in blocks(len(q))])

    none = np.zeros_like(evaluation.raw)
    true, reported, offset, corrected = map(
        tip, (none, evaluation.raw, evaluation.after_offset, evaluation.after_model)
    )
    moves = tuple(_moves_tip(robot, [place]) for place in places)
    return TipErrors(robot, true, reported, offset, corrected, moves)


def tip_blocks(tip: TipErrors, name: str, joints: Sequence[str]) -> list[Block]:
    """Return the blocks of a page on the tip's error, by a model of these joints."""
    without = [joint for joint, moves in zip(joints, tip.moves, strict=True) if not moves]
    aside = f" Joints that do not move this frame, and are not in its error: {', '.join(without)}." if without else ""
    rows = []
    for called, tips in (("raw", tip.reported), ("fixed offset", tip.offset), (name, tip.corrected)):
        off = tip.distances(tips)
        rows.append([called, 1e3 * rms(off), 1e3 * np.median(off), 1e3 * off.max()])
    columns: list[Column] = ["joints", ("RMSE [mm]", ":.3f"), ("median [mm]", ":.3f"), ("largest [mm]", ":.3f")]
    return [
        Heading("Error of the tip"),
        Table(columns, rows),
        Text(
            f'Distance between frame "{tip.robot.tip}" of robot {tip.robot.name} by these joints and by the measured '
            "ones, through the robot's kinematics, over the same rows as above. Errors of the kinematics themselves "
            f"are not included.{aside}"
        ),
    ]


def tip_rmse(tip: TipErrors) -> tuple[float, float]:
    """Return the RMS distance by reported and by corrected joints [mm]."""
    return 1e3 * rms(tip.distances(tip.reported)), 1e3 * rms(tip.distances(tip.corrected))


def _places(robot: RobotModel, names: Sequence[str], units: Sequence[str]) -> list[int] | None:
    """Return the robot's coordinates of a model's joints; None if other coordinates move its tip too."""
    n = len(names)
    if set(names) <= set(robot.joint_names):
        places = [robot.joint_names.index(name) for name in names]
        if [robot.joint_units[place] for place in places] != list(units):
            return None
    elif tuple(robot.joint_units[:n]) == tuple(units):
        places = list(range(n))
    else:
        return None
    others = [place for place in range(robot.n) if place not in places]
    return None if _moves_tip(robot, others) else places


def _moves_tip(robot: RobotModel, places: Sequence[int]) -> bool:
    q = np.full((2, robot.n), 0.1)
    q[1, list(places)] = 0.0
    first, second = forward_kinematics(robot, q)[1]
    return bool(np.linalg.norm(first - second) > _ROUNDING_M)


_MAX_NAMED_JOINTS = 6  # in a sentence
_PAPER = (
    "H. Peng, A. Lewis, Y.-H. Su, S. Lin, D.-T. Chiang, W. Jiang, H. Lai, B. Hannaford, "
    '"Efficient data-driven joint-level calibration of cable-driven surgical robots", 2024, arXiv:2408.01604.'
)


def write_calibration_report(
    path: Path,
    model: CalibrationModel,
    card: Card,
    evaluation: Evaluation,
    *,
    tested_on: str,
    spread: Sequence[Spread] = (),
    notes: Sequence[str] = (),
    opening: Sequence[Block] = (),
    further: Sequence[Block] = (),
    name: str | None = None,
    unseen: bool = True,
    robot: RobotModel | None = None,
) -> None:
    """Write the report of a calibration as one self-contained HTML file.

    Args:
        opening: Blocks after those on errors.
        further: Blocks before the model's card.
        name: Name of the model on the page; kind and preset when None.
        unseen: The model was not fitted to the test data.
        robot: Robot for the tip's error; by the card when None.
    """
    name = name if name is not None else short_name(model)
    robot = robot or kinematics_of(card.get("robot") or evaluation.data.robot, model)
    tip = None if robot is None else tip_errors(robot, model, evaluation)
    simulated = bool(card["simulated"]) or any(s.simulated for s in evaluation.data.sources)
    joints = range(len(model.joint_names))
    missing = "Unknown: name a robot whose tip follows from these joints (--robot)."
    of_tip: list[Block] = [Heading("Error of the tip"), Text(missing)]
    if tip is not None:
        of_tip = tip_blocks(tip, name, evaluation.data.joint_names)
    noted: list[Block] = [Heading("Notes on the data"), Remarks(notes)] if notes else []
    crossed: list[Block] = [Heading("Cross-validation"), spread_table(spread, name)] if spread else []
    blocks: list[Block] = [
        Heading("Every joint"),
        *(joint_errors.joint_picture(evaluation, model, j, name=name) for j in joints),
        *joint_errors.error_blocks(evaluation, name),
        *of_tip,
        *joint_errors.coverage_blocks(evaluation),
        *opening,
        *noted,
        Heading(f"RMSE of {name} over time"),
        joint_errors.window_table(evaluation),
        *crossed,
        *further,
        Heading("The model"),
        Facts([("model", model_name(model)), *card_facts(card)]),
        Listing("The whole card", json_text(card)),
        Heading("Literature"),
        Text(_PAPER),
    ]
    title = f"Calibration of {card.get('robot') or 'an arm'}: {name}"
    recorded = evaluation.data.dates[1]
    when = f"recorded until {recorded}" if recorded else "recording without a date"
    lead = f"Tested on {tested_on}: {len(evaluation.data):,} rows, {when}."
    verdict = headline(evaluation, unseen=unseen, spread=spread, tip=tip)
    write_page(path, title, lead, blocks, verdict=verdict, simulated=simulated)


def short_name(model: CalibrationModel) -> str:
    """Return a model's kind and preset as text."""
    return model.kind if model.preset is None else f"{model.kind}, preset {model.preset}"


def model_name(model: CalibrationModel) -> str:
    """Return a model's kind, preset and memory as text."""
    return f"{short_name(model)}, play states" if model.features.play else short_name(model)


def card_facts(card: Card) -> list[tuple[str, str]]:
    """Return the main entries of a card as name and text."""
    hashes = (f"sha256 {s['sha256'][:12]}" if s["sha256"] else "no hash" for s in card["data"])
    data = ", ".join(f"{s['name']} ({s['rows']:,} rows, {sha})" for s, sha in zip(card["data"], hashes, strict=True))
    version = ", ".join(f"{name} {number}" for name, number in card["version"].items())
    seconds, delays = clock_delay(card), ", ".join(card.get("mends", {}).get("delay", ()))
    corrected = f", of which {delays} s was corrected" if delays else ""
    return [
        *((name, card[name]) for name in ("instrument", "tool", "recorded") if card.get(name)),
        *([] if seconds is None else [("delay", f"{seconds:+.3f} s{corrected}")]),
        ("target", f"joint {card['target']}"),
        ("inputs", first_names([entry["name"] for entry in card["inputs"]])),
        ("scaling", card["scaling"]),
        ("fitted to", f"{card['rows']:,} rows of {data}"),
        ("seed", str(card["run"]["seed"])),
        ("version", version),
    ]


def first_names(names: Sequence[str], count: int = 8) -> str:
    """Return the first `count` names of a list, and the number of the others."""
    more = f" and {len(names) - count} more" if len(names) > count else ""
    return ", ".join(names[:count]) + more


class JointGain(NamedTuple):
    """RMS errors of one joint in deg or mm, and the reason against its correction, if any."""

    name: str
    unit: str
    before: float
    after: float
    against: str  # empty if the correction is recommended


def headline(
    evaluation: Evaluation, *, unseen: bool = True, spread: Sequence[Spread] = (), tip: TipErrors | None = None
) -> str:
    """Return the verdict on a correction in one sentence, with the numbers of the tables.

    It is recommended for a joint whose error is at least 3 % below the fixed offset's, with inputs in the trained
    range; for fitted data (not `unseen`) the errors of the cross-validation `spread` are used.
    """
    on_blocks = not unseen and bool(spread)
    if on_blocks:
        gains = [
            JointGain(s.joint, s.unit, s.offset_rmse_mean, s.rmse_mean, _against(s.rmse_mean, s.offset_rmse_mean))
            for s in spread
        ]
        start = "On data that it did not see, the correction brings joints' RMS error after the fixed offset"
    else:
        gains = [
            JointGain(j.name, j.unit, j.raw_rmse, j.rmse, _against(j.rmse, j.offset_rmse, j.outside_valid_range))
            for j in evaluation.joints
        ]
        start = "The" if unseen else "No test, since the model was fitted to this data: the"
        start += " correction brings the RMS error of joints as reported"
    sentence = f"{start} {_numbers(gains)}"
    if not unseen and not on_blocks:
        return f"{sentence}; whether to use it, other data must show."
    if tip is not None and unseen:
        sentence += f", and the tip's from {tip_rmse(tip)[0]:.3f} to {tip_rmse(tip)[1]:.3f} mm"
    verdicts = coverage_verdicts(evaluation) if unseen else ()  # none of a model without intervals either
    narrow = [j.name for j, verdict in zip(evaluation.joints, verdicts, strict=False) if verdict == "too narrow"]
    intervals = f"; its intervals are too narrow for {_listed(narrow)}" if narrow else ""
    return f"{sentence}: {recommendation(gains)}{intervals}."


def _numbers(gains: Sequence[JointGain]) -> str:
    """Return errors before and after as text, for the most improved joints if there are many."""
    best = sorted(gains, key=lambda gain: gain.after / gain.before if gain.before > 0.0 else 1.0)[:_MAX_NAMED_JOINTS]
    texts = [f"from {g.before:.3f} to {g.after:.3f} {g.unit} ({g.name})" for g in gains if g in best]
    more = len(gains) - len(texts)
    return ", ".join(texts) + (f", and those of {more} more below" if more > 0 else "")


def recommendation(gains: Sequence[JointGain]) -> str:
    """Return the joints for which the correction is recommended, and the reasons against the others, as text."""
    good = [gain for gain in gains if not gain.against]
    if len(good) == len(gains):
        return "recommended for every joint" if len(gains) > 1 else "recommended"
    reasons = dict.fromkeys(gain.against for gain in gains if gain.against)
    against = "; ".join(f"{_listed([g.name for g in gains if g.against == reason])}: {reason}" for reason in reasons)
    return f"recommended for {len(good) or 'none'} of {len(gains)} joints ({against})"


def _listed(names: Sequence[str]) -> str:
    if len(names) > _MAX_NAMED_JOINTS:
        return f"{', '.join(names[:_MAX_NAMED_JOINTS])} and {len(names) - _MAX_NAMED_JOINTS} more"
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def _against(after: float, offset: float, outside: float = 0.0) -> str:
    """Return the reason against a correction: an error close to the fixed offset's or above, rows outside its range."""
    if after > HARM_RATIO * offset:
        return "worse than the fixed offset"
    if _CLOSE_RATIO * after > offset:
        return "no better than the fixed offset"
    return f"{outside:.0%} of rows are outside its trained range" if outside > OUTSIDE_SHARE else ""
