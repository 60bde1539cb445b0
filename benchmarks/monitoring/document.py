"""The part of docs/monitoring.md that is made, the alerts from their rules, and where links can lead."""

import re
from pathlib import Path

from .prometheus import shipped_alerts

DOCUMENT = Path(__file__).resolve().parents[2] / "docs" / "monitoring.md"
_LABEL = re.compile(r"\{\{\s*(?:humanize\w* )?\$?(?:labels\.)?(\w+)[^}]*\}\}")


def alerts() -> str:
    """The table of alerts; consequence and action come with the alert itself."""
    lines = ["| alert | severity, after | cause |", "| --- | --- | --- |"]
    for name, rule in shipped_alerts().items():
        notes = rule["annotations"]
        severity = rule["labels"]["severity"]
        severity = "the alarm's own" if "{{" in severity else severity
        wait = ", " + rule["for"] if "for" in rule else ""
        link = notes["runbook"].removeprefix("docs/").replace('{{ reReplaceAll "_" "-" $labels.id }}', "alarms")
        cause = _LABEL.sub(lambda match: f"*{match[1]}*", notes["cause"])
        lines.append(f"| [{name}]({link.removeprefix('monitoring.md')}) | {severity}{wait} | {cause} |")
    return "\n".join(lines)


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
