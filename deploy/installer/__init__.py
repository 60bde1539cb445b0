"""The installer: standard library only, as it runs before there is anything else."""
