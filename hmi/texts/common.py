"""Texts of several pages."""

from hmi.texts.text import define, define_plural

define("common.older", "Older")
define_plural("common.days", "{n} day", "{n} days", "n")
