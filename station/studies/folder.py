"""Study folder: each sample is stored atomically as soon as it is measured."""

import hashlib
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError

import station
from station.atomic_file import write_atomically
from station.errors import BadInputError, StationError
from station.studies.sample import SampleResult, Task, segmentation_of

_DRAWN_BY = (
    "studies/cohort.py",
    "studies/sample.py",
    "studies/paper_samples.csv",
    *(
        f"twin/{name}"
        for name in ("contact.py", "damage.py", "fruit.py", "gel.py", "squeeze.py", "texture.py", "digit")
    ),
)
_MEASURED_BY = {
    "paper": tuple(
        f"vision/{name}"
        for name in ("paper.py", "methods.py", "median.py", "contact.py", "working.py", "step.py", "press.py")
    ),
    "robust": ("vision",),
}
"""Code that decides a sample's numbers, relative to the package."""


class Identity(BaseModel):
    """Common properties of a study's samples; samples of different studies are never mixed."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    fruit: str
    method: str
    seed: int
    measured_by: str
    """A hash over the parameters and the code that draws and measures a sample."""


def identity_of(task: Task) -> Identity:
    """Return the identity of the study that a sample belongs to."""
    root = Path(station.__file__).parent
    digest = hashlib.sha256(segmentation_of(task.fruit, task.method).model_dump_json().encode())
    for name in (*_DRAWN_BY, *_MEASURED_BY[task.method]):
        place = root / name
        files = [place] if place.is_file() else sorted(f for f in place.iterdir() if f.suffix in {".py", ".npz"})
        for file in files:
            digest.update(file.read_bytes())
    return Identity(fruit=task.fruit, method=task.method, seed=task.seed, measured_by=digest.hexdigest()[:16])


class StudyFolder:
    """The folder `DIR` of `station study`."""

    def __init__(self, folder: Path, identity: Identity) -> None:
        """Open or make the folder of a study: an empty or new one, or this study's own.

        Raises:
            BadInputError: it holds something else, is no folder, or cannot be written.
        """
        self.folder = folder
        self._identity = identity
        self._samples = folder / "samples"
        label = folder / "study.json"
        try:
            if label.exists():
                self._check(label)
            elif folder.exists() and any(folder.iterdir()):
                raise BadInputError(f"{folder}: is not empty and holds no study; name a new folder with --out")
            self._samples.mkdir(parents=True, exist_ok=True)
            if not label.exists():
                write_atomically(label, (identity.model_dump_json(indent=2) + "\n").encode())
        except OSError as error:
            raise BadInputError(
                f"{folder}: cannot be written: {error.strerror}; name another folder with --out"
            ) from error

    def _check(self, label: Path) -> None:
        try:
            there = Identity.model_validate_json(label.read_bytes())
        except ValidationError as error:
            raise BadInputError(f"{label}: is not a study's; name a new folder with --out") from error
        theirs, ours = there.model_dump(), self._identity.model_dump()
        differing = [name for name, value in ours.items() if theirs[name] != value]
        if differing == ["measured_by"]:
            raise BadInputError(
                f"{self.folder}: holds the same study measured by another version of the program or the recipe; "
                "its samples cannot be mixed with new ones: name a new folder with --out"
            )
        if differing:
            differing = [name for name in differing if name != "measured_by"]  # a hash, which is of no use to a person
            words = ", ".join(f"{name} {theirs[name]} in place of {ours[name]}" for name in differing)
            raise BadInputError(f"{self.folder}: holds another study ({words}); name a new folder with --out")

    def stored(self, number: int) -> SampleResult | None:
        """Read a sample by its number, from 1; None if it is missing or cannot be read: it is then measured again."""
        try:
            found = SampleResult.model_validate_json(self._place(number).read_bytes())
        except (OSError, ValidationError):
            return None
        return found if found.number == number else None

    def store(self, sample: SampleResult) -> None:
        """Store a sample.

        Raises:
            StationError: the disk is full or the folder has become unwritable; no half-written file remains.
        """
        self.write(f"samples/{self._place(sample.number).name}", sample.model_dump_json().encode())

    def write(self, name: str, data: bytes) -> None:
        """Write a file atomically at a path below the folder.

        Raises:
            StationError: as for `store`.
        """
        path = self.folder / name
        try:
            write_atomically(path, data)
        except OSError as error:
            raise StationError(
                f"{path}: cannot be written: {error.strerror}; what was measured by then is kept: free space or mend "
                "the folder, then give the same command again"
            ) from error

    def _place(self, number: int) -> Path:
        return self._samples / f"{number:05d}.json"
