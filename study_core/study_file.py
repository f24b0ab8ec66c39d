"""What a study's TOML file may hold: its sections and their keys, checked."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import (
    AwareDatetime,
    Discriminator,
    Field,
    Tag,
    field_validator,
    model_validator,
)

from study_core.conditions import ConditionSection
from study_core.online.schedule import FEWEST_ANSWERS, LEAD
from study_core.path import (
    QUERIES_ALONE,
    Ending,
    EndingSection,
    Path,
    PracticeStep,
    Questionnaires,
    needed_questionnaires,
    needed_texts,
)
from study_core.section import Language, Name, Section, Words

# Products of a few probabilities as small as this are still numbers.
_SMALLEST_LAPSE_RATE = 1e-9

AnswerName = Literal["a", "b", "same", "unsure", "skip"]


def _kind_of_setting(value: object) -> str:
    """Returns how a setting that may be a number or a word is to be read, so that errors speak of that alone."""
    return "<word>" if isinstance(value, str) else "<number>"


Rationality = Annotated[
    Annotated[float, Field(ge=1e-6, le=1e6), Tag("<number>")]
    | Annotated[Literal["inferred", "evidence"], Tag("<word>")],
    Discriminator(_kind_of_setting),
]
LapseRate = Annotated[
    Annotated[float, Field(ge=0, le=0.999), Tag("<number>")]
    | Annotated[Literal["inferred", "evidence"], Tag("<word>")],
    Discriminator(_kind_of_setting),
]
TieThreshold = Annotated[
    Annotated[float, Field(ge=1e-3, le=50), Tag("<number>")] | Annotated[Literal["inferred"], Tag("<word>")],
    Discriminator(_kind_of_setting),
]


class ProtocolSection(Section):
    """How many queries."""

    active_queries: int = Field(
        ge=1, le=10_000, description="Queries chosen by what the answers so far leave open."
    )
    test_queries: int = Field(
        ge=0, le=10_000, description="Common queries, the same for everyone, kept out of the posterior."
    )
    repeats: int = Field(
        0,
        ge=0,
        description="Active queries that are asked once more with swapped sides, out of the posterior.",
    )
    checks: int = Field(
        0, ge=0, description="Queries that say which side to choose, to see whether they are read."
    )

    @model_validator(mode="after")
    def _extra_queries_have_room(self) -> ProtocolSection:
        most = self.active_queries // 2
        for name in ("repeats", "checks"):
            if getattr(self, name) > most:
                raise ValueError(
                    f"{name} can be at most half of active_queries, {most}; got {getattr(self, name)}"
                )
        return self


class ResponseSection(Section):
    """How people are assumed to answer."""

    model: Literal["sigmoid", "clipped-linear"] = Field(description="The paper's, or the published code's.")
    rationality: Rationality = Field(
        description="beta, per unit of reward: a number, `inferred` or `evidence`."
    )
    lapse_rate: LapseRate = Field(
        0.0, description="Share of answers given at random: a number, `inferred` or `evidence`."
    )
    answers: tuple[AnswerName, ...] = Field(
        ("a", "b"),
        description="What may be answered. `same` is about the same; `unsure` and `skip` say nothing about the person.",
    )
    tie_threshold: TieThreshold | None = Field(
        None, description="eta of `same`, in units of beta times reward: a number or `inferred`."
    )

    @field_validator("answers")
    @classmethod
    def _a_and_b_come_first(cls, value: tuple[AnswerName, ...]) -> tuple[AnswerName, ...]:
        if value[:2] != ("a", "b") or len(set(value)) != len(value):
            raise ValueError('answers must begin with "a", "b" and name none twice')
        return value

    @field_validator("lapse_rate")
    @classmethod
    def _is_nothing_or_something(cls, value: LapseRate) -> LapseRate:
        if not isinstance(value, str) and 0.0 < value < _SMALLEST_LAPSE_RATE:
            raise ValueError(f"lapse_rate must be 0 or at least {_SMALLEST_LAPSE_RATE}")
        return value

    @model_validator(mode="after")
    def _clipped_linear_has_nothing_to_learn(self) -> ResponseSection:
        if self.model != "clipped-linear":
            return self
        if isinstance(self.rationality, str):
            raise ValueError(
                "rationality must be a number for the clipped-linear model, whose likelihood isn't normalised over "
                'the answers; learn it with model = "sigmoid"'
            )
        if self.lapse_rate != 0.0:
            raise ValueError("lapse_rate must be 0 for the clipped-linear model")
        if "same" in self.answers:
            raise ValueError('answers can\'t hold "same" for the clipped-linear model; it has only two')
        return self

    @model_validator(mode="after")
    def _threshold_belongs_to_same(self) -> ResponseSection:
        if ("same" in self.answers) != (self.tie_threshold is not None):
            raise ValueError('tie_threshold and the answer "same" need each other; give both or neither')
        return self


class PriorSection(Section):
    """Where the weights may lie."""

    support: Literal["ball", "sphere"] = Field(
        description="The unit ball's non-negative part, or its surface."
    )


class SamplerSection(Section):
    """How much the posterior draws."""

    samples: int = Field(ge=2, le=5000, description="M, the draws that the acquisition sees.")
    chains: int = Field(4, ge=2, le=16, description="Chains of the sampler.")
    warmup: int = Field(200, ge=50, description="Draws of each warm-up stage for each coordinate.")
    draws: int = Field(
        750, ge=100, le=1_000_000, description="Draws of each chain, if the diagnostics are satisfied."
    )
    most_draws: int = Field(
        12_000, le=1_000_000, description="Draws of each chain after which an update ends in any case."
    )

    @model_validator(mode="after")
    def _has_enough_draws(self) -> SamplerSection:
        if self.samples > self.chains * self.draws:
            raise ValueError("samples can't exceed chains x draws")
        if self.most_draws < self.draws:
            raise ValueError("most_draws can't be less than draws")
        return self


class AcquisitionSection(Section):
    """How the next pair is chosen."""

    method: str = Field(
        description="Name of an acquisition method, such as `information-gain-realistic` or `random`."
    )
    mu: float = Field(0.1, ge=0, description="Weight of the distance between the two samples.")
    min_difference: float = Field(
        0.0, ge=0, description="How far apart the two trajectories must look, in body lengths."
    )


class TrajectorySection(Section):
    """How the best trajectory for a reward is found."""

    search: Literal["starts", "bank"] = Field(
        "starts", description="From random starts, as in the paper, or from a bank of local optima."
    )
    starts: int | None = Field(
        None, ge=1, le=1000, description="Random starts of L-BFGS for each trajectory."
    )

    @model_validator(mode="after")
    def _starts_belong_to_random_starts(self) -> TrajectorySection:
        if (self.starts is None) == (self.search == "starts"):
            raise ValueError('starts must be given with search = "starts", and only then')
        return self


class LearningSection(Section):
    """What a session may know beyond its hand-coded features and its own answers."""

    people_before: bool = Field(
        False, description="Start from what everyone who has finished the study before cares for."
    )
    feature_every: int | None = Field(
        None,
        ge=LEAD + FEWEST_ANSWERS,
        description="After each so many active queries, learn a feature from the answers so far, and go on with it.",
    )

    @model_validator(mode="after")
    def _is_one_of_the_two(self) -> LearningSection:
        if self.people_before and self.feature_every is not None:
            raise ValueError(
                "people_before and feature_every can't go together: what people have in common is known of the "
                "hand-coded features alone. Leave one out"
            )
        return self


class AnsweringSection(Section):
    """How an answer is given."""

    confidence: bool = Field(False, description="Asks how sure the person is, from 1 to 5.")
    watch_once: bool = Field(False, description="Both drives must have been shown to the end once.")
    take_back: bool = Field(False, description="The last answer can be taken back until the next one.")


class RecruitmentSection(Section):
    """Who can join when; nobody who is in a session is sent away by it."""

    opens: AwareDatetime | None = Field(
        None, description="Nobody can begin before; such as 2026-12-01T09:00:00+01:00."
    )
    closes: AwareDatetime | None = Field(None, description="Nobody new can begin from then on.")
    places: int | None = Field(
        None, ge=1, description="Completed sessions wanted, in all conditions together."
    )
    hold_hours: float = Field(
        24.0, gt=0, description="A place is kept for somebody of whom nothing is heard for so long."
    )

    @model_validator(mode="after")
    def _opens_before_it_closes(self) -> RecruitmentSection:
        if self.opens is not None and self.closes is not None and self.opens >= self.closes:
            raise ValueError("closes must be later than opens")
        return self


class ExclusionSection(Section):
    """Who is left out of the analysis, decided before anybody has answered."""

    least_checks_passed: float | None = Field(
        None, gt=0, le=1, description="Share of checks answered as told."
    )
    least_repeats_agreed: float | None = Field(
        None, gt=0, le=1, description="Share of repeated queries answered as the first time."
    )
    most_one_side: float | None = Field(
        None, ge=0.5, lt=1, description="Share of answers that chose the same side of the screen."
    )
    least_median_response_ms: int | None = Field(
        None, gt=0, description="Half of the answers took at least so long."
    )


class PaymentSection(Section):
    """What people are paid."""

    amount: float = Field(ge=0, description="To each who completes, in the currency's units.")
    currency: str = Field(pattern=r"^[A-Z]{3}$", description="Three letters (ISO 4217), such as EUR.")
    fee: float = Field(0.0, ge=0, le=2, description="What the recruiting service takes, as a share of it.")


class DataSection(Section):
    """What is kept, and for how long."""

    forget_ids_after_days: int | None = Field(
        None,
        ge=1,
        description="Ids by which others know people are forgotten so long after a session that has ended began.",
    )


class SessionSection(Section):
    """How long a session can be resumed."""

    max_age_hours: float | None = Field(None, gt=0, description="From its beginning; for ever without it.")
    when_old: Literal["restart", "end"] = Field(
        "end", description="What happens to somebody who comes back later than that."
    )


class StudyFile(Section):
    """The whole file."""

    name: Name = Field(description="Used in links and file names.")
    title: Words = Field(description="What people see above every page.")
    seed: int = Field(ge=0, description="Of everything random in it.")
    domain: str = Field(description="Whose trajectories people compare, such as `driving-v1`.")
    languages: tuple[Language, ...] = Field(("en",), min_length=1, description="The first is the default.")
    text: dict[str, Words] = Field(description="What the participant reads, by name; Markdown.")
    path: Path = Field(QUERIES_ALONE, description="What people go through, in this order.")
    questionnaire: Questionnaires = Field({}, description="Items of each questionnaire.")
    endings: dict[str, EndingSection] = Field({}, description="What people get at each ending.")
    answering: AnsweringSection = AnsweringSection()
    recruitment: RecruitmentSection = RecruitmentSection()
    session: SessionSection = SessionSection()
    protocol: ProtocolSection
    response: ResponseSection
    prior: PriorSection
    sampler: SamplerSection
    acquisition: AcquisitionSection
    trajectory: TrajectorySection
    learning: LearningSection = LearningSection()
    exclusion: ExclusionSection = ExclusionSection()
    payment: PaymentSection | None = None
    data: DataSection = DataSection()
    condition: tuple[ConditionSection, ...] = Field((), description="The arms of an experiment.")
    arm: Name | None = Field(None, description="The one condition that the file is of.")

    @field_validator("path")
    @classmethod
    def _path_has_an_order(cls, path: Path) -> Path:
        kinds = [step.step for step in path]
        if kinds.count("queries") != 1:
            raise ValueError('path must have exactly one step "queries"')
        if kinds.count("practice") > 1 or "practice" in kinds[kinds.index("queries") :]:
            raise ValueError('path can have one step "practice", before "queries"')
        if kinds.count("consent") > 1 or ("consent" in kinds and kinds[0] != "consent"):
            raise ValueError('path can have one step "consent", and it comes first')
        return path

    @field_validator("questionnaire")
    @classmethod
    def _items_have_names_of_their_own(cls, questionnaires: Questionnaires) -> Questionnaires:
        for name, items in questionnaires.items():
            names = [item.name for item in items]
            if len(set(names)) != len(names):
                raise ValueError(f"the items of '{name}' must have different names")
        return questionnaires

    @field_validator("endings")
    @classmethod
    def _endings_are_known(cls, endings: dict[str, EndingSection]) -> dict[str, EndingSection]:
        unknown = set(endings) - set(Ending)
        if unknown:
            close = difflib.get_close_matches(min(unknown), list(Ending), n=1)
            hint = f"did you mean '{close[0]}'?" if close else f"expected one of: {', '.join(Ending)}"
            raise ValueError(f"no ending is called '{min(unknown)}'; {hint}")
        return endings

    @model_validator(mode="after")
    def _conditions_are_arms(self) -> StudyFile:
        names = [condition.name for condition in self.condition]
        if len(names) == 1 or len(set(names)) != len(names):
            raise ValueError("there must be no condition, or at least two, with different names")
        if self.arm is not None and self.arm not in names:
            raise ValueError(f"no condition is called '{self.arm}'; expected one of: {', '.join(names)}")
        return self

    @model_validator(mode="after")
    def _questionnaires_are_there(self) -> StudyFile:
        for name in needed_questionnaires(self.path):
            if name not in self.questionnaire:
                raise ValueError(
                    f"no questionnaire is called '{name}'; add [[questionnaire.{name}]] or the file {name}.toml in "
                    "the study's folder"
                )
        check = next(
            (step.check for step in self.path if isinstance(step, PracticeStep) and step.check), None
        )
        if check and not any(getattr(item, "right", None) is not None for item in self.questionnaire[check]):
            raise ValueError(
                f"the check '{check}' needs an item with a right answer; add `right = ...` to one"
            )
        return self

    @model_validator(mode="after")
    def _texts_are_there(self) -> StudyFile:
        for name in needed_texts(self.path, self.endings):
            if name not in self.text:
                raise ValueError(
                    f"no text is called '{name}'; add [text.{name}] or files such as "
                    f"{name}.{self.languages[0]}.md in the study's folder"
                )
        return self

    @model_validator(mode="after")
    def _texts_are_in_every_language(self) -> StudyFile:
        for where, words in _all_words(self):
            known = self.languages[:1] if isinstance(words, str) else words
            missing = [language for language in self.languages if language not in known]
            if missing:
                raise ValueError(f"'{where}' is missing in {', '.join(missing)}; add it in every language")
        return self

    @model_validator(mode="after")
    def _a_feature_comes_in_time(self) -> StudyFile:
        every = self.learning.feature_every
        if every is not None and every >= self.protocol.active_queries:
            raise ValueError(
                f"learning.feature_every must be less than protocol.active_queries, {self.protocol.active_queries}, "
                f"for a query to be chosen with the feature; got {every}"
            )
        return self

    @model_validator(mode="after")
    def _learning_knows_the_scale_of_rewards(self) -> StudyFile:
        is_learning = self.learning.people_before or self.learning.feature_every is not None
        if is_learning and (self.prior.support, self.response.rationality) != ("sphere", "inferred"):
            raise ValueError(
                'the section learning needs prior.support = "sphere" and response.rationality = "inferred": what is '
                "learned comes in units of the person's own rationality"
            )
        return self


def _all_words(file: StudyFile) -> Iterator[tuple[str, Words]]:
    """Gives everything that a participant may read, and where in the file it stands."""
    yield "title", file.title
    for name, words in file.text.items():
        yield f"text.{name}", words
    for name, items in file.questionnaire.items():
        for item in items:
            for key in ("label", "low", "high"):
                if hasattr(item, key):
                    yield f"questionnaire.{name}.{item.name}.{key}", getattr(item, key)
            for option in getattr(item, "options", ()):
                yield f"questionnaire.{name}.{item.name}.{option.name}", option.label
