"""What vibrates: `M x'' + C x' + K x + sum_e d_e f_e(d_e.x, d_e.x'; parameters) = p(t)`.

Structural (hysteretic) damping adds to every harmonic of a motion the force `i S x`, whatever its frequency.
"""

from __future__ import annotations

import functools
import keyword
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from suboctave.arguments import Rule, Title, checked
from suboctave.errors import InputError, Key, Refusals, is_number, located, printable, shortened, suggest
from suboctave.model.angles import Angle, Turns, check_angles, numbered, read_angles
from suboctave.model.description import Arrays, build_part, describe_part, from_plain, plain_value
from suboctave.model.elements.base import Array, BaseElement, with_numbers
from suboctave.model.elements.smoothness import CornerSampling, PiecewiseLinear, SharpVelocitySampling
from suboctave.model.expressions.coefficients import Coefficient
from suboctave.model.expressions.reader import RESERVED
from suboctave.model.loads import ROTATIONS, HarmonicLoad, Load, LoadComponent
from suboctave.model.matrices import MatrixCoefficient, check_damping, check_mass, matrix_coefficient, viscous_damping
from suboctave.model.modes import modes_of
from suboctave.units import UnitSystem

if TYPE_CHECKING:
    from suboctave.model.frequencies import NaturalFrequencies

AnElement = Annotated[BaseElement, Rule("an Element", lambda element: True)]
ALoad = Annotated[Load, Rule("a load", lambda load: True)]
_MATRICES = ("mass", "damping", "stiffness", "structural")
_PARTS = (*_MATRICES, "elements", "loads", "parameters", "name", "dof_names", "units", "angles")


@checked
class System:
    """Mass, damping, stiffness, elements, loads and named parameters. Immutable.

    `mass`, `damping`, `stiffness`: a number or an expression (one degree of freedom), nested lists or arrays (n, n) of
    numbers and expressions, sparse matrices, or `{expression: matrix}` for a sum; the mass symmetric positive definite
    at the parameters, the other two of any kind; damping also `Rayleigh` or `ModalDamping`. `elements`: a sequence of
    `Element`; their forces stand on the left-hand side (those that are integrated at nodes of their own come last).
    `loads`: a sequence of `HarmonicLoad` and other loads, on the right-hand side. `parameters`: `{name: number}`, every
    one of them used somewhere.
    `structural`: structural damping S, a force `i S x` at every frequency: like the other matrices, `{"eta": K}` for a
    loss factor. `dof_names`: by these elements and loads may say where they act, `dof="x"`. Units are the user's own,
    if they are consistent; frequencies are circular. `units`: their names, length, force (or mass) and time, such as
    `"mm, N, s"`, for axes and tables; nothing is converted. `angles`: degrees of freedom that mean the same position a
    whole turn further, by number or name, those that only turn together as a list; a mapping says the size of a turn,
    `{"x": "pi"}`, default 2 pi.

    Raises `InputError` for anything that does not fit, before any work.
    """

    mass: MatrixCoefficient
    damping: MatrixCoefficient
    stiffness: MatrixCoefficient
    structural: MatrixCoefficient
    elements: tuple[BaseElement, ...]
    loads: tuple[Load, ...]
    parameters: Mapping[str, float]
    name: str
    dof_names: tuple[str, ...]
    units: UnitSystem | None
    angles: tuple[Angle, ...]
    n: int
    _components: tuple[LoadComponent, ...]

    def __init__(
        self,
        mass: Any,
        damping: Any,
        stiffness: Any,
        elements: AnElement | Iterable[AnElement] = (),
        loads: ALoad | Iterable[ALoad] = (),
        parameters: Mapping[str, float] | None = None,
        name: Title = "",
        dof_names: Iterable[str] = (),
        structural: Any = None,
        units: str | None = None,
        angles: Any = (),
    ) -> None:
        read = matrix_coefficient(mass, None, "mass")
        names = _read_dof_names(dof_names, read.n)
        stiff = matrix_coefficient(stiffness, read.n, "stiffness")
        if hasattr(damping, "matrix"):
            damping = _made_of(damping, read, stiff)
        self._fill(
            check=True,
            mass=read,
            damping=matrix_coefficient(damping, read.n, "damping"),
            stiffness=stiff,
            structural=read.zeros("structural")
            if structural is None
            else matrix_coefficient(structural, read.n, "structural"),
            elements=sorted(_several(elements, BaseElement, "Element", "elements", names), key=lambda e: e.own_nodes),
            loads=_several(loads, Load, "HarmonicLoad", "loads", names),
            parameters=_read_parameters(parameters),
            name=printable(str(name)),
            dof_names=names,
            units=UnitSystem.of(units),
            angles=read_angles(angles, read.n, names),
        )
        for i, load in enumerate(self.loads):  # not of known systems, which are read from files
            with located("loads", i):
                load.check_names(self.dof_names)
        self._check_values(self.parameters)

    @classmethod
    def from_equations(
        cls,
        equations: str | Sequence[str],
        parameters: Mapping[str, float] | None = None,
        name: Title = "",
        units: str | None = None,
        angles: Any = None,
    ) -> System:
        """A system from equations of motion as text, such as `"x'' + 2*zeta*x' + x + a*x**3 = p*cos(omega*t)"`.

        What has a second derivative is a degree of freedom, in the order of appearance; accelerations enter with
        constant factors. Linear terms go to mass, damping and stiffness, `cos(k*omega*t + phase)` and `sin` (k an
        integer) to loads, constants to static loads, all others to elements: `Expression`, or `CubicSpring`,
        `PolynomialSpring`, `ElasticStop` where they are such. State times cosine is parametric excitation. Functions:
        those of coefficients, `sign`, `heaviside`, and `max` and `min` of two arguments. A text "angle x" beside the
        equations (or behind one and a semicolon), or `angles=["x"]`, declares an angle; "angle x: pi" the size of a
        turn.

        Raises `InputError` with the place in the text.
        """
        from suboctave.model.equations import declared_in, parts_of

        read = _read_parameters(parameters)
        equations, declared = declared_in(equations)
        if angles is not None and declared:
            raise InputError("angles are declared in the equations and by angles=: leave one of them out", ("angles",))
        parts = parts_of(equations, read)
        return cls(**parts, parameters=read, name=name, units=units, angles=declared if angles is None else angles)

    def _fill(self, check: bool, **parts: Any) -> None:
        """Take all parts; `check`: whether they fit each other, where no system has accepted them already."""
        refusals, components = Refusals(), []
        for i, load in enumerate(parts["loads"]):
            with refusals.at("loads", i):
                components += load.components(parts["mass"].n, tuple(parts[what] for what in _MATRICES))
        parts |= {kind: tuple(parts[kind]) for kind in ("elements", "loads")}
        parts |= {"n": parts["mass"].n, "parameters": MappingProxyType(dict(parts["parameters"]))}
        for field, value in {**parts, "_components": tuple(components)}.items():
            object.__setattr__(self, field, value)
        if check:
            self._check_parts(refusals)
        refusals.refuse()

    # ------------------------------------------------------------------------------------------------- parameters
    def with_parameters(self, changes: Mapping[str, float] | None = None, /, **more: float) -> System:
        """The same system with other values of some parameters; the sides of its stops stay as they are."""
        changed = self.read_values(changes) | self.read_values(more)
        result = self.moved_to(changed)
        result._check_values(changed)
        return result

    def read_values(self, values: Any) -> dict[str, float]:
        """Values of some of its parameters as floats, none for None; InputError for what is none."""
        if values is not None and not isinstance(values, Mapping):
            raise InputError(f"values of parameters are given as a mapping {{name: number}}, not {shortened(values)}")
        for name in values or ():
            self.check_parameter(name)
        return {name: _number(name, value) for name, value in (values or {}).items()}

    def moved_to(self, values: Mapping[str, float]) -> System:
        """As `with_parameters`, at values where a motion was solved: nothing is checked, or said, any more."""
        return self._changed(parameters={**self.parameters, **values})

    def with_units(self, units: str | None) -> System:
        """The same system with names of its units, such as `"mm, N, s"`; its numbers stay as they are."""
        return self._changed(units=UnitSystem.of(units))

    def with_angles(self, angles: Any) -> System:
        """The same system with these degrees of freedom as angles, as `angles` of `System`; none for an empty list."""
        result = self._changed(angles=read_angles(angles, self.n, self.dof_names))
        check_angles(result)
        return result

    @functools.cached_property
    def turns(self) -> Turns:
        """The turns of its angles, by which states are compared."""
        return Turns(np.array([angle.turn(self.n) for angle in self.angles]).reshape(-1, self.n))

    @functools.cached_property
    def rotations(self) -> frozenset[int]:
        """Degrees of freedom that are angles: those declared, and of structures the rotations, by names as "7 rx"."""
        named = (i for i, name in enumerate(self.dof_names) if name.split()[-1:] and name.split()[-1] in ROTATIONS)
        return frozenset([*named, *(dof for angle in self.angles for dof in angle.dofs)])

    def units_of(self, dof: int) -> UnitSystem | None:
        """The units of what is said of a degree of freedom: rad in the place of the length where it is an angle."""
        return self.units.angular if self.units is not None and dof in self.rotations else self.units

    def with_scaled_loads(self, name: str = "load_scale") -> System:
        """The same system whose oscillating loads are multiplied by a new parameter, 1 to begin with.

        Constant loads and parametric excitation by elements stay as they are. For sweeps of the level of excitation
        where loads have no common parameter.
        """
        if name in self.parameters:
            raise InputError(f"the system has a parameter {name!r} already: give the scale of the loads another name")
        loads = [
            HarmonicLoad(
                amplitude=f"{_name(name)}*({c.amplitude.text})" if c.harmonic else c.amplitude.text,
                harmonic=c.harmonic,
                phase=c.phase.text,
                direction=c.direction,
            )
            for c in self._components
        ]
        return self._changed(loads=tuple(loads), parameters={**self.parameters, name: 1.0})

    def _changed(self, **parts: Any) -> System:
        """A system with these parts in the place of its own."""
        return _assemble(**{field: getattr(self, field) for field in _PARTS} | parts)

    def check_parameter(self, name: str) -> None:
        """Raise `InputError`, with a suggestion, if there is no parameter of this name."""
        if not isinstance(name, str) or name not in self.parameters:
            has = suggest(str(name), self.parameters) or "; it has none"
            raise InputError(f"the system has no parameter {name!r}{has}")

    def expressions(self) -> Iterator[tuple[str, Coefficient, Key]]:
        """Every expression: where it stands, itself, and the key of the part of the system that it belongs to."""
        for matrix in self.linear_parts:
            for source in matrix.coefficients:
                yield matrix.what, source, (matrix.what,)
        for i, element in enumerate(self.elements):
            for what, source in zip(element.coefficient_names, element.coefficients, strict=True):
                yield f"{element.label}, {what}", source, ("elements", i)
        for i, load in enumerate(self.loads):
            for what, source in load.coefficients:
                yield f"{load.label}, {what}", source, ("loads", i)

    def _check_parts(self, refusals: Refusals) -> None:
        """Parts that do not fit each other: places that do not exist, names of no parameter."""
        for i, element in enumerate(self.elements):
            with refusals.at("elements", i):
                element.direction(self.n)
                element.inputs(self.n)
        for i, load in enumerate(self.loads):
            with refusals.at("loads", i):
                load.check_elements(self.n, self.elements)
        used: set[str] = set()
        unused = set(self.parameters).difference(*(source.names for _, source, _ in self.expressions()))
        for where, source, key in self.expressions():
            used |= source.names
            for name in sorted(source.names - {"omega"} if key[0] == "loads" else source.names):
                with refusals.at(*key):
                    if name == "omega":
                        raise InputError(f"{where}: 'omega' occurs in {source}; only loads may depend on the frequency")
                    if name not in self.parameters:
                        known = _meant(name, self.parameters, unused)
                        raise InputError(f"{where}: unknown parameter {name!r} in the expression {source}{known}")
        if not refusals.mistakes:
            for name in self.parameters:
                with refusals.at("parameters", name):
                    if name not in used:
                        raise InputError(f"parameter {name!r} not used in any expression; remove or use it")

    def _check_values(self, changed: Mapping[str, float]) -> None:
        """Refuse values at which an expression has no number or the mass is not a mass."""
        for where, source, key in self.expressions():
            if source.names and "omega" not in source.names:
                with located(*key, owner=where):
                    source.value(self.parameters)
        first = changed is self.parameters
        for i, element in enumerate(self.elements):
            with located("elements", i):
                element.check(self.parameters, first)
                kind = element.sampling(element.coefficient_values(self.parameters))
                if isinstance(kind, CornerSampling | SharpVelocitySampling) and not element.own_nodes:
                    what = f"a law with {type(kind).__name__} needs own_nodes = True in its class"
                    raise InputError(f"{element.label}: {what}")
                if isinstance(kind, PiecewiseLinear) and element.own_nodes:
                    raise InputError(f"{element.label}: a piecewise-linear law needs no nodes, own_nodes must be False")
        if first or self.mass.names.intersection(changed):
            mass = self.mass.compact(self.parameters)
            with located("mass"):
                check_mass(mass)
        if first:
            for matrix in (self.damping, self.structural):
                check_damping(matrix, self.parameters, mass.diagonal())
        if self.angles and (first or changed):
            with located("angles"):
                check_angles(self)

    # --------------------------------------------------------------------------------------------------- matrices
    @property
    def linear_parts(self) -> tuple[MatrixCoefficient, MatrixCoefficient, MatrixCoefficient, MatrixCoefficient]:
        """M, C, K and the structural damping S."""
        return self.mass, self.damping, self.stiffness, self.structural

    def viscous_equivalent(self) -> System:
        """The same system with viscous damping in the place of the structural one, at these parameters.

        A mode of the linear structure, of the natural frequency w, is damped as much at w: by half its loss factor. At
        other frequencies it is not, so that this is another system, but one that has an equation of motion in time.
        """
        if self.structural.zero:
            return self
        mass, _, stiffness = self.matrices()
        more = viscous_damping(mass, self.structural.value(self.parameters), modes_of(mass, stiffness))
        return self._changed(damping=self.damping.plus(more), structural=self.mass.zeros("structural"))._pruned()

    def without_excitation(self) -> System:
        """The same system under its constant loads alone, without the parameters that nothing else depends on."""
        constant = [
            HarmonicLoad(amplitude=c.amplitude.text, harmonic=0, phase=c.phase.text, direction=c.direction)
            for c in self._components
            if c.harmonic == 0
        ]
        return self._changed(loads=tuple(constant))._pruned()

    def undamped(self) -> System:
        """The same system without its damping matrices; elements stay as they are."""
        zeros = {name: self.mass.zeros(name) for name in ("damping", "structural")}
        return self._changed(**zeros)._pruned()

    def linear(self) -> System:
        """The same system without its elements, and without the parameters of these alone."""
        return self._changed(elements=())._pruned()

    def fed(self, rate: str) -> System:
        """The same system with the damping `C - rate M`, rate a new parameter, zero to begin with."""
        return self._changed(damping=self.damping.less(rate, self.mass), parameters={**self.parameters, rate: 0.0})

    def _pruned(self) -> System:
        """The same without parameters that nothing depends on."""
        used = {name for _, source, _ in self.expressions() for name in source.names}
        return self._changed(parameters={name: v for name, v in self.parameters.items() if name in used})

    def matrices(self, values: Mapping[str, float] | None = None) -> tuple[Array, Array, Array]:
        """`(M, C, K)` as dense arrays (n, n), at `values` (all parameters; default: the system's own)."""
        at = self.parameters if values is None else values
        return self.mass.value(at), self.damping.value(at), self.stiffness.value(at)

    def matrix_derivatives(
        self, *names: str, values: Mapping[str, float] | None = None
    ) -> tuple[Array | None, Array | None, Array | None]:
        """Derivatives of `(M, C, K)` by one parameter, or mixed ones by two; None where identically zero.

        The other arguments and the shapes are those of `matrices`.
        """
        if len(names) not in (1, 2):
            raise InputError(f"matrix_derivatives takes one or two names of parameters, got {len(names)}")
        matrices: list[MatrixCoefficient | None] = [self.mass, self.damping, self.stiffness]
        for name in names:
            if name != "omega":
                self.check_parameter(name)
            matrices = [matrix and matrix.derivative(name) for matrix in matrices]
        at = self.parameters if values is None else values
        mass, damping, stiffness = (None if matrix is None else matrix.value(at) for matrix in matrices)
        return mass, damping, stiffness

    def natural_frequencies(
        self, count: int = 10, *, about: Any = None, parameters: Mapping[str, float] | None = None, **more: float
    ) -> NaturalFrequencies:
        """Natural frequencies, damping ratios and mode shapes of small vibrations, the lowest `count`; print it.

        Elements have their slopes at rest, or at the displacements `about` (n,); `system.linear()` has none. Values of
        parameters that are given, `parameters={"k": 2.0}` or `k=2.0`, stand in for those of the system.
        """
        from suboctave.model.linearised import small_vibrations

        changed = self.read_values(parameters) | self.read_values(more)
        system = self.with_parameters(changed) if changed else self
        return small_vibrations(system, count, about, system.parameters)

    # ------------------------------------------------------------------------------------------------------ loads
    def load_components(self) -> tuple[LoadComponent, ...]:
        """Every cosine of every load; static parts are components of harmonic 0."""
        return self._components

    def force_time(self, t: ArrayLike, omega: float, values: Mapping[str, float] | None = None) -> Array:
        """The external force `p(t)`: (n,) for one instant, (n, len(t)) for several."""
        at = {**(self.parameters if values is None else values), "omega": float(omega)}
        times = np.asarray(t, dtype=float)
        force = np.zeros((self.n, *times.shape))
        for one in self._components:
            wave = np.cos(one.harmonic * omega * times + one.phase.value(at))
            force += np.multiply.outer(one.direction, one.amplitude.value(at) * wave)
        return force

    @property
    def excited_by_elements(self) -> bool:
        """Whether an element depends on time (parametric excitation)."""
        return any(element.depends_on_time for element in self.elements)

    @property
    def driven(self) -> bool:
        """Whether anything sets the frequency of its motions, at its parameters: a load that oscillates, or an element
        that depends on time.
        """
        at = {**self.parameters, "omega": 1.0}
        loaded = any(c.harmonic > 0 and c.amplitude.value(at) != 0.0 for c in self._components)
        return loaded or self.excited_by_elements

    @property
    def observed_dof(self) -> int:
        """The degree of freedom watched by default: where the first load acts most (a non-static one if any)."""
        acting = [c.direction for c in sorted(self._components, key=lambda c: c.harmonic == 0)]
        # without loads: what time acts on
        acting += [element.direction(self.n) for element in self.elements if element.depends_on_time]
        return int(np.argmax(np.abs(acting[0]))) if acting else 0

    # -------------------------------------------------------------------------------------------------- projection
    def reduced(self, states: Any) -> Array:
        """States (..., 2 n) of the structure as states of this system; other ones in `ProjectedSystem` only."""
        result: Array = np.asarray(states, dtype=float)
        return result

    def recovered(self, coordinates: Any) -> Any:
        """What `reduced` is the inverse of; displacements (..., n) too."""
        return coordinates

    # ------------------------------------------------------------------------------------------------------ object
    def __setattr__(self, name: str, value: Any = None) -> None:
        raise AttributeError("a System does not change; with_parameters() gives one with other parameters")

    __delattr__ = __setattr__

    def __reduce__(self) -> tuple[Any, ...]:
        parts = {field: getattr(self, field) for field in _PARTS} | {"parameters": dict(self.parameters)}
        return functools.partial(_assemble, **parts), ()

    def __repr__(self) -> str:
        from suboctave.model.display import system_text

        return system_text(self)

    def _repr_html_(self) -> str:
        from suboctave.model.display import system_html

        return system_html(self)


def _meant(name: str, known: Mapping[str, float], unused: set[str]) -> str:
    """The tail of a message on a name that is no parameter; where one like it is used nowhere, either is misspelt."""
    alike = suggest(name, unused)
    if "did you mean" in alike:
        given = alike.split("'")[1]
        return f"; {given!r} is given and used nowhere: one of the two is misspelt"
    return suggest(name, known) or "; no parameters are given"


def _assemble(check: bool = False, **parts: Any) -> System:
    """A system from all of its parts."""
    result = object.__new__(System)
    result._fill(check, **parts)
    return result


def _several(items: Any, kind: type, name: str, what: str, names: tuple[str, ...]) -> tuple[Any, ...]:
    items = (items,) if isinstance(items, kind) else items
    if not isinstance(items, Iterable):
        raise InputError(f"{what} must be a sequence of {name}, not {items!r}")
    for item in (listed := tuple(items)):
        if not isinstance(item, kind):
            raise InputError(f"{what} must hold objects of the kind {name}, not {item!r}")
    placed = []
    for i, item in enumerate(listed):
        with located(what, i, owner=type(item).__name__):
            placed.append(with_numbers(item, names))
    return tuple(placed)


def _read_dof_names(names: Iterable[str], n: int) -> tuple[str, ...]:
    read = tuple(str(name) for name in names)
    if len(set(read)) < len(read) or len(read) not in (0, n):
        raise InputError(f"dof_names must be {n} different names, or none, not {read!r}", ("dof_names",))
    return read


def _read_parameters(parameters: Mapping[str, float] | None) -> dict[str, float]:
    if parameters is not None and not isinstance(parameters, Mapping):
        raise InputError(f"parameters must be a mapping {{name: number}}, not {parameters!r}")
    read = {}
    for name, value in (parameters or {}).items():
        with located("parameters", name):
            read[_name(name)] = _number(name, value)
    return read


def _name(name: Any) -> str:
    if not isinstance(name, str) or not name.isidentifier() or keyword.iskeyword(name):
        raise InputError(
            f"{name!r} cannot name a parameter: letters, digits and underscores, not a word of Python"
            + (f"; for example {name + '_'!r}" if isinstance(name, str) and keyword.iskeyword(name) else "")
        )
    if name in RESERVED:
        raise InputError(f"{name!r} cannot name a parameter: it already has a meaning in expressions")
    plain = unicodedata.normalize("NFKC", name)
    if plain != name:  # Python reads names in this form, so an expression would never find it
        raise InputError(f"{name!r} cannot name a parameter; write it with plain letters: {plain!r}")
    return name


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not is_number(value):
        raise InputError(f"parameter {name!r} must be a finite number, not {shortened(value)}")
    return float(value)


def _made_of(damping: Any, mass: MatrixCoefficient, stiffness: MatrixCoefficient) -> Any:
    """The matrix of a damping that is said by mass and stiffness: `Rayleigh` or `ModalDamping`."""
    if names := sorted(mass.names | stiffness.names):
        raise InputError(
            f"{type(damping).__name__} needs a mass and a stiffness without parameters, but {', '.join(names)} "
            f"{'is' if len(names) == 1 else 'are'} in them: give the damping matrix, such as {{'alpha': mass}}"
        )
    made = damping.matrix(mass.sparse_value({}), stiffness.sparse_value({}))
    if mass.sparse or stiffness.sparse:
        return made
    if isinstance(made, Mapping):
        return {expression: matrix.toarray() for expression, matrix in made.items()}
    return made.toarray()


# ------------------------------------------------------------------------------------------------------- description
def describe(system: System, arrays: Arrays | None = None) -> dict[str, Any]:
    """The system as plain data; large arrays go into `arrays` under names of their own, if that is given.

    Raises InputError where an argument cannot be written down (a function without a name that can be imported).
    """
    return {
        "name": system.name,
        "dof_names": list(system.dof_names),
        **{what: _plain_matrix(getattr(system, what), arrays) for what in _MATRICES},
        "elements": [describe_part(element, arrays) for element in system.elements],
        "loads": [describe_part(load, arrays) for load in system.loads],
        "parameters": dict(system.parameters),
        **({"units": str(system.units)} if system.units else {}),
        **({"angles": [[list(one.dofs), list(one.periods)] for one in system.angles]} if system.angles else {}),
    }


def build(
    description: Mapping[str, Any], arrays: Mapping[str, np.ndarray] | None = None, allow_code: bool = False
) -> System:
    """The system of a description that `describe` made.

    Raises InputError where the description is not one, or names a class that is not known (see `allow_code` above).
    """
    try:
        parts: dict[str, Any] = {
            what: _read_matrix(description[what], what, arrays or {}) for what in _MATRICES if what in description
        }
        # files from before there was structural damping have none
        parts.setdefault("structural", parts["mass"].zeros("structural"))
        for family in ("element", "load"):
            items = description[f"{family}s"]
            parts[f"{family}s"] = [build_part(item, family, arrays or {}, allow_code) for item in items]
        parts |= {"parameters": _read_parameters(description["parameters"]), "name": str(description["name"])}
        parts["dof_names"] = _read_dof_names(description["dof_names"], parts["mass"].n)
        parts["units"] = UnitSystem.of(description.get("units"))
        parts["angles"] = numbered(description.get("angles", ()))
    except InputError:
        raise
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise InputError(f"this is not the description of a system: {type(error).__name__} {error}") from None
    if len({parts[what].n for what in _MATRICES}) > 1:
        raise InputError("this is not the description of a system: its matrices have different sizes")
    system = _assemble(check=True, **parts)
    system._check_values({})  # as for other parameters of a known system: the sides of its stops are as they are
    check_mass(system.mass.compact(system.parameters))
    return system


def _plain_matrix(matrix: MatrixCoefficient, arrays: Arrays | None) -> dict[str, Any]:
    return {
        "base": plain_value(matrix._base, arrays),
        "terms": [[plain_value(c), plain_value(pattern, arrays)] for c, pattern in matrix._terms],
    }


def _read_matrix(description: Mapping[str, Any], what: str, arrays: Mapping[str, np.ndarray]) -> MatrixCoefficient:
    base = from_plain(description["base"], arrays)
    terms = [(from_plain(c, arrays), from_plain(pattern, arrays)) for c, pattern in description["terms"]]
    shapes = {matrix.shape for matrix in (base, *(pattern for _, pattern in terms))}
    if len(shapes) != 1 or len(base.shape) != 2 or base.shape[0] != base.shape[1]:
        raise InputError(f"this is not the description of a system: {what} has shapes {sorted(shapes)}")
    if isinstance(base, np.ndarray):
        base.setflags(write=False)
    return MatrixCoefficient(base, terms, what)
