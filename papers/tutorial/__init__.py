"""The tutorial on mass and gravity: a two-link arm."""
