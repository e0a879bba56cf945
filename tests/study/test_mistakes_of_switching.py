"""The table of mistakes, continued: branches that leave others, diagrams, and what starts from a branch of one.

A row is what is changed in a study that is in order, words that the message must contain, the key that it must name and
the text of the line that it must point to. Nothing runs, nothing is written.
"""

from __future__ import annotations

import json

import pytest

STUDY = """
title = "Switching"
[system]
library = "duffing"
parameters = { c = 0.05, F = 1.0 }

[[analyses]]
name = "response"
type = "frequency_response"
omega = [0.5, 3.5]
parameters = { F = 1.1 }

[[analyses]]
name = "tree"
type = "bifurcation_diagram"
omega = [0.6, 0.8]
depth = 3
max_branches = 5
seconds = 60

[[analyses]]
name = "other"
type = "switch_branch"
start = { analysis = "response", bifurcation = "BP", index = 0 }
side = 1
bounds = [0.6, 0.8]
parameters = { F = 1.1 }

[[analyses]]
name = "deeper"
type = "switch_branch"
start = { analysis = "tree", branch = 0, bifurcation = "BP" }

[[analyses]]
name = "over the force"
type = "continue_branch"
start = { analysis = "tree", label = "T, closed", point = 2 }
parameter = "F"
bounds = [0.9, 1.1]

[[analyses]]
name = "witness"
type = "verify"
branch = { analysis = "tree", branch = 1 }

[[analyses]]
name = "multipliers"
type = "stability"
branch = { analysis = "tree", branch = 1 }
points = [0]

[outputs]
[[outputs.figures]]
file = "tree.png"
analyses = ["tree"]
[[outputs.figures]]
kind = "phase"
file = "portrait.png"
motions = [{ analysis = "tree", branch = 0, point = 7 }]
"""
SWITCH = 'start = { analysis = "response", bifurcation = "BP", index = 0 }'
DEEPER = 'start = { analysis = "tree", branch = 0, bifurcation = "BP" }'
VERIFY = 'type = "verify"\nbranch = { analysis = "tree", branch = 1 }'
POINTS = 'branch = { analysis = "tree", branch = 1 }\npoints = [0]'
MOTIONS = 'motions = [{ analysis = "tree", branch = 0, point = 7 }]'

ROWS = [
    # ------------------------------------------------------------------------------------------------- switch_branch
    ("type misspelt", '"switch_branch"', '"swich_branch"', ["mean 'switch_branch'"], "analyses[2].type", "swich"),
    ("no start", SWITCH + "\n", "", ["missing"], "analyses[2].start", "[[analyses]]"),
    ("start a name", SWITCH, 'start = "response"', ["name the bifurcation"], "analyses[2].start", 'start = "response"'),
    ("start numbers", SWITCH, "start = [0.1, 0.0]", ["a text or a table"], "analyses[2].start", "start = [0.1"),
    ("start a point", SWITCH, 'start = { analysis = "response", point = 3 }', ["name the bifurcation", '"PD" or "BP"'],
     "analyses[2].start", "point = 3"),
    ("start without an analysis", SWITCH, 'start = { bifurcation = "BP" }', ["missing"], "analyses[2].start.analysis",
     'start = { bifurcation = "BP" }'),
    ("unknown analysis", SWITCH, SWITCH.replace("response", "respnse"), ["did you mean 'response'"],
     "analyses[2].start.analysis", "respnse"),
    ("a later analysis", SWITCH, SWITCH.replace("response", "deeper"), ["no analysis 'deeper' before"],
     "analyses[2].start.analysis", 'analysis = "deeper"'),
    ("an analysis without branch", DEEPER, 'start = { analysis = "other", branch = 0, bifurcation = "BP" }',
     ["one branch, not a diagram", "leave branch out"], "analyses[3].start.branch", 'analysis = "other", branch'),
    ("key of a start misspelt", SWITCH, SWITCH.replace("index", "indx"), ["did you mean 'index'"],
     "analyses[2].start.indx", "indx"),
    ("unknown kind", SWITCH, SWITCH.replace("BP", "PB"), ["no kind of bifurcation 'PB'"],
     "analyses[2].start.bifurcation", '"PB"'),
    ("a limit point", SWITCH, SWITCH.replace("BP", "LP"), ["turns back, no other branch", "takes a PD or a BP"],
     "analyses[2].start", '"LP"'),
    ("a Neimark-Sacker point", SWITCH, SWITCH.replace("BP", "NS"), ["quasi-periodic"], "analyses[2].start", '"NS"'),
    ("a grazing contact", SWITCH, SWITCH.replace("BP", "grazing"), ["no other branch"], "analyses[2].start", "grazing"),
    ("two choices at once", SWITCH, SWITCH.replace("index = 0", "point = 1"), ["not by several"], "analyses[2].start",
     "point = 1"),
    ("side two", "side = 1", "side = 2", ["1 or -1"], "analyses[2].side", "side = 2"),
    ("side a text", "side = 1", 'side = "up"', ["1 or -1"], "analyses[2].side", 'side = "up"'),
    ("bounds of one number", "bounds = [0.6, 0.8]", "bounds = [0.6]", ["at least 2 items"], "analyses[2].bounds",
     "bounds = [0.6]"),
    ("bounds empty", "bounds = [0.6, 0.8]", "bounds = [0.6, 0.6]", ["two different"], "analyses[2].bounds", "0.6, 0.6"),
    ("bounds of a frequency negative", "bounds = [0.6, 0.8]", "bounds = [-0.6, 0.8]", ["positive"],
     "analyses[2].bounds", "bounds = [-0.6"),
    ("parameters that differ", "bounds = [0.6, 0.8]\nparameters = { F = 1.1 }",
     "bounds = [0.6, 0.8]\nparameters = { F = 1.2 }", ["F = 1.1", "leave it out"], "analyses[2].parameters.F",
     "F = 1.2"),
    ("parameters of the study, not of the analysis", "bounds = [0.6, 0.8]\nparameters = { F = 1.1 }",
     "bounds = [0.6, 0.8]\nparameters = { F = 1.0 }", ["F = 1.1"], "analyses[2].parameters.F", "F = 1.0 }"),
    ("a parameter that is none", "bounds = [0.6, 0.8]\nparameters = { F = 1.1 }",
     "bounds = [0.6, 0.8]\nparameters = { G = 1.1 }", ["no such parameter"], "analyses[2].parameters.G", "G = 1.1"),
    ("an argument of another step", "side = 1", "omega = [0.6, 0.8]", ["no such key"], "analyses[2].omega",
     "omega = [0.6"),
    ("an option out of range", "side = 1", "max_step = -1.0", ["positive"], "analyses[2].max_step", "max_step = -1"),
    ("a stability method misspelt", "side = 1", 'stability = "hil"', ["did you mean 'hill'"], "analyses[2].stability",
     "hil"),
    # -------------------------------------------------------------------------------------------- bifurcation_diagram
    ("depth negative", "depth = 3", "depth = -1", ["0"], "analyses[1].depth", "depth = -1"),
    ("depth a fraction", "depth = 3", "depth = 1.5", ["whole number"], "analyses[1].depth", "depth = 1.5"),
    ("no branches", "max_branches = 5", "max_branches = 0", ["greater than or equal to 1"], "analyses[1].max_branches",
     "max_branches = 0"),
    ("no time", "seconds = 60", "seconds = 0", ["greater than 0"], "analyses[1].seconds", "seconds = 0"),
    ("time a text", "seconds = 60", 'seconds = "1 h"', ["number"], "analyses[1].seconds", "1 h"),
    ("argument misspelt", "depth = 3", "dept = 3", ["did you mean 'depth'"], "analyses[1].dept", "dept = 3"),
    ("no range", "omega = [0.6, 0.8]\n", "", ["missing"], "analyses[1].omega", "[[analyses]]"),
    ("range negative", "omega = [0.6, 0.8]", "omega = [-0.6, 0.8]", ["positive"], "analyses[1].omega", "omega = [-0.6"),
    ("no load", "depth = 3", "depth = 3\nparameters = { F = 0.0 }", ["load is zero"], "analyses[1]", "[[analyses]]"),
    # ------------------------------------------------------------------------------------------- branches of a diagram
    ("which branch", DEEPER, 'start = { analysis = "tree", bifurcation = "BP" }', ["gives a diagram", "branch = 0"],
     "analyses[3].start.analysis", 'start = { analysis = "tree", bifurcation'),
    ("number and label", DEEPER, DEEPER.replace("branch = 0", 'branch = 0, label = "T"'), ["not by both"],
     "analyses[3].start.analysis", 'label = "T"'),
    ("branch negative", DEEPER, DEEPER.replace("branch = 0", "branch = -1"), ["greater than or equal to 0"],
     "analyses[3].start.branch", "branch = -1"),
    ("branch a label", DEEPER, DEEPER.replace("branch = 0", 'branch = "T"'), ["whole number"],
     "analyses[3].start.branch", 'branch = "T"'),
    ("label empty", DEEPER, DEEPER.replace("branch = 0", 'label = ""'), ["not be empty"], "analyses[3].start.label",
     'label = ""'),
    ("the parameter that varies", "bounds = [0.9, 1.1]", "bounds = [0.9, 1.1]\nparameters = { F = 1.0 }",
     ["range is in bounds"], "analyses[4].parameters.F", "parameters = { F = 1.0 }"),
    ("another damping than the motion", "bounds = [0.9, 1.1]", "bounds = [0.9, 1.1]\nparameters = { c = 0.06 }",
     ["c = 0.05"], "analyses[4].parameters.c", "c = 0.06"),
    ("verify a diagram", VERIFY, 'type = "verify"\nbranch = "tree"', ["say which of its branches"],
     "analyses[5].branch", 'branch = "tree"'),
    ("verify no branch", VERIFY, 'type = "verify"\nbranch = 3', ["a text or a table,"], "analyses[5].branch",
     "branch = 3"),
    ("verify a branch of a branch", VERIFY, VERIFY.replace("tree", "response"), ["leave branch out"],
     "analyses[5].branch.branch", 'analysis = "response", branch'),
    ("stability of a diagram", POINTS, 'branch = "tree"\npoints = [0]', ["say which of its branches"],
     "analyses[6].branch", 'branch = "tree"'),
    # ---------------------------------------------------------------------------------------------------------- outputs
    ("figure of no analysis", 'analyses = ["tree"]', 'analyses = ["three"]', ["did you mean 'tree'"],
     "outputs.figures[0].analyses[0]", '"three"'),
    ("labels for branches", 'analyses = ["tree"]', 'analyses = ["tree"]\nlabels = ["T", "2T"]', ["2 labels for 1"],
     "outputs.figures[0].labels", "labels ="),
    ("part backwards", 'analyses = ["tree"]', 'analyses = ["tree"]\nxlim = [0.8, 0.6]', ["smaller one first"],
     "outputs.figures[0]", "[[outputs.figures]]"),
    ("part of one number", 'analyses = ["tree"]', 'analyses = ["tree"]\nylim = [0.8]', ["at least 2 items"],
     "outputs.figures[0].ylim", "ylim ="),
    ("marks misspelt", 'analyses = ["tree"]', 'analyses = ["tree"]\nmarks = ["PP"]', ["neither a kind nor an event"],
     "outputs.figures[0].marks[0]", "marks ="),
    ("portrait of a diagram", MOTIONS, 'motions = ["tree"]', ["say which of its branches"],
     "outputs.figures[1].motions[0]", 'motions = ["tree"]'),
    ("portrait of a branch of a branch", MOTIONS, MOTIONS.replace("tree", "response"), ["leave branch out"],
     "outputs.figures[1].motions[0].branch", 'analysis = "response", branch'),
]  # fmt: skip


def test_the_study_is_in_order(study_file, suboctave):
    status, out, err = suboctave("check", study_file(STUDY))
    assert status == 0, err
    assert "7 analyses" in out


@pytest.mark.parametrize(("old", "new", "words", "key", "line"), [r[1:] for r in ROWS], ids=[r[0] for r in ROWS])
def test_a_mistake(old, new, words, key, line, study_file, suboctave, tmp_path):
    # the first place behind the analyses that are not changed
    place = STUDY.rindex(old) if old in ("omega = [0.6, 0.8]", "omega = [0.6, 0.8]\n") else STUDY.index(old)
    text = STUDY[:place] + new + STUDY[place + len(old) :]
    path = study_file(text)
    status, out, err = suboctave("run", path)
    assert status == 2, (out, err)
    assert not out
    for word in words:
        assert word in err, err
    assert [p.name for p in tmp_path.iterdir()] == ["study.toml"]
    status, out, _ = suboctave("check", path, "--json")
    assert status == 2
    mistakes = json.loads(out)["mistakes"]
    assert key in [m["key"] for m in mistakes], mistakes
    lines = text.splitlines()
    assert any(line in lines[m["line"] - 1] for m in mistakes if m["key"] == key), mistakes


def test_labels_of_rows_are_different():
    assert len({row[0] for row in ROWS}) == len(ROWS)
