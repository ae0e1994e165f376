"""A person beside a robot, as tests would have one."""

from typing import Any


class Person:
    """Answers as told, and does what is asked: by a word of the question what is called then; False gives up."""

    def __init__(self, **does: Any) -> None:
        self.asked: list[str] = []
        self.told: list[str] = []
        self._does = does

    def say(self, text: str) -> None:
        self.told.append(text)

    def confirm(self, text: str) -> bool:
        self.asked.append(text)
        return all(act() is not False for word, act in self._does.items() if word in text)
