"""Production: commands of PLC and operator, lots, readiness."""
