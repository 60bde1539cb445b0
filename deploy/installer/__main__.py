"""The installer's command line: `deploy/install --help`."""

import argparse
import contextlib
import fcntl
import os
import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from installer import preflight, rollback
from installer.installation import Installation
from installer.layout import Layout
from installer.messages import Failed, Refused, print_progress
from installer.release import Packages, Source
from installer.services import ScratchRoot, Services, Systemd
from installer.uninstall import installed, uninstall


def main(arguments: list[str] | None = None) -> int:
    """Run the command: exit code 0 when done, 2 when refused, 1 when it failed."""
    chosen = _parser().parse_args(arguments)
    os.umask(0o022)  # the station's user has to read what root makes
    layout = Layout(chosen.root.resolve())
    services: Services = Systemd(layout) if layout.is_system else ScratchRoot(layout)
    try:
        with _alone(layout):
            _act(chosen, layout, services)
    except Refused as refusal:
        print_progress(f"refused, and nothing was changed: {refusal}")
        return 2
    except (Failed, OSError) as error:
        print_progress(f"failed: {error}")
        return 1
    except KeyboardInterrupt:
        print_progress("interrupted: run it again, it goes on from here")
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="deploy/install",
        description="Install the fruit-inspection station on Debian 12, or upgrade the one installed. May be run again "
        "at any time, also after an interruption.",
    )
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--rollback", action="store_true", help="roll the last upgrade back")
    what.add_argument("--undo", action="store_true", help="stop the station and take it away; its data are kept")
    parser.add_argument(
        "--purge", action="store_true", help="with --undo: remove configuration, records, copies and user too"
    )
    parser.add_argument("--dry-run", action="store_true", help="say what would be done, and do nothing")
    parser.add_argument("--during-lot", action="store_true", help="upgrade or roll back though a lot is under way")
    parser.add_argument(
        "--root", type=Path, default=Path("/"), metavar="DIR", help="a scratch root; nothing is started"
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--wheels", type=Path, metavar="DIR", help="take the packages from a folder of wheels: no internet needed"
    )
    where.add_argument(
        "--environment", type=Path, metavar="VENV", help="borrow the packages of a virtual environment, for development"
    )
    return parser


def _act(chosen: argparse.Namespace, layout: Layout, services: Services) -> None:
    if chosen.purge and not chosen.undo:
        raise Refused("--purge goes with --undo")
    if chosen.undo:
        preflight.check_machine(layout)
        if chosen.dry_run:
            kept = "" if chosen.purge else "; configuration, records, copies and user are kept"
            print_progress(f"would stop the station and take away what was installed{kept}")
        else:
            uninstall(layout, services, purge=chosen.purge)
        return
    if chosen.rollback:
        _roll_back(chosen, layout, services)
        return
    source = Source(Path(__file__).resolve().parents[2])
    source.check()
    packages = Packages(*(path.resolve() if path else None for path in (chosen.wheels, chosen.environment)))
    installation = Installation(layout, services, source, packages)
    installation.check(during_lot=chosen.during_lot)
    if chosen.dry_run:
        for step in installation.steps():
            print_progress(f"would {step.sentence}")
        return
    installation.run()
    print_progress(f"{installation.release.name} is installed; configure it in {layout.configuration}")


def _roll_back(chosen: argparse.Namespace, layout: Layout, services: Services) -> None:
    preflight.check_machine(layout)
    rollback.check(layout)
    if not chosen.during_lot:
        preflight.check_no_lot(layout, layout.current)
    if chosen.dry_run:
        print_progress(f"would go back to {layout.previous.resolve().name}")
    else:
        rollback.roll_back(layout, services)


@contextlib.contextmanager
def _alone(layout: Layout) -> Iterator[None]:
    """Exclude a second installer; before the first installation there is nothing to protect."""
    if not installed(layout):
        yield
        return
    folder = os.open(layout.program, os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError as error:
        raise Refused("another installer is at work: wait until it has ended") from error
    finally:
        os.close(folder)


if __name__ == "__main__":
    raise SystemExit(main())
