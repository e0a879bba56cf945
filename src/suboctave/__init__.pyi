"""The public names and where they are defined; read by type checkers and, lazily, by `__init__.py`."""

from . import results as results, structures as structures
from .analysis.branches import (
    continue_branch as continue_branch,
    frequency_response as frequency_response,
    switch_branch as switch_branch,
)
from .analysis.diagram import bifurcation_diagram as bifurcation_diagram
from .analysis.equilibria import equilibria as equilibria
from .analysis.limit_cycles import limit_cycles as limit_cycles
from .analysis.locate_extremum import locate_extremum as locate_extremum
from .analysis.nonlinear_mode import nonlinear_mode as nonlinear_mode
from .analysis.phase_resonance import phase_resonance as phase_resonance
from .analysis.sensitivity import Sensitivity as Sensitivity, sensitivity as sensitivity
from .analysis.subharmonics import (
    Seeds as Seeds,
    find_subharmonics as find_subharmonics,
    periodic_orbit as periodic_orbit,
)
from .analysis.track import track as track
from .analysis.track_peak import track_peak as track_peak
from .bifurcation.bifurcation import Bifurcation as Bifurcation
from .continuation import Event as Event, NewtonOptions as NewtonOptions, SteppingOptions as SteppingOptions
from .curves.events.formulation import (
    Alcorta2019 as Alcorta2019,
    BorderedSystem as BorderedSystem,
    ExtendedSystem as ExtendedSystem,
)
from .errors import (
    ConvergenceError as ConvergenceError,
    FunctionError as FunctionError,
    InputError as InputError,
    NegativeDampingWarning as NegativeDampingWarning,
    SuboctaveError as SuboctaveError,
    TimeLimitError as TimeLimitError,
)
from .experiments.basins import Basins as Basins, basins as basins
from .experiments.brute_force import BruteForceDiagram as BruteForceDiagram, brute_force_diagram as brute_force_diagram
from .experiments.lyapunov import (
    LyapunovExponents as LyapunovExponents,
    Separation as Separation,
    TwoTrajectories as TwoTrajectories,
    lyapunov_exponents as lyapunov_exponents,
)
from .experiments.lyapunov_map import LyapunovMap as LyapunovMap, lyapunov_map as lyapunov_map
from .experiments.measured import Measured as Measured, read_measured as read_measured
from .experiments.poincare import (
    Attractor as Attractor,
    PoincareSections as PoincareSections,
    poincare_sections as poincare_sections,
)
from .experiments.stepped_sine import SteppedSine as SteppedSine, stepped_sine as stepped_sine
from .experiments.trajectories import Trajectory as Trajectory, integrate as integrate
from .floquet.methods import (
    Arbitration as Arbitration,
    Hill as Hill,
    Monodromy as Monodromy,
)
from .harmonic import (
    AdaptiveHarmonics as AdaptiveHarmonics,
    HarmonicBalance as HarmonicBalance,
    HarmonicBasis as HarmonicBasis,
    PeriodicOrbit as PeriodicOrbit,
)
from .harmonic.condensed import condense as condense
from .maps.isolas.map import IsolaMap as IsolaMap, isola_map as isola_map
from .maps.isolas.margin import DesignMargin as DesignMargin, design_margin as design_margin
from .maps.isolas.result import Isola as Isola, Isolas as Isolas
from .maps.isolas.verb import find_isolas as find_isolas
from .maps.regimes.map import RegimeMap as RegimeMap
from .maps.regimes.verb import regime_map as regime_map
from .model import (
    BaseAcceleration as BaseAcceleration,
    BaseDisplacement as BaseDisplacement,
    Callable as Callable,
    Clearance as Clearance,
    CoupledElement as CoupledElement,
    CubicSpring as CubicSpring,
    ElasticStop as ElasticStop,
    Element as Element,
    Expression as Expression,
    Freeplay as Freeplay,
    Gravity as Gravity,
    HarmonicLoad as HarmonicLoad,
    HertzContact as HertzContact,
    PolynomialSpring as PolynomialSpring,
    QuadraticDamper as QuadraticDamper,
    RotatingUnbalance as RotatingUnbalance,
    StaticLoad as StaticLoad,
    System as System,
    TanhFriction as TanhFriction,
    check_derivatives as check_derivatives,
    library as library,
)
from .pictures import (
    animate_shape as animate_shape,
    plot as plot,
    plot_boundaries as plot_boundaries,
    plot_history as plot_history,
    plot_panels as plot_panels,
    plot_phase as plot_phase,
    plot_shape as plot_shape,
    plot_space as plot_space,
    plot_spectrum as plot_spectrum,
    to_pyvista as to_pyvista,
    write_report as write_report,
    write_vtu as write_vtu,
)
from .results.branch import Branch as Branch
from .results.diagram import BifurcationDiagram as BifurcationDiagram
from .structures import (
    DofMap as DofMap,
    Mesh as Mesh,
    ModalDamping as ModalDamping,
    Rayleigh as Rayleigh,
    Structure as Structure,
    read_structure as read_structure,
)
from .study.results import Results as Results, load as load
from .study.sweeps.result import Sweep as Sweep
from .study.sweeps.verb import sweep as sweep
from .verification import stability as stability, verify as verify
from .version import __version__ as __version__
