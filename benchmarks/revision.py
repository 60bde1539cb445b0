"""Revision that is measured, and an earlier one, checked out beside it for a comparison in the same run."""

import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def commit() -> str:
    """Return the commit that is measured, with a `+` where its code was changed; empty outside a repository."""
    git = ["git", "-C", str(ROOT)]
    head = subprocess.run([*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    code = ("*.py", "*.yaml", "*.lock")  # not the pages, which benchmarks write
    changed = subprocess.run([*git, "diff", "--quiet", "HEAD", "--", *code], capture_output=True, check=False)
    return head.stdout.strip() + "+" * (changed.returncode == 1)


@contextmanager
def checked_out(revision: str) -> Iterator[Path]:
    """Check a revision out into a folder of its own, and remove it afterwards.

    Args:
        revision: as Git names it.

    Raises:
        subprocess.CalledProcessError: there is no such revision.
    """
    git = ["git", "-C", str(ROOT), "worktree"]
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        images = ROOT.parent / "shared"
        if images.exists():  # where the benchmarks of real images have them, beside a checkout
            (tree.parent / images.name).symlink_to(images)
        subprocess.run([*git, "add", "--quiet", "--detach", str(tree), revision], check=True)
        try:
            yield tree
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=True)
