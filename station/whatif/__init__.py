"""What another recipe would have done: stored inspections judged again, and limits proposed from marked fruit."""
