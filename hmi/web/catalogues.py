"""Message catalogues: extracts the texts from the source, updates and checks each language's `.po` files.

`./run messages` calls it. Extraction, reading and writing are Babel's.
"""

import io
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple, TypeAlias, get_args

from babel.messages.catalog import Catalog, Message
from babel.messages.extract import extract_from_file
from babel.messages.pofile import read_po, write_po

from hmi.recipes.form import field_texts
from hmi.web.folders import FOLDERS, HMI
from hmi.web.translation import SOURCE, forms_of
from station.messages.message import fields
from station.settings.hmi import Language

ROOT = HMI.parent
KEYWORDS = {"define": ((1, "c"), 2), "define_plural": ((1, "c"), 2, 3)}
_ROOMS = ROOT / "station" / "messages"
_HEADER = "Language: {}", "Plural-Forms: {}", "Content-Type: text/plain; charset=utf-8"

Forms: TypeAlias = tuple[str, ...]
"""The English of a text: one form, or that for one and that for other numbers."""


class Finding(NamedTuple):
    """Text of one language, or its whole catalogue, that needs work, and the reason."""

    file: Path
    id: str
    what: str

    def __str__(self) -> str:
        return f"{self.file.relative_to(ROOT)}: {self.id}: {self.what}"


def translated() -> tuple[Language, ...]:
    """Return the languages that have catalogues: all but the source's."""
    return tuple(language for language in get_args(Language) if language != SOURCE)


@cache
def sources() -> Mapping[str, Mapping[str, Forms]]:
    """Return all English texts by their ids, by their catalogue's file, whose `{}` is the language.

    The texts of a recipe's values are the recipe model's own titles and descriptions.
    """
    found = {f"hmi/locale/{{}}/{path.stem}.po": _extracted(path) for path in sorted(_ROOMS.glob("*.py"))}
    found |= {f"hmi/{folder}/{{}}.po": _extracted(HMI / folder / "texts.py") for folder in FOLDERS}
    recipe = field_texts()
    found["hmi/recipes/{}.po"] |= {key: (title,) for key, (title, _) in recipe.items()} | {
        key.replace("recipe_field", "recipe_what"): (what,) for key, (_, what) in recipe.items() if what
    }
    return {file: texts for file, texts in found.items() if texts}


def _extracted(path: Path) -> dict[str, Forms]:
    found: dict[str, Forms] = {}
    for _, english, _, context in extract_from_file("python", path, keywords=KEYWORDS):
        forms = english if isinstance(english, tuple) else (english,)
        if context is not None and any(_is_text(form) for form in forms):
            found[context] = forms
    return found


def _is_text(english: str) -> bool:
    """Return whether there is something to translate beside the values in braces."""
    return any(letter.isalpha() for letter in english.format_map(defaultdict(str)))


def update(language: Language) -> list[Path]:
    """Write a language's catalogues: new texts untranslated, those of a changed English fuzzy; return what changed.

    Texts that the source does not have any more are left out.
    """
    changed = []
    for file, texts in sources().items():
        path = ROOT / file.format(language)
        before = path.read_bytes() if path.exists() else b""
        after = _written(_merged(_entries(path, language), texts, language), language)
        if after != before:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(after)
            changed.append(path)
    for path in _orphans(language):
        path.unlink()
        changed.append(path)
    return changed


def findings(language: Language) -> Iterator[Finding]:
    """Yield what is wrong with a language's translations: missing, left over, to review, or with other braces."""
    for file, texts in sources().items():
        path = ROOT / file.format(language)
        entries = _entries(path, language)
        for key in dict.fromkeys((*texts, *entries)):
            if what := _wrong(texts.get(key), entries.get(key)):
                yield Finding(path, key, what)
    for path in _orphans(language):
        yield Finding(path, "the file", "has no texts in the source any more")


def reworded(language: Language) -> Iterator[Finding]:
    """Yield the texts whose English is not what their translation was made of."""
    for file, texts in sources().items():
        path = ROOT / file.format(language)
        for key, entry in _entries(path, language).items():
            if key in texts and forms_of(entry.id) != texts[key]:
                yield Finding(path, key, f"its English is {texts[key][0]!r} now; run ./run messages, then review it")


def _wrong(english: Forms | None, entry: Message | None) -> str:
    if english is None:
        return "the source does not have it any more"
    forms = forms_of(entry.string) if entry is not None else ()
    if entry is None or not all(forms):
        return "has no translation"
    if entry.fuzzy:
        return "its English was changed: review the translation, and remove `fuzzy`"
    allowed, needed = fields("".join(english)), fields(english[-1])
    if fields(forms[-1]) != needed or not all(fields(form) <= allowed for form in forms):
        return f"has other braces than {sorted(needed)}"
    return ""


def _merged(old: Mapping[str, Message], texts: Mapping[str, Forms], language: Language) -> Catalog:
    catalog = Catalog(locale=language, charset="utf-8", fuzzy=False)
    for key, english in texts.items():
        entry = old.get(key)
        text = english[0] if len(english) == 1 else english
        if entry is None or len(forms_of(entry.id)) != len(english):
            catalog.add(text, context=key)
            continue
        changed = any(forms_of(entry.string)) and forms_of(entry.id) != english
        flags = {*entry.flags, "fuzzy"} if changed else entry.flags
        catalog.add(text, entry.string, context=key, flags=flags, user_comments=entry.user_comments)
    return catalog


def _written(catalog: Catalog, language: Language) -> bytes:
    """Return a catalogue's file: without dates and line numbers, so that it changes with its texts only."""
    header = "".join(f'"{line}\\n"\n' for line in _HEADER).format(language, catalog.plural_forms)
    body = io.BytesIO()
    write_po(body, catalog, width=0, no_location=True, omit_header=True)
    return f'msgid ""\nmsgstr ""\n{header}\n'.encode() + body.getvalue().strip() + b"\n"


def _entries(path: Path, language: Language) -> dict[str, Message]:
    if not path.exists():
        return {}
    with path.open("rb") as file:
        return {entry.context: entry for entry in read_po(file, locale=language) if entry.context}


def _orphans(language: Language) -> list[Path]:
    known = {ROOT / file.format(language) for file in sources()}
    there = (*ROOT.glob(f"hmi/locale/{language}/*.po"), *ROOT.glob(f"hmi/*/{language}.po"))
    return sorted(path for path in there if path not in known)


def main() -> int:
    """Update all catalogues, or with `--check` only compare them; print what a translator has to do."""
    check = sys.argv[1:] == ["--check"]
    found: list[Finding] = []
    for language in translated():
        if check:
            found += reworded(language)
        else:
            for path in update(language):
                print(f"changed: {path.relative_to(ROOT)}")  # noqa: T201
        found += findings(language)
    for each in found:
        print(each)  # noqa: T201
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
