"""Commands that show a robot's model: as pictures, as formulas."""
