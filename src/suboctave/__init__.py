"""Vibrating structures with nonlinear parts, in the frequency domain.

How does the structure respond, which of those responses are stable, where does the response double its period, split,
jump or go quasi-periodic? The method is harmonic balance with numerical continuation.

    import suboctave as so

    system = so.library.reference_oscillator(p=0.55, j=0.0)
    curve = so.frequency_response(system, omega=(4.5, 1.3))
    print(curve.bifurcations)

The names below are loaded when they are first used, so that importing the package costs next to nothing.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING

from suboctave.version import __version__

if TYPE_CHECKING:
    from suboctave.analysis import (
        Attractor,
        Basins,
        BifurcationDiagram,
        Branch,
        BruteForceDiagram,
        Isola,
        IsolaMap,
        Isolas,
        LyapunovExponents,
        LyapunovMap,
        Measured,
        PoincareSections,
        RegimeMap,
        Results,
        Seeds,
        Separation,
        SteppedSine,
        Trajectory,
        TwoTrajectories,
        basins,
        bifurcation_diagram,
        brute_force_diagram,
        continue_branch,
        find_isolas,
        find_subharmonics,
        frequency_response,
        integrate,
        isola_map,
        load,
        locate_extremum,
        lyapunov_exponents,
        lyapunov_map,
        periodic_orbit,
        poincare_sections,
        read_measured,
        regime_map,
        stability,
        stepped_sine,
        switch_branch,
        track,
        verify,
    )
    from suboctave.bifurcation import Alcorta2019, Bifurcation, BorderedSystem, ExtendedSystem
    from suboctave.continuation import Event, NewtonOptions, SteppingOptions
    from suboctave.errors import ConvergenceError, InputError, NegativeDampingWarning, SuboctaveError, TimeLimitError
    from suboctave.harmonic import AdaptiveHarmonics, HarmonicBalance, HarmonicBasis, PeriodicOrbit
    from suboctave.model import (
        BaseAcceleration,
        BaseDisplacement,
        Callable,
        Clearance,
        CoupledElement,
        CubicSpring,
        ElasticStop,
        Element,
        Expression,
        Freeplay,
        Gravity,
        HarmonicLoad,
        PolynomialSpring,
        QuadraticDamper,
        RotatingUnbalance,
        StaticLoad,
        System,
        TanhFriction,
        check_derivatives,
        library,
    )
    from suboctave.pictures import plot, plot_history, plot_phase, plot_space, plot_spectrum, write_report
    from suboctave.stability import Arbitration, Hill, KoopmanHill, Monodromy

# Public name -> the module that defines it. A new public name is one entry here and one import above.
_HOME = {
    "System": "suboctave.model",
    "CubicSpring": "suboctave.model",
    "PolynomialSpring": "suboctave.model",
    "ElasticStop": "suboctave.model",
    "Element": "suboctave.model",
    "HarmonicLoad": "suboctave.model",
    "BaseAcceleration": "suboctave.model",
    "BaseDisplacement": "suboctave.model",
    "Callable": "suboctave.model",
    "Clearance": "suboctave.model",
    "CoupledElement": "suboctave.model",
    "Expression": "suboctave.model",
    "Freeplay": "suboctave.model",
    "Gravity": "suboctave.model",
    "QuadraticDamper": "suboctave.model",
    "RotatingUnbalance": "suboctave.model",
    "StaticLoad": "suboctave.model",
    "TanhFriction": "suboctave.model",
    "check_derivatives": "suboctave.model",
    "library": "suboctave.model.library",
    "HarmonicBasis": "suboctave.harmonic",
    "HarmonicBalance": "suboctave.harmonic",
    "AdaptiveHarmonics": "suboctave.harmonic",
    "PeriodicOrbit": "suboctave.harmonic",
    "NewtonOptions": "suboctave.continuation",
    "SteppingOptions": "suboctave.continuation",
    "Event": "suboctave.continuation",
    "Bifurcation": "suboctave.bifurcation",
    "BifurcationDiagram": "suboctave.analysis",
    "BorderedSystem": "suboctave.bifurcation",
    "ExtendedSystem": "suboctave.bifurcation",
    "Alcorta2019": "suboctave.bifurcation",
    "Branch": "suboctave.analysis",
    "bifurcation_diagram": "suboctave.analysis",
    "find_isolas": "suboctave.analysis",
    "find_subharmonics": "suboctave.analysis",
    "Isola": "suboctave.analysis",
    "IsolaMap": "suboctave.analysis",
    "isola_map": "suboctave.analysis",
    "Isolas": "suboctave.analysis",
    "frequency_response": "suboctave.analysis",
    "periodic_orbit": "suboctave.analysis",
    "Seeds": "suboctave.analysis",
    "continue_branch": "suboctave.analysis",
    "stability": "suboctave.analysis",
    "switch_branch": "suboctave.analysis",
    "Arbitration": "suboctave.stability",
    "Monodromy": "suboctave.stability",
    "Hill": "suboctave.stability",
    "KoopmanHill": "suboctave.stability",
    "track": "suboctave.analysis",
    "locate_extremum": "suboctave.analysis",
    "verify": "suboctave.analysis",
    "load": "suboctave.analysis",
    "integrate": "suboctave.analysis",
    "poincare_sections": "suboctave.analysis",
    "brute_force_diagram": "suboctave.analysis",
    "Basins": "suboctave.analysis",
    "basins": "suboctave.analysis",
    "LyapunovExponents": "suboctave.analysis",
    "lyapunov_exponents": "suboctave.analysis",
    "LyapunovMap": "suboctave.analysis",
    "lyapunov_map": "suboctave.analysis",
    "Separation": "suboctave.analysis",
    "TwoTrajectories": "suboctave.analysis",
    "stepped_sine": "suboctave.analysis",
    "SteppedSine": "suboctave.analysis",
    "read_measured": "suboctave.analysis",
    "Measured": "suboctave.analysis",
    "Attractor": "suboctave.analysis",
    "BruteForceDiagram": "suboctave.analysis",
    "PoincareSections": "suboctave.analysis",
    "Trajectory": "suboctave.analysis",
    "Results": "suboctave.analysis",
    "RegimeMap": "suboctave.analysis",
    "regime_map": "suboctave.analysis",
    "plot": "suboctave.pictures",
    "plot_history": "suboctave.pictures",
    "plot_phase": "suboctave.pictures",
    "plot_space": "suboctave.pictures",
    "plot_spectrum": "suboctave.pictures",
    "write_report": "suboctave.pictures",
    "SuboctaveError": "suboctave.errors",
    "InputError": "suboctave.errors",
    "NegativeDampingWarning": "suboctave.errors",
    "ConvergenceError": "suboctave.errors",
    "TimeLimitError": "suboctave.errors",
}

__all__ = [
    "AdaptiveHarmonics",
    "Alcorta2019",
    "Arbitration",
    "Attractor",
    "BaseAcceleration",
    "BaseDisplacement",
    "Basins",
    "Bifurcation",
    "BifurcationDiagram",
    "BorderedSystem",
    "Branch",
    "BruteForceDiagram",
    "Callable",
    "Clearance",
    "ConvergenceError",
    "CoupledElement",
    "CubicSpring",
    "ElasticStop",
    "Element",
    "Event",
    "Expression",
    "ExtendedSystem",
    "Freeplay",
    "Gravity",
    "HarmonicBalance",
    "HarmonicBasis",
    "HarmonicLoad",
    "Hill",
    "InputError",
    "Isola",
    "IsolaMap",
    "Isolas",
    "KoopmanHill",
    "LyapunovExponents",
    "LyapunovMap",
    "Measured",
    "Monodromy",
    "NegativeDampingWarning",
    "NewtonOptions",
    "PeriodicOrbit",
    "PoincareSections",
    "PolynomialSpring",
    "QuadraticDamper",
    "RegimeMap",
    "Results",
    "RotatingUnbalance",
    "Seeds",
    "Separation",
    "StaticLoad",
    "SteppedSine",
    "SteppingOptions",
    "SuboctaveError",
    "System",
    "TanhFriction",
    "TimeLimitError",
    "Trajectory",
    "TwoTrajectories",
    "__version__",
    "basins",
    "bifurcation_diagram",
    "brute_force_diagram",
    "check_derivatives",
    "continue_branch",
    "find_isolas",
    "find_subharmonics",
    "frequency_response",
    "integrate",
    "isola_map",
    "library",
    "load",
    "locate_extremum",
    "lyapunov_exponents",
    "lyapunov_map",
    "periodic_orbit",
    "plot",
    "plot_history",
    "plot_phase",
    "plot_space",
    "plot_spectrum",
    "poincare_sections",
    "read_measured",
    "regime_map",
    "stability",
    "stepped_sine",
    "switch_branch",
    "track",
    "verify",
    "write_report",
]


def __getattr__(name: str) -> object:
    home = _HOME.get(name)
    if home is None:
        if name.startswith("_"):  # protocol probes of notebooks, copy, pickle: no search for a suggestion
            raise AttributeError(f"module 'suboctave' has no attribute {name!r}")
        from suboctave.errors import suggest

        raise AttributeError(f"suboctave has no {name!r}{suggest(name, __all__)}")
    module = importlib.import_module(home)
    value = module if home.endswith(f".{name}") else getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})


class _Package(ModuleType):
    """Keeps a public verb when a room of the same name is imported.

    Python hangs every imported submodule on its package. `suboctave.stability` is a verb first: without this, the
    verb would turn into the room as soon as anything imports from it. `from suboctave.stability import ...` is
    unaffected.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if isinstance(value, ModuleType) and _HOME.get(name, f"suboctave.{name}") != value.__name__:
            return
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
