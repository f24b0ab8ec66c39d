"""What a study's TOML file may hold: its sections and their keys, checked, and what is said where one is wrong."""

from __future__ import annotations

import difflib
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    field_validator,
    model_validator,
)

from study_core.online.schedule import FEWEST_ANSWERS, LEAD

# Products of a few probabilities as small as this are still numbers.
_SMALLEST_LAPSE_RATE = 1e-9

AnswerName = Literal["a", "b", "same", "unsure", "skip"]


def _kind_of_setting(value: object) -> str:
    """Returns how a setting that may be a number or a word is to be read, so that errors speak of that alone."""
    return "word" if isinstance(value, str) else "number"


Rationality = Annotated[
    Annotated[float, Field(ge=1e-6, le=1e6), Tag("number")]
    | Annotated[Literal["inferred", "evidence"], Tag("word")],
    Discriminator(_kind_of_setting),
]
LapseRate = Annotated[
    Annotated[float, Field(ge=0, le=0.999), Tag("number")]
    | Annotated[Literal["inferred", "evidence"], Tag("word")],
    Discriminator(_kind_of_setting),
]
TieThreshold = Annotated[
    Annotated[float, Field(ge=1e-3, le=50), Tag("number")] | Annotated[Literal["inferred"], Tag("word")],
    Discriminator(_kind_of_setting),
]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class TextSection(_Section):
    """What the participant reads."""

    welcome: str = Field(description="First page, plain paragraphs separated by empty lines.")
    question: str = Field(description="Above every pair.")
    thanks: str = Field(description="Last page.")


class ProtocolSection(_Section):
    """How many queries."""

    active_queries: int = Field(
        ge=1, le=10_000, description="Queries chosen by what the answers so far leave open."
    )
    test_queries: int = Field(
        ge=0, le=10_000, description="Common queries, the same for everyone, kept out of the posterior."
    )

    @property
    def n_queries(self) -> int:
        """Returns how many queries a session has."""
        return self.active_queries + self.test_queries


class ResponseSection(_Section):
    """How people are assumed to answer."""

    model: Literal["sigmoid", "clipped-linear"]
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

    @field_validator("answers", mode="before")
    @classmethod
    def _list_is_tuple(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value

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


class PriorSection(_Section):
    """Where the weights may lie."""

    support: Literal["ball", "sphere"]


class SamplerSection(_Section):
    """How much the posterior draws."""

    samples: int = Field(ge=2, le=5000, description="M, the draws that the acquisition sees.")
    chains: int = Field(4, ge=2, le=16)
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


class AcquisitionSection(_Section):
    """How the next pair is chosen."""

    method: str
    mu: float = Field(0.1, ge=0, description="Weight of the distance between the two samples.")
    min_difference: float = Field(
        0.0, ge=0, description="How far apart the two trajectories must look, in body lengths."
    )


class TrajectorySection(_Section):
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


class LearningSection(_Section):
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


class StudyFile(_Section):
    """The whole file."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9-]*$", description="Used in links and file names.")
    title: str
    seed: int = Field(ge=0)
    domain: str
    text: TextSection
    protocol: ProtocolSection
    response: ResponseSection
    prior: PriorSection
    sampler: SamplerSection
    acquisition: AcquisitionSection
    trajectory: TrajectorySection
    learning: LearningSection = LearningSection()

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


def explain(error: ValidationError) -> str:
    """Returns one line about the first thing that is wrong, and how many more there are."""
    # A misspelt key is also a missing one; its own spelling says more.
    problems = sorted(
        error.errors(include_url=False), key=lambda problem: problem["type"] != "extra_forbidden"
    )
    line = _explain_one(problems[0])
    return line if len(problems) == 1 else f"{line} ({len(problems) - 1} more after this one)"


def _explain_one(problem: Any) -> str:
    message = problem["msg"].removeprefix("Value error, ")
    if not problem["loc"]:
        # About several sections together; the message names their keys.
        return f"{message[0].lower()}{message[1:]}."
    # What `_kind_of_setting` says isn't a part of the file.
    *section, key = [part for part in problem["loc"] if part not in ("number", "word")]
    where = ".".join(str(part) for part in (*section, key))
    if problem["type"] == "extra_forbidden":
        known = _keys_of(section)
        close = difflib.get_close_matches(str(key), known, n=1)
        hint = f"did you mean '{close[0]}'?" if close else f"expected one of: {', '.join(known)}."
        return f"unknown key '{where}'; {hint}"
    if problem["type"] == "missing":
        return f"key '{where}' is missing; add it."
    line = f"key '{where}': {message[0].lower()}{message[1:]}"
    # What is wrong with several keys together is said in full; the whole section would only hide it.
    return f"{line}." if isinstance(problem["input"], dict) else f"{line}, got {problem['input']!r}."


def _keys_of(section: list[Any]) -> list[str]:
    """Returns the keys that a section of the file knows."""
    model: type[BaseModel] = StudyFile
    for part in section:
        annotation: Any = model.model_fields[str(part)].annotation
        model = annotation
    return list(model.model_fields)
