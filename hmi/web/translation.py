"""Translation: one message catalogue, a `.po` file, for each module of texts and each language.

Those of a page's texts are beside them, as `hmi/run/de.po`; those of `station/messages` are in `hmi/locale/de`.
"""

import gettext
import io
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from functools import cache
from math import isfinite
from pathlib import Path

import babel
from babel.dates import format_date
from babel.messages.plurals import get_plural
from babel.messages.pofile import read_po
from babel.numbers import NumberPattern, get_decimal_symbol, get_group_symbol, parse_pattern
from markupsafe import Markup

from hmi.web.folders import HMI
from hmi.web.text import texts
from station.messages import recipes
from station.messages.message import ENGLISH, VERBATIM, Definition, Message, Renderer, fields
from station.settings.hmi import Language

SOURCE: Language = "en"
_FIGURE = re.compile(r"-?\d+\.\d+")
_THIN_SPACE = "\u202f"
NO_VALUE = "–"  # noqa: RUF001 (for a value that was not measured)


@cache
def translations(language: Language) -> Mapping[str, tuple[str, ...]]:
    """Return the translations of the station's messages by their ids: one form, or one for each plural."""
    return _read(sorted(HMI.glob(f"locale/{language}/*.po")), language)


@cache
def page_translations(language: Language) -> Mapping[str, tuple[str, ...]]:
    """Return the translations of the pages' texts by their ids."""
    return _read(sorted(HMI.glob(f"*/{language}.po")), language)


def _read(files: Iterable[Path], language: Language) -> dict[str, tuple[str, ...]]:
    found: dict[str, tuple[str, ...]] = {}
    for file in files:
        for entry in read_po(io.BytesIO(file.read_bytes()), locale=language):
            english, forms = forms_of(entry.id), tuple(form for form in forms_of(entry.string) if form)
            # A translation of an earlier English serves until it is reviewed, unless its values are others.
            if entry.context and forms and (not entry.fuzzy or fields(forms[-1]) == fields(english[-1])):
                found[entry.context] = forms
    return found


def forms_of(text: object) -> tuple[str, ...]:
    """Return a catalogue's text as one form, or as one for each plural."""
    return tuple(map(str, text)) if isinstance(text, list | tuple) else (str(text),)


@cache
def renderer(language: Language) -> Renderer:
    """Return how the station's messages are written in a language.

    Args:
        language: English is the definitions' own.
    """
    if language == SOURCE:
        return ENGLISH
    return Renderer(_chooser(language, translations(language)), lambda value, digits: _figure(language, value, digits))


@cache
def page_renderer(language: Language) -> Renderer:
    """Return how the pages' texts are written in a language."""
    if language == SOURCE:
        return ENGLISH
    return Renderer(_chooser(language, page_translations(language)), ENGLISH.number)


def _chooser(language: Language, known: Mapping[str, tuple[str, ...]]) -> Callable[[Definition, float], str]:
    """Make the choice among a text's plural forms, by the language's gettext rule."""
    rule = gettext.c2py(get_plural(language).plural_expr)

    def form(definition: Definition, count: float) -> str:
        forms = known.get(definition.id)
        if not forms:
            return ENGLISH.form(definition, count)
        return forms[min(rule(int(count)), len(forms) - 1)] if float(count).is_integer() else forms[-1]

    return form


def _figure(language: Language, value: float, digits: int | None) -> str:
    """Format a number in a sentence: rounded as in English, with the language's decimal sign, without thousands."""
    return ENGLISH.number(value, digits).replace(".", get_decimal_symbol(language))


@cache
def _pattern(language: Language, digits: int, *, percent: bool) -> NumberPattern:
    formats = babel.Locale.parse(language)
    pattern = parse_pattern((formats.percent_formats if percent else formats.decimal_formats)[None].pattern)
    pattern.frac_prec = digits, digits
    return pattern


@cache
def _day_pattern(language: Language) -> str:
    """Return the order and signs of the language's short date, with two digits for day and month and four for the year.

    In English it is ISO 8601's: day and month are read in either order.
    """
    if language == SOURCE:
        return "yyyy-MM-dd"
    short = babel.Locale.parse(language).date_formats["short"].pattern
    return re.sub("y+", "yyyy", re.sub("M+", "MM", re.sub("d+", "dd", short)))


@dataclass(frozen=True, slots=True)
class Locale:
    """Texts, numbers and times in one language."""

    language: Language

    def text(self, key: str, **values: object) -> str:
        """Return a text; in English if the language has none, which a test refuses.

        Args:
            values: for the text's braces; the one that decides between its forms is a number.

        Raises:
            KeyError: it is not defined.
        """
        known = texts()[key]
        count = values.get(known.counted, 1)
        form = page_renderer(self.language).form(known, count if isinstance(count, int | float) else 1)
        return form.format(**values) if values else form

    def own(self, key: str, english: str) -> str:
        """Translate a text that the station sends in English; unchanged if the catalogue has none."""
        if key in texts():
            return self.text(key)
        known = page_translations(self.language).get(key)
        return english if known is None else known[0]

    def title(self, title: str) -> str:
        """Translate a shipped recipe's title; a site's own is shown as it is."""
        return self.own(f"fruit.{title}", title)

    def sentence(self, said: Message | str | None) -> str:
        """Write a message in this language. A text that is not the station's is marked as English on other pages.

        Args:
            said: a message, or a text of a library, of an operating system or of a record from before messages;
                None for an empty text.
        """
        if isinstance(said, Message) and said.id != VERBATIM.id:
            return renderer(self.language).sentence(said)
        words = "" if said is None else str(said)
        return Markup('<span lang="en">{}</span>').format(words) if words and self.language != SOURCE else words

    def reason(self, given: str) -> str:
        """Translate a stored reason if the station itself gave it; a person's own text is unchanged."""
        own = next((message for reason in recipes.OWN_REASONS if str(message := reason()) == given), None)
        return given if own is None else self.sentence(own)

    def figure(self, text: str) -> str:
        """Write a number of a recipe's file with the language's decimal sign; any other text is shown as it is."""
        return text.replace(".", self.decimal_sign) if _FIGURE.fullmatch(text) else text

    def number(self, value: float | None, digits: int = 0) -> str:
        """Format a number with the language's decimal sign and a thin space between thousands.

        Args:
            value: None is shown as a dash.
            digits: behind the decimal sign.
        """
        return self._formatted(value, digits, percent=False)

    def percent(self, share: float | None, digits: int = 0) -> str:
        """Format a fraction of one as a percentage.

        Args:
            share: None is shown as a dash.
            digits: behind the decimal sign.
        """
        return self._formatted(None if share is None else 100 * share, digits, percent=True)

    def _formatted(self, value: float | None, digits: int, *, percent: bool) -> str:
        if value is None or not isfinite(value):
            return NO_VALUE
        rounded = Decimal(f"{value:.{digits}f}")  # as `str(message)` rounds: a page and a log show the same digits
        pattern = _pattern(self.language, digits, percent=percent)
        written = pattern.apply(rounded / 100 if percent else rounded, self.language)
        return written.replace(get_group_symbol(self.language), _THIN_SPACE)

    @staticmethod
    def clock(utc_ms: int) -> str:
        """Format a time of day, of 24 hours in every language, in the machine's zone."""
        return datetime.fromtimestamp(utc_ms / 1000).astimezone().strftime("%H:%M:%S")

    def day(self, utc_ms: int) -> str:
        """Format a date, in the machine's zone."""
        there = datetime.fromtimestamp(utc_ms / 1000).astimezone()
        return format_date(there, _day_pattern(self.language), self.language)

    @property
    def decimal_sign(self) -> str:
        """The language's, for a field to type a number in."""
        return get_decimal_symbol(self.language)

    @staticmethod
    def name_of(language: Language) -> str:
        """Return a language's own name for itself."""
        name = babel.Locale.parse(language).get_display_name() or language
        return name[:1].upper() + name[1:]


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
