"""Recipe state: the revision in force and the state of the file, computed from files and history."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from station.errors import BadInputError
from station.messages import recipes as messages
from station.messages.message import Message, message_of
from station.recipe_store.difference import described_differences
from station.recipe_store.revision import Revision, Status
from station.settings.problems import Problem, SettingsError
from station.settings.recipe_model import Recipe


class FileState(StrEnum):
    """State of a recipe's file, compared with the approved revision."""

    APPROVED = "approved"
    """The same values as the approved revision."""
    DRAFT = "draft"
    """Other values: an unapproved draft."""
    BROKEN = "broken"
    MISSING = "missing"


@dataclass(frozen=True, slots=True)
class Control:
    """Recipe in force, for inspections."""

    recipe: Recipe
    revision: int


@dataclass(frozen=True, slots=True)
class ValidFile:
    """Valid file of the folder."""

    path: Path
    text: str
    recipe: Recipe


@dataclass(frozen=True, slots=True)
class RecipeState:
    """State of one recipe."""

    name: str
    control: Control | None
    """None if no revision is approved."""
    file_state: FileState
    file: ValidFile | None
    """None if it is invalid or missing."""
    submitted: Revision | None
    """The draft that waits for approval, independent of the file's state."""
    note: Message | None
    """Information or instruction for a person; None if the file is the approved revision."""

    @property
    def recipe(self) -> Recipe | None:
        """Return the recipe in force, or else the file's; None if nothing good of it is known."""
        known = self.control or self.file
        return known.recipe if known else None

    @property
    def title(self) -> str:
        """Return its title, or else its name."""
        return self.recipe.title if self.recipe else self.name

    @property
    def valid_file(self) -> ValidFile:
        """Return its file.

        Raises:
            BadInputError: there is none, or it is invalid.
        """
        if self.file is None:
            raise BadInputError(self.note or messages.NO_GOOD_FILE(recipe=self.name))
        return self.file


def recipe_states(
    found: Sequence[ValidFile], broken: Mapping[str, Sequence[Problem]], history: Sequence[Revision]
) -> tuple[RecipeState, ...]:
    """Combine the valid files, of different names, and the history, oldest first, in the order of names.

    Args:
        broken: what is wrong with the other files, by their stems. Any recipe without a good file may be the one of a
            file whose stem is no recipe's name.
    """
    files = {file.recipe.name: file for file in found}
    names = dict.fromkeys(sorted({*files, *(each.name for each in history)}))
    nobodys = [problem for stem, problems in broken.items() if stem not in names for problem in problems]
    return tuple(
        _recipe_state(
            name, files.get(name), [*broken.get(name, ()), *nobodys], [each for each in history if each.name == name]
        )
        for name in names
    )


def _recipe_state(
    name: str, file: ValidFile | None, broken: Sequence[Problem], history: Sequence[Revision]
) -> RecipeState:
    submitted = next((each for each in reversed(history) if each.status is Status.DRAFT), None)
    approved = next((each for each in reversed(history) if each.status is Status.APPROVED), None)
    control, note = None, None
    if approved is not None:
        try:
            control = Control(approved.recipe, approved.revision)
        except SettingsError as error:
            note = messages.NOT_ACCEPTED(recipe=name, revision=approved.revision, why=message_of(error))
    if file is None:
        state = FileState.BROKEN if broken else FileState.MISSING
        note = note or _no_file_note(name, broken, control)
        if state is FileState.MISSING and control is None:
            note = None
    elif control is not None and file.recipe == control.recipe:
        state = FileState.APPROVED
    else:
        state = FileState.DRAFT
        note = note or _draft_note(name, file, control, submitted)
    return RecipeState(name, control, state, file, submitted, note)


def _no_file_note(name: str, broken: Sequence[Problem], control: Control | None) -> Message:
    if not broken:
        return messages.FILE_GONE(recipe=name, stays=_in_force(control))
    problems = [each.message for each in broken]
    return messages.FILE_BROKEN(problems=problems, stays=_in_force(control), recipe=name)


def _draft_note(name: str, file: ValidFile, control: Control | None, submitted: Revision | None) -> Message:
    todo = messages.DO_SUBMIT(recipe=name)
    if submitted is not None and submitted.holds(file.recipe):
        todo = messages.DO_APPROVE(revision=submitted.revision, author=submitted.author)
    told = {"recipe": name, "file": file.path.name, "stays": _in_force(control), "todo": todo}
    if control is None:
        return messages.FILE_IS_DRAFT(**told)
    return messages.FILE_IS_CHANGED(**told, changes=described_differences(control.recipe, file.recipe))


def _in_force(control: Control | None) -> Message:
    return messages.NONE_IN_FORCE() if control is None else messages.STAYS(revision=control.revision)
