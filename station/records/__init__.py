"""Records of the station: inspections with their curves and images, alarms, events, audit trail."""
