import pytest

from catenary.sensing.faults import Fault


@pytest.mark.parametrize("fault", list(Fault))
def test_every_fault_has_a_message_of_its_own(fault):
    assert len(fault.message) > 20
    assert fault is not Fault.GRAVITY_STRIPPED or "driver takes gravity away" in fault.message
    assert sum(other.message == fault.message for other in Fault) == 1


def test_faults_that_come_together_are_told_together_and_none_has_nothing_to_say():
    assert (Fault.NONE.message, Fault.NONE.names) == ("", ())
    both = Fault.STUCK | Fault.INTERRUPTED
    assert set(both.names) == {"stuck", "interrupted"}
    assert Fault.STUCK.message in both.message
    assert Fault.INTERRUPTED.message in both.message
