"""Records of the station: inspections with their curves and images, alarms, counters, events, audit trail."""
