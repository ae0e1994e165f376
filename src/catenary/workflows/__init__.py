"""What people do with the package: parts assembled, one file per job."""
