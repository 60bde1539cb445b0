"""Installed files outside the releases: units, rules, users, folders, the command."""

import hashlib
import shutil
from pathlib import Path

from installer.layout import NAME, Layout, read_note, write_note
from installer.messages import print_progress
from installer.programs import own

PLACES = {
    "systemd": "/etc/systemd/system",
    "sysusers.d": "/etc/sysusers.d",
    "tmpfiles.d": "/etc/tmpfiles.d",
    "udev": "/etc/udev/rules.d",
    "command": "/usr/local/bin",
    "settings": f"/etc/{NAME}",
}
"""Folders of a release's `deploy`, and where their files go."""
FROM_DEPLOY = {
    "station.schema.json": f"/etc/{NAME}/station.schema.json",
    "station.yaml": f"/etc/{NAME}/station.example.yaml",
}
SAVED = ".saved"


def wanted(release: Path) -> dict[str, Path]:
    """Return the files of a release by their installed paths."""
    deploy = release / "deploy"
    found = {
        f"{place}/{file.name}": file
        for folder, place in PLACES.items()
        for file in sorted((deploy / folder).glob("*"))
        if file.is_file()
    }
    return found | {path: deploy / name for name, path in FROM_DEPLOY.items()}


def put(layout: Layout, release: Path) -> None:
    """Install a release's files, and remove those of another release. Idempotent.

    A file that a person has changed is retained as `NAME.saved`; use drop-ins for changes.
    """
    known = dict(read_note(layout.manifest).get("files", {}))
    files = wanted(release)
    for path in known.keys() - files.keys():
        _remove_file(layout, path, known.pop(path))
    for path, source in files.items():
        file, content = layout.place(path), source.read_bytes()
        _keep_changed(file, known.get(path), content)
        make_folder(layout, file.parent)
        # Noted first: a file that is put and not noted would outlive an uninstall.
        known[path] = hashlib.sha256(content).hexdigest()
        write_note(layout.manifest, {**read_note(layout.manifest), "files": known})
        new = file.with_name(f".{file.name}.new")
        shutil.copyfile(source, new)
        new.chmod(0o755 if source.stat().st_mode & 0o100 else 0o644)
        new.replace(file)


def make_folders(layout: Layout, shipped: Path) -> None:
    """Create the folders of configuration, state and backups; a missing configuration with the shipped recipes."""
    for path, user in ((layout.settings, "root"), (layout.home, NAME), (layout.backups, NAME)):
        make_place(layout, path, user)
    if not layout.configuration.exists():
        _make_recipes(layout, shipped)
        text = (layout.settings / "station.example.yaml").read_text(encoding="utf-8")
        named = text.replace("# recipes_folder: null", f'recipes_folder: "{layout.recipes}"')
        layout.configuration.write_text(named, encoding="utf-8")
        print_progress(f"{layout.configuration}: the site's own from now on; all but its recipes is commented out")
    layout.configuration.chmod(0o640)
    own(layout, layout.configuration, "root", NAME)


def make_place(layout: Layout, folder: Path, user: str) -> None:
    """Create a folder of a user, which the station's group may read."""
    make_folder(layout, folder)
    folder.chmod(0o750)
    own(layout, folder, user, NAME)


def _make_recipes(layout: Layout, shipped: Path) -> None:
    """Copy the shipped recipes to where the station's pages can edit them; those that are there stay."""
    layout.recipes.mkdir(exist_ok=True)
    for source in sorted(shipped.glob("*.yaml")):
        if not (file := layout.recipes / source.name).exists():
            shutil.copyfile(source, file)
            file.chmod(0o640)
            own(layout, file, NAME, NAME)
    layout.recipes.chmod(0o750)
    own(layout, layout.recipes, NAME, NAME)


def make_folder(layout: Layout, folder: Path) -> None:
    """Create a folder below the layout's root with its parents, and note the new ones."""
    missing = [path for path in (folder, *folder.parents) if path.is_relative_to(layout.root) and not path.exists()]
    if not missing:
        return
    layout.program.mkdir(parents=True, exist_ok=True)
    note = read_note(layout.manifest)
    known = note.get("folders", [])
    known += [name for path in missing if (name := f"/{path.relative_to(layout.root)}") not in known]
    write_note(layout.manifest, {**note, "folders": known})
    folder.mkdir(parents=True, exist_ok=True)


def remove_files(layout: Layout) -> None:
    """Remove every installed file."""
    note = read_note(layout.manifest)
    for path, digest in note.get("files", {}).items():
        _remove_file(layout, path, digest)


def remove_folders(layout: Layout, folders: list[str]) -> None:
    """Remove created folders, as in the manifest, that are empty."""
    for path in sorted(set(folders), key=len, reverse=True):
        folder = layout.place(path)
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


def _keep_changed(file: Path, digest: str | None, content: bytes) -> None:
    """Rename a file that a person has changed, or that existed before the first installation."""
    if not file.is_file():
        return
    there = file.read_bytes()
    if there != content and hashlib.sha256(there).hexdigest() != digest:
        saved = file.with_name(file.name + SAVED)
        file.replace(saved)
        print_progress(f"{file} was changed by hand: kept as {saved}; put your changes into a drop-in (systemctl edit)")


def _remove_file(layout: Layout, path: str, digest: str) -> None:
    file = layout.place(path)
    _keep_changed(file, digest, b"")
    file.unlink(missing_ok=True)
