"""Recipes page."""
