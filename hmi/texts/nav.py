"""Texts of the navigation."""

from hmi.texts.text import define

define("nav.run", "Run")
define("nav.change", "Change fruit")
define("nav.recipes", "Recipes")
define("nav.history", "History")
define("nav.alarms", "Alarms")
define("nav.maintenance", "Maintenance")
define("nav.people", "People")
