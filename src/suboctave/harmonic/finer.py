"""Equations of a motion with many more harmonics than a dense matrix can carry, solved from those of a few.

In a basis of N > H harmonics the equations are `R = A X + F(X) - P` as ever. Far above the structure a harmonic of the
force moves little: `x_k = -A(k w0)^-1 F_k` (post-processed Galerkin method; Garcia-Archilla, Novo, Titi, SIAM Journal
on Numerical Analysis 35, 1998). So the matrix of the harmonics up to H, bordered by the free parameter and one scalar
equation, beside the blocks A(k w0) beyond,

    P = diag( [J_H R_p; row], A((H + 1) w0), .., A(N w0) ),

is close to `[R_X R_p; row]`, and a correction of Newton's method is solved for by GMRES with P as the preconditioner:
one factorisation of the matrix of H harmonics, and products with R_X by fast Fourier transforms.
"""

from __future__ import annotations

import numpy as np
import scipy
from scipy.linalg import lapack

from suboctave.harmonic.basis import Array, ComplexArray, to_complex, to_real
from suboctave.harmonic.evaluation import BalanceState

#: what GMRES leaves of a right-hand side, at most, as a share of it, and the products with R_X after which it stops
_LEFT, _PRODUCTS = 1e-5, 60


class BorderedMotion:
    """`[R_X R_p; row]` at a motion: R_X (m, m), R_p (m,) by the free parameter, row (m + 1,); low: the harmonics of the
    preconditioner's matrix.
    """

    def __init__(self, state: BalanceState, by_parameter: Array, row: Array, low: int) -> None:
        balance = state.balance
        self.state, self.by_parameter, self.row = state, by_parameter, row
        # products of a motion with spectra up to 2 N + 1 do not fold back onto the harmonics up to N
        self.samples = scipy.fft.next_fast_len(4 * state.basis.harmonics + 4, real=True)
        self.outgoing = np.concatenate([np.tile(g.direction, (len(g.inputs), 1)) for g in balance.all_groups])
        self.incoming = np.concatenate([g.inputs for g in balance.all_groups])
        self.moving = any(group.moving for group in balance.all_groups)
        self.stiffness, self.damping = scipy.fft.irfft(state.tangent_spectra, self.samples) * self.samples
        rows = (2 * low + 1) * balance.size
        matrix = np.zeros((rows + 1, rows + 1))
        matrix[:-1, :-1] = state.low_jacobian(low)
        matrix[:-1, -1], matrix[-1, :-1], matrix[-1, -1] = by_parameter[:rows], row[:rows], row[-1]
        self.rows = rows
        #: LU factors of the transposed matrix, which lies in memory as LAPACK takes it
        self._lu, self._pivots, info = lapack.dgetrf(matrix.T, overwrite_a=True)
        self.singular = info > 0
        self.beyond = np.linalg.inv(state.blocks[low + 1 :])

    def solve(self, rhs: Array) -> Array:
        """The solution for a right-hand side (m + 1,), to a share of it; what is left is for the next correction."""
        from scipy.sparse.linalg import LinearOperator, gmres

        shape = (len(rhs), len(rhs))
        product = LinearOperator(shape, matvec=self._product, dtype=float)
        near = LinearOperator(shape, matvec=self._nearly, dtype=float)
        solution: Array = gmres(product, rhs, M=near, rtol=_LEFT, atol=0.0, restart=_PRODUCTS, maxiter=1)[0]
        return solution

    def _product(self, v: Array) -> Array:
        state = self.state
        waves = to_complex(state.balance.shaped(v[:-1]))
        along = self.incoming @ waves.T
        force = self.stiffness * self._in_time(along)
        if self.moving:
            force += self.damping * self._in_time(1j * state.frequencies * along)
        spectrum = scipy.fft.rfft(force)[:, : len(waves)] / self.samples
        spectrum[:, 1:] *= 2.0
        total = np.matmul(state.blocks, waves[:, :, None])[:, :, 0] + spectrum.T @ self.outgoing
        return np.append(to_real(total).ravel() + v[-1] * self.by_parameter, self.row @ v)

    def _in_time(self, waves: ComplexArray) -> Array:
        half = 0.5 * waves
        half[:, 0] *= 2.0
        result: Array = scipy.fft.irfft(half, self.samples) * self.samples
        return result

    def _nearly(self, v: Array) -> Array:
        """The inverse of P applied."""
        out, size, end = np.empty_like(v), self.state.balance.size, self.rows
        solved = lapack.dgetrs(self._lu, self._pivots, np.append(v[:end], v[-1]), trans=1)[0]
        out[:end], out[-1] = solved[:-1], solved[-1]
        rows = v[end:-1].reshape(-1, 2, size)
        waves = np.matmul(self.beyond, (rows[:, 0] - 1j * rows[:, 1])[:, :, None])[:, :, 0]
        out[end:-1] = np.stack((waves.real, -waves.imag), axis=1).ravel()
        return out
