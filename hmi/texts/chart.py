"""Texts of the charts of recipes and inspections."""

from hmi.texts.text import define, define_plural

define("chart.closing", "closing, mm")
define("chart.area", "contact area, mm²")
define("chart.early", "early stop")
define("chart.limit", "limit")
define("chart.own", "this fruit")
define("chart.passed", "{n} passed")
define("chart.failed", "{n} rejected")
define("chart.no_past", "No fruit was inspected with this recipe yet.")
define("chart.growth", "steepest growth, mm²/mm")
define("chart.width", "width of the fruit, mm")
define("chart.confidence", "confidence at the deciding closing")
define_plural(
    "chart.recipe_label",
    "Area over closing of the last fruit, {failed} rejected, with the recipe's limits",
    "Area over closing of the last {n} fruit, {failed} of them rejected, with the recipe's limits",
    "n",
)
define("chart.fruit_label", "Area over closing of fruit {n} with the limits of its recipe")
