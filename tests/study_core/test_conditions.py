"""A study's conditions are arms of their own that share its file, its seed and its common test queries."""

import hashlib
from collections import Counter

import numpy as np
import pytest

from app.settings import STUDIES
from study_core.conditions import choose
from study_core.errors import StudyError
from study_core.queries import propose_common_query, propose_test_set
from study_core.streams import stream
from study_core.study import parse_study

QUICKSTART = (STUDIES / "quickstart.toml").read_text()
CONDITIONS = """
[[condition]]
name = "gain"
acquisition.method = "information-gain"

[[condition]]
name = "random"
acquisition.method = "random"
answering.confidence = true
text.welcome = "Hello."

[[condition]]
name = "ties"
response.answers = ["a", "b", "same"]
response.tie_threshold = 1.0
"""
TEXT = QUICKSTART + CONDITIONS


def test_each_condition_is_a_study_with_its_own_settings_and_all_the_others():
    study = parse_study(TEXT)
    gain, chance, _ = study.arms
    assert [arm.condition for arm in study.arms] == ["gain", "random", "ties"]
    assert (gain.file.acquisition.method, chance.file.acquisition.method) == ("information-gain", "random")
    assert chance.file.acquisition.min_difference == study.file.acquisition.min_difference
    assert [arm.file.answering.confidence for arm in study.arms] == [False, True, False]
    assert chance.text_named("welcome", "en") == "Hello."
    assert gain.text_named("welcome", "en") == study.text_named("welcome", "en")
    assert [len(arm.answers) for arm in study.arms] == [2, 2, 3]
    assert {arm.seed for arm in study.arms} == {study.seed}


def test_arms_have_hashes_of_their_own_and_the_version_of_their_file():
    study = parse_study(TEXT)
    assert study.version == study.hash == hashlib.sha256(TEXT.encode()).hexdigest()
    assert {arm.version for arm in study.arms} == {study.version}
    assert len({study.hash, *(arm.hash for arm in study.arms)}) == 4
    for arm in study.arms:
        assert parse_study(arm.text).condition == arm.condition
        assert parse_study(arm.text).arms == (arm,)


def test_a_study_without_conditions_is_its_only_arm():
    study = parse_study(QUICKSTART)
    assert (study.condition, study.arms, study.version) == (None, (study,), study.hash)


def test_the_common_queries_are_the_same_in_every_arm():
    arms = parse_study(TEXT).arms
    for queries in (
        [propose_test_set(arm) for arm in arms],
        [[propose_common_query(arm, "practice", 0)] for arm in arms],
    ):
        controls = [
            [(one.query.controls_a.tolist(), one.query.controls_b.tolist()) for one in each]
            for each in queries
        ]
        assert controls[0] == controls[1] == controls[2]
        assert controls[0]


@pytest.mark.parametrize(
    ("condition", "said"),
    [
        ('name = "other"\nacquisition.method = "randm"', "condition 'other'.*random"),
        (
            'name = "other"\nacquisition.min_difference = 0.5',
            "unknown key 'condition.1.acquisition.min_difference'",
        ),
        ('name = "other"\nprotocol.test_queries = 3', "unknown key 'condition.1.protocol'"),
        (
            'name = "other"\nresponse.anwsers = ["a", "b"]',
            "condition 'other': unknown key 'response.anwsers'; did you mean 'answers'",
        ),
        ('name = "gain"', "at least two, with different names"),
        ('name = "Other one"', "condition.1.name"),
    ],
)
def test_what_is_wrong_with_a_condition_is_said(condition, said):
    first = '[[condition]]\nname = "gain"\n'
    with pytest.raises(StudyError, match=said):
        parse_study(f"{QUICKSTART}\n[[condition]]\n{condition}\n{first}")


def test_one_condition_alone_is_refused_and_so_is_an_arm_that_there_is_not():
    with pytest.raises(StudyError, match="at least two"):
        parse_study(f'{QUICKSTART}\n[[condition]]\nname = "gain"\n')
    with pytest.raises(StudyError, match="no condition is called 'none'"):
        parse_study(f'arm = "none"\n{TEXT}')


def test_somebody_new_comes_to_a_condition_that_has_fewest_and_which_is_chance():
    names = ["x", "y", "z"]
    chosen = Counter(choose(stream(1, "condition", i), names, [3, 2, 2]) for i in range(600))
    assert set(chosen) == {"y", "z"}
    # Half of 600, within four standard deviations.
    assert abs(chosen["y"] - 300) < 4 * np.sqrt(600) / 2
