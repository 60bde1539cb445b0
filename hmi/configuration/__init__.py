"""Page Configuration, a part of Maintenance."""
