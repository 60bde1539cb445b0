"""Draft evaluation (what-if): stored inspections judged by another recipe, and limits proposed from marked fruit."""
