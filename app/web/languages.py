"""The pages' own words in a person's language: gettext catalogues, text direction and numbers, all by Babel.

English is what stands in the code. Every other language is one file, `static/locale/LANGUAGE/LC_MESSAGES/prefstudy.po`,
which `make messages` brings up to date; it is compiled in memory when it is first needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import lru_cache
from gettext import GNUTranslations, NullTranslations
from io import BytesIO

from babel import Locale, UnknownLocaleError, negotiate_locale
from babel.dates import format_date, format_time, get_timezone_gmt
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po
from babel.numbers import format_decimal, format_percent
from babel.units import format_unit

from app.settings import STATIC

ORIGINAL = "en"
CATALOGUES = STATIC / "locale"


def N_(message: str) -> str:  # noqa: N802 (gettext's own name)
    """Marks a message for the catalogues where it can't be translated yet, because nobody knows for whom."""
    return message


@lru_cache
def interface_languages() -> tuple[str, ...]:
    """Returns the languages that the pages' own words exist in, as BCP 47 tags, English first."""
    folders = sorted(folder.name for folder in CATALOGUES.iterdir() if folder.is_dir())
    return (ORIGINAL, *(folder.replace("_", "-") for folder in folders))


@lru_cache
def translator(language: str) -> NullTranslations:
    """Returns what translates into a language (`gettext`, `ngettext`); it leaves English where there is no translation.

    Args:
        language: BCP 47 tag; `de-AT` finds the catalogue `de`.
    """
    known = negotiate_locale([language], interface_languages(), sep="-")
    if known is None or known == ORIGINAL:
        return NullTranslations()
    folder = known.replace("-", "_")
    with (CATALOGUES / folder / "LC_MESSAGES" / "prefstudy.po").open("rb") as file:
        catalogue = read_po(file, locale=folder)
    compiled = BytesIO()
    write_mo(compiled, catalogue)
    compiled.seek(0)
    return GNUTranslations(compiled)


def text_direction(language: str) -> str:
    """Returns `ltr` or `rtl`, as HTML's `dir` wants it."""
    return _locale(language).text_direction


def language_name(language: str) -> str:
    """Returns what a language calls itself, e.g. `Deutsch`."""
    name = _locale(language).get_display_name(language)
    return name or language


def format_number(value: float, language: str) -> str:
    """Returns a number as the language writes it, e.g. `1.234,5` in German."""
    return format_decimal(value, locale=_locale(language))


def format_share(share: float, language: str) -> str:
    """Returns a share of 1 as the language writes percent, e.g. `42 %` in German."""
    return format_percent(share, locale=_locale(language))


def format_minutes(minutes: int, language: str) -> str:
    """Returns a duration in words, e.g. `12 minutes`."""
    return format_unit(minutes, "duration-minute", locale=_locale(language))


def format_moment(moment: datetime, language: str) -> str:
    """Returns an aware moment as the language writes it, with the day of the week and the offset of its own clock."""
    locale = _locale(language)
    day = format_date(moment, "full", locale=locale)
    time = format_time(moment, "short", tzinfo=moment.tzinfo, locale=locale)
    return f"{day}, {time} ({get_timezone_gmt(moment, 'long', locale=locale)})"


def choose_language(wanted: str | None, accept_language: str | None, available: Sequence[str]) -> str:
    """Returns the language to speak with a person.

    Args:
        wanted: What they asked for by name, if they did; it counts before the browser's settings.
        accept_language: The browser's `Accept-Language` header.
        available: BCP 47 tags, the default first.
    """
    asked = ([wanted] if wanted else []) + _accepted(accept_language or "")
    found = negotiate_locale(asked, available, sep="-")
    # Babel gives it back as it was asked for.
    return next((tag for tag in available if found and tag.casefold() == found.casefold()), available[0])


def _accepted(header: str) -> list[str]:
    """Returns the tags of an `Accept-Language` header (RFC 9110, 12.5.4), the dearest first."""
    weighted = []
    for part in header.split(","):
        tag, _, parameter = part.partition(";")
        weight = _weight(parameter)
        if tag.strip() and weight > 0.0:
            weighted.append((weight, tag.strip()))
    return [tag for _, tag in sorted(weighted, key=lambda each: -each[0])]


def _weight(parameter: str) -> float:
    """Returns the q of `q=0.8`: 1 unless it is given, 0 if nobody can read it."""
    name, _, value = parameter.partition("=")
    if not name.strip():
        return 1.0
    try:
        return min(float(value), 1.0)
    except ValueError:
        return 0.0


@lru_cache
def _locale(language: str) -> Locale:
    """Returns what Babel knows of a language; a tag that it has never heard of is written like English."""
    try:
        return Locale.parse(language, sep="-")
    except (UnknownLocaleError, ValueError):
        return Locale.parse(ORIGINAL)
