"""Metrics, health and audit."""
