"""What verification is made of, against closed forms and the equations."""

import numpy as np
import pytest

from study_core.choice import PARAMETER_PRIORS, ResponseParameters
from study_core.comparison import ComparisonSet
from study_core.knowledge import Knowledge
from study_core.posterior.diagnostics import Diagnostics
from study_core.posterior.population import PopulationPrior
from study_core.queries import infer_posterior
from study_core.verification.drives import verify_optimum
from study_core.verification.findings import Findings, Violation
from study_core.verification.posterior import verify_posterior
from study_core.verification.stored import StoredPosterior, log_densities
from tests.study_core import references
from tests.study_core.verification.walked import small_study

DOMAIN = references.QuadraticDomain([[0.2, -0.4], [0.9, 3.0]], [1.0, 2.0])
WEIGHTS = np.array([0.6, 0.8])


def reward(controls):
    return float(DOMAIN.features(DOMAIN.rollout(controls[None]))[0] @ WEIGHTS)


@pytest.mark.parametrize(("loss", "is_found"), [(0.0, False), (5e-7, False), (1e-5, True), (1e-3, True)])
def test_a_drive_is_an_optimum_to_a_millionth_of_reward(loss, is_found):
    best = DOMAIN.best_controls(WEIGHTS)
    # The reward falls by this much per square of the first control's distance.
    moved = best + np.array([np.sqrt(loss / WEIGHTS.sum()), 0.0])
    assert reward(best) - reward(moved) == pytest.approx(loss, abs=1e-12)
    findings = Findings(7)
    verify_optimum(findings, "reward", DOMAIN, moved, WEIGHTS)
    assert [each.query_index for each in findings.violations] == [7] * is_found
    if is_found:
        assert findings.violations[0].stored == pytest.approx(reward(moved))
        assert findings.violations[0].recomputed == pytest.approx(reward(best), abs=1e-9)


def test_a_drive_at_its_bound_is_an_optimum_and_one_that_had_not_converged_is_left_out():
    weights = np.array([0.0, 1.0])
    best = DOMAIN.best_controls(weights)
    assert best[1] == DOMAIN.control_upper[1]
    findings = Findings()
    verify_optimum(findings, "reward", DOMAIN, best, weights)
    verify_optimum(findings, "reward", DOMAIN, np.zeros(2), weights, has_converged=False)
    assert not findings.violations
    assert sum(findings.left_out.values()) == 1


def some_answers(n):
    rng = np.random.default_rng(n)
    return ComparisonSet(rng.normal(0, 0.1, (n, 4)), rng.choice([-1.0, 1.0], n))


def test_log_densities_are_those_of_the_equations():
    rng, answers = np.random.default_rng(3), some_answers(9)
    study = small_study(response__rationality="inferred", response__lapse_rate=0.1)
    samples = references.prior_draws(rng, "sphere", 30)
    beta = rng.uniform(5.0, 200.0, 30)
    parameters = ResponseParameters(beta, np.full(30, 0.1), np.zeros(30))
    likelihoods = references.log_likelihoods(answers.feature_diffs, answers.signs, samples, beta, 0.1)
    normal = -0.5 * ((np.log(beta) - np.log(50.0)) / 1.5) ** 2
    np.testing.assert_allclose(
        log_densities(study, answers, samples, parameters), likelihoods + normal, rtol=1e-12
    )


@pytest.mark.parametrize("has_population", [False, True])
def test_log_densities_are_those_that_the_posterior_was_drawn_with(has_population):
    study = small_study(response__rationality="inferred", response__lapse_rate="inferred")
    population = PopulationPrior(np.array([10.0, 20.0, 10.0, 30.0]), np.diag([30.0, 60.0, 40.0, 90.0]))
    knowing = study.knowing(Knowledge(population=population if has_population else None))
    posterior = infer_posterior(knowing, 1, 4, some_answers(6))
    logs = log_densities(knowing, some_answers(6), posterior.samples, posterior.parameters)
    np.testing.assert_allclose(logs, posterior.log_densities, rtol=0, atol=1e-9)
    assert PARAMETER_PRIORS["rationality"].scale == 1.5


@pytest.mark.parametrize("support", ["ball", "sphere"])
def test_draws_from_the_prior_that_nobody_sampled_are_a_posterior_without_answers(support):
    study = small_study(prior__support=support)
    draws = references.prior_draws(np.random.default_rng(8), support, 4000)
    exact = Diagnostics(np.ones(4), np.full(4, 4000.0), np.full(4, 4000.0), 0.5, 4000)
    parameters = ResponseParameters.constant(40, 50.0, 0.1)
    stored = StoredPosterior(draws[::100], draws.mean(axis=0), parameters, exact)

    def violations(posterior):
        findings = Findings()
        verify_posterior(findings, study, 1, 0, ComparisonSet.empty(4), posterior)
        return [each.quantity for each in findings.violations]

    assert violations(stored) == []
    shift = 12.0 * draws.std(axis=0)[2] / np.sqrt(2000.0)
    moved = stored.mean + np.array([0.0, 0.0, shift, 0.0])
    assert violations(StoredPosterior(draws[::100], moved, parameters, exact)) == ["mean[2]"]
    # Draws of a posterior after some answers are no draws from the prior.
    answered = infer_posterior(study, 1, 9, some_answers(30))
    other = StoredPosterior(answered.samples, answered.mean, parameters, exact)
    assert any(name.startswith("mean[") for name in violations(other))


def test_a_violation_says_query_quantity_both_values_and_tolerance():
    said = str(Violation(12, "provenance.score", 0.25, 0.5, 1e-9))
    assert said == "query 12: provenance.score: stored 0.25, expected 0.5 to within 1e-09"
    assert str(Violation(3, "first_shown", "a", "b", 0.0)) == "query 3: first_shown: stored 'a', expected 'b'"


def test_numbers_are_compared_to_within_and_texts_and_absences_exactly():
    findings = Findings(1)
    findings.compare("small", 1e-10, 0.0, 1e-9)
    findings.compare("large", 1e6 + 1e-4, 1e6, 1e-9)
    findings.compare("nothing", None, None, 1e-9)
    findings.compare_all("several", np.array([1.0, 2.0]), [1.0, 2.0 + 1e-10], 1e-9)
    assert (findings.violations, findings.n_compared) == ([], 5)
    findings.compare("nan", float("nan"), 0.0, 1e-9)
    findings.compare("absent", None, 0.0, 1e-9)
    findings.compare("exact", 1e-15, 0.0)
    findings.compare_all("fewer", [1.0], [1.0, 2.0], 1e-9)
    names = [each.quantity for each in findings.violations]
    assert names == ["nan", "absent", "exact", "number of fewer"]
