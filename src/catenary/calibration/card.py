"""The model card: everything a stranger must know before trusting a calibration."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version

from catenary import __version__
from catenary.calibration.dataset import CalibrationData
from catenary.calibration.evaluate import Evaluation, Spread
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.fit_rows import AXES_EXTRAPOLATION, extrapolation
from catenary.calibration.intervals import FARTHEST
from catenary.calibration.kind_choice import JointChoice
from catenary.calibration.model import REACH, CalibrationModel, Card
from catenary.calibration.neural import BEST, PAPER
from catenary.units import DISPLAY

OF_THE_ARM = ("instrument", "tool", "date")  # that a run states, and no option of the fit
LIBRARIES = ("numpy", "scikit-learn", "numba")
BLOCKS = "contiguous blocks of time, each predicted by a model that did not see it"


def model_card(
    model: CalibrationModel,
    data: CalibrationData,
    options: FitOptions,
    *,
    run: FitRun,
    spread: tuple[Spread, ...],
    held_out: Evaluation | None,
    notes: tuple[str, ...] = (),
    choices: tuple[JointChoice, ...] = (),  # of a model of kind "auto", by which errors each joint's kind was chosen
) -> Card:
    """Describe a fitted model and how it came to be."""
    features, intervals = model.features, model.intervals
    names, ranges = features.names, valid_inputs(model)
    of_joint = [choice.chosen for choice in choices] or [model.kind] * len(model.joint_names)
    kinds = set(of_joint)
    group_of = {j: group for group in model.groups for j in group.joints}
    asked = {key: value for key, value in asdict(run).items() if key not in ("robot", *OF_THE_ARM)}
    # JSON has no infinity: null is no limit
    asked["max_error"] = run.max_error and [e if math.isfinite(e) else None for e in run.max_error]
    asked["accept"] = list(run.accept)
    known = data.X[data.complete]
    mean, spread_of = known.mean(axis=0), known.std(axis=0)
    return {
        "robot": run.robot if run.robot is not None else data.robot,
        "instrument": run.instrument,
        "tool": run.tool,
        "simulated": any(source.simulated for source in data.sources),
        "kind": model.kind,
        "preset": model.preset,
        "joints": [
            {
                "name": name,
                "unit": unit,
                "kind": of_joint[j],
                "inputs": [names[c] for c in group_of[j].columns],
                "widened_by": extrapolation(of_joint[j], features, group_of[j].columns),
                **sizes_of(model, j),
            }
            for j, (name, unit) in enumerate(zip(model.joint_names, model.joint_units, strict=True))
        ],
        "inputs": [
            {
                "name": name,
                "unit": unit,
                "training_mean": float(mean[c]),
                "training_sd": float(spread_of[c]),
                **({"valid": ranges[name]} if name in ranges else {}),
            }
            for c, (name, unit) in enumerate(zip(names, features.feature_units, strict=True))
        ],
        "target": model.target,
        "output": "correction added to q_nominal, in rad and m",
        "scaling": "none"
        if kinds == {"offset"}
        else "inputs standardised by mean and standard deviation of the training rows"
        + "; targets of networks standardised too" * ("neural" in kinds),
        "choice": [asdict(choice) for choice in choices] or None,
        "settings": {
            "kind": options.kind,
            "inputs": dict(options.inputs) if isinstance(options.inputs, Mapping) else options.inputs,
            "play_shares": None if options.play is None else list(options.play),
            "target": options.target,
            "ridge": options.ridge_used,
            **({"network": asdict(PAPER if options.network == "paper" else BEST)} if "neural" in kinds else {}),
        },
        "valid_range": "of each joint: box around its inputs in training and box along their principal axes, "
        "widened by `widened_by` times their range, twice that for midlines and, but for polynomials, "
        f"{AXES_EXTRAPOLATION:g} times along axes; outside it, and where a correction is beyond "
        f"{REACH:g} times `largest_correction`, the fixed offset is used. `valid` of an input: "
        "in the first box of all joints that take it",
        "intervals": None
        if intervals is None
        else {
            "coverage": intervals.level,
            "how": "hierarchical conformal prediction on blocks of time, from the errors of the cross-validation",
            "margin": "half_width where training rows lay, growing to half_width_outside halfway from them to the edge",
            "outside": "half_width_outside, times how many times farther from the middle of the valid range's box a "
            f"watched input is than its edge, at most {FARTHEST:g}",
        },
        "data": [asdict(source) for source in data.sources],
        "mends": {key: list(texts) for key, texts in model.mends.items()},
        "rows": len(data),
        "recorded": data.dates[1] or run.date,
        "run": {"seed": options.seed, **asked},
        "version": {"catenary": __version__, **{name: version(name) for name in LIBRARIES}},
        "errors": {
            "unit": {name: DISPLAY[unit][0] for name, unit in zip(model.joint_names, model.joint_units, strict=True)},
            "cross_validation": {"how": BLOCKS, "joints": [asdict(joint) for joint in spread]} if spread else None,
            "held_out": held_out
            and [  # JSON has no NaN, as of a percentage of nothing
                {key: None if value != value else value for key, value in asdict(j).items()} for j in held_out.joints
            ],
        },
        "notes": list(notes),
    }


def sizes_of(model: CalibrationModel, joint: int) -> dict[str, float | None]:
    """Return a joint's fixed offset, its largest correction, and half-widths of its intervals [rad|m]."""
    widths = model.intervals
    return {
        "fixed_offset": float(model.offset[joint]),
        "largest_correction": float(model.largest[joint]),
        "half_width": None if widths is None else float(widths.inside[joint]),
        "half_width_outside": None if widths is None else float(widths.outside[joint]),
    }


def clock_delay(card: Card) -> float | None:
    """Return the delay of the recordings that a model was fitted to, as they were recorded [s]; None where unknown."""
    left = [each["seconds"] for each in card.get("delays", ()) if each.get("unit") == "s"]
    mended = sum(map(float, card.get("mends", {}).get("delay", ())))
    return mended + sorted(left)[len(left) // 2] if left else mended or None


def valid_inputs(model: CalibrationModel) -> dict[str, dict[str, float]]:
    """Return by input between which values no joint that takes it leaves the box of its valid range."""
    names, ranges = model.features.names, dict[str, dict[str, float]]()
    for group in model.groups:
        edges = group.valid_range
        for column, low, high in zip(group.watched, edges.lower.tolist(), edges.upper.tolist(), strict=True):
            held = ranges.setdefault(names[column], {"lower": low, "upper": high})
            held["lower"], held["upper"] = max(held["lower"], low), min(held["upper"], high)
    return ranges
