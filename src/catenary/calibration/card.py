"""The model card: everything a stranger must know before trusting a calibration."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from importlib.metadata import version
from typing import Any

from catenary import __version__
from catenary.arrays import Floats
from catenary.bounded_parsers import cut
from catenary.calibration.dataset import CalibrationData
from catenary.calibration.evaluate import Evaluation, Spread
from catenary.calibration.fit_options import FitOptions, FitRun
from catenary.calibration.intervals import MAX_HALF_RANGES
from catenary.calibration.model import MAX_CORRECTION_RATIO, CalibrationModel, Card
from catenary.calibration.model_kinds import ModelKind, kind_of
from catenary.units import DISPLAY

_ARM_KEYS = ("instrument", "tool", "date")  # that a run states, and no option of the fit
_LIBRARIES = ("numpy", "scikit-learn", "numba")
_BLOCKS_TEXT = "contiguous blocks of time, each predicted by a model that did not see it"


def model_card(
    model: CalibrationModel,
    data: CalibrationData,
    options: FitOptions,
    *,
    run: FitRun,
    spread: tuple[Spread, ...],
    held_out: Evaluation | None,
    notes: tuple[str, ...] = (),
) -> Card:
    """Describe a fitted model and how it came to be."""
    kind = kind_of(model.kind, model.preset)
    settings = {key: value for key, value in asdict(run).items() if key not in ("robot", *_ARM_KEYS)}
    # JSON has no infinity: null is no limit
    settings["max_error"] = run.max_error and [e if math.isfinite(e) else None for e in run.max_error]
    settings["accept"] = list(run.accept)
    return {
        "robot": run.robot if run.robot is not None else data.robot,
        "instrument": run.instrument,
        "tool": run.tool,
        "simulated": any(source.simulated for source in data.sources),
        "kind": model.kind,
        "preset": model.preset,
        "joints": _joints(model, kind),
        "inputs": _inputs(model, data.X),
        "target": model.target,
        "output": "correction added to q_nominal, in rad and m",
        "scaling": "none"
        if kind.of_error or options.is_function
        else "inputs standardised by mean and standard deviation of the training rows"
        + "; targets standardised too" * (kind.settings is not None or not kind.in_c),
        "settings": {
            "kind": options.kind,
            "inputs": dict(options.inputs) if isinstance(options.inputs, Mapping) else options.inputs,
            "play_shares": None if options.play is None else list(options.play),
            "target": options.target,
            "ridge": options.ridge_used,
            **({} if options.estimator is None else {"estimator": cut(repr(options.estimator))}),
            **({} if kind.own_settings is None else {"network": asdict(kind.own_settings)}),
        },
        "valid_range": "of each joint: box around its inputs in training and box along their principal axes, widened "
        "by `widened_by` times their range and, but for polynomials, 1 times along axes; outside it, and where a "
        f"correction is beyond {MAX_CORRECTION_RATIO:g} times `largest_correction`, the fixed offset is used. "
        "`valid` of an input: in the first box of all joints that take it",
        "intervals": _intervals(model),
        "data": [asdict(source) for source in data.sources],
        "mends": {key: list(texts) for key, texts in model.mends.items()},
        "rows": len(data),
        "recorded": data.dates[1] or run.date,
        "run": {"seed": options.seed, **settings},
        "version": {"catenary": __version__, **{name: version(name) for name in _LIBRARIES}},
        "errors": {
            "unit": {name: DISPLAY[unit][0] for name, unit in zip(model.joint_names, model.joint_units, strict=True)},
            "cross_validation": {"how": _BLOCKS_TEXT, "joints": [asdict(joint) for joint in spread]}
            if spread
            else None,
            "held_out": held_out
            and [  # JSON has no NaN, as of a percentage of nothing
                {key: None if value != value else value for key, value in asdict(j).items()} for j in held_out.joints
            ],
        },
        "notes": list(notes),
    }


def _joints(model: CalibrationModel, kind: ModelKind) -> list[dict[str, Any]]:
    group_of = {j: group for group in model.groups for j in group.joints}
    return [
        {
            "name": name,
            "unit": unit,
            "kind": kind.name,
            "inputs": [model.features.names[c] for c in group_of[j].columns],
            "widened_by": kind.beyond,
            **sizes_of(model, j),
        }
        for j, (name, unit) in enumerate(zip(model.joint_names, model.joint_units, strict=True))
    ]


def _inputs(model: CalibrationModel, X: Floats) -> list[dict[str, Any]]:
    """Return each feature's unit, its mean and deviation over rows (N, F), and where it is valid."""
    ranges, names = valid_inputs(model), model.features.names
    columns = zip(names, model.features.feature_units, X.mean(axis=0).tolist(), X.std(axis=0).tolist(), strict=True)
    return [
        {"name": name, "unit": unit, "training_mean": mean, "training_sd": deviation}
        | ({"valid": ranges[name]} if name in ranges else {})
        for name, unit, mean, deviation in columns
    ]


def _intervals(model: CalibrationModel) -> dict[str, Any] | None:
    if model.intervals is None:
        return None
    return {
        "coverage": model.intervals.level,
        "how": "hierarchical conformal prediction on blocks of time, from the errors of the cross-validation",
        "margin": "half_width where training rows lay, of regressions growing with the leverage of a row; to "
        "half_width_outside at the edge, of the papers' models halfway from the rows to it",
        "outside": "half_width_outside, times how many times farther from the middle of the valid range's box a "
        f"watched input is than its edge, at most {MAX_HALF_RANGES:g}",
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
    left = [delay["seconds"] for delay in card.get("delays", ()) if delay.get("unit") == "s"]
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
