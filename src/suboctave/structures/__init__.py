"""Finite-element models as their users have them: matrices with labelled degrees of freedom, from files or meshes."""

from suboctave.structures.damping import ModalDamping as ModalDamping, Rayleigh as Rayleigh
from suboctave.structures.dof_map import DofMap as DofMap
from suboctave.structures.files import read_structure as read_structure
from suboctave.structures.mesh import Mesh as Mesh
from suboctave.structures.published import (
    cantilever_beam as cantilever_beam,
    clearance_plate as clearance_plate,
    clearance_plate_structure as clearance_plate_structure,
)
from suboctave.structures.sources import (
    beam as beam,
    from_skfem as from_skfem,
    join as join,
    plate as plate,
)
from suboctave.structures.structure import Structure as Structure
