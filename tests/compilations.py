"""What numba compiles, or takes its lock for to load, while a block runs."""

from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def compilations(*, in_ticks: bool = False) -> Iterator[list[str]]:
    """Collect what is compiled, or found compiled on disk, in the block; `in_ticks`: between a loop's first and last."""
    from numba.core import event

    from catenary.kernels.compiled import in_motion

    found: list[str] = []

    class Listener(event.Listener):
        def on_start(self, happened: event.Event) -> None:
            if in_motion.get() or not in_ticks:
                found.append(f"{happened.kind} {happened.data or ''}")

        def on_end(self, happened: event.Event) -> None:
            pass

    with event.install_listener("numba:compile", Listener()), event.install_listener("numba:compiler_lock", Listener()):
        yield found
