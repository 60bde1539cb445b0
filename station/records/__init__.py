"""What happened, for ever: inspections with their curves and images, alarms, counters and events."""
