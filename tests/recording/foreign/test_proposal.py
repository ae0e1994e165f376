"""What a recording suggests is proposed; what it leaves open is asked, never chosen in silence."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catenary.config import parse_settings
from catenary.documents import toml_table
from catenary.errors import ConfigError, InputError
from catenary.recording.foreign.mapping import RecordingMapping, mapping_of
from catenary.workflows.import_recording import Proposal, propose_mapping
from foreign_bags import JOINT_STATE, JOINTS, Message, joint_state, true_q, write_bag

T = np.arange(0.0, 3.0, 0.01)
Q = true_q(T)[:, :2]


def of_table(folder: Path, names: str, *columns: np.ndarray) -> Proposal:
    table = folder / "lab.csv"
    rows = "\n".join(",".join(f"{v:.9f}" for v in row) for row in np.column_stack([T, *columns]))
    table.write_text(f"t,{names}\n{rows}\n")
    return propose_mapping(table)


@pytest.mark.parametrize(
    ("names", "scale", "asked"),
    [
        ("cmd1_deg,cmd2_deg,optitrack1_deg,optitrack2_deg", 1.0, None),
        ("cmd1_rad,cmd2_rad,encoder1,encoder2", 57.2957795, None),  # told by the ranges: degrees
        ("cmd1,cmd2,encoder1,encoder2", 1.0, "the units of q_nominal"),
        ("cmd1_rad,cmd2_rad,encoder1,encoder2", 7.0, "the units of q_encoder"),
        ("q_des1_rad,q_des2_rad,q_act1_rad,q_act2_rad", 1.0, "measured at the joints"),
        ("a1,a2,b1,b2", 1.0, "which is q_nominal"),
        ("shoe,hat,tie,scarf", 1.0, "which columns are q_nominal"),
    ],
)
def test_what_is_open_is_asked_and_nothing_is_accepted_then(
    names: str, scale: float, asked: str | None, tmp_path: Path
) -> None:
    proposal = of_table(tmp_path, names, *Q.T, *(scale * (Q + 0.01)).T)
    if asked is None:
        assert proposal.questions == ()
        assert proposal.accepted().q_encoder is not None
        return
    assert any(asked in question for question in proposal.questions)
    assert "OPEN" in proposal.toml
    with pytest.raises(InputError, match="leaves open"):
        proposal.accepted()


def test_units_follow_from_ranges_beside_each_other(tmp_path: Path) -> None:
    proposal = of_table(tmp_path, "cmd1_rad,cmd2_rad,encoder1,encoder2", *Q.T, *np.rad2deg(Q).T)
    mapping = proposal.accepted()
    assert mapping.q_encoder is not None
    assert mapping.q_encoder.units == ("deg", "deg")


def test_columns_that_never_change_and_currents_are_set_aside_and_said(tmp_path: Path) -> None:
    still = np.ones((len(T), 2))
    proposal = of_table(tmp_path, "q1_rad,q2_rad,enc1_rad,enc2_rad,current1,current2", *Q.T, *still.T, *Q.T)
    assert any("never changes" in said for said in proposal.decisions)
    assert any("needs a scale" in said for said in proposal.decisions)
    assert proposal.accepted().q_encoder is None


def test_two_topics_that_may_both_be_the_encoder_are_asked(tmp_path: Path) -> None:
    topics = ("/arm/joint_states", "/vicon/joints", "/camera/joints")
    messages: list[Message] = [(t, topic, joint_state(JOINTS, true_q(t))) for t in T for topic in topics]
    bag = write_bag(tmp_path / "lab", "ros1", dict.fromkeys(topics, JOINT_STATE), messages)
    proposal = propose_mapping(bag)
    assert any("/vicon/joints.position or /camera/joints.position" in one for one in proposal.questions)


@settings(max_examples=30)
@given(st.text(max_size=12), st.sampled_from(["q_nominal", "signal:x", "time", "ok", "other"]))
def test_any_text_as_an_option_is_a_mapping_or_refused(text: str, quantity: str) -> None:
    try:
        mapping = mapping_of(["q_nominal=a", f"{quantity}={text}"])
    except ConfigError:
        return
    assert mapping is not None
    assert mapping.q_nominal.columns


def test_a_mapping_with_keys_that_there_are_not_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown key"):
        parse_settings(toml_table('[q_nominal]\ncolumn = "a"\n', "x"), RecordingMapping, "x")
    with pytest.raises(ValueError, match="needs robot"):
        parse_settings(
            {"q_nominal": {"columns": "a"}, "q_encoder": {"pose": {"columns": "b"}}}, RecordingMapping, "x"
        )
