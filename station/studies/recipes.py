"""Shipped recipes, as a study uses them."""

from functools import cache

from station.settings.recipe import find_recipe
from station.settings.recipe_model import Recipe


@cache
def shipped_recipe(fruit: str) -> Recipe:
    """Return a fruit's shipped recipe; read once, as a study judges thousands of presses by it.

    Raises:
        BadInputError: there is none; the message lists the existing ones.
    """
    return find_recipe(fruit)
