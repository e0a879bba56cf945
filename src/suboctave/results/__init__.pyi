"""What verbs give and take, for annotations and `isinstance`; read by type checkers and, lazily, by `__init__.py`."""

from suboctave.analysis.diagram import Keeper as Keeper
from suboctave.analysis.sensitivity import Sensitivity as Sensitivity
from suboctave.analysis.subharmonics import Branches as Branches
from suboctave.bifurcation.bifurcation import (
    Bifurcation as Bifurcation,
    CriticalMotion as CriticalMotion,
    TrackedEvent as TrackedEvent,
)
from suboctave.bifurcation.gaps import GrazingContact as GrazingContact
from suboctave.bifurcation.normal_form import NormalForm as NormalForm
from suboctave.curves.events.formulation import Formulation as Formulation
from suboctave.curves.junction import Junction as Junction
from suboctave.curves.trace import BranchPoint as BranchPoint, TrackedPoint as TrackedPoint
from suboctave.experiments.basin_attractors import BasinAttractor as BasinAttractor
from suboctave.experiments.basins import Basins as Basins
from suboctave.experiments.brute_force import BruteForceDiagram as BruteForceDiagram
from suboctave.experiments.common import TimeResult as TimeResult
from suboctave.experiments.lyapunov import LyapunovExponents as LyapunovExponents, Separation as Separation
from suboctave.experiments.lyapunov_map import LyapunovMap as LyapunovMap
from suboctave.experiments.measured import Measured as Measured
from suboctave.experiments.poincare import Attractor as Attractor, PoincareSections as PoincareSections
from suboctave.experiments.stepped_sine import SteppedSine as SteppedSine
from suboctave.experiments.trajectories import Trajectory as Trajectory
from suboctave.floquet.methods import StabilityMethod as StabilityMethod
from suboctave.floquet.result import FloquetResult as FloquetResult
from suboctave.harmonic.evaluation import BalanceState as BalanceState
from suboctave.harmonic.linear_part import LinearPart as LinearPart
from suboctave.harmonic.orbit import PeriodicOrbit as PeriodicOrbit
from suboctave.interruption import Interruption as Interruption
from suboctave.maps.isolas.map import IsolaMap as IsolaMap, IsolaRegion as IsolaRegion, Probe as Probe, Span as Span
from suboctave.maps.isolas.margin import DesignMargin as DesignMargin
from suboctave.maps.isolas.result import Isola as Isola, IsolaEnd as IsolaEnd, Isolas as Isolas
from suboctave.maps.pieces import MonotonePiece as MonotonePiece
from suboctave.maps.regimes.arcs import Arc as Arc, Edge as Edge, Regime as Regime, Slice as Slice, Strip as Strip
from suboctave.maps.regimes.map import (
    Landing as Landing,
    RegimeCheck as RegimeCheck,
    RegimeMap as RegimeMap,
    Region as Region,
)
from suboctave.model.elements.base import BaseElement as BaseElement
from suboctave.model.elements.derivative_check import DerivativeReport as DerivativeReport
from suboctave.model.frequencies import NaturalFrequencies as NaturalFrequencies
from suboctave.model.modes import Modes as Modes
from suboctave.model.projected import ProjectedSystem as ProjectedSystem
from suboctave.pictures.options import View as View
from suboctave.results.branch import Branch as Branch, TrackedBranch as TrackedBranch
from suboctave.results.diagram import BifurcationDiagram as BifurcationDiagram, DiagramBranch as DiagramBranch
from suboctave.results.equilibria import Equilibria as Equilibria
from suboctave.results.modes import ModeCurve as ModeCurve
from suboctave.results.points import Peak as Peak, Peaks as Peaks, Points as Points
from suboctave.results.sweep import Jump as Jump, SweepPath as SweepPath
from suboctave.store.registry import Stored as Stored
from suboctave.store.table import Table as Table
from suboctave.study.file import Study as Study
from suboctave.study.results import Results as Results
from suboctave.study.sweeps.result import Sweep as Sweep
from suboctave.timedomain.period_recognition import Drift as Drift
from suboctave.timedomain.shooting import PeriodicSolution as PeriodicSolution
from suboctave.timedomain.trapping import Trap as Trap
from suboctave.units import UnitSystem as UnitSystem
from suboctave.verification.motions import Verification as Verification
from suboctave.verification.result import (
    BranchVerification as BranchVerification,
    VerifiedBifurcation as VerifiedBifurcation,
    VerifiedPoint as VerifiedPoint,
)
