"""Page Set-up, a part of Maintenance."""
