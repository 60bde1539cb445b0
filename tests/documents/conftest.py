"""The documents as their readers have them: pages with links and commands, and a station's home to try commands on."""

import asyncio
import re
import shlex
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
import pytest
from markdown_it import MarkdownIt
from markdown_it.token import Token

from station.inspection.fruit_size import FruitSize
from station.inspection.judge import early_stop, judge
from station.inspection.press import Measured, Press
from station.records.judgement import judgement_measures
from station.records.model import CurvePoint, Image, InspectionRecord, RecipeSnapshot, Trigger
from station.records.records import Records
from station.settings.gripper import GripperCalibration
from station.settings.recipe import find_recipe
from station.settings.records import RecordsSettings
from station.twin.damage import Damage
from station.twin.digit.press import PressOptions, PressSequence, render_press
from station.twin.fruit import draw_fruit
from station.twin.gel import MM_PER_PX
from station.vision.median import median_image
from station.vision.methods import make_method
from station.vision.press import PressTracker

ROOT = Path(__file__).resolve().parents[2]
MARKDOWN = MarkdownIt("commonmark").enable("table")
HTML_LINK = re.compile(r"<(?:img|a)\s[^>]*?(?:src|href)=\"([^\"]+)\"")
TOUCHED_MM = 0.3
"""Closing at which the gripper, which moves in counts, sees the first contact."""
MOST_STEPS = 7
ASSIGNMENT = re.compile(r"[A-Z][A-Z_0-9]*=\S*$")


@dataclass(frozen=True)
class Command:
    """A command that a document instructs its reader to give."""

    page: "Page"
    line: int
    words: tuple[str, ...]
    whole: bool
    """It can be given as it is written; in a sentence its arguments may be left out."""

    def __str__(self) -> str:
        return f"{self.page.name}:{self.line}: {shlex.join(self.words)}"


@dataclass
class ConsoleCommand:
    """One `$` line of a console block, with the expected output and exit code."""

    line: int
    command: str
    expected: list[str]
    code: int


@dataclass(frozen=True)
class Page:
    """A Markdown document."""

    path: Path

    @property
    def name(self) -> str:
        return self.path.relative_to(ROOT).as_posix()

    @cached_property
    def tokens(self) -> list[Token]:
        return MARKDOWN.parse(self.path.read_text(encoding="utf-8"))

    def _inline(self) -> Iterator[tuple[int, Token]]:
        for token in self.tokens:
            for child in token.children or ():
                yield (token.map or [0])[0] + 1, child

    @cached_property
    def links(self) -> list[tuple[int, str]]:
        """Line and target of every link and image."""
        found = [
            (line, str(child.attrGet("href" if child.type == "link_open" else "src")))
            for line, child in self._inline()
            if child.type in {"link_open", "image"}
        ]
        raw = [(token.map[0] + 1, token.content) for token in self.tokens if token.type == "html_block" and token.map]
        raw += [(line, child.content) for line, child in self._inline() if child.type == "html_inline"]
        return found + [(line, target) for line, text in raw for target in HTML_LINK.findall(text)]

    @cached_property
    def anchors(self) -> set[str]:
        """The fragments by which its headings are reached, as GitHub makes them."""
        anchors: set[str] = set()
        for heading, inline in zip(self.tokens, self.tokens[1:], strict=False):
            if heading.type == "heading_open":
                text = "".join(child.content for child in inline.children or ())
                slug = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
                number = 0
                while (anchor := f"{slug}-{number}" if number else slug) in anchors:
                    number += 1
                anchors.add(anchor)
        return anchors

    @cached_property
    def commands(self) -> list[Command]:
        """Every command of the project, in blocks and in sentences."""
        found = []
        for token in self.tokens:
            drawn = "──" in token.content
            if token.type == "fence" and token.info.split(" ")[0] in {"", "sh", "console"} and token.map and not drawn:
                text = re.sub(r"\\\n", "  ", token.content)
                for number, line in enumerate(text.splitlines(), token.map[0] + 2):
                    found += [Command(self, number, words, whole=True) for words in _words(line, token.info)]
        for line, child in self._inline():
            if child.type == "code_inline":
                found += [Command(self, line, words, whole=False) for words in _words(child.content, "")]
        return found

    @cached_property
    def console_commands(self) -> list[ConsoleCommand]:
        """Commands in the page's console blocks with their expected output, in order."""
        found: list[ConsoleCommand] = []
        for token in self.tokens:
            if token.type == "fence" and token.info.startswith("console") and token.map:
                code = int(token.info.partition("exit=")[2] or 0)
                for number, line in enumerate(token.content.splitlines(), token.map[0] + 2):
                    if line.startswith("$ "):
                        found.append(ConsoleCommand(number, line[2:], [], code))
                    else:
                        found[-1].expected.append(line)
        return found


def _words(line: str, info: str) -> list[tuple[str, ...]]:
    """The project's commands on a line of shell; none where it is output, a table or a sentence."""
    if info.startswith("console"):
        if not line.startswith("$ "):
            return []
        line = line[2:]
    try:
        lexer = shlex.shlex(line.replace("$(", " ; "), posix=True, punctuation_chars=True)
        lexer.wordchars += ",=[]{}:@%^+…"
        words = list(lexer)
    except ValueError:
        return []
    parts: list[list[str]] = [[]]
    for word in words:
        if set(word) <= set("&|;()<>"):
            parts.append([])
        elif parts[-1] or not ASSIGNMENT.match(word):
            parts[-1].append(word)
    return [tuple(part) for part in parts if part and (part[0] == "./run" or (part[0] == "station" and len(part) > 1))]


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def pages() -> dict[str, Page]:
    """Every document that a reader may meet, by its path in the repository."""
    found = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return {page.name: page for page in map(Page, found)}


@pytest.fixture(scope="session")
def page() -> Callable[[Path], Page]:
    """Makes a page of a file anywhere."""
    return lambda path: Page(ROOT / path)


@pytest.fixture(scope="session")
def packhouse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The home folder of a station that has inspected strawberries of lot DEMO; every fourth is bruised."""
    home = tmp_path_factory.mktemp("packhouse") / "home"
    home.mkdir()
    asyncio.run(_inspect(home / "records", fruit=12))
    return home


@pytest.fixture
def home(packhouse: Path, tmp_path: Path) -> Path:
    """A copy of it for one document."""
    return shutil.copytree(packhouse, tmp_path / "home")


async def _inspect(folder: Path, fruit: int) -> None:
    """Press simulated fruit, measure and judge them by the shipped recipe, and store them as the service does."""
    cv2.setNumThreads(1)
    recipe = find_recipe("strawberry")
    snapshot = RecipeSnapshot.of(recipe.model_dump(mode="json"), "1")
    records = await Records.open(folder, RecordsSettings(deadline_s=30.0, free_reserve_mb=1), "boot")
    try:
        for number in range(fruit):
            # A little flatter than severe damage, so that one is surely over its limit.
            drawn = draw_fruit("strawberry", 71 + number, bruised=number % 4 == 3, damage=Damage(0.45, 1.7))
            closings_mm = [TOUCHED_MM + step * recipe.steps.step_mm for step in range(MOST_STEPS)]
            shown = render_press(drawn, number, closings_mm, PressOptions(step_s=0.3, references=3))
            length_mm = round(drawn.length_mm)
            press = _pressed(shown, recipe, FruitSize(length_mm))
            verdict = judge(press, recipe)
            deciding = verdict.deciding
            began_ms = 1_782_828_000_000 + number * 9000
            sequence = await records.begin(
                Trigger(number + 1, 0, "DEMO", began_ms, snapshot, simulated=True, fruit_length_mm_x10=10 * length_mm)
            )
            steps = [Image("step", step, shown.frames[step]) for step in range(len(press.points))]
            outcome = await records.conclude(
                sequence,
                InspectionRecord(
                    outcome=verdict.outcome,
                    reasons=() if verdict.outcome == "PASS" else tuple(map(str, verdict.reasons)),
                    explanation=tuple(finding.message for finding in verdict.findings),
                    late=False,
                    partial=verdict.partial,
                    area_mm2=None if deciding is None else deciding.area_mm2,
                    area_px=None if deciding is None else deciding.area_px,
                    closing_mm=None if deciding is None else deciding.closing_mm,
                    confidence=0.9,
                    ended_utc_ms=began_ms + 6000,
                    duration_ms=6000,
                    curve=tuple(
                        CurvePoint(
                            step,
                            shown.widths_mm[step],
                            p.closing_mm,
                            p.area_mm2,
                            p.area_px,
                            p.confidence,
                            changed_area_mm2=p.changed_area_mm2,
                            changed_area_px=p.changed_area_px,
                        )
                        for step, p in enumerate(press.points)
                    ),
                    measures={
                        "onset_mm": press.onset_mm,
                        "onset_uncertainty_mm": press.onset_uncertainty_mm,
                        "scale_uncertainty": press.scale_uncertainty,
                        "gripper_resolution_mm": press.resolution_mm,
                        **judgement_measures(verdict),
                    },
                    images=(Image("reference", None, shown.references[0]), *steps),
                ),
            )
            await records.published(outcome)
            await records.acknowledged(sequence)
        while records.status().images_waiting:
            await asyncio.sleep(0.02)
    finally:
        await records.close()


def _pressed(shown: PressSequence, recipe, size: FruitSize) -> Press:
    """Measure its frames one after the other until the recipe stops the press."""
    method = make_method(median_image(shown.references), recipe.segmentation)
    tracker = PressTracker(method)
    count_mm = GripperCalibration().mm_per_count
    press = Press(shown.widths_mm[0], 0.1, (), size=size, resolution_mm=count_mm, scale_uncertainty=0.0125)
    for closing_mm, frame in zip(np.subtract(shown.closings_mm, TOUCHED_MM), shown.frames, strict=True):
        contact = tracker.measure_step([frame])
        area_mm2, changed_px = contact.area_px * MM_PER_PX**2, contact.changed_area_px
        point = Measured(
            float(closing_mm),
            area_mm2,
            contact.area_px,
            contact.confidence,
            contact.flags,
            None if changed_px is None else changed_px * MM_PER_PX**2,
            changed_px,
        )
        press = replace(press, points=(*press.points, point))
        if early_stop(press, recipe) is not None:
            break
    return press
