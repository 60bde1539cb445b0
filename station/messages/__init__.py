"""Everything the station can say; one module for each room that says it. Importing the package defines all of it."""

from importlib import import_module
from pkgutil import iter_modules

for _room in iter_modules(__path__, "station.messages."):
    import_module(_room.name)
