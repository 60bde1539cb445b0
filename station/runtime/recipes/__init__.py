"""Recipes in force."""
