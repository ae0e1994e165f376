"""Several tools beside one served robot for ENDURANCE_MINUTES: memory flat, nothing lost, losers named."""

import json
import os
import threading
from collections import deque
from pathlib import Path

import pytest

from catenary.recording.bag_reader import JournalReader
from meeting import Meeting
from patience import PATIENCE, until
from ros import PATIENT_COMMAND, Program

MINUTES = float(os.environ.get("ENDURANCE_MINUTES", "0"))
# [MB] of a program beyond what it had after a quarter of the time; an hour's messages of 200 Hz alone take 200
GROWTH = 30.0
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(MINUTES == 0.0, reason="wants a calm machine for the minutes of ENDURANCE_MINUTES"),
    pytest.mark.timeout(600.0 + 90.0 * MINUTES),
    pytest.mark.parametrize("meeting", ["1"], indirect=True, ids=["ros1"]),
]


class Tool:
    """A command whose output is read as it comes, so that none waits for a full pipe; its last lines are kept."""

    def __init__(self, meeting: Meeting, *arguments: str) -> None:
        self.program = Program(meeting.network, PATIENT_COMMAND, *arguments, "--ros", meeting.ros, "--json")
        self.process, self.lines, self.megabytes = self.program.process, deque([""], 400), list[float]()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line)

    @property
    def last(self) -> str:
        """The last line."""
        return self.lines[-1]

    def weigh(self) -> None:
        """Note the memory that is its own."""
        lines = Path(f"/proc/{self.process.pid}/status").read_text(encoding="ascii").splitlines()
        own = [line.split()[1] for line in lines if line.startswith("RssAnon")]
        self.megabytes += [float(kilobytes) / 1024.0 for kilobytes in own]

    def end(self) -> dict:
        """Press Ctrl-C, and return what it says last."""
        if self.process.poll() is None:
            self.program.interrupt()
        self.process.wait(PATIENCE)
        self._reader.join(PATIENCE)
        lines = list(self.lines)
        first = max(k for k, line in enumerate(lines) if line.startswith("{"))  # one line, or one that is laid out
        return json.loads("".join(lines[first:]))

    def grew(self) -> float:
        """Megabytes by which it grew after a quarter of the time."""
        quarter = len(self.megabytes) // 4
        return max(self.megabytes[quarter:]) - max(self.megabytes[: quarter + 1])


def test_several_tools_keep_up_and_grow_no_further(meeting: Meeting, model: Path, tmp_path: Path) -> None:
    project, hours = tmp_path / "project", str(MINUTES / 60.0)
    server = Tool(meeting, "serve", "--homed", "--rate", "200")
    tools = {"serve": server}
    try:
        until(lambda: server.last, seconds=10.0 * PATIENCE)  # it compiles
        meeting.resume()
        tools["monitor"] = Tool(meeting, "monitor", "--rate", "2")
        until(lambda: tools["monitor"].last, seconds=10.0 * PATIENCE)
        shoulder = json.loads(tools["monitor"].last)["q"][0]
        tools["view"] = Tool(meeting, "view", "--no-open")
        tools["deploy"] = Tool(meeting, "deploy", str(model), "--rate", "200")
        recorder = tools["record"] = Tool(
            meeting, "record", str(project), "--no-motion", "--hours", hours, "--simulated"
        )
        moves = 0
        while recorder.process.poll() is None or moves < 2:
            goal = str(shoulder + (0.1 if moves % 2 == 0 else 0.0))
            going = Tool(meeting, "goto", "--joints", "shoulder", "--q", goal, "--simulated")
            going.process.wait()  # the test's own limit ends what never ends
            assert going.process.returncode == 0, going.program.finish()
            moves += 1
            meeting.resume()  # a motion ends paused
            for name, tool in tools.items():
                if tool.process.poll() is None:
                    tool.weigh()
                else:
                    assert name == "record", tool.program.finish()
        assert recorder.process.returncode == 0
        told = {name: tools[name].end() for name in ("record", "deploy", "monitor", "serve")}
    finally:
        for tool in tools.values():
            tool.process.kill()
        figures = {name: {"megabytes": tool.megabytes, "said": tool.last} for name, tool in tools.items()}
        (tmp_path / "figures.json").write_text(json.dumps(figures), encoding="utf-8")
    assert {name: tool.grew() for name, tool in tools.items() if tool.grew() > GROWTH} == {}
    topics = {topic["name"]: topic for topic in told["record"]["topics"]}
    assert [topic["lost"] for topic in topics.values()] == [0] * len(topics)
    reader = JournalReader(project / "recordings" / "test")
    kept = sum(1 for _ in reader.messages())
    assert (kept, reader.lost, reader.damage) == (sum(topic["kept"] for topic in topics.values()), 0, [])
    # whoever missed messages is told by name
    missed = told["serve"]["missed"]
    assert sum(missed.values()) == told["serve"]["overflowed"]
    assert all(name.lstrip("/").startswith("catenary_") for name in missed)
    assert told["deploy"]["unreadable"] == 0
