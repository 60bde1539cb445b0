"""Requests of the PLC interface and of the HMI."""
