"""Outbox: a process that publishes the station's records to other systems and only reads them."""
