"""What all sections of a study file have in common: they are checked strictly, frozen, and know no unknown key."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, field_validator

LANGUAGE = r"^[a-z]{2,3}(-[A-Za-z0-9]{2,8})*$"

NAME = r"^[a-z0-9][a-z0-9-]*$"

Name = Annotated[str, Field(pattern=NAME)]
"""What something in the file is called by the rest of it."""

Language = Annotated[str, Field(pattern=LANGUAGE)]
"""A language's code (BCP 47), such as `en` or `pt-BR`."""


def _kind_of_words(value: object) -> str:
    return "<by language>" if isinstance(value, dict) else "<one text>"


# Tags in angle brackets choose between kinds of a value; they are no part of the file (see `study_file.explain`).
Words = Annotated[
    Annotated[str, Tag("<one text>")] | Annotated[dict[Language, str], Tag("<by language>")],
    Discriminator(_kind_of_words),
]
"""What a participant reads: one text, or one in each language."""


class Section(BaseModel):
    """Root of a study file's sections."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _list_is_tuple(cls, value: object) -> object:
        """TOML has lists; what is frozen has tuples."""
        return tuple(value) if isinstance(value, list) else value


def words_in(words: Words, language: str) -> str:
    """Returns a text in a language that it is there in."""
    return words if isinstance(words, str) else words[language]
