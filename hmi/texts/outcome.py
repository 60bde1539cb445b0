"""Texts of outcomes."""

from hmi.texts.text import define

define("outcome.pass", "Pass")
define("outcome.fail", "Fail")
define("outcome.unjudged", "No result")
