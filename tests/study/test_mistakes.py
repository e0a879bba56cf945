"""The table of mistakes: each is told with its cause, its line and a remedy; nothing runs, nothing is overwritten.

A row is what is changed in a study that is in order (text to replace, replacement), words that the message must
contain, and the text of the line that it must point to (None: the mistake has no line of its own).
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

DUFFING = (Path(__file__).parent / "duffing.toml").read_text(encoding="utf-8")
TWO = DUFFING.replace("mass = 1.0", "mass = [[1.0, 0.0], [0.0, 2.0]]").replace(
    'damping = "c"', 'damping = [["c", 0.0], [0.0, 0.1]]'
).replace("stiffness = 1.0", "stiffness = [[1.0, 0.0], [0.0, 1.0]]")  # fmt: skip

SPRING = '{ type = "CubicSpring", dof = 0, coefficient = "alpha" }'
LOAD = '{ type = "HarmonicLoad", dof = 0, amplitude = "F" }'
VERIFY = '\n[[analyses]]\nname = "w"\ntype = "verify"\nbranch = "response"\n'
STABILITY = '\n[[analyses]]\nname = "s"\ntype = "stability"\nbranch = "response"\n'
FIGURE = '\n[outputs]\n[[outputs.figures]]\nfile = "a.png"\n'
PHASE = FIGURE + 'kind = "phase"\nmotions = ["response"]\n'
HISTORY = PHASE.replace("phase", "history")
RESPONSE = "omega = [3.0, 0.5]\n"

ROWS = [
    # ------------------------------------------------------------------------------------------------ the file itself
    ("not TOML", 'title = "Duffing"', "title = Duffing", ["not TOML", "column"], "title = Duffing"),
    ("a key twice", "stiffness = 1.0", "stiffness = 1.0\nstiffness = 2.0", ["not TOML"], "stiffness = 2.0"),
    ("cut short", 'bounds = [0.25, 0.4]', "bounds = [0.25,", ["not TOML"], None),
    ("no system", "[system]", "[sytem]", ["system", "did you mean 'system'"], "[sytem]"),
    ("no analysis", DUFFING[DUFFING.index("[[analyses]]"):], "", ["analyses", "is missing"], None),
    ("title no text", 'title = "Duffing"', "title = 3", ["title", "must be a text"], "title = 3"),
    ("unknown section", "[system]", "[plots]\n[system]", ["plots", "no such key"], "[plots]"),
    # ---------------------------------------------------------------------------------------------------- the system
    ("misspelt key of the system", "stiffness = 1.0", "stifness = 1.0", ["did you mean 'stiffness'"], "stifness = 1.0"),
    ("matrix missing", "mass = 1.0\n", "", ["system.mass", "missing"], "[system]"),
    ("two ways at once", "mass = 1.0", 'library = "duffing"\nmass = 1.0', ["not several"], "[system]"),
    ("unknown published system", 'mass = 1.0\ndamping = "c"\nstiffness = 1.0', 'library = "dufing"',
     ["did you mean 'duffing'"], 'library = "dufing"'),
    ("mass zero", "mass = 1.0", "mass = 0.0", ["mass"], "mass = 0.0"),
    ("mass negative", "mass = 1.0", "mass = -1.0", ["mass"], "mass = -1.0"),
    ("mass not a number", "mass = 1.0", "mass = nan", ["mass", "finite"], "mass = nan"),
    ("stiffness infinite", "stiffness = 1.0", "stiffness = inf", ["stiffness", "finite"], "stiffness = inf"),
    ("mass of hundreds of digits", "mass = 1.0", f"mass = 1{'0' * 400}", ["mass", "finite"], "mass = 10000"),
    ("matrix of hundreds of digits", "mass = 1.0", f"mass = [[1{'0' * 400}]]", ["mass", "finite"], "mass = [["),
    ("mass next to nothing", "mass = 1.0", "mass = 1e-320", ["units"], None),
    ("system a text", DUFFING[DUFFING.index("[system]"):DUFFING.index("[[analyses]]")], 'system = "duffing"\n',
     ["system", "must be a table"], 'system = "duffing"'),
    ("mass a truth value", "mass = 1.0", "mass = true", ["mass"], "mass = true"),
    ("matrix not square", "mass = 1.0", "mass = [[1.0, 0.0]]", ["mass", "square"], "mass = [[1.0, 0.0]]"),
    ("rows of different lengths", "mass = 1.0", "mass = [[1.0, 0.0], [0.0]]", ["different lengths"], "mass = [["),
    ("sizes that differ", "stiffness = 1.0", "stiffness = [[1.0, 0.0], [0.0, 1.0]]", ["2 x 2"], "stiffness = [["),
    ("matrix a table", "mass = 1.0", "mass = {}", ["mass"], "mass = {}"),
    ("matrix file missing", "mass = 1.0", 'mass = { file = "M.npy" }', ["no file"], "mass = { file"),
    ("matrix file of another kind", "mass = 1.0", 'mass = { file = "M.xls" }', [".npy, .npz"], "mass = { file"),
    ("matrix key misspelt", "mass = 1.0", 'mass = { file = "M.npz", kee = "M" }', ["'key'"], "mass = { file"),
    ("malicious expression", 'damping = "c"', """damping = "__import__('os').system('touch stolen')" """,
     ["call of something else"], "damping ="),
    ("attribute in an expression", 'coefficient = "alpha"', 'coefficient = "alpha.__class__"', ["dot"], SPRING[:10]),
    ("huge power", 'damping = "c"', 'damping = "c**99999999999"', ["power", "1000"], "damping ="),
    ("tower of powers", 'damping = "c"', 'damping = "9**9**9**9"', ["power"], "damping ="),
    ("^ for a power", 'damping = "c"', 'damping = "c^2"', ["**"], "damping ="),
    ("unbalanced parenthesis", 'damping = "c"', 'damping = "2*(c"', ["cannot read"], "damping ="),
    ("function misspelt", 'damping = "c"', 'damping = "sqr(c)"', ["did you mean 'sqrt'"], "damping ="),
    ("omega in a matrix", 'damping = "c"', 'damping = "c*omega"', ["only loads"], "damping ="),
    ("unknown parameter in a matrix", 'damping = "c"', 'damping = "d*c"', ["unknown parameter 'd'"], "damping ="),
    ("unknown parameter in an element", '"alpha" }]', '"alpa" }]',
     ["'alpha' is given and used nowhere: one of the two is misspelt"], "elements ="),
    ("unused parameter", "c = 0.1,", "c = 0.1, unused = 2.0,", ["not used"], "parameters ="),
    ("parameter nan", "c = 0.1", "c = nan", ["finite"], "parameters ="),
    ("parameter a text", "c = 0.1", 'c = "0.1"', ["number"], "parameters ="),
    ("parameter with a name of ours", "c = 0.1,", "c = 0.1, sin = 1.0,", ["sin"], "parameters ="),
    ("expression without a value", 'damping = "c"', 'damping = "sqrt(-c)"', ["finite real number"], "damping ="),
    # ------------------------------------------------------------------------------------------- elements and loads
    ("element misspelt", "CubicSpring", "CubicSprng", ["did you mean 'CubicSpring'"], "elements ="),
    ("element without a type", 'type = "CubicSpring", ', "", ["no type"], "elements ="),
    ("argument misspelt", 'coefficient = "alpha"', 'coeficient = "alpha"', ["mean 'coefficient'"], "elements ="),
    ("argument missing", ', coefficient = "alpha" }', " }", ["needs coefficient"], "elements ="),
    ("DOF out of range", SPRING, SPRING.replace("dof = 0", "dof = 3"), ["dof 3 does not exist"], "elements ="),
    ("DOF negative", SPRING, SPRING.replace("dof = 0", "dof = -1"), ["negative"], "elements ="),
    ("DOF no whole number", SPRING, SPRING.replace("dof = 0", "dof = 0.5"), ["integer"], "elements ="),
    ("DOF with itself", SPRING, SPRING.replace("dof = 0", "dof = [0, 0]"), ["itself"], "elements ="),
    ("direction of a wrong length", SPRING, SPRING.replace("dof = 0", "direction = [1.0, 0.0]"), ["2 entries"], "elem"),
    ("direction zero", SPRING, SPRING.replace("dof = 0", "direction = [0.0]"), ["not all zero"], "elements ="),
    ("side misspelt", SPRING, '{ type = "ElasticStop", dof = 0, stiffness = "alpha", gap = 1.0, side = "rihgt" }',
     ["did you mean 'right'"], "elements ="),
    ("side left open", SPRING, '{ type = "ElasticStop", dof = 0, stiffness = "alpha", gap = "-alpha" }',
     ['side="left"', 'side="right"'], "elements ="),
    ("load misspelt", "HarmonicLoad", "HarmonicLod", ["did you mean 'HarmonicLoad'"], "loads ="),
    ("load DOF out of range", LOAD, LOAD.replace("dof = 0", "dof = 7"), ["dof 7"], "loads ="),
    ("load harmonic negative", LOAD, LOAD.replace(" }", ", harmonic = -1 }"), ["harmonic"], "loads ="),
    ("load harmonic a fraction", LOAD, LOAD.replace(" }", ", harmonic = 0.5 }"), ["harmonic"], "loads ="),
    ("no load", f"loads = [{LOAD}]", f"loads = [{LOAD.replace('dof = 0', 'dof = 0, harmonic = 0')}]",
     ["no periodic load"], "[[analyses]]"),
    ("load zero", "F = 0.3", "F = 0.0", ["load is zero"], "[[analyses]]"),
    ("own class without permission", "CubicSpring", "somewhere:Spring", ["--allow-code"], "elements ="),
    ("elements no tables", f"elements = [{SPRING}]", 'elements = ["CubicSpring"]', ["elements"], "elements ="),
    ("function without permission", "\nmax_step = 0.2", '\nevents = [{ name = "e", function = "os:getpid" }]',
     ["--allow-code"], "events ="),
    # ------------------------------------------------------------------------------------------------------ analyses
    ("type misspelt", '"frequency_response"', '"frequency_respnse"', ["did you mean 'frequency_response'"], "type ="),
    ("type missing", 'type = "frequency_response"\n', "", ["type", "missing"], "[[analyses]]"),
    ("argument of an analysis misspelt", "max_step = 0.2", "max_stp = 0.2", ["did you mean 'max_step'"], "max_stp"),
    ("omega missing", RESPONSE, "", ["omega", "missing"], "[[analyses]]"),
    ("range empty", RESPONSE, "omega = [1.0, 1.0]\n", ["two different"], "omega = [1.0"),
    ("range negative", RESPONSE, "omega = [-1.0, 1.0]\n", ["positive"], "omega = [-1"),
    ("range from zero", RESPONSE, "omega = [0.0, 1.0]\n", ["positive"], "omega = [0.0"),
    ("range of one number", RESPONSE, "omega = [1.0]\n", ["at least 2 items, not 1"], "omega = [1.0]"),
    ("range of three", RESPONSE, "omega = [1.0, 2.0, 3.0]\n", ["at most 2 items, not 3"], "omega = [1.0"),
    ("range no numbers", RESPONSE, 'omega = ["1", "2"]\n', ["number"], "omega ="),
    ("range nan", RESPONSE, "omega = [nan, 2.0]\n", ["finite"], "omega ="),
    ("range a number", RESPONSE, "omega = 2.0\n", ["list"], "omega ="),
    ("harmonics zero", RESPONSE, RESPONSE + "harmonics = 0\n", ["at least 1"], "harmonics ="),
    ("harmonics negative", RESPONSE, RESPONSE + "harmonics = -3\n", ["at least 1"], "harmonics ="),
    ("harmonics a fraction", RESPONSE, RESPONSE + "harmonics = 2.5\n", ["whole number"], "harmonics ="),
    ("harmonics a word", RESPONSE, RESPONSE + 'harmonics = "many"\n', ["adaptive"], "harmonics ="),
    ("harmonics by the million", RESPONSE, RESPONSE + "harmonics = 1000000000\n", ["too many"], "harmonics ="),
    ("harmonics option misspelt", RESPONSE, RESPONSE + "harmonics = { tolerence = 1e-4 }\n",
     ["did you mean 'tolerance'"], "harmonics ="),
    ("max_step zero", "max_step = 0.2", "max_step = 0.0", ["positive"], "max_step = 0.0"),
    ("max_step tiny", "max_step = 0.2", "max_step = 1e-9", ["smallest step"], "max_step = 1e-9"),
    ("observe out of range", RESPONSE, RESPONSE + "observe = 4\n", ["observe=4"], "observe = 4"),
    ("newton option misspelt", RESPONSE, RESPONSE + "newton = { iteratons = 9 }\n", ["did you mean"], "newton ="),
    ("newton out of range", RESPONSE, RESPONSE + "newton = { iterations = 0 }\n", ["NewtonOptions"], "newton ="),
    ("stepping of a wrong kind", RESPONSE, RESPONSE + 'stepping = { angle = "wide" }\n', ["default"], "stepping ="),
    ("stability misspelt", RESPONSE, RESPONSE + 'stability = "hil"\n', ["did you mean 'hill'"], "stability ="),
    ("formulation misspelt", RESPONSE, RESPONSE + 'formulation = "extendet"\n', ["mean 'extended'"], "formulation ="),
    (
        "test function misspelt",
        RESPONSE,
        RESPONSE + 'formulation = { name = "alcorta2019", test = "determinand" }\n',
        ["did you mean 'determinant'"],
        "formulation =",
    ),
    ("override unknown", RESPONSE, RESPONSE + "parameters = { alfa = 2.0 }\n", ["mean 'alpha'"], "parameters = { alfa"),
    ("name twice", 'name = "up"', 'name = "response"', ["two analyses"], 'name = "response"'),
    ("name with a slash", 'name = "up"', 'name = "../up"', ["slash"], 'name = "../up"'),
    ("start unknown", 'analysis = "response"', 'analysis = "respnse"', ["did you mean 'response'"], "start ="),
    ("start after", 'analysis = "response"', 'analysis = "up"', ["before this one"], "start ="),
    ("start from a kind unknown", 'bifurcation = "LP"', 'bifurcation = "FOLD"', ["no kind"], "start ="),
    ("start without an analysis", 'analysis = "response", ', "", ["analyses[1].start.analysis: is missing"], "start ="),
    ("start a number", 'start = { analysis = "response", bifurcation = "LP" }', "start = 3",
     ["a text, a table or a list"], "start = 3"),
    ("start misspelt", 'bifurcation = "LP"', 'bifurcaton = "LP"', ["did you mean 'bifurcation'"], "start ="),
    ("start of texts", 'start = { analysis = "response", bifurcation = "LP" }', 'start = [1.0, "b"]',
     ["1 mistake;", "start[1]: must be a number"], "start ="),
    ("start of a wrong kind", 'analysis = "response"', "analysis = 3", ["start.analysis: must be a text"], "start ="),
    ("name empty", 'name = "up"', 'name = ""', ["must not be empty"], 'name = ""'),
    ("start chosen twice", 'bifurcation = "LP"', 'bifurcation = "LP", point = 3', ["several"], "start ="),
    ("nearest of an unknown name", 'bifurcation = "LP"', "nearest = { omga = 1.0 }", ["mean 'omega'"], "start ="),
    ("parameter to vary unknown", 'parameter = "F"', 'parameter = "G"', ["unknown parameter 'G'"], 'parameter = "G"'),
    ("bounds empty", "bounds = [0.25, 0.4]", "bounds = [0.25, 0.25]", ["two different"], "bounds ="),
    ("no start and no omega", 'start = { analysis = "response", bifurcation = "LP" }\n', "", ["omega"], "[[analyses]]"),
    ("verify what", None, VERIFY + 'what = "point"\n', ["'points'"], 'what = "point"'),
    ("verify every", None, VERIFY + "every = 0\n", ["every"], "every = 0"),
    ("verify tolerance", None, VERIFY + "tolerance = 2.0\n", ["tolerance"], "tolerance = 2.0"),
    ("verify a table", None, VERIFY + VERIFY.replace('"w"', '"v"').replace('"response"', '"w"'), ["no branch"],
     'branch = "w"'),
    ("stability of nothing", None, STABILITY, ["choose motions"], "[[analyses]]"),
    ("stability method", None, STABILITY + 'points = [0]\nmethods = ["hil"]\n', ["did you mean 'hill'"], "methods ="),
    # ------------------------------------------------------------------------------------------------------- outputs
    ("figure of no known form", None, FIGURE.replace("a.png", "a.gif"), [".png"], 'file = "a.gif"'),
    ("figure elsewhere", None, FIGURE.replace("a.png", "../a.png"), ["inside the folder"], 'file = "../a.png"'),
    ("figure of an unknown analysis", None, FIGURE + 'analyses = ["respons"]\n', ["did you mean"], "analyses ="),
    ("figure over an unknown axis", None, FIGURE + 'x = "G"\n', ["neither omega"], 'x = "G"'),
    ("figure with too many labels", None, FIGURE + 'labels = ["a"]\n', ["1 labels for 2"], "labels ="),
    ("figure without a file", None, '\n[[outputs.figures]]\ntitle = "a"\n', ["file", "missing"], "[[outputs.figures]]"),
    ("figure too large", None, FIGURE + "size = [1e9, 4.0]\n", ["inches"], "size ="),
    ("figure of no known size", None, FIGURE + 'size = "singlecolumn"\n', ["did you mean 'single-column'"], "size ="),
    ("figure of no known quantity", None, FIGURE + 'quantity = "velocty"\n', ["did you mean 'velocity'"], "[[outputs"),
    ("figure of no element", None, FIGURE + 'quantity = "impacts"\n', ["give element="], "[[outputs"),
    ("figure of an element without gap", None, FIGURE + 'quantity = "impacts"\nelement = 0\n', ["no gap"], "element ="),
    ("figure of a missing DOF", None, FIGURE + "dof = 4\n", ["out of range"], "dof ="),
    ("figure in no known unit", None, FIGURE + 'frequency = "hz"\n', ["did you mean 'Hz'"], "[[outputs"),
    ("figure sized beyond numbers", None, FIGURE + f"size = [1{'0' * 400}, 1.0]\n", ["inches"], "size ="),
    ("figure with a name too long", None, FIGURE.replace("a.png", "a" * 300 + ".png"), ["too long"], 'file = "aaa'),
    ("figure with a name of no file", None, FIGURE.replace("a.png", "a\\u0000.png"), ["characters that no"], "file ="),
    ("folder of no name", None, '\n[outputs]\nfolder = "a\\u0000"\n', ["characters that no"], "folder ="),
    ("formula that cannot be drawn", None, FIGURE + "title = '$\\frac{a$'\n", ["cannot be drawn"], "title ="),
    ("analysis with a name too long", 'name = "up"', f'name = "{"u" * 300}"', ["at most 60"], 'name = "uuu'),
    ("figure twice", None, FIGURE + '[[outputs.figures]]\nfile = "a.png"\n', ["twice"], 'file = "a.png"'),
    ("figure of no known kind", None, FIGURE + 'kind = "phas"\n', ["did you mean 'phase'"], 'kind = "phas"'),
    ("figure of no motion", None, FIGURE + 'kind = "phase"\n', ["motions", "missing"], "[[outputs.figures]]"),
    ("figure of an empty list", None, PHASE.replace('["response"]', "[]"), ["at least 1"], "motions ="),
    ("motion of an unknown analysis", None, PHASE.replace('"response"', '"respons"'), ["did you mean"], "motions ="),
    ("motion chosen twice", None, PHASE.replace('["response"]', '[{ analysis = "up", point = 1, bifurcation = "LP" }]'),
     ["not by several"], "motions ="),
    ("misspelt key of a motion", None, PHASE.replace('["response"]', '[{ analysis = "up", pont = 1 }]'),
     ["did you mean 'point'"], "motions ="),
    ("motion of an unknown kind", None, PHASE.replace('["response"]', '[{ analysis = "up", bifurcation = "PDD" }]'),
     ["did you mean 'PD'"], "motions ="),
    ("misspelt key of a portrait", None, PHASE + "overlai = true\n", ["did you mean 'overlay'"], "overlai ="),
    ("key of another kind of figure", None, PHASE + 'quantity = "velocity"\n', ["no such key"], "quantity ="),
    ("portrait with too many labels", None, PHASE + 'labels = ["a", "b"]\n', ["2 labels for 1"], "labels ="),
    ("portrait in no known unit", None, PHASE + 'frequency = "hz"\n', ["did you mean 'Hz'"], "[[outputs"),
    ("portrait of a missing DOF", None, PHASE + "dof = 4\n", ["out of range"], "dof ="),
    ("portrait of no known size", None, PHASE + 'size = "singlecolumn"\n', ["did you mean"], "size ="),
    ("history of no element", None, HISTORY + 'quantity = "force"\n', ["give element="], "[[outputs"),
    ("history of a missing element", None, HISTORY + 'quantity = "force"\nelement = 3\n', ["range"], "element ="),
    ("spectrum up to nothing", None, PHASE.replace("phase", "spectrum") + "highest = 0.0\n", ["greater"], "highest ="),
    ("results of another form", None, '\n[outputs]\nresults = "a.csv"\n', [".nc"], "results ="),
    ("outputs misspelt", None, '\n[outputs]\nfoldr = "a"\n', ["did you mean 'folder'"], "foldr ="),
    ("tables of one name", None, '\n[[analyses]]\nname = "response_bifurcations"\ntype = "verify"\nbranch = "up"\n'
     "[outputs]\ncsv = true\n", ["same table"], "csv ="),
    ("csv no truth value", None, '\n[outputs]\ncsv = "yes"\n', ["csv", "boolean"], "csv ="),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "words", "line"), [row[1:] for row in ROWS], ids=[row[0] for row in ROWS])
def test_a_mistake_in_a_study_file(old, new, words, line, study_file, suboctave, tmp_path):
    if old is None:
        text = DUFFING + new
    else:
        assert old in DUFFING
        text = DUFFING.replace(old, new, 1)
    path = study_file(text)
    status, out, err = suboctave("run", path)
    assert status == 2, err
    assert not out
    for word in words:
        assert word in err, err
    if line is not None:
        lines = text.splitlines()
        told = [int(part.split(":")[0]) for part in err.split("line ")[1:] if part.split(":")[0].isdigit()]
        assert any(line in lines[number - 1] for number in told), (err, [lines[n - 1] for n in told])
    assert [p.name for p in tmp_path.iterdir()] == ["study.toml"]  # no folder, no journal, and nothing was executed
    assert path.read_text() == text
    status, out, _ = suboctave("check", path, "--json")
    assert status == 2
    said = json.loads(out)
    assert said["mistakes"]
    assert all(m["message"] for m in said["mistakes"])


def test_the_table_is_long_enough():
    assert len(ROWS) >= 60
    assert len({row[0] for row in ROWS}) == len(ROWS)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (TWO.replace("[0.0, 2.0]", "[0.5, 2.0]"), ["mass", "symmetric"]),
        (TWO.replace("[0.0, 2.0]", "[0.0, 0.0]"), ["mass"]),
        (TWO.replace("[0.0, 2.0]", "[0.0, -2.0]"), ["mass", "definite"]),
        (TWO.replace('damping = [["c", 0.0], [0.0, 0.1]]', 'damping = "c"'), ["damping", "single value"]),
        (TWO.replace("dof = 0, coefficient", "dof = [0, 2], coefficient"), ["dof 2 does not exist", "DOFs 0 to 1"]),
        (
            TWO.replace("stiffness = [[1.0", "stiffness = [[0.0").replace("dof = 0, coef", "dof = 1, coef"),
            ["move freely"],
        ),
    ],
    ids=["asymmetric mass", "singular mass", "indefinite mass", "damping a number", "pair out of range", "free body"],
)
def test_mistakes_of_several_dofs(text, words, study_file, suboctave):
    status, _, err = suboctave("check", study_file(text))
    assert status == 2
    for word in words:
        assert word in err, err


def test_mistakes_in_one_place_do_not_hide_others(study_file, suboctave):
    """An unused parameter, and a wrong key of an analysis, leave the rest of the file to be checked."""
    text = DUFFING.replace("F = 0.3 }", "F = 0.3, idle = 1.0 }").replace("title =", "title = ", 1)
    text = text.replace("max_step = 0.2", "max_step = 0.2\nharmonics = 0\nobserve = 3", 1)
    text = (
        text.replace("omega = [3.0, 0.5]", "omega = [3.0, 3.0]").replace('"LP"', '"TR"').replace("[0.25, 0.4]", "[0.2]")
    )
    text = text.replace('parameter = "F"', 'parameter = "idle"').replace(
        "mass = 1.0", 'mass = 1.0\nunits = "mm, N, kg"'
    )
    status, _, err = suboctave("check", study_file(text))
    assert status == 2
    for word in (
        "no unit of time", "'idle' not used", "a whole number of at least 1", "observe=3 is out of range",
        "two different finite ends", "'NS' is what it is called here", "at least 2 items, not 1",
    ):  # fmt: skip
        assert word in err, err
    assert "7 mistakes" in err


def test_of_what_a_value_may_be_the_nearest_is_told(study_file, suboctave):
    text = (
        DUFFING
        + """
[[analyses]]
name = "border"
type = "track"
start = { analysis = "response", bifurcation = "LP" }
parameter = "F"
bounds = [0.2]
"""
    )
    _, _, err = suboctave("check", study_file(text))
    assert "bounds: must have at least 2 items, not 1" in err
    assert "1 mistake;" in err
    _, _, err = suboctave("check", study_file(text.replace("[0.2]", "[[0.2, 0.4], [1.0]]")))
    assert "bounds[1]: must have at least 2 items, not 1" in err
    assert "1 mistake;" in err


def test_gyroscopic_and_circulatory_matrices_are_accepted(study_file, suboctave):
    text = TWO.replace('[["c", 0.0], [0.0, 0.1]]', '[["c", 0.3], [-0.3, 0.1]]').replace(
        "stiffness = [[1.0, 0.0], [0.0, 1.0]]", "stiffness = [[1.0, 0.1], [-0.1, 1.0]]"
    )
    status, _, err = suboctave("check", study_file(text))
    assert status == 0, err


def test_all_mistakes_are_told_at_once(study_file, suboctave):
    text = DUFFING.replace("mass = 1.0", "mass = nan").replace("CubicSpring", "CubicSprng")
    text = text.replace("max_step = 0.2", "max_stp = 0.2").replace("omega = [3.0, 0.5]", "omega = [3.0]")
    path = study_file(text + '\n[outputs]\nfoldr = "x"\n')
    status, out, _ = suboctave("check", path, "--json")
    assert status == 2
    lines = text.splitlines()
    told = {
        lines[m["line"] - 1].split(" ")[0] if m["line"] <= len(lines) else "foldr" for m in json.loads(out)["mistakes"]
    }
    assert told == {"mass", "elements", "max_stp", "omega", "foldr"}


def test_a_mistake_does_not_hide_those_beside_it(study_file, suboctave):
    text = (
        DUFFING.replace("c = 0.1", "c = nan")
        .replace('"alpha" }]', '"alpa" }]')
        .replace("mass", "misprint = 2\nmass", 1)
    )
    text = text.replace("omega = [3.0, 0.5]", "harmonics = -1\nnewton = { iteratons = 3 }")
    status, out, _ = suboctave("check", study_file(text), "--json")
    assert status == 2
    keys = {m["key"] for m in json.loads(out)["mistakes"]}
    assert {"system.parameters.c", "system.elements[0]", "system.misprint"} <= keys
    assert {"analyses[0].omega", "analyses[0].harmonics", "analyses[0].newton"} <= keys


def test_lines_are_right_in_arrays_of_tables_and_texts_of_several_lines(study_file, suboctave):
    text = """\
title = '''
[[analyses]]
name = "no analysis"
'''
system.mass = 1.0  # dotted, with a comment: = [ {
system . "damping" = 0.1
[system.parameters]
F = 1.0
[[system.loads]]
type = "HarmonicLoad"
amplitude = "F"
dof = 0
[[system.loads]]
type = "HarmonicLoad"
amplitude = "F"
dof = 5
[[analyses]]
type = "frequency_response"
omega = [
  1.0,
  nan,
]
[[analyses]]
name = "b"
type = "frequency_response"
omega = [1.0, 2.0]
start = { analysis = "frequency_response", "pont" = 3 }
"""
    status, out, _ = suboctave("check", study_file(text), "--json")
    told = {m["line"]: m["key"] for m in json.loads(out)["mistakes"]}
    assert status == 2
    assert told[16].startswith("system.loads[1]")
    assert told[21] == "analyses[0].omega[1]"
    assert told[27].startswith("analyses[1].start")
    assert any("system.stiffness" in key for key in told.values())
