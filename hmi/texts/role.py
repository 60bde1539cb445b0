"""Texts of roles."""

from hmi.texts.text import define

define("role.viewer", "Viewer")
define("role.operator", "Operator")
define("role.quality", "Quality")
define("role.maintenance", "Maintenance")
define("role.admin", "Administrator")
