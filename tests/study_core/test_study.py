"""Study files: the shipped ones hold the contract's numbers; a malformed one is told its key."""

import hashlib
from pathlib import Path

import pytest

from study_core.choice import ResponseModel
from study_core.comparison import Choice
from study_core.errors import StudyError
from study_core.posterior.prior import Prior
from study_core.posterior.run import SamplerSettings
from study_core.study import parse_study, read_study
from tests.study_core.references import study_text

STUDIES = Path(__file__).parents[2] / "static" / "studies"

LIBRARY = STUDIES.parent

SHIPPED = {
    "quickstart": (8, 4, ResponseModel("sigmoid", 200.0, 0.1), "sphere"),
    "online": (60, 40, ResponseModel("sigmoid", "inferred", "inferred"), "sphere"),
    "katz2021": (100, 75, ResponseModel("sigmoid", 50.0, 0.0), "ball"),
    "katz2021-code": (100, 75, ResponseModel("clipped-linear", 1.0, 0.0), "ball"),
    "full-path": (6, 3, ResponseModel("sigmoid", 200.0, 0.1, 1.0), "sphere"),
}
# Practice queries, repeats and checks.
N_MORE = dict.fromkeys(SHIPPED, 0) | {"full-path": 2 + 2 + 1}


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_study_has_the_numbers_of_the_contract(name):
    active, test, response, support = SHIPPED[name]
    study = read_study(STUDIES / f"{name}.toml", LIBRARY)
    assert study.name == name
    assert (study.protocol.active_queries, study.protocol.test_queries) == (active, test)
    assert study.n_queries == active + test + N_MORE[name]
    assert study.response == response
    assert study.prior == Prior(support, 4)
    assert study.domain.id == "driving-v1"
    assert study.sampler.n_chains >= 4


@pytest.mark.parametrize("name", ["katz2021", "katz2021-code"])
def test_the_papers_studies_choose_and_search_as_the_paper_does(name):
    study = read_study(STUDIES / f"{name}.toml", LIBRARY)
    assert (study.file.acquisition.method, study.file.acquisition.mu) == ("heuristic", 0.1)
    assert (study.file.trajectory.search, study.file.trajectory.starts) == ("starts", 10)
    assert study.sampler.n_samples == 100
    assert study.bank is None


def test_quickstart_asks_what_says_most_among_realistic_drives():
    study = read_study(STUDIES / "quickstart.toml")
    section = study.file.acquisition
    assert (section.method, section.min_difference) == ("information-gain-realistic", 0.5)
    assert (study.file.trajectory.search, study.file.trajectory.starts) == ("bank", None)
    assert study.sampler.n_samples == 300


@pytest.mark.parametrize(
    ("method", "search", "has_bank"),
    [
        ("heuristic", "starts", False),
        ("heuristic", "bank", True),
        ("information-gain", "starts", False),
        ("regret", "starts", True),
    ],
)
def test_a_study_has_a_bank_if_its_method_or_its_search_needs_one(method, search, has_bank):
    study = parse_study(study_text(acquisition__method=method, trajectory__search=search))
    assert (study.bank is not None) == has_bank


def test_the_online_study_learns_a_feature_and_the_others_know_their_files_alone():
    studies = {name: read_study(STUDIES / f"{name}.toml", LIBRARY).file.learning for name in SHIPPED}
    every = {name: learning.feature_every for name, learning in studies.items()}
    assert every == dict.fromkeys(SHIPPED) | {"online": 20}
    assert not any(learning.people_before for learning in studies.values())


LEARNING = {
    "protocol__active_queries": 20,
    "prior__support": "sphere",
    "response__rationality": "inferred",
}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"learning__feature_every": 15, **LEARNING, "prior__support": "ball"}, "needs prior.support"),
        (
            {"learning__people_before": True, "prior__support": "sphere"},
            ": the section learning needs prior.support",
        ),
        (
            {"learning__people_before": True, "learning__feature_every": 15, **LEARNING},
            "key 'learning': people_before and feature_every can't go together",
        ),
        ({"learning__feature_every": 13, **LEARNING}, "key 'learning.feature_every'"),
        ({"learning__feature_every": 20, **LEARNING}, "less than protocol.active_queries, 20"),
        ({"learning__feature_evry": 20, **LEARNING}, "did you mean 'feature_every'"),
    ],
)
def test_a_study_that_cant_learn_so_is_refused_in_a_line_without_the_whole_section(changes, message):
    with pytest.raises(StudyError) as raised:
        parse_study(study_text(**changes))
    assert message in str(raised.value)
    assert len(str(raised.value)) < 300


def test_every_shipped_study_is_tested():
    assert {path.stem for path in STUDIES.glob("*.toml")} == set(SHIPPED)


def test_shipped_studies_have_seeds_and_names_of_their_own():
    studies = [read_study(path, LIBRARY) for path in STUDIES.glob("*.toml")]
    assert len({study.name for study in studies}) == len(studies)
    assert len({study.hash for study in studies}) == len(studies)


def test_what_the_file_says_reaches_the_science():
    study = parse_study(study_text(sampler__warmup=150, sampler__draws=500, sampler__most_draws=900))
    assert study.response == ResponseModel("sigmoid", 50.0, 0.1)
    assert study.prior == Prior("sphere", 4)
    expected = SamplerSettings(n_chains=4, n_warmup=150, n_draws=500, most_draws=900, n_samples=20)
    assert study.sampler == expected
    assert (study.seed, study.n_queries, study.file.trajectory.starts) == (5, 5, 3)


def test_a_study_offers_a_and_b_and_whatever_it_names_beside_them():
    assert parse_study(study_text()).answers == (Choice.A, Choice.B)
    more = parse_study(study_text(response__answers=["a", "b", "unsure", "skip"]))
    assert more.answers == (Choice.A, Choice.B, Choice.UNSURE, Choice.SKIP)


@pytest.mark.parametrize("rationality", [30.0, "inferred", "evidence"])
@pytest.mark.parametrize("lapse_rate", [0.0, 1e-9, 0.2, "inferred", "evidence"])
@pytest.mark.parametrize("tie_threshold", [None, 0.5, "inferred"])
def test_a_study_picks_how_each_response_parameter_is_set(rationality, lapse_rate, tie_threshold):
    changes = {"response__rationality": rationality, "response__lapse_rate": lapse_rate}
    if tie_threshold is not None:
        changes |= {"response__answers": ["a", "b", "same"], "response__tie_threshold": tie_threshold}
    study = parse_study(study_text(**changes))
    assert study.response == ResponseModel("sigmoid", rationality, lapse_rate, tie_threshold or 0.0)
    assert (Choice.SAME in study.answers) == (tie_threshold is not None)


def test_the_hash_is_of_every_character_of_the_text():
    text = study_text()
    assert parse_study(text).hash == hashlib.sha256(text.encode()).hexdigest()
    assert parse_study(text).text == text
    assert parse_study(text + "# a remark\n").hash != parse_study(text).hash


def test_a_whole_number_is_good_enough_for_a_real_one():
    assert parse_study(study_text(response__rationality=200)).response.rationality == 200.0


def test_optional_keys_have_their_defaults():
    text = study_text(response__lapse_rate=None, acquisition__mu=None, sampler__chains=None)
    study = parse_study(text)
    assert (study.response.lapse_rate, study.file.acquisition.mu, study.sampler.n_chains) == (0.0, 0.1, 4)
    # What studies did before they could say: leave out equal drives alone, and search as in the paper.
    assert (study.file.acquisition.min_difference, study.file.trajectory.search) == (0.0, "starts")


MALFORMED = {
    "an unknown key at the top": ({"tittle": "x"}, r"unknown key 'tittle'; did you mean 'title'\?"),
    "an unknown key in a section": (
        {"response__rationalty": 3.0},
        r"unknown key 'response\.rationalty'; did you mean 'rationality'\?",
    ),
    "an unknown key like no other": (
        {"prior__zzz": 1},
        r"unknown key 'prior\.zzz'; expected one of: support\.",
    ),
    "an unknown section": (
        {"trajectories__starts": 5},
        r"unknown key 'trajectories'; did you mean 'trajectory'\?",
    ),
    "a key missing at the top": ({"seed": None}, r"key 'seed' is missing"),
    "a key missing in a section": (
        {"protocol__test_queries": None},
        r"key 'protocol\.test_queries' is missing",
    ),
    "a text where a number belongs": (
        {"protocol__active_queries": "ten"},
        r"key 'protocol\.active_queries': input should be a valid integer, got 'ten'",
    ),
    "a number where a text belongs": ({"title": 3}, r"key 'title': input should be a valid string, got 3"),
    "a truth value where a number belongs": (
        {"protocol__active_queries": True},
        r"key 'protocol\.active_queries': input should be a valid integer, got True",
    ),
    "a fraction where a whole number belongs": (
        {"trajectory__starts": 2.5},
        r"key 'trajectory\.starts': input should be a valid integer.*, got 2\.5",
    ),
    "a value where a section belongs": ({"prior": "ball"}, r"TOML|key 'prior'"),
    "no active queries": (
        {"protocol__active_queries": 0},
        r"key 'protocol\.active_queries': input should be greater than or equal to 1, got 0",
    ),
    "fewer than no test queries": (
        {"protocol__test_queries": -1},
        r"key 'protocol\.test_queries': input should be greater than or equal to 0, got -1",
    ),
    "a negative seed": ({"seed": -1}, r"key 'seed': input should be greater than or equal to 0, got -1"),
    "no rationality": (
        {"response__rationality": 0.0},
        r"key 'response\.rationality': input should be greater than or equal to 0\.000001, got 0\.0",
    ),
    "infinite rationality": (
        {"response__rationality": "inf"},
        r"key 'response\.rationality': .*finite.*, got inf",
    ),
    "rationality that is not a number": (
        {"response__rationality": "nan"},
        r"key 'response\.rationality': .*, got nan",
    ),
    "infinite mu": ({"acquisition__mu": "inf"}, r"key 'acquisition\.mu': .*finite.*, got inf"),
    "negative mu": (
        {"acquisition__mu": -0.1},
        r"key 'acquisition\.mu': .*greater than or equal to 0, got -0\.1",
    ),
    "people who only guess": (
        {"response__lapse_rate": 1.0},
        r"key 'response\.lapse_rate': input should be less than or equal to 0\.999, got 1\.0",
    ),
    "a negative lapse rate": (
        {"response__lapse_rate": -0.1},
        r"key 'response\.lapse_rate': input should be greater than or equal to 0, got -0\.1",
    ),
    "a lapse rate in the clipped model": (
        {"response__model": "clipped-linear"},
        r"key 'response': lapse_rate must be 0 for the clipped-linear model",
    ),
    "an unknown response model": (
        {"response__model": "probit"},
        r"key 'response\.model': input should be 'sigmoid' or 'clipped-linear', got 'probit'",
    ),
    "an answer twice": (
        {"response__answers": ["a", "b", "skip", "skip"]},
        r"key 'response\.answers': answers must begin with \"a\", \"b\" and name none twice",
    ),
    "answers without b": (
        {"response__answers": ["a", "skip"]},
        r"key 'response\.answers': answers must begin with \"a\", \"b\"",
    ),
    "an unknown answer": (
        {"response__answers": ["a", "b", "maybe"]},
        r"key 'response\.answers\.3': input should be 'a', 'b'.*, got 'maybe'",
    ),
    "a rationality like no other word": (
        {"response__rationality": "infered"},
        r"key 'response\.rationality': input should be 'inferred' or 'evidence', got 'infered'",
    ),
    "a lapse rate like no other word": (
        {"response__lapse_rate": "none"},
        r"key 'response\.lapse_rate': input should be 'inferred' or 'evidence', got 'none'",
    ),
    "a lapse rate too small to compute with": (
        {"response__lapse_rate": 1e-12},
        r"key 'response\.lapse_rate': lapse_rate must be 0 or at least 1e-09, got 1e-12",
    ),
    "a clipped model with a rationality to infer": (
        {"response__model": "clipped-linear", "response__rationality": "inferred"},
        r"key 'response': rationality must be a number for the clipped-linear model",
    ),
    "a clipped model with a rationality to choose": (
        {"response__model": "clipped-linear", "response__rationality": "evidence"},
        r"key 'response': rationality must be a number for the clipped-linear model",
    ),
    "a clipped model with three answers": (
        {
            "response__model": "clipped-linear",
            "response__lapse_rate": 0.0,
            "response__answers": ["a", "b", "same"],
            "response__tie_threshold": 0.5,
        },
        r"key 'response': answers can't hold \"same\" for the clipped-linear model",
    ),
    "about the same without a threshold": (
        {"response__answers": ["a", "b", "same"]},
        r"key 'response': tie_threshold and the answer \"same\" need each other",
    ),
    "a threshold without about the same": (
        {"response__tie_threshold": 0.5},
        r"key 'response': tie_threshold and the answer \"same\" need each other",
    ),
    "a threshold by the evidence": (
        {"response__answers": ["a", "b", "same"], "response__tie_threshold": "evidence"},
        r"key 'response\.tie_threshold': input should be 'inferred', got 'evidence'",
    ),
    "a threshold beyond what numbers hold": (
        {"response__answers": ["a", "b", "same"], "response__tie_threshold": 800.0},
        r"key 'response\.tie_threshold': input should be less than or equal to 50, got 800\.0",
    ),
    "more draws than a day has room for": (
        {"sampler__most_draws": 1_000_000_000},
        r"key 'sampler\.most_draws': input should be less than or equal to 1000000",
    ),
    "a threshold of nothing": (
        {"response__answers": ["a", "b", "same"], "response__tie_threshold": 0},
        r"key 'response\.tie_threshold': input should be greater than or equal to 0\.001, got 0",
    ),
    "fewer draws at most than at least": (
        {"sampler__most_draws": 399},
        r"key 'sampler': most_draws can't be less than draws",
    ),
    "an unknown support": (
        {"prior__support": "cube"},
        r"key 'prior\.support': input should be 'ball' or 'sphere', got 'cube'",
    ),
    "one sample": (
        {"sampler__samples": 1},
        r"key 'sampler\.samples': input should be greater than or equal to 2, got 1",
    ),
    "one chain": ({"sampler__chains": 1}, r"key 'sampler\.chains': .*greater than or equal to 2, got 1"),
    "more samples than draws": (
        {"sampler__samples": 1601},
        r"key 'sampler': samples can't exceed chains x draws",
    ),
    "a search from random starts without their number": (
        {"trajectory__starts": None},
        r"key 'trajectory': starts must be given with search = \"starts\"",
    ),
    "a bound below nothing": (
        {"acquisition__min_difference": -0.1},
        r"key 'acquisition\.min_difference': .*greater than or equal to 0, got -0\.1",
    ),
    "no starts": (
        {"trajectory__starts": 0},
        r"key 'trajectory\.starts': .*greater than or equal to 1, got 0",
    ),
    "a name with capitals": ({"name": "Katz 2021"}, r"key 'name': .*pattern.*, got 'Katz 2021'"),
    "an unknown method": (
        {"acquisition__method": "heuristc"},
        r"No acquisition method named 'heuristc'\. Did you mean 'heuristic'\?",
    ),
    "an unknown domain": (
        {"domain": "drivng-v1"},
        r"No domain named 'drivng-v1'\. Did you mean 'driving-v1'\?",
    ),
}


def malformed_text(changes):
    text = study_text(**changes)
    # TOML's own words for what is no finite number.
    return text.replace('"inf"', "inf").replace('"nan"', "nan")


@pytest.mark.parametrize("case", MALFORMED)
def test_a_malformed_study_is_told_its_key_and_what_was_expected(case):
    changes, expected = MALFORMED[case]
    with pytest.raises(StudyError, match=expected) as raised:
        parse_study(malformed_text(changes), source="mine.toml")
    assert str(raised.value).startswith("mine.toml: ")
    assert "\n" not in str(raised.value)


def test_the_first_problem_is_told_with_the_number_of_the_others():
    with pytest.raises(StudyError, match=r"\(2 more after this one\)$"):
        parse_study(study_text(title=3, seed=-1, trajectory__starts=0))


def test_text_that_is_not_toml_is_told_its_line():
    with pytest.raises(StudyError, match=r"mine\.toml: not valid TOML: .*line 2"):
        parse_study('name = "a"\nseed = = 3\n', source="mine.toml")


def test_an_empty_file_is_told_what_is_missing():
    with pytest.raises(StudyError, match=r"key 'name' is missing"):
        parse_study("")


def test_a_file_that_is_not_there_or_not_text_is_named(tmp_path):
    with pytest.raises(StudyError, match=r"nowhere\.toml"):
        read_study(tmp_path / "nowhere.toml")
    (tmp_path / "latin.toml").write_bytes('title = "Übung"'.encode("latin-1"))
    with pytest.raises(StudyError, match=r"latin\.toml"):
        read_study(tmp_path / "latin.toml")


def test_errors_in_a_file_name_its_path(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(study_text(seed=-1))
    with pytest.raises(StudyError, match=r"mine\.toml: key 'seed'"):
        read_study(path)
