"""JSON that every reader takes: NaN and infinity, which JSON does not know, are null."""

import json
import math
from typing import Any


def json_text(content: Any) -> str:
    """JSON text of plain data, indented, in ASCII."""
    return json.dumps(_finite(content), indent=2, allow_nan=False)


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {str(key): _finite(value) for key, value in content.items()}
    if isinstance(content, list | tuple):
        return [_finite(value) for value in content]
    if hasattr(content, "tolist"):  # a NumPy array or number; NumPy itself need not be loaded here
        return _finite(content.tolist())
    if isinstance(content, float) and not math.isfinite(content):
        return None
    return content
