"""docs/messages.md: what it lists is in the source, and every failure of an iteration in the source is on it."""

from __future__ import annotations

import ast
import re
from functools import cache

import pytest
from pages import DOCS, check_prints

import suboctave
from suboctave.continuation.ending import _SENTENCES, EndReason

SOURCE = DOCS.parent / "src" / "suboctave"

#: raised and caught within the package, or read only as the reason in another message, which is on the page
INTERNAL = (
    "the harmonic at {} omega is not kept",
    "the system does not tell where on the response curve to look",
    "two extrema or singular points fall together",
    "two ridges meet",
    "no crossing of curves was found beside",
    "no other curve crosses at",
    "the direction of the curve at",
    "the curves that cross at",
    "no point of the other curve was found beside",
    "the motion has no extremum here",
    "no complex pair of multipliers here",
    "no period doubling where the system is nearly solved",
    "the Hopf point found lies elsewhere",
    "the equations have a double multiplier",
    "the pair of multipliers splits into two real ones",
    "no zero found beside",
    "no zero was located between",
    "two points fall together at",
    "the search left the positive frequencies",
    "not settled within {} passes",
    "shooting with free omega did not converge",
    "no {} found along the curve of periodic motions",
    "the pair of multipliers followed became real",
    "no branch point {}: no second branch crosses there",
    "none of {} moves where the isola is",
    "where the isola ends turns into another kind of point",
    "no node",
    "the motion of {} load periods at {} was not found again",
    "this {} has no complex pair",
    "no limit point of the doubled motions was found",
)


def _text(node: ast.AST) -> str | None:
    """A text of the source, what is formatted into it as {}; parts joined by + together."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.JoinedStr):
        return "".join(part.value if isinstance(part, ast.Constant) else "{}" for part in node.values)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = _text(node.left), _text(node.right)
        return None if left is right is None else (left or "{}") + (right or "{}")
    return None


@cache
def trees() -> list[ast.Module]:
    return [ast.parse(path.read_text(encoding="utf-8")) for path in sorted(SOURCE.rglob("*.py"))]


@cache
def texts() -> tuple[str, ...]:
    found = (_text(node) for tree in trees() for node in ast.walk(tree))
    return tuple({re.sub(r"\{\w[\w:.]*\}", "{}", text) for text in found if text and " " in text})


@cache
def patterns() -> list[str]:
    """The messages of the page, first column of its tables."""
    _, page = (DOCS / "messages.md").read_text(encoding="utf-8").split("## The curve ends")
    return re.findall(r"^\| `([^`]+)` \|", page, re.M)


def matches(pattern: str, text: str) -> bool:
    """Whether the fixed parts of a message are in a text, in their order."""
    place = 0
    for part in (part.strip() for part in pattern.split("…")):
        place = text.find(part, place)
        if place < 0:
            return False
        place += len(part)
    return True


def test_every_message_on_the_page_is_in_the_source():
    assert len(patterns()) > 90
    rotten = [pattern for pattern in patterns() if not any(matches(pattern, text) for text in texts())]
    assert not rotten, rotten


def test_the_page_has_every_failure_of_an_iteration():
    missing = []
    for tree in trees():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "ConvergenceError" and node.args:
                text = _text(node.args[0])
                if text and not _known(text):
                    missing.append(text)
    assert not missing, "\n".join(missing)


def _known(text: str) -> bool:
    return any(matches(pattern, text) for pattern in patterns()) or any(one in text for one in INTERNAL)


#: modules that print sentences about what was not settled, all of which are on the page
SENTENCES = (
    *("curves/follow.py", "curves/guard.py", "curves/interior.py", "curves/ledgers.py", "curves/refine.py"),
    *("curves/corners.py", "curves/tracked/ends.py", "curves/tracked/follow.py", "floquet/hill.py"),
    *("maps/regimes/verb.py", "timedomain/flow.py"),
)
#: parts of sentences that are on the page
PARTS = (
    "it must return a finite number",
    "they are not good enough, more are needed",
    "the map holds what had been found",
)


def _sentences(module: str) -> list[str]:
    """Texts of six words and more but docstrings and what is said of wrong input."""
    tree = ast.parse((SOURCE / module).read_text(encoding="utf-8"))
    left_out: set[int] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and isinstance(node.body[0], ast.Expr):
            left_out.add(id(node.body[0].value))
        if isinstance(node, ast.JoinedStr):
            left_out |= {id(part) for part in node.values}
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("InputError", "refuse_idle"):
            left_out |= {id(part) for part in ast.walk(node)}
    found = (_text(node) for node in ast.walk(tree) if id(node) not in left_out and not isinstance(node, ast.BinOp))
    return [text for text in found if text and len(re.findall(r"[a-z]{2,}", text)) >= 6]


@pytest.mark.parametrize("module", SENTENCES)
def test_the_page_has_what_a_module_says(module):
    missing = [text for text in _sentences(module) if not _known(text) and not any(part in text for part in PARTS)]
    assert not missing, "\n".join(missing)


#: with these a message says what to change
REMEDIES = re.compile(
    r"\b(use|try|give|take|check|keep|move|begin|start|declare|raise|add|write|return|leave|choose|track|reduce|name|draw|"
    r"replace|write|smaller|larger|more)\b",
    re.I,
)


def _last(text: str) -> str:
    """The last sentence or clause."""
    return re.split(r"[.;] (?=\w)|: (?=[a-z])", text)[-1]


#: modules with long texts that are no messages: what a demonstration is of, the head of a generated module
NO_MESSAGES = ("study/demo.py", "timedomain/generated.py")


def test_a_long_message_ends_with_what_to_do():
    """Of more than 200 characters, the last sentence or clause says what to change; wherever it is put together."""
    silent = []
    for path in sorted(SOURCE.rglob("*.py")):
        if path.relative_to(SOURCE).as_posix() in NO_MESSAGES:
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        left_out: set[int] = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and isinstance(node.body[0], ast.Expr):
                left_out.add(id(node.body[0].value))  # a docstring
            elif isinstance(node, ast.Subscript) and getattr(node.value, "id", "") == "Annotated":
                left_out |= {id(part) for part in ast.walk(node)}  # what an option means
            elif isinstance(node, ast.JoinedStr):
                left_out |= {id(part) for part in node.values}
        texts = (_text(node) for node in ast.walk(tree) if id(node) not in left_out)
        silent += [text for text in texts if text and len(text) > 200 and not REMEDIES.search(_last(text))]
    assert not silent, "\n".join(silent)


def test_messages_of_the_page_are_short_or_end_with_what_to_do():
    long = [one for one in patterns() if len(one) > 200 and not REMEDIES.search(_last(one))]
    assert not long, "\n".join(long)


def test_what_is_called_internal_is_in_the_source():
    assert not [one for one in INTERNAL if not any(one in text for text in texts())]


def test_the_page_has_every_reason_for_an_end():
    for reason, sentence in _SENTENCES.items():
        if reason is not EndReason.START:
            assert _known(re.sub(r"\{\w[\w:.]*\}", "{}", sentence)), sentence


def test_the_page_names_what_exists_and_prints_what_it_says(capsys):
    page = (DOCS / "messages.md").read_text(encoding="utf-8")
    assert not [name for name in re.findall(r"\bso\.(\w+)", page) if not hasattr(suboctave, name)]
    check_prints("messages.md", capsys)
