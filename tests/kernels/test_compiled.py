import subprocess
import sys

import numba
import pytest

from catenary.kernels.compiled import Compiled, compiled, inlined


@inlined
def three() -> float:
    return 3.0


@compiled
def unused(x: float) -> float:
    return x + three()


@compiled
def plus_three(x: float) -> float:
    return x + three()


@compiled
def doubled(x: float) -> float:
    return 2.0 * plus_three(x)


def test_a_compiled_function_is_numbas_in_its_own_file_from_its_first_call_on() -> None:
    assert isinstance(unused, Compiled)
    assert unused.__name__ == "unused"
    assert unused(2.0) == 5.0
    assert not isinstance(unused, Compiled)
    assert unused(3.0) == 6.0


def test_compiled_functions_call_those_that_nobody_has_called_yet() -> None:
    assert doubled(1.0) == 8.0


def test_importing_compiled_functions_and_asking_for_a_line_does_not_import_numba() -> None:
    code = (
        "import sys, catenary, catenary.gravity.torque, catenary.dynamics.inverse_dynamics, catenary.control.limits\n"
        "from catenary.gravity.compact import compact_regressor\n"
        "from catenary.dynamics.lines import gravity_line\n"
        "gravity_line(catenary.load_robot('raven2'))\n"
        "assert not {'numba', 'scipy', 'sklearn'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_code_on_disk_is_made_anew_when_a_file_that_it_calls_has_changed(tmp_path) -> None:
    head = "from catenary.kernels.compiled import compiled, inlined\n"
    caller = (
        f"{head}from called import slope\n@compiled\ndef line(x):\n    return slope() * x\nprint(line(1.0))\n"
    )
    (tmp_path / "caller.py").write_text(caller)
    for slope in ("2.0", "3.0"):
        (tmp_path / "called.py").write_text(f"{head}@inlined\ndef slope():\n    return {slope}\n")
        done = subprocess.run([sys.executable, tmp_path / "caller.py"], capture_output=True, check=True)
        assert done.stdout.decode().strip() == slope


def test_where_numba_is_told_to_compile_nothing_functions_run_as_python(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", True)

    @compiled
    def twice(x: float) -> float:
        return 2.0 * x

    assert twice(1.5) == 3.0
