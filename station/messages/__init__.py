"""Catalogue of the station's messages, one module for each package. Importing the package defines all of them."""

from importlib import import_module
from pkgutil import iter_modules

for _module in iter_modules(__path__, "station.messages."):
    import_module(_module.name)
