import numpy as np

from study_core.bank import open_bank
from study_core.domains.driving.domain import DRIVING_V1
from study_core.evaluation.best_drives import best_of, diversity, draw_candidates, optimise
from study_core.trajectory import best_from_bank

WEIGHTS = np.array([0.36, 0.2, 0.39, 0.25])


def reward(states):
    return DRIVING_V1.features(states) @ WEIGHTS


def test_the_optimiser_comes_near_the_bank_s_best_and_candidates_do_not():
    candidates = draw_candidates(1, DRIVING_V1)
    best, found = best_of(DRIVING_V1, candidates, reward), optimise(DRIVING_V1, candidates, reward)
    values = reward(DRIVING_V1.rollout(np.stack([best, found])))
    known = best_from_bank(DRIVING_V1, open_bank(DRIVING_V1), WEIGHTS[None])
    reachable = reward(DRIVING_V1.rollout(known.controls))[0]
    assert values[0] < values[1] <= reachable + 1e-6
    assert values[1] > reachable - 0.05
    assert values[0] == max(reward(DRIVING_V1.rollout(candidates)))


def test_a_reward_without_gradient_is_climbed_too():
    def final_progress(states):
        return states[:, -1, 1]

    found = optimise(DRIVING_V1, draw_candidates(2, DRIVING_V1), final_progress)
    straight_on = DRIVING_V1.rollout(np.tile([0.0, 1.0], 5)[None])
    assert final_progress(DRIVING_V1.rollout(found[None]))[0] > final_progress(straight_on)[0] - 1e-3


def test_equal_drives_are_not_diverse_and_each_pair_of_people_counts_once():
    drives = np.repeat(draw_candidates(3, DRIVING_V1)[:1], 4, axis=0)
    assert diversity(DRIVING_V1, drives).tolist() == [0.0] * 6
    assert (diversity(DRIVING_V1, draw_candidates(3, DRIVING_V1)[:4]) > 0.1).all()
