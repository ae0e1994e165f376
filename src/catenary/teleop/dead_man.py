"""The dead man's switch of teleop: a key moves while the terminal repeats it, then its motion ramps down to none.

Terminals do not tell when a key is released. They repeat one that is held, 20 to 30 times a second, so a key that has
not come for TIMEOUT counts as released. TIMEOUT + RAMP after its last repeat everything has stopped.
"""

TIMEOUT = 0.15  # [s] after the last repeat of a key, from which its motion ramps down
RAMP = 0.1  # [s] from rest to full speed, and back


class DeadMan:
    """The keys that are held, and the share of full speed, 0 to 1, that each of them has."""

    def __init__(self) -> None:
        self.shares: dict[str, float] = {}
        self._pressed: dict[str, float] = {}  # when a key came last [s]

    def press(self, key: str, now: float) -> None:
        """Take a key, or a repeat of it, at a time [s]."""
        self._pressed[key] = now
        self.shares.setdefault(key, 0.0)

    def stop(self) -> None:
        """Release all keys, without a ramp."""
        self._pressed.clear()
        self.shares.clear()

    def update(self, now: float, period: float) -> dict[str, float]:
        """Ramp every key's share up or down for a tick of `period` [s], and return those of the keys that move."""
        for key, pressed in list(self._pressed.items()):
            is_held = now - pressed <= TIMEOUT
            share = self.shares[key] + (period if is_held else -period) / RAMP
            self.shares[key] = min(max(share, 0.0), 1.0)
            if not is_held and share <= 0.0:
                del self.shares[key], self._pressed[key]
        return self.shares
