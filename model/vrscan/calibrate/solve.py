"""Fits of parameters to residuals: robust least squares beside the paper's simplex search.

Both get the same parameters and residuals. What the residuals do not tell about a parameter is
found from their derivatives, and the parameter then keeps its start and is named.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vrscan.data.arrays import Bools, Floats
from vrscan.data.residuals import robust_sigma

ROBUST = 3.0  # residual, in standard deviations, from which the loss grows linearly only
SIMPLEX_CALLS = 400  # evaluations of the simplex search for each parameter
SIMPLEX_START = 0.5  # size of the first simplex, in tolerances


@dataclass(frozen=True)
class Parameter:
    """One parameter of a fit."""

    name: str
    unit: str
    start: float
    tolerance: float  # how far the start may be off, positive


@dataclass(frozen=True)
class Fit:
    """The outcome of a fit of n parameters."""

    parameters: tuple[Parameter, ...]
    values: Floats  # [n]
    sigma: Floats  # standard deviations [n]; that of a parameter that is not observed is not less
    #                than its tolerance
    correlation: Floats  # [n, n]; 0 beside a parameter that is not observed
    observed: Bools  # whether the residuals tell more than the start [n]
    seconds: float
    calls: int  # number of evaluations of the residuals

    def value(self, name: str) -> float:
        """Return the value of a parameter."""
        return float(self.values[[each.name for each in self.parameters].index(name)])

    def correlated(self, least: float = 0.9) -> list[tuple[str, str, float]]:
        """Return the pairs of parameters whose correlation is at least so large, largest first."""
        rows, columns = np.nonzero(np.triu(np.abs(self.correlation), 1) >= least)
        names = [each.name for each in self.parameters]
        pairs = [
            (names[i], names[j], float(self.correlation[i, j]))
            for i, j in zip(rows.tolist(), columns.tolist(), strict=True)
        ]
        return sorted(pairs, key=lambda pair: -abs(pair[2]))


def least_squares(residuals: Callable[[Floats], Floats], parameters: Sequence[Parameter]) -> Fit:
    """Return the parameters of the least sum of a robust loss, and what is known of them.

    A parameter whose standard deviation, with all others free, is larger than its tolerance is not
    observed: the worst one keeps its start, then the worst of the rest, until all of the rest are
    observed, and these are fitted again.

    Args:
        residuals: Function of the parameters' values [n], which returns residuals in units of their
            standard deviation [m].
        parameters: The n parameters.
    """
    from scipy.optimize import least_squares as solve

    begin, calls = time.perf_counter(), 0
    start = np.array([each.start for each in parameters])
    scale = np.array([each.tolerance for each in parameters])
    free = np.ones(len(start), np.bool_)
    at = np.zeros(len(start))

    def of(some: Floats) -> Floats:
        nonlocal calls
        calls += 1
        whole = at.copy()
        whole[free] = some
        return residuals(start + scale * whole)

    while True:
        # A start that is off by many standard deviations is no outlier: first the plain squares.
        first = solve(of, at[free], method="trf", x_scale=1.0, max_nfev=20)
        spread = max(1.0, robust_sigma(first.fun))
        found = solve(of, first.x, loss="soft_l1", f_scale=ROBUST * spread, max_nfev=40)
        at[free] = found.x
        # Without the worst one the others may well be observed, so they go one at a time.
        jacobian, left = found.jac, np.flatnonzero(free)
        covariance, deviation = _covariance(jacobian, found.fun)
        while len(left) and deviation.max() > 1.0:
            worst = int(np.argmax(deviation))
            free[left[worst]], at[left[worst]] = False, 0.0
            jacobian, left = np.delete(jacobian, worst, axis=1), np.delete(left, worst)
            covariance, deviation = _covariance(jacobian, found.fun)
        if jacobian.shape == found.jac.shape or not len(left):
            break
    sigma = scale.copy()
    sigma[free] *= deviation
    correlation = np.eye(len(start))
    if free.any():
        scaled = np.where(deviation > 0.0, deviation, 1.0)
        correlation[np.ix_(free, free)] = covariance / np.outer(scaled, scaled)
    return Fit(
        tuple(parameters),
        start + scale * at,
        sigma,
        correlation,
        free,
        time.perf_counter() - begin,
        calls,
    )


def _covariance(jacobian: Floats, residual: Floats) -> tuple[Floats, Floats]:
    """Return the covariance [n, n], and the standard deviations [n], infinite where unknown."""
    count = jacobian.shape[1]
    if count == 0:
        return np.zeros((0, 0)), np.zeros(0)
    _, singular, rows = np.linalg.svd(jacobian, full_matrices=False)
    kept = singular > 1e-10 * singular[0]
    inverse = np.where(kept, 1.0 / np.where(kept, singular, 1.0), 0.0)
    scatter = robust_sigma(residual)
    covariance = (rows.T * np.square(inverse)) @ rows * scatter**2
    lost = np.abs(rows[~kept]).max(axis=0, initial=0.0) > 1e-6
    return np.asarray(covariance), np.where(lost, np.inf, np.sqrt(np.diag(covariance)))


def simplex(
    cost: Callable[[Floats], float], parameters: Sequence[Parameter], *, most: int | None = None
) -> tuple[Floats, float, int]:
    """Return the paper's simplex search: values [n], seconds and number of evaluations.

    Args:
        cost: Function of the parameters' values, to be minimised.
        parameters: The n parameters.
        most: Largest number of evaluations; ``SIMPLEX_CALLS`` a parameter if None.
    """
    from scipy.optimize import minimize

    begin = time.perf_counter()
    start = np.array([each.start for each in parameters])
    scale = np.array([each.tolerance for each in parameters])
    corners = np.concatenate([np.zeros((1, len(start))), SIMPLEX_START * np.eye(len(start))])
    options = {
        "initial_simplex": corners,
        "maxfev": most or SIMPLEX_CALLS * len(start),
        "adaptive": True,
        "xatol": 1e-4,
        "fatol": 1e-9,
    }
    found = minimize(
        lambda at: cost(start + scale * at),
        np.zeros(len(start)),
        method="Nelder-Mead",
        options=options,
    )
    return start + scale * found.x, time.perf_counter() - begin, int(found.nfev)
