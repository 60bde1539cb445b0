"""The part of docs/monitoring.md that is made, the alerts from their rules, and where links can lead."""

import re
from pathlib import Path

from .prometheus import alerts_of

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "monitoring.md"
_LABEL = re.compile(r"\{\{\s*(?:humanize\w* )?\$?(?:labels\.)?(\w+)[^}]*\}\}")


def alerts() -> str:
    """Every alert under its own heading."""
    parts = []
    for name, rule in alerts_of().items():
        notes = rule["annotations"]
        severity = rule["labels"]["severity"]
        wait = ", after " + rule["for"] if "for" in rule else ""
        link = notes["runbook"].removeprefix("docs/").replace('{{ reReplaceAll "_" "-" $labels.id }}', "alarms")
        rows = [("cause", notes["cause"]), ("consequence", notes["consequence"]), ("action", notes["action"])]
        rows = [(what, _LABEL.sub(lambda match: f"*{match[1]}*", text)) for what, text in rows]
        table = "".join(f"| {what} | {text} |\n" for what, text in rows)
        severity = "the alarm's own" if "{{" in severity else severity
        more = (
            f"[More]({link})"
            if not link.startswith("monitoring.md")
            else f"[More]({link.removeprefix('monitoring.md')})"
        )
        parts.append(f"### {name}\n\nSeverity: {severity}{wait}. {more}.\n\n|  |  |\n| --- | --- |\n{table}")
    return "\n".join(parts)


def with_part(text: str, name: str, part: str) -> str:
    """A document with one of its made parts renewed.

    Args:
        text: with `<!-- name -->` before and `<!-- /name -->` behind the part.
        name: the part's.
        part: what is to stand there.
    """
    begin, end = f"<!-- {name} -->\n", f"\n<!-- /{name} -->"
    before, found, rest = text.partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise ValueError(f"the document has no part {name}")
    return before + begin + "\n" + part.strip() + "\n" + end + after


def headings(file: Path) -> set[str]:
    """The anchors of a document, as Git hosts make them.

    Args:
        file: in Markdown.
    """
    lines = re.findall(r"^#+ (.*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in lines}
