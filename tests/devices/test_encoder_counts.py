import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_array_equal

from catenary.devices.encoder_board import _CONFIRMING_ROWS, CountTracker, EncoderRig, Verdict, parse_counts
from catenary.errors import InputError

COUNT = st.integers(-(2**31), 2**31 - 1)


def wrapped(value, bits):
    """What a counter of so many bits holds."""
    cut = int(value) % 2**bits
    return cut - 2**bits if cut >= 2 ** (bits - 1) else cut


def followed(rows, *, bits=32, period=0.01, **options):
    tracker = CountTracker(EncoderRig(bits=bits, **options))
    return [tracker.update(tuple(map(int, row)), period * k, period=period) for k, row in enumerate(rows)]


@given(a=COUNT, b=COUNT, c=COUNT)
def test_three_signed_counts_are_read(a, b, c):
    assert parse_counts(f"{a}_{b}_{c}") == (a, b, c)


@pytest.mark.parametrize(
    "line",
    ["", "1_2", "1_2_3_4", "1__3", "1_2_x", "1_2_3 4", "1_2_--3", "+1_2_3", "1.0_2_3", "_1_2_3", "1_2_99999999999",
     "1_2_٣", "4294967295_0_0"],
)  # fmt: skip
def test_what_is_not_three_signed_counts_is_refused(line):
    with pytest.raises(InputError):
        parse_counts(line)


def test_counts_beyond_the_boards_bits_are_refused():
    with pytest.raises(InputError, match="expected counts of 16 bits, -32768 to 32767"):
        parse_counts("32768_0_0", 16)


@pytest.mark.parametrize("bits", [16, 24, 32])
def test_counters_are_followed_over_their_ends_both_ways(bits):
    end = 2 ** (bits - 1)
    true = np.linspace(-600.0, 600.0, 100).round()[:, None] * [1.0, -1.0, 1.0] + end
    there_and_back = np.vstack([true, true[::-1]])
    rows = [[wrapped(v, bits) for v in row] for row in there_and_back]
    seen = followed(rows, bits=bits)
    assert all(one.verdict is Verdict.GOOD for one in seen)
    travelled = np.array([one.counts for one in seen]) - seen[0].counts
    assert_array_equal(travelled, there_and_back - there_and_back[0])


def test_an_encoder_that_counts_against_its_joint_is_turned_round():
    seen = followed([[0, 0, 0], [5, 7, 9]], direction=np.array([-1.0, 1.0, -1.0]))
    assert_array_equal(seen[1].counts, [-5, 7, -9])


@pytest.mark.parametrize(
    ("at", "named"),
    [
        ((40_000, 200, 300), "move: shoulder by +39900 counts"),
        ((100, -40_000, 300), "move: elbow by -40200 counts"),
        ((100, 200, 80_000), "move: insertion by +79700 counts"),
    ],
)
def test_a_single_row_that_no_joint_reaches_is_left_out_and_its_joint_named(at, named):
    seen = followed([[100, 200, 300]] * 5 + [at] + [[101, 201, 301]] * 5)
    assert [one.verdict for one in seen].count(Verdict.REJECTED) == 1
    assert seen[5].verdict is Verdict.REJECTED
    assert seen[5].reason.endswith(named)
    assert_array_equal(seen[5].counts, [100, 200, 300])
    assert_array_equal(seen[-1].counts, [101, 201, 301])


@pytest.mark.parametrize("leap", [2500, 3000, 4000, 40_000])
def test_counts_that_leap_and_stay_there_are_lost(leap):
    seen = followed([[0, 0, 0]] * 5 + [[leap, 0, 0]] * 10)
    verdicts = [one.verdict for one in seen]
    assert verdicts[5 : 5 + _CONFIRMING_ROWS - 1] == [Verdict.REJECTED] * (_CONFIRMING_ROWS - 1)
    assert verdicts.count(Verdict.LOST) == 1
    assert verdicts[-1] is Verdict.GOOD
    assert_array_equal(seen[-1].counts, [leap, 0, 0])


def test_the_fastest_motion_that_joints_may_make_is_followed():
    rig = EncoderRig()
    rows = np.cumsum(np.tile(0.01 * rig.max_speed * rig.counts, (50, 1)), axis=0)
    assert all(one.verdict is Verdict.GOOD for one in followed(rows))


def test_scattered_noise_loses_nothing():
    rng = np.random.default_rng(0)
    rows = np.cumsum(rng.integers(-50, 51, (2000, 3)), axis=0)
    noisy = rng.random(2000) < 0.2
    noisy[[0, -1]] = False
    sent = np.where(noisy[:, None], rng.integers(-(2**31), 2**31, (2000, 3)), rows)
    seen = followed(sent)
    assert not any(one.verdict is Verdict.LOST for one in seen)
    assert [one.verdict is Verdict.REJECTED for one in seen] == noisy.tolist()
    assert_array_equal(seen[-1].counts, rows[-1])


@pytest.mark.parametrize(
    ("before", "after", "gap", "bits", "loss"),
    [
        ((0, 0, 0), (10, 0, 0), 0.9, 32, None),
        ((0, 0, 0), (10, 0, 0), 1.1, 32, "no counts for 1.1 s"),
        ((6000, 17_000, 76_000), (0, 0, 1), 0.9, 32, "the board restarted"),
        # 0.5 m/s for 0.4 s is 40,000 counts, more than half of 65,536
        ((0, 0, 0), (0, 0, 10), 0.4, 16, "no counts for 0.40 s, too long for 16 bits"),
        ((0, 0, 0), (0, 0, 10), 0.4, 24, None),
    ],
)
def test_counts_are_lost_over_a_gap_in_which_they_may_have_changed_unseen(before, after, gap, bits, loss):
    tracker = CountTracker(EncoderRig(bits=bits))
    tracker.update(before, 0.0)
    found = tracker.update(after, gap)
    assert found.verdict is (Verdict.GOOD if loss is None else Verdict.LOST)
    assert (loss or "") in found.reason


def test_a_board_that_was_unplugged_begins_at_any_counts():
    tracker = CountTracker(EncoderRig())
    tracker.update((5, 5, 5), 0.0)
    tracker.restart()
    assert tracker.update((40_005, 5, 5), 0.1) == (Verdict.GOOD, pytest.approx([40_005, 5, 5]), "")
