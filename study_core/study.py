"""A study, as its TOML file defines it: read, checked and hashed, and what follows from the file."""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

from pydantic import ValidationError

from study_core.acquisition import acquisition_named
from study_core.bank import Bank, open_bank
from study_core.choice import ResponseModel
from study_core.comparison import Choice
from study_core.conditions import arm_text, changed, file_text
from study_core.domain import Domain, domain_named
from study_core.errors import StudyError, StudyProblem, UnknownNameError
from study_core.explanation import explain, explain_all
from study_core.knowledge import NOTHING, Knowledge
from study_core.online.rewards import FEATURE_NAME, rewards_with
from study_core.path import PracticeStep
from study_core.posterior.prior import Prior
from study_core.posterior.run import SamplerSettings
from study_core.rewards import Rewards
from study_core.section import words_in
from study_core.study_file import ProtocolSection, StudyFile
from study_core.study_folder import with_its_folder


@dataclass(frozen=True)
class Study:
    """A checked study: its file's text, which a session keeps for ever, and what the text says.

    Attributes:
        text: The file's.
        file: What it says.
        knowledge: What a session that takes part in it knows besides; nothing in the study itself.
    """

    text: str
    file: StudyFile
    knowledge: Knowledge = NOTHING

    @cached_property
    def hash(self) -> str:
        """Returns the SHA-256 of the file's text, in hex."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @cached_property
    def version(self) -> str:
        """Returns the SHA-256 of the study file's text, in hex: the same for all its arms."""
        return hashlib.sha256(file_text(self.text).encode()).hexdigest()

    @property
    def condition(self) -> str | None:
        """Returns the condition whose arm this is; None for a whole study."""
        return self.file.arm

    @cached_property
    def arms(self) -> tuple[Study, ...]:
        """Returns the studies under which sessions are created: one a condition, or itself."""
        if self.condition is not None or not self.file.condition:
            return (self,)
        return tuple(parse_study(arm_text(self.text, each.name)) for each in self.file.condition)

    @property
    def name(self) -> str:
        """Returns the study's name."""
        return self.file.name

    @property
    def seed(self) -> int:
        """Returns the seed of all its random streams."""
        return self.file.seed

    @property
    def protocol(self) -> ProtocolSection:
        """Returns the numbers of queries."""
        return self.file.protocol

    @property
    def languages(self) -> tuple[str, ...]:
        """Returns the codes of the languages it can be taken in, the default first."""
        return self.file.languages

    def title(self, language: str) -> str:
        """Returns its title in one of its languages."""
        return words_in(self.file.title, language)

    def text_named(self, name: str, language: str) -> str:
        """Returns a text in one of its languages."""
        return words_in(self.file.text[name], language)

    def text_hash(self, name: str, language: str) -> str:
        """Returns the SHA-256 of a text in one of its languages, in hex."""
        return hashlib.sha256(self.text_named(name, language).encode()).hexdigest()

    @cached_property
    def n_practice(self) -> int:
        """Returns how many queries are for practice; they come first."""
        return sum(step.queries for step in self.file.path if isinstance(step, PracticeStep))

    @property
    def first_test(self) -> int:
        """Returns the index of the first common test query, all of which come last."""
        protocol = self.protocol
        return self.n_practice + protocol.active_queries + protocol.repeats + protocol.checks

    @property
    def n_queries(self) -> int:
        """Returns how many queries a session has, of all kinds."""
        return self.first_test + self.protocol.test_queries

    @cached_property
    def domain(self) -> Domain:
        """Returns the domain plug-in."""
        return domain_named(self.file.domain)

    @property
    def uses_bank(self) -> bool:
        """Returns whether its method or its search needs the domain's bank of local optima."""
        method = acquisition_named(self.file.acquisition.method)
        return method.needs_bank or self.file.trajectory.search == "bank"

    @cached_property
    def bank(self) -> Bank | None:
        """Returns the domain's bank, built on the machine's first use, or None if the study has no use for one."""
        return open_bank(self.domain) if self.uses_bank else None

    @cached_property
    def response(self) -> ResponseModel:
        """Returns the response model."""
        section = self.file.response
        return ResponseModel(
            section.model, section.rationality, section.lapse_rate, section.tie_threshold or 0.0
        )

    @cached_property
    def answers(self) -> tuple[Choice, ...]:
        """Returns what a person may answer, A and B first."""
        return tuple(Choice(name) for name in self.file.response.answers)

    @cached_property
    def prior(self) -> Prior:
        """Returns the prior over the domain's weights."""
        return Prior(self.file.prior.support, len(self.domain.feature_names))

    @property
    def weight_names(self) -> tuple[str, ...]:
        """Returns the names of all weights that a session's posterior may have, in their order."""
        learned = () if self.file.learning.feature_every is None else (FEATURE_NAME,)
        return (*self.domain.feature_names, *learned)

    @cached_property
    def rewards(self) -> Rewards:
        """Returns what posteriors and queries run over, with all that is known."""
        prior = replace(self.prior, population=self.knowledge.population)
        rewards = Rewards(self.domain, prior, self.bank)
        feature = self.knowledge.feature
        return rewards if feature is None else rewards_with(rewards, feature)

    def knowing(self, knowledge: Knowledge) -> Study:
        """Returns the study as a session with that knowledge goes on in it."""
        return replace(self, knowledge=knowledge)

    @cached_property
    def sampler(self) -> SamplerSettings:
        """Returns the sampler's settings."""
        section = self.file.sampler
        return SamplerSettings(
            section.chains, section.warmup, section.draws, section.most_draws, section.samples
        )


@lru_cache(maxsize=32)
def parse_study(text: str, source: str = "study file") -> Study:
    """Returns the study that a TOML text defines.

    Args:
        text: The file's content.
        source: What to call it in errors, e.g. its path.

    Raises:
        StudyError: Not TOML, a key missing, unknown or of the wrong kind; the message names the key and what was
            expected.
    """
    try:
        content = tomllib.loads(text)
        study = Study(text, StudyFile.model_validate(changed(content)))
        acquisition_named(study.file.acquisition.method)
        domain_named(study.file.domain)
    except tomllib.TOMLDecodeError as error:
        raise StudyError(f"{source}: not valid TOML: {error}. Mend that line.") from error
    except ValidationError as error:
        raise StudyError(f"{source}: {explain(error)}", explain_all(error)) from error
    except UnknownNameError as error:
        place = ("domain",) if error.what == "domain" else ("acquisition", "method")
        raise StudyError(f"{source}: {error}", (StudyProblem(place, str(error)),)) from error
    if study.condition is None:
        _check_conditions(study, source)
    return study


def _check_conditions(study: Study, source: str) -> None:
    """Raises a StudyError if an arm of the study isn't a study."""
    for condition in study.file.condition:
        parse_study(arm_text(study.text, condition.name), f"{source}, condition '{condition.name}'")


def read_study(path: Path, library: Path | None = None) -> Study:
    """Returns the study in a file, with what its folder or the library adds to it.

    Args:
        path: Of the TOML file; see `study_folder` for what stands beside it.
        library: Folder of ready texts and questionnaires.

    Raises:
        StudyError: The file can't be read or isn't a study.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(
            f"Can't read the study file {path}: {error}. Give the path of a TOML file."
        ) from error
    return parse_study(with_its_folder(text, path.with_suffix(""), library), source=str(path))
