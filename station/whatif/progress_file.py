"""Progress file of a what-if: its results until now, so that it can be interrupted and repeated quickly."""

import json
import os
from collections.abc import Iterable
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any, Self

from station.errors import BadInputError, StationError
from station.messages import whatif as messages
from station.records.stored_message import from_stored, to_stored
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import content_sha256
from station.whatif.replay import Replayed

FILE_NAME = "replayed.jsonl"


class ProgressFile:
    """One draft's results, a line each; the first line identifies the draft. Open it with `with`."""

    def __init__(self, folder: Path, draft: Recipe) -> None:
        self._path = folder / FILE_NAME
        self._header = {
            "draft": draft.name,
            "draft_sha256": content_sha256(draft),
            "fruit-station": version("fruit-station"),
        }
        self.done: dict[int, Replayed] = {}
        """By sequence."""
        self._descriptor = -1

    def __enter__(self) -> Self:
        """Read the stored results.

        Raises:
            BadInputError: the file is of another draft or program, or cannot be written.
        """
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            with open(self._descriptor, "rb", closefd=False) as file:
                content = file.read()
        except OSError as error:
            raise BadInputError(
                messages.OUT_NOT_WRITABLE(folder=str(self._path.parent), words=error.strerror or str(error))
            ) from error
        whole = content[: content.rfind(b"\n") + 1]  # a line that a crash cut short is done again
        lines = whole.splitlines()
        if lines and _parsed(lines[0]) != self._header:
            self.__exit__()
            raise BadInputError(messages.OTHER_DRAFT(folder=str(self._path.parent)))
        # The next line must not join the rest of the one that was cut short.
        os.ftruncate(self._descriptor, len(whole))
        os.lseek(self._descriptor, 0, os.SEEK_END)
        for line in lines[1:]:
            values = _parsed(line)
            if values is not None:
                areas_mm2, why = tuple(values.pop("areas_mm2")), values.pop("why")
                said = from_stored(why) if why else None
                self.done[values["sequence"]] = Replayed(**values, why=said, areas_mm2=areas_mm2)
        if not lines:
            self._append([self._header])
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        os.close(self._descriptor)

    def add(self, results: Iterable[Replayed]) -> None:
        """Append results.

        Raises:
            StationError: they cannot be written; earlier results remain.
        """
        fresh = list(results)
        self._append([{**asdict(each), "why": each.why and to_stored(each.why)} for each in fresh])
        self.done.update((each.sequence, each) for each in fresh)

    def _append(self, values: Iterable[dict[str, Any]]) -> None:
        data = "".join(json.dumps(each, ensure_ascii=False) + "\n" for each in values).encode()
        try:
            while data:
                data = data[os.write(self._descriptor, data) :]
        except OSError as error:
            raise StationError(
                messages.RESULTS_NOT_WRITTEN(path=str(self._path), words=(error.strerror or str(error)).lower())
            ) from error


def _parsed(line: bytes) -> dict[str, Any] | None:
    try:
        values = json.loads(line)
    except ValueError:
        return None
    return values if isinstance(values, dict) else None
