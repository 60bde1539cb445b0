"""Installer: standard library only, because it runs before any package is installed."""
