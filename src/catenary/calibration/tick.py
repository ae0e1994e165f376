"""One tick of a calibration model as one compiled call: features, valid range, prediction, of every group."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from catenary.arrays import Floats
from catenary.calibration.kernels import (
    Integers,
    in_lines,
    inside_at,
    predict_at,
)
from catenary.calibration.layers import lines
from catenary.calibration.model import CalibrationModel, JointGroup
from catenary.errors import InputError
from catenary.kernels.compiled import borrowed, compiled, inlined

# what the first integers of a layout mean; `_AT`: where something begins, in the layout itself or in the memory
(JOINTS, SIGNALS, POSITIONS, PLAYS, FEATURES, HISTORY, DECIMATION, GIVES_POSITION, GROUPS) = range(9)
(GROUPS_AT, ROBOT_JOINTS, ROBOT_AT, RING_AT, FEATURES_AT, TAKEN_AT, WATCHED_AT, WORK_AT) = range(9, 17)
(PREDICTION_AT, NUMBERS_AT) = range(17, 19)
HEADER = 19
SOURCES = ("q", "qd", "tau")  # of a joint state, by number


def fuse(model: CalibrationModel, decimation: int) -> tuple[Integers, Floats]:
    """Give a model as a layout and a memory, so that one compiled function runs every model.

    Layout: a header; the features that are positions; the positions that play states follow; per group its sizes,
    joints, features, watched features and the predictor's layout; last, what `with_robot` adds.
    Memory: where the ring of previous positions is to be written; the play states; the ring; room to work in; then
    what does not change: offset (n,), half-widths of the play states, per group the valid range and the predictor.
    Each part begins with a line. One array costs a call 45 ns less than two.

    Raises:
        InputError: Parts of the model do not fit together.
    """
    features, n = model.features, len(model.joint_names)
    if sorted(j for group in model.groups for j in group.joints) != list(range(n)):
        raise InputError(f"model: expected each of its {n} joints in one group")
    positions = [features.signals.index(name) for name in features.positions]
    played = [features.signals.index(name) for name, _ in features.play]
    tail: list[int] = [*positions, *played]
    header = np.zeros(HEADER, dtype=np.int64)
    header[GROUPS_AT] = HEADER + len(tail)
    numbers = [np.asarray(model.offset, dtype=float), np.array([width for _, width in features.play])]
    work = 1
    for group in model.groups:
        integers, floats, size = _fuse_group(group, len(features.names))
        tail += integers
        numbers += floats
        work = max(work, size)
    header[JOINTS], header[SIGNALS], header[FEATURES] = n, len(features.signals), len(features.names)
    header[POSITIONS], header[PLAYS], header[GROUPS] = len(positions), len(played), len(model.groups)
    header[HISTORY], header[DECIMATION] = features.history, decimation
    header[GIVES_POSITION] = model.target == "position"
    at = lines(1 + len(played))  # before it: where the ring is to be written, the play states
    for place, size in (
        (RING_AT, features.history * decimation * len(positions)),
        (FEATURES_AT, len(features.names)),
        (TAKEN_AT, len(features.names)),
        (WATCHED_AT, len(features.names)),
        (WORK_AT, work),
        (PREDICTION_AT, n),
        (NUMBERS_AT, 0),
    ):
        header[place] = at
        at += lines(size)
    layout = np.concatenate([header, np.array(tail, dtype=np.int64)])
    memory = in_lines([np.zeros(at), *numbers])
    clear(layout, memory)
    # of no robot yet: no joint state has -1 joints
    return with_robot(layout, range(n), [], -1), memory


def _fuse_group(group: JointGroup, width: int) -> tuple[list[int], list[Floats], int]:
    """Give the integers, the numbers and the working memory of a group."""
    joints = ", ".join(map(str, group.joints))
    predictor, valid = group.predictor.pack(), group.valid_range.pack()
    inputs, outputs = int(predictor.layout[1]), int(predictor.layout[2])
    watched, axes = group.valid_range.axes.shape
    if inputs not in (0, len(group.columns)) or outputs != len(group.joints) or watched != len(group.watched):
        raise InputError(
            f"model: joints {joints} take {len(group.columns)} features, {len(group.watched)} of them watched; "
            f"the predictor takes {inputs} and gives {outputs}, the valid range is of {watched}"
        )
    for columns in (group.columns, group.watched):
        if len(columns) and not (0 <= columns.min() and columns.max() < width):
            raise InputError(f"model: joints {joints} take features beyond the {width} that there are")
    if not np.isfinite(predictor.numbers).all():
        raise InputError(f"model: the predictor of joints {joints} holds NaN or infinity")
    sizes = [len(group.joints), len(group.columns), watched, axes]
    sizes += [len(valid), len(predictor.numbers), len(predictor.layout)]
    integers = [*sizes, *group.joints, *group.columns, *group.watched, *predictor.layout]
    return (
        [int(i) for i in integers],
        [valid, predictor.numbers],
        max(lines(watched) + lines(axes), int(predictor.layout[3])),
    )


def with_robot(
    layout: Integers, joints: Sequence[int], signals: Sequence[tuple[int, int]], robot_joints: int
) -> Integers:
    """Say which of a robot's joints are the model's, and where in its joint state each signal is.

    Args:
        layout: Of the model.
        joints: (n,) index of each of the model's joints among the robot's.
        signals: (S,) index into SOURCES and among the robot's joints, of each signal.
        robot_joints: How many joints the robot has.
    """
    if layout[ROBOT_AT]:
        layout = layout[: layout[ROBOT_AT]]
    flat = [int(i) for pair in signals for i in pair]
    bound = np.concatenate([layout, np.array([*joints, *flat], dtype=np.int64)])
    bound[ROBOT_AT], bound[ROBOT_JOINTS] = len(layout), robot_joints
    return bound


def clear(layout: Integers, memory: Floats) -> None:
    """Forget all previous ticks: no previous position, play states to be centred on the next one."""
    memory[0] = 0.0
    memory[1 : layout[FEATURES_AT]] = np.nan


@compiled
def tick(
    layout: Integers,
    memory: Floats,
    q: Floats,
    signals: Floats,
    out: Floats,
    inside: NDArray[np.bool_],
) -> bool:
    """Write calibrated positions (n,) and whether each is inside the valid range; false for wrong sizes."""
    n = layout[JOINTS]
    if len(q) != n or len(signals) != layout[SIGNALS] or len(out) != n or len(inside) != n:
        return False
    at = layout[FEATURES_AT]  # the first features are the signals
    for i in range(len(signals)):
        memory[at + i] = signals[i]
    _tick(layout, memory, q, out, inside)
    return True


@compiled
def tick_rows(
    layout: Integers,
    memory: Floats,
    q: Floats,
    signals: Floats,
    out: Floats,
    inside: NDArray[np.bool_],
) -> None:
    """Run `tick` on every row."""
    layout, memory, q, signals = borrowed(layout), borrowed(memory), borrowed(q), borrowed(signals)
    out, inside = borrowed(out), borrowed(inside)
    for k in range(len(q)):
        tick(layout, memory, q[k], signals[k], out[k], inside[k])


@compiled
def tick_state(
    layout: Integers,
    memory: Floats,
    q: Floats,
    qd: Floats,
    tau: Floats,
    out: Floats,
    inside: NDArray[np.bool_],
) -> bool:
    """Run a tick on a robot's joint state; joints that the model does not have pass through. See `tick`."""
    n, size = layout[JOINTS], layout[ROBOT_JOINTS]
    if len(q) != size or len(qd) != size or len(tau) != size or len(out) != size or len(inside) != size:
        return False
    at, pairs = layout[FEATURES_AT], layout[ROBOT_AT] + n
    for i in range(layout[SIGNALS]):
        source, joint = layout[pairs + 2 * i], layout[pairs + 2 * i + 1]
        memory[at + i] = q[joint] if source == 0 else (qd[joint] if source == 1 else tau[joint])
    for j in range(size):
        out[j] = q[j]
        inside[j] = True
    _tick(layout, memory, out, out, inside)
    return True


@inlined
def _tick(layout: Integers, memory: Floats, q: Floats, out: Floats, inside: NDArray[np.bool_]) -> None:
    # every slice costs a call some 5 ns: none but those that kernels take
    offset, x_at = layout[NUMBERS_AT], layout[FEATURES_AT]
    widths = offset + lines(layout[JOINTS])
    _add_memory(layout, widths, memory)
    taken, near, work, prediction = (
        layout[TAKEN_AT],
        layout[WATCHED_AT],
        layout[WORK_AT],
        layout[PREDICTION_AT],
    )
    at, number = layout[GROUPS_AT], widths + lines(layout[PLAYS])
    for _ in range(layout[GROUPS]):
        joints, count, watched, axes = layout[at], layout[at + 1], layout[at + 2], layout[at + 3]
        predictor, joint_at = number + layout[at + 4], at + 7
        following, integers = predictor + layout[at + 5], layout[at + 6]
        at = joint_at + joints
        ok = True
        for i in range(count):
            value = memory[x_at + layout[at + i]]
            memory[taken + i] = value
            ok &= np.isfinite(value)
        at += count
        for i in range(watched):
            memory[near + i] = memory[x_at + layout[at + i]]
        at += watched
        if ok:
            ok = inside_at(memory, near, watched, axes, memory, number, memory, work)
        if ok:
            predict_at(layout, at, memory, taken, memory, predictor, memory, work, memory, prediction)
        at, number = at + integers, following
        for j in range(joints):
            joint = layout[joint_at + j]
            place = layout[layout[ROBOT_AT] + joint]
            here = q[place]
            known = ok and np.isfinite(here)
            correction = memory[offset + joint]  # the fixed offset
            if known:
                predicted = memory[prediction + j]
                correction = predicted - here if layout[GIVES_POSITION] else predicted
            out[place] = here + correction
            inside[place] = known


@inlined
def _add_memory(layout: Integers, widths: int, memory: Floats) -> None:
    """Write the features after the signals, in the order of FeatureSet, and remember the positions for later ticks.

    A signal that is NaN leaves its play states as they are, and is NaN among the previous positions.
    """
    x, positions = layout[FEATURES_AT], layout[POSITIONS]
    at = x + layout[SIGNALS]
    ticks = layout[HISTORY] * layout[DECIMATION]
    if ticks > 0:
        ring, now = layout[RING_AT], int(memory[0])
        for k in range(1, layout[HISTORY] + 1):
            earlier = now - k * layout[DECIMATION]
            if earlier < 0:
                earlier += ticks
            for i in range(positions):
                memory[at] = memory[ring + earlier * positions + i]
                at += 1
        for i in range(positions):
            memory[ring + now * positions + i] = memory[x + layout[HEADER + i]]
        memory[0] = now + 1 if now + 1 < ticks else 0
    for i in range(layout[PLAYS]):
        value, width, state = memory[x + layout[HEADER + positions + i]], memory[widths + i], memory[1 + i]
        if np.isfinite(value):
            if np.isnan(state):
                state = value
            state = min(max(state, value - width), value + width)
            memory[1 + i] = state
        memory[at + i] = state - value
