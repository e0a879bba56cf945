"""Structures in study files: read from files, places by labels, the same as a script; mistakes with their lines."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.study.file import read_study

STUDY = """
title = "frame"
[system]
structure = "frame.npz"
parameters = { k = 5.0 }
elements = [
    { type = "ElasticStop", dof = ["1042 z", "node 7 z"], stiffness = "k", gap = 0.4 },
]
loads = [
    { type = "HarmonicLoad", dof = "1042 z", amplitude = 0.2 },
    { type = "StaticLoad", direction = { "7 x" = 1.0, "1042 z" = -0.5 }, force = 0.1 },
]

[[analyses]]
name = "response"
type = "frequency_response"
omega = [0.8, 0.7]
harmonics = 5
"""

LABELS = [(1042, "x"), (1042, "z"), (7, "x"), (7, "z")]
STIFFNESS = np.kron([[2.0, -1.0], [-1.0, 2.0]], np.diag([1.0, 4.0]))


@pytest.fixture
def frame(tmp_path) -> so.Structure:
    structure = so.Structure(np.eye(4), STIFFNESS, so.Rayleigh(0.1, 0.01), LABELS, name="frame")
    structure.save(tmp_path / "frame.npz")
    return structure


def test_a_study_finds_places_by_their_labels(study_file, frame):
    system = read_study(study_file(STUDY)).system
    script = frame.system(
        elements=[so.ElasticStop(dof=(frame.dof(1042, "z"), frame.dof(7, "z")), stiffness="k", gap=0.4)],
        loads=[
            so.HarmonicLoad(dof=frame.dof("1042 z"), amplitude=0.2),
            so.StaticLoad(direction=frame.direction({(7, "x"): 1.0, (1042, "z"): -0.5}), force=0.1),
        ],
        parameters={"k": 5.0},
    )
    assert repr(system) == repr(script)
    for ours, theirs in zip(system.matrices(), script.matrices(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_a_direction_alone_is_one_of_all_its_places(study_file, frame):
    system = read_study(study_file(STUDY.replace('{ "7 x" = 1.0, "1042 z" = -0.5 }', '"x"'))).system
    np.testing.assert_array_equal(system.loads[1].place.direction(system.n), frame.direction("x"))


def test_a_study_of_a_structure_runs(study_file, frame, suboctave):
    status, out, err = suboctave("run", study_file(STUDY))
    assert status == 0, err
    assert "response" in out


@pytest.mark.parametrize(
    ("table", "damping"),
    [
        ('{ file = "frame.npz", damping = { rayleigh = [0.0, "k"] } }', lambda m, k: 5.0 * k),
        ('{ file = "frame.npz", damping = { ratios = [[1.0, 0.1], [2.0, 0.2]] } }', lambda m, k: 0.2 * k),
        ('{ file = "frame.npz", mass = "mass", damping = "stiffness" }', lambda m, k: k),
        ('{ mass = "m.npy", stiffness = "k.npy", damping = "k.npy", dofs = "labels.txt" }', lambda m, k: k),
        (
            '{ mass = "m.npy", stiffness = "k.npy", dofs = [[1042, "x"], [1042, 3], [7, 1], [7, 3]] }',
            lambda m, k: 0 * k,
        ),
    ],
)
def test_tables_of_structures(table, damping, study_file, frame, tmp_path):
    np.save(tmp_path / "m.npy", frame.mass.toarray())
    np.save(tmp_path / "k.npy", frame.stiffness.toarray())
    (tmp_path / "labels.txt").write_text("".join(f"{node} {direction}\n" for node, direction in LABELS))
    m, c, k = read_study(study_file(STUDY.replace('"frame.npz"', table))).system.matrices()
    np.testing.assert_allclose(c, damping(m, k), atol=1e-15)


@pytest.mark.parametrize(
    ("table", "losses"),
    [
        ('{ file = "frame.npz", structural = { loss_factor = 0.03 } }', lambda k: 0.03 * k),
        ('{ file = "frame.npz", structural = { loss_factor = "2*k" } }', lambda k: 10.0 * k),
        ('{ mass = "m.npy", stiffness = "k.npy", structural = "s.npy", dofs = "labels.txt" }', np.abs),
        ('{ file = "k4.npz" }', np.abs),
        ('{ file = "frame.npz" }', np.zeros_like),
    ],
)
def test_structural_damping_in_tables(table, losses, study_file, frame, tmp_path):
    for name, matrix in (("m", frame.mass), ("k", frame.stiffness), ("s", abs(frame.stiffness))):
        np.save(tmp_path / f"{name}.npy", matrix.toarray())
    nodes, directions = (np.array([str(label[i]) for label in LABELS]) for i in (0, 1))
    np.savez(
        tmp_path / "k4.npz", MGG=frame.mass.toarray(), KGG=frame.stiffness.toarray(), dof_nodes=nodes,
        K4GG=abs(frame.stiffness).toarray(), dof_directions=directions,
    )  # fmt: skip
    (tmp_path / "labels.txt").write_text("".join(f"{node} {direction}\n" for node, direction in LABELS))
    system = read_study(study_file(STUDY.replace('"frame.npz"', table))).system
    k = system.matrices()[2]
    np.testing.assert_allclose(system.structural.value(system.parameters), losses(k), atol=1e-15)


def test_what_is_computed_is_said_before_the_first_analysis(study_file, frame, suboctave):
    _, out, _ = suboctave("run", study_file(STUDY))
    assert out.index("frame") < out.index("4 degrees of freedom") < out.index("response")
    assert "natural frequencies 1, 1.73205, 2, 3.4641 rad per unit time" in out


def test_harmonics_are_counted_by_what_is_unknown(study_file, tmp_path):
    n = 1200
    structure = so.Structure(np.eye(n), np.diag(np.linspace(1.0, 5.0, n)), so.Rayleigh(0.1, 0.0))
    structure.save(tmp_path / "frame.npz")
    text = STUDY.replace('["1042 z", "node 7 z"]', "[0, 1]").replace('"1042 z", amplitude', "3, amplitude")
    text = text.replace('    { type = "StaticLoad", direction = { "7 x" = 1.0, "1042 z" = -0.5 }, force = 0.1 },\n', "")
    assert read_study(study_file(text)).system.n == n


def test_modal_damping_and_fixed_dofs(study_file, frame):
    table = '{ file = "frame.npz", fixed = ["7 x"], damping = { modal = [0.02, 0.02, 0.02] } }'
    text = STUDY.replace('"frame.npz"', table).replace('"7 x" = 1.0, ', "")
    system = read_study(study_file(text)).system
    assert system.dof_names == ("1042 x", "1042 z", "7 z")
    found = frame.fixed([(7, "x")]).natural_frequencies()
    ratios = np.diag(found.modes.T @ system.matrices()[1] @ found.modes) / (2 * found.omega)
    np.testing.assert_allclose(ratios, 0.02)


@pytest.mark.parametrize(
    ("old", "new", "words", "line"),
    [
        ('"frame.npz"', '"fram.npz"', ["no file", "did you mean 'frame.npz'"], "structure ="),
        ('"frame.npz"', '{ file = "frame.npz", fixd = [] }', ["did you mean 'fixed'"], "structure ="),
        ('"frame.npz"', '{ file = "frame.npz", fixed = ["8 x"] }', ["there is no node 8", "nearest: 7"], "structure ="),
        (
            '"frame.npz"',
            '{ file = "frame.npz", fixed = ["1042 z"] }',
            ["1042 z is fixed"],
            '    { type = "ElasticStop"',
        ),
        ('"frame.npz"', '{ file = "frame.npz", damping = { rayleih = [1, 2] } }', ["'rayleigh'"], "structure ="),
        ('"frame.npz"', '{ file = "frame.npz", damping = { rayleigh = 1 } }', ["a list of two"], "structure ="),
        ('"frame.npz"', '{ file = "frame.npz", damping = { modal = -1 } }', ["damping ratios"], "structure ="),
        (
            '"frame.npz"',
            '{ file = "frame.npz", damping = { modal = 0.1, count = 0 } }',
            ["count must be"],
            "structure =",
        ),
        (
            '"frame.npz"',
            '{ file = "frame.npz", damping = { modal = 0.1, cont = 2 } }',
            ["mean 'count'?"],
            "structure =",
        ),
        ('"frame.npz"', '{ file = "frame.npz", damping = 0.1 }', ["a text or a table"], "structure ="),
        ('"frame.npz"', '{ file = "frame.npz", structural = 0.1 }', ["loss_factor"], "structure ="),
        ('"frame.npz"', '{ file = "frame.npz", structural = { eta = 0.1 } }', ["loss_factor"], "structure ="),
        ('"frame.npz"', '{ file = "frame.npz", mass = "MGG" }', ["no matrix 'MGG'"], "structure ="),
        ('"frame.npz"', '{ file = "frame.npz", mass = 3 }', ["mass is a text"], "structure ="),
        ('"frame.npz"', "3", ["the name of a file, or a table"], "structure ="),
        ('"frame.npz"', '{ mass = "frame.npz" }', ["stiffness is missing"], "structure ="),
        ('"frame.npz"', '{ file = "frame.npz", dofs = [[1, "x"]] }', ["1 labels, the matrices 4 DOFs"], "structure ="),
        ('"frame.npz"', '"frame.npz"\nmass = 1.0', ["not several"], "[system]"),
        ('"frame.npz"', '"frame.npz"\ndof_names = ["a", "b", "c", "d"]', ["leave it out"], "dof_names ="),
        ('dof = "1042 z"', 'dof = "1024 z"', ["no node 1024", "1042"], '    { type = "HarmonicLoad"'),
        ('dof = "1042 z"', 'dof = "1042 y"', ["it has x, z"], '    { type = "HarmonicLoad"'),
        ('"node 7 z"', '"node 7"', ["write node and direction"], '    { type = "ElasticStop"'),
        ('{ "7 x" = 1.0, "1042 z" = -0.5 }', '"y"', ["no DOF has the direction 'y'"], '    { type = "StaticLoad"'),
        ('{ "7 x" = 1.0,', '{ "7 rx" = 1.0,', ["node 7 has no direction 'rx'"], '    { type = "StaticLoad"'),
        ('{ "7 x" = 1.0,', '{ "7 x" = "a",', ["must be a finite number"], '    { type = "StaticLoad"'),
    ],
)
def test_mistakes_with_structures(old, new, words, line, study_file, frame, suboctave):
    text = STUDY.replace(old, new, 1)
    assert text != STUDY
    with pytest.raises(so.InputError) as caught:
        read_study(study_file(text))
    message = str(caught.value)
    for word in words:
        assert word in message
    number = next(i for i, one in enumerate(text.splitlines(), 1) if one.startswith(line))
    assert f"line {number}:" in message


def test_names_of_an_ordinary_system_are_places_too(study_file):
    text = STUDY.replace(
        'structure = "frame.npz"',
        "mass = [[1.0, 0.0], [0.0, 1.0]]\ndamping = [[0.1, 0.0], [0.0, 0.1]]\nstiffness = [[2.0, -1.0], [-1.0, 2.0]]\n"
        'dof_names = ["tip", "base"]',
    )
    text = text.replace('["1042 z", "node 7 z"]', '["tip", "base"]').replace('"1042 z"', '"tip"').replace("7 x", "base")
    system = read_study(study_file(text)).system
    np.testing.assert_array_equal(system.elements[0].direction(2), [1, -1])
    np.testing.assert_array_equal(system.loads[1].place.direction(2), [-0.5, 1.0])
    with pytest.raises(so.InputError, match=r"there is no DOF 'tp' \(did you mean 'tip'\?\)"):
        read_study(study_file(text.replace('dof = "tip"', 'dof = "tp"')))


BEAM = """
[system]
structure = { source = "beam", length = 0.7, width = 0.014, height = 0.014, young = 2.05e11, density = 7800.0, \
elements = 3, damping = { rayleigh = [3.0, "beta"] } }
parameters = { beta = 1e-6, gap = 1e-3 }
elements = [{ type = "ElasticStop", dof = "3 z", stiffness = 1e5, gap = "gap" }]
loads = [{ type = "HarmonicLoad", dof = "3 z", amplitude = 0.2 }]

[[analyses]]
name = "response"
type = "frequency_response"
omega = [100.0, 105.0]
"""


def test_a_beam_needs_no_file(study_file):
    from suboctave.structures import beam

    structure = beam(0.7, 0.014, 0.014, 2.05e11, 7800.0, 3)
    script = structure.system(
        [so.ElasticStop(dof=structure.dof(3, "z"), stiffness=1e5, gap="gap")],
        [so.HarmonicLoad(dof=structure.dof(3, "z"), amplitude=0.2)],
        {"beta": 1e-6, "gap": 1e-3},
        so.Rayleigh(3.0, "beta"),
    )
    system = read_study(study_file(BEAM)).system
    assert repr(system) == repr(script)
    for ours, theirs in zip(system.matrices(), script.matrices(), strict=True):
        np.testing.assert_array_equal(ours, theirs)


def test_modal_damping_of_the_first_modes(study_file):
    from suboctave.structures import beam

    text = BEAM.replace('rayleigh = [3.0, "beta"]', "modal = 0.02, count = 2").replace("beta = 1e-6, ", "")
    structure = beam(0.7, 0.014, 0.014, 2.05e11, 7800.0, 3).with_damping(so.ModalDamping(0.02, 2))
    ours, theirs = (system.damping.value({}) for system in (read_study(study_file(text)).system, structure.system()))
    np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ('"beam"', '"beem"', "line 3: system.structure.source: there is no source 'beem' (did you mean 'beam'?)"),
        ("width", "with", "a beam has no argument 'with' (did you mean 'width'?)"),
        ("length = 0.7, ", "", "a beam needs length"),
        ("height = 0.014", "height = -1.0", "height=-1.0: must be above 0"),
        ("rayleigh = [3.0", "rayleih = [3.0", "did you mean 'rayleigh'?"),
        ('damping = { rayleigh = [3.0, "beta"] }', "damping = 3.0", "damping is one of rayleigh"),
    ],
)
def test_mistakes_of_sources(study_file, suboctave, old, new, text):
    status, _, err = suboctave("check", study_file(BEAM.replace(old, new)))
    assert status == 2
    assert text in err
