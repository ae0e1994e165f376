"""A fitted calibration model: what to add to the reported joint positions, and where it may be trusted."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import Field

from catenary.arrays import Flags, Floats, as_array
from catenary.calibration.features import FeatureSet, Many, Memory
from catenary.calibration.intervals import Intervals, widen
from catenary.calibration.model_kinds import MODEL_KINDS
from catenary.calibration.predictors import AnyPredictor
from catenary.calibration.spike_filter import ANY_SIZE
from catenary.calibration.valid_range import ValidRange, choose
from catenary.cards import StoredFloats, StoredIntegers
from catenary.config import IN_FILES
from catenary.errors import InputError
from catenary.kernels import row_functions as arithmetic
from catenary.kernels.bind import Step, blocks, run
from catenary.plant import MotionLog
from catenary.tables import OnScreen, Screen, Table
from catenary.units import shown_rows
from catenary.verdict.corrections import MEND_KEYS

Target = Literal["error", "position"]
Unit = Annotated[str, Field(pattern="^(rad|m)$")]
Mends = Annotated[Mapping[Annotated[str, Field(pattern=MEND_KEYS)], tuple[str, ...]], Field(max_length=50)]
_FADES_FROM = 0.9  # of the way to the edge of the valid range: the learned model is the fixed offset's at the edge
MAX_CORRECTION_RATIO = 2.0  # times the largest correction that training showed: the largest that is believed
Card = dict[str, Any]  # everything a stranger must know before trusting a model, as JSON holds it


@dataclass(frozen=True)
class JointGroup:
    """Joints that share their inputs, and what was fitted for them."""

    joints: Many[Annotated[int, Field(ge=0, lt=10_000)]]
    columns: StoredIntegers  # features that they take
    predictor: AnyPredictor
    valid_range: ValidRange
    watched: StoredIntegers  # features that the valid range looks at: those that can leave their range

    def __post_init__(self) -> None:
        for name in ("columns", "watched"):
            columns = np.asarray(getattr(self, name))
            if columns.ndim != 1 or (columns.size and columns.dtype.kind not in "iu"):
                raise InputError(f"model: {name}: expected indices of features, got {columns!r}")
            object.__setattr__(self, name, np.ascontiguousarray(columns, dtype=np.int64))
        (inputs, outputs), watched = self.predictor.shape, len(self.valid_range.lower)
        fits = inputs == len(self.columns) and outputs == len(self.joints)
        if not fits or watched != len(self.watched):
            raise InputError(
                f"model: joints {self.joints} take {len(self.columns)} features, {len(self.watched)} of them watched; "
                f"the predictor takes {inputs} and gives {outputs}, the valid range is of {watched}"
            )

    def steps(
        self, X: Floats, known: Flags, prediction: Floats, far: Floats, beyond: Floats, fades_at: float
    ) -> list[Step]:
        """Return steps from features X (N, F) to predictions (N, m), which rows are known (N,), and how far."""
        taken, watched = np.empty((len(X), len(self.columns))), np.empty((len(X), len(self.watched)))
        return [
            Step(arithmetic.take, (X, self.columns), (taken,)),
            Step(arithmetic.finite, (taken,), (known,)),
            Step(arithmetic.take, (X, self.watched), (watched,)),
            *self.valid_range.steps(watched, known, far, to_edges=fades_at > 0.0),
            *(self._farther(taken, far, known, fades_at) if fades_at > 1.0 else ()),
            *self.predictor.steps(taken, prediction, beyond),
        ]

    def _farther(self, taken: Floats, far: Floats, known: Flags, farthest: float) -> list[Step]:
        limits = np.zeros(1), np.full(1, farthest)
        return [Step(arithmetic.finite, (taken,), (known,)), Step(arithmetic.between, (far, *limits), (known,))]


@dataclass(frozen=True, repr=False)
class CalibrationModel(OnScreen):
    """A fitted model: corrections of joint positions from features. There is no unfitted one.

    `correction` is added to q_nominal. A row outside a group's valid range gets the training data's fixed offset, and a
    learned model goes over to it before the edge, so that nothing leaps there; so
    does a joint whose correction was never seen: beyond MAX_CORRECTION_RATIO
    times `largest`, or to `largest` beyond its limits.
    """

    __pydantic_config__ = IN_FILES

    kind: str  # of `MODEL_KINDS`
    preset: str | None
    joint_names: Many[str]
    joint_units: Many[Unit]
    features: FeatureSet
    target: Target  # what the predictors give: the joint error, or the joint position (end to end)
    offset: StoredFloats  # (n,) mean error of the training data [rad|m]
    largest: StoredFloats  # (n,) largest correction that training showed [rad|m]; see `fit.largest_shown`
    groups: Many[JointGroup]
    intervals: Intervals | None = None  # how far off corrections may be; None if that was not estimated
    limits: StoredFloats | None = None  # (2, n) lower and upper joint limits [rad|m]; None if they are not known
    mends: Mends = field(default_factory=dict)  # of its recordings: MotionLog.settled
    # (3, n) of a refresh: factors of predicted errors and of q_nominal, and what is added [rad|m]; 1, 0, 0 when None
    adjustment: StoredFloats | None = None

    def __post_init__(self) -> None:
        n, width = len(self.joint_names), len(self.features.names)
        if len(self.joint_units) != n:
            raise InputError(f"model: expected a unit for each of its {n} joints, got {len(self.joint_units)}")
        if self.target not in get_args(Target):
            raise InputError(f"model: target {self.target!r}: expected {' or '.join(get_args(Target))}")
        if sorted(j for group in self.groups for j in group.joints) != list(range(n)):
            raise InputError(f"model: expected each of its {n} joints in one group")
        for group in self.groups:
            columns = np.concatenate([group.columns, group.watched])
            if len(columns) and not (0 <= columns.min() and columns.max() < width):
                raise InputError(f"model: joints {group.joints} take features beyond the {width} that there are")
        object.__setattr__(self, "offset", as_array("offset", self.offset, (n,)))
        object.__setattr__(self, "largest", as_array("largest", self.largest, (n,)))
        if not (np.abs(self.offset) <= self.largest).all():
            raise InputError(
                f"model: fixed offsets {self.offset.tolist()}: expected none beyond the largest corrections that "
                f"training showed, {self.largest.tolist()}"
            )
        if self.adjustment is not None:
            object.__setattr__(self, "adjustment", as_array("adjustment", self.adjustment, (3, n)))
        if self.limits is not None:
            object.__setattr__(self, "limits", as_array("limits", self.limits, (2, n)))
        if self.intervals is not None and len(self.intervals.inside) != n:
            raise InputError(f"model: expected intervals of its {n} joints, got {len(self.intervals.inside)}")

    @property
    def screen(self) -> Screen:
        """The fixed offset of each joint, its largest correction, and the half-width of its interval."""
        widths = np.full(len(self.joint_names), np.nan) if self.intervals is None else self.intervals.inside
        columns = ("joint", "unit", ("offset", ":.3f"), ("largest correction", ":.3f"), ("half-width", ":.3f"))
        table = Table(columns, shown_rows(self, self.offset, self.largest, widths), "Corrections")
        return Screen(f"{self.kind}: {len(widths)} joints, {len(self.features.names)} features", [table])

    @property
    def adjusted(self) -> Floats:
        """What refreshes changed, (3, n): see `adjustment`."""
        nothing = np.outer([1.0, 0.0, 0.0], np.ones(len(self.joint_names)))
        return nothing if self.adjustment is None else self.adjustment

    @property
    def widening(self) -> Floats | None:
        """How many times larger an error is where joints meet otherwise than in training, (n,); None of other kinds."""
        factors = np.ones(len(self.joint_names))
        for group in self.groups:
            if group.predictor.leverage is None:
                return None
            factors[list(group.joints)] = group.predictor.leverage.widening
        return factors

    @property
    def asked_of_reports(self) -> list[str]:
        """A sentence where what the robot reported in training was mended, but for units, and the model takes it."""
        taken = {"q_nominal", *(signal.partition(":")[0] for signal in self.features.signals)}
        keys = [key for key in self.mends if key.partition(":")[2] in taken and not key.startswith("units")]
        done = [f"--{key.partition(':')[0]} {text}" for key in keys for text in self.mends[key]]
        note = f"the model was trained on recordings corrected by {' '.join(done)}: correct the robot's reports too"
        return [note] if done else []

    def inside(self, X: Floats) -> Flags:
        """Return flags (N, n) of features (N, F) within each joint's valid range; see `correct`."""
        n = len(self.joint_names)
        return replace(self, largest=np.full(n, ANY_SIZE), limits=None).correct(X, np.zeros((len(X), n)))[1]

    def correction(self, X: Floats, q_nominal: Floats) -> Floats:
        """Return the correction of q_nominal (N, n), (N, n) [rad|m]; NaN features count as outside the valid range."""
        return self.correct(X, q_nominal)[0]

    def correct(self, X: Floats, q_nominal: Floats, leaping: Flags | None = None) -> tuple[Floats, Flags, Floats]:
        """Return `correction`, `inside` and `interval` of rows; none leaps without `leaping` (N,)."""
        X = as_array("features", X, (None, len(self.features.names)), finite=False)
        q = as_array("q_nominal", q_nominal, (len(X), len(self.joint_names)), finite=False)
        correction, inside, interval = np.empty_like(q), np.empty(q.shape, dtype=bool), np.empty_like(q)
        leaps = np.zeros(len(X), dtype=bool) if leaping is None else leaping
        for rows in blocks(len(X)):
            outputs = (correction[rows], inside[rows], interval[rows])
            run(self.steps(X[rows], q[rows], *outputs, leaps[rows]))
        return correction, inside, interval

    def steps(
        self,
        X: Floats,  # (N, F) features
        q: Floats,  # (N, n) reported positions [rad|m]; the correction of one that is not finite is the fixed offset
        correction: Floats,  # (N, n) receives what to add [rad|m]
        inside: Flags,  # (N, n) receives whether each comes from a predictor, inside its valid range, and is believed
        interval: Floats | None = None,  # (N, n) receives half-widths [rad|m]; without it they are not computed
        leaping: Flags | None = None,  # (N,) see `correct`
    ) -> list[Step]:
        """Return the compiled steps from features to corrections."""
        n, leaping = len(self.joint_names), np.zeros(len(X), dtype=bool) if leaping is None else leaping
        steps: list[Step] = []
        if interval is not None and self.intervals is None:
            steps = [Step(arithmetic.repeat, (np.full(n, np.nan),), (interval,))]
        lower, upper = np.outer((-ANY_SIZE, ANY_SIZE), np.ones(n)) if self.limits is None else self.limits
        believed = (MAX_CORRECTION_RATIO * self.largest, lower - self.largest, upper + self.largest)
        adjustment = np.vstack([np.full((1, n), float(self.target == "position")), self.adjusted])
        fades_at = MODEL_KINDS[self.kind].fades_at if self.kind in MODEL_KINDS else 0.0
        for group in self.groups:
            joints, leverage = np.array(group.joints, dtype=np.int64), group.predictor.leverage
            known, prediction = np.empty(len(X), dtype=bool), np.empty((len(X), len(joints)))
            far, beyond = np.zeros((len(X), 1)), np.zeros((len(X), 1))
            steps += group.steps(X, known, prediction, far, beyond, fades_at)
            fade = np.array([_FADES_FROM, 1.0]) * (fades_at or ANY_SIZE)
            farthest = np.full(len(joints), ANY_SIZE)
            if leverage is not None and leverage.farthest is not None:
                farthest = leverage.farthest
            inputs = prediction, known, beyond, farthest, q, joints, far, fade, adjustment, self.offset
            steps.append(Step(choose, (*inputs, *believed), (correction, inside)))
            if interval is not None and self.intervals is not None:
                seen, factor = group.valid_range.seen, np.zeros(len(joints)) if leverage is None else leverage.factor
                reach = np.array([_FADES_FROM, 1.0] if fades_at else [seen, 0.5 * (seen + 1.0)])
                widths = (beyond, factor, self.intervals.inside, self.intervals.outside, reach)
                steps.append(Step(widen, (far, leaping, inside, q, joints, *widths), (interval,)))
        return steps

    def tick_steps(
        self,
        memory: Memory,
        q: Floats,  # (N, n) reported positions [rad|m]
        signals: Floats,  # (N, S) values of `features.signals`
        calibrated: Floats,  # (N, n) receives the calibrated positions [rad|m]
        inside: Flags,  # (N, n) receives the flags of `steps`
        interval: Floats | None = None,  # (N, n) receives the half-widths of `steps`
        *,
        rate_hz: float | None = None,  # of the rows; None if it is that of the training rows, or a higher one
    ) -> list[Step]:
        """Return the compiled steps from what a robot reports to calibrated positions, for rows of one motion."""
        period = self.features.period
        slower = 1.0 if rate_hz is None or period is None else max(1.0, 1.0 / (rate_hz * period))
        X, correction = np.empty((len(q), len(self.features.names))), np.empty(q.shape)
        leaping = np.zeros(len(q), dtype=bool)
        return [
            *self.features.row_steps(signals, memory, X, np.full(len(q), slower), leaping),
            *self.steps(X, q, correction, inside, interval, leaping),
            Step(arithmetic.add_rows, (q, correction), (calibrated,)),
        ]

    def calibrate(self, log: MotionLog) -> Floats:
        """Return calibrated joint positions of every row of a recording, (N, n) [rad|m], in the model's order."""
        log = self.matched(log)
        return log.q_nominal + self.correction(self.features.matrix(log), log.q_nominal)

    def half_widths(self, log: MotionLog) -> Floats:
        """Return half-widths of intervals about `calibrate`, (N, n) [rad|m]; NaN if the model has none."""
        log = self.matched(log)
        X, leaping, _ = self.features.rows(log)
        return self.correct(X, log.q_nominal, leaping)[2]

    def matched(self, log: MotionLog) -> MotionLog:
        """Return a recording with the model's joints in the model's order."""
        return log.in_order_of(self, of="the model is for")
