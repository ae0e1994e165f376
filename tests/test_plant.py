from dataclasses import replace
from itertools import permutations, product
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from catenary.errors import DataError, InputError
from catenary.plant import Joints, MotionLog, joint_indices
from catenary.verdict.check import repeated_findings, require_apart
from recordings import recording

LOG = recording(np.random.default_rng(0), rows=6)


def changed(key: str, row: int, value: float) -> np.ndarray:
    values = getattr(LOG, key).copy()
    values[row] = value
    return values


def test_arrays_of_a_log_are_read_only_copies() -> None:
    q = LOG.q_nominal.copy()
    log = replace(LOG, q_nominal=q, signals={"current": np.zeros(6)})
    q[0] = 99.0
    assert log.q_nominal[0, 0] != 99.0
    for values in (log.q_nominal, log.q_encoder, log.time, log.ok, log.signals["current"]):
        assert not values.flags.writeable


INFINITE = product(("q_nominal", "time"), (np.nan, np.inf, -np.inf))


@pytest.mark.parametrize(("key", "value"), [*INFINITE, ("tau", np.nan), ("qd", np.nan)])
def test_non_finite_value_is_refused_with_its_row(key: str, value: float) -> None:
    given = changed("time" if key == "time" else "q_nominal", 4, value)
    with pytest.raises(InputError, match=rf'"run": {key} is -?(nan|inf) at row 4'):
        replace(LOG, **{key: given})


def test_nan_measurement_is_fine_where_ok_is_not_set() -> None:
    log = replace(LOG, q_encoder=changed("q_encoder", 1, np.nan), ok=changed("ok", 1, False))
    assert np.isnan(log.q_encoder[1]).all()


def test_nan_measurement_where_ok_is_set_is_refused_with_joint_and_row() -> None:
    q = LOG.q_encoder.copy()
    q[3, 1] = np.nan
    with pytest.raises(InputError, match="joint J2 is nan at row 3, where ok is set"):
        replace(LOG, q_encoder=q)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        *(({key: np.zeros((6, 2))}, rf"{key}: expected shape \(6, 3\), got \(6, 2\)") for key in ("q_encoder", "tau", "qd")),
        *(({key: getattr(LOG, key)[:5]}, rf"{key}: expected shape \(6,\), got \(5,\)") for key in ("time", "ok")),
        ({"signals": {"current": np.zeros(7)}}, r'signal "current": expected shape \(6,\), got \(7,\)'),
        ({"ok": np.ones(6, dtype=int)}, "ok: expected true or false"),
        ({"ok": np.ones(6, dtype=float)}, "ok: expected true or false"),
        ({"joint_names": ("J1", "J1", "J3")}, "joint names must differ"),
        ({"q_nominal": np.zeros((0, 3))}, '"run": is empty'),
        ({"joint_names": (), "joint_units": (), "q_nominal": np.zeros((6, 0))}, '"run": has no joints'),
    ],
)  # fmt: skip
def test_what_is_no_recording_is_refused_by_name(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        replace(LOG, **changes)


def test_a_measurement_that_means_missing_clears_ok_and_is_counted_once() -> None:
    measured = LOG.q_encoder.copy()  # type: ignore[union-attr]
    measured[[1, 3], [0, 2]] = -9999.0, -3.697314e28
    log = replace(replace(LOG, q_encoder=measured, ok=np.ones(6, dtype=bool)), name="again")
    assert np.flatnonzero(~log.ok).tolist() == [1, 3]
    assert [note for note in log.notes if "mean no measurement" in note] == [
        "q_encoder: 2 rows hold numbers that mean no measurement, and are not ok"
    ]


@pytest.mark.parametrize("units", [("rad", "rad"), ("rad", "rad", "deg"), ("rad", "rad", "mm")])
def test_units_that_are_not_rad_or_m_for_each_joint_are_refused(units: tuple[str, ...]) -> None:
    with pytest.raises(InputError, match="expected 3 units, each rad or m, for joints J1, J2, J3"):
        replace(LOG, joint_units=units)


def test_recordings_begin_where_the_clock_goes_back() -> None:
    assert replace(LOG, time=np.array([0.0, 1.0, 1.0, 0.5, 0.6, 0.0])).starts == (0, 3, 5)
    assert replace(LOG, time=None).starts == (0,)


NAMED = replace(LOG, joint_names=("a", "b", "c"))


def test_joints_are_found_by_their_names_among_further_ones() -> None:
    had = Joints(("x", "c", "a", "b"), ("rad", "m", "rad", "rad"))
    assert joint_indices(NAMED, had, whose="the robot", of="the log has").tolist() == [2, 3, 1]


@pytest.mark.parametrize(
    ("had", "words"),
    [
        (Joints(("a", "b"), ("rad", "rad")), r'the robot has no joint "c"; it has a \[rad\], b \[rad\], the log has a \[rad\]'),
        (Joints(("a", "b", "c"), ("rad", "rad", "rad")), 'has joint "c" in rad, not m; it has'),
        (Joints(("left/a", "b", "c"), ("rad", "rad", "m")), 'no joint "a".*is "left/a" meant'),
        (Joints(("J1", "J2", "J3"), ("rad", "rad", "m")), 'no joint "a"'),  # a robot may be called so
    ],
)  # fmt: skip
def test_joints_that_are_not_there_are_refused_with_both_sides(had: Joints, words: str) -> None:
    with pytest.raises(InputError, match=words):
        joint_indices(NAMED, had, whose="the robot", of="the log has")


@pytest.mark.parametrize("order", list(permutations(range(3))))
def test_a_log_in_another_order_is_the_same_log(order: tuple[int, ...]) -> None:
    turned = replace(
        NAMED, joint_names=tuple(NAMED.joint_names[j] for j in order),
        joint_units=tuple(NAMED.joint_units[j] for j in order), q_nominal=NAMED.q_nominal[:, order],
        q_encoder=NAMED.q_encoder[:, order],
    )  # fmt: skip
    back = turned.in_order_of(NAMED, of="expected are")
    assert (back.joint_names, back.joint_units) == (NAMED.joint_names, NAMED.joint_units)
    assert_array_equal(back.q_nominal, NAMED.q_nominal)
    assert_array_equal(back.q_encoder, NAMED.q_encoder)
    assert bool(back.notes) == (order != (0, 1, 2))


def test_joints_without_names_are_taken_in_order_with_a_note_and_in_their_units() -> None:
    taken = LOG.in_order_of(NAMED, of="expected are")
    assert (taken.joint_names, taken.notes) == (
        NAMED.joint_names, ("joints J1, J2, J3 were taken without names, in order as a, b, c",),
    )  # fmt: skip
    with pytest.raises(InputError, match='has joint "a" in rad, not m'):
        LOG.in_order_of(Joints(("a", "b", "c"), ("m", "rad", "rad")), of="expected are")
    part = replace(LOG, joint_names=("J2", "J1", "J3"), q_nominal=LOG.q_nominal[:, [1, 0, 2]])
    assert_array_equal(part.in_order_of(LOG, of="expected are").q_nominal, LOG.q_nominal)


@pytest.mark.parametrize(("names", "hint"), [(("c", "a"), "--joints c,a$"), (("J1", "J2"), "--joints NAME,")])
def test_a_log_of_some_of_a_robots_joints_is_told_how_they_are_named(names: tuple[str, ...], hint: str) -> None:
    some = MotionLog("some", names, ("rad", "rad"), LOG.q_nominal[:, :2], LOG.ok)
    with pytest.raises(InputError, match=f'recording "some" has joints .*; robot "arm" has a .*{hint}'):
        some.of_robot(NAMED, "arm")


def test_a_part_of_a_log_has_its_rows_of_every_array() -> None:
    rows = np.arange(6.0)
    log = MotionLog(
        "run",
        ("J1",),
        ("rad",),
        rows[:, None],
        rows > 1.0,
        q_encoder=rows[:, None] + 1.0,
        time=rows,
        signals={"I": rows},
    )
    part = log.part(2, 5)
    for values in (part.q_nominal[:, 0], part.time, part.signals["I"], np.asarray(part.q_encoder)[:, 0] - 1.0):
        assert np.array_equal(values, [2.0, 3.0, 4.0])
    assert part.ok.all()
    with pytest.raises(InputError, match="has rows 0 to 6, got 5:5"):
        log.part(5, 5)


def test_minutes_of_a_recording_are_known_again_in_single_precision_and_others_on_the_same_way_are_not() -> None:
    log = recording(np.random.default_rng(0), rows=3000)
    known = [{"sha256": None, "marks": log.marks}]
    short = log.part(1200, 1500)
    assert short.is_among(known)
    assert replace(short, q_encoder=short.q_encoder.astype(np.float32).astype(float), time=None).is_among(known)
    step = 0.02  # coarser than the noise: many rows of the same way are alike by chance
    days = [
        replace(log, q_encoder=np.round((log.q_nominal + noise) / step) * step)
        for noise in 0.01 * np.random.default_rng(1).normal(size=(2, *log.q_nominal.shape))
    ]
    alike = (days[0].q_encoder == days[1].q_encoder).all(axis=1)
    assert 0.02 < alike.mean() < 0.5
    assert not days[1].is_among([{"sha256": None, "marks": days[0].marks}])
    assert not log.is_among([])


@pytest.mark.parametrize("rate", [17.0, 61.0])
def test_minutes_are_known_again_at_another_rate_by_a_calendars_clock_and_where_the_arm_was(rate: float) -> None:
    log = replace(recording(np.random.default_rng(0), rows=3000), began=1.7e9)
    assert log.time is not None
    time = np.arange(log.time[400] + 0.003, log.time[1500], 1.0 / rate)
    q = np.column_stack([np.interp(time, log.time, column) for column in log.q_nominal.T])
    ok = np.ones(len(time), dtype=bool)
    again = MotionLog("again", log.joint_names, log.joint_units, q, ok, q + 0.01, time - 5.0, began=log.began + 5.0)
    assert again.is_among([log.identity])
    assert not replace(again, began=0.0).is_among([log.identity])  # a clock of its own tells nothing
    assert not replace(again, began=again.began + 7.0).is_among([log.identity])  # another motion then
    other_arm = replace(again, q_nominal=np.roll(q, 1, axis=1))
    assert not other_arm.is_among([log.identity])
    assert [each.says for _, each in repeated_findings([log, again])] == [
        f'its minutes are those of "{log.name}": it is no independent test'
    ]
    with pytest.raises(DataError, match="read at another rate"):
        require_apart([log], [again])
