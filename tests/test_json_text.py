import json
import math

from catenary.json_text import json_text


def test_plain_data_come_back() -> None:
    content = {"a": [1, 2.5, "µ", None, True], "b": {"c": []}}
    assert json.loads(json_text(content)) == content


def test_nan_and_infinity_are_null() -> None:
    assert json.loads(json_text({"a": (math.nan, [math.inf, -math.inf])})) == {"a": [None, [None, None]]}


def test_the_text_is_ascii() -> None:
    assert json_text("µ\udcff").isascii()
