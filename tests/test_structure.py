"""What a reader may rely on in every room: names once, short files, a page that knows them all."""

import ast
import pkgutil
import re
import sys
import tomllib
from collections import Counter
from functools import cache
from pathlib import Path

import pytest

import rooms
from catenary import errors

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "catenary"
FILES = sorted(PACKAGE.rglob("*.py"))
CODE = re.sub('""".*?"""', "", "\n".join(path.read_text() for path in FILES), flags=re.DOTALL)


def test_no_class_name_is_used_twice() -> None:
    names = Counter(re.findall(r"^ *class (\w+)[(:\[]", CODE, re.MULTILINE))
    assert len(names) > 300
    assert [name for name, count in names.items() if count > 1] == []


def test_no_file_is_longer_than_a_concept() -> None:
    lengths = {str(path.relative_to(PACKAGE)): len(path.read_text().splitlines()) for path in FILES}
    assert {name: length for name, length in lengths.items() if length > 600} == {}


@cache
def trees() -> dict[str, ast.Module]:
    return {str(path.relative_to(PACKAGE)): ast.parse(path.read_text("utf-8")) for path in FILES}


def test_every_file_of_text_is_read_and_written_in_utf8() -> None:
    """Not in the locale's encoding, which LC_ALL=C makes ASCII."""
    found = []
    for name, tree in trees().items():
        for call in [node for node in ast.walk(tree) if isinstance(node, ast.Call)]:
            told = getattr(call.func, "attr", getattr(call.func, "id", ""))
            words = [one.value for one in call.args if isinstance(one, ast.Constant) and isinstance(one.value, str)]
            is_text = told in ("read_text", "write_text") or (
                told == "open" and (words[-1:] or ["r" * (not call.args)])[0] in ("r", "w", "a", "x", "r+", "w+")
            )
            if is_text and "utf-8" not in words and "encoding" not in {one.arg for one in call.keywords}:
                found.append(f"{name}:{call.lineno}")
    assert found == []


def test_no_error_within_our_own_code_is_told_as_one_of_the_users() -> None:
    """What may hide a mistake of ours, such as AttributeError, is caught around others' code or a user's alone."""
    hiding, ours = {"Exception", "AttributeError", "TypeError"}, set(vars(errors))
    found = []
    for name, tree in trees().items():
        nodes = list(ast.walk(tree))
        own = {node.name for node in nodes if isinstance(node, ast.FunctionDef | ast.ClassDef)}
        imports = [node for node in nodes if isinstance(node, ast.ImportFrom) and "catenary" in str(node.module)]
        own |= {one.asname or one.name for node in imports for one in node.names}
        for node in [node for node in nodes if isinstance(node, ast.Try)]:
            called = {call.func.id for part in node.body for call in ast.walk(part)
                      if isinstance(call, ast.Call) and isinstance(call.func, ast.Name)}  # fmt: skip
            for handler in node.handlers:
                caught = {one.id for one in ast.walk(handler.type or handler) if isinstance(one, ast.Name)}
                raised = {one.func.id for one in ast.walk(handler)
                          if isinstance(one, ast.Call) and isinstance(one.func, ast.Name)}  # fmt: skip
                if caught & hiding and raised & ours and called & own - {"TypeError"}:
                    found.append(f"{name}:{handler.lineno}: {', '.join(sorted(called & own))}")
    assert found == []


def test_index_of_files_is_made_from_their_docstrings() -> None:
    assert rooms.PAGE.read_text() == rooms.page(), "run python -m tests.rooms"


PAGES = [ROOT / "README.md", ROOT / "Makefile", *sorted((ROOT / "docs").rglob("*.md"))]
# scripts of other projects
OF_OTHERS = r"run_r\w+|raven_py_controller|crtk_\w+_example|ral_ros1|utils|make_msgs|dvrk_\w+_test|dvrk_teleoperation|dvrk_mtm_\w+"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_names_exists(page: Path) -> None:
    text = page.read_text()
    targets = re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert set(re.findall(r"(?:`|^)make ([a-z0-9-]+)", text, re.MULTILINE)) <= set(targets)
    programs = re.findall(r"python -m ((?:papers|tests)\.[\w.]+\w)", text)
    folders = re.findall(r"`((?:src|tests|papers|docs|examples)/[\w./]*)`", text)
    modules = [ROOT / name.replace(".", "/") for name in programs]
    assert [m for m in modules if not (m.with_suffix(".py").exists() or (m / "__main__.py").exists())] == []
    assert [path for path in folders if not (ROOT / path).exists()] == []
    for link, anchor in re.findall(r"\]\(([^)#:]+)(?:#([^)]*))?\)", text):
        assert (page.parent / link).exists(), link
        headings = re.findall(r"^#+ (.*)$", (page.parent / link).read_text(), re.MULTILINE) if anchor else []
        assert anchor in ["", *(re.sub(r"[^\w -]", "", one.lower()).replace(" ", "-") for one in headings)]


PYTHON = [f"/{path}" for room in ("src", "papers", "tests", "examples") for path in (ROOT / room).rglob("*.py")]


@pytest.mark.alike
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_files_and_names_of_the_package_that_a_page_names_exist(page: Path) -> None:
    text = page.read_text()
    named = [name for name in re.findall(r"[\w/]+\.py\b", text) if not re.fullmatch(OF_OTHERS, name[:-3])]
    assert [name for name in named if not any(file.endswith(f"/{name.lstrip('/')}") for file in PYTHON)] == []
    for name in re.findall(r"\bcatenary(?:\.[A-Za-z]\w*)+(?![.\w])", text):
        assert pkgutil.resolve_name(name) is not None, name


# packages that are imported by another name than they are installed by, or that come with ROS
IMPORTED = {"sklearn": "scikit_learn", "serial": "pyserial"}
OF_ROS = {"rospy", "rosgraph", "genpy", "xacro", "rclpy", "rcl_interfaces", "crtk_msgs"}


def _declared(requirements: list[str]) -> set[str]:
    return {re.split(r"[^\w-]", one)[0].replace("-", "_") for one in requirements}


def _imported() -> set[str]:
    lines = r"^ *from (\w+)[\w.]* import |^ *import (\w+)[\w.]*(?: as \w+)?(?:  #.*)?$|import_module\(\"(\w+)"
    names = {name for found in re.findall(lines, CODE, re.MULTILINE) for name in found}
    return {IMPORTED.get(name, name) for name in names} - {*sys.stdlib_module_names, "catenary", ""}


def test_every_package_that_is_imported_is_declared() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    always = _declared(project["dependencies"])
    extras = {name: _declared(each) for name, each in project["optional-dependencies"].items()}
    of_users = set().union(*(each for name, each in extras.items() if name not in ("test", "bench", "dev")))
    imported = _imported()
    assert imported - always - of_users - OF_ROS == set()
    assert always - imported == set()


_WEAK_FIRST_LINE = re.compile(r"(Return|Give|Say|Tell) (what|it|how|whether|where|which)\b")
_IDIOMS = ("told", "anew", "as they come", "lie behind", "lies behind", "what lies", "vouch", "in how far")


def test_a_docstring_begins_with_what_is_returned() -> None:
    functions = [
        (name, node) for name, tree in trees().items() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)
    ]
    weak = [f"{n}:{f.name}" for n, f in functions if _WEAK_FIRST_LINE.match(ast.get_docstring(f) or "")]
    assert weak == []


def test_functions_that_other_rooms_import_state_their_arguments() -> None:
    """Commands' arguments are their options, which have a help each."""
    imported = {
        alias.name
        for name, tree in trees().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("catenary.")
        if node.module.split(".")[1] != name.split("/")[0]
        for alias in node.names
    }
    silent = [
        f"{name}:{node.name}"
        for name, tree in trees().items()
        if not name.startswith("cli/")
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and node.name in imported and not node.name.startswith("_")
        if not any(getattr(decorator, "id", "") == "overload" for decorator in node.decorator_list)
        if len([*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]) > 1
        if not re.search(r"^\s*Args:", ast.get_docstring(node) or "", re.MULTILINE)
    ]
    assert silent == []


def test_names_and_prose_are_the_fields() -> None:
    nodes = [(name, node) for name, tree in trees().items() for node in ast.walk(tree)]
    loops = [node for _, node in nodes if isinstance(node, ast.For | ast.comprehension)]
    assert [node for node in loops if isinstance(node.target, ast.Name) and node.target.id == "each"] == []
    found = {
        str(path.relative_to(PACKAGE)): words
        for path in FILES
        if (words := [word for word in _IDIOMS if re.search(rf"\b{word}\b", path.read_text(), re.IGNORECASE)])
    }
    assert found == {}
