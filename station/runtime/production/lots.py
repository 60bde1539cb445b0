"""Lot manager: the current lot, and the control recipe that is frozen for it."""

import asyncio
import logging

from station.errors import StationError
from station.messages import lots as messages
from station.messages import readiness
from station.messages.message import Message, joined, message_of
from station.records.audit import STATION, AuditEntry
from station.runtime.cycle.service import Service
from station.runtime.observability.audit_logger import PLC, AuditLogger
from station.runtime.recipes.active import ActiveRecipe, ActiveRecipes
from station.state_files import StateFiles
from station.vocabulary import LONGEST_LOT

_NAMED = "named_lot"

log = logging.getLogger(__name__)


class LotManager:
    """Current lot. Its recipe is frozen when it begins: a later approval, edit or retirement affects the next lot.

    The state files store the lot and the name that a person gave: both outlast a restart.
    """

    def __init__(self, service: Service, recipes: ActiveRecipes, audit: AuditLogger, state_files: StateFiles) -> None:
        self._service, self._recipes, self._audit, self._state_files = service, recipes, audit, state_files
        self._turn, self._file = asyncio.Lock(), asyncio.Lock()
        self._storing: asyncio.Task[bool] | None = None
        self.lot: str | None = None
        """The lot under way; None before the first fruit of one."""
        self.named = ""
        """The lot that a person started at the panel, for fruit without a lot of the PLC."""
        self.plc_names = False
        """Whether the PLC named a lot with its last trigger."""
        self.mismatch: Message | None = None
        """Reason why the last lot could not begin: number, name and content of the recipe do not match."""

    def restore(self) -> None:
        """Continue the lot, its name and the recipe of the previous start. Blocks for some milliseconds."""
        named = (self._state_files.read(_NAMED) or b"").decode("ascii", "replace")
        if not named or is_lot_name(named):
            self.named = named
        else:
            log.warning("the lot started at the panel is lost: %s has no lot's name", self._state_files.folder / _NAMED)
        remembered = self._recipes.restored()
        if remembered is None:
            return
        try:
            self._service.pacing.check(remembered.active.recipe)
        except StationError as error:
            self.mismatch = messages.NAMELESS_REFUSED(why=message_of(error))
            log.warning("%s", self.mismatch)
            return
        active, self.lot = remembered
        self._service.set_active(active)

    async def choose(self, active: ActiveRecipe) -> bool:
        """Set the recipe of the next lot, and return whether it is stored; a lot under way continues with its own."""
        self.mismatch = None
        self._service.set_active(active)
        return await self._store()

    def no_recipe(self) -> Message:
        """Return why no recipe is active, and how one is chosen."""
        numbers = ", ".join(map(str, self._recipes.numbers))
        choose = readiness.NO_RECIPE(numbers=numbers) if numbers else readiness.NO_RECIPE_AT_ALL()
        return choose if self.mismatch is None else joined((self.mismatch, choose))

    def lot_of(self, named_by_plc: str) -> str:
        """Return the lot of a fruit, for which the PLC's name may be empty."""
        self.plc_names = bool(named_by_plc)
        return named_by_plc or self.named

    async def set_lot(self, lot: str) -> bool:
        """Start a lot for a person, or end it by an empty name, and return whether that is stored.

        The next fruit freezes the recipe in force again.
        """
        self.named, self.lot = lot, None
        return await self._store()

    async def begin(self, lot: str) -> bool:
        """Begin a fruit of the PLC's lot. The first fruit of another lot freezes the active recipe's revision in force.

        Returns:
            Whether it may be inspected; if not, `mismatch` is the reason.
        """
        async with self._turn:
            active = self._service.active
            if active is None or lot == self.lot:
                return active is not None
            try:
                now = self._recipes.current(active)
                self._service.pacing.check(now.recipe)
            except StationError as error:
                why = message_of(error)
                self.mismatch = messages.REFUSED(lot=lot, why=why) if lot else messages.NAMELESS_REFUSED(why=why)
                self._service.set_active(None)
                self.lot = None
                log.warning("%s", self.mismatch)
                self._audit.log(
                    AuditEntry(STATION, STATION, "lot.refused", f"lot {lot}", "", _audited(active), {"why": str(error)})
                )
                return False
            before, self.lot, self.mismatch = self.lot, lot, None
            self._service.set_active(now)
            if now.snapshot != active.snapshot:
                log.info("lot %s begins with revision %s of %s", lot, now.snapshot.revision, now.recipe.name)
            self._audit.log(
                AuditEntry(
                    PLC, PLC, "lot.started", f"lot {lot}", "", {"lot": before, **_audited(active)}, _audited(now)
                )
            )
            await self._store()
            return True

    async def _store(self) -> bool:
        """Store the active recipe, the lot and its name for the next start, and return whether they are stored."""
        # A write that outlasts its order is not left behind, or it could replace the next order's.
        self._storing = asyncio.create_task(self._store_last())
        return await asyncio.shield(self._storing)

    async def _store_last(self) -> bool:
        """Make them durable; the last order's are what the file has at the end."""
        async with self._file:
            return await asyncio.to_thread(self._write, self.named, self._service.active, self.lot)

    def _write(self, named: str, active: ActiveRecipe | None, lot: str | None) -> bool:
        stored = self._state_files.write(_NAMED, named.encode())
        return (active is None or self._recipes.store_active(active, lot)) and stored


def is_lot_name(text: str) -> bool:
    """Check that a person may start a lot with this name: the PLC could give it too."""
    return bool(text.strip()) and len(text) <= LONGEST_LOT and text.isascii() and text.isprintable()


def _audited(active: ActiveRecipe) -> dict[str, str | int]:
    snapshot = active.snapshot
    return {
        "recipe": snapshot.name,
        "number": snapshot.number,
        "revision": snapshot.revision,
        "sha256": snapshot.sha256,
    }
