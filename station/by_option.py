"""Option `--by` of every command that writes a row of the audit trail."""

import getpass

import click

by_option = click.option(
    "--by", metavar="WHO", default=getpass.getuser, help="Who does it, for the audit trail. [default: your login]"
)
