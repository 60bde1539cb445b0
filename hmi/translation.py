"""Translation: message catalogues of the folder `locale`, one file for each page and language."""

import io
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from functools import cache
from pathlib import Path
from string import Formatter

import babel
from babel.messages.pofile import read_po
from markupsafe import Markup

from station.messages.message import ENGLISH, VERBATIM, Definition, Message, Renderer
from station.settings.hmi import Language

FOLDER = Path(__file__).with_name("locale")
SOURCE: Language = "en"
_DECIMAL = {"en": ".", "de": ",", "es": ","}
_NUMBER = re.compile(r"(?<![\w.])([0-9]+)\.([0-9]+)(?![\w.])")
_DAY = {"en": "%Y-%m-%d", "de": "%d.%m.%Y", "es": "%d/%m/%Y"}
NO_VALUE = "–"  # noqa: RUF001 (for a value that was not measured)


@cache
def catalogue(language: Language) -> Mapping[str, str]:
    """Return all texts of a language by their keys, `page.what`; a key begins with its file's name.

    Raises:
        ValueError: a key is in another page's file.
    """
    texts: dict[str, str] = {}
    for file in sorted((FOLDER / language).glob("*.json")):
        for key, text in json.loads(file.read_text(encoding="utf-8")).items():
            if key.partition(".")[0] != file.stem:
                raise ValueError(f"{file}: the key {key} belongs into {key.partition('.')[0]}.json")
            texts[key] = text
    return texts


@cache
def sentence_patterns() -> tuple[tuple[str, re.Pattern[str]], ...]:
    """Return the station's own sentences, `sentence.*` of the English catalogue, as patterns; the most specific first.

    A device's fault, `sentence.fault_of_*`, encloses an observation and a remedy: these patterns come first.
    """
    texts = {key: text for key, text in catalogue(SOURCE).items() if key.startswith("sentence.")}
    parts = {key: list(Formatter().parse(text)) for key, text in texts.items()}
    patterns = {
        key: "".join(re.escape(literal) + (f"(?P<{name}>.*?)" if name else "") for literal, name, _, _ in pieces)
        for key, pieces in parts.items()
    }
    order = sorted(
        parts,
        key=lambda key: (not key.startswith("sentence.fault_of_"), -sum(len(literal) for literal, *_ in parts[key])),
    )
    return tuple((key, re.compile(patterns[key], re.DOTALL)) for key in order)


@cache
def translations(language: Language) -> Mapping[str, tuple[str, ...]]:
    """Return the translations of the station's messages by their ids: one form, or one for each plural.

    Args:
        language: the folder below `locale` whose `.po` files are read.
    """
    found: dict[str, tuple[str, ...]] = {}
    for file in sorted((FOLDER / language).glob("*.po")):
        for entry in read_po(io.BytesIO(file.read_bytes()), locale=language):
            forms = tuple(entry.string) if isinstance(entry.string, list | tuple) else (entry.string,)
            if entry.context and not entry.fuzzy:
                found[entry.context] = tuple(form for form in forms if form)
    return found


@cache
def renderer(language: Language) -> Renderer:
    """Return how messages are written in a language: by its catalogue, and with its decimal sign.

    Args:
        language: English is the definitions' own.
    """
    if language == SOURCE:
        return ENGLISH
    rule = babel.Locale.parse(language).plural_form
    known = translations(language)

    def form(definition: Definition, count: float) -> str:
        forms = known.get(definition.id)
        if not forms:
            return ENGLISH.form(definition, count)
        return forms[0 if rule(count) == "one" else -1]

    def number(value: float, digits: int | None) -> str:
        return ENGLISH.number(value, digits).replace(".", _DECIMAL[language])

    return Renderer(form, number)


@dataclass(frozen=True, slots=True)
class Locale:
    """Texts, numbers and times in one language."""

    language: Language

    def text(self, key: str, **values: object) -> str:
        """Return a text; in English if the language has none, which a test refuses.

        Args:
            key: as in the catalogue.
            values: for the text's braces.

        Raises:
            KeyError: no language has it.
        """
        known = catalogue(self.language).get(key)
        text = catalogue(SOURCE)[key] if known is None else known
        return text.format(**values) if values else text

    def own(self, key: str, english: str) -> str:
        """Translate a text that the station sends in English; unchanged if the catalogue has none."""
        return catalogue(self.language).get(key, english)

    def sentence(self, english: str | Message | None) -> str:
        """Write a message in this language; in English, and marked as that, where it has no translation.

        Args:
            english: a message, None for an empty text; as long as some rooms send sentences, also one of those.
        """
        if english is None:
            return ""
        if isinstance(english, Message):
            if english.id != VERBATIM.id:
                return renderer(self.language).sentence(english)
            english = str(english)
        if self.language == SOURCE:
            return english
        found = self._translated(english)
        return Markup('<span lang="en">{}</span>').format(english) if found is None and english else found or ""

    def _translated(self, english: str) -> str | None:
        for key, pattern in sentence_patterns():
            if (found := pattern.fullmatch(english)) is not None:
                return self.text(key, **{name: self._value(value) for name, value in found.groupdict().items()})
        return None

    def _value(self, text: str) -> str:
        """Translate a part of a sentence: a number, another sentence, or a name."""
        lead = text.removesuffix(" ")
        if (found := self._translated(lead)) is not None:
            return found + text[len(lead) :]
        return _NUMBER.sub(rf"\1{_DECIMAL[self.language]}\2", text)

    def number(self, value: float | None, digits: int = 0) -> str:
        """Format a number with the language's decimal sign and a thin space between thousands.

        Args:
            value: None is shown as a dash.
            digits: behind the decimal sign.
        """
        if value is None:
            return NO_VALUE
        return f"{value:,.{digits}f}".replace(".", "\0").replace(",", "\u202f").replace("\0", _DECIMAL[self.language])

    def percent(self, share: float | None, digits: int = 0) -> str:
        """Format a fraction of one as a percentage.

        Args:
            share: None is shown as a dash.
            digits: behind the decimal sign.
        """
        if share is None:
            return NO_VALUE
        return f"{self.number(100 * share, digits)}{'' if self.language == 'en' else chr(0xA0)}%"

    @staticmethod
    def clock(utc_ms: int) -> str:
        """Format a time of day, in the machine's zone."""
        return datetime.fromtimestamp(utc_ms / 1000).astimezone().strftime("%H:%M:%S")

    def day(self, utc_ms: int) -> str:
        """Format a date, in the machine's zone."""
        return datetime.fromtimestamp(utc_ms / 1000).astimezone().strftime(_DAY[self.language])


def preferred(languages: tuple[Language, ...], cookie: str, accepted: str) -> Language:
    """Return the language to show.

    Args:
        languages: the site's.
        cookie: what the person chose; may be anything.
        accepted: the browser's Accept-Language.
    """
    wished = (part.partition(";")[0].strip().partition("-")[0].lower() for part in accepted.split(",")[:20])
    order = [cookie, *wished]
    places: dict[Language, int] = {language: order.index(language) for language in languages if str(language) in order}
    return min(places, key=places.__getitem__) if places else languages[0]
