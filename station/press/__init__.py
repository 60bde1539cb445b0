"""Press: reference, approach, contact, compression steps and release, the same for every rig."""
