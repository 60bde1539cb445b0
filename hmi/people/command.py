"""`station administrator`: the first person who may log in, where the station has no screen of its own."""

from pathlib import Path

import click

from hmi.web.roles import Role
from hmi.web.text import texts
from hmi.web.user_store import FOLDER, UserStore, UserStoreError
from station.by_option import by_option
from station.config_option import config_option
from station.errors import BadInputError
from station.records.audit import AuditEntry, append_audit
from station.records.database import records_folder
from station.records.direct_transaction import direct_transaction
from station.settings.configuration import load_configuration


@click.command()
@click.argument("name")
@by_option
@config_option
def administrator(name: str, by: str, config: Path | None) -> None:
    """Make NAME the first person who may log in, and ask for the PIN.

    For a station without a screen, or in a container. The pages need no restart. Once anybody may log in, an
    administrator adds people on the page People.
    """
    home = load_configuration(config).home
    store = UserStore(home / FOLDER)
    if not store.first_start:
        raise _refusal("people.broken" if store.broken else "people.begun", store.broken)
    pin = click.prompt("PIN", hide_input=True, confirmation_prompt="The same PIN again")
    with direct_transaction(records_folder(home)) as connection:  # nobody without a row, and no row without a person
        entry = AuditEntry(by, "command line", "panel.added", name, new={"role": Role.ADMIN.value})
        append_audit(connection, entry)
        try:
            store.begin(name, pin)
        except UserStoreError as error:
            raise _refusal(error.key, error.detail) from error
    click.echo(f"{name} is the administrator: log in on the page People")


def _refusal(key: str, detail: str) -> BadInputError:
    return BadInputError(texts()[key].english.format(detail=detail))
