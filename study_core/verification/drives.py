"""Whether two drives are what their controls say, and as good as their search should have found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Float
from scipy.optimize import Bounds, minimize

from study_core.acquisition.free_controls import values_and_gradients
from study_core.acquisition.pairs import Objective
from study_core.distinctness import visible_difference, visible_paths
from study_core.domain import Domain
from study_core.queries import ProposedQuery, Provenance, differ
from study_core.study import Study
from study_core.verification.findings import ROUNDING, Findings

OPTIMAL = 1e-6
"""A search has found an optimum if none that is so much better lies next to it."""

# Scenes are drawn in single precision.
_SINGLE = 1e-5

_UNCONVERGED = "drives of searches that had not converged"

_ValueAndGradient = Callable[[np.ndarray], tuple[float, np.ndarray]]


def verify_pair(findings: Findings, study: Study, proposed: ProposedQuery) -> None:
    """Verifies features, bounds and how different the two drives look."""
    domain, query, provenance = study.domain, proposed.query, proposed.provenance
    assert isinstance(provenance, Provenance), "an imported query can't be verified"
    controls = np.stack([query.controls_a, query.controls_b])
    features = domain.features(domain.rollout(controls))
    for side, name in enumerate("ab"):
        stored = (query.features_a, query.features_b)[side]
        findings.compare_all(f"query.features_{name}", stored, features[side], ROUNDING)
        within = np.clip(controls[side], domain.control_lower, domain.control_upper)
        findings.compare_all(f"query.controls_{name}", controls[side], within)
    if provenance.visible_difference is None:
        return
    paths = visible_paths(domain, controls)
    apart = float(visible_difference(paths[:1], paths[1:])[0])
    findings.compare("provenance.visible_difference", provenance.visible_difference, apart, _SINGLE)
    least = study.file.acquisition.min_difference
    if abs(apart - least) > _SINGLE * max(1.0, least):
        are_distinct = differ(domain, controls) and apart >= least
        findings.compare("provenance.are_distinct", provenance.are_distinct, are_distinct)


def verify_best_drives(findings: Findings, domain: Domain, proposed: ProposedQuery) -> None:
    """Verifies that each drive is an optimum of the reward that it should be best for, locally at least.

    Args:
        findings: Told what isn't so.
        domain: Whose features the weights are of, a learned one among them.
        proposed: The drives and the weights.
    """
    query, provenance = proposed.query, proposed.provenance
    assert isinstance(provenance, Provenance), "an imported query can't be verified"
    sides = (
        ("A", query.controls_a, provenance.weights_a, provenance.has_converged[0]),
        ("B", query.controls_b, provenance.weights_b, provenance.has_converged[1]),
    )
    for name, controls, weights, has_converged in sides:
        assert weights is not None, "this method optimises rewards"
        verify_optimum(findings, f"reward of trajectory {name}", domain, controls, weights, has_converged)


def verify_optimum(
    findings: Findings,
    quantity: str,
    domain: Domain,
    controls: Float[np.ndarray, " n_controls"],
    weights: Float[np.ndarray, " n_features"],
    has_converged: bool = True,
) -> None:
    """Verifies that one drive is a local optimum of w . Phi; nothing is said of a search that had not converged."""

    def reward(point: Float[np.ndarray, " n_controls"]) -> tuple[float, Float[np.ndarray, " n_controls"]]:
        values, gradients = domain.reward_and_gradient(point[None], weights[None])
        return float(values[0]), gradients[0]

    _verify_local(findings, quantity, reward, controls, domain, has_converged)


def verify_free_pair(
    findings: Findings,
    domain: Domain,
    objective: Objective,
    controls: Float[np.ndarray, "2 n_controls"],
    has_converged: bool,
) -> None:
    """Verifies that a pair of drives is a local optimum of what a method climbed over both drives' controls."""

    def value(point: Float[np.ndarray, " n_both"]) -> tuple[float, Float[np.ndarray, " n_both"]]:
        values, gradients = values_and_gradients(domain, objective, point[None])
        return float(values[0]), gradients[0]

    _verify_local(findings, "objective of the pair", value, controls.ravel(), domain, has_converged)


def _verify_local(
    findings: Findings,
    quantity: str,
    function: _ValueAndGradient,
    stored: Float[np.ndarray, " n"],
    domain: Domain,
    has_converged: bool,
) -> None:
    if not has_converged:
        findings.leave_out(_UNCONVERGED)
        return
    n_drives = len(stored) // len(domain.control_lower)
    lower, upper = np.tile(domain.control_lower, n_drives), np.tile(domain.control_upper, n_drives)

    def fall(point: Float[np.ndarray, " n"]) -> tuple[float, Float[np.ndarray, " n"]]:
        value, gradient = function(point)
        return -value, -gradient

    # Its first step is as long as the gradient, so near an optimum it stays near.
    found = minimize(
        fall,
        stored,
        jac=True,
        method="L-BFGS-B",
        bounds=Bounds(lower, upper),
        options={"gtol": 1e-8, "ftol": 1e-14},
    )
    best = function(np.asarray(found.x))[0]
    value = function(stored)[0]
    findings.compare(quantity, value, max(value, best), OPTIMAL)
