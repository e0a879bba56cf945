"""The witness: time integration with located contacts, shooting, bifurcations by shooting; knows no harmonic object."""

from suboctave.timedomain.locate import locate_by_shooting, shoot_along, shoot_cycle
from suboctave.timedomain.shooting import PeriodicSolution, shoot
from suboctave.timedomain.trajectory import Contact, Trajectory, integrate, state_transition

__all__ = [
    "Contact",
    "PeriodicSolution",
    "Trajectory",
    "integrate",
    "locate_by_shooting",
    "shoot",
    "shoot_along",
    "shoot_cycle",
    "state_transition",
]
