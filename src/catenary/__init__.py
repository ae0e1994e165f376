"""catenary: make an arm's low-level model true.

The names of `__init__.pyi` are loaded when first used, so that importing the package costs nothing.
"""

from importlib import import_module
from pathlib import Path
from typing import Any

__version__ = "1.0.0rc1"

# each line of the stub is "from MODULE import NAME as NAME"
_HOME = {
    words[3]: words[1]
    for words in map(str.split, Path(__file__).with_suffix(".pyi").read_text(encoding="utf-8").splitlines())
    if words[:1] == ["from"]
}

__all__ = [*_HOME, "__version__"]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'catenary' has no attribute {name!r}; it has {', '.join(_HOME)}")
    from catenary.arguments import explained  # brings NumPy

    home = import_module(_HOME[name])
    public = globals()[name] = explained(getattr(home, name))
    setattr(home, name, public)  # as pickle finds it
    return public


def __dir__() -> list[str]:
    return sorted(__all__)
