"""The page about a calibration: errors before and after, per joint, and the model's card."""

from collections.abc import Sequence
from pathlib import Path

from catenary.calibration.evaluate import Evaluation, Spread
from catenary.calibration.kind_choice import JointChoice
from catenary.calibration.model import CalibrationModel, Card
from catenary.files import json_text
from catenary.reports.arm_picture import arm_picture
from catenary.reports.error_tables import error_blocks, spread_table, window_blocks
from catenary.reports.headline import headline
from catenary.reports.intervals import coverage_blocks
from catenary.reports.joint_picture import joint_picture, row_breaks
from catenary.reports.page import Block, Facts, Heading, Listing, Remarks, Table, Text, write_page
from catenary.reports.tip import TipErrors, kinematics_of, tip_blocks, tip_errors
from catenary.robots.model import RobotModel

PAPER = (
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
    comparison: tuple[Sequence[str], Sequence[Sequence[str]]] | None = None,
    opening: Sequence[Block] = (),
    further: Sequence[Block] = (),
    name: str | None = None,
    unseen: bool = True,
    robot: RobotModel | None = None,
) -> None:
    """Write the page about a calibration, one self-contained file.

    Args:
        path: The HTML file.
        model: The model.
        card: Its card.
        evaluation: Its errors.
        tested_on: Which data these are, in words.
        spread: Errors of a cross-validation, if there was one.
        notes: What a reader must know about the data.
        comparison: Header and rows of a table of several models, to open the page with.
        opening: What else to open the page with.
        further: What else to say before the model's card.
        name: What title, tables and pictures call the model; its kind and preset when None.
        unseen: Whether the model was not fitted to this data.
        robot: Whose tip is looked at; the catalogue's robot of the card when None, if there is one.
    """
    name = name if name is not None else short_name(model)
    robot = robot or kinematics_of(card.get("robot") or evaluation.data.robot, model)
    tip = None if robot is None else tip_errors(robot, model, evaluation)
    simulated = bool(card["simulated"]) or any(s.simulated for s in evaluation.data.sources)
    blocks: list[Block] = [*opening]
    if comparison is not None:
        blocks += [Heading("Every model"), Table(*comparison)]
    blocks += [
        *error_blocks(evaluation, name),
        *note_blocks(notes),
        *tip_part(tip, evaluation, name),
        *coverage_blocks(evaluation),
    ]
    for j, joint in enumerate(model.joint_names):
        blocks += [Heading(f"Joint {joint}"), joint_picture(evaluation, model, j, name=name)]
    blocks += window_blocks(evaluation, name)
    if spread:
        blocks += [Heading("Cross-validation over blocks of time"), spread_table(spread, name)]
    blocks += [
        *further,
        Heading("The model"),
        Facts([("model", model_name(model)), *card_facts(card)]),
        Listing("The whole card", json_text(card)),
        Heading("Literature"),
        Text(PAPER),
    ]
    title = f"Calibration of {card.get('robot') or 'an arm'}: {name}"
    recorded = evaluation.data.dates[1]
    when = f"recorded until {recorded}" if recorded else "recording without a date"
    lead = f"Tested on {tested_on}: {len(evaluation.data):,} rows, {when}."
    verdict = headline(evaluation, unseen=unseen, spread=spread, tip=tip)
    write_page(path, title, lead, blocks, verdict=verdict, simulated=simulated)


def note_blocks(notes: Sequence[str]) -> list[Block]:
    """Return what a reader must know about the data, under a heading."""
    return [Heading("Notes on the data"), Remarks(notes)] if notes else []


def tip_part(tip: TipErrors | None, evaluation: Evaluation, name: str) -> list[Block]:
    """Return table and picture of the tip; without kinematics how to get them."""
    if tip is not None:
        return [
            *tip_blocks(tip, name, evaluation.data.joint_names),
            arm_picture(tip, name, row_breaks(evaluation)),
        ]
    missing = "Not known: no robot whose kinematics give the tip from these joints was named (--robot)."
    return [Heading("Error of the tip"), Text(missing)]


def short_name(model: CalibrationModel) -> str:
    """Return a model's kind and preset in words."""
    return model.kind if model.preset is None else f"{model.kind}, preset {model.preset}"


def model_name(model: CalibrationModel) -> str:
    """Return a model's kind, preset and memory in words."""
    name = short_name(model)
    if model.features.history:
        name += f", {model.features.history} previous commands"
    if model.features.play:
        name += ", play states"
    return name


def card_facts(card: Card) -> list[tuple[str, str]]:
    """Return the card's main lines."""
    data = ", ".join(f"{s['name']} ({s['rows']:,} rows, {_short(s['sha256'])})" for s in card["data"])
    version = ", ".join(f"{name} {number}" for name, number in card["version"].items())
    return [
        *(("chosen", str(JointChoice(**choice))) for choice in card.get("choice") or ()),
        ("target", f"joint {card['target']}"),
        ("inputs", shortened([entry["name"] for entry in card["inputs"]])),
        ("scaling", card["scaling"]),
        ("fitted to", f"{card['rows']:,} rows of {data}"),
        ("seed", str(card["run"]["seed"])),
        ("version", version),
    ]


def shortened(names: Sequence[str], most: int = 8) -> str:
    """Return the first names of a list, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def _short(digest: str | None) -> str:
    return f"sha256 {digest[:12]}" if digest else "no hash"
