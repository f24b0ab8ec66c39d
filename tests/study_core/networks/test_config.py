"""A configuration is the paper's unless told, and refuses what can't be trained."""

from dataclasses import replace

import numpy as np
import pytest

from study_core.domains.driving import DRIVING_V1
from study_core.errors import NetworkError, UnknownNameError
from study_core.networks.config import NetworkConfig


def test_the_defaults_are_the_papers():
    config = NetworkConfig()
    assert config.inputs == ("x", "distance", "heading", "speed")
    assert (config.n_features, config.n_hidden, config.has_hand_coded) == (1, 100, True)
    assert (config.n_trials, config.n_epochs, config.n_selected) == (40, 40, 5)
    assert (config.learning_rate, config.betas) == (0.001, (0.9, 0.999))
    assert (config.epochs_per_linear_update, config.n_linear_steps, config.linear_rate) == (20, 5, 0.005)
    assert config.training_share == 0.7


WRONG = {
    "no inputs": {"inputs": ()},
    "an input twice": {"inputs": ("x", "x")},
    "no feature": {"n_features": 0},
    "no hidden unit": {"n_hidden": 0},
    "no epoch": {"n_epochs": 0},
    "a rate of zero": {"learning_rate": 0.0},
    "a rate that is not a number": {"learning_rate": float("nan")},
    "a beta of one": {"betas": (0.9, 1.0)},
    "negative decay": {"weight_decay": -0.1},
    "no training": {"training_share": 0.0},
    "more selected than trials": {"n_selected": 41},
    "selection without validation": {"training_share": 1.0},
}


@pytest.mark.parametrize("breach", WRONG)
def test_what_cant_be_trained_is_refused_in_one_line_that_names_it(breach):
    (name,) = WRONG[breach] if len(WRONG[breach]) == 1 else (next(iter(WRONG[breach])),)
    named = "n_selected" if breach == "selection without validation" else name
    with pytest.raises(NetworkError, match=rf"^Expected `{named}` .+\.$") as raised:
        NetworkConfig(**WRONG[breach])
    assert "\n" not in str(raised.value)


def test_an_unknown_procedure_is_refused_with_the_nearest():
    with pytest.raises(UnknownNameError, match="Did you mean 'continued'"):
        NetworkConfig(procedure="continue")


def test_a_configuration_comes_back_from_its_text_with_the_same_digest():
    config = NetworkConfig(inputs=("speed", "x"), n_features=2, betas=(0.8, 0.9))
    again = NetworkConfig.from_json(config.to_json())
    assert again == config
    assert again.digest == config.digest
    assert replace(config, n_hidden=99).digest != config.digest


def test_inputs_are_chosen_by_name_in_their_order():
    states = DRIVING_V1.rollout(np.zeros((2, 10)))
    chosen = NetworkConfig(inputs=("speed", "x")).inputs_of(DRIVING_V1, states)
    np.testing.assert_array_equal(chosen, states[..., [3, 0]])


def test_an_input_that_the_domain_lacks_is_refused():
    with pytest.raises(UnknownNameError, match=r"network input of 'driving-v1' named 'sped'.+'speed'"):
        NetworkConfig(inputs=("x", "sped")).inputs_of(DRIVING_V1, DRIVING_V1.rollout(np.zeros((1, 10))))
