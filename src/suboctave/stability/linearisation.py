"""The elements along a motion, on panels: what stiffness and damping they add, and what force they leave unbalanced.

Piecewise-linear laws and polynomials in u are evaluated in compiled code. All other elements are asked for their
tangents at all nodes at once, along the motion as it stands and, where it is corrected by `d(tau)`, again; but for
sharp laws `f_u + f_uu d + f_uv d'` is taken at the old nodes. Panels are graded towards the old passages, and where d
exceeds the law's width the new ones lie between the nodes; the linear form has the right integral all the same.
"""

from __future__ import annotations

import numpy as np

from suboctave.harmonic.basis import Array
from suboctave.harmonic.group_force import PackedLaws
from suboctave.harmonic.quadrature import FEWEST, search_grid
from suboctave.harmonic.sharp_nodes import singular_instants
from suboctave.harmonic.state import BalanceState
from suboctave.model.sampling import AdaptiveSampling
from suboctave.stability.channels import Channels
from suboctave.stability.nodes import NODES
from suboctave.stability.panels import closed_changes, lay_out, longest_panel

#: a law that tells nothing of itself and needs this many samples per period is smooth over one radian
_BLIND = 48.0
_NONE = np.zeros((2, 0))


class Linearisation:
    """Stiffness, damping and unbalanced force of the elements along a motion.

    Attributes
    ----------
    directions, acting
        What every direction reads and where it acts, (G, size) each, in the unknown DOFs: the same but for elements
        with nodes of their own (`channels`).
    stretch, path, law, base
        See `panels.lay_out`; `law` with the elements that are not known in closed form.
    moving
        Whether any element has damping.
    varying
        Whether any stiffness or damping varies within panels.
    blind
        Whether an element tells nothing of how smooth it is.
    """

    def __init__(self, state: BalanceState) -> None:
        balance = state.balance
        self.state = state
        _, kinds, laws = balance.coefficients(state.values)
        own = self._own = Channels(state, len(laws))
        self.directions = [group.direction for group in balance.groups] + own.right
        self.acting = self.directions[: len(laws)] + own.left
        self.moving = True in balance.moving or any(nodal.own.moving for nodal in state.nodal)
        laws = laws + own.laws
        self._laws = PackedLaws.of(laws) if own.laws else state.packed[0]
        degree, finest = max(own.degree, self._laws.polynomial.shape[1] - 2), own.finest
        self.blind = own.blind
        for law in laws:
            if law.sharp or len(law.smooth_steps):
                degree = max(degree, 1)
            for i, _ in law.uniform:
                degree = max(degree, law.degree - 1, 1)
                if isinstance(kinds[i], AdaptiveSampling):
                    self.blind = True
                    finest = min(finest, _BLIND / (balance.samples[i] or FEWEST))
        self.varying = degree > 0
        forces = np.concatenate((state.spectra_table[0], own.forces)) if own.forces else state.spectra_table[0]
        if state.basis.kept is not None:
            # the force at harmonics that are left out is unbalanced, like that beyond the highest
            forces = forces.copy()
            forces[:, state.basis.left_out] = 0.0
        high = state.basis.harmonics
        grid = search_grid(high)
        motions = c = np.concatenate((state.motions, own.motions)) if own.motions else state.motions
        longest = min(longest_panel(c, degree), finest)
        passed = _NONE
        # singularities further away than that do not disturb a panel
        found = [
            singular_instants(motion, law.points, law.widths, longest, grid.zr, grid.zi)
            for law, motion in zip(laws, motions, strict=True)
            if len(law.points)
        ]
        found += [
            singular_instants(motion, *law.told_places, longest, grid.zr, grid.zi)
            for law, motion in zip(laws, motions, strict=True)
            if len(law.smooth_steps)
        ]
        if found:
            passed = found[0] if len(found) == 1 else np.concatenate(found, axis=1)
        told = self._laws
        self.stretch, self.path, self.law, self.base, self._events, self._start = lay_out(
            c,
            forces,
            state.rate,
            told.pieces,
            told.owner,
            told.polynomial,
            told.steps,
            told.step_owner,
            told.line,
            passed,
            longest,
            grid.zr,
            grid.zi,
            NODES,
        )
        #: (group, element, its coefficients, whether sharp, f_u, f_v) of the elements not known in closed form
        self._asked = []
        for g, law in enumerate(laws):
            for members, sharp in ((law.sharp, True), (law.uniform, False)):
                for i, a in members:
                    element = balance.elements[i]
                    force, f_u, f_v = element.tangent(self.path[g, 0], self.path[g, 1], a)
                    self.law[g, 0] += force
                    self.law[g, 1] += f_u
                    if f_v is not None:
                        self.law[g, 2] += f_v
                    self._asked.append((g, element, a, sharp, f_u, f_v))
        own.locate(self._events, self._start, told.owner, len(self.stretch))
        own.ask(self.path, self.law)

    def changed(self, change: Array) -> tuple[Array, Array]:
        """Along the motion changed by (G, 2, N): stiffness and damping (G, 2, N), kicks at the beginnings of panels
        (G, P).
        """
        laws = self._laws
        law: Array
        kick: Array
        law, kick = closed_changes(
            self.path,
            self.law,
            change,
            self.state.rate,
            laws.pieces,
            laws.owner,
            laws.polynomial,
            laws.steps,
            laws.step_owner,
            self._events,
            self._start,
            len(self.stretch),
        )
        for g, element, a, sharp, f_u, f_v in self._asked:
            u, v = self.path[g]
            d_u, d_v = change[g]
            if sharp:
                f_uu, f_uv, f_vv = element.curvature(u, v, a)
                f_u = f_u + f_uu * d_u
                if f_v is not None and f_uv is not None and f_vv is not None:
                    f_u = f_u + f_uv * d_v
                    f_v = f_v + f_uv * d_u + f_vv * d_v
            else:
                _, f_u, f_v = element.tangent(u + d_u, v + d_v, a)
            law[g, 0] += f_u
            if f_v is not None:
                law[g, 1] += f_v
        self._own.changed(self.path, change, law, self.stretch)
        return law, kick
