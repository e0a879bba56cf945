"""Normal forms against the branches themselves: doubled ones, the other one at a branch point, tori by integration."""

from __future__ import annotations

import numpy as np
import pytest

import suboctave as so
from suboctave.bifurcation.normal_form import normal_form
from suboctave.bifurcation.normal_form_real import doubling_predictor
from suboctave.harmonic.basis import HarmonicBasis


def branch_along(balance, start, first, eps, parameter, values, omega, name):
    """Newton's method in (X, parameter) for the motion whose component along `first` is eps: the parameter."""
    weight = np.tile(balance.scales()[0] ** 2, balance.basis.size)
    row = first.ravel() * weight / (first.ravel() @ (weight * first.ravel()))
    x = start.ravel().copy()
    base = row @ x - eps
    for _ in range(12):
        at = {**values, name: parameter} if name != "omega" else values
        state = balance.at(x, parameter if name == "omega" else omega, at)
        matrix = np.zeros((len(x) + 1,) * 2)
        matrix[:-1, :-1], matrix[:-1, -1], matrix[-1, :-1] = state.jacobian, state.residual_by(name), row
        step = np.linalg.solve(matrix, np.append(state.residual, row @ x - base - eps))
        x, parameter = x - step[:-1], parameter - step[-1]
        if np.abs(step).max() < 1e-12:
            return parameter, x.reshape(start.shape)
    raise AssertionError("the branch was not found")


def doubled_curvature(b, sizes):
    """(p - p_PD) / eps^2 on the doubled branch at small sub-harmonic amplitudes, in units of the motion."""
    state, name = b.orbit.state(), b.parameter_name
    predictor = doubling_predictor(state, b.null_vectors, name)
    balance = state.balance.with_basis(predictor.basis).settle(predictor.motion, state.omega, state.values)
    scale = np.linalg.norm(predictor.motion * state.balance.scales()[0])
    found = []
    for share in sizes:
        eps = share * scale
        x, change = predictor.at(eps)
        value, _ = branch_along(
            balance, x, predictor.first, eps, b.parameter(name) + change, state.values, state.omega, name
        )
        found.append((value - b.parameter(name)) / eps**2)
    return np.array(found)
