import numpy as np
import pytest

from catenary.crtk.message import has_header, header, message_class, message_fields, stamp_of
from catenary.errors import FileFormatError, InputError


def test_a_message_and_its_default_arrays_which_others_share_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        message_class("std_msgs/String")(data="a").data = "b"
    with pytest.raises(ValueError, match="read-only"):
        message_class("raven_2/raven_state")().jpos[0] = 1.0


def test_old_and_new_names_give_the_same_class() -> None:
    assert message_class("crtk_msgs/operating_state") is message_class("crtk_msgs/OperatingState")


def test_header_is_found_whatever_its_name_and_its_stamp_is_the_messages() -> None:
    assert has_header("raven_2/raven_state")  # hdr
    assert has_header("sensor_msgs/Imu")
    assert not has_header("std_msgs/Header")
    assert not has_header("std_msgs/Empty")
    assert stamp_of(message_class("raven_2/raven_state")(hdr=header(12, "base"))) == 12
    assert stamp_of(message_class("std_msgs/Empty")()) is None
    assert stamp_of(message_class("std_msgs/Bool")(data=True)) is None


def test_an_unknown_type_and_a_message_of_another_are_refused() -> None:
    with pytest.raises(FileFormatError, match="unknown"):
        message_class("raven_2/raven_mood")
    with pytest.raises(InputError, match="OperatingState"):
        message_fields("crtk_msgs/OperatingState", np.zeros(3))
