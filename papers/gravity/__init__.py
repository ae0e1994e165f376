"""The gravity paper: Lewis and Hannaford 2014, dynamically evaluated gravity compensation."""
