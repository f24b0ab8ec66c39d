"""Networks come back from their bytes as they were, and nothing else comes back at all."""

from dataclasses import fields, replace

import numpy as np
import pytest
from safetensors.numpy import save

from study_core.domains.driving import DRIVING_V1
from study_core.errors import CheckpointError
from study_core.networks.checkpoint import from_bytes, to_bytes
from study_core.networks.config import NetworkConfig
from study_core.predictors.personal_network import checkpoint_of, model_of, train_networks
from tests.study_core.networks.people import keeps_left, pairs

CONFIG = NetworkConfig(n_trials=3, n_selected=2, n_epochs=2, n_hidden=6)
TRAINING = keeps_left(1, 20)


@pytest.fixture(scope="module")
def checkpoint():
    model = train_networks(np.random.default_rng(1), DRIVING_V1, CONFIG, TRAINING)
    return checkpoint_of(model, TRAINING, seed=7)


def test_numbers_configuration_and_lineage_come_back(checkpoint):
    again = from_bytes(to_bytes(checkpoint))
    for field in fields(checkpoint.networks):
        before, after = (getattr(one.networks, field.name) for one in (checkpoint, again))
        np.testing.assert_array_equal(before, after)
        assert before.dtype == after.dtype
    assert again.config == CONFIG
    assert again.lineage == checkpoint.lineage
    assert again.lineage.seed == 7
    assert again.lineage.config_digest == CONFIG.digest


def test_what_comes_back_predicts_the_same(checkpoint):
    first, again = model_of(checkpoint), model_of(from_bytes(to_bytes(checkpoint)))
    new = pairs(9, 5)
    np.testing.assert_array_equal(first.probability_of_a(new), again.probability_of_a(new))


def test_equal_checkpoints_are_equal_bytes(checkpoint):
    assert to_bytes(from_bytes(to_bytes(checkpoint))) == to_bytes(checkpoint)


def test_other_answers_are_another_lineage(checkpoint):
    turned = replace(TRAINING, signs=-TRAINING.signs)
    other = checkpoint_of(model_of(checkpoint), turned, seed=7)
    assert other.lineage.answers_digest != checkpoint.lineage.answers_digest


def refused(data):
    with pytest.raises(
        CheckpointError, match=r"^Expected the bytes of a prefstudy-networks-1 .+ Train again\.$"
    ) as raised:
        from_bytes(data)
    assert "\n" not in str(raised.value)


def test_every_damaged_byte_is_found(checkpoint):
    data = to_bytes(checkpoint)
    for place in np.linspace(0, len(data) - 1, 150).astype(int):
        damaged = bytearray(data)
        damaged[place] ^= 0x15
        refused(bytes(damaged))


@pytest.mark.parametrize("length", [0, 5, 8, 100, -1])
def test_a_file_cut_short_is_refused(checkpoint, length):
    refused(to_bytes(checkpoint)[:length])


FOREIGN = {
    "nothing of the kind": b"not safetensors at all",
    "without metadata": save({"a": np.ones(3)}),
    "with other metadata": save({"a": np.ones(3)}, {"who": "somebody"}),
    "with our key and no JSON": save({"a": np.ones(3)}, {"prefstudy": "hello"}),
    "with our key and a list": save({"a": np.ones(3)}, {"prefstudy": "[]"}),
    "with our key and nothing in it": save({"a": np.ones(3)}, {"prefstudy": "{}"}),
    "a pickle": b"\x80\x04\x95\x10\x00\x00\x00\x00\x00\x00\x00\x8c\x02os\x94.",
}


@pytest.mark.parametrize("kind", FOREIGN)
def test_a_foreign_file_is_refused(kind):
    refused(FOREIGN[kind])
