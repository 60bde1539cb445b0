"""Alembic's environment: it runs the migrations on the connection that `station.records.migration` hands over."""

from alembic import context

from station.records.schema import metadata

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=metadata,
    render_as_batch=True,
    transactional_ddl=True,
)
context.run_migrations()
