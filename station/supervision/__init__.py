"""The station's processes: started, watched, restarted within a budget, and ended in order."""
