"""Recipe history in the records' database: each change is one transaction with its audit entry."""

from dataclasses import asdict, replace
from typing import Any, NamedTuple

from sqlalchemy import Connection, func, insert, select, update

from station.clock import utc_ms
from station.messages import recipes as messages
from station.recipe_store.revision import STATUS, ConflictError, Origin, RecipeStoreError, Revision, Status
from station.records.audit import AuditEntry, append_audit
from station.records.schema import recipe_revisions
from station.settings.recipe_model import Recipe
from station.settings.recipe_versions import content_sha256


class Person(NamedTuple):
    """Person who changes a recipe, and the reason."""

    who: str
    role: str
    reason: str


def read_revisions(connection: Connection, name: str = "") -> list[Revision]:
    """Read the revisions of a recipe, or of all, by name, oldest first."""
    query = select(recipe_revisions).order_by(recipe_revisions.c.name, recipe_revisions.c.revision)
    if name:
        query = query.where(recipe_revisions.c.name == name)
    rows = [dict[str, Any](row) for row in connection.execute(query).mappings()]
    return [Revision(**(row | {"status": Status(row["status"]), "origin": Origin(row["origin"])})) for row in rows]


def submit(connection: Connection, text: str, recipe: Recipe, person: Person) -> Revision:
    """Store a recipe's file as a draft for another person to approve. Idempotent for the same content and author.

    Raises:
        RecipeStoreError: it is approved already, or another person's draft waits.
    """
    known = read_revisions(connection, recipe.name)
    approved, draft = _with(known, Status.APPROVED), _with(known, Status.DRAFT)
    if approved is not None and approved.holds(recipe):
        raise RecipeStoreError(messages.SAME(recipe=recipe.name, revision=approved.revision))
    if draft is not None and draft.holds(recipe) and draft.author == person.who:
        return draft
    if draft is not None and draft.author != person.who:
        told = {"recipe": recipe.name, "revision": draft.revision, "author": draft.author}
        raise ConflictError(messages.ANOTHER_WAITS_DIFFERS(**told, changes=draft.changes_to(recipe)))
    if draft is not None:
        _retire(connection, draft, person, f"replaced by its author's next draft: {person.reason}")
    made = _new(known, text, recipe, Origin.SUBMITTED, person)
    _insert(connection, made)
    before = None if approved is None else _audited(approved)
    _note(connection, person, "recipe.submitted", made, before, {**_audited(made), "text": text})
    return made


def approve(connection: Connection, wanted: Revision, file: Recipe | None, person: Person) -> Revision:
    """Put a draft in force from the next lot on; the revision approved before is retired.

    Args:
        wanted: the draft, as the approver has seen it.
        file: the recipe's file now; None if it is invalid.

    Raises:
        RecipeStoreError: it is no draft any more, or the approver's own, or its PLC number is another recipe's.
        ConflictError: the file was changed since the draft was submitted.
    """
    place = {"recipe": wanted.name, "revision": wanted.revision}
    known = read_revisions(connection, wanted.name)
    draft = next((each for each in known if each.revision == wanted.revision), None)
    if draft is None or draft.status is not Status.DRAFT:
        status = messages.MISSING() if draft is None else STATUS[draft.status]()
        raise ConflictError(messages.NOT_WAITING(**place, status=status))
    if draft.author.casefold().split() == person.who.casefold().split():
        raise RecipeStoreError(messages.OWN(**place, author=draft.author))
    if file is None:
        raise ConflictError(messages.FILE_UNREADABLE(**place))
    if not draft.holds(file):
        raise ConflictError(messages.FILE_DIFFERS(**place, changes=draft.changes_to(file)))
    for other in read_revisions(connection):
        if other.status is Status.APPROVED and other.name != draft.name and other.number == draft.number:
            raise RecipeStoreError(messages.NUMBER_TAKEN(**place, number=draft.number, other=other.name))
    before = _with(known, Status.APPROVED)
    if before is not None:
        _retire(connection, before, person, f"revision {draft.revision} took its place: {person.reason}", told=False)
    made = replace(
        draft,
        status=Status.APPROVED,
        approver=person.who,
        approval_reason=person.reason,
        approved_utc_ms=utc_ms(),
    )
    _update(connection, made)
    changes = str(before.changes_to(file)) if before else "the first revision"
    old = None if before is None else _audited(before)
    _note(connection, person, "recipe.approved", made, old, {**_audited(made), "changes": changes})
    return made


def retire(connection: Connection, wanted: Revision, person: Person) -> Revision:
    """Take a revision out of use: a draft is rejected; no lot begins with an approved one any more.

    Raises:
        RecipeStoreError: it is retired already.
    """
    now = next(each for each in read_revisions(connection, wanted.name) if each.revision == wanted.revision)
    if now.status is Status.RETIRED:
        raise RecipeStoreError(messages.RETIRED_ALREADY(recipe=now.name, revision=now.revision))
    return _retire(connection, now, person, person.reason)


def store_approved(
    connection: Connection, text: str, recipe: Recipe, origin: Origin, who: str, reason: str
) -> Revision:
    """Store a recipe that is approved by its origin, in place of the revision approved before; within a transaction.

    Args:
        origin: shipped or adopted.
        who: the distribution, or the station.
        reason: why it counts as approved.
    """
    known, person = read_revisions(connection, recipe.name), Person(who, "station", reason)
    before = _with(known, Status.APPROVED)
    if before is not None:
        _retire(connection, before, person, f"replaced: {reason}", told=False)
    made = replace(
        _new(known, text, recipe, origin, person),
        status=Status.APPROVED,
        approval_reason=reason,
        approved_utc_ms=utc_ms(),
    )
    _insert(connection, made)
    old = None if before is None else _audited(before)
    _note(connection, person, f"recipe.{origin}", made, old, {**_audited(made), "text": text})
    return made


def _with(known: list[Revision], status: Status) -> Revision | None:
    return next((each for each in reversed(known) if each.status is status), None)


def _new(known: list[Revision], text: str, recipe: Recipe, origin: Origin, person: Person) -> Revision:
    approved = _with(known, Status.APPROVED)
    return Revision(
        name=recipe.name,
        revision=known[-1].revision + 1 if known else 1,
        number=recipe.plc_number,
        sha256=content_sha256(recipe),
        text=text,
        status=Status.DRAFT,
        origin=origin,
        based_on=None if approved is None else approved.revision,
        author=person.who,
        reason=person.reason,
        created_utc_ms=utc_ms(),
    )


def _retire(connection: Connection, now: Revision, person: Person, reason: str, *, told: bool = True) -> Revision:
    made = replace(now, status=Status.RETIRED, retired_by=person.who, retired_reason=reason, retired_utc_ms=utc_ms())
    _update(connection, made)
    if told:
        _note(connection, person, "recipe.retired", made, _audited(now), _audited(made))
    return made


def _insert(connection: Connection, made: Revision) -> None:
    latest = connection.scalar(
        select(func.max(recipe_revisions.c.revision)).where(recipe_revisions.c.name == made.name)
    )
    if latest is not None and latest >= made.revision:
        raise ConflictError(messages.RECORDED_MEANWHILE(recipe=made.name, revision=latest))
    connection.execute(insert(recipe_revisions).values(asdict(made)))


def _update(connection: Connection, made: Revision) -> None:
    table = recipe_revisions.c
    connection.execute(
        update(recipe_revisions).where(table.name == made.name, table.revision == made.revision).values(asdict(made))
    )


def _note(connection: Connection, person: Person, action: str, of: Revision, old: Any, new: Any) -> None:
    subject = f"recipe {of.name} revision {of.revision}"
    append_audit(connection, AuditEntry(person.who, person.role, action, subject, person.reason, old, new))


def _audited(revision: Revision) -> dict[str, Any]:
    return {"revision": revision.revision, "status": str(revision.status), "sha256": revision.sha256}
